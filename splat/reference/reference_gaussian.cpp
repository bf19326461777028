#include "splat/reference/reference_gaussian.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/check.h"

namespace hsi4d::reference {
namespace {

constexpr double kLogScaleLimit = 20;
/// INRIA's square support: its least half-difference of variances (squared), its standard deviations.
constexpr double kInriaLeastSpread = 0.1;
constexpr double kInriaSigmas = 3;

template <class T>
using Quat = std::array<T, 4>;

// Rotation matrix of a unit quaternion wxyz.
template <class T>
Mat3<T> rotation_matrix(const Quat<T>& q) {
  const auto [w, x, y, z] = q;
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
           {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
           {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}

template <class T>
Quat<T> rotation_matrix_adjoint(const Quat<T>& q, const Mat3<T>& g) {
  const auto [w, x, y, z] = q;
  return {
      2 * (x * (g[2][1] - g[1][2]) + y * (g[0][2] - g[2][0]) + z * (g[1][0] - g[0][1])),
      2 * (w * (g[2][1] - g[1][2]) + y * (g[0][1] + g[1][0]) + z * (g[0][2] + g[2][0]) - 2 * x * (g[1][1] + g[2][2])),
      2 * (w * (g[0][2] - g[2][0]) + x * (g[0][1] + g[1][0]) + z * (g[1][2] + g[2][1]) - 2 * y * (g[0][0] + g[2][2])),
      2 * (w * (g[1][0] - g[0][1]) + x * (g[0][2] + g[2][0]) + y * (g[1][2] + g[2][1]) - 2 * z * (g[0][0] + g[1][1]))};
}

// 1/(1 + exp(−x)), and its derivative, without overflow or cancellation [B15].
template <class T>
T sigmoid(T x) {
  const T e = std::exp(-std::abs(x));
  return x >= 0 ? 1 / (1 + e) : e / (1 + e);
}

template <class T>
T sigmoid_derivative(T x) {
  const T e = std::exp(-std::abs(x));
  return e / ((1 + e) * (1 + e));
}

/// Everything on the way from the stored numbers to what is drawn.
template <class T>
struct Steps {
  // 1. The Gaussian in the world.
  Vec3<T> mean_rest, mean;  // m, μ
  Mat3<T> linear;           // A
  T quat_length;            // |q|
  Quat<T> unit_quat;        // q/|q|
  Mat3<T> rotation;         // R
  Vec3<T> scales;           // diagonal of S
  std::array<bool, 3> scale_held;
  Mat3<T> axes_rest, axes;  // R S, M = A R S
  // 2. In the camera's frame.
  Vec3<T> point;        // p
  Mat3<T> axes_camera;  // W M
  // 3. In the image: x/z and y/z, held for J; J's rows; V's rows; V Vᵀ + blur I = [a b; b c].
  std::array<T, 2> ratio, held;
  std::array<bool, 2> is_held;
  std::array<Vec3<T>, 2> jacobian, factor;
  T a, b, c, det, det_unblurred;
  // 4. Opacity.
  T compensation;
  // 5. Colour.
  int degree;
  T distance;
  Vec3<T> direction, color_sum;
};

template <class T>
bool all_finite(const T* numbers, std::size_t n) {
  return std::all_of(numbers, numbers + n, [](T x) { return std::isfinite(x); });
}

/// Step 1's condition: whether the numbers that the Gaussian uses can be used.
template <class T>
bool usable(const Scene<T>& scene, std::size_t i, int degree) {
  const auto coefficients = static_cast<std::size_t>(scene.sh_coefficients);
  const auto used = static_cast<std::size_t>((degree + 1) * (degree + 1));
  const T* q = scene.quats.data() + 4 * i;
  const T* log_scale = scene.log_scales.data() + 3 * i;
  return all_finite(scene.means.data() + 3 * i, 3) && all_finite(q, 4) &&
         !(q[0] == 0 && q[1] == 0 && q[2] == 0 && q[3] == 0) &&
         std::none_of(log_scale, log_scale + 3, [](T x) { return std::isnan(x); }) &&
         !std::isnan(scene.opacity_logits[i]) && all_finite(scene.sh.data() + 3 * coefficients * i, 3 * used) &&
         (scene.transforms.empty() || all_finite(scene.transforms.data() + 12 * i, 12));
}

template <class T>
void place_in_world(const Scene<T>& scene, std::size_t i, Steps<T>& s) {
  const T* m = scene.means.data() + 3 * i;
  s.mean_rest = {m[0], m[1], m[2]};
  const T* q = scene.quats.data() + 4 * i;
  s.quat_length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (std::size_t k = 0; k < 4; ++k) s.unit_quat[k] = q[k] / s.quat_length;
  s.rotation = rotation_matrix(s.unit_quat);
  for (std::size_t k = 0; k < 3; ++k) {
    const T limit = kLogScaleLimit, log_scale = scene.log_scales[3 * i + k];
    s.scale_held[k] = log_scale < -limit || log_scale > limit;
    s.scales[k] = std::exp(std::clamp(log_scale, -limit, limit));
  }
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t k = 0; k < 3; ++k) s.axes_rest[r][k] = s.rotation[r][k] * s.scales[k];
  s.linear = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  s.mean = s.mean_rest;
  s.axes = s.axes_rest;
  if (scene.transforms.empty()) return;
  const T* transform = scene.transforms.data() + 12 * i;
  for (std::size_t r = 0; r < 3; ++r) {
    s.linear[r] = {transform[4 * r], transform[4 * r + 1], transform[4 * r + 2]};
    s.mean[r] = dot(s.linear[r], s.mean_rest) + transform[4 * r + 3];
  }
  s.axes = times(s.linear, s.axes_rest);
}

/// Adjoint of place_in_world.
template <class T>
void place_in_world_adjoint(const Scene<T>& scene, std::size_t i, const Steps<T>& s, const Vec3<T>& d_mean,
                            const Mat3<T>& d_axes, Gradients<T>& result) {
  if (!scene.transforms.empty()) {
    const Mat3<T> d_linear = times(d_axes, transposed(s.axes_rest));  // M = A (R S), μ = A m + a
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t k = 0; k < 3; ++k)
        result.transforms[12 * i + 4 * r + k] += d_linear[r][k] + d_mean[r] * s.mean_rest[k];
      result.transforms[12 * i + 4 * r + 3] += d_mean[r];
    }
  }
  const Vec3<T> d_mean_rest = times(transposed(s.linear), d_mean);
  const Mat3<T> d_axes_rest = times(transposed(s.linear), d_axes);
  Mat3<T> d_rotation;
  for (std::size_t k = 0; k < 3; ++k) {
    result.means[3 * i + k] += d_mean_rest[k];
    T d_scale = 0;
    for (std::size_t r = 0; r < 3; ++r) {
      d_scale += s.rotation[r][k] * d_axes_rest[r][k];
      d_rotation[r][k] = s.scales[k] * d_axes_rest[r][k];
    }
    if (!s.scale_held[k]) result.log_scales[3 * i + k] += s.scales[k] * d_scale;
  }
  // Through q/|q|: what is along q goes nowhere [A13].
  const Quat<T> d_unit = rotation_matrix_adjoint(s.unit_quat, d_rotation);
  T along = 0;
  for (std::size_t k = 0; k < 4; ++k) along += s.unit_quat[k] * d_unit[k];
  for (std::size_t k = 0; k < 4; ++k) result.quats[4 * i + k] += (d_unit[k] - along * s.unit_quat[k]) / s.quat_length;
}

/// Step 3: J, V, and the covariance. The mean's own x/z is `ratio`, J's is `held` [A2].
template <class T>
void project(const View<T>& view, T blur, Steps<T>& s) {
  const T z = s.point[2];
  for (std::size_t k = 0; k < 2; ++k) {
    s.ratio[k] = s.point[k] / z;
    s.is_held[k] = s.ratio[k] < view.low[k] || s.ratio[k] > view.high[k];
    s.held[k] = std::clamp(s.ratio[k], view.low[k], view.high[k]);
    s.jacobian[k] = {0, 0, -view.focal[k] * s.held[k] / z};
    s.jacobian[k][k] = view.focal[k] / z;
    s.factor[k] = times(transposed(s.axes_camera), s.jacobian[k]);
  }
  s.a = dot(s.factor[0], s.factor[0]) + blur;
  s.b = dot(s.factor[0], s.factor[1]);
  s.c = dot(s.factor[1], s.factor[1]) + blur;
  // det V Vᵀ = |v0|² |v1|² − (v0·v1)² = |v0 × v1|²: a sum of squares where ac − b² would cancel [A1].
  const Vec3<T> normal = cross(s.factor[0], s.factor[1]);
  s.det_unblurred = dot(normal, normal);
  s.det = s.det_unblurred + blur * (dot(s.factor[0], s.factor[0]) + dot(s.factor[1], s.factor[1])) + blur * blur;
}

/// Adjoint of project and of the mean's projection, to the point and to W M.
template <class T>
void project_adjoint(const View<T>& view, const Steps<T>& s, const std::array<T, 2>& d_mean_px,
                     const std::array<Vec3<T>, 2>& d_factor, Vec3<T>& d_point, Mat3<T>& d_axes_camera) {
  const T z = s.point[2];
  for (std::size_t k = 0; k < 2; ++k) {
    const Vec3<T> d_jacobian = times(s.axes_camera, d_factor[k]);
    for (std::size_t r = 0; r < 3; ++r) add(d_axes_camera[r], s.jacobian[k][r], d_factor[k]);
    d_point[2] -= d_jacobian[k] * view.focal[k] / (z * z);              // f/z
    d_point[2] += d_jacobian[2] * view.focal[k] * s.held[k] / (z * z);  // −f h/z at a fixed h
    const T d_held = -d_jacobian[2] * view.focal[k] / z;
    const T d_ratio = view.focal[k] * d_mean_px[k] + (s.is_held[k] ? T(0) : d_held);
    d_point[k] += d_ratio / z;
    d_point[2] -= d_ratio * s.ratio[k] / z;
  }
}

/// Factor by which antialias lowers the opacity [A7].
template <class T>
T compensation(const Steps<T>& s, bool antialias) {
  return antialias ? std::sqrt(s.det_unblurred / s.det) : T(1);
}

/// Adjoint of the factor f = sqrt(det0/det1): df = ½ f (d log det0 − d log det1), with n = v0 × v1,
/// d det0 = 2 (v1 × n)·dv0 + 2 (n × v0)·dv1 and d det1 = d det0 + 2 blur (v0·dv0 + v1·dv1). Nothing at det0 = 0.
template <class T>
void compensation_adjoint(const Steps<T>& s, T blur, T d_compensation, std::array<Vec3<T>, 2>& d_factor) {
  if (!(s.det_unblurred > 0)) return;
  const auto& [v0, v1] = s.factor;
  const Vec3<T> normal = cross(v0, v1);
  const T d_log = d_compensation * s.compensation / 2;
  const T inverse_difference = (s.det - s.det_unblurred) / s.det / s.det_unblurred;  // 1/det0 − 1/det1
  add(d_factor[0], 2 * d_log * inverse_difference, cross(v1, normal));
  add(d_factor[1], 2 * d_log * inverse_difference, cross(normal, v0));
  for (std::size_t k = 0; k < 2; ++k) add(d_factor[k], -2 * d_log * blur / s.det, s.factor[k]);
}

/// Step 5.
template <class T>
void shade(const Scene<T>& scene, std::size_t i, const View<T>& view, Steps<T>& s) {
  const Vec3<T> offset = difference(s.mean, view.center);
  s.distance = std::sqrt(dot(offset, offset));
  s.direction = {0, 0, 1};
  if (s.distance > 0) s.direction = scaled(1 / s.distance, offset);
  const std::array<T, 16> basis = sh_basis(s.degree, s.direction);
  const auto coefficients = static_cast<std::size_t>(scene.sh_coefficients);
  const auto used = static_cast<std::size_t>((s.degree + 1) * (s.degree + 1));
  for (std::size_t channel = 0; channel < 3; ++channel) {
    s.color_sum[channel] = T(0.5);
    for (std::size_t k = 0; k < used; ++k)
      s.color_sum[channel] += basis[k] * scene.sh[3 * (coefficients * i + k) + channel];
  }
}

/// Adjoint of shade: adds to the coefficients' gradient and returns that of μ − c.
template <class T>
Vec3<T> shade_adjoint(const Scene<T>& scene, std::size_t i, const Steps<T>& s, const Vec3<T>& d_color,
                      Gradients<T>& result) {
  const std::array<T, 16> basis = sh_basis(s.degree, s.direction);
  const std::array<Vec3<T>, 16> basis_gradient = sh_basis_gradient(s.degree, s.direction);
  const auto coefficients = static_cast<std::size_t>(scene.sh_coefficients);
  const auto used = static_cast<std::size_t>((s.degree + 1) * (s.degree + 1));
  Vec3<T> d_direction{};
  for (std::size_t channel = 0; channel < 3; ++channel) {
    if (!(s.color_sum[channel] > 0)) continue;  // held at 0 [B18]
    for (std::size_t k = 0; k < used; ++k) {
      const std::size_t at = 3 * (coefficients * i + k) + channel;
      result.sh[at] += basis[k] * d_color[channel];
      add(d_direction, scene.sh[at] * d_color[channel], basis_gradient[k]);
    }
  }
  if (!(s.distance > 0)) return {0, 0, 0};
  Vec3<T> d_offset = d_direction;  // of v/|v|: (g − r r·g)/|v| [B19]
  add(d_offset, -dot(s.direction, d_direction), s.direction);
  return scaled(1 / s.distance, d_offset);
}

/// Highest degree that the scene's K coefficients and the settings both allow.
template <class T>
int used_degree(const Scene<T>& scene, const RenderSettings& settings) {
  int degree = 0;
  while ((degree + 2) * (degree + 2) <= scene.sh_coefficients) ++degree;
  return std::min(degree, settings.sh_degree);
}

/// Steps 1 to 5; false as soon as the Gaussian turns out to contribute nothing.
template <class T>
bool take_steps(const Scene<T>& scene, std::size_t i, const View<T>& view, const RenderSettings& settings,
                Steps<T>& s) {
  s.degree = used_degree(scene, settings);
  if (!usable(scene, i, s.degree)) return false;
  place_in_world(scene, i, s);
  s.point = times(view.rotation, difference(s.mean, view.center));
  if (!(s.point[2] > T(settings.near))) return false;
  s.axes_camera = times(view.rotation, s.axes);
  project(view, T(settings.blur), s);
  if (!(s.det > 0)) return false;
  s.compensation = compensation(s, settings.antialias);
  shade(scene, i, view, s);
  return true;
}

/// Eigenvalues of [a b; b c] and the direction of the larger; the smaller as det over the larger, which does not
/// cancel.
template <class T>
Ellipse<T> ellipse_of(const Steps<T>& s) {
  const T half_difference = (s.a - s.c) / 2;
  const T root = std::hypot(half_difference, s.b);
  const T larger = (s.a + s.c) / 2 + root;
  std::array<T, 2> axis = {1, 0};
  if (root > 0) {
    axis = half_difference >= 0 ? std::array<T, 2>{root + half_difference, s.b}
                                : std::array<T, 2>{s.b, root - half_difference};
    const T length = std::hypot(axis[0], axis[1]);
    axis = {axis[0] / length, axis[1] / length};
  }
  return {axis, larger, s.det / larger};
}

/// The tiles of settings.footprint, as reference.h states them.
template <class T>
void bound(const View<T>& view, const RenderSettings& settings, const Steps<T>& s, Drawn<T>& drawn) {
  const T mid = (s.a + s.c) / 2;
  const T spread = std::sqrt(std::max(T(kInriaLeastSpread), mid * mid - s.det));
  const T radius = std::ceil(T(kInriaSigmas) * std::sqrt(mid + spread));
  for (std::size_t k = 0; k < 2; ++k) {
    const int tiles = (view.pixels[k] + kInriaTile - 1) / kInriaTile;
    drawn.tile_begin[k] = 0;
    drawn.tile_end[k] = tiles;
    if (settings.footprint == Footprint::kExact) continue;
    const T center = drawn.mean[k] - T(0.5);
    const auto tile = [&](T at) { return static_cast<int>(std::clamp(std::floor(at / kInriaTile), T(0), T(tiles))); };
    drawn.tile_begin[k] = tile(center - radius);
    drawn.tile_end[k] = tile(center + radius + kInriaTile - 1);
  }
}

}  // namespace

template <class T>
View<T> view_of(const Pinhole<T>& camera, const RenderSettings& settings) {
  HSI4D_CHECK(camera.width > 0 && camera.height > 0, "an image of no pixels");
  HSI4D_CHECK(camera.fx > 0 && camera.fy > 0, "focal lengths must be positive");
  View<T> view;
  view.pixels = {camera.width, camera.height};
  view.focal = {camera.fx, camera.fy};
  view.principal = {camera.cx, camera.cy};
  for (std::size_t k = 0; k < 2; ++k) {
    const T size = view.pixels[k], margin = (T(settings.frustum_clamp) - 1) * size / (2 * view.focal[k]);
    view.low[k] = -view.principal[k] / view.focal[k] - margin;
    view.high[k] = (size - view.principal[k]) / view.focal[k] + margin;
  }
  const auto& w = camera.camera_from_world;
  view.rotation = {{{w[0], w[1], w[2]}, {w[4], w[5], w[6]}, {w[8], w[9], w[10]}}};
  view.rotation_inverse = inverse(view.rotation);
  view.center = scaled(T(-1), times(view.rotation_inverse, Vec3<T>{w[3], w[7], w[11]}));
  return view;
}

template <class T>
bool draw(const Scene<T>& scene, Index index, const View<T>& view, const RenderSettings& settings, Drawn<T>& drawn) {
  const auto i = static_cast<std::size_t>(index);
  Steps<T> s;
  if (!take_steps(scene, i, view, settings, s)) return false;
  drawn.index = index;
  const bool float_key = settings.depth_key == DepthKey::kFloat;
  drawn.depth_key = float_key ? static_cast<float>(s.point[2]) : static_cast<double>(s.point[2]);
  for (std::size_t k = 0; k < 2; ++k) drawn.mean[k] = view.focal[k] * s.ratio[k] + view.principal[k];
  drawn.ellipse = ellipse_of(s);
  drawn.opacity = sigmoid(scene.opacity_logits[i]) * s.compensation;
  for (std::size_t k = 0; k < 3; ++k) drawn.color[k] = std::max(T(0), s.color_sum[k]);
  drawn.depth = s.point[2];
  drawn.group = scene.groups.empty() ? -1 : scene.groups[i];
  bound(view, settings, s, drawn);
  return true;
}

template <class T>
void draw_adjoint(const Scene<T>& scene, Index index, const View<T>& view, const RenderSettings& settings,
                  const DrawnGradient<T>& d_drawn, Gradients<T>& result) {
  const auto i = static_cast<std::size_t>(index);
  Steps<T> s;
  const bool draws = take_steps(scene, i, view, settings, s);
  HSI4D_CHECK(draws, "the adjoint of a Gaussian that draws nothing");

  const T logit = scene.opacity_logits[i];
  result.opacity_logits[i] += d_drawn.opacity * s.compensation * sigmoid_derivative(logit);

  const auto& [d_00, d_01, d_11] = d_drawn.cov;  // cov = V Vᵀ + blur I: d_V = 2 d_cov V
  const auto& [v0, v1] = s.factor;
  std::array<Vec3<T>, 2> d_factor{};
  add(d_factor[0], 2 * d_00, v0);
  add(d_factor[0], 2 * d_01, v1);
  add(d_factor[1], 2 * d_01, v0);
  add(d_factor[1], 2 * d_11, v1);
  if (settings.antialias) compensation_adjoint(s, T(settings.blur), d_drawn.opacity * sigmoid(logit), d_factor);

  Vec3<T> d_point = {0, 0, d_drawn.depth};
  Mat3<T> d_axes_camera{};
  project_adjoint(view, s, d_drawn.mean, d_factor, d_point, d_axes_camera);

  const Mat3<T> world_from_camera = transposed(view.rotation);  // of gradients: p = W (μ − c), W M
  Vec3<T> d_mean = times(world_from_camera, d_point);
  const Vec3<T> d_offset = shade_adjoint(scene, i, s, d_drawn.color, result);
  add(d_mean, T(1), d_offset);
  place_in_world_adjoint(scene, i, s, d_mean, times(world_from_camera, d_axes_camera), result);

  // The camera: dp = ρ + φ × p, d(W M) = φ × its columns, and dc = −W⁻¹ ρ moves the direction μ − c.
  Vec3<T> d_rho = times(transposed(view.rotation_inverse), d_offset);
  add(d_rho, T(1), d_point);
  Vec3<T> d_phi = cross(s.point, d_point);
  const Mat3<T> columns = transposed(s.axes_camera), d_columns = transposed(d_axes_camera);
  for (std::size_t k = 0; k < 3; ++k) add(d_phi, T(1), cross(columns[k], d_columns[k]));
  for (std::size_t k = 0; k < 3; ++k) {
    result.camera[k] += d_rho[k];
    result.camera[3 + k] += d_phi[k];
  }
}

template View<double> view_of(const Pinhole<double>&, const RenderSettings&);
template View<long double> view_of(const Pinhole<long double>&, const RenderSettings&);
template bool draw(const Scene<double>&, Index, const View<double>&, const RenderSettings&, Drawn<double>&);
template bool draw(const Scene<long double>&, Index, const View<long double>&, const RenderSettings&,
                   Drawn<long double>&);
template void draw_adjoint(const Scene<double>&, Index, const View<double>&, const RenderSettings&,
                           const DrawnGradient<double>&, Gradients<double>&);
template void draw_adjoint(const Scene<long double>&, Index, const View<long double>&, const RenderSettings&,
                           const DrawnGradient<long double>&, Gradients<long double>&);

}  // namespace hsi4d::reference
