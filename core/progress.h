// How far a long task is: counted by the library, shown by whoever asked for it.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace hsi4d {

/// A part of the number worth watching: a term of a loss.
struct ProgressPart {
  std::string_view name;
  double value = 0;
};

/// A task at one moment. Views are valid during the call that receives it.
struct ProgressState {
  std::string_view task;
  std::int64_t done = 0;
  std::int64_t total = 0;                    ///< 0: not known
  double seconds = 0;                        ///< since the task began
  double steps_per_second = 0;               ///< of late; 0: not known yet
  double seconds_left = -1;                  ///< negative: not known
  std::string_view value_name;               ///< "loss"; empty: none was given
  double value = 0;                          ///< the latest one
  std::span<const ProgressPart> parts = {};  ///< of that value; none when the task is finished
  bool is_finished = false;                  ///< the last call of this task
};

/// Shows a state. Called on the thread that steps.
using ProgressSink = std::function<void(const ProgressState&)>;

/// Seconds from some fixed moment.
using ProgressClock = double (*)();

/// Counts the steps of one task and reports now and then: at the first step, then not more often than the interval, and
/// once at the end. A step in between costs one look at the clock and allocates nothing. Used by one thread at a time.
class Progress {
 public:
  /// @param task      what is being done, at most 63 bytes of it are kept
  /// @param total     how many steps there will be; 0: not known
  /// @param sink      who shows it; empty: nobody, and nothing is measured
  /// @param interval  seconds between two reports
  /// @param clock     for tests; null: the steady clock
  Progress(std::string_view task, std::int64_t total, ProgressSink sink, double interval = 0.1,
           ProgressClock clock = nullptr);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `steps` were done by an earlier process: they count as done, but tell nothing of how fast this one is.
  void skip(std::int64_t steps);
  /// `steps` of the total will not be needed.
  void drop(std::int64_t steps);
  /// `steps` more are done.
  void step(std::int64_t steps = 1);
  /// As step(), with a number worth watching; `name` must outlive the task (a literal), `parts` only the call.
  void step_with(const char* name, double value, std::span<const ProgressPart> parts = {});
  /// Reports the end, once; the destructor does the same.
  void finish();

 private:
  void report(double now, bool is_finished, std::span<const ProgressPart> parts);
  void count(std::int64_t steps, std::span<const ProgressPart> parts);

  std::array<char, 64> task_{};
  std::size_t task_size_ = 0;
  std::int64_t total_, done_ = 0, skipped_ = 0;
  ProgressSink sink_;
  double interval_;
  ProgressClock clock_;
  double begin_ = 0, last_report_ = 0;
  std::int64_t last_done_ = 0;
  double rate_ = 0;  // smoothed, steps a second
  std::string_view value_name_;
  double value_ = 0;
  bool has_reported_ = false, is_finished_ = false;
};

/// "12 s", "3:07", "1:02:45": seconds for people; "?" when negative or not finite.
std::string duration_text(double seconds);

/// One line: "interaction 120/300, 40%, 52.1 steps/s, loss 0.01234 (l1 0.01, ssim 0.0234), 3 s left".
std::string progress_line(const ProgressState& state);

/// As progress_line with a bar of the width that is left in `columns`. When space runs out the bar goes first, then the
/// parts from the last one on ("(l1 0.01, …)"), then figures.
std::string progress_bar(const ProgressState& state, int columns);

}  // namespace hsi4d
