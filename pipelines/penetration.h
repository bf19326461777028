// How much of the body is inside of what is solid, by the mesh of data.surface.
#pragma once

#include <vector>

#include "pipelines/clip.h"
#include "pipelines/run_summary.h"

namespace hsi4d {

/// Behind open pieces of the mesh so much counts as solid, metres.
inline constexpr double kMeasuredThickness = 0.1;

/// Gaussians of the human that are looked at in a frame, evenly chosen; all where there are fewer.
inline constexpr Index kMeasuredPoints = 4000;

/// Counts of one frame, or of several together.
struct Penetration {
  Index points = 0, inside = 0;
  double depth = 0;  ///< sum over those inside, metres
};

/// The human's Gaussians in each state. Throws InternalError when the clip has no surface.
std::vector<Penetration> penetration_by_frame(const Clip& clip, const std::vector<SceneState>& states);

/// penetration_share, and penetration_depth_mm: of those inside, the mean; 0 where there are none.
MetricValues penetration_values(const Penetration& counts);

/// The same of frames 1 to T together.
MetricValues mean_penetration(const std::vector<Penetration>& by_frame);

}  // namespace hsi4d
