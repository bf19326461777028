// A sweep's file: which runs there are to be, as blocks of axes, before they are put together. (docs/sweeps.md)
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/config_value.h"

namespace hsi4d {

/// A setting that is laid over a config.
struct SweepSetting {
  std::string key;  ///< as written; lay_into_config takes it
  ConfigValue value;
  ConfigOrigin origin;  ///< of the key
};

/// What is reconstructed.
struct SweepClip {
  std::string name;
  std::filesystem::path config;
  ConfigOrigin origin;
  std::vector<SweepSetting> set;
};

/// An ablation or a seed: settings with a name.
struct SweepVariant {
  std::string name;
  std::vector<SweepSetting> set;
  std::optional<std::int64_t> seed = {};  ///< of a seed that is a number
};

/// An axis of a grid, or lists that are zipped.
struct SweepAxis {
  std::vector<std::string> keys;                  ///< one of a grid
  std::vector<std::vector<SweepSetting>> points;  ///< a setting a key
};

/// What a setting is searched over: choices, or the numbers of a range.
struct SweepRange {
  std::string key;      ///< as written
  ConfigOrigin origin;  ///< of the key
  std::vector<ConfigValue> choices;
  double from = 0, to = 0;  ///< without choices
  bool is_log = false;      ///< of equal ratios as many, not of equal differences
  bool is_integer = false;  ///< whole numbers, both ends among them
};

/// How the points of a search are chosen.
enum class SweepSampling { kSobol, kRandom };

/// Points of a space, of which each is a setting of every key of `over`.
struct SweepSearch {
  std::string metric;  ///< what is searched for: the best of it
  SweepSampling method = SweepSampling::kSobol;
  std::int64_t seed = 0;
  std::int64_t runs = 0;  ///< the most, of all points, clips and seeds together
  std::vector<SweepRange> over;
  SweepAxis rungs;      ///< of successive halving, the cheapest first; without points: all are computed in full
  int factor = 2;       ///< of so many points of a rung one goes on
  std::string pointer;  ///< of the search
  ConfigOrigin origin;
};

/// An entry of `skip` or `only`.
struct SweepRule {
  std::vector<SweepSetting> values;  ///< key: block, clip, ablation, seed or that of an axis
  bool is_skip = true;
  std::string pointer;
  ConfigOrigin origin;
};

/// A part of a sweep, with what it takes over from the file.
struct SweepBlock {
  std::string name;  ///< empty: it has none
  std::filesystem::path base;
  std::vector<SweepSetting> set;
  std::vector<SweepClip> clips;         ///< empty: what the base says
  std::vector<SweepVariant> ablations;  ///< empty: none
  std::vector<SweepAxis> grid, zip;
  std::optional<SweepSearch> search;
  std::vector<SweepAxis> searched;  ///< what the search comes to: its rungs, if it has any, then its points
  std::vector<SweepVariant> seeds;  ///< empty: what the base says
  std::vector<SweepRule> rules;
  std::string pointer;  ///< of the block; empty: it is the file itself
  ConfigOrigin origin;
};

/// How a sweep's runs are started by Slurm.
struct SweepSlurm {
  std::string time;                  ///< as sbatch takes it; empty: the partition's
  int memory_mb = 0;                 ///< 0: memory_mb of the sweep, or what the partition gives
  int at_once = 0;                   ///< 0: as many as there is room for
  std::string partition;             ///< empty: the default one
  int grace_s = 120;                 ///< before the end of its time a run saves its state; Slurm: up to 60 s earlier
  std::vector<std::string> options;  ///< more of sbatch
};

/// The most runs that a sweep's file may ask for, before `skip` and `only` leave some out.
inline constexpr std::int64_t kMostSweepRuns = 100000;

/// The most retries of a run that is killed for memory: the last one has a thousand times as much.
inline constexpr int kMostMemoryRetries = 10;

/// A sweep's file, read.
struct SweepFile {
  std::string name;
  std::vector<SweepBlock> blocks;
  std::vector<SweepSetting> compare;  ///< what the others are compared with; empty: not said
  int threads = 0;                    ///< of each run; 0: not said
  double hours = 0;                   ///< of all runs, added up; 0: no limit
  double memory_mb = 0;               ///< of each run; 0: not said
  int memory_retries = 0;             ///< of a run that is killed for memory, each with twice as much
  SweepSlurm slurm;
};

class ConfigFields;

/// Describes the settings of a sweep's file that are no axes.
void describe(ConfigFields& fields, SweepFile& sweep);

/// The JSON Schema of sweeps' files, for editors.
std::string sweep_schema();

/// Reads a sweep's file as far as it can be told without the configs that it names. Throws one UserError with every
/// problem: unknown keys, values of a wrong kind, empty or unequal lists, names that occur twice, settings that two
/// axes name, rules about what is no axis, more than kMostSweepRuns runs.
/// @param tree  what load_config made of it
/// @param file  whose name the sweep has where it does not say one
SweepFile read_sweep_file(const ConfigValue& tree, const std::filesystem::path& file, ConfigProblems& problems);

/// The axes of settings that a block has: searched, grid, zip.
std::vector<const SweepAxis*> setting_axes(const SweepBlock& block);

/// Adds what is wrong with a sweep's axes as they stand beside each other: settings that two of them name, rules and
/// comparisons of what is no axis.
void check_sweep_axes(const SweepFile& sweep, ConfigProblems& problems);

/// Whether a block has an axis of that name: block, clip, ablation, seed, or the key of a setting.
bool has_sweep_axis(const SweepBlock& block, const std::string& key);

/// How many runs the axes of a block make before its rules; beyond kMostSweepRuns one more than these.
std::int64_t sweep_combinations(const SweepBlock& block);

/// A key in one spelling, "stages.camera.iterations": two that name one place are then equal.
std::string sweep_key(const std::string& key);

/// A value as text that equal values have in common: JSON on a line, numbers in their shortest form.
std::string sweep_value_text(const ConfigValue& value);

/// The same of a name: without quotes, a number as it is.
std::string sweep_name_text(const ConfigValue& value);

}  // namespace hsi4d
