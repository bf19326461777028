// Memory of processes and of the machine.
#pragma once

#include <cstdint>
#include <filesystem>

namespace hsi4d {

/// Bytes in a MB, as they are counted here.
inline constexpr double kBytesPerMb = 1024.0 * 1024.0;

/// Resident memory of a process at its most, so far, in bytes; 0 where the system does not tell, as of one that has
/// ended. Its own alone: what getrusage tells begins with that of the process that started it.
/// @param process  0: this one
std::int64_t peak_memory_bytes(int process = 0);

/// Memory that programs can still have, MB: what the kernel has to give, or what the control groups that we are in
/// (version 1 or 2, a container's for example) leave, where that is less. Files that are kept in memory and could be
/// dropped count as free. 0 where the system does not tell.
/// @param root  where /proc and /sys are
double available_memory_mb(const std::filesystem::path& root = "/");

}  // namespace hsi4d
