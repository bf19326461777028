// What a terminal is shown of a sweep: its tables within the width that there is. Files and other programs get the
// whole text.
#pragma once

#include <optional>
#include <string>

#include "pipelines/sweep/report.h"
#include "pipelines/sweep/tables.h"

namespace hsi4d::cli {

/// Means and differences in columns that are folded to a terminal's width, with the best and what differs clearly
/// marked by *; those of single clips are left to results.md, which it names.
std::string sweep_text(const SweepPaths& paths, const SweepResults& results, int columns);

/// The table in columns that are folded to that width, or as Markdown where there is none; empty for one without rows.
std::string sweep_table_text(const Table& table, std::optional<int> columns);

/// Writes the results of a sweep and returns what is shown of them where stdout leads to.
std::string write_and_show_results(const SweepPaths& paths);

}  // namespace hsi4d::cli
