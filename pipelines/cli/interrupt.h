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

}  // namespace hsi4d::cli
