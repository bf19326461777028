// What the method's paper publishes, to stand beside a run's own numbers.
#pragma once

#include <string>

#include "pipelines/record/summary.h"

namespace hsi4d {

/// The section of the report: the paper's figures, and this run's where it has the metric. Its data is not public, so
/// they are of other clips, which the section says.
std::string published_section(const RunSummary& summary);

}  // namespace hsi4d
