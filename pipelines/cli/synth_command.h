// `hsi4d synth`: a dataset with exact ground truth.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_description.h"

namespace hsi4d::cli {

/// Makes the dataset that the config's section `synthetic` describes, and tells progress on stderr unless `quiet`.
/// The other sections go along in its config.json. Returns what the command prints.
///
/// @param out  a new or empty folder; it appears when everything in it is complete
/// Throws UserError with all problems of the config, or when the folder is not empty or cannot be written;
/// Interrupted after Ctrl-C.
std::string synth_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                          const std::filesystem::path& out, bool quiet, const std::vector<LossDescription>& losses);

}  // namespace hsi4d::cli
