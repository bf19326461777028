// Metrics of a person and what they hold together, as CHORE, VisTracker and those after them measure them on BEHAVE and
// InterCap: both are laid on the truth in one piece, and then compared as surfaces.
// [Xie et al. 2022, CHORE; Xie et al. 2023, VisTracker; their public evaluation]
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// Frames that are laid on the truth together; 1: each by itself, as CHORE does.
inline constexpr Index kAlignedFrames = 300;

/// Points that are drawn from each surface in each frame.
inline constexpr Index kSurfacePoints = 10000;

/// Mean distance to the nearest point of the other side, of both sides together:
///
///   1/|A| Σ_{a ∈ A} min_{b ∈ B} |a − b| + 1/|B| Σ_{b ∈ B} min_{a ∈ A} |a − b|
///
/// @param a, b  [N,3], [M,3] metres
/// @return      metres; not finite where a point is not
/// Throws InternalError where a side has no points.
double chamfer_distance(std::span<const double> a, std::span<const double> b);

using Triangles = std::vector<std::array<std::int32_t, 3>>;

/// Points of a person and of all that they move, in T frames: those of the same place in estimate and truth are the
/// same point of the body or the object.
struct HumanObjectMotion {
  std::vector<std::vector<double>> human = {}, object = {};  ///< [T][V,3], [T][P,3] metres
};

/// The surfaces that these are the vertices of. Without triangles the points are compared as they are.
struct HumanObjectSurfaces {
  Triangles human = {}, object = {};
};

/// What is measured. Centimetres; accelerations a frame².
struct HumanObjectErrors {
  double cd_human = 0, cd_object = 0, cd_both = 0;
  std::optional<double> acceleration_human = {}, acceleration_object = {};  ///< nothing for fewer than three frames
};

/// Lays pieces of `window` frames of the estimate on the truth, each by the similarity that fits the points of human
/// and object of all its frames best; then
///
///   cd            the mean over frames of chamfer_distance, of kSurfacePoints drawn from each surface, or of the
///   points
///                 as they are; `both`: of human and object as one set
///   acceleration  the mean over frames of 1/P Σ_p |(p̂_{t+1} − 2 p̂_t + p̂_{t−1}) − (p_{t+1} − 2 p_t + p_{t−1})|, a
///                 piece's own mean in each of its frames; pieces of fewer than three frames have none
///
/// Points of estimate and truth are drawn apart, so that what is equal has not 0 but how far drawn points are apart.
///
/// Throws InternalError where sizes differ, a side has no points, no frame, or `window` is less than 1; and as
/// surface_points.
HumanObjectErrors human_object_errors(const HumanObjectMotion& estimate, const HumanObjectMotion& truth,
                                      const HumanObjectSurfaces& surfaces, Index window = kAlignedFrames);

}  // namespace hsi4d
