#include "pipelines/sweep/search.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "core/formatted.h"
#include "core/random.h"
#include "pipelines/sweep/sobol.h"

namespace hsi4d {
namespace {

constexpr double kSteps = 1000;          // what a range is told in: so fine at least
constexpr double kLeastSpacing = 1e-18;  // a thousandth of the least number of a logarithmic range

/// The shortest decimal that is off by no more than half a spacing.
double shortest_near(double value, double spacing) {
  const int decimals = -static_cast<int>(std::floor(std::log10(std::max(spacing, kLeastSpacing))));
  if (decimals <= 0) return std::round(value / std::pow(10, -decimals)) * std::pow(10, -decimals);
  const std::string text = fixed_number(value, decimals);
  double number = value;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

ConfigValue whole_at(const SweepRange& range, double share) {
  const double end = range.to + 1;
  const double place =
      range.is_log ? range.from * std::pow(end / range.from, share) : range.from + share * (end - range.from);
  return ConfigValue::make_integer(static_cast<std::int64_t>(std::clamp(std::floor(place), range.from, range.to)));
}

/// A coordinate of a point in (0, 1).
double share_of(const SweepSearch& search, std::uint64_t index, std::size_t dimension) {
  const auto seed = static_cast<std::uint64_t>(search.seed);
  if (search.method == SweepSampling::kRandom) {
    const Random random(seed, random_stream("sweep.search." + sweep_key(search.over[dimension].key)));
    return std::max(random.uniform(index), 0x1p-53);
  }
  const std::uint64_t shift = Random(seed, random_stream("sweep.search.shift")).bits(dimension) >> 32;
  const std::uint32_t point = sobol_point(static_cast<std::uint32_t>(index), static_cast<int>(dimension));
  return (static_cast<double>(point ^ shift) + 0.5) * 0x1p-32;
}

}  // namespace

std::vector<std::int64_t> rung_sizes(std::int64_t points, std::size_t rungs, int factor) {
  std::vector<std::int64_t> sizes = {points};
  while (sizes.size() < rungs) sizes.push_back(std::max<std::int64_t>(1, sizes.back() / factor));
  return sizes;
}

std::int64_t points_within(const SweepSearch& search, std::int64_t runs_per_point) {
  const std::size_t rungs = std::max<std::size_t>(1, search.rungs.points.size());
  const auto fits = [&](std::int64_t points) {
    std::int64_t all = 0;
    for (const std::int64_t size : rung_sizes(points, rungs, search.factor)) all += size;
    return all <= search.runs / runs_per_point;
  };
  std::int64_t points = 0, most = std::min(kMostSweepRuns, search.runs / runs_per_point);
  while (points < most) {
    const std::int64_t middle = (points + most + 1) / 2;
    if (fits(middle)) {
      points = middle;
    } else {
      most = middle - 1;
    }
  }
  return points;
}

std::optional<std::int64_t> points_of_space(const std::vector<SweepRange>& over) {
  double points = 1;
  for (const SweepRange& range : over) {
    if (range.choices.empty() && !range.is_integer) return std::nullopt;
    points *= range.choices.empty() ? range.to - range.from + 1 : static_cast<double>(range.choices.size());
  }
  return static_cast<std::int64_t>(std::min(points, 0x1p53));
}

ConfigValue value_at(const SweepRange& range, double share) {
  if (!range.choices.empty()) {
    const auto count = static_cast<double>(range.choices.size());
    return range.choices[static_cast<std::size_t>(std::min(share * count, count - 1))];
  }
  if (range.is_integer) return whole_at(range, share);
  const double ratio = std::log(range.to / range.from);
  const double value =
      range.is_log ? range.from * std::exp(ratio * share) : range.from + share * (range.to - range.from);
  const double spacing = (range.is_log ? value * std::min(1.0, ratio) : range.to - range.from) / kSteps;
  return ConfigValue::make_number(std::clamp(shortest_near(value, spacing), range.from, range.to));
}

std::optional<SweepAxis> search_points(const SweepSearch& search, std::int64_t count) {
  SweepAxis axis;
  for (const SweepRange& range : search.over) axis.keys.push_back(range.key);
  std::set<std::string> seen;
  const auto most = static_cast<std::uint64_t>(100 * count + 10000);
  for (std::uint64_t index = 0; index < most && std::ssize(axis.points) < count; ++index) {
    std::vector<SweepSetting> point;
    std::string text;
    for (std::size_t d = 0; d < search.over.size(); ++d) {
      const SweepRange& range = search.over[d];
      point.push_back({range.key, value_at(range, share_of(search, index, d)), range.origin});
      text += sweep_value_text(point.back().value) + "\n";
    }
    if (seen.insert(text).second) axis.points.push_back(std::move(point));
  }
  if (std::ssize(axis.points) < count) return std::nullopt;
  return axis;
}

}  // namespace hsi4d
