// Ctrl-C and `kill`: asked for politely first, so that a run can save its state.
#pragma once

#include "core/progress.h"

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

/// A sink that shows progress by `show` (may be empty) and throws Interrupted once a signal has come, for tasks that
/// have nothing to save.
ProgressSink stopping_progress(ProgressSink show);

}  // namespace hsi4d::cli
