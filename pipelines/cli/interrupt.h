// Ctrl-C and `kill`: asked for politely first, so that a run can save its state.
#pragma once

namespace hsi4d::cli {

/// While it lives, the first SIGINT or SIGTERM is noted instead of ending the program; a second one ends it at once. A
/// signal that was ignored before stays ignored. One at a time.
class InterruptWatch {
 public:
  InterruptWatch();
  ~InterruptWatch();
  InterruptWatch(const InterruptWatch&) = delete;
  InterruptWatch& operator=(const InterruptWatch&) = delete;

  /// True once a signal has come.
  static bool requested();
};

/// While it lives, SIGUSR1 is noted instead of ending the program: Slurm sends it before a job's time is over. One that
/// came before and was blocked is noted too. Later it does what it did before, but is not blocked any more. One at a
/// time.
class TimeLimitWatch {
 public:
  TimeLimitWatch();
  ~TimeLimitWatch();
  TimeLimitWatch(const TimeLimitWatch&) = delete;
  TimeLimitWatch& operator=(const TimeLimitWatch&) = delete;

  /// True once the signal has come.
  static bool requested();

 private:
  void (*before_)(int);
};

}  // namespace hsi4d::cli
