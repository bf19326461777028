#include "pipelines/cli/program.h"

#include "pipelines/cli/command_line.h"
#include "pipelines/cli/other_programs.h"

namespace hsi4d::cli {

int run_program(int argc, const char* const* argv, const std::vector<LossTerm>& losses) {
  return run_commands(argc, argv, [&]() -> std::unique_ptr<ProgramCommands> {
    if (is_other_program(argc, argv)) become_other_program(argv);
    return std::make_unique<CommandLine>(losses);
  });
}

}  // namespace hsi4d::cli
