#include "optim/loss_term.h"

namespace hsi4d {

template <class S>
bool LossInputs<S>::gives(LossInput need) const {
  switch (need) {
    case LossInput::kImage:
      return given(rendered) && given(target);
    case LossInput::kObjectDepth:
      return given(object_depth) && given(object_depth_target) && object_depth.shape().rows > 0;
    case LossInput::kObjectOpacity:
      return given(object_opacity) && object_opacity.shape().planes > 0;
    case LossInput::kHumanOpacity:
      return given(human_opacity);
    case LossInput::kKeypoints:
      return given(keypoints) && given(keypoints_target);
    case LossInput::kBones:
      return given(bones) && given(bones_target);
    case LossInput::kTracks:
      return given(tracks) && given(tracks_target);
    case LossInput::kDepthMap:
      return given(depth) && given(transmittance) && given(depth_map) && given(depth_map_weight);
    case LossInput::kUnknowns:
      return given(unknowns);
    case LossInput::kPose:
      return given(body_rotations);
    case LossInput::kMotion:
      return given(joints) && motion;
    case LossInput::kSigmas:
      return given(joints_sigma) && given(view_axes);
    case LossInput::kObjectMotion:
      return object_points && motion && !motion->objects.empty();
    case LossInput::kContacts:
      return given(joints) && motion && motion->contacts.has_value();
    case LossInput::kBodyVertices:
      return motion && motion->mesh != nullptr;
    case LossInput::kDepths:
      return given(depth_moments) && given(transmittance) && given(depth_target);
    case LossInput::kGaussians:
      return given(gaussian_opacities) && given(gaussian_log_scales);
    case LossInput::kLook:
      return given(color_change) && given(shape_change);
  }
  return false;
}

template bool LossInputs<float>::gives(LossInput) const;
template bool LossInputs<double>::gives(LossInput) const;

std::vector<LossDescription> descriptions_of(const std::vector<LossTerm>& terms) {
  std::vector<LossDescription> all;
  for (const LossTerm& term : terms) all.push_back(term.description);
  return all;
}

}  // namespace hsi4d
