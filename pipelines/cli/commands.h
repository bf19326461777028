// The subcommands, apart from how their arguments are written. Each returns what it prints on stdout.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_description.h"

namespace hsi4d::cli {

/// `hsi4d check CONFIG`: reads a config of either kind, throws UserError with all its problems, and returns a short
/// summary, or the resolved config when `print_config` is set.
std::string check_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                          bool print_config, const std::vector<LossDescription>& losses);

/// `hsi4d schema [KIND]`: the JSON Schema of configs of `hsi4d run` ("run"), `hsi4d avatar fit` ("avatar_fit") or
/// `hsi4d sweep` ("sweep").
/// Throws UserError for another kind.
std::string schema_command(const std::string& kind, const std::vector<LossDescription>& losses);
/// Its kinds.
std::vector<std::string> schema_kinds();

/// What `hsi4d list` can list.
std::vector<std::string> list_topics();

/// `hsi4d list TOPIC`: a table, a line an entry. Throws UserError, with the nearest topic, for one that is not known.
std::string list_command(const std::string& topic, const std::vector<LossDescription>& losses);

}  // namespace hsi4d::cli
