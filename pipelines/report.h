// The report of a run: one HTML file that needs nothing else, readable on light and dark.
#pragma once

#include <string>

namespace hsi4d {

/// Writes report.html of a run folder, and returns its path.
///
/// It has the run's state and settings, the table of errors, plots of the errors by frame and of the losses, where the
/// time went, and the frames (target, render, difference) to slide through and compare. Styles, plots, images and the
/// script are inside the file; it makes no request. The same folder gives the same bytes.
///
/// Read: status.json, config.resolved.json, summary.json, metrics.jsonl,
/// frames/NNNN_{target,render,difference,start}.png. What is missing is told in the report; a last line of
/// metrics.jsonl that was cut short is, too. Throws UserError when the folder does not exist or holds no run, DataError
/// naming file and line for a file that is damaged.
std::string write_report(const std::string& run_folder);

/// The text of report.html, unwritten. Errors as write_report.
std::string report_html(const std::string& run_folder);

}  // namespace hsi4d
