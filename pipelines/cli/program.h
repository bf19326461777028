// The command-line program `hsi4d`.
#pragma once

namespace hsi4d::cli {

/// Runs the program: parses the command line, calls the subcommand, prints errors.
/// Returns the exit status: 0 done, 2 the user's mistake (one message, no stack), 3 our bug, 130 interrupted.
int run_program(int argc, const char* const* argv);

}  // namespace hsi4d::cli
