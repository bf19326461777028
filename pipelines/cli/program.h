// The command-line program `hsi4d`.
#pragma once

#include <exception>
#include <string>
#include <vector>

#include "optim/loss_term.h"

namespace hsi4d::cli {

/// Exit statuses, which other programs rely on.
inline constexpr int kDone = 0;
inline constexpr int kUserMistake = 2;
inline constexpr int kOurBug = 3;
inline constexpr int kInterrupted = 130;

/// What the program says of an exception that ended a command, and the status it exits with.
struct Failure {
  int status = kOurBug;
  std::string message;  ///< for stderr, without a line break at its end
};

/// UserError and DataError are the user's: their message, status 2. Interrupted is status 130. Everything else is our
/// bug: status 3 and a request to report it.
Failure describe_failure(const std::exception_ptr& error);

/// Runs the program: parses the command line, calls the subcommand, prints errors.
/// @param losses  the loss terms that configs may name; a program of a user's own passes its own terms beside the
/// library's. Returns the exit status: 0 done, 2 the user's mistake (one message, no stack), 3 our bug, 130
/// interrupted.
int run_program(int argc, const char* const* argv, const std::vector<LossTerm>& losses);

}  // namespace hsi4d::cli
