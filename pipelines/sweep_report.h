// The results of a sweep as files: results.csv, results.md, report.html.
#pragma once

#include <string>

#include "pipelines/sweep_folder.h"
#include "pipelines/sweep_results.h"

namespace hsi4d {

/// Writes the three from what the folder holds now; runs that are not done are told. Returns what a terminal is shown:
/// the tables, and where the report is. Errors as read_sweep_results.
std::string write_sweep_results(const SweepPaths& paths);

/// The text of report.html: one file that needs no other but for its links to the reports of runs.
std::string sweep_page(const SweepResults& results);

}  // namespace hsi4d
