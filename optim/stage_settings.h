// What a config says about one stage: what moves and how far, which losses count, how gradients become steps.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "body/pose_prior.h"
#include "core/config.h"
#include "optim/loss_description.h"

namespace hsi4d {

enum class OptimizerKind { kAdam, kBfgs, kLm, kWhitenedAdam };

inline constexpr std::array<ConfigChoice<OptimizerKind>, 4> kOptimizerKinds = {
    {{OptimizerKind::kAdam, "adam"},
     {OptimizerKind::kBfgs, "bfgs"},
     {OptimizerKind::kLm, "lm"},
     {OptimizerKind::kWhitenedAdam, "whitened_adam"}}};

/// How gradients become steps. beta1, beta2 and eps are Adam's; what begins with matrix is of the Gauss-Newton matrix
/// of lm and whitened_adam (autodiff/curvature.h).
struct OptimizerSettings {
  OptimizerKind kind = OptimizerKind::kAdam;
  double beta1 = 0.9;
  double beta2 = 0.999;
  double eps = 1e-8;
  int max_rollbacks = 10;       ///< bad steps in a row (in all, but with adam) that are undone; one more is an error
  bool keep_curvature = false;  ///< a frame begins with what was learnt in the frame before
  double damping = 0.01;        ///< lm: the first; whitened_adam: what is added to correlations
  int matrix_every = 1;         ///< a new matrix in every n-th step
  int matrix_tiles = 1;         ///< one tile of n counts, n times
  double matrix_floor = 0.01;   ///< differences of pixels below it count as squares
  bool matrix_ssim = true;      ///< SSIM has a part in it
};

/// Whether a kind makes Gauss-Newton matrices.
inline bool needs_matrix(OptimizerKind kind) {
  return kind == OptimizerKind::kLm || kind == OptimizerKind::kWhitenedAdam;
}

/// Names of settings that are not the usual ones and that this kind of optimiser does not look at.
std::vector<std::string> idle_settings(const OptimizerSettings& settings);

/// When and how far one group of parameters moves.
struct ParameterGroupSettings {
  double lr = 0;
  double lr_final_share = 1;  ///< the last iteration's learning rate is lr times this; it falls geometrically
  int from = 0;               ///< the first iteration in which it moves
  std::optional<int> until;   ///< the first in which it does not move any more; none: the end of the stage
  int every = 1;              ///< it moves in iterations from, from + every, ...
};

/// What a stage renders.
enum class Draw { kAll, kScene };

/// Which pixels count where a loss term uses weights: all; those that nothing has covered in any frame so far; those
/// that the masks of this frame do not cover; those that they do.
enum class PixelWeight { kAll, kUnoccluded, kBackground, kForeground };

/// What a stage is run for: the first frame, which is given otherwise; then each later one in its turn; then all of
/// them at once.
enum class StageScope { kFirst, kFrame, kSequence };

inline constexpr std::array<ConfigChoice<StageScope>, 3> kStageScopes = {
    {{StageScope::kFirst, "first_frame"}, {StageScope::kFrame, "frame"}, {StageScope::kSequence, "sequence"}}};

inline constexpr std::array<ConfigChoice<Draw>, 2> kDraws = {{{Draw::kAll, "all"}, {Draw::kScene, "scene"}}};
inline constexpr std::array<ConfigChoice<PixelWeight>, 4> kPixelWeights = {{{PixelWeight::kAll, "all"},
                                                                            {PixelWeight::kUnoccluded, "unoccluded"},
                                                                            {PixelWeight::kBackground, "background"},
                                                                            {PixelWeight::kForeground, "foreground"}}};

inline constexpr int kLongestSide = 65536;  ///< of images, pixels

/// One stage of the method.
struct StageSettings {
  int iterations = 0;
  StageScope over = StageScope::kFrame;
  Draw draw = Draw::kAll;
  PixelWeight weight = PixelWeight::kAll;
  ConfigMap<ParameterGroupSettings> optimize;  ///< by parameter group
  ConfigMap<LossSettings> losses;              ///< by loss term
  int headings = 1;                            ///< over the first frame: of the human, tried as starts
  int gradient_shares = 0;                     ///< every so many iterations (optim/gradient_shares.h); 0: never
  std::optional<PosePrior> pose_prior;         ///< with pose_weights, by prepare_losses; empty before
  std::filesystem::path pose_weights;          ///< over the sequence: VPoser's weights; empty: natural poses
  OptimizerSettings optimizer;
};

/// Describe the sections. `losses` are the terms that a stage may name.
void describe(ConfigFields& fields, OptimizerSettings& settings);
void describe(ConfigFields& fields, ParameterGroupSettings& settings);
void describe(ConfigFields& fields, StageSettings& settings, const std::vector<LossDescription>& losses);

/// A loss of a stage that cannot be used.
struct LossFault {
  std::string pointer;  ///< JSON pointer from the stage on: "/losses/pose_prior/weights"
  std::string text;
};

/// Prepares the losses that are on and have not been prepared yet (LossDescription::prepare), and the pose prior of a
/// stage over the sequence, so that what they read is read once, and before anything is written. A fault is placed at
/// the file that the loss names, if it is one.
/// @return  what its prepare function threw as UserError or DataError, a fault a loss
std::vector<LossFault> prepare_losses(StageSettings& stage);

/// What losses can read in a stage that draws the scene alone, and in one over the sequence.
inline constexpr std::array<LossInput, 1> kImageInputs = {LossInput::kImage};
inline constexpr std::array<LossInput, 6> kMotionInputs = {LossInput::kPose,     LossInput::kMotion,
                                                           LossInput::kSigmas,   LossInput::kObjectMotion,
                                                           LossInput::kContacts, LossInput::kBodyVertices};

/// Losses that are on and need what the stage does not have.
///
/// @param has     what it has
/// @param having  the stage in words: "a stage with ..."
std::vector<LossFault> losses_without_inputs(const StageSettings& stage, std::span<const LossInput> has,
                                             const std::string& having);

}  // namespace hsi4d
