#include "core/progress.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/text.h"

namespace hsi4d {
namespace {

constexpr double kRateMemory = 5;  // seconds after which an old rate counts for 1/e
constexpr int kLeastBar = 10, kMostBar = 40;

double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void append_two_digits(std::string& text, std::int64_t value) {
  text += value < 10 ? ":0" : ":";
  text += std::to_string(value);
}

double share_done(const ProgressState& state) {
  return state.total > 0 ? std::clamp(static_cast<double>(state.done) / static_cast<double>(state.total), 0.0, 1.0) : 0;
}

/// " (l1 0.01, ssim 0.0234)" with the first `shown` parts; nothing without parts.
std::string parts_text(std::span<const ProgressPart> parts, std::size_t shown) {
  if (parts.empty() || shown == 0) return "";
  std::string text;
  for (const ProgressPart& part : parts.first(shown)) {
    text.append(text.empty() ? " (" : ", ").append(part.name).append(" ") += rounded(part.value, 3);
  }
  return text.append(shown < parts.size() ? ", …)" : ")");
}

/// The line with the first `shown` parts of its value.
std::string line_with(const ProgressState& state, std::size_t shown) {
  std::string text(state.task);
  const auto append = [&text](std::string_view before, std::string_view figure, std::string_view after) {
    text.append(before).append(figure).append(after);
  };
  append(" ", std::to_string(state.done), "");
  if (state.total > 0) {
    append("/", std::to_string(state.total), "");
    append(", ", std::to_string(static_cast<int>(100 * share_done(state))), "%");
  }
  if (state.steps_per_second > 0) append(", ", rounded(state.steps_per_second, 3), " steps/s");
  if (!state.value_name.empty()) {
    append(", ", state.value_name, " ");
    text += rounded(state.value, 4) + parts_text(state.parts, shown);
  }
  if (state.is_finished) {
    append(", took ", duration_text(state.seconds), "");
  } else if (state.seconds_left >= 0) {
    append(", ", duration_text(state.seconds_left), " left");
  }
  return text;
}

/// The line with as many parts as fit.
std::string fitted_line(const ProgressState& state, int columns) {
  std::size_t shown = state.parts.size();
  std::string line = line_with(state, shown);
  while (shown > 0 && static_cast<int>(count_characters(line)) > columns) line = line_with(state, --shown);
  return line;
}

}  // namespace

Progress::Progress(std::string_view task, std::int64_t total, ProgressSink sink, double interval, ProgressClock clock)
    : total_(total), sink_(std::move(sink)), interval_(interval), clock_(clock ? clock : steady_seconds) {
  task_size_ = std::min(task.size(), task_.size() - 1);
  while (task_size_ > 0 && task_size_ < task.size() && (static_cast<unsigned char>(task[task_size_]) & 0xC0U) == 0x80U)
    --task_size_;  // not inside a UTF-8 character
  std::memcpy(task_.data(), task.data(), task_size_);
  if (sink_) begin_ = last_report_ = clock_();
}

Progress::~Progress() {
  try {
    finish();
  } catch (...) {  // a sink that throws must not end the program from a destructor
  }
}

void Progress::skip(std::int64_t steps) {
  done_ += steps;
  skipped_ += steps;
  last_done_ += steps;
}

void Progress::drop(std::int64_t steps) { total_ = std::max<std::int64_t>(total_ - steps, 0); }

void Progress::step(std::int64_t steps) { count(steps, {}); }

void Progress::step_with(const char* name, double value, std::span<const ProgressPart> parts) {
  value_name_ = name;
  value_ = value;
  count(1, parts);
}

void Progress::count(std::int64_t steps, std::span<const ProgressPart> parts) {
  done_ += steps;
  if (!sink_ || is_finished_) return;
  const double now = clock_();
  if (!has_reported_ || now - last_report_ >= interval_) report(now, false, parts);
}

void Progress::finish() {
  if (!sink_ || is_finished_) return;
  is_finished_ = true;
  report(clock_(), true, {});
}

void Progress::report(double now, bool is_finished, std::span<const ProgressPart> parts) {
  const double passed = now - last_report_;
  if (passed > 0) {
    const double rate = static_cast<double>(done_ - last_done_) / passed;
    const double keep = rate_ > 0 ? std::exp(-passed / kRateMemory) : 0;
    rate_ = keep * rate_ + (1 - keep) * rate;
    last_report_ = now;
    last_done_ = done_;
  }
  has_reported_ = true;
  ProgressState state;
  state.task = {task_.data(), task_size_};
  state.done = done_;
  state.total = total_;
  state.seconds = now - begin_;
  state.steps_per_second = rate_;
  if (is_finished && state.seconds > 0) state.steps_per_second = static_cast<double>(done_ - skipped_) / state.seconds;
  if (total_ > 0 && rate_ > 0)
    state.seconds_left = static_cast<double>(std::max<std::int64_t>(total_ - done_, 0)) / rate_;
  state.value_name = value_name_;
  state.value = value_;
  state.parts = parts;
  state.is_finished = is_finished;
  sink_(state);
}

std::string duration_text(double seconds) {
  if (!(seconds >= 0) || seconds > 1e9) return "?";
  const auto whole = static_cast<std::int64_t>(seconds + 0.5);
  const std::int64_t minutes = whole / 60;
  std::string text = std::to_string(whole < 60 ? whole : minutes < 60 ? minutes : minutes / 60);
  if (whole < 60) return text += " s";
  if (minutes >= 60) append_two_digits(text, minutes % 60);
  append_two_digits(text, whole % 60);
  return text;
}

std::string progress_line(const ProgressState& state) { return line_with(state, state.parts.size()); }

std::string progress_bar(const ProgressState& state, int columns) {
  const std::string line = fitted_line(state, columns);
  std::size_t width = 0, end = 0;  // in characters and bytes, as far as fits
  for (std::size_t i = 0; i <= line.size(); ++i) {
    const bool begins = i == line.size() || (static_cast<unsigned char>(line[i]) & 0xC0U) != 0x80U;
    if (!begins) continue;
    end = i;
    if (i == line.size() || width == static_cast<std::size_t>(std::max(columns, 0))) break;
    ++width;
  }
  const int space = std::min(columns - static_cast<int>(width) - 3, kMostBar);  // "[", "]" and a blank
  if (state.total <= 0 || space < kLeastBar) return line.substr(0, end);
  const int filled = static_cast<int>(share_done(state) * space);
  std::string bar = "[";
  bar.append(static_cast<std::size_t>(filled), '#').append(static_cast<std::size_t>(space - filled), '.');
  return bar.append("] ").append(line);
}

}  // namespace hsi4d
