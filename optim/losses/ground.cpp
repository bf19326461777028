// L = mean over the frames that move of ρ((z̄_t − z̄_0)²), m²: the lower foot stays on the ground. z̄_t is the mean
// height of the `points` Gaussians of the feet that were lowest in frame t when the stage began, z̄_0 that of the first
// frame.   ρ: squared d²; huber and geman_mcclure of robust.h.
//
// From one view depth is the least certain direction, and a body that is a little too far away also seems to float.
// With ρ = d² for clips in which a foot is always down, on level ground; geman_mcclure lets go of who climbs.
// [beyond the paper: method.md, §8]
#include <algorithm>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "optim/losses/list.h"
#include "optim/losses/robust.h"

namespace hsi4d {

namespace {

struct GroundSettings {
  Index points = 20;
  RobustKernel kernel = RobustKernel::kNone;
  double scale = 0.1;  // metres
};

void describe(ConfigFields& fields, GroundSettings& settings) {
  fields.integer("points", settings.points, {.min = 1, .max = 10000},
                 "Lowest Gaussians of the feet whose mean height counts");
  fields.choice("kernel", settings.kernel, kSquareKernels,
                "Of the change of height: its square; huber, constant pull beyond scale; geman_mcclure, by which a "
                "person far beyond scale, who climbs or jumps, is let go");
  fields.number("scale", settings.scale, {.above = 0, .max = 10},
                "Change of height up to which a kernel is nearly the square, metres");
  fields.rule({"scale", "kernel"}, [&settings] {
    return idle_scale_text(settings.kernel, settings.scale, GroundSettings().scale, "squared");
  });
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
                       const Index count = std::min(settings.points, std::ssize(feet));
                       std::vector<BodyPoint> points;
                       for (Index t = motion.still_frames; t < motion.frames(); ++t) {
                         const LowestPoints lowest = lowest_points(motion, feet, t, count);
                         points.insert(points.end(), lowest.points.begin(), lowest.points.end());
                       }
                       const Value heights =
                           reshape(slice_cols(in.body_points(points), 2, 1), motion.moving_frames(), count);
                       const double ground = lowest_points(motion, feet, kFirstFrame, count).height;
                       const Value rises = sum_cols(heights) * (1 / static_cast<double>(count)) - ground;
                       if (settings.kernel == RobustKernel::kNone) return mean(square(rises));
                       const auto term = [kernel = settings.kernel, scale = static_cast<float>(settings.scale)](
                                             auto rise) { return robust(square(rise), kernel, scale); };
                       return sum_over({rises}, term) * (1 / static_cast<double>(motion.moving_frames()));
                     }));
}

}  // namespace hsi4d
