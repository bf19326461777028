// Time that a piece of work takes.
#pragma once

#include <chrono>
#include <ctime>
#include <utility>

#include "core/parallel.h"

namespace hsi4d {

/// Seconds since it was made or last asked; on one thread those that the processor gave, so that other programs of the
/// machine do not count.
class Stopwatch {
 public:
  double lap() {
    const double now = seconds();
    return now - std::exchange(last_, now);
  }

 private:
  static double seconds() {
    timespec time{};
    clock_gettime(thread_count() == 1 ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }
  double last_ = seconds();
};

/// Seconds of the wall clock since `start`, for what people wait for.
inline double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace hsi4d
