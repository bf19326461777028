// Places spread evenly over a body's surface.
#pragma once

#include <span>
#include <vector>

#include "body/surface_index.h"

namespace hsi4d {

/// One of the places.
struct SurfaceSample {
  SurfacePlace place;
  double wanted_spacing = 0;  ///< metres: the root of the area that a place has there by the density
  double spacing = 0;         ///< metres: the root of the area that is nearer to this one than to others
  double reach = 0;           ///< metres: to the farthest of what is nearest to this one
  double bend = 0;            ///< metres: how far the surface there leaves the plane of this one's face
};

/// `count` places, everywhere as many per area as the density says, and as far from each other as that allows.
///
/// Many candidates are drawn, in strata of equal area times density. In random order those are kept that keep their
/// distance [dart throwing: Cook 1986, ACM TOG 5(1)]; then each moves to the middle of the candidates that are nearest
/// to it, a few times [Lloyd 1982, IEEE TIT 28(2)]. What faces the other way is another side, and no neighbour.
///
/// @param density  [V] places per area, relative to each other, > 0
/// @return         in the order of their faces; a function of the arguments alone, for any number of threads
/// Throws InternalError when the body has no surface, or sizes or a density do not fit.
std::vector<SurfaceSample> sample_surface(const BodyModel& body, std::span<const double> density, Index count,
                                          std::uint64_t seed);

}  // namespace hsi4d
