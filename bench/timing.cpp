#include "bench/timing.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "bench/machine.h"

namespace hsi4d {

BenchTime bench_time(const std::string& name, int threads, const std::vector<double>& seconds) {
  return {name, threads, 1e3 * median_of(seconds), 1e3 * *std::min_element(seconds.begin(), seconds.end()),
          static_cast<int>(seconds.size())};
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

std::string bench_line(const BenchTime& time, const std::string& more) {
  nlohmann::ordered_json row = {{"name", time.name},
                                {"threads", time.threads},
                                {"median_ms", time.median_ms},
                                {"min_ms", time.min_ms},
                                {"repeats", time.repeats}};
  row.update(nlohmann::ordered_json::parse(more));
  return bench_line(row.dump());
}

}  // namespace hsi4d
