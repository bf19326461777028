// Lenses that bend: the radial and tangential model that COLMAP, OpenCV, nerfstudio and instant-ngp write, and pictures
// without it.
//
//   r² = x² + y²,  s = 1 + k1 r² + k2 r⁴ + k3 r⁶
//   x_d = x s + 2 p1 x y + p2 (r² + 2 x²)
//   y_d = y s + p1 (r² + 2 y²) + 2 p2 x y          [Brown 1966; OpenCV, calib3d]
//
// with (x, y) = ((u − cx)/fx, (v − cy)/fy) of the pinhole and (x_d, y_d) those of the picture.
#pragma once

#include "core/camera.h"
#include "core/image.h"

namespace hsi4d {

/// Numbers of the model; all 0: a pinhole.
struct Lens {
  double k1 = 0, k2 = 0, k3 = 0;  ///< radial
  double p1 = 0, p2 = 0;          ///< tangential

  bool operator==(const Lens&) const = default;
  bool is_straight() const { return *this == Lens{}; }
};

/// Where the lens shows a direction. @param point  (x, y) at depth 1
Vector2<double> bent_by(const Lens& lens, const Vector2<double>& point);

/// The direction that the lens shows at a place: the inverse of bent_by, to rounding, within the valid radius. Beyond
/// it the nearest that it finds, which is shown elsewhere.
Vector2<double> straight_of(const Lens& lens, const Vector2<double>& bent);

/// Squared radius within which the radial part grows, so that each place of a picture is shown once; infinite for
/// lenses that never turn back.
double valid_radius_squared(const Lens& lens);

/// Whether the lens shows the middles of the picture's edges: one that turns back before them took no such picture.
/// @param camera  whose intrinsics the lens goes with
bool covers_picture(const Lens& lens, const Camera& camera);

/// A picture as a pinhole would have taken it.
struct StraightImage {
  Image image;  ///< [C,H,W], 0 where `seen` is
  Image seen;   ///< [1,H,W] 1, or 0 where the picture does not show the direction
};

/// Between pixel centres, or at the nearest one, for numbers that have no mean.
enum class Sampling { kBilinear, kNearest };

/// The picture that a pinhole with the camera's intrinsics takes.
///
/// @param image  [C,H,W] of the camera's size, taken through the lens
/// Throws InternalError for another size.
StraightImage straightened(const Image& image, const Camera& camera, const Lens& lens,
                           Sampling sampling = Sampling::kBilinear);

}  // namespace hsi4d
