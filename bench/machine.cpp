#include "bench/machine.h"

#include <fstream>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>

#include "core/simd.h"

namespace hsi4d {

namespace {

/// What stands behind "name : " in a file of such lines; empty where there is no such line.
std::string value_in(const char* file, const std::string& name) {
  std::ifstream text(file);
  for (std::string line; std::getline(text, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with(name) && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "";
}

std::string first_line(const char* file) {
  std::string line;
  std::getline(std::ifstream(file), line, '\n');
  return line.substr(0, line.find('\0'));  // a device tree ends its texts so
}

std::string cpu_name() {
  std::string name = value_in("/proc/cpuinfo", "model name");
  if (name.empty()) name = first_line("/proc/device-tree/model");
  return name.empty() ? "unknown" : name;
}

}  // namespace

const BenchMachine& bench_machine() {
  static const BenchMachine machine{cpu_name(), static_cast<int>(std::thread::hardware_concurrency()),
                                    first_line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"), HSI4D_COMPILER,
                                    HSI4D_FLAGS};
  return machine;
}

std::string bench_line(const std::string& text) {
  nlohmann::ordered_json row = nlohmann::ordered_json::parse(text);
  const BenchMachine& m = bench_machine();
  if (!row.contains("isa")) row["isa"] = isa_name(best_isa());
  nlohmann::ordered_json& machine = row["machine"];
  machine = {{"cpu", m.cpu}, {"cores", m.cores}, {"compiler", m.compiler}, {"flags", m.flags}};
  if (!m.governor.empty()) machine["governor"] = m.governor;
  return row.dump() + "\n";
}

}  // namespace hsi4d
