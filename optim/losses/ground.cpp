// L = mean over the frames that move of (z̄_t − z̄_0)², m²: the lower foot stays on the ground. z̄_t is the mean height of
// the `points` Gaussians of the feet that were lowest in frame t when the stage began, z̄_0 that of the first frame.
//
// From one view depth is the least certain direction, and a body that is a little too far away also seems to float.
// For clips in which a foot is always down, on level ground. With `level_within` L is 0 in all frames where the clip's
// estimate has the lower foot go up and down further than that: who climbs would be held down, as a square is stronger
// than what a picture of a small person says.   [beyond the paper: method.md, §8]
#include <algorithm>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/text.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct GroundSettings {
  Index points = 20;
  double level_within = 0;  // metres; 0: any
};

void describe(ConfigFields& fields, GroundSettings& settings) {
  fields.integer("points", settings.points, {.min = 1, .max = 10000},
                 "Lowest Gaussians of the feet whose mean height counts");
  fields.number("level_within", settings.level_within, {.min = 0, .max = 100},
                "The term counts where the lower foot goes up and down by at most this much in the estimated poses of "
                "the clip, metres; 0: always");
}

/// Whether the estimate says that the ground is not level.
bool is_not_level(const MotionStart& motion, const GroundSettings& settings) {
  return settings.level_within > 0 && motion.foot_range.value_or(0) > settings.level_within;
}

std::string not_level_text(const MotionStart& motion, const GroundSettings& settings) {
  return "the lower foot goes up and down by " + rounded(*motion.foot_range, 2) +
         " m in the estimated poses, and level_within is " + rounded(settings.level_within, 2) + " m";
}

/// The lowest of the rows in a frame, and their mean height.
struct LowestPoints {
  std::vector<BodyPoint> points;
  double height = 0;  // metres
};

LowestPoints lowest_points(const MotionStart& motion, const std::vector<Index>& rows, Index frame, Index count) {
  std::vector<std::pair<double, Index>> heights;
  for (const Index row : rows) heights.emplace_back(motion.place(BodyPoint{frame, row})[2], row);
  const auto end = heights.begin() + std::min(count, std::ssize(heights));
  std::partial_sort(heights.begin(), end, heights.end());
  LowestPoints lowest;
  for (auto at = heights.begin(); at != end; ++at) {
    lowest.points.push_back({frame, at->second});
    lowest.height += at->first / static_cast<double>(end - heights.begin());
  }
  return lowest;
}

}  // namespace

LossTerm ground_loss() {
  return needing({LossInput::kMotion},
                 make_loss_term<GroundSettings>(
                     "ground", "How far the lower foot is above or below where the ground was in the first frame",
                     [](const auto& in, const GroundSettings& settings) {
                       using Value = decltype(in.joints);
                       const MotionStart& motion = *in.motion;
                       const std::vector<Index> feet = rows_of_joints(motion.avatar->weights, is_foot_joint);
                       if (feet.empty()) return Value{};
                       if (is_not_level(motion, settings)) {
                         if (in.notes != nullptr)
                           in.notes->push_back({"ground", not_level_text(motion, settings), true, true});
                         return sum(in.joints) * 0.0;  // depends on what the term does, and moves nothing
                       }
                       const Index count = std::min(settings.points, std::ssize(feet));
                       std::vector<BodyPoint> points;
                       for (Index t = motion.still_frames; t < motion.frames(); ++t) {
                         const LowestPoints lowest = lowest_points(motion, feet, t, count);
                         points.insert(points.end(), lowest.points.begin(), lowest.points.end());
                       }
                       const Value heights =
                           reshape(slice_cols(in.body_points(points), 2, 1), motion.moving_frames(), count);
                       const double ground = lowest_points(motion, feet, kFirstFrame, count).height;
                       return mean(square(sum_cols(heights) * (1 / static_cast<double>(count)) - ground));
                     }));
}

}  // namespace hsi4d
