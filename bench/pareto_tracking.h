// What the errors of `hsi4d bench pareto` come to: a small generated clip is reconstructed with every setting, with as
// many iterations, and with as many as take as long.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "bench/pareto.h"
#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"

namespace hsi4d {

/// What is reconstructed, and how.
struct Tracking {
  RunConfig config;  ///< with the section `synthetic` and stages that draw a frame; its seed and that of `synthetic`
                     ///< are replaced
  std::vector<ParetoSetting>
      settings;  ///< the default first; thresholds, tile, depth key, degree and precision are taken
  int seeds = 5;
  std::filesystem::path folder;  ///< for datasets and runs, removed again
};

/// Throws UserError naming the folder if it is there.
void check_tracking_folder(const std::filesystem::path& folder);

/// How many runs measure_tracking makes.
Index tracking_run_count(const Tracking& tracking);

/// Reconstructs on one thread.
/// @param told  after every run; may be empty
/// Throws as write_dataset and execute_run; UserError when the folder is there.
std::vector<TrackedPoint> measure_tracking(const Tracking& tracking, const std::vector<LossTerm>& losses,
                                           const std::function<void()>& told = {});

/// A table: a line a setting and budget.
std::string tracking_table(const std::vector<TrackedPoint>& points);

/// One JSON object a line: {"tracking": "steps" or "time", "knob", "value", ...}.
std::string tracking_json(const std::vector<TrackedPoint>& points);

}  // namespace hsi4d
