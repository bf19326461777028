#include "pipelines/config/passes.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "pipelines/config/parameter_groups.h"
#include "pipelines/config/run_config.h"

namespace hsi4d {

namespace {

bool is_of_pass(const StageSettings& stage) {
  return stage.over == StageScope::kSequence || (stage.over == StageScope::kFrame && stage.draw == Draw::kAll);
}

/// An iteration of the first pass in a further one.
int in_pass(int iteration, double share) { return static_cast<int>(std::lround(iteration * share)); }

StageSettings again(StageSettings stage, const PassSettings& passes) {
  if (stage.over == StageScope::kSequence) {
    for (auto& [name, loss] : stage.losses) {
      if (name == "smooth") loss.weight *= passes.smooth_share;
    }
    return stage;
  }
  const double share = passes.iterations_share;
  stage.iterations = std::max(1, in_pass(stage.iterations, share));
  for (auto& [name, group] : stage.optimize) {
    if (name != kColorNetGroup && name != kFeaturesGroup) group.lr *= passes.lr_share;
    group.from = std::min(in_pass(group.from, share), stage.iterations - 1);
    if (group.until) group.until = std::max(in_pass(*group.until, share), group.from + 1);
  }
  return stage;
}

/// Calls f(name, stage of the first pass) for all copies.
template <class F>
void for_copies(const RunConfig& config, const F& f) {
  for (int pass = 2; pass <= config.passes.count; ++pass) {
    for (const auto& [name, stage] : config.stages) {
      if (is_of_pass(stage)) f(name + "_" + std::to_string(pass), stage);
    }
  }
}

}  // namespace

void describe(ConfigFields& f, PassSettings& s) {
  f.integer("count", s.count, {.min = 1, .max = 10},
            "How often the stages go through the frames: those that draw everything and those over the sequence");
  f.number("iterations_share", s.iterations_share, {.above = 0, .max = 10},
           "Iterations of a further pass in a frame, as a share of those of the first");
  f.number("lr_share", s.lr_share, {.above = 0, .max = 10},
           "Its learning rates likewise, but for those of the color net and its features");
  f.number("smooth_share", s.smooth_share, {.min = 0, .max = 10},
           "The weight of `smooth` in its stages over the sequence likewise");
}

bool are_passes_idle(const RunConfig& config) {
  return config.passes.count > 1 && std::none_of(config.stages.begin(), config.stages.end(), [](const auto& stage) {
           return stage.second.over == StageScope::kSequence;
         });
}

std::vector<std::string> stages_in_the_way(const RunConfig& config) {
  std::vector<std::string> names;
  if (are_passes_idle(config)) return names;
  for_copies(config, [&](const std::string& name, const StageSettings&) {
    if (find_entry(config.stages, name) != nullptr) names.push_back(name);
  });
  return names;
}

RunConfig with_passes(const RunConfig& config) {
  HSI4D_CHECK(stages_in_the_way(config).empty(), "stages have the names of passes");
  RunConfig all = config;
  all.passes = {};
  if (are_passes_idle(config)) return all;
  for_copies(config, [&](const std::string& name, const StageSettings& stage) {
    all.stages.emplace_back(name, again(stage, config.passes));
  });
  return all;
}

}  // namespace hsi4d
