// A config of `hsi4d reconstruct`: Gaussians of a scene or an object from pictures whose cameras are known.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/config_value.h"
#include "optim/loss_description.h"
#include "optim/stage_settings.h"
#include "pipelines/photos/photo.h"
#include "pipelines/rig/settings.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// A scene is around its cameras, an object before them.
enum class ScanKind { kScene, kObject };
inline constexpr std::array<ConfigChoice<ScanKind>, 2> kScanKinds = {
    {{ScanKind::kScene, "scene"}, {ScanKind::kObject, "object"}}};

/// Which pictures, and how they are read.
struct ScanPhotos {
  std::filesystem::path path;      ///< as read_posed_images has it, or a mesh; empty: not given yet
  std::filesystem::path pictures;  ///< their folder, where it is not beside the cameras
  PhotoRules rules;
  int hold_every = 8;  ///< every so many pictures, in the order of names, one is not learnt from; 0: none
  RigSettings rig;     ///< of a mesh
};

/// Where Gaussians begin.
enum class ScanStartKind { kAuto, kPoints, kDepth, kRandom };
inline constexpr std::array<ConfigChoice<ScanStartKind>, 4> kScanStartKinds = {{{ScanStartKind::kAuto, "auto"},
                                                                                {ScanStartKind::kPoints, "points"},
                                                                                {ScanStartKind::kDepth, "depth"},
                                                                                {ScanStartKind::kRandom, "random"}}};

struct ScanStart {
  ScanStartKind from = ScanStartKind::kAuto;  ///< auto: points where there are some, else depths, else random
  std::filesystem::path points;               ///< a PLY of points; empty: those of the cameras' file
  Index count = 100000;                       ///< of depth and random: at most, and so many
  double voxel = 0.01;                        ///< of depth: one point in each, metres
  std::optional<std::array<double, 6>> box;   ///< of random: x, y, z from and to; none: by the cameras
  double opacity = 0.5;
  double size = 1;  ///< of the distance to the nearest points
};

/// How the number of Gaussians changes.
enum class DensityMethod { kMcmc, kAdc, kNone };
inline constexpr std::array<ConfigChoice<DensityMethod>, 3> kDensityMethods = {
    {{DensityMethod::kMcmc, "mcmc"}, {DensityMethod::kAdc, "adc"}, {DensityMethod::kNone, "none"}}};

struct DensitySettings {
  DensityMethod method = DensityMethod::kMcmc;
  Index most = 300000;            ///< Gaussians
  int from = 500, until = 15000;  ///< iterations
  int every = 100;
  double least_opacity = 0.005;  ///< fainter ones move to where others are, or go
  double growth = 1.05;          ///< of mcmc, as the next
  double noise = 5e5;            ///< times the rate of the means and the covariance
  double gradient = 2e-4;        ///< of adc (pipelines/scan/density_adc.h), as the next
  double split_size = 0.01, most_size = 0.1;
  int reset_every = 3000;
};

/// A config of `hsi4d reconstruct`.
struct ScanSettings {
  std::filesystem::path file;  ///< the config itself, for messages
  ScanKind kind = ScanKind::kScene;
  ScanPhotos photos;
  ScanStart start;
  DensitySettings density;
  std::int64_t seed = 0;
  int threads = 0;         ///< 0: one a core
  int sh_degree = 3;       ///< of the result
  int sh_every = 1000;     ///< iterations after which one more degree is used
  double sh_share = 0.05;  ///< of the rate of `sh`, for the harmonics above degree 0
  std::array<double, 3> background = {0, 0, 0};
  bool random_background = false;
  int save_every = 1000;  ///< iterations between checkpoints
  RenderSettings render;
  StageSettings stage;
};

/// The group of each picture's gains and offsets, which the stage may move beside those of the Gaussians.
inline constexpr const char* kExposures = "exposures";

/// Names of the groups of the Gaussians.
std::vector<std::string> scan_groups();

/// Describe the sections.
void describe(ConfigFields& fields, RigSettings& settings);
void describe(ConfigFields& fields, ScanPhotos& settings);
void describe(ConfigFields& fields, ScanStart& settings);
void describe(ConfigFields& fields, DensitySettings& settings);

/// Describes a config: every setting with its range.
/// @param losses  terms that the stage may name
void describe(ConfigFields& fields, ScanSettings& settings, const std::vector<LossDescription>& losses);

/// Reads a config, and prepares its losses. Throws UserError with all of its problems, or that it is of another
/// command.
ScanSettings load_scan(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                       const std::vector<LossDescription>& losses);

/// As above of a tree that load_config made of `file`, telling its problems beside those found before.
/// @param asks_photos  whether it is a problem that it names no pictures
ScanSettings read_scan(const ConfigValue& tree, const std::filesystem::path& file,
                       const std::vector<LossDescription>& losses, ConfigProblems& problems, bool asks_photos = true);

/// Its text with every setting, defaults included.
std::string resolved_scan(const ScanSettings& settings, const std::vector<LossDescription>& losses);

/// The JSON Schema (draft 2020-12) of such configs, and all of their settings.
std::string scan_schema(const std::vector<LossDescription>& losses);
std::vector<ConfigSetting> scan_settings(const std::vector<LossDescription>& losses);

}  // namespace hsi4d
