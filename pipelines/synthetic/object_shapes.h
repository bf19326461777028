// The larger objects of synthetic clips, as sheets: z up, front +x, left side +y, standing on z = 0.
#pragma once

#include "pipelines/synthetic/surface.h"

namespace hsi4d::detail {

/// Where they are held: height of the bar; the handles, from the middle of the ground.
inline constexpr double kBarbellHeight = 0.225;
inline constexpr double kCartHandle[2] = {-0.52, 1.02};   // x, z, metres
inline constexpr double kMowerHandle[2] = {-0.95, 0.98};  // x, z, metres

void add_barbell(SurfaceModel& model);
void add_shopping_cart(SurfaceModel& model);
void add_mower(SurfaceModel& model);

}  // namespace hsi4d::detail
