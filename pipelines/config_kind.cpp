#include "pipelines/config_kind.h"

#include <algorithm>

#include "core/check.h"

namespace hsi4d {

namespace {

bool has_one(const ConfigValue& tree, std::initializer_list<const char*> keys) {
  return std::any_of(keys.begin(), keys.end(), [&](const char* key) { return find_member(tree, key) != nullptr; });
}

bool is_of_run(const ConfigValue& tree) { return has_one(tree, {"stages", "data", "synthetic"}); }

}  // namespace

ConfigKind config_kind(const ConfigValue& tree) {
  return has_one(tree, {"views", "stage"}) && !is_of_run(tree) ? ConfigKind::kAvatarFit : ConfigKind::kRun;
}

void require_kind(const ConfigValue& tree, ConfigKind wanted, const std::filesystem::path& file) {
  const std::string name = file.generic_string();
  if (wanted == ConfigKind::kRun && config_kind(tree) == ConfigKind::kAvatarFit) {
    throw UserError(name +
                    ": is a config of `hsi4d avatar fit`, which learns an avatar from pictures: hsi4d avatar "
                    "fit " +
                    name + " --out F.safetensors");
  }
  if (wanted == ConfigKind::kAvatarFit && config_kind(tree) == ConfigKind::kRun && is_of_run(tree)) {
    throw UserError(name +
                    ": is a config of `hsi4d run` and `hsi4d synth`, not of `hsi4d avatar fit`; "
                    "configs/avatar/fit.json is one");
  }
}

}  // namespace hsi4d
