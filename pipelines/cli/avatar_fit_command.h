// `hsi4d avatar fit`: an avatar learnt from pictures, or from the video of a run.
#pragma once

#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/cli/program_commands.h"

namespace hsi4d::cli {

struct AvatarFitOptions {
  std::string config;  ///< empty: that of configs/avatar/from_run.json
  std::string run;     ///< folder of a run whose frames are learnt from; empty: the config's `views` are
  std::vector<std::string> overrides = {};
  std::string out;  ///< a file, *.safetensors
  bool quiet = false;
};

/// Learns the avatar that a config describes and writes its file; tells progress on stderr unless `quiet`. Returns
/// what the command prints: how well views are shown, before and after, those that were learnt from and those that were
/// held back.
///
/// Throws UserError, before anything is learnt, when `out` has another ending, is a file that is read (the config, what
/// the config names, a file of the set), or cannot be written; for neither config nor run; as load_avatar_fit,
/// read_view_set, run_views, fit_avatar, write_avatar.
std::string avatar_fit_command(const AvatarFitOptions& options, const std::vector<LossTerm>& terms);

/// Adds the command to `hsi4d avatar`.
void add_avatar_fit(CLI::App& avatar, Program& program);

}  // namespace hsi4d::cli
