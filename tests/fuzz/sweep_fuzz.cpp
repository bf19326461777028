// Any bytes as a sweep's file. What is taken has blocks that begin with a config which is there, axes whose points have
// a setting for each of their keys, and no more runs than a sweep may have.
#include "core/config_file.h"
#include "pipelines/sweep/file.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::sweep_fuzz {

namespace {

constexpr std::string_view kAxes =
    R"({"name": "a", "base": "base.json", "set": {"render.blur": 0.13}, "seeds": 2, "compare": {"ablation": "plain"},
 "ablations": {"plain": {}, "no_center": {"stages.interaction.losses.center": null}},
 "grid": {"stages.camera.iterations": [30, 60], "/data/instance": ["x", "y"]},
 "zip": {"render.alpha_min": [1e-3, 1e-4], "render.transmittance_stop": [1e-3, 1e-5]},
 "skip": [{"ablation": "no_center", "seed": 1}], "only": [{"stages.camera.iterations": [30, 60]}]})";

constexpr std::string_view kBlocks =
    R"({"base": "base.json", "threads": 2, "memory_mb": 512.5, "seeds": [0, 7], "clips": {"a": "base.json"},
 "slurm": {"time": "1-02:00:00", "memory_mb": 900, "at_once": 4, "grace_s": 60, "options": ["--account=hsi"]},
 "blocks": [{"name": "one", "clips": {"b": {"config": "clip.json", "set": {"threads": 1}}}},
  {"name": "two", "clips": ["clip.json"], "seeds": {"dim": {"background": [0, 0, 0]}}, "zip": [{"seed_of": [1, 2]}]}]})";

constexpr std::string_view kSearch =
    R"({"base": "base.json", "seeds": 2, "hours": 1.5, "memory_retries": 1, "search": {"metric": "mpjpe_mm", "method": "random", "seed": 3, "runs": 30,
 "over": {"stages.a.lr": {"from": 1e-3, "to": 0.1, "scale": "log"}, "b.frames": {"from": 2, "to": 30, "integer": true},
  "color_net.use": ["on", "off", null]}, "halving": {"rungs": {"stages.a.iterations": [10, 20]}, "factor": 3}}})";

/// The configs that a sweep's file names; what is in them is read with its runs.
const Scratch& scratch() {
  static const Scratch made({{"base.json", bytes_of("{}")}, {"clip.json", bytes_of("{}")}});
  return made;
}

void check_axis(const SweepAxis& axis) {
  for (const std::vector<SweepSetting>& point : axis.points) HSI4D_CHECK_EQ(point.size(), axis.keys.size());
}

void check_block(const SweepBlock& block) {
  HSI4D_CHECK(std::filesystem::exists(block.base), "a base that is not there");
  for (const SweepClip& clip : block.clips)
    HSI4D_CHECK(std::filesystem::exists(clip.config), "a clip that is not there");
  for (const SweepAxis* const axis : setting_axes(block)) check_axis(*axis);
  HSI4D_CHECK_EQ(block.search.has_value(), !block.searched.empty());
  if (block.search) HSI4D_CHECK(sweep_combinations(block) >= 2, "a search of one point");
}

}  // namespace

std::vector<Bytes> corpus() { return {bytes_of(kAxes), bytes_of(kBlocks), bytes_of(kSearch)}; }

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    ConfigProblems problems;
    const ConfigValue tree =
        load_config_text(std::string(file.begin(), file.end()), "fuzz.json", scratch().path(), {}, problems);
    const SweepFile sweep = read_sweep_file(tree, "fuzz.json", problems);
    HSI4D_CHECK(!sweep.blocks.empty(), "a sweep without blocks");
    std::int64_t runs = 0;
    for (const SweepBlock& block : sweep.blocks) {
      check_block(block);
      runs += sweep_combinations(block);
    }
    HSI4D_CHECK(runs <= kMostSweepRuns, "more runs than are allowed");
  });
}

const Target target("sweep", corpus, accepts);

}  // namespace hsi4d::fuzz::sweep_fuzz
