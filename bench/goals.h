// Figures that the project asks of itself, printed beside what a run measured.
//
// A benchmark may set the counter "fma" to the fused multiply-adds that one iteration must do; its share of the
// processor's measured peak is then printed too.
#pragma once

#include <string>

namespace hsi4d::bench {

/// Asks that the median time of `numerator` be at most `bound` times that of `denominator` (benchmark names).
void ask_ratio(std::string what, std::string numerator, std::string denominator, double bound);

/// Asks that the median time of `name`, divided by `per` (nodes, pixels, …), be at most `bound_ns` nanoseconds.
void ask_time(std::string what, std::string name, double bound_ns, double per = 1);

/// Names of the benchmarks that measure the peak rate of fused multiply-adds.
inline constexpr const char* kPeakFloat = "peak/fma_float";
inline constexpr const char* kPeakDouble = "peak/fma_double";

/// Registers its statements when the program starts: `const AtStart goals([] { ask_ratio(…); });`
struct AtStart {
  template <class F>
  explicit AtStart(F&& f) {
    f();
  }
};

}  // namespace hsi4d::bench
