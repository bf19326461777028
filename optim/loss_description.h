// What a config needs to know of a loss term: its name, one line about it, and its own settings.
#pragma once

#include <algorithm>
#include <any>
#include <functional>
#include <memory>
#include <string>
#include <typeinfo>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/config.h"

namespace hsi4d {

/// What a loss term may need, as LossInputs (optim/loss_term.h) has it. A term declares it once; what a stage makes for
/// the term, which stages it can be in and where it is off follow.
enum class LossInput {
  kImage,          ///< rendered, target
  kObjectDepth,    ///< object_depth, object_depth_target
  kObjectOpacity,  ///< object_opacity, and what the frame says of the objects; a channel of the render each, on demand
  kHumanOpacity,   ///< human_opacity, human_mask, human_seen; likewise
  kKeypoints,      ///< keypoints, keypoints_target: where data.keypoints is given; likewise
  kBones,          ///< bones, bones_target: where data.keypoints has landmarks; likewise
  kDepthMap,       ///< depth, transmittance, depth_map, depth_map_weight: where data.depth_maps is given; likewise
  kTracks,         ///< tracks, tracks_target: where data.tracks has some on what moves; likewise
  kUnknowns,       ///< unknowns: in a stage over the first frame that moves some
  kPose,           ///< body_rotations
  kMotion,         ///< joints, joints_start, joints_after, motion, body_points
  kSigmas,         ///< joints_sigma, view_axes: in a stage over the sequence that a run makes
  kObjectMotion,   ///< object_points, and motion with objects
  kContacts,       ///< motion->contacts, with body_points and object_points: where data.contacts is given
  kBodyVertices,   ///< motion->mesh, where the avatar was made on it; on demand
  kDepths,         ///< depth_moments, transmittance, depth_target: where pictures come with depths
  kGaussians,      ///< gaussian_opacities, gaussian_log_scales: where Gaussians themselves are made
  kLook,           ///< color_change, shape_change: where the look of an avatar is learnt
};

/// What a term reads once from its settings; see LossDescription::prepare.
using PrepareLoss = std::any (*)(const std::any& settings);

/// What a term needs with these settings. It is off where none of it is given.
using LossNeeds = std::function<std::vector<LossInput>(const std::any& settings)>;

/// A loss term as configs and `hsi4d list losses` see it. Made by describe_loss.
struct LossDescription {
  std::string name;     ///< the key in a stage's `losses`
  std::string summary;  ///< one line
  std::any defaults;    ///< its own settings before anything is read; empty for a term that has none
  void (*describe_settings)(ConfigFields&, std::any&) = nullptr;
  LossNeeds needs = {};           ///< made by needing() of optim/loss_term.h. Null: the image
  PrepareLoss prepare = nullptr;  ///< reads the files that the settings name, say: once, before a run writes anything.
                                  ///< What it returns is recorded from in place of the settings. Null: nothing to do
  double weight = 1;              ///< the default
};

/// A loss term without settings of its own.
inline LossDescription describe_loss(std::string name, std::string summary) {
  LossDescription loss;
  loss.name = std::move(name);
  loss.summary = std::move(summary);
  return loss;
}

/// A loss term with its own settings: a struct with `void describe(ConfigFields&, Settings&)` beside it.
template <class Settings>
LossDescription describe_loss(std::string name, std::string summary, Settings defaults = {}) {
  LossDescription loss = describe_loss(std::move(name), std::move(summary));
  loss.defaults = std::move(defaults);
  loss.describe_settings = [](ConfigFields& fields, std::any& settings) {
    describe(fields, *std::any_cast<Settings>(&settings));
  };
  return loss;
}

/// What a term is recorded from: what it prepares of its settings, or the settings. Throws what `prepare` throws.
inline std::any prepared_loss(PrepareLoss prepare, const std::any& settings) {
  return prepare != nullptr ? prepare(settings) : settings;
}

/// One entry of a stage's `losses`: the weight, and the term's own settings beside it.
struct LossSettings {
  double weight = 1;
  std::any own;
  std::shared_ptr<const LossDescription> term = {};  ///< null: a term without settings that needs the image
  std::any prepared = {};  ///< of `own`, by prepare_losses (optim/stage_settings.h); empty before

  /// The term's own settings. Throws InternalError when the term has others than `Settings`.
  template <class Settings>
  const Settings& own_as() const {
    const Settings* settings = std::any_cast<Settings>(&own);
    HSI4D_CHECK(settings != nullptr,
                std::string("the settings of this loss are not of type ") + typeid(Settings).name());
    return *settings;
  }
};

/// What a term with these settings needs, whether it is on or not.
inline std::vector<LossInput> needs_of(const LossSettings& loss) {
  return loss.term && loss.term->needs ? loss.term->needs(loss.own) : std::vector{LossInput::kImage};
}

/// Whether a term with these settings is on and needs the input.
inline bool needs_input(const LossSettings& loss, LossInput input) {
  if (loss.weight == 0) return false;
  const std::vector<LossInput> needs = needs_of(loss);
  return std::find(needs.begin(), needs.end(), input) != needs.end();
}

/// The settings of a term before anything is read.
inline LossSettings default_settings(const LossDescription& loss) {
  return {loss.weight, loss.defaults, std::make_shared<const LossDescription>(loss)};
}

/// Describes the weight and the term's own settings.
inline void describe(ConfigFields& fields, LossSettings& settings) {
  fields.number("weight", settings.weight, {.min = 0}, "Factor in the stage's sum; 0: off");
  if (settings.term && settings.term->describe_settings) settings.term->describe_settings(fields, settings.own);
}

}  // namespace hsi4d
