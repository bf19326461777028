// The command-line program `hsi4d`.
#pragma once

#include <vector>

#include "optim/loss_term.h"

namespace hsi4d::cli {

/// Runs the program: parses the command line, calls the subcommand, prints errors.
/// @param losses  the loss terms that configs may name; a program of a user's own passes its own terms beside the
/// library's. Returns the exit status: 0 done, 2 the user's mistake (one message, no stack), 3 our bug, 130
/// interrupted.
int run_program(int argc, const char* const* argv, const std::vector<LossTerm>& losses);

}  // namespace hsi4d::cli
