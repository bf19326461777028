// The subcommand `hsi4d report`.
#pragma once

#include <string>
#include <vector>

namespace hsi4d::cli {

/// `hsi4d report RUN...`: writes report.html of each run folder; returns its path and table of errors, for each.
/// Throws as write_report.
std::string report_command(const std::vector<std::string>& runs);

}  // namespace hsi4d::cli
