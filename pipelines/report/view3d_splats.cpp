#include "pipelines/report/view3d_splats.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "core/quaternion.h"
#include "splat/sh_basis.h"

namespace hsi4d {

namespace {

constexpr double kMostEnlargement = 3;

double opacity_of(const Gaussians& g, Index i) {
  return 1 / (1 + std::exp(-static_cast<double>(g.opacity_logits[static_cast<std::size_t>(i)])));
}

Vector3<double> mean_of(const Gaussians& g, Index i) {
  return Vector3<float>(g.means.data() + 3 * i).cast<double>() + g.origin_world;
}

/// The two largest log scales of a Gaussian, whose exp are the half axes of what is seen of it.
std::pair<double, double> largest_log_scales(const Gaussians& g, Index i) {
  std::array<double, 3> s{};
  for (std::size_t k = 0; k < 3; ++k) s[k] = g.log_scales[static_cast<std::size_t>(3 * i) + k];
  std::sort(s.begin(), s.end());
  return {s[2], s[1]};
}

/// How much a Gaussian adds to what is seen: 0 for one that is not shown.
double weight_of(const Gaussians& g, Index i, const SplatSelection& selection) {
  const double opacity = opacity_of(g, i);
  const auto [largest, second] = largest_log_scales(g, i);
  if (opacity < selection.least_opacity || std::exp(largest) > selection.radius) return 0;
  if (!((mean_of(g, i) - selection.center_world).norm() <= selection.radius)) return 0;
  return opacity * std::exp((largest + second) / 2);
}

template <class T>
T quantised(double value, double low, double high) {
  constexpr double kMost = std::numeric_limits<T>::max();
  const double share = high > low ? (value - low) / (high - low) : 0;
  return static_cast<T>(std::lround(kMost * std::clamp(share, 0.0, 1.0)));
}

struct Box {
  Vector3<double> low = Vector3<double>::Constant(std::numeric_limits<double>::infinity());
  Vector3<double> high = -low;
};

Box box_of(const Gaussians& g, const std::vector<Index>& rows) {
  Box box;
  for (const Index i : rows) {
    const Vector3<double> mean = mean_of(g, i);
    box.low = box.low.cwiseMin(mean);
    box.high = box.high.cwiseMax(mean);
  }
  if (rows.empty()) box.low = box.high = Vector3<double>::Zero();
  // As floats, which is how they are kept: rounded outwards, so that every mean is inside.
  for (Index a = 0; a < 3; ++a) {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    box.low[a] = std::nextafter(static_cast<float>(box.low[a]), -kFar);
    box.high[a] = std::nextafter(static_cast<float>(box.high[a]), kFar);
  }
  return box;
}

void add_splat(const Gaussians& g, Index i, double probability, const Box& box, QuantisedSplats& splats) {
  const Vector3<double> mean = mean_of(g, i);
  const double larger = std::min(-std::log(probability) / 2, std::log(kMostEnlargement));
  const Vector4<double> q =
      quaternion_normalized(Vector4<double>(Vector4<float>(g.quats.data() + 4 * i).cast<double>()));
  const float* const sh = g.sh.data() + 3 * i * g.sh_coefficients();
  for (Index a = 0; a < 3; ++a) {
    splats.positions.push_back(quantised<std::uint16_t>(mean[a], box.low[a], box.high[a]));
    const double log_scale = g.log_scales[static_cast<std::size_t>(3 * i + a)] + larger;
    splats.log_scales.push_back(quantised<std::uint8_t>(log_scale, kLeastLogScale, kLargestLogScale));
    splats.colors.push_back(quantised<std::uint8_t>(0.5 + kShC0 * static_cast<double>(sh[a]), 0, 1));
  }
  splats.colors.push_back(quantised<std::uint8_t>(opacity_of(g, i), 0, 1));
  for (Index a = 0; a < 4; ++a) splats.rotations.push_back(static_cast<std::int8_t>(std::lround(127 * q[a])));
}

/// Σ min(1, c w).
double expected_count(const std::vector<double>& weights, double c) {
  double sum = 0;
  for (const double w : weights) sum += std::min(1.0, c * w);
  return sum;
}

/// c at which expected_count is `count`. More weights than that are above 0.
double scale_for(const std::vector<double>& weights, double count) {
  double low = 0, high = 1;
  while (expected_count(weights, high) < count) high *= 2;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (expected_count(weights, middle) < count ? low : high) = middle;
  }
  return low;
}

}  // namespace

Sample weighted_sample(const std::vector<double>& weights, Index count) {
  const auto has_weight = [](double w) { return w > 0; };
  const bool takes_all = std::count_if(weights.begin(), weights.end(), has_weight) <= count;
  const double c = takes_all || count <= 0 ? 0 : scale_for(weights, static_cast<double>(count));
  Sample sample;
  double sum = 0.5;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double p = takes_all ? (weights[i] > 0 ? 1.0 : 0.0) : std::min(1.0, c * weights[i]);
    const double next = sum + p;
    const bool is_taken = std::floor(next) > std::floor(sum);
    sum = next;
    if (!is_taken || static_cast<Index>(sample.rows.size()) >= count) continue;
    sample.rows.push_back(static_cast<Index>(i));
    sample.probabilities.push_back(p);
  }
  return sample;
}

void add_part(const Gaussians& gaussians, const SplatSelection& selection, QuantisedSplats& splats) {
  check_sizes(gaussians);
  std::vector<double> weights;
  for (Index i = 0; i < gaussians.count(); ++i) weights.push_back(weight_of(gaussians, i, selection));
  const Sample sample = weighted_sample(weights, selection.count);
  const Box box = box_of(gaussians, sample.rows);
  for (const Vector3<double>& corner : {box.low, box.high}) {
    for (Index a = 0; a < 3; ++a) splats.boxes.push_back(static_cast<float>(corner[a]));
  }
  splats.counts.push_back(static_cast<std::int32_t>(sample.rows.size()));
  for (std::size_t s = 0; s < sample.rows.size(); ++s)
    add_splat(gaussians, sample.rows[s], sample.probabilities[s], box, splats);
}

}  // namespace hsi4d
