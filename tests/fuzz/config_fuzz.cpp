// Any bytes as a config of `run` or of `avatar fit`: the reader answers with a config or with a UserError, and what it
// accepts it writes and reads back to the same text. The first byte decides how much of the input is an override.
#include <string>
#include <string_view>

#include "core/config_file.h"
#include "optim/loss_term.h"
#include "pipelines/avatar/fit.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/config/run_config.h"
#include "pipelines/config/run_problems.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::config_fuzz {
namespace {

std::string resolved(const std::string& text, const std::vector<std::string>& overrides) {
  static const std::vector<LossDescription> losses = descriptions_of(loss_terms());
  ConfigProblems problems;
  const ConfigValue tree = load_config_text(text, "fuzz.json", "/nonexistent", overrides, problems);
  if (config_kind(tree) == ConfigKind::kAvatarFit)
    return resolved_avatar_fit(read_avatar_fit(tree, "fuzz.json", losses, problems, false), losses);
  const RunConfig config = read_run_config(tree, losses, problems);
  run_problems(config, ConfigUse::kRun);
  return resolved_config(config, losses);
}

Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

}  // namespace

std::vector<Bytes> corpus() {
  return {
      bytes_of(R"({"seed": 3, "threads": 2, "render": {"quality": "accurate", "blur": 0.25, "alpha_min": 1e-4}})"),
      bytes_of(R"({"render": {"compatibility": "gsplat", "near": 0.2}, "stages": {"camera": {"iterations": 30,
 "optimize": {"camera": {"lr": 1e-3, "from": 0, "until": 30, "every": 1}}, "losses": {"photometric": {"weight": 0.5}},
 "optimizer": {"kind": "adam", "beta1": 0.9}}}})"),
      bytes_of(R"({"stage": {"iterations": 30, "optimize": {"colors": {"lr": 1e-3}}, "losses": {"photometric": {}}},
 "gaussians": 100, "held_cameras": [1, 2], "color_net": {"use": "off"}})"),
      bytes_of(R"({"chain": [{"name": "a", "data": {"video_rate": 25}}], "skip": {"unseen_gaussians": true},
 "synthetic": {"frames": 2, "scene": "garden"}})"),
      bytes_of("\xa0render.blur=0.5                 {\"render\": {\"blur\": 1}}"),
  };
}

bool accepts(std::span<const uint8_t> file) {
  const std::string bytes(file.begin(), file.end());
  const std::size_t cut = file.empty() ? 0 : 1 + file[0] % 64U;
  std::vector<std::string> overrides;
  if (!file.empty() && file[0] >= 128 && cut <= file.size()) overrides.push_back(bytes.substr(1, cut - 1));
  const std::string text = overrides.empty() ? bytes : bytes.substr(cut);
  return is_read([&] {
    const std::string once = resolved(text, overrides);
    HSI4D_CHECK_EQ(resolved(once, {}), once);
  });
}

const Target target("config", corpus, accepts);

}  // namespace hsi4d::fuzz::config_fuzz
