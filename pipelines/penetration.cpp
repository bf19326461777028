#include "pipelines/penetration.h"

#include <algorithm>

#include "core/check.h"
#include "core/parallel.h"
#include "optim/motion_start.h"

namespace hsi4d {
namespace {

constexpr Index kGrain = 64;
constexpr double kMillimetres = 1000;

Penetration penetration_of(const MeshDistance& surface, const MotionStart& motion) {
  const Index rows = motion.avatar->weights.vertices, count = std::min(kMeasuredPoints, rows);
  std::vector<double> distances(static_cast<std::size_t>(count));
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      distances[static_cast<std::size_t>(i)] = surface.at(motion.place(BodyPoint{kFirstFrame, i * rows / count}));
  });
  Penetration counts{.points = count};
  for (const double distance : distances) {
    if (!(distance < 0)) continue;  // free, or not known
    ++counts.inside;
    counts.depth -= distance;
  }
  return counts;
}

}  // namespace

std::vector<Penetration> penetration_by_frame(const Clip& clip, const std::vector<SceneState>& states) {
  HSI4D_CHECK(clip.surface != nullptr, "the clip has no surface");
  std::vector<Penetration> by_frame;
  for (const SceneState& state : states) {
    MotionStart motion;
    motion.avatar = &clip.avatar;
    motion.first_body = pose_skeleton(clip.avatar, state.body);
    by_frame.push_back(penetration_of(*clip.surface, motion));
  }
  return by_frame;
}

MetricValues penetration_values(const Penetration& counts) {
  const double share = counts.points > 0 ? static_cast<double>(counts.inside) / static_cast<double>(counts.points) : 0;
  const double depth = counts.inside > 0 ? counts.depth / static_cast<double>(counts.inside) : 0;
  return {{"penetration_share", share}, {"penetration_depth_mm", kMillimetres * depth}};
}

MetricValues mean_penetration(const std::vector<Penetration>& by_frame) {
  Penetration sum;
  for (std::size_t t = 1; t < by_frame.size(); ++t) {
    sum.points += by_frame[t].points;
    sum.inside += by_frame[t].inside;
    sum.depth += by_frame[t].depth;
  }
  return penetration_values(sum);
}

}  // namespace hsi4d
