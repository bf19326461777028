// The larger objects of synthetic clips, as sheets: z up, front +x, left side +y, standing on z = 0.
#pragma once

#include "pipelines/synthetic/surface.h"

namespace hsi4d::detail {

/// Where they are held: height of the bar; the handles, from the middle of the ground.
inline constexpr double kBarbellHeight = 0.225;
inline constexpr double kCartHandle[2] = {-0.52, 1.02};   // x, z, metres
inline constexpr double kMowerHandle[2] = {-0.95, 0.98};  // x, z, metres

inline constexpr double kGateHandle[3] = {-0.055, -0.25, 1.04};
/// A point of the axis that a gate turns about, on the ground: y.
inline constexpr double kGateHinge = 0.3;

void add_barbell(SurfaceModel& model);
void add_shopping_cart(SurfaceModel& model);
void add_mower(SurfaceModel& model);
void add_gate(SurfaceModel& model);

}  // namespace hsi4d::detail
