#include "splat/files/info.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "splat/limits.h"

namespace hsi4d {
namespace {

template <class F>
std::vector<float> mapped(const std::vector<float>& values, F f) {
  std::vector<float> result(values.size());
  std::transform(values.begin(), values.end(), result.begin(), f);
  return result;
}

std::vector<double> powers_of_ten(const Distribution& scale) {
  const int first = static_cast<int>(std::floor(std::log10(scale.smallest)));
  const int last = std::max(first + 1, static_cast<int>(std::ceil(std::log10(scale.largest))));
  std::vector<double> edges;
  for (int power = first; power <= last; ++power) edges.push_back(std::pow(10.0, power));
  return edges;
}

/// How many stand where an earlier one does.
Index duplicates_in(const std::vector<float>& means) {
  std::vector<std::array<float, 3>> places(means.size() / 3);
  for (std::size_t n = 0; n < places.size(); ++n) places[n] = {means[3 * n], means[3 * n + 1], means[3 * n + 2]};
  std::sort(places.begin(), places.end());
  return static_cast<Index>(places.end() - std::unique(places.begin(), places.end()));
}

/// The diagonal of the box that the middle 90 % of the means' coordinates fill.
double middle_diagonal(const std::vector<float>& means) {
  double squares = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<float> coordinates;
    for (std::size_t i = c; i < means.size(); i += 3) coordinates.push_back(means[i]);
    const Distribution d = distribution_of(std::move(coordinates));
    squares += (d.percentile_95 - d.percentile_5) * (d.percentile_95 - d.percentile_5);
  }
  return std::sqrt(squares);
}

Suspicions suspicions_of(const Gaussians& g, const std::vector<float>& opacities) {
  Suspicions s;
  s.duplicates = duplicates_in(g.means);
  s.transparent = std::count_if(opacities.begin(), opacities.end(), [](float o) { return o < kAlphaMin; });
  const double diagonal = middle_diagonal(g.means);
  for (std::size_t n = 0; n < g.opacity_logits.size(); ++n) {
    std::array<float, 3> axes = {g.log_scales[3 * n], g.log_scales[3 * n + 1], g.log_scales[3 * n + 2]};
    std::sort(axes.begin(), axes.end());
    if (diagonal > 0 && std::exp(static_cast<double>(axes[2])) > diagonal) ++s.huge;
    if (static_cast<double>(axes[2]) - static_cast<double>(axes[1]) >= std::log(kNeedleAspect)) ++s.needles;
  }
  return s;
}

}  // namespace

Histogram histogram_of(std::span<const float> values, std::vector<double> edges) {
  HSI4D_CHECK(edges.size() >= 2 && std::is_sorted(edges.begin(), edges.end()), "edges of a histogram must ascend");
  Histogram h{std::move(edges), {}};
  h.counts.resize(h.edges.size() - 1);
  for (const float value : values) {
    const auto above = std::upper_bound(h.edges.begin(), h.edges.end(), static_cast<double>(value));
    const auto bin = std::clamp<std::ptrdiff_t>(above - h.edges.begin() - 1, 0, std::ssize(h.counts) - 1);
    ++h.counts[static_cast<std::size_t>(bin)];
  }
  return h;
}

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
  const std::vector<float> opacities = mapped(gaussians.opacity_logits, [](float x) { return 1 / (1 + std::exp(-x)); });
  const std::vector<float> scales = mapped(gaussians.log_scales, [](float x) { return std::exp(x); });
  s.opacity = distribution_of(opacities);
  s.scale = distribution_of(scales);
  if (s.count == 0) return s;
  s.opacity_histogram = histogram_of(opacities, {0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1});
  s.scale_histogram = histogram_of(scales, powers_of_ten(s.scale));
  s.suspicions = suspicions_of(gaussians, opacities);
  return s;
}

}  // namespace hsi4d
