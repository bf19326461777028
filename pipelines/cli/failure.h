// How the program ends: its exit statuses, and what it says of an exception.
#pragma once

#include <exception>
#include <string>

namespace hsi4d::cli {

/// Exit statuses, which other programs rely on.
inline constexpr int kDone = 0;
inline constexpr int kRowsFailed = 1;  ///< of `hsi4d stress`, or bounds broken of its functions
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

}  // namespace hsi4d::cli
