// The config of a run: its sections as structs, read from JSON with `extends` and `--set`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "autodiff/tape.h"
#include "core/config.h"
#include "optim/loss_description.h"
#include "optim/stage_settings.h"
#include "pipelines/config/body_settings.h"
#include "pipelines/config/camera_selection_settings.h"
#include "pipelines/config/chain_settings.h"
#include "pipelines/config/color_net_settings.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/config/instance_settings.h"
#include "pipelines/config/log_settings.h"
#include "pipelines/config/masks.h"
#include "pipelines/config/passes.h"
#include "pipelines/config/source_settings.h"
#include "pipelines/config/start_settings.h"
#include "pipelines/config/synthetic_settings.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// The type in which a run computes.
enum class RunPrecision { kFloat, kDouble };

/// The numbers by which rotations are optimised.
enum class RotationParameters { kSixD, kAxisAngle };

/// The frame in which six numbers move a camera.
enum class CameraIncrement { kCamera, kWorld, kScene };

inline constexpr std::array<ConfigChoice<CameraIncrement>, 3> kCameraIncrements = {
    {{CameraIncrement::kCamera, "camera"}, {CameraIncrement::kWorld, "world"}, {CameraIncrement::kScene, "scene"}}};
inline constexpr std::array<ConfigChoice<RunPrecision>, 2> kRunPrecisions = {
    {{RunPrecision::kFloat, "float"}, {RunPrecision::kDouble, "double"}}};
inline constexpr std::array<ConfigChoice<RotationParameters>, 2> kRotationParameters = {
    {{RotationParameters::kSixD, "6d"}, {RotationParameters::kAxisAngle, "axis_angle"}}};

/// How cameras are optimised.
struct CameraSettings {
  CameraIncrement increment = CameraIncrement::kScene;
};

/// What is not computed because the result does not need it: config section `skip`.
struct SkipSettings {
  RenderSkips render;
  TapeSkips tape;
};

/// All of them off.
SkipSettings no_skips();

/// What changes the result a little: config section `approx`.
struct ApproxSettings {
  /// Colours of harmonics are those of the stage's first iteration, the color net's those of the last iteration in
  /// which it moved; neither has a gradient in between.
  bool hold_colors = false;
  /// Longest side of the images that are worked on; the camera's image, frames and masks are reduced to it where they
  /// are larger. 0: as large as the camera's.
  int longest_side_px = 0;
  /// Degrees, in (0, 90]: Gaussians of human and objects that their own others hide when a stage of a frame begins,
  /// from the camera and from this far around, are left out of the stage (seen_rows). 0: all are drawn.
  double seen_within_deg = 0;
};

/// A whole run.
struct RunConfig {
  std::string name;
  std::int64_t seed = 0;
  int threads = 0;  ///< 0: one a core
  RunPrecision precision = RunPrecision::kFloat;
  RotationParameters rotations = RotationParameters::kSixD;
  std::array<double, 3> background{};  ///< colour behind everything
  CameraSettings camera;
  CameraSelectionSettings camera_selection;
  StartSettings start;
  InstanceSettings instance;
  DataSettings data;
  SourceSettings sources;
  std::vector<ChainClip> chain;  ///< clips that follow one another, each with its whole data; empty: one clip
  BodySettings body;
  ColorNetSettings color_net;
  SyntheticSettings synthetic;
  RenderSettings render;
  bool remove_depth_bias = false;  ///< see pipelines/run/depth_bias.h
  bool uncertainty = false;        ///< see pipelines/run/place_uncertainty.h
  bool estimate_blur = false;      ///< render.blur is what frame 0 says, found as the run begins
  SkipSettings skip;
  ApproxSettings approx;
  LogSettings log;
  PassSettings passes;              ///< see with_passes
  ConfigMap<StageSettings> stages;  ///< in the order written
};

/// Describe the sections: every setting with its range.
void describe(ConfigFields& fields, CameraSettings& settings);
void describe(ConfigFields& fields, SkipSettings& settings);

/// What a config is read for: the more is asked of it, the more can be wrong.
enum class ConfigUse {
  kSettings,  ///< each setting is right in itself
  kStages,    ///< and its stages can be run, once there are inputs
  kRun,       ///< and so can the config, as it is
};

/// Describes the config of a run. `losses` are the terms that a stage may name.
void describe(ConfigFields& fields, RunConfig& config, const std::vector<LossDescription>& losses);

/// Reads and checks a config file. Throws one UserError that tells every problem of the file, of the files that it
/// extends, and of the overrides (KEY=VALUE), a line each; or that it is a config of `hsi4d avatar fit`.
RunConfig load_run_config(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                          const std::vector<LossDescription>& losses, ConfigUse use = ConfigUse::kSettings);

/// Reads and checks a tree that load_config or config_from_overrides made, telling its problems beside those found
/// before.
RunConfig read_run_config(const ConfigValue& tree, const std::vector<LossDescription>& losses, ConfigProblems& problems,
                          ConfigUse use = ConfigUse::kSettings);

/// The text of config.resolved.json: every setting, defaults included. Reading it back gives the same config and text.
std::string resolved_config(const RunConfig& config, const std::vector<LossDescription>& losses);

/// The losses of stages that draw human and objects which empty masks switch off: those that need opacities, as
/// `center` and `mask` do.
LossesOverMasks losses_over_masks(const RunConfig& config);

/// A tree of a config without what another dataset or machine would change: the files of data, chain and body,
/// synthetic, threads, log. Two runs of the same data with equal trees have the same result.
ConfigValue without_data(ConfigValue tree);

/// The config as such a tree.
ConfigValue sections_beside_data(const RunConfig& config, const std::vector<LossDescription>& losses);

/// As sections_beside_data, with the body's file (its absolute path): what a dataset's config takes over.
ConfigValue dataset_sections(const RunConfig& config, const std::vector<LossDescription>& losses);

/// Files that the stages name, weights of a loss for example, by JSON pointer.
std::vector<ConfigPath> stage_files(const RunConfig& config, const std::vector<LossDescription>& losses);

/// The JSON Schema (draft 2020-12) of run configs.
std::string run_config_schema(const std::vector<LossDescription>& losses);

/// Every setting of a run config.
std::vector<ConfigSetting> run_config_settings(const std::vector<LossDescription>& losses);

}  // namespace hsi4d
