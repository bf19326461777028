// What the measurements of `hsi4d bench` were made with: every row of their JSON tells it.
#pragma once

#include <string>

namespace hsi4d {

/// The machine, and how the program was compiled.
struct BenchMachine {
  std::string cpu;       ///< as the system names it: "AMD EPYC 9B45"; "unknown" where it does not
  int cores = 0;         ///< that the process may use
  std::string governor;  ///< of their clock: "performance"; empty where the system does not tell
  std::string compiler;  ///< "GNU 12.2.0"
  std::string flags;     ///< of the sources; vector kernels are compiled for better instruction sets too
};

const BenchMachine& bench_machine();

/// A measurement as a line of JSON: the row, then "isa" unless the row has one, and "machine".
/// @param row  a JSON object
std::string bench_line(const std::string& row);

}  // namespace hsi4d
