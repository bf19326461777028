// `hsi4d bench TOPIC`: measurements.
#pragma once

#include <string>
#include <vector>

namespace hsi4d::cli {

struct BenchOptions {
  std::vector<std::string> workloads;  ///< empty: all
  int threads = 1;
  int repeats = 9;                 ///< of all but pixel_filter
  std::vector<double> heights_px;  ///< of the figures of pixel_filter; empty: all
  std::string json;                ///< path to write one JSON object a measurement to; empty: none
};

/// `hsi4d bench rasterize`: returns a table.
std::string bench_rasterize_command(const BenchOptions& options);

/// `hsi4d bench skinning`: returns a table.
std::string bench_skinning_command(const BenchOptions& options);

/// `hsi4d bench color_net`: returns a table.
std::string bench_color_net_command(const BenchOptions& options);

/// `hsi4d bench tape`: returns a table. On one thread.
std::string bench_tape_command(const BenchOptions& options);

/// `hsi4d bench`: the tables of rasterize, skinning, color_net and tape, each with all its workloads; the tape on one
/// thread.
std::string bench_kernels_command(const BenchOptions& options);

/// `hsi4d bench pixel_filter`: returns a table. The workloads are figures.
std::string bench_pixel_filter_command(const BenchOptions& options);

}  // namespace hsi4d::cli
