// What the programs `hsi4d`, `hsi4d-bench` and `hsi4d-stress` share: from main's arguments to an exit status.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/cli/failure.h"

namespace CLI {
class App;
}

namespace hsi4d::cli {

/// What the commands of a program read, and what the chosen one leaves.
struct Program {
  std::vector<LossTerm> terms = {};       ///< that configs may name
  std::function<std::string()> run = {};  ///< does what the chosen command does; returns what is printed
  int status = kDone;                     ///< that `run` leaves

  /// Makes a command's options, which live as long as the program.
  template <class Options>
  Options& options() {
    const auto made = std::make_shared<Options>();
    kept.push_back(made);
    return *made;
  }

  std::vector<std::shared_ptr<void>> kept = {};  ///< the options of all commands
};

/// Adds commands to an app called "hsi4d", whose subcommands they are.
using AddCommands = std::function<void(CLI::App& app, Program& program)>;

/// Makes `run` what the program does where the command is chosen.
void run_when_chosen(CLI::App& command, Program& program, std::function<std::string()> run);

/// Parses the command line, carries it out and prints what it came to. Errors go to stderr. Returns the exit status.
int run_commands(int argc, const char* const* argv, const AddCommands& add, const std::vector<LossTerm>& terms = {});

/// The same of a program that has one command: `hsi4d-bench ARGUMENT...` is `hsi4d bench ARGUMENT...`.
int run_command_program(const char* command, int argc, const char* const* argv, const AddCommands& add,
                        const std::vector<LossTerm>& terms = {});

}  // namespace hsi4d::cli
