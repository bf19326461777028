// Who watches long work, and how it is asked to stop.
#pragma once

#include <functional>
#include <stdexcept>

#include "core/progress.h"

namespace hsi4d {

struct StageWatch;

/// Somebody asked for the work to stop. The message says what is left of it.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Who watches a run, or the making of a dataset.
struct Observer {
  ProgressSink progress = {};                 ///< empty: nobody
  double progress_interval = 0.1;             ///< seconds
  std::function<bool()> stop_requested = {};  ///< asked after every iteration or frame; empty: never
  const StageWatch* stages = nullptr;         ///< who wants to know where the time of stages goes; null: nobody

  bool wants_stop() const { return stop_requested && stop_requested(); }
};

}  // namespace hsi4d
