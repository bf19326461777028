// What a search has found: its points, how good they are, and which of its settings matter.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "pipelines/sweep/results.h"

namespace hsi4d {

/// The number that a JSON text is; nothing for other values.
std::optional<double> number_in(const std::string& json);

/// A point of a search.
struct SearchedPoint {
  std::vector<std::string> values;             ///< of the searched settings, JSON text
  std::vector<std::vector<std::size_t>> runs;  ///< of each rung, of all clips and seeds
  std::vector<std::optional<double>> scores;   ///< of each rung: the median over them, once all are done
  std::size_t rung() const;                    ///< the highest with a score; 0 without
};

/// A search as far as it has come; of one beside ablations or a grid, the points that compete with each other.
struct SearchResults {
  const PlannedSearch* search;
  std::string label;                  ///< of what its runs have in common, "no_contact"; may be empty
  std::vector<SearchedPoint> points;  ///< with a score, the best first: those of a higher rung before others
  std::size_t rungs = 1;
};

/// The searches of a plan, without those of which no point has a score. Points into the results.
std::vector<SearchResults> search_results(const SweepResults& results);

/// The best ten points of a search, with their values and the metric in every rung.
Table best_points_table(const SearchResults& found);

/// How much a setting matters to a metric in the points of a search.
struct Importance {
  double share = 0;   ///< ε² of the metric's ranks by the setting, from which chance is taken off; may be below 0
  double chance = 0;  ///< of 200 orders of the points 95 % have less
  double correlation = 0;  ///< of the ranks; 0 for settings that are no numbers
};

/// Fewest points that tell what matters.
inline constexpr std::size_t kFewestPoints = 10;

/// How much of the variance of the ranks of `scores` the means of groups of equal values explain, with what they would
/// by chance taken off:                                                                         [Kelley 1935]
///
///   ε² = 1 − (n − 1) / (n − k) · Σ (r − mean of its group)² / Σ (r − mean)²
///
/// Groups are the values where there are at most five, else fifths of the sorted numbers, fewer than five where that
/// would be fewer than five points each.
/// @param values  of the setting, JSON text, one a point
/// @return        nothing for fewer than kFewestPoints, or where all values or all scores are equal
std::optional<Importance> importance_of(const std::vector<std::string>& values, const std::vector<double>& scores);

/// The same of each setting of a search, of any metric, from the points' runs in the first rung.
std::vector<std::optional<Importance>> importances(const SweepResults& results, const SearchResults& found,
                                                   const MetricFacts& metric);

}  // namespace hsi4d
