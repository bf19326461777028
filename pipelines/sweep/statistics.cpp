#include "pipelines/sweep/statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/check.h"
#include "core/random.h"

namespace hsi4d {

SampleStatistics sample_statistics(std::span<const double> values) {
  SampleStatistics sample{values.size()};
  if (values.empty()) return sample;
  const auto count = static_cast<double>(values.size());
  for (const double value : values) sample.mean += value / count;
  double squares = 0;
  for (const double value : values) squares += (value - sample.mean) * (value - sample.mean);
  if (values.size() > 1) sample.deviation = std::sqrt(squares / (count - 1));
  return sample;
}

double quantile(std::span<const double> sorted, double share) {
  HSI4D_CHECK(!sorted.empty(), "there is no quantile of nothing");
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (place - std::floor(place)) * (sorted[above] - sorted[below]);
}

std::optional<Interval> bootstrap_interval(std::span<const double> values, double confidence, Index samples) {
  if (values.size() < 2) return std::nullopt;
  RandomSequence random(0, random_stream("sweep.bootstrap"));
  std::vector<double> means(static_cast<std::size_t>(samples));
  for (double& mean : means) {
    for (std::size_t i = 0; i < values.size(); ++i) mean += values[random.below(values.size())];
    mean /= static_cast<double>(values.size());
  }
  std::sort(means.begin(), means.end());
  const double tail = (1 - confidence) / 2;
  return Interval{quantile(means, tail), quantile(means, 1 - tail)};
}

}  // namespace hsi4d
