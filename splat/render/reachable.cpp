#include "splat/render/reachable.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "core/parallel.h"

namespace hsi4d {

namespace {

/// Room for rounding, and for a rotation that is orthonormal only to 1e-4.
constexpr double kSlack = 1.001;
constexpr double kSlackPixels = 1;

/// An axis of the image.
struct Axis {
  double focal, center, size;  ///< pixels
  double steepest;             ///< of x/z as the projection's Jacobian holds it
};

Axis axis_of(double focal, double center, double size, const RenderSettings& settings) {
  const double margin = (settings.frustum_clamp - 1) * size / 2;
  return {focal, center, size, (std::max(center, size - center) + margin) / focal};
}

/// Where a Gaussian may be: a point in the camera's frame, and how far it is from there at most, metres.
struct Ball {
  Vector3<double> center;
  double away;
};

/// Whether the pixels along one axis may include some of the image's. A Gaussian of largest scale s reaches
/// k √(s² (1 + h²) (f/z)² + blur) pixels from its mean, k where alpha falls to alpha_min.
bool meets(const Axis& axis, const Ball& ball, int row, double scale, double k, double blur) {
  const double nearest = ball.center[2] - ball.away, farthest = ball.center[2] + ball.away;
  const double low = ball.center[row] - ball.away, high = ball.center[row] + ball.away;
  const double lowest = axis.focal * (low < 0 ? low / nearest : low / farthest) + axis.center;
  const double highest = axis.focal * (high > 0 ? high / nearest : high / farthest) + axis.center;
  const double spread = scale * axis.focal / nearest;
  const double reach =
      kSlack * k * std::sqrt(spread * spread * (1 + axis.steepest * axis.steepest) + blur) + kSlackPixels;
  return highest + reach >= 0 && lowest - reach <= axis.size;
}

}  // namespace

std::vector<Index> reachable_rows(const Gaussians& gaussians, const SplatView& view, const CameraReach& reach) {
  check_sizes(gaussians);
  const RenderSettings& settings = view.settings;
  std::vector<Index> rows(static_cast<std::size_t>(gaussians.count()));
  std::iota(rows.begin(), rows.end(), Index(0));
  if (!(settings.alpha_min > 0)) return rows;
  const Camera& camera = view.camera;
  const detail::MovedCamera place = detail::moved_camera(view, Vector6<double>::Zero());
  const Axis x = axis_of(camera.fx, camera.cx, camera.width, settings);
  const Axis y = axis_of(camera.fy, camera.cy, camera.height, settings);
  const auto is_reachable = [&](Index n) {
    const auto number = [n](const std::vector<float>& of, Index width, Index i) {
      return static_cast<double>(of[static_cast<std::size_t>(n * width + i)]);
    };
    const double opacity = 1 / (1 + std::exp(-number(gaussians.opacity_logits, 1, 0)));
    const double log_ratio = std::log(opacity / settings.alpha_min);
    if (log_ratio < -1e-3) return false;
    double largest = number(gaussians.log_scales, 3, 0);
    for (Index i = 1; i < 3; ++i) largest = std::max(largest, number(gaussians.log_scales, 3, i));
    const Vector3<double> mean(number(gaussians.means, 3, 0), number(gaussians.means, 3, 1),
                               number(gaussians.means, 3, 2));
    Ball ball{place.rotation * (mean - place.center), 0};
    ball.away = kSlack * (reach.rotation * ball.center.norm() + reach.translation) + 1e-6 * ball.center.norm();
    if (ball.center[2] + ball.away <= settings.near) return false;
    if (!(ball.center[2] - ball.away > settings.near)) return true;  // so near, or not finite
    const double scale = std::exp(largest), k = std::sqrt(2 * (log_ratio + 2e-3));
    return meets(x, ball, 0, scale, k, settings.blur) && meets(y, ball, 1, scale, k, settings.blur);
  };
  std::vector<std::uint8_t> kept(rows.size());
  constexpr Index kGrain = 4096;
  parallel_for(gaussians.count(), kGrain, [&](Index begin, Index end) {
    for (Index n = begin; n < end; ++n) kept[static_cast<std::size_t>(n)] = is_reachable(n) ? 1 : 0;
  });
  std::erase_if(rows, [&](Index n) { return kept[static_cast<std::size_t>(n)] == 0; });
  return rows;
}

}  // namespace hsi4d
