#include "pipelines/cli/program.h"

#include <CLI/CLI.hpp>

#include "core/version.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/other_programs.h"

namespace hsi4d::cli {

int run_program(int argc, const char* const* argv, const std::vector<LossTerm>& losses) {
  const auto add = [&](CLI::App& app, Program& program) {
    if (is_other_program(argc, argv)) become_other_program(argv);
    app.set_version_flag("--version", std::string("hsi4d ") + version() + " (" + git_commit() + ")");
#define HSI4D_COMMAND(name) add_##name(app, program);
    HSI4D_COMMANDS
#undef HSI4D_COMMAND
  };
  return run_commands(argc, argv, add, losses);
}

}  // namespace hsi4d::cli
