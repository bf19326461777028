// `hsi4d bench tape`: what the tape itself costs: a node, and the gradient of a lambda loss over its value alone.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// Something that is timed, ready to be run again and again.
struct TapeWork {
  std::string name;                 ///< "tape/WORKLOAD/STEP"
  Index nodes = 0;                  ///< of a chain; 0: a loss
  Index elements = 0;               ///< of a loss; 0: a chain
  std::string against = {};         ///< the name of the work that its time is divided by; empty: none
  std::optional<double> goal = {};  ///< the most that is asked for: nanoseconds a node or element, or the ratio
  std::function<void()> run;
};

/// Names of the workloads.
std::vector<std::string> tape_workloads();

/// The work of the workloads asked for (empty: all), on one thread:
///
///   nodes, additions     1000 scalar operators in a row, forward and backward (`both`): a bare copy, and x + 1
///   loss_of_4            `primal`: 2048 values of a robust residual with its own scale and weight, summed by the
///                        fastest plain loop; `gradient`: sum_over of the same lambda, value and gradient of all inputs
///   loss_of_10           the same of a robust distance of a point to a plane
///   ssim, skinning, anomaly   operators with goals of their own (bench/tape_operators.h)
///
/// Throws UserError for a workload that is not known.
std::vector<TapeWork> tape_work(const std::vector<std::string>& workloads = {});

/// The time of one run of a work.
struct TapeMeasurement {
  std::string name;
  double median_ms = 0, min_ms = 0;
  int repeats = 0;
  Index nodes = 0, elements = 0;  ///< as the work's
  std::optional<double> ratio;    ///< of medians, over `against`
  std::string against;
  std::optional<double> goal;  ///< as the work's

  /// Nanoseconds a node of a chain, or an element of a loss, by the median.
  double ns_each() const;
};

struct TapeBench {
  std::vector<std::string> workloads;  ///< names; empty: all
  int repeats = 9;                     ///< of each: many runs in a row, of which the mean is taken
};

/// Measures every work, in rounds, so that noise meets all alike. Throws as tape_work.
std::vector<TapeMeasurement> bench_tape(const TapeBench& options);

}  // namespace hsi4d
