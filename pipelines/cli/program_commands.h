// What the programs `hsi4d`, `hsi4d-bench` and `hsi4d-stress` share: from main's arguments to an exit status.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "pipelines/cli/failure.h"

namespace CLI {
class App;
}

namespace hsi4d::cli {

/// Commands with their arguments.
struct ProgramCommands {
  std::unique_ptr<CLI::App> app;     ///< called "hsi4d"; its subcommands are the commands
  std::function<std::string()> run;  ///< does what the chosen command does; returns what is printed
  int status = kDone;                ///< that `run` leaves

  ProgramCommands();
  virtual ~ProgramCommands();
  ProgramCommands(const ProgramCommands&) = delete;
  ProgramCommands& operator=(const ProgramCommands&) = delete;
};

using MakeCommands = std::function<std::unique_ptr<ProgramCommands>()>;

/// Parses the command line, carries it out and prints what it came to. Errors go to stderr. Returns the exit status.
int run_commands(int argc, const char* const* argv, const MakeCommands& make);

/// The same of a program that has one command: `hsi4d-bench ARGUMENT...` is `hsi4d bench ARGUMENT...`.
int run_command_program(const char* command, int argc, const char* const* argv, const MakeCommands& make);

}  // namespace hsi4d::cli
