#include "splat/info.h"

#include <algorithm>
#include <cmath>

namespace hsi4d {
namespace {

template <class F>
std::vector<float> mapped(const std::vector<float>& values, F f) {
  std::vector<float> result(values.size());
  std::transform(values.begin(), values.end(), result.begin(), f);
  return result;
}

}  // namespace

Distribution distribution_of(std::vector<float> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&values](double share) {  // the smallest value with at least this share at or below it
    const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
    return static_cast<double>(values[std::max<std::size_t>(rank, 1) - 1]);
  };
  return {values.front(), at(0.05), at(0.5), at(0.95), values.back()};
}

GaussianStatistics statistics_of(const Gaussians& gaussians) {
  check_sizes(gaussians);
  GaussianStatistics s;
  s.count = gaussians.count();
  s.sh_degree = gaussians.sh_degree;
  for (Index n = 0; n < s.count; ++n) {
    const float* mean = gaussians.means.data() + 3 * n;
    const Vector3<double> world = gaussians.origin_world + Vector3<double>(mean[0], mean[1], mean[2]);
    s.lower_world = n == 0 ? world : Vector3<double>(s.lower_world.cwiseMin(world));
    s.upper_world = n == 0 ? world : Vector3<double>(s.upper_world.cwiseMax(world));
  }
  s.opacity = distribution_of(mapped(gaussians.opacity_logits, [](float x) { return 1 / (1 + std::exp(-x)); }));
  s.scale = distribution_of(mapped(gaussians.log_scales, [](float x) { return std::exp(x); }));
  return s;
}

}  // namespace hsi4d
