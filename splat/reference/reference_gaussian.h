// One Gaussian of the brute-force renderer: from its stored numbers to what it draws (steps 1 to 5 of reference.h), and
// the adjoint of that.
#pragma once

#include <array>

#include "splat/reference/reference.h"
#include "splat/reference/reference_linear.h"

namespace hsi4d::reference {

/// Side of the tiles of INRIA's square support, pixels.
inline constexpr int kInriaTile = 16;

/// The camera, and what every Gaussian needs of it.
template <class T>
struct View {
  std::array<int, 2> pixels;   ///< width, height
  std::array<T, 2> focal;      ///< fx, fy, pixels
  std::array<T, 2> principal;  ///< cx, cy, pixels
  std::array<T, 2> low, high;  ///< where x/z and y/z of the Jacobian are held
  Mat3<T> rotation;            ///< W, as given
  Mat3<T> rotation_inverse;    ///< W⁻¹
  Vec3<T> center;              ///< c = −W⁻¹ t, world
};

/// Throws InternalError if the image has no pixels or a focal length is not positive.
template <class T>
View<T> view_of(const Pinhole<T>& camera, const RenderSettings& settings);

/// The ellipse of a projected covariance by its axes.
template <class T>
struct Ellipse {
  std::array<T, 2> axis;  ///< unit vector along the longer one
  T long_variance;        ///< pixels²
  T short_variance;       ///< pixels², > 0
};

/// What a Gaussian draws.
template <class T>
struct Drawn {
  Index index;            ///< row of the scene
  double depth_key;       ///< what is sorted by
  std::array<T, 2> mean;  ///< u, v, pixels
  Ellipse<T> ellipse;
  T opacity;  ///< with the factor of antialias
  Vec3<T> color;
  T depth;                                  ///< p_z, metres
  int group;                                ///< −1: none
  std::array<int, 2> tile_begin, tile_end;  ///< tiles of 16 × 16 pixels (column, row) outside which it is skipped
};

/// Derivatives of a loss by what a Gaussian draws.
template <class T>
struct DrawnGradient {
  std::array<T, 2> mean{};
  std::array<T, 3> cov{};  ///< of the entries 00, 01 = 10 (each of the two), 11 of the covariance
  T opacity = 0;
  Vec3<T> color{};
  T depth = 0;
};

/// False if the Gaussian contributes nothing: culled, or its numbers are not usable.
template <class T>
bool draw(const Scene<T>& scene, Index index, const View<T>& view, const RenderSettings& settings, Drawn<T>& drawn);

/// Adds to `result` what `d_drawn` means for the Gaussian's numbers and the camera. The Gaussian is one that draws.
template <class T>
void draw_adjoint(const Scene<T>& scene, Index index, const View<T>& view, const RenderSettings& settings,
                  const DrawnGradient<T>& d_drawn, Gradients<T>& result);

/// Real spherical harmonics Y_0 … Y_15 with INRIA's order and signs; those above `degree` are 0.
template <class T>
std::array<T, 16> sh_basis(int degree, const Vec3<T>& direction);
/// Their gradients as polynomials of x, y, z.
template <class T>
std::array<Vec3<T>, 16> sh_basis_gradient(int degree, const Vec3<T>& direction);

}  // namespace hsi4d::reference
