// What the method's paper publishes, to stand beside our own figures and never among them.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/table.h"
#include "pipelines/record/summary.h"

namespace hsi4d {

/// A figure of another method, as the paper has it.
struct OtherFigure {
  std::string_view method;
  double value;
};

/// A mean over the paper's static clips (a person and the scene) or dynamic ones (who moves an object too).
struct PublishedFigure {
  bool is_dynamic;
  std::string_view label;
  std::string_view metric;  ///< ours in summary.json; "" where there is none
  double value;             ///< of ZeroHSI
  int decimals;
  int better;                       ///< as in MetricFacts
  std::vector<OtherFigure> others;  ///< methods that it is compared with
  std::string_view summary;
};

/// Where they are from.
inline constexpr std::string_view kPublishedSource =
    "Li et al., ZeroHSI (arXiv 2412.18600, 3DV 2026), the tables of the main paper; 11 static and 9 dynamic clips, "
    "five "
    "seeds each, 10 frames a second, without refinement (its supplement, C.1 and C.6)";

/// All that are known.
const std::vector<PublishedFigure>& published_figures();

/// Whether metrics are of a clip with an object, by what there is of objects among them: those of a run have
/// contact_share in each such clip.
bool is_of_objects(const MetricValues& values);

/// Our value that stands beside a published one: of the same metric, and of a clip of the same kind; else null.
/// @param is_dynamic  whether the clip has an object
const double* own_figure(const PublishedFigure& figure, const MetricValues& values, bool is_dynamic);

/// A row a figure: its clips, ours in each column (marked "own"), the paper's, and those of other methods.
/// @param own  our value of a column, where there is one
Table published_table(
    const std::vector<std::string>& columns,
    const std::function<std::optional<double>(const PublishedFigure& figure, std::size_t column)>& own);

}  // namespace hsi4d
