// Which command a config is for. The kinds have different sections, and messages should say which one is meant.
#pragma once

#include <filesystem>

#include "core/config_value.h"

namespace hsi4d {

enum class ConfigKind {
  kRun,        ///< of `hsi4d run`, `hsi4d synth` and `hsi4d demo`
  kAvatarFit,  ///< of `hsi4d avatar fit`
  kScan,       ///< of `hsi4d reconstruct`
  kSweep,      ///< of `hsi4d sweep`
};

/// By the names of its sections: `photos` or `density` are of a reconstruction, `views` or `stage` else of an avatar
/// fit, `base`, `grid` and the like of a sweep, `stages`, `data` and `synthetic` of a run. What has none of these is of
/// a run.
ConfigKind config_kind(const ConfigValue& tree);

/// Throws UserError, "FILE: is a config of `hsi4d avatar fit` …" or "… of `hsi4d sweep` …", when a tree is of the other
/// kind than `wanted`.
void require_kind(const ConfigValue& tree, ConfigKind wanted, const std::filesystem::path& file);

}  // namespace hsi4d
