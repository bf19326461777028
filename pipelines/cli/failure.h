// How the program ends: its exit status, and what it says of an exception.
#pragma once

#include <exception>
#include <string>

#include "core/exit_status.h"

namespace hsi4d::cli {

using namespace exit_status;

/// What the program says of an exception that ended a command, and the status it exits with.
struct Failure {
  int status = kOurBug;
  std::string message;  ///< for stderr, without a line break at its end
};

/// UserError and DataError are the user's: their message, status 2. Interrupted is status 130. Everything else is our
/// bug: status 3 and a request to report it.
Failure describe_failure(const std::exception_ptr& error);

}  // namespace hsi4d::cli
