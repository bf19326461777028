// The config of a run: its sections as structs, read from JSON with `extends` and `--set`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/config.h"
#include "optim/loss_description.h"
#include "pipelines/synthetic_settings.h"
#include "splat/render_settings.h"

namespace hsi4d {

enum class OptimizerKind { kAdam };

inline constexpr std::array<ConfigChoice<OptimizerKind>, 1> kOptimizerKinds = {{{OptimizerKind::kAdam, "adam"}}};

/// How gradients become steps.
struct OptimizerSettings {
  OptimizerKind kind = OptimizerKind::kAdam;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double eps = 1e-8;
};

/// When and how far one group of parameters moves.
struct ParameterGroupSettings {
  double lr = 0;
  int from = 0;              ///< the first iteration in which it moves
  std::optional<int> until;  ///< the first in which it does not move any more; none: the end of the stage
  int every = 1;             ///< it moves in iterations from, from + every, ...
};

/// One stage of the method.
struct StageSettings {
  int iterations = 0;
  ConfigMap<ParameterGroupSettings> optimize;  ///< by parameter group
  ConfigMap<LossSettings> losses;              ///< by loss term
  OptimizerSettings optimizer;
};

/// A whole run.
struct RunConfig {
  std::int64_t seed = 0;
  int threads = 0;  ///< 0: one a core
  RenderSettings render;
  SyntheticSettings synthetic;
  ConfigMap<StageSettings> stages;  ///< in the order written
};

/// Describe the sections. `losses` are the terms that a stage may name.
void describe(ConfigFields& fields, OptimizerSettings& settings);
void describe(ConfigFields& fields, ParameterGroupSettings& settings);
void describe(ConfigFields& fields, StageSettings& settings, const std::vector<LossDescription>& losses);
void describe(ConfigFields& fields, RunConfig& config, const std::vector<LossDescription>& losses);

/// Reads and checks a config file. Throws one UserError that tells every problem of the file, of the files that it
/// extends, and of the overrides (KEY=VALUE), a line each.
RunConfig load_run_config(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                          const std::vector<LossDescription>& losses);

/// Reads and checks a tree that load_config or config_from_overrides made, telling its problems beside those found
/// before.
RunConfig read_run_config(const ConfigValue& tree, const std::vector<LossDescription>& losses,
                          ConfigProblems& problems);

/// The text of config.resolved.json: every setting, defaults included. Reading it back gives the same config and text.
std::string resolved_config(const RunConfig& config, const std::vector<LossDescription>& losses);

/// The JSON Schema (draft 2020-12) of run configs.
std::string run_config_schema(const std::vector<LossDescription>& losses);

/// Every setting of a run config.
std::vector<ConfigSetting> run_config_settings(const std::vector<LossDescription>& losses);

}  // namespace hsi4d
