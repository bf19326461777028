// Metrics by name: values, and what is known of each: unit, direction, digits.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/table.h"

namespace hsi4d {

/// Numbers by name, in the order in which they are shown.
using MetricValues = std::vector<std::pair<std::string, double>>;

/// The value of that name, or null.
const double* find_metric(const MetricValues& values, std::string_view name);

/// The errors of one frame.
struct FrameMetrics {
  int frame = 0;
  MetricValues values;
};

/// What is known of a metric.
struct MetricFacts {
  std::string_view name;     ///< in summary.json
  std::string_view label;    ///< for people
  std::string_view unit;     ///< "" where it has none
  std::string_view summary;  ///< one line
  int decimals = 2;
  int better = -1;  ///< −1: smaller is better, 1: larger is, 0: neither
};

/// Every metric of summary.json, in the order in which tables show them.
const std::vector<MetricFacts>& metric_facts();

/// The facts of a metric, or null for other numbers of a stage (counters).
const MetricFacts* find_metric_facts(std::string_view name);

/// "root position [mm]".
std::string shown_metric(const MetricFacts& facts);
/// A metric as the heading of a column, "MPJPE, mm ↓".
std::string metric_heading(const MetricFacts& facts);
/// A value to the decimals of its metric; kNoCell for null.
Cell metric_cell(const MetricFacts& facts, const double* value);

/// The metric and its value in each source; empty where none has it.
std::vector<Cell> metric_row(const MetricFacts& facts, const std::vector<const MetricValues*>& sources);

/// Marks the cells whose numbers are the best as they are shown, unless all are the same.
/// @param better  as in MetricFacts
/// @param cells   those whose text begins with no number are passed over
void mark_best(int better, const std::vector<Cell*>& cells);

}  // namespace hsi4d
