#include "stress/stress.h"

#include <algorithm>
#include <chrono>
#include <exception>

#include "core/parallel.h"
#include "core/stopwatch.h"

namespace hsi4d {

namespace {

std::vector<StressFigure> tried(const StressCase& row, Remedy remedy, std::string& error) {
  try {
    return row.run(remedy);
  } catch (const std::exception& thrown) {
    error = thrown.what();
    return {};
  }
}

bool all_hold(const std::vector<StressFigure>& figures) {
  return std::all_of(figures.begin(), figures.end(), [](const StressFigure& figure) { return figure.holds(); });
}

}  // namespace

bool StressResult::holds() const { return error.empty() && !with.empty() && all_hold(with); }

bool StressResult::would_fail() const { return error_without.empty() && !all_hold(without); }

std::vector<StressResult> run_stress(std::span<const StressCase> cases,
                                     const std::function<void(const StressResult&)>& done, int threads) {
  std::vector<StressResult> results;
  for (const StressCase& row : cases) {
    const auto begin = std::chrono::steady_clock::now();
    StressResult result{&row, {}, {}, {}, {}, 0};
    const auto run = [&] {
      result.with = tried(row, Remedy::kOn, result.error);
      result.without = tried(row, Remedy::kOff, result.error_without);
    };
    if (row.run != nullptr) threads > 0 && !row.own_threads ? with_threads(threads, run) : run();
    result.seconds = seconds_since(begin);
    if (done) done(result);
    results.push_back(std::move(result));
  }
  return results;
}

}  // namespace hsi4d
