#include "pipelines/run/hidden_tracker.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace hsi4d {

HiddenTracker::HiddenTracker(const RunConfig& config, const Clip& clip, std::vector<std::vector<double>>& seen,
                             std::function<void(const std::string&)> note)
    : config_(config), clip_(clip), seen_(seen), note_(std::move(note)) {}

bool HiddenTracker::is_on() const { return config_.start.objects == StartFrom::kBest && !clip_.objects.empty(); }

std::vector<double> HiddenTracker::all_seen() const { return std::vector(clip_.objects.size(), 1.0); }

bool HiddenTracker::is_hidden(Index frame, std::size_t object) const {
  return !clip_.objects[object].joint && frame < std::ssize(seen_) &&
         seen_[static_cast<std::size_t>(frame)][object] < kHiddenBelow;
}

/// The last frame before that shows the object; the first one does.
Index HiddenTracker::last_seen(Index before, std::size_t object) const {
  Index last = before - 1;
  while (last > 0 && is_hidden(last, object)) --last;
  return last;
}

/// The states of frames up to `last` that show the object.
std::vector<const SceneState*> HiddenTracker::frames_with(std::size_t object, Index last,
                                                          const std::vector<SceneState>& states) const {
  std::vector<const SceneState*> shown;
  for (Index t = 0; t <= last; ++t) {
    if (!is_hidden(t, object)) shown.push_back(&states[static_cast<std::size_t>(t)]);
  }
  return shown;
}

void HiddenTracker::start_hidden(Index index, const ClipFrame& frame, const std::vector<SceneState>& done,
                                 const ColorState& colors, SceneState& state) {
  seen_.push_back(seen_shares(clip_, frame, config_.data.mask_threshold, state));
  for (std::size_t o = 0; o < clip_.objects.size(); ++o) {
    if (!is_hidden(index - 1, o) && !is_hidden(index, o)) continue;
    const Index last = last_seen(index, o);
    const SceneState& shown = done[static_cast<std::size_t>(last)];
    const Carrier carrier = carrier_of(clip_, o, frames_with(o, last, done));
    SceneState carried = state;
    carried.objects[o] = carried_pose(clip_, carrier, o, shown, state);
    double& share = seen_.back()[o];
    if (share == 0 && is_shown_at(config_, clip_, o, frame, state, colors))  // its mask is missing
      share = drawn_share(clip_, picture_of_state(config_, clip_, state, colors), o, state);
    const std::string text = "frame " + std::to_string(index) + ": " + clip_.objects[o].name;
    if (is_hidden(index, o)) {
      state = carried;
      note_(text + " is hidden, and " + carrier_text(clip_, carrier));
    } else if (is_hidden(index - 1, o)) {
      const FoundObject found = find_object(config_, clip_, o, frame, carried, shown, colors);
      state.objects[o] = found.pose;
      note_(text + " is seen again, " + found.from);
    }
  }
}

void HiddenTracker::carry_hidden(Index index, const std::vector<SceneState>& known, SceneState& state) const {
  for (std::size_t o = 0; is_on() && o < clip_.objects.size(); ++o) {
    if (!is_hidden(index, o)) continue;
    const Index last = last_seen(index, o);
    const Carrier carrier = carrier_of(clip_, o, frames_with(o, last, known));
    const Index from = std::ssize(known) > index ? index : last;
    const SceneState& shown = known[static_cast<std::size_t>(from)];
    state.objects[o] = carried_pose(clip_, carrier, o, shown, state);
    if (!state.lights.empty()) state.lights[o] = light_of(shown, o);
  }
}

void HiddenTracker::look_for_lost(At at, const ClipFrame& frame, const std::vector<SceneState>& known,
                                  const SceneState& before, const ColorState& colors, SceneState& state) const {
  const StatePicture picture = picture_of_state(config_, clip_, state, colors);
  for (std::size_t o = 0; o < clip_.objects.size(); ++o) {
    const std::optional<double> iou = object_iou(picture, frame, o);
    if (clip_.objects[o].joint || is_hidden(at.frame, o) || !iou || *iou >= kDoubtfulIou) continue;
    FoundObject found = find_object(config_, clip_, o, frame, state, before, colors);
    state.objects[o] = found.pose;
    std::string text = "frame " + std::to_string(at.frame) + ", pass " + std::to_string(at.pass) + ": " +
                       clip_.objects[o].name + " is looked for, by frame " + std::to_string(at.frame - 1) + ": " +
                       found.from;
    Index next = at.frame + 1;
    while (next < clip_.frames() && is_hidden(next, o)) ++next;
    if (next < clip_.frames()) {
      found = find_object(config_, clip_, o, frame, state, known[static_cast<std::size_t>(next)], colors);
      state.objects[o] = found.pose;
      text += ", by frame " + std::to_string(next) + ": " + found.from;
    }
    note_(text);
  }
}

bool HiddenTracker::is_where_shown(std::size_t object, Index frame, const SceneState& state,
                                   const ColorState& colors) const {
  constexpr double kFirmIou = 0.8;
  const std::optional<double> iou =
      object_iou(picture_of_state(config_, clip_, state, colors), read_frame(clip_, frame), object);
  return !iou || *iou >= kFirmIou;
}

HiddenGap HiddenTracker::gap_around(std::size_t object, Index least, Index last, Index next, const ColorState& colors,
                                    const std::vector<SceneState>& states) const {
  constexpr Index kMostDoubtful = 4;  // frames at an end
  const auto is_firm = [&](Index t) { return is_where_shown(object, t, states[static_cast<std::size_t>(t)], colors); };
  const Index first = std::max(least, last - kMostDoubtful),
              final = std::min<Index>(clip_.frames() - 1, next + kMostDoubtful);
  while (last > first && !is_hidden(last - 1, object) && !is_firm(last)) --last;
  while (next < final && !is_hidden(next + 1, object) && !is_firm(next)) ++next;
  return {object, static_cast<std::size_t>(last), static_cast<std::size_t>(next)};
}

void HiddenTracker::lay_hidden(const ColorState& colors, const std::vector<PlaceSigmas>& sigmas,
                               std::vector<SceneState>& states) const {
  for (std::size_t o = 0; is_on() && o < clip_.objects.size(); ++o) {
    const auto contradicted = [&](std::size_t t, const SceneState& state) {
      const double drawn = drawn_share(clip_, picture_of_state(config_, clip_, state, colors), o, state);
      return drawn >= seen_[t][o] + kHiddenBelow;
    };
    Index least = 0;
    for (Index t = 1; t < clip_.frames(); ++t) {
      const Index last = last_seen(t, o);
      if (is_hidden(t, o) || last == t - 1) continue;
      const HiddenGap gap = gap_around(o, least, last, t, colors, states);
      least = static_cast<Index>(gap.end);
      const Carrier carrier = carrier_of(clip_, o, frames_with(o, static_cast<Index>(gap.begin), states));
      const std::string text = lay_gap(clip_, carrier, gap, contradicted, sigmas, states);
      if (!text.empty()) note_(text);
    }
  }
}

}  // namespace hsi4d
