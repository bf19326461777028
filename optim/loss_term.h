// Loss terms: what they may read, and how they are listed. docs/adding_a_loss.md shows how to write one.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "autodiff/tape.h"
#include "optim/loss_description.h"
#include "optim/motion_start.h"

namespace hsi4d {

/// What a term may leave out of its sum, though its inputs are given: objects, or the human.
struct LeftOut {
  std::string term;
  std::string reason;                             ///< empty: its mask is, of which a run warns before it begins
  Index objects = 0;                              ///< 1 of the human, or of everything
  std::function<bool(Index object)> is_left_out;  ///< in the tape's last forward run
  bool of_human = false;                          ///< with a reason: of everything
};

/// What a term tells of what it found when it was recorded.
struct LossNote {
  std::string term, text;   ///< "hands near an object in 3 of 9 frames"
  bool is_idle = false;     ///< the term moves nothing in this stage
  bool is_of_clip = false;  ///< nor in any other frame, for the same reason
};

/// What a loss term may read, by name. A Var without a tape stands for what the stage does not have; `given` asks.
/// Every input may carry a gradient. O counts the moving objects.
template <class S>
struct LossInputs {
  Var<S> rendered;  ///< [3,H,W] the image of the present state, sRGB values as they are
  Var<S> target;    ///< [3,H,W] the video's frame
  Var<S> weight;    ///< [1,H,W] how much a pixel counts, 0 to 1; not given where all do

  Var<S> object_opacity;  ///< [O,H,W] rendered opacity Σ T α of each object's Gaussians, occluders included, 0 to 1;
                          ///< only for terms that need kObjectOpacity, as the next three
  Var<S> object_center_target;  ///< [O,3] centre of each object in the frame: x px, y px (pixel centres at +0.5), and
                                ///< how much of it the frame shows, up to 1; 0 where none is
  Var<S> object_masks;          ///< [O,H,W] what of the frame shows each object, 0 to 1
  Var<S> object_seen;           ///< [O,1,1] 1, or 0 where the frame shows none of the object
  Var<S> object_place;          ///< [O,2] where each object's centroid is in the image, x px, y px, whatever is before
                                ///< it; zeros without gradient where it is not before the camera
  Var<S> object_depth;          ///< [O,1] mean camera z of each object's Gaussian centres, metres
  Var<S> object_depth_target;   ///< [O,1] what it was in the clip's first frame, metres

  Var<S> human_opacity;  ///< [1,H,W] Σ T α of the human's Gaussians; for terms that need kHumanOpacity, as the next two
  Var<S> human_mask;     ///< [1,H,W] what of the frame shows the human, 0 to 1
  Var<S> human_seen;     ///< [1,1] 1, or 0 where the frame shows none of the human

  Var<S> keypoints;  ///< [K,2] where points of the body are in the image, x px, y px, whatever is before them;
                     ///< zeros without gradient where a point is not before the camera; only for terms that need
                     ///< kKeypoints, as the next one
  Var<S>
      keypoints_target;  ///< [K,3] where a detector found them, x px, y px, and its confidence, 0 to 1; 0: it did not

  Var<S> bones;  ///< [B,3] from joint to joint of the body, in the camera's axes, metres; only for terms that need
                 ///< kBones, as the next one
  Var<S> bones_target;  ///< [B,4] the directions that a detector found, of length 1, and its confidence, 0 to 1

  Var<S> tracks;  ///< [P,2] where points of the human and the objects are in the image, x px, y px, as keypoints; only
                  ///< for terms that need kTracks, as the next one
  Var<S> tracks_target;  ///< [P,3] where a tracker has followed them to, x px, y px, and whether it sees them, 0 to 1

  Var<S> depth;  ///< [1,H,W] mean camera z of the Gaussians in a pixel, metres, 0 where there is none; only for terms
                 ///< that need kDepthMap, as the next two and transmittance
  Var<S> depth_map;  ///< [1,H,W] depths or disparities that an estimator found, of mean 0 and standard deviation 1
                     ///< where they are known
  Var<S> depth_map_weight;  ///< [1,H,W] how sure it was, 0 to 1; 0 where they are not known
  Var<S> unknowns;  ///< [1,K] what the stage looks for of the clip: logarithms of factors, metres, betas; 0: as given

  /// The body over the F frames that the stage sees: those before, which stand still, and those that it moves. A stage
  /// of one frame sees up to three before it, one of the whole sequence frame 0.
  Var<S> body_rotations;  ///< [21M,9] rotation matrices, by rows, of joints 1 to 21 relative to their parents in the M
                          ///< frames that move
  Var<S> joints;          ///< [F,66] places of joints 0 to 21, metres, world, a frame a row
  Var<S> joints_start;    ///< [F,66] what they were when the stage began
  Var<S> joints_after;  ///< [A,66] what they are in the A frames that follow, up to three; a stage of one frame that is
                        ///< gone through again knows them, else none is given
  Var<S> joints_sigma;  ///< [F,44] how sure they are, of each joint one standard deviation across the view and one
                        ///< along it, metres. Infinite: nothing tells; not a number: nobody looked. Only for terms
                        ///< that need kSigmas, as the next one
  Var<S> view_axes;     ///< [F,3] the cameras' z in the world, of length 1
  std::shared_ptr<const MotionStart> motion;  ///< what was where when the stage began; null: not given
  /// Record places of some points of the human, all of one set, and of some of the objects' Gaussians, [P,3] metres,
  /// world, in frames that move.
  std::function<Var<S>(const std::vector<BodyPoint>& points)> body_points;
  std::function<Var<S>(const std::vector<ObjectPoint>& points)> object_points;

  Var<S> depth_moments;  ///< [2,H,W] Σ w z and Σ w z² of the Gaussians in a pixel, camera z, metres; for terms that
                         ///< need kDepths, as the next two
  Var<S> transmittance;  ///< [1,H,W] 1 − Σ w; of kDepthMap too
  Var<S> depth_target;   ///< [1,H,W] camera z of what the picture shows, metres; 0 where it is not known

  Var<S> gaussian_opacities;   ///< [N,1] of all Gaussians that are made, 0 to 1
  Var<S> gaussian_log_scales;  ///< [N,3] natural logarithm of metres

  Var<S> color_change;  ///< [N,3] by how much the avatar's own colours are others than where a fit of it began
  Var<S> shape_change;  ///< [N,7] likewise places, cm, log-scales and logits of the opacity

  /// Those of the people beside the first one: of each the human_… inputs, keypoints and bones, those over the body,
  /// object_masks, and nothing else. A term's value is the sum of what it is of the first person with all else, and of
  /// each of these.
  std::vector<LossInputs> others;
  bool is_of_other = false;  ///< of such a person: terms of objects alone have no value

  std::vector<LeftOut>* left_out = nullptr;  ///< where a term tells of what it may leave out; null: nobody asks
  std::vector<LossNote>* notes = nullptr;    ///< where it tells what it found; null: nobody asks

  static bool given(Var<S> input) { return input.tape != nullptr; }
  bool gives(LossInput need) const;
};

/// The inputs without those made on demand, or kept whole, for terms that declare them, so that a term reads none that
/// it does not declare.
template <class S>
LossInputs<S> only_declared(LossInputs<S> inputs, const std::vector<LossInput>& needs) {
  const auto lacks = [&needs](LossInput need) { return std::find(needs.begin(), needs.end(), need) == needs.end(); };
  if (lacks(LossInput::kObjectDepth)) inputs.object_depth = inputs.object_depth_target = {};
  if (lacks(LossInput::kObjectOpacity)) inputs.object_opacity = {};
  if (lacks(LossInput::kHumanOpacity)) inputs.human_opacity = {};
  if (lacks(LossInput::kKeypoints)) inputs.keypoints = inputs.keypoints_target = {};
  if (lacks(LossInput::kBones)) inputs.bones = inputs.bones_target = {};
  if (lacks(LossInput::kTracks)) inputs.tracks = inputs.tracks_target = {};
  if (lacks(LossInput::kDepths)) inputs.depth_moments = inputs.depth_target = {};
  if (lacks(LossInput::kDepthMap)) inputs.depth = inputs.depth_map = inputs.depth_map_weight = {};
  if (lacks(LossInput::kDepths) && lacks(LossInput::kDepthMap)) inputs.transmittance = {};
  if (lacks(LossInput::kSigmas)) inputs.joints_sigma = inputs.view_axes = {};
  if (lacks(LossInput::kUnknowns)) inputs.unknowns = {};
  if (lacks(LossInput::kGaussians)) inputs.gaussian_opacities = inputs.gaussian_log_scales = {};
  if (lacks(LossInput::kLook)) inputs.color_change = inputs.shape_change = {};
  return inputs;
}

/// A loss term: its description, and the function that records it on a tape and returns a scalar, or an empty Var where
/// it cannot: the term is off then, and the stage reports it. Of a term that declares what it needs the function is
/// called only where some of that is given.
struct LossTerm {
  LossDescription description;
  Var<float> (*record_float)(const LossInputs<float>& inputs, const std::any& prepared) = nullptr;
  Var<double> (*record_double)(const LossInputs<double>& inputs, const std::any& prepared) = nullptr;

  /// Records the term. `prepared` is prepared_loss of its settings; of most terms those are the settings themselves.
  template <class S>
  Var<S> record(const LossInputs<S>& inputs, const std::any& prepared) const {
    const std::vector<LossInput> needs =
        description.needs ? description.needs(prepared) : std::vector{LossInput::kImage};
    const auto is_given = [&inputs](LossInput need) { return inputs.gives(need); };
    if (description.needs && std::none_of(needs.begin(), needs.end(), is_given)) return {};
    const LossInputs<S> declared = only_declared(inputs, needs);
    if constexpr (std::is_same_v<S, float>) {
      return record_float(declared, prepared);
    } else {
      return record_double(declared, prepared);
    }
  }
  /// As above by the default settings.
  template <class S>
  Var<S> record(const LossInputs<S>& inputs) const {
    return record(inputs, prepared_loss(description.prepare, description.defaults));
  }
};

/// A term that declares what it needs; it is off where none of it is given.
inline LossTerm needing(std::vector<LossInput> inputs, LossTerm term) {
  term.description.needs = [inputs = std::move(inputs)](const std::any&) { return inputs; };
  return term;
}

/// One whose settings say what it needs; not for terms that prepare something of their settings.
/// @param inputs_of  the inputs of a `const Settings&`
template <class Settings, class F>
LossTerm needing(F inputs_of, LossTerm term) {
  term.description.needs = [inputs_of](const std::any& settings) -> std::vector<LossInput> {
    return inputs_of(std::any_cast<const Settings&>(settings));
  };
  return term;
}

/// A loss term from a function of (inputs, settings) that is generic in the precision. F is a captureless lambda.
template <class Settings, class F>
LossTerm make_loss_term(std::string name, std::string summary, F) {
  return {describe_loss<Settings>(std::move(name), std::move(summary)),
          [](const LossInputs<float>& inputs, const std::any& settings) {
            return F{}(inputs, std::any_cast<const Settings&>(settings));
          },
          [](const LossInputs<double>& inputs, const std::any& settings) {
            return F{}(inputs, std::any_cast<const Settings&>(settings));
          }};
}

/// A loss term that reads something of its settings once a run, before anything is written, and is then recorded from
/// that: Prepare is a captureless lambda of the settings, F one of (inputs, what that returned). Prepare throws
/// UserError or DataError; the message is told with the place in the config.
template <class Settings, class Prepare, class F>
LossTerm make_loss_term(std::string name, std::string summary, Prepare, F) {
  using Prepared = std::decay_t<std::invoke_result_t<Prepare, const Settings&>>;
  LossTerm term{describe_loss<Settings>(std::move(name), std::move(summary)),
                [](const LossInputs<float>& inputs, const std::any& prepared) {
                  return F{}(inputs, std::any_cast<const Prepared&>(prepared));
                },
                [](const LossInputs<double>& inputs, const std::any& prepared) {
                  return F{}(inputs, std::any_cast<const Prepared&>(prepared));
                }};
  term.description.prepare = [](const std::any& settings) {
    return std::any(Prepare{}(std::any_cast<const Settings&>(settings)));
  };
  return term;
}

/// A loss term without settings of its own; F is generic in (inputs).
template <class F>
LossTerm make_loss_term(std::string name, std::string summary, F) {
  return {describe_loss(std::move(name), std::move(summary)),
          [](const LossInputs<float>& inputs, const std::any&) { return F{}(inputs); },
          [](const LossInputs<double>& inputs, const std::any&) { return F{}(inputs); }};
}

/// The terms that this library comes with, in the order of optim/losses/list.h. A project of a user's own appends its
/// terms to this list and passes their descriptions to the program.
const std::vector<LossTerm>& loss_terms();

/// The descriptions of some terms, for configs.
std::vector<LossDescription> descriptions_of(const std::vector<LossTerm>& terms);

}  // namespace hsi4d
