#include "pipelines/config/config_kind.h"

#include <algorithm>

#include "core/check.h"

namespace hsi4d {

namespace {

bool has_one(const ConfigValue& tree, std::initializer_list<const char*> keys) {
  return std::any_of(keys.begin(), keys.end(), [&](const char* key) { return find_member(tree, key) != nullptr; });
}

bool is_of_run(const ConfigValue& tree) { return has_one(tree, {"stages", "data", "synthetic"}); }

bool is_of_sweep(const ConfigValue& tree) {
  return has_one(tree, {"base", "grid", "zip", "blocks", "ablations", "seeds", "clips", "sweep_plan"});
}

}  // namespace

ConfigKind config_kind(const ConfigValue& tree) {
  if (is_of_run(tree)) return ConfigKind::kRun;
  if (is_of_sweep(tree)) return ConfigKind::kSweep;
  if (has_one(tree, {"photos", "density"})) return ConfigKind::kScan;
  return has_one(tree, {"views", "stage"}) ? ConfigKind::kAvatarFit : ConfigKind::kRun;
}

void require_kind(const ConfigValue& tree, ConfigKind wanted, const std::filesystem::path& file) {
  const std::string name = file.generic_string();
  const ConfigKind kind = config_kind(tree);
  if (wanted != ConfigKind::kSweep && kind == ConfigKind::kSweep)
    throw UserError(name + ": is a sweep, many runs in one file: hsi4d sweep " + name);
  if (wanted == ConfigKind::kSweep && kind != ConfigKind::kSweep)
    throw UserError(name + ": is no sweep: it has no \"base\"; docs/sweeps.md tells what one looks like");
  if (wanted == ConfigKind::kRun && kind == ConfigKind::kAvatarFit) {
    throw UserError(name +
                    ": is a config of `hsi4d avatar fit`, which learns an avatar from pictures: hsi4d avatar "
                    "fit " +
                    name + " --out F.safetensors");
  }
  if (wanted != ConfigKind::kScan && kind == ConfigKind::kScan) {
    throw UserError(name +
                    ": is a config of `hsi4d reconstruct`, which makes Gaussians from pictures: hsi4d reconstruct " +
                    name + " --out DIR");
  }
  if (wanted == ConfigKind::kScan && kind != ConfigKind::kScan) {
    throw UserError(name +
                    ": is no config of `hsi4d reconstruct`: it has neither \"photos\" nor \"density\"; "
                    "configs/reconstruct/scene.json is one");
  }
  if (wanted == ConfigKind::kAvatarFit && kind == ConfigKind::kRun && is_of_run(tree)) {
    throw UserError(name +
                    ": is a config of `hsi4d run` and `hsi4d synth`, not of `hsi4d avatar fit`; "
                    "configs/avatar/fit.json is one");
  }
}

}  // namespace hsi4d
