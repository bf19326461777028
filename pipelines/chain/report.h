// The report of a chain: the errors of its clips and at the joins, with links to the clips' own reports.
#pragma once

#include <string>

namespace hsi4d {

/// Whether a run folder is one of a chain: its config has clips.
bool is_chain_folder(const std::string& folder);

/// Writes report.html of the folder of a chain that is done, and returns its path. The same folder gives the same
/// bytes. Throws UserError where summary.json is missing, DataError where it is damaged.
std::string write_chain_report(const std::string& folder);

}  // namespace hsi4d
