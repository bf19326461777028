// L = mean over the frames that move of Σ over wrists w that hold an object between frame t and the next of
// s² d²/(s² + d²), m², d = |w_{t+1} − A_t w_t|, A_t the object's motion between the two: hands do not move on what they
// hold. Beyond `scale`, s, there is hardly a pull, for hands let go. A hand holds an object that a joint of it was
// nearer than `distance` to, in one of the two frames, when the stage began; of several the nearest.
//
// With w⁰ and A⁰, of rotation R⁰, as they were then, and p the place to which the object carries w_t⁰,
//
//   w_{t+1} − A_t w_t = w_{t+1} − p − R_t (w_t − w_t⁰)
//
// in which R⁰ stands for R: exact where frame t or the object stands still, one of which does in every stage. Which
// hands hold what, and R⁰, have no gradient.
#include <algorithm>
#include <array>
#include <optional>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "autodiff/tape_rows.h"
#include "body/skinning.h"
#include "core/rigid.h"
#include "optim/losses/list.h"
#include "optim/losses/robust.h"
#include "optim/metrics.h"
#include "optim/object_centres.h"

namespace hsi4d {

namespace {

struct GripSettings {
  double distance = kContactDistance;  // metres
  double scale = 0.03;                 // metres
};

void describe(ConfigFields& fields, GripSettings& settings) {
  fields.number("distance", settings.distance, {.above = 0, .max = 10},
                "A hand holds an object that it is nearer to than this at the stage's start, metres");
  fields.number("scale", settings.scale, {.above = 0, .max = 10},
                "A hand that moves farther than this on the object between two frames is hardly pulled, metres");
}

/// The object that each hand is near to, by frame from the first one on; none: −1.
using Touched = std::vector<std::array<Index, kWristJoints.size()>>;

Touched touched_objects(const MotionStart& motion, Index first, double distance) {
  const ObjectCentres centres(motion.objects);
  Touched touched;
  for (Index t = first; t < motion.frames(); ++t) {
    auto& objects = touched.emplace_back();
    objects.fill(-1);
    std::array<double, kWristJoints.size()> within;
    within.fill(distance);
    const std::vector<double>& joints = motion.body_in(t).joints;
    for (Index j = 0; 3 * j < std::ssize(joints); ++j) {
      const std::optional<std::size_t> hand = hand_of_joint(j);
      if (!hand) continue;
      const auto nearest = centres.nearest(Vector3<double>(joints.data() + 3 * j),
                                           motion.world_from_object[static_cast<std::size_t>(t)], within[*hand]);
      if (!nearest) continue;
      objects[*hand] = nearest->object;
      within[*hand] = nearest->distance;
    }
  }
  return touched;
}

/// Wrists that hold an object between a frame and the next.
struct Grips {
  std::vector<std::uint32_t> before, after;  // rows of [22F,3] joints
  std::vector<ObjectPoint> carried;          // by the object, from where the wrist was before
  std::vector<double> turns, starts;         // [.,12] R⁰, and [.,3] w⁰ before
};

void add_grip(const MotionStart& motion, Index frame, Index joint, Index object, Grips& grips) {
  const auto pose = [&](Index t) {
    return motion.world_from_object[static_cast<std::size_t>(t)][static_cast<std::size_t>(object)];
  };
  const Vector3<double> start(motion.body_in(frame).joints.data() + 3 * joint);
  const Vector3<double> first =
      Vector3<float>(motion.objects[static_cast<std::size_t>(object)]->means.data()).cast<double>();
  const Matrix3<double> turn = pose(frame + 1).rotation * pose(frame).rotation.transpose();
  grips.before.push_back(static_cast<std::uint32_t>(frame * kMetricJoints + joint));
  grips.after.push_back(static_cast<std::uint32_t>((frame + 1) * kMetricJoints + joint));
  grips.carried.push_back({frame + 1, object, 0, transform_point(inverse(pose(frame)), start) - first});
  for (Index r = 0; r < 3; ++r) grips.turns.insert(grips.turns.end(), {turn(r, 0), turn(r, 1), turn(r, 2), 0});
  grips.starts.insert(grips.starts.end(), start.data(), start.data() + 3);
}

Grips grips_of(const MotionStart& motion, double distance) {
  const Index first = std::max<Index>(0, motion.still_frames - 1);  // that is followed by one that moves
  const Touched touched = touched_objects(motion, first, distance);
  Grips grips;
  for (std::size_t i = 0; i + 1 < touched.size(); ++i) {
    for (std::size_t hand = 0; hand < kWristJoints.size(); ++hand) {
      const Index object = touched[i][hand] >= 0 ? touched[i][hand] : touched[i + 1][hand];
      if (object >= 0) add_grip(motion, first + static_cast<Index>(i), kWristJoints[hand], object, grips);
    }
  }
  return grips;
}

LossNote note_of(const Grips& grips, const MotionStart& motion) {
  const bool is_idle = grips.before.empty();
  const std::string frames = std::to_string(motion.moving_frames()) + " frames";
  return {"grip",
          is_idle ? "no hand holds an object in any of " + frames
                  : std::to_string(grips.before.size()) + " grips of hands in " + frames,
          is_idle};
}

template <class S>
Var<S> grip(const LossInputs<S>& in, const GripSettings& settings) {
  if (!in.gives(LossInput::kObjectMotion)) return {};
  const MotionStart& motion = *in.motion;
  const Grips grips = grips_of(motion, settings.distance);
  if (in.notes != nullptr) in.notes->push_back(note_of(grips, motion));
  if (grips.before.empty()) return sum(in.joints) * 0.0;  // depends on what the term does, and moves nothing
  Tape<S>& tape = in.joints.owner();
  const Var<S> joints = reshape(in.joints, motion.frames() * kMetricJoints, 3);
  const Var<S> change = gather_rows(joints, grips.before) - constant_rows(tape, "wrists", grips.starts, 3);
  const Var<S> d = gather_rows(joints, grips.after) - in.object_points(grips.carried) -
                   transform_points(constant_rows(tape, "object_turns", grips.turns, 12), change);
  const auto limit = static_cast<float>(settings.scale * settings.scale);
  return sum_over({slice_cols(d, 0, 1), slice_cols(d, 1, 1), slice_cols(d, 2, 1)},
                  [limit](auto x, auto y, auto z) { return geman_mcclure(x * x + y * y + z * z, limit); }) *
         (1 / static_cast<double>(motion.moving_frames()));
}

}  // namespace

LossTerm grip_loss() {
  return needing(
      {LossInput::kObjectMotion},
      make_loss_term<GripSettings>("grip", "How far hands move on the objects that they hold",
                                   [](const auto& in, const GripSettings& settings) { return grip(in, settings); }));
}

}  // namespace hsi4d
