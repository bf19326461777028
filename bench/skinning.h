// `hsi4d bench skinning`: time of the SMPL-X body on the tape, forward and backward with respect to its pose,
// and of the Gaussians on it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// One step of one workload.
struct SkinningMeasurement {
  std::string name;  ///< "skinning/WORKLOAD/STEP"; the step `both` is forward and then backward
  int threads = 1;
  double median_ms = 0, min_ms = 0;
  int repeats = 0;
  Index vertices = 0;   ///< 0 where Gaussians are posed
  Index gaussians = 0;  ///< 0 where vertices are
  Index joints = 0;
  Index corrective_columns = 0;  ///< that follow every pose
  Index table_bytes = 0;         ///< of these columns, read once in each direction
  double packing_error_m = 0;    ///< most that packed numbers can move a vertex along an axis
};

/// What is measured.
struct SkinningBench {
  std::vector<std::string> workloads;  ///< names; empty: all
  int threads = 1;
  int repeats = 9;  ///< of each, after some to warm up
};

/// Names of the workloads.
std::vector<std::string> skinning_workloads();

/// Measures every workload asked for: a body of 10,475 vertices and 486 correctives, made up from the procedural body,
/// in float, with a fixed cotangent on the vertices; and "posing", an avatar of 50,000 Gaussians from its joints'
/// rotations to means and axes, with cotangents on both. `report` gets each measurement as it is made. Throws UserError
/// for a workload that is not known.
void bench_skinning(const SkinningBench& options, const std::function<void(const SkinningMeasurement&)>& report);

}  // namespace hsi4d
