#include "pipelines/run/hidden_path.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "core/rigid.h"
#include "core/rotation.h"
#include "optim/motion_start.h"

namespace hsi4d {

namespace {

/// A carrier, from one end of a gap to the last frame that does not speak against it.
struct Carried {
  Carrier carrier;
  std::size_t from = 0, last = 0;
};

/// Between two poses, evenly; share 0: the first.
Rigid<double> between(const Rigid<double>& from, const Rigid<double>& to, double share) {
  const Vector3<double> turn = so3_log(Matrix3<double>(from.rotation.transpose() * to.rotation));
  return {from.rotation * so3_exp(Vector3<double>(share * turn)),
          (1 - share) * from.translation + share * to.translation};
}

/// The frame nearer to `to` by one.
std::size_t next_to(std::size_t frame, std::size_t to) { return frame < to ? frame + 1 : frame - 1; }

/// Of the hands that touch the object at an end of the gap the one whose wrist images know better while it is hidden;
/// none where they tell of none.
std::optional<Carrier> known_hand(const Clip& clip, const HiddenGap& gap, std::size_t person,
                                  const std::vector<PlaceSigmas>& sigmas, const std::vector<SceneState>& states) {
  const std::array<bool, 2> before = touching_hands(clip, gap.object, person, states[gap.begin]),
                            after = touching_hands(clip, gap.object, person, states[gap.end]);
  std::optional<Carrier> best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t hand = 0; hand < kWristJoints.size(); ++hand) {
    if (!before[hand] && !after[hand]) continue;
    double sum = 0;
    for (std::size_t t = gap.begin + 1; t < gap.end; ++t) {
      const std::vector<PlaceSigma>& joints = person == 0 ? sigmas[t].joints : sigmas[t].others.at(person - 1);
      sum += joints.at(static_cast<std::size_t>(kWristJoints[hand])).across;
    }
    if (!(sum < least)) continue;  // one that is not known in some frame is infinite, or not a number
    least = sum;
    best = Carrier{kWristJoints[hand], person, true};
  }
  return best;
}

/// How far a hand gets into a gap from one of its ends.
Carried carried_from(const Clip& clip, const Carrier& hand, std::size_t object, std::size_t from, std::size_t to,
                     const Contradicted& contradicted, const std::vector<SceneState>& states) {
  Carried carried{hand, from, from};
  for (std::size_t t = next_to(from, to); t != to; t = next_to(t, to)) {
    SceneState state = states[t];
    state.objects[object] = carried_pose(clip, hand, object, states[from], state);
    if (contradicted(t, state)) break;
    carried.last = t;
  }
  return carried;
}

/// Where a hand that does not carry it all the way has it lowest: there it is put down, or taken.
std::size_t lowest(const Clip& clip, const Carried& carried, std::size_t object,
                   const std::vector<SceneState>& states) {
  const auto height = [&](std::size_t t) {
    return carried_pose(clip, carried.carrier, object, states[carried.from], states[t]).translation[2];
  };
  std::size_t best = carried.from;
  double least = height(best);
  for (std::size_t t = best; t != carried.last;) {
    t = next_to(t, carried.last);
    const double now = height(t);
    if (now >= least) continue;
    least = now;
    best = t;
  }
  return best;
}

/// From both ends as far as they get, and evenly between.
void lay_carried(const Clip& clip, const Carried& before, const Carried& after, std::size_t object,
                 std::vector<SceneState>& states) {
  const auto pose_in = [&](const Carried& carried, std::size_t t) {
    return rigid_of(carried_pose(clip, carried.carrier, object, states[carried.from], states[t]));
  };
  const auto low = static_cast<double>(std::min(before.last, after.last)),
             high = static_cast<double>(std::max(before.last, after.last));
  const bool overlap = before.last > after.last;  // both carry it there
  std::vector<ObjectPose> poses;
  for (std::size_t t = before.from + 1; t < after.from; ++t) {
    const double share = high > low ? std::clamp((static_cast<double>(t) - low) / (high - low), 0.0, 1.0)
                                    : (static_cast<double>(t) > low ? 1.0 : 0.0);
    poses.push_back(pose_of(between(pose_in(before, overlap ? t : std::min(t, before.last)),
                                    pose_in(after, overlap ? t : std::max(t, after.last)), share)));
  }
  for (std::size_t i = 0; i < poses.size(); ++i) states[before.from + 1 + i].objects[object] = poses[i];
}

}  // namespace

void lay_between(const Clip& clip, const Carrier& carrier, std::size_t object, std::size_t begin, std::size_t end,
                 std::vector<SceneState>& states) {
  lay_carried(clip, {carrier, begin, end}, {carrier, end, begin}, object, states);
}

std::string lay_gap(const Clip& clip, const Carrier& carrier, const HiddenGap& gap, const Contradicted& contradicted,
                    const std::vector<PlaceSigmas>& sigmas, std::vector<SceneState>& states) {
  lay_between(clip, carrier, gap.object, gap.begin, gap.end, states);
  if (!carrier.joint || sigmas.empty()) return "";
  bool is_wrong = false;
  for (std::size_t t = gap.begin + 1; t < gap.end; ++t) is_wrong = is_wrong || contradicted(t, states[t]);
  if (!is_wrong) return "";
  const std::string text = "frames " + std::to_string(gap.begin + 1) + " to " + std::to_string(gap.end - 1) +
                           ": more of " + clip.objects[gap.object].name + " would show than does; it ";
  const std::string stays = carrier_text(clip, carrier) + " all the same, as no hand that is known goes elsewhere";
  const std::optional<Carrier> hand = known_hand(clip, gap, carrier.person, sigmas, states);
  if (!hand) return text + stays;
  Carried before = carried_from(clip, *hand, gap.object, gap.begin, gap.end, contradicted, states),
          after = carried_from(clip, *hand, gap.object, gap.end, gap.begin, contradicted, states);
  if (before.last == gap.begin && after.last == gap.end) return text + stays;
  const bool is_carried = before.last + 1 >= after.last;
  if (!is_carried) {
    before.last = lowest(clip, before, gap.object, states);
    after.last = lowest(clip, after, gap.object, states);
  }
  lay_carried(clip, before, after, gap.object, states);
  return text + carrier_text(clip, *hand) +
         (is_carried ? ""
                     : ", is put down in frame " + std::to_string(before.last) + " and taken in frame " +
                           std::to_string(after.last));
}

}  // namespace hsi4d
