// The time of what is run several times, as tables and JSON of `hsi4d bench` tell it.
#pragma once

#include <string>
#include <vector>

namespace hsi4d {

/// What every measurement of a kernel holds.
struct BenchTime {
  std::string name;  ///< "TOPIC/WORKLOAD/STEP"
  int threads = 1;
  double median_ms = 0, min_ms = 0;
  int repeats = 0;
};

/// @param seconds  of each run, in any order, at least one
BenchTime bench_time(const std::string& name, int threads, const std::vector<double>& seconds);

/// The one in the middle; of an even number the larger of the two. Of at least one.
double median_of(std::vector<double> values);

/// A measurement as a line of JSON: its time, then what else there is, then what it was made with (bench/machine.h).
/// @param more  a JSON object
std::string bench_line(const BenchTime& time, const std::string& more);

}  // namespace hsi4d
