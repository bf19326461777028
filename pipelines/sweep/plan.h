// The runs of a sweep: every combination with its whole config, checked, and the plan as a folder keeps it.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "optim/loss_description.h"
#include "pipelines/config/run_config.h"
#include "pipelines/sweep/file.h"

namespace hsi4d {

/// A combination. Names are empty where the sweep has no such axis.
struct SweepRun {
  std::string id;  ///< of its run folder: a hash of the resolved config without what changes no result
  std::string block, clip, ablation, seed;
  std::vector<std::pair<std::string, std::string>> values;  ///< of search, grid and zip: key and JSON text
  std::string dataset;   ///< id of the generated dataset; empty: the config names data
  std::string config;    ///< its text, resolved; empty in a plan that was read from a folder
  std::size_t rung = 0;  ///< of successive halving
};

/// A setting that a search is over.
struct SearchedKey {
  std::string key;
  bool is_log = false;
};

/// What a search of a plan is about.
struct PlannedSearch {
  std::string block;  ///< whose runs are its own
  std::string metric;
  std::vector<SearchedKey> over;
  std::vector<std::string> rung_keys;  ///< settings of the rungs of successive halving
  int factor = 2;                      ///< of so many points of a rung one goes on
};

/// A sweep, ready to be carried out.
struct SweepPlan {
  std::string name;
  std::vector<SweepRun> runs;  ///< by index; several may have one id, and are then one run
  std::vector<std::pair<std::string, std::string>> compare;  ///< "ablation" or a key, and its value as text
  int threads = 0;                                           ///< of each run; 0: not said
  double memory_mb = 0;                                      ///< of each run; 0: not said
  SweepSlurm slurm;
  double hours = 0;  ///< of all runs, added up: none is started once they are over; 0: no limit
  std::vector<PlannedSearch> searches = {};
  int memory_retries = 0;  ///< of a run that is killed for memory, each with twice as much
};

/// The search that a run is of, or null.
const PlannedSearch* search_of(const SweepPlan& plan, const SweepRun& run);

/// What a run is called on an axis: "no_color_net" on "ablation", "iterations 100" on that key, "seed 1" on "seed".
struct SweepLabelPart {
  std::string axis, text;
};

/// The parts of a run's label, of the axes that it has, in order.
std::vector<SweepLabelPart> sweep_label_parts(const SweepRun& run);

/// What a run is called: "no_color_net, iterations 100, seed 1"; "the only run" where there is no axis.
std::string sweep_label(const SweepRun& run);

/// The run without clip and seed: what it has in common with those of its row of the results.
SweepRun without_repetition(SweepRun run);

/// The last parts of keys that tell them apart: "iterations".
std::string short_sweep_key(const std::string& key);

/// A value as labels show it: words without quotes, long ones by their end.
std::string plain_sweep_value(const std::string& json);

/// So many last parts of each key as tell it from the others: "camera.lr", "body_pose.lr", "blur".
/// @param least  parts
std::vector<std::string> short_sweep_keys(const std::vector<std::string>& keys, std::size_t least = 1);

/// Puts the combinations of a sweep together and reads each as a run would. Throws one UserError with every problem, of
/// the file, its configs and its combinations, with the runs that it is in.
SweepPlan plan_sweep(const std::filesystem::path& file, const std::vector<LossDescription>& losses);

/// The id of the run that has a config: a hash of what changes its result.
/// @param text     the resolved config
/// @param name     what messages call it: its file
/// @param is_made  its dataset is generated
/// Throws DataError for text that is no JSON.
std::string sweep_run_id(const std::string& text, const std::string& name, bool is_made);

/// The runs of the plan without those whose id another one before has: indices.
std::vector<std::size_t> distinct_runs(const SweepPlan& plan);

/// The text of a plan as a sweep's folder keeps it, without configs, and back. Throws DataError naming file and place.
std::string sweep_plan_json(const SweepPlan& plan);
SweepPlan parse_sweep_plan(const std::string& text, const std::string& name);

/// True for a tree that sweep_plan_json wrote.
bool is_sweep_plan(const ConfigValue& tree);

}  // namespace hsi4d
