// Pinhole camera with OpenCV axes (x right, y down, z forward) in a z-up world. Pixel (row i, column j) covers
// [j, j+1] × [i, i+1]; its centre is (j + 0.5, i + 0.5).
#pragma once

#include <string_view>

#include "core/linear.h"
#include "core/rigid.h"

namespace hsi4d {

/// Intrinsics and pose. Plain data; check_camera says whether it makes sense.
struct Camera {
  int width = 0;   ///< pixels
  int height = 0;  ///< pixels
  double fx = 0;   ///< pixels
  double fy = 0;   ///< pixels
  double cx = 0;   ///< pixels, from the image's left edge
  double cy = 0;   ///< pixels, from the image's top edge
  Rigid<double> camera_from_world;
};

/// Largest entry of |R Rᵀ − I| that a camera's rotation may have.
inline constexpr double kRotationTolerance = 1e-4;

/// Throws UserError unless width, height, fx and fy are positive, all numbers are finite, |R Rᵀ − I| ≤
/// kRotationTolerance in every entry, and R does not mirror (determinant > 0). It is otherwise used as given.
///
/// @param name  starts the message: a file, with a JSON pointer perhaps
void check_camera(const Camera& camera, std::string_view name = "camera");

/// The camera at a size whose longer side is `longer` pixels, or as it is where that is smaller. Sizes are rounded to
/// whole pixels, and fx and fy with them.
Camera reduced_camera(Camera camera, int longer);

/// The rigid transform in a 4×4 matrix [R t; 0 0 0 1].
///
/// Throws UserError if a number is not finite or the last row is not 0 0 0 1; whether R is a rotation is check_camera's
/// question.
///
/// @param name  starts the message
Rigid<double> rigid_from_matrix(const Matrix4<double>& matrix, std::string_view name = "world_to_camera");

/// [R t; 0 0 0 1].
Matrix4<double> matrix_from_rigid(const Rigid<double>& transform);

/// Position of the camera in the world, c = −R⁻¹ t, metres: the point that camera_from_world takes to 0, also where R
/// is orthonormal only to kRotationTolerance. Not finite where R has no inverse, which check_camera refuses.
Vector3<double> camera_center_world(const Camera& camera);

/// Pose that looks from `eye_world` to `target_world`, the image's top towards `up_world` (row C13: view along up).
///
///   z = (target − eye)/|…|,  x = z × up/|…|,  y = z × x,  R = [x y z]ᵀ,  t = −R eye
///
/// @param eye_world, target_world  metres
/// @param up_world                 any length. Where the view is within 1e-6 of parallel to it, the world axis least
/// aligned with the
///                                 view is used.
/// @return                         camera_from_world, orthonormal to rounding
/// Adjoint: none. Throws UserError if eye and target are the same point, up is zero, or a number is not finite.
Rigid<double> look_at(const Vector3<double>& eye_world, const Vector3<double>& target_world,
                      const Vector3<double>& up_world = Vector3<double>::UnitZ());

/// The camera of the window [left, left+width) × [top, top+height) of the image; the window may reach over the edges.
///
/// A point projects to the same place of the scene: u' = u − left, v' = v − top. Throws UserError if width or height is
/// not positive.
Camera cropped(const Camera& camera, int left, int top, int width, int height);

/// The camera of the image resampled to width × height: u' = u width'/width (edges map to edges, as centres are at
/// +0.5).
///
/// Throws UserError if a width or height, old or new, is not positive.
Camera resized(const Camera& camera, int width, int height);

/// A camera ready to take points of the world into its frame: rotation in S, centre kept in double.
template <class S>
struct View {
  Matrix3<S> rotation;           ///< camera from world
  Vector3<double> center_world;  ///< metres
};

/// @param origin_world  where the points' own origin lies in the world (row A10: means are stored relative to it),
/// metres
template <class S>
View<S> view_of(const Camera& camera, const Vector3<double>& origin_world = Vector3<double>::Zero()) {
  return {camera.camera_from_world.rotation.cast<S>(), camera_center_world(camera) - origin_world};
}

/// Point in the camera's frame, R (p − c), the difference taken in double: exact to rounding of its own size at any
/// distance from the origin, where R p + t loses whole pixels (row A10, table M7).
///
/// @param point  metres, relative to the view's origin
/// Adjoint: point_in_view_adjoint (point), se3_transform_point_adjoint_at_zero (the camera's update).
template <class S>
Vector3<S> point_in_view(const View<S>& view, const Vector3<S>& point) {
  using W = detail::Wide<S>;
  const Vector3<W> offset = point.template cast<W>() - view.center_world.template cast<W>();
  return view.rotation * offset.template cast<S>();
}

/// d_point += Rᵀ g.
template <class S>
void point_in_view_adjoint(const View<S>& view, const Vector3<S>& d_point_camera, Vector3<S>& d_point) {
  d_point += view.rotation.transpose() * d_point_camera;
}

/// Image position (u, v) = (fx x/z + cx, fy y/z + cy) in pixels.
///
/// @param point_camera  metres, camera frame, z > 0 (points behind the camera are the caller's to cull)
/// Adjoint: project_point_adjoint (point_camera; the intrinsics are constants).
template <class S>
Vector2<S> project_point(const Camera& camera, const Vector3<S>& point_camera) {
  using R = detail::Real<S>;
  return {S(R(camera.fx)) * (point_camera[0] / point_camera[2]) + S(R(camera.cx)),
          S(R(camera.fy)) * (point_camera[1] / point_camera[2]) + S(R(camera.cy))};
}

template <class S>
void project_point_adjoint(const Camera& camera, const Vector3<S>& point_camera, const Vector2<S>& d_pixel,
                           Vector3<S>& d_point_camera) {
  using R = detail::Real<S>;
  const S d_x = S(R(camera.fx)) * d_pixel[0] / point_camera[2];
  const S d_y = S(R(camera.fy)) * d_pixel[1] / point_camera[2];
  d_point_camera[0] += d_x;
  d_point_camera[1] += d_y;
  d_point_camera[2] -= d_x * (point_camera[0] / point_camera[2]) + d_y * (point_camera[1] / point_camera[2]);
}

/// Point of the camera's frame at an image position and depth, z ((u − cx)/fx, (v − cy)/fy, 1).
///
/// @param pixel  (u, v) in pixels; the centre of row i, column j is (j + 0.5, i + 0.5)
/// @param depth  camera z in metres, not the distance
/// Adjoint: unproject_pixel_adjoint (pixel, depth; the intrinsics are constants).
template <class S>
Vector3<S> unproject_pixel(const Camera& camera, const Vector2<S>& pixel, const S& depth) {
  using R = detail::Real<S>;
  return {depth * ((pixel[0] - S(R(camera.cx))) / S(R(camera.fx))),
          depth * ((pixel[1] - S(R(camera.cy))) / S(R(camera.fy))), depth};
}

template <class S>
void unproject_pixel_adjoint(const Camera& camera, const Vector2<S>& pixel, const S& depth,
                             const Vector3<S>& d_point_camera, Vector2<S>& d_pixel, S& d_depth) {
  using R = detail::Real<S>;
  const S fx(R(camera.fx)), fy(R(camera.fy));
  d_pixel[0] += depth / fx * d_point_camera[0];
  d_pixel[1] += depth / fy * d_point_camera[1];
  d_depth += (pixel[0] - S(R(camera.cx))) / fx * d_point_camera[0] +
             (pixel[1] - S(R(camera.cy))) / fy * d_point_camera[1] + d_point_camera[2];
}

}  // namespace hsi4d
