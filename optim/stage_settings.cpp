#include "optim/stage_settings.h"

namespace hsi4d {
namespace {

constexpr int kMostIterations = 1000000;

std::vector<ConfigKey<LossSettings>> loss_keys(const std::vector<LossDescription>& losses) {
  std::vector<ConfigKey<LossSettings>> keys;
  for (const LossDescription& loss : losses)
    keys.push_back({loss.name, loss.summary, {1, loss.defaults, loss.describe_settings}});
  return keys;
}

}  // namespace

void describe(ConfigFields& f, OptimizerSettings& s) {
  f.choice("kind", s.kind, kOptimizerKinds, "The method");
  f.number("beta1", s.beta1, {.min = 0, .below = 1}, "Decay of the first moment");
  f.number("beta2", s.beta2, {.min = 0, .below = 1}, "Decay of the second moment");
  f.number("eps", s.eps, {.min = 1e-30, .max = 1}, "Added to the root of the second moment");
  f.integer("max_rollbacks", s.max_rollbacks, {.min = 0, .max = kMostIterations},
            "Steps of a stage that may be taken back because a number was not finite; one more is an error");
}

void describe(ConfigFields& f, ParameterGroupSettings& s) {
  const IntegerRange iterations = {.min = 0, .max = kMostIterations};
  f.number("lr", s.lr, {.min = 0, .max = 1000}, "Learning rate").required();
  f.number("lr_final_share", s.lr_final_share, {.above = 0, .max = 1},
           "Share of the learning rate that is left in the last iteration; it falls geometrically; 1: constant");
  f.integer("from", s.from, iterations, "First iteration in which the group moves");
  f.optional(s.until, [iterations](ConfigFields& inner, int& until) {
    inner.integer("until", until, iterations,
                  "First iteration in which it no longer moves; null: the end of the stage");
  });
  f.integer("every", s.every, {.min = 1, .max = kMostIterations}, "It moves in every this many-th iteration");
  f.rule({"until", "from"}, [&s]() -> std::string {
    if (!s.until || *s.until > s.from) return "";
    return std::to_string(*s.until) + " is not after from, which is " + std::to_string(s.from) +
           "; the group would never move";
  });
}

void describe(ConfigFields& f, StageSettings& s, const std::vector<LossDescription>& losses) {
  f.integer("iterations", s.iterations, {.min = 1, .max = kMostIterations}, "Steps of the optimiser").required();
  f.choice(
      "over", s.over, kStageScopes,
      "What is optimised at once: a frame, each in its turn, or after them the whole sequence, which draws nothing");
  f.choice("draw", s.draw, kDraws, "What is rendered: all, or the static scene alone");
  f.choice("weight", s.weight, kPixelWeights,
           "Pixels that count in weighted losses: all, those that no human or object has covered in any frame so far, "
           "or those that the frame's masks cover");
  f.map("optimize", s.optimize, "What moves: parameter groups by name");
  f.map("losses", s.losses, loss_keys(losses), "What is made small: loss terms by name; their weighted sum counts");
  f.path("pose_weights", s.pose_weights, {.must_exist = true},
         "VPoser's weights (tools/export_vposer.py), whose latents a stage over the sequence moves; without, natural "
         "poses by anatomy");
  f.object("optimizer", s.optimizer, "How gradients become steps");
}

}  // namespace hsi4d
