// The report of a run: one HTML file that needs nothing else, readable on light and dark.
#pragma once

#include <string>

namespace hsi4d {

/// Writes report.html of a run folder, and returns its path.
///
/// It has the run's state and settings, the table of errors, the frames with a divider between input and result, a 3D
/// view, plots of the errors by frame and of the losses, the paper's figures, and where the time went. Styles, plots,
/// images and scripts are inside the file; it makes no request. The same folder gives the same bytes.
///
/// Read: status.json, config.resolved.json, summary.json, metrics.jsonl, view3d.safetensors,
/// frames/NNNN_{target,render,start,side}.png. What is missing is told in the report; a last line of
/// metrics.jsonl that was cut short is, too. Throws UserError when the folder does not exist or holds no run, DataError
/// naming file and line for a file that is damaged.
std::string write_report(const std::string& run_folder);

/// The text of report.html, unwritten. Errors as write_report.
std::string report_html(const std::string& run_folder);

}  // namespace hsi4d
