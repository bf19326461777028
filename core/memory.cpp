#include "core/memory.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <sys/resource.h>

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

constexpr double kBytesPerKib = 1024;
constexpr double kNoMemoryLimit = std::numeric_limits<double>::infinity();

/// The number behind a word that a line of a file begins with ("VmHWM:", "inactive_file "); negative: there is none.
double number_behind(const fs::path& file, const std::string& word) {
  std::ifstream text(file);
  for (std::string line; std::getline(text, line);) {
    if (line.starts_with(word)) return std::strtod(line.c_str() + word.size(), nullptr);
  }
  return -1;
}

/// The number that a file consists of; nothing where there is none ("max").
std::optional<double> number_in(const fs::path& file) {
  double number = 0;
  if (std::ifstream(file) >> number) return number;
  return std::nullopt;
}

/// The names of a version of control groups.
struct GroupFiles {
  const char *limit, *used, *droppable;  ///< droppable: in memory.stat
};
constexpr GroupFiles kVersion1 = {"memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file "};
constexpr GroupFiles kVersion2 = {"memory.max", "memory.current", "inactive_file "};

/// Bytes that a group leaves.
double left_in_group(const fs::path& group, const GroupFiles& files) {
  const auto limit = number_in(group / files.limit), used = number_in(group / files.used);
  if (!limit || !used) return kNoMemoryLimit;
  return std::max(0.0, *limit - *used + std::max(0.0, number_behind(group / "memory.stat", files.droppable)));
}

/// Bytes that a group and those that it is in leave. In a container the path may be that of the machine outside: what
/// is not there has no limit.
double left_in_groups(const fs::path& mount, const fs::path& path, const GroupFiles& files) {
  double left = left_in_group(mount, files);
  fs::path group = mount;
  for (const fs::path& part : path.relative_path()) left = std::min(left, left_in_group(group /= part, files));
  return left;
}

}  // namespace

std::int64_t peak_memory_bytes(int process) {
  const std::string who = process == 0 ? "self" : std::to_string(process);
  const double kib = number_behind("/proc/" + who + "/status", "VmHWM:");
  if (kib >= 0) return static_cast<std::int64_t>(kib * kBytesPerKib);
  rusage used{};
  const bool is_known = process == 0 && ::getrusage(RUSAGE_SELF, &used) == 0;
  return is_known ? std::int64_t{used.ru_maxrss} * static_cast<std::int64_t>(kBytesPerKib) : 0;
}

double available_memory_mb(const fs::path& root) {
  double bytes = std::max(0.0, number_behind(root / "proc/meminfo", "MemAvailable:")) * kBytesPerKib;
  std::ifstream groups(root / "proc/self/cgroup");  // HIERARCHY:CONTROLLERS:PATH
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const fs::path path = line.substr(second + 1), mount = root / "sys/fs/cgroup";
    if (controllers == ",,") bytes = std::min(bytes, left_in_groups(mount, path, kVersion2));
    if (controllers.find(",memory,") != std::string::npos)
      bytes = std::min(bytes, left_in_groups(mount / "memory", path, kVersion1));
  }
  return bytes / kBytesPerMb;
}

}  // namespace hsi4d
