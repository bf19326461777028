// Checks the adjoints of a recorded tape against central differences, and names the operator that is wrong.
//
// Works on any tape, also inside a real optimisation: values are restored afterwards. Each check takes a random
// cotangent (the sum of the outputs alone misses errors that cancel).
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

struct GradcheckOptions {
  /// Error of an entry that is a failure, relative to the largest of: the entry, the array's root mean square gradient.
  double tolerance = 1e-7;
  /// Step relative to max(|x|, root mean square of the array, 1e-3); six evaluations within ±3 steps (error ~ step⁶).
  double step = 2e-3;
  /// Where a discrete choice changes within the step, ten times shorter ones are tried that are not below this
  /// (relative as the step); by default none.
  double shortest_step = 1;
  /// Entries tried of each array; chosen at random when the array holds more.
  Index entries = 64;
  /// Share of entries that may lie at a kink (a discrete choice changes within the step, differences of two step sizes
  /// disagree, or those to the left and to the right) before the check fails for seeing too little.
  double kink_share = 0.1;
  /// Checks each operator by itself as well, on its own inputs.
  bool each_node = true;
  std::uint64_t seed = 1;
};

/// One entry whose gradient is wrong.
struct GradcheckFailure {
  std::string node;    ///< operator, or "whole tape" for the gradient of a leaf through everything
  std::string source;  ///< where the operator was recorded
  std::string array;   ///< input whose gradient is wrong
  Index plane = 0, row = 0, col = 0;
  double expected = 0, computed = 0;
};

/// What was found of one array: an input of an operator by itself, or a leaf through the whole tape.
struct GradcheckArray {
  std::string node;  ///< as GradcheckFailure's
  std::string array;
  int input = -1;  ///< which of the operator's inputs; −1: a leaf through the whole tape
  Index entries = 0, kinks = 0;
  double worst_error = 0;
};

struct GradcheckReport {
  Index entries = 0, kinks = 0;
  double worst_error = 0;  ///< relative, over the entries that are no kinks
  std::vector<GradcheckArray> arrays;
  std::vector<GradcheckFailure> failures;
  bool too_many_kinks = false;

  /// True when something was tried and nothing was wrong.
  bool ok() const { return entries > 0 && failures.empty() && !too_many_kinks; }
  /// A few lines: what was tried, the worst error, the first failures.
  std::string text() const;
};
std::ostream& operator<<(std::ostream& stream, const GradcheckReport& report);

/// Checks d(cotangent · result) / d(every unfrozen leaf), and each operator on the way.
GradcheckReport gradcheck(Tape<double>& tape, Var<double> result, const GradcheckOptions& options = {});

}  // namespace hsi4d
