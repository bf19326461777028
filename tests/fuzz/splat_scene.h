// What the fuzz targets of all formats of Gaussians share: two Gaussians, and what must hold of all that is taken.
#pragma once

#include <cmath>

#include "core/check.h"
#include "splat/files/splat_report.h"

namespace hsi4d::fuzz {

inline Gaussians two_gaussians(int degree) {
  Gaussians g;
  g.sh_degree = degree;
  g.means = {0, 1, 2, -3, 4, 5};
  g.quats = {1, 0, 0, 0, 0.5F, -0.5F, 0.5F, 2};
  g.log_scales = {-3, -4, -5, 0, 1, 2};
  g.opacity_logits = {-1, 3};
  for (int i = 0; i < 2 * 3 * g.sh_coefficients(); ++i) g.sh.push_back(static_cast<float>(i) / 16 - 1);
  return g;
}

/// Sizes fit, numbers are finite and within their limits, every row is accounted for.
inline void check_scene(const SplatFile& scene) {
  const Gaussians& g = scene.gaussians;
  check_sizes(g);
  HSI4D_CHECK_EQ(static_cast<Index>(scene.report.row_of.size()), g.count());
  HSI4D_CHECK_EQ(g.count() + scene.report.rejected, scene.report.rows);
  Index rejected = 0;
  for (const auto& [reason, count] : scene.report.rejections) rejected += count;
  HSI4D_CHECK_EQ(rejected, scene.report.rejected);
  for (const auto* values : {&g.means, &g.quats, &g.sh}) {
    for (const float value : *values) HSI4D_CHECK(std::isfinite(value), "a number that is not finite was let through");
  }
  for (const auto* values : {&g.log_scales, &g.opacity_logits}) {
    for (const float value : *values) HSI4D_CHECK(std::fabs(value) <= 20, "a number beyond its limit was let through");
  }
}

}  // namespace hsi4d::fuzz
