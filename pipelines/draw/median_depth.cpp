#include "pipelines/draw/median_depth.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/quaternion.h"
#include "splat/render/covariance.h"
#include "splat/render/median_rows.h"
#include "splat/render/opacity.h"

namespace hsi4d {

namespace {

std::vector<std::int32_t> rows_at_median(const Gaussians& g, const SplatView& view) {
  Tape<float> tape;
  const Index n = g.count();
  const auto constant = [&tape](const char* name, const Shape& shape, const std::vector<float>& values) {
    const Var<float> var = tape.constant(name, shape);
    tape.set(var, values);
    return var;
  };
  const Var<float> axes =
      gaussian_axes(constant("quats", shape_of(n, 4), g.quats), constant("log_scales", shape_of(n, 3), g.log_scales));
  const Var<float> opacities = gaussian_opacities(constant("opacity_logits", shape_of(n, 1), g.opacity_logits));
  const Projected<float> projected = project(constant("means", shape_of(n, 3), g.means), axes,
                                             constant("xi", shape_of(1, 6), std::vector<float>(6)), view);
  for (const Var<float> var :
       {projected.means_px, projected.factors, projected.depths, projected.depth_low, projected.means_low, opacities})
    tape.forward(var);
  return median_rows(tape, projected, opacities, view);
}

/// Depth along a pixel's ray where a Gaussian is densest.
double densest_depth(const Gaussians& g, std::int32_t row, const Camera& camera, const Vector2<double>& pixel) {
  constexpr double kThinnest = 1e-6;  // of the longest axis
  constexpr double kSigmas = 3;
  const auto n = static_cast<std::size_t>(row);
  const Vector3<double> mean =
      transform_point(camera.camera_from_world,
                      Vector3<double>(Vector3<float>(g.means.data() + 3 * n).cast<double>() + g.origin_world));
  const Vector4<double> quat = Vector4<float>(g.quats.data() + 4 * n).cast<double>();
  const Vector3<double> logs = Vector3<float>(g.log_scales.data() + 3 * n).cast<double>();
  Vector3<double> scales = logs.array().exp();
  scales = scales.cwiseMax(kThinnest * scales.maxCoeff());
  const Matrix3<double> axes = camera.camera_from_world.rotation * quaternion_to_matrix(quat);
  const Vector3<double> ray = unproject_pixel(camera, pixel, 1.0);
  const Vector3<double> a = (axes.transpose() * ray).cwiseQuotient(scales),
                        b = (axes.transpose() * mean).cwiseQuotient(scales);
  const double reach = kSigmas * axes.row(2).transpose().cwiseProduct(scales).norm();
  const double depth = a.dot(b) / a.squaredNorm();
  return std::isfinite(depth) ? std::clamp(depth, mean[2] - reach, mean[2] + reach) : mean[2];
}

}  // namespace

std::vector<float> median_depths(const Gaussians& gaussians, const SceneView& view) {
  const Camera& camera = view.camera;
  const std::vector<std::int32_t> rows = rows_at_median(gaussians, {camera, gaussians.origin_world, view.settings});
  std::vector<float> depths(rows.size());
  parallel_for(camera.height, 8, [&](Index begin, Index end) {
    for (Index i = begin * camera.width; i < end * camera.width; ++i) {
      const std::int32_t row = rows[static_cast<std::size_t>(i)];
      if (row < 0) continue;
      const Vector2<double> pixel(static_cast<double>(i % camera.width) + 0.5,
                                  static_cast<double>(i / camera.width) + 0.5);
      depths[static_cast<std::size_t>(i)] =
          static_cast<float>(std::max(densest_depth(gaussians, row, camera, pixel), view.settings.near));
    }
  });
  return depths;
}

}  // namespace hsi4d
