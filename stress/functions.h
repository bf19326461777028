// How far off the functions are that all else is made of, in units in the last place: exponentials, the sigmoid, sines,
// the coefficients of rotations, harmonics. Each is the program's own, on every instruction set that this processor
// has.
#pragma once

#include <string>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// What errors are told in.
enum class ErrorUnit {
  kUlp,         ///< units in the last place of the exact value
  kLargestUlp,  ///< those of the largest value that the function has: where it has zeros
};

/// A function in a range on an instruction set.
struct FunctionErrors {
  std::string function;   ///< "exp, plain loops"
  std::string precision;  ///< "float" or "double"
  std::string argument;   ///< what `low`, `high` and `worst_at` are of: "x"
  double low = 0, high = 0;
  std::string isa;  ///< "avx512", "avx2", "baseline"; "all" for code that is compiled once
  ErrorUnit unit = ErrorUnit::kUlp;
  double bound = 0;  ///< of the largest error

  Index tried = 0;
  double worst = 0, mean = 0;
  double worst_at = 0;  ///< the argument

  /// What is not a number does not hold.
  bool holds() const { return tried > 0 && worst <= bound; }
};

/// The table. Arguments are random (with fixed seeds), dense where a formula changes into another, and spaced by their
/// bits down to very small ones; exact values are of long double.
///
/// @param points  arguments a row
std::vector<FunctionErrors> function_errors(Index points);

}  // namespace hsi4d
