// The stress suite: every way in which such software is known to go wrong, tried out. A case is one row of the
// catalogue (docs/numerics/failures.md): it measures how far off the program is on inputs that bring the failure about,
// and the same of a computation without the row's remedy, which has to be further off than is allowed. A case that
// passes both ways would prove nothing.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// Whether what is tried is the program's own way, or one without the row's remedy.
enum class Remedy { kOn, kOff };

/// One figure of a case. It holds when measured ≤ allowed; what is not a number does not hold.
struct StressFigure {
  std::string what;  ///< with its unit: "relative error of det"
  double measured = 0;
  double allowed = 0;

  bool holds() const { return measured <= allowed; }
};

/// One row of the catalogue.
struct StressCase {
  const char* id;       ///< "A1"
  const char* failure;  ///< what goes wrong, in a few words
  const char* remedy;   ///< what is switched off without it
  /// The figures, the same ones in the same order for both. The same in every run but for times; seconds at most. What
  /// it throws counts as a figure that does not hold, and without the remedy proves nothing.
  std::vector<StressFigure> (*run)(Remedy);
  const char* tried_on = "";  ///< the scenes by their sizes, where there are such: "60 Gaussians, 48 x 32 px"
  const char* exempt = "";    ///< why this row cannot apply here; then `run` is null
  bool own_threads = false;   ///< it compares numbers of threads, so it runs beside any limit
};

/// What became of a case.
struct StressResult {
  const StressCase* row = nullptr;
  std::vector<StressFigure> with, without;  ///< the remedy
  std::string error, error_without;         ///< what was thrown
  double seconds = 0;

  /// The program's own way holds.
  bool holds() const;
  /// Without the remedy some figure was measured that does not hold.
  bool would_fail() const;
  bool passed() const { return holds() && would_fail(); }
};

/// All cases, in the order of the catalogue: rows A1 to F16, then those beyond it (poison, metamorphic, long runs).
std::span<const StressCase> stress_cases();

/// Runs cases in order.
/// @param done     called after each of them; may be empty
/// @param threads  at most so many for all but those which compare numbers of them; 0: one a core
std::vector<StressResult> run_stress(std::span<const StressCase> cases,
                                     const std::function<void(const StressResult&)>& done = {}, int threads = 0);

}  // namespace hsi4d
