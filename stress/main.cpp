// The program `hsi4d-stress`, which `hsi4d stress` starts.
#include <CLI/CLI.hpp>

#include "pipelines/cli/options.h"
#include "pipelines/cli/other_programs.h"
#include "pipelines/cli/program_commands.h"
#include "stress/command.h"

namespace hsi4d::cli {
namespace {

void add_stress(CLI::App& app, Program& program) {
  StressOptions& stress = program.options<StressOptions>();
  CLI::App* command = app.add_subcommand(kStressProgram.command, kStressProgram.summary);
  command->add_option("--row", stress.rows, "Only these: A1, or a letter for its group; default: all")->type_name("ID");
  add_threads(*command, stress.threads);
  command->add_option("--json", stress.json, "File for the figures, one JSON object a row")->type_name("F");
  command->add_flag("--functions", stress.functions,
                    "Instead: how far off exponentials, sigmoid, sines, rotations and harmonics are, in units in "
                    "the last place, on each instruction set");
  command->add_option("--points", stress.points, "Of --functions: arguments a row, 1000 or more")
      ->check(CLI::Range(Index(1000), Index(1) << 30))
      ->type_name("N");
  command->footer("Exit status: 1 when a row fails, or holds without its remedy too.");
  run_when_chosen(*command, program, [&] {
    StressOutcome outcome = stress_command(stress);
    program.status = outcome.status;
    return outcome.text;
  });
}

}  // namespace
}  // namespace hsi4d::cli

int main(int argc, char** argv) {
  using namespace hsi4d;
  return cli::run_command_program("stress", argc, argv, cli::add_stress);
}
