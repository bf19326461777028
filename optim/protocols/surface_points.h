// Points drawn evenly from the surface of a mesh.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// Where a draw begins: draws of another seed or stream have nothing to do with each other.
struct SurfaceDraw {
  std::uint64_t seed = 0, stream = 0;
};

/// `count` points of a surface, each drawn by itself, as likely everywhere: a triangle by its area, a place in it
/// evenly.
///
/// @param vertices  [V,3] metres
/// @param faces     [F] vertices of each triangle
/// @return          [count,3] metres; a function of the arguments alone
/// Throws InternalError where a face names no vertex, and where all of them have no area, or one that is not finite.
std::vector<double> surface_points(std::span<const double> vertices, std::span<const std::array<std::int32_t, 3>> faces,
                                   Index count, const SurfaceDraw& draw);

}  // namespace hsi4d
