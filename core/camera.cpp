#include "core/camera.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <Eigen/LU>

#include "core/check.h"

namespace hsi4d {
namespace {

constexpr double kParallelView = 1e-6;  // sine of the angle to `up` below which it is replaced

template <class T>
std::string text_of(T value) {
  std::array<char, 32> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

[[noreturn]] void refuse(std::string_view name, const std::string& problem, std::string_view allowed) {
  throw UserError(std::string(name) + ": " + problem + "; allowed: " + std::string(allowed));
}

void check_size(std::string_view name, int width, int height) {
  if (width <= 0) refuse(name, "width is " + text_of(width), "a whole number > 0");
  if (height <= 0) refuse(name, "height is " + text_of(height), "a whole number > 0");
}

void check_finite(std::string_view name, const std::string& what, double value) {
  if (!std::isfinite(value)) refuse(name, what + " is " + text_of(value), "a finite number");
}

void check_focal(std::string_view name, const std::string& what, double value) {
  if (!std::isfinite(value) || value <= 0) refuse(name, what + " is " + text_of(value), "a finite number > 0");
}

/// "name[i]" for a vector, "name[i][j]" for a matrix.
std::string entry_name(std::string name, int row, int column, bool is_vector) {
  name.append("[").append(text_of(row)).append("]");
  if (!is_vector) name.append("[").append(text_of(column)).append("]");
  return name;
}

template <class Matrix>
void check_all_finite(std::string_view name, const std::string& what, const Matrix& matrix) {
  for (int i = 0; i < matrix.rows(); ++i) {
    for (int j = 0; j < matrix.cols(); ++j) {
      if (std::isfinite(matrix(i, j))) continue;
      check_finite(name, entry_name(what, i, j, matrix.cols() == 1), matrix(i, j));
    }
  }
}

void check_distinct(const Vector3<double>& eye, const Vector3<double>& target, const Vector3<double>& up) {
  check_all_finite("look_at", "eye", eye);
  check_all_finite("look_at", "target", target);
  check_all_finite("look_at", "up", up);
  if (eye == target) {
    refuse("look_at",
           "eye and target are both (" + text_of(eye[0]) + ", " + text_of(eye[1]) + ", " + text_of(eye[2]) + ")",
           "two different points");
  }
  if (up.isZero(0)) refuse("look_at", "up is (0, 0, 0)", "a direction that is not zero");
}

}  // namespace

Camera reduced_camera(Camera camera, int longer) {
  const double share = std::min(1.0, static_cast<double>(longer) / std::max(camera.width, camera.height));
  const auto size = [share](int pixels) { return std::max(1, static_cast<int>(std::lround(share * pixels))); };
  const int width = size(camera.width), height = size(camera.height);
  camera.fx *= static_cast<double>(width) / camera.width;
  camera.cx *= static_cast<double>(width) / camera.width;
  camera.fy *= static_cast<double>(height) / camera.height;
  camera.cy *= static_cast<double>(height) / camera.height;
  camera.width = width;
  camera.height = height;
  return camera;
}

void check_camera(const Camera& camera, std::string_view name) {
  check_size(name, camera.width, camera.height);
  check_focal(name, "fx", camera.fx);
  check_focal(name, "fy", camera.fy);
  check_finite(name, "cx", camera.cx);
  check_finite(name, "cy", camera.cy);
  const Matrix3<double>& r = camera.camera_from_world.rotation;
  check_all_finite(name, "rotation", r);
  check_all_finite(name, "translation", camera.camera_from_world.translation);
  const double error = (r * r.transpose() - Matrix3<double>::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= kRotationTolerance)) {
    refuse(name, "the rotation R is not orthonormal: |R R^T - I| is " + text_of(error),
           "at most " + text_of(kRotationTolerance));
  }
  if (r.determinant() < 0) {
    refuse(name, "the rotation R mirrors: its determinant is -1",
           "1. An odd number of axes is turned round: those of a camera are OpenCV's, x right, y down, z forward, and "
           "from OpenGL's, y up, z backward, two differ; a world of left-handed axes must be made right-handed first");
  }
}

Rigid<double> rigid_from_matrix(const Matrix4<double>& matrix, std::string_view name) {
  check_all_finite(name, "matrix", matrix);
  const Vector4<double> last = matrix.row(3).transpose();
  if (last != Vector4<double>::Unit(3)) {
    refuse(name,
           "the last row is " + text_of(last[0]) + " " + text_of(last[1]) + " " + text_of(last[2]) + " " +
               text_of(last[3]),
           "0 0 0 1");
  }
  return {matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>()};
}

Matrix4<double> matrix_from_rigid(const Rigid<double>& transform) {
  Matrix4<double> matrix = Matrix4<double>::Identity();
  matrix.topLeftCorner<3, 3>() = transform.rotation;
  matrix.topRightCorner<3, 1>() = transform.translation;
  return matrix;
}

Vector3<double> camera_center_world(const Camera& camera) {
  return -(camera.camera_from_world.rotation.inverse() * camera.camera_from_world.translation);
}

Rigid<double> look_at(const Vector3<double>& eye_world, const Vector3<double>& target_world,
                      const Vector3<double>& up_world) {
  check_distinct(eye_world, target_world, up_world);
  // Halved first, so that the difference of huge coordinates stays finite.
  const Vector3<double> z = direction_of(Vector3<double>(target_world / 2 - eye_world / 2)).unit;
  Vector3<double> right = cross(z, direction_of(up_world).unit);
  if (right.norm() < kParallelView) {
    Eigen::Index least = 0;
    z.cwiseAbs().minCoeff(&least);
    right = cross(z, Vector3<double>(Vector3<double>::Unit(least)));
  }
  const Vector3<double> x = direction_of(right).unit;
  Rigid<double> camera_from_world;
  camera_from_world.rotation << x.transpose(), cross(z, x).transpose(), z.transpose();
  camera_from_world.translation = -(camera_from_world.rotation * eye_world);
  return camera_from_world;
}

Camera cropped(const Camera& camera, int left, int top, int width, int height) {
  check_size("crop", width, height);
  Camera result = camera;
  result.width = width;
  result.height = height;
  result.cx = camera.cx - left;
  result.cy = camera.cy - top;
  return result;
}

Camera resized(const Camera& camera, int width, int height) {
  check_size("resize", width, height);
  check_size("resize: camera", camera.width, camera.height);
  const double scale_x = static_cast<double>(width) / camera.width;
  const double scale_y = static_cast<double>(height) / camera.height;
  Camera result = camera;
  result.width = width;
  result.height = height;
  result.fx = camera.fx * scale_x;
  result.cx = camera.cx * scale_x;
  result.fy = camera.fy * scale_y;
  result.cy = camera.cy * scale_y;
  return result;
}

}  // namespace hsi4d
