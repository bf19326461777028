#include "optim/stage_settings.h"

#include <algorithm>

#include "core/check.h"

namespace hsi4d {
namespace {

constexpr int kMostIterations = 1000000;

std::vector<ConfigKey<LossSettings>> loss_keys(const std::vector<LossDescription>& losses) {
  std::vector<ConfigKey<LossSettings>> keys;
  for (const LossDescription& loss : losses) keys.push_back({loss.name, loss.summary, default_settings(loss)});
  return keys;
}

/// The place of a loss: of the one file that it names, else of itself.
std::string place_of(const std::string& name, LossSettings& loss) {
  const std::string pointer = child_pointer("/losses", name);
  ConfigFields fields;
  describe(fields, loss);
  const std::vector<ConfigPath> files = list_paths(fields, pointer);
  return files.size() == 1 ? files.front().pointer : pointer;
}

const char* words_of(LossInput need) {
  switch (need) {
    case LossInput::kImage:
      return "an image";
    case LossInput::kObjectDepth:
    case LossInput::kObjectOpacity:
      return "objects";
    case LossInput::kHumanOpacity:
    case LossInput::kKeypoints:
    case LossInput::kBones:
      return "the body in an image";
    case LossInput::kTracks:
    case LossInput::kDepthMap:
      return "everything in an image";
    case LossInput::kDepths:
      return "depths of pictures";
    case LossInput::kGaussians:
      return "Gaussians that are made";
    case LossInput::kUnknowns:
      return "a group of the clip, such as focal_length";
    case LossInput::kLook:
      return "a look that is learnt";
    case LossInput::kPose:
    case LossInput::kMotion:
    case LossInput::kSigmas:
    case LossInput::kObjectMotion:
    case LossInput::kContacts:
    case LossInput::kBodyVertices:
      return "the body";
  }
  return "";
}

}  // namespace

void describe(ConfigFields& f, OptimizerSettings& s) {
  f.choice("kind", s.kind, kOptimizerKinds,
           "Adam; for few numbers such as the camera's BFGS with a line search; with a Gauss-Newton matrix "
           "Levenberg-Marquardt, or Adam in numbers that are not correlated");
  f.number("beta1", s.beta1, {.min = 0, .below = 1}, "Decay of the first moment");
  f.number("beta2", s.beta2, {.min = 0, .below = 1}, "Decay of the second moment");
  f.number("eps", s.eps, {.min = 1e-30, .max = 1}, "Added to the root of the second moment");
  f.integer("max_rollbacks", s.max_rollbacks, {.min = 0, .max = kMostIterations},
            "Steps that may be undone because a number was not finite, in a row with adam, else in a stage; one more "
            "is an error");
  f.boolean("keep_curvature", s.keep_curvature,
            "bfgs, whitened_adam: begin with the curvature of the frame before, for fewer evaluations");
  f.number(
      "damping", s.damping, {.min = 1e-9, .max = 1e6},
      "lm: share of the diagonal added to the matrix in the first step; whitened_adam: in all, beside correlations");
  f.integer("matrix_every", s.matrix_every, {.min = 1, .max = kMostIterations},
            "lm, whitened_adam: a new matrix in every n-th step");
  f.integer("matrix_tiles", s.matrix_tiles, {.min = 1, .max = 64},
            "lm, whitened_adam: one of so many tiles of the image is in a matrix, others in the next");
  f.number("matrix_floor", s.matrix_floor, {.min = 1e-6, .max = 10},
           "lm, whitened_adam: absolute differences of pixels below it count as squares in the matrix");
  f.boolean("matrix_ssim", s.matrix_ssim, "lm, whitened_adam: SSIM has a part in the matrix");
}

std::vector<std::string> idle_settings(const OptimizerSettings& s) {
  const OptimizerSettings usual;
  const bool has_moments = s.kind != OptimizerKind::kBfgs, has_matrix = needs_matrix(s.kind);
  const bool keeps = s.kind == OptimizerKind::kBfgs || s.kind == OptimizerKind::kWhitenedAdam;
  std::vector<std::string> idle;
  const auto add_if = [&idle](bool is_idle, const char* name) {
    if (is_idle) idle.emplace_back(name);
  };
  add_if(!keeps && s.keep_curvature, "keep_curvature");
  add_if(!has_moments && s.beta1 != usual.beta1, "beta1");
  add_if(!has_moments && s.beta2 != usual.beta2, "beta2");
  add_if(!has_moments && s.eps != usual.eps, "eps");
  add_if(!has_matrix && s.damping != usual.damping, "damping");
  add_if(!has_matrix && s.matrix_every != usual.matrix_every, "matrix_every");
  add_if(!has_matrix && s.matrix_tiles != usual.matrix_tiles, "matrix_tiles");
  add_if(!has_matrix && s.matrix_floor != usual.matrix_floor, "matrix_floor");
  add_if(!has_matrix && s.matrix_ssim != usual.matrix_ssim, "matrix_ssim");
  return idle;
}

void describe(ConfigFields& f, ParameterGroupSettings& s) {
  const IntegerRange iterations = {.min = 0, .max = kMostIterations};
  f.number("lr", s.lr, {.min = 0, .max = 1000}, "Learning rate").required();
  f.number("lr_final_share", s.lr_final_share, {.above = 0, .max = 1},
           "Share of lr in the last iteration; it falls geometrically; 1: constant");
  f.integer("from", s.from, iterations, "First iteration in which the group moves");
  f.optional(s.until, [iterations](ConfigFields& inner, int& until) {
    inner.integer("until", until, iterations,
                  "First iteration in which it no longer moves; null: the end of the stage");
  });
  f.integer("every", s.every, {.min = 1, .max = kMostIterations}, "It moves in every n-th iteration");
  f.rule({"until", "from"}, [&s]() -> std::string {
    if (!s.until || *s.until > s.from) return "";
    return std::to_string(*s.until) + " is not after from, which is " + std::to_string(s.from) +
           "; the group would never move";
  });
}

void describe(ConfigFields& f, StageSettings& s, const std::vector<LossDescription>& losses) {
  f.integer("iterations", s.iterations, {.min = 1, .max = kMostIterations}, "Steps of the optimiser").required();
  f.choice("over", s.over, kStageScopes,
           "What is optimised at once: frame 0 before the others, each frame in turn, or the sequence after them; "
           "frames after "
           "the sequence: a further pass, each frame from where the stages before left it");
  f.choice("draw", s.draw, kDraws, "What is rendered: everything, or the static scene alone");
  f.choice("weight", s.weight, kPixelWeights,
           "Pixels that count in weighted losses: all, those never masked so far, those outside this frame's masks, "
           "those inside");
  f.map("optimize", s.optimize, "What moves: parameter groups by name");
  f.map("losses", s.losses, loss_keys(losses), "What is made small: loss terms by name; their weighted sum counts");
  f.integer("headings", s.headings, {.min = 1, .max = 72},
            "Over the first frame: headings of the human, evenly around from the given one, from which the stage is "
            "tried; the one that ends with the least loss is kept");
  f.integer("gradient_shares", s.gradient_shares, {.min = 0, .max = kMostIterations},
            "Measure each loss's share of the gradient in every n-th iteration, a backward pass per loss; 0: never");
  f.path("pose_weights", s.pose_weights, {.must_exist = true},
         "VPoser's weights (tools/export_vposer.py), for a stage over the sequence; empty: natural poses by anatomy");
  f.object("optimizer", s.optimizer, "How gradients become steps");
  f.rule({"headings", "over", "draw"}, [&s]() -> std::string {
    if (s.headings == 1 || (s.over == StageScope::kFirst && s.draw == Draw::kAll)) return "";
    return std::to_string(s.headings) +
           " headings are tried by a stage over \"first_frame\" that draws \"all\"; allowed here: 1";
  });
  f.rule({"optimizer", "optimize"}, [&s]() -> std::string {
    if (s.optimizer.kind != OptimizerKind::kBfgs) return "";
    for (const auto& [name, group] : s.optimize) {
      if (group.from != 0 || group.until || group.every != 1 || group.lr_final_share != 1)
        return std::string(choice_name<OptimizerKind>(kOptimizerKinds, s.optimizer.kind)) +
               " moves all numbers in every step: from, until, every and lr_final_share of \"" + name +
               "\" have no meaning";
    }
    return "";
  });
  f.rule({"optimizer", "over"}, [&s]() -> std::string {
    if (!s.optimizer.keep_curvature) return "";
    return s.over == StageScope::kFrame ? "" : "only a stage over frames has a frame before to keep the curvature of";
  });
  f.rule({"draw", "over"}, [&s]() -> std::string {
    return s.over == StageScope::kSequence && s.draw != Draw::kAll ? "a stage over the sequence draws nothing" : "";
  });
  f.rule({"weight", "over"}, [&s]() -> std::string {
    return s.over == StageScope::kSequence && s.weight != PixelWeight::kAll ? "a stage over the sequence draws nothing"
                                                                            : "";
  });
  f.rule({"pose_weights", "over"}, [&s]() -> std::string {
    return s.over != StageScope::kSequence && !s.pose_weights.empty() ? "only a stage over the sequence has latents"
                                                                      : "";
  });
}

std::vector<LossFault> prepare_losses(StageSettings& stage) {
  std::vector<LossFault> faults;
  if (stage.over == StageScope::kSequence && !stage.pose_prior) {
    try {
      stage.pose_prior = read_pose_prior(stage.pose_weights.string());
    } catch (const UserError& mistake) {
      faults.push_back({"/pose_weights", mistake.what()});
    } catch (const DataError& damage) {
      faults.push_back({"/pose_weights", damage.what()});
    }
  }
  for (auto& [name, loss] : stage.losses) {
    if (loss.weight == 0 || !loss.term || loss.term->prepare == nullptr || loss.prepared.has_value()) continue;
    try {
      loss.prepared = loss.term->prepare(loss.own);
    } catch (const UserError& mistake) {
      faults.push_back({place_of(name, loss), mistake.what()});
    } catch (const DataError& damage) {
      faults.push_back({place_of(name, loss), damage.what()});
    }
  }
  return faults;
}

std::vector<LossFault> losses_without_inputs(const StageSettings& stage, std::span<const LossInput> has,
                                             const std::string& having) {
  std::vector<LossFault> faults;
  for (const auto& [name, loss] : stage.losses) {
    const std::vector<LossInput> needs = needs_of(loss);
    const bool is_given = std::find_first_of(needs.begin(), needs.end(), has.begin(), has.end()) != needs.end();
    if (loss.weight == 0 || is_given || needs.empty()) continue;
    faults.push_back({child_pointer("/losses", name), std::string("this loss needs ") + words_of(needs.front()) +
                                                          ", which " + having + " does not have"});
  }
  return faults;
}

}  // namespace hsi4d
