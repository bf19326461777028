// `hsi4d avatar fit`: an avatar learnt from pictures.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/cli/program_commands.h"

namespace hsi4d::cli {

/// Learns the avatar that a config describes and writes its file; tells progress on stderr unless `quiet`. Returns
/// what the command prints: how well views are shown, those that were learnt from and those that were held back.
///
/// @param out  a file, *.safetensors
/// Throws UserError, before anything is learnt, when `out` has another ending, is a file that is read (the config, what
/// the config names, a file of the set), or cannot be written; as load_avatar_fit, read_view_set, fit_avatar,
/// write_avatar.
std::string avatar_fit_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                               const std::filesystem::path& out, bool quiet, const std::vector<LossTerm>& terms);

/// Adds the command to `hsi4d avatar`.
void add_avatar_fit(CLI::App& avatar, Program& program);

}  // namespace hsi4d::cli
