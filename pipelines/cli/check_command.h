// `hsi4d check CONFIG`: what is wrong with a config, or what it will do.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_description.h"

namespace hsi4d::cli {

/// Reads a config of any kind, throws UserError with all its problems, and returns a short summary, or the resolved
/// config when `print_config` is set.
std::string check_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                          bool print_config, const std::vector<LossDescription>& losses);

}  // namespace hsi4d::cli
