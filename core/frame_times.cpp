#include "core/frame_times.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace hsi4d {

namespace {

// Shares of the mean step by which frames that count as even may be off.
constexpr double kUnevenness = 0.2, kMostUnevenness = 0.3;
constexpr double kSameTime = 1e-9;  // seconds

std::vector<double> steps_of(const FrameTimes& times) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.seconds.size(); ++i) steps.push_back(times.seconds[i] - times.seconds[i - 1]);
  return steps;
}

}  // namespace

bool are_even(const FrameTimes& times) {
  if (times.seconds.size() < 3) return true;
  const double step = times.seconds.back() / static_cast<double>(times.seconds.size() - 1);
  const double most = std::clamp(times.tick, kUnevenness * step, kMostUnevenness * step);
  for (std::size_t i = 0; i < times.seconds.size(); ++i) {
    if (std::fabs(times.seconds[i] - static_cast<double>(i) * step) > most) return false;
  }
  return true;
}

double usual_step(const FrameTimes& times) {
  std::vector<double> steps = steps_of(times);
  if (steps.empty()) return 0;
  const auto middle = steps.begin() + std::ssize(steps) / 2;
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

TimeStep widest_step(const FrameTimes& times) {
  const std::vector<double> steps = steps_of(times);
  HSI4D_CHECK(!steps.empty(), "no step between fewer than two frames");
  const auto widest = std::max_element(steps.begin(), steps.end());
  return {widest - steps.begin(), *widest};
}

std::vector<Index> nearest_frames(const FrameTimes& times, double rate) {
  HSI4D_CHECK(rate > 0, std::to_string(rate));
  std::vector<Index> frames;
  if (times.seconds.empty()) return frames;
  const double end = times.seconds.back() + usual_step(times) / 2;
  for (Index t = 0;; ++t) {
    const double moment = static_cast<double>(t) / rate;
    if (t > 0 && moment > end - kSameTime) return frames;
    frames.push_back(nearest_frame(times, moment));
  }
}

Index nearest_frame(const FrameTimes& times, double seconds) {
  HSI4D_CHECK(!times.seconds.empty(), "no frames");
  const auto& all = times.seconds;
  const auto later = std::upper_bound(all.begin(), all.end(), seconds);
  if (later == all.begin()) return 0;
  const auto before = later - 1;
  const bool is_before = later == all.end() || seconds - *before < *later - seconds - kSameTime;
  return (is_before ? before : later) - all.begin();
}

}  // namespace hsi4d
