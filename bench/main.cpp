// Runs the benchmarks, repeated and interleaved at random so that noise meets all alike, and prints a table of the
// figures asked for. Google Benchmark's own flags work (--benchmark_filter=..., --benchmark_out=...).
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

#include "bench/goals.h"
#include "core/simd.h"

namespace hsi4d::bench {

namespace {

struct Goal {
  std::string what, numerator, denominator;
  double bound, per;
};

std::vector<Goal>& goals() {
  static std::vector<Goal> all;
  return all;
}

struct Measured {
  double median_ns = 0;
  std::optional<double> fma;
};

std::string time_text(double ns) {
  char text[32];
  const char* unit = ns < 1e3 ? "ns" : ns < 1e6 ? "us" : "ms";
  std::snprintf(text, sizeof text, "%.4g %s", ns < 1e3 ? ns : ns < 1e6 ? ns / 1e3 : ns / 1e6, unit);
  return text;
}

/// Prints the median of each benchmark and keeps it. It is the processor time: what is asked for is on one thread, and
/// other programs of the machine do not count.
class MedianReporter : public benchmark::BenchmarkReporter {
 public:
  std::map<std::string, Measured> medians;

  bool ReportContext(const Context&) override {
    std::printf("medians of processor time\n");
    return true;
  }
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Aggregate || run.aggregate_name != "median") continue;
      Measured m;
      m.median_ns = run.GetAdjustedCPUTime() * 1e9 / benchmark::GetTimeUnitMultiplier(run.time_unit);
      if (const auto fma = run.counters.find("fma"); fma != run.counters.end()) m.fma = fma->second.value;
      medians[run.run_name.str()] = m;
      std::printf("%-72s %12s\n", run.run_name.str().c_str(), time_text(m.median_ns).c_str());
      std::fflush(stdout);
    }
  }
};

/// ", 34 % of peak" where the benchmark counts its multiply-adds.
std::string share_text(const MedianReporter& reporter, const std::string& name) {
  const Measured& m = reporter.medians.at(name);
  const bool is_double = name.find("double") != std::string::npos;
  const auto peak = reporter.medians.find(is_double ? kPeakDouble : kPeakFloat);
  if (!m.fma || peak == reporter.medians.end() || !peak->second.fma) return "";
  const double share = (*m.fma / m.median_ns) / (*peak->second.fma / peak->second.median_ns);
  char text[32];
  std::snprintf(text, sizeof text, ", %.0f %% of peak", 100 * share);
  return text;
}

void print_goals(const MedianReporter& reporter) {
  const std::string title = std::string("asked for (medians; instruction set ") + isa_name(best_isa()) + ")";
  std::printf("\n%-66s %10s %10s  %s\n", title.c_str(), "at most", "measured", "absolute times");
  for (const Goal& goal : goals()) {
    const auto top = reporter.medians.find(goal.numerator);
    const auto bottom = reporter.medians.find(goal.denominator);
    if (top == reporter.medians.end()) continue;
    if (goal.denominator.empty()) {
      std::printf("%-66s %10s %10s  %s%s\n", goal.what.c_str(), time_text(goal.bound).c_str(),
                  time_text(top->second.median_ns / goal.per).c_str(), time_text(top->second.median_ns).c_str(),
                  share_text(reporter, goal.numerator).c_str());
    } else if (bottom != reporter.medians.end()) {
      std::printf("%-66s %10.2f %10.2f  %s%s against %s%s\n", goal.what.c_str(), goal.bound,
                  top->second.median_ns / bottom->second.median_ns, time_text(top->second.median_ns).c_str(),
                  share_text(reporter, goal.numerator).c_str(), time_text(bottom->second.median_ns).c_str(),
                  share_text(reporter, goal.denominator).c_str());
    }
  }
}

}  // namespace

void ask_ratio(std::string what, std::string numerator, std::string denominator, double bound) {
  goals().push_back({std::move(what), std::move(numerator), std::move(denominator), bound, 1});
}

void ask_time(std::string what, std::string name, double bound_ns, double per) {
  goals().push_back({std::move(what), std::move(name), "", bound_ns, per});
}

}  // namespace hsi4d::bench

int main(int argc, char** argv) {
  std::vector<char*> arguments(argv, argv + argc);
  // Defaults first, so that flags of the command line win.
  std::string defaults[] = {"--benchmark_repetitions=9", "--benchmark_enable_random_interleaving=true",
                            "--benchmark_report_aggregates_only=true", "--benchmark_min_time=0.05"};
  for (std::string& flag : defaults) arguments.insert(arguments.begin() + 1, flag.data());
  int count = static_cast<int>(arguments.size());
  benchmark::Initialize(&count, arguments.data());
  if (benchmark::ReportUnrecognizedArguments(count, arguments.data())) return 2;
  hsi4d::bench::MedianReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  hsi4d::bench::print_goals(reporter);
  return 0;
}
