// How much of the body is inside of what is solid.
#pragma once

#include <span>
#include <vector>

#include "body/avatar.h"
#include "core/rigid.h"
#include "pipelines/input/clip.h"
#include "pipelines/metrics/metric_facts.h"
#include "pipelines/metrics/solid.h"

namespace hsi4d {

/// Gaussians of the human that are looked at in a frame, evenly chosen; all where there are fewer.
inline constexpr Index kMeasuredPoints = 4000;

/// Counts of one frame, or of several together.
struct Penetration {
  Index points = 0, inside = 0;
  double depth = 0;  ///< sum over those inside, metres
};

/// Some Gaussians of the human in a pose, [P,3] metres, world.
std::vector<double> posed_gaussians(const Avatar& avatar, const BodyPose& pose, std::span<const Index> rows);

/// The chosen Gaussians of the human in a pose, [P,3] metres, world.
std::vector<double> measured_points(const Avatar& avatar, const BodyPose& pose);

/// Points where the signed distance is below 0, and how deep they are. What is not known counts as free.
/// @param points  [P,3] metres, in the frame of `distance`
Penetration penetration_of(const SignedDistance& distance, std::span<const double> points);

/// The same by several objects that move: a point counts once, as deep as in the one where it is deepest.
///
///   d(x) = min_o d_o(T_o⁻¹ x)
///
/// @param distances          of each object, in its own frame; an empty one is passed over
/// @param world_from_object  T_o
Penetration penetration_of(const std::vector<SignedDistance>& distances,
                           std::span<const Rigid<double>> world_from_object, std::span<const double> points);

/// By the mesh of data.surface, the human's Gaussians in each state. Throws InternalError when the clip has no surface.
std::vector<Penetration> penetration_by_frame(const Clip& clip, const std::vector<SceneState>& states);

/// penetration_share, and penetration_depth_mm: of those inside, the mean; 0 where there are none.
MetricValues penetration_values(const Penetration& counts);

/// The same by objects: object_penetration_share, object_penetration_depth_mm.
MetricValues object_penetration_values(const Penetration& counts);

/// The counts of frames 1 to T together.
Penetration sum_after_first(const std::vector<Penetration>& by_frame);

/// penetration_values of them.
MetricValues mean_penetration(const std::vector<Penetration>& by_frame);

}  // namespace hsi4d
