// `hsi4d stress`: every known way to fail, tried; or the errors of the functions that all else is made of.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"
#include "stress/stress.h"

namespace hsi4d::cli {

struct StressOptions {
  std::vector<std::string> rows;  ///< ids, or letters of groups; empty: all
  std::optional<int> threads;     ///< none or 0: one a core
  std::string json;               ///< path for one JSON object a row; empty: none
  bool functions = false;         ///< the table of stress/functions.h instead
  Index points = 100'000;         ///< arguments a row of it
};

/// What the command prints, and what it exits with.
struct StressOutcome {
  std::string text;  ///< a table; its last line is the summary
  int status = 0;    ///< kRowsFailed when a row failed
};

/// Runs the rows. Throws UserError for one that is not known, and for rows beside `functions`.
StressOutcome stress_command(const StressOptions& options);

/// Runs these cases, whatever rows `options` names, and writes its file.
StressOutcome run_cases(std::span<const StressCase> cases, const StressOptions& options);

}  // namespace hsi4d::cli
