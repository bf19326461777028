// The results of a sweep as files: results.csv, results.md, report.html.
#pragma once

#include <string>

#include "pipelines/sweep/folder.h"
#include "pipelines/sweep/results.h"

namespace hsi4d {

/// What was written, and the text that tells it: the tables of results.md, and where the report is.
struct SweepWritten {
  SweepResults results;
  std::string text;
};

/// Writes the three from what the folder holds now; runs that are not done are told. Errors as read_sweep_results.
SweepWritten write_sweep_results(const SweepPaths& paths);

/// The text of report.html: one file that needs no other but for its links to the reports of runs.
std::string sweep_page(const SweepResults& results);

}  // namespace hsi4d
