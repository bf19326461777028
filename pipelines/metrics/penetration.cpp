#include "pipelines/metrics/penetration.h"

#include <algorithm>
#include <optional>

#include "core/check.h"
#include "core/parallel.h"
#include "optim/metrics.h"
#include "optim/motion_start.h"

namespace hsi4d {
namespace {

constexpr Index kVertexGrain = 64;

Vector3<double> point_at(std::span<const double> points, Index p) { return Vector3<double>(points.data() + 3 * p); }

/// @param distance_at  of point p, metres; NaN or above 0: free
template <class F>
Penetration counted(Index count, const F& distance_at) {
  std::vector<double> distances(static_cast<std::size_t>(count));
  parallel_for(count, kVertexGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) distances[static_cast<std::size_t>(i)] = distance_at(i);
  });
  Penetration counts{.points = count};
  for (const double distance : distances) {
    if (!(distance < 0)) continue;  // free, or not known
    ++counts.inside;
    counts.depth -= distance;
  }
  return counts;
}

/// Distances of points that move from frame to frame. A point that has gone less far than it was from anything solid is
/// still free: most are, and only the others are looked at.
class FollowedPoints {
 public:
  FollowedPoints(const MeshDistance& surface, std::size_t count) : surface_(surface), free_(count) {}

  /// Of point p; where it cannot be below 0 maybe an older one. Several threads may ask for different points.
  double distance_of(Index p, const Vector3<double>& place) {
    FreeBall& ball = free_[static_cast<std::size_t>(p)];
    if ((place - ball.center).norm() < ball.radius) return ball.radius;
    const double distance = surface_.at(place);
    ball = {place, distance > 0 ? surface_.free_radius(distance) : 0};
    return distance;
  }

 private:
  /// Nothing solid is in it.
  struct FreeBall {
    Vector3<double> center = Vector3<double>::Zero();
    double radius = 0;
  };

  const MeshDistance& surface_;
  std::vector<FreeBall> free_;
};

MetricValues values_of(const Penetration& counts, const std::string& before) {
  const double share = counts.points > 0 ? static_cast<double>(counts.inside) / static_cast<double>(counts.points) : 0;
  const double depth = counts.inside > 0 ? counts.depth / static_cast<double>(counts.inside) : 0;
  return {{before + "penetration_share", share}, {before + "penetration_depth_mm", kMillimetres * depth}};
}

}  // namespace

std::vector<double> posed_gaussians(const Avatar& avatar, const BodyPose& pose, std::span<const Index> rows) {
  MotionStart motion;
  motion.avatar = &avatar;
  motion.first_body = pose_skeleton(avatar, pose);
  std::vector<double> points;
  for (const Index row : rows) {
    const Vector3<double> place = motion.place(BodyPoint{kFirstFrame, row});
    points.insert(points.end(), place.data(), place.data() + 3);
  }
  return points;
}

std::vector<double> measured_points(const Avatar& avatar, const BodyPose& pose) {
  const Index all = avatar.weights.vertices, count = std::min(kMeasuredPoints, all);
  std::vector<Index> rows;
  for (Index i = 0; i < count; ++i) rows.push_back(i * all / count);
  return posed_gaussians(avatar, pose, rows);
}

Penetration penetration_of(const SignedDistance& distance, std::span<const double> points) {
  return counted(std::ssize(points) / 3, [&](Index i) { return distance(point_at(points, i)); });
}

Penetration penetration_of(const std::vector<SignedDistance>& distances,
                           std::span<const Rigid<double>> world_from_object, std::span<const double> points) {
  HSI4D_CHECK_EQ(distances.size(), world_from_object.size());
  return counted(std::ssize(points) / 3, [&](Index i) {
    double least = 0;
    for (std::size_t o = 0; o < distances.size(); ++o) {
      if (!distances[o]) continue;
      const double distance = distances[o](transform_point(inverse(world_from_object[o]), point_at(points, i)));
      if (distance < least) least = distance;
    }
    return least;
  });
}

std::vector<Penetration> penetration_by_frame(const Clip& clip, const std::vector<SceneState>& states) {
  HSI4D_CHECK(clip.surface != nullptr, "the clip has no surface");
  std::vector<Penetration> by_frame;
  std::optional<FollowedPoints> followed;
  for (const SceneState& state : states) {
    const std::vector<double> points = measured_points(clip.avatar, state.body);
    if (!followed) followed.emplace(*clip.surface, points.size() / 3);
    by_frame.push_back(
        counted(std::ssize(points) / 3, [&](Index p) { return followed->distance_of(p, point_at(points, p)); }));
  }
  return by_frame;
}

MetricValues penetration_values(const Penetration& counts) { return values_of(counts, ""); }

MetricValues object_penetration_values(const Penetration& counts) { return values_of(counts, "object_"); }

Penetration sum_after_first(const std::vector<Penetration>& by_frame) {
  Penetration sum;
  for (std::size_t t = 1; t < by_frame.size(); ++t) {
    sum.points += by_frame[t].points;
    sum.inside += by_frame[t].inside;
    sum.depth += by_frame[t].depth;
  }
  return sum;
}

MetricValues mean_penetration(const std::vector<Penetration>& by_frame) {
  return penetration_values(sum_after_first(by_frame));
}

}  // namespace hsi4d
