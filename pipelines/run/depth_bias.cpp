#include "pipelines/run/depth_bias.h"

#include <cmath>

#include "core/text.h"
#include "pipelines/graph/frame_masks.h"

namespace hsi4d {

namespace {

Vector3<double> camera_center(const SceneState& state) {
  const Rigid<double>& camera = state.camera_from_world;
  return -(camera.rotation.transpose() * camera.translation);
}

/// Where the pelvis is: the body turns about it, and the translation comes last.
Vector3<double> pelvis_of(const Clip& clip, const SceneState& state, std::size_t person) {
  return Vector3<double>(clip.person(person).avatar.joints.data()) + state.person(person).transl;
}

/// Distance along the line of sight of `given`, as a factor.
double factor_of(const Vector3<double>& center, const Vector3<double>& given, const Vector3<double>& fitted) {
  const Vector3<double> sight = given - center;
  const double factor = (fitted - center).dot(sight) / sight.squaredNorm();
  return std::abs(factor - 1) <= kMostDepthBias ? factor : 1;  // also where it is not a number
}

bool is_seen(const Image& mask, double threshold) { return mask.empty() || mask_center(mask, threshold)[2] != 0; }

}  // namespace

DepthBias depth_bias(const Clip& clip, const ClipFrame& frame, double mask_threshold, const SceneState& given,
                     const SceneState& fitted) {
  const Vector3<double> center = camera_center(given);
  DepthBias bias;
  bias.others.resize(clip.others.size(), 1);
  for (std::size_t p = 0; p < clip.people(); ++p) {
    if (is_seen(frame.person_mask(p), mask_threshold))
      bias.person(p) = factor_of(center, pelvis_of(clip, given, p), pelvis_of(clip, fitted, p));
  }
  for (std::size_t o = 0; o < given.objects.size(); ++o) {
    const bool seen = o >= frame.object_masks.size() || is_seen(frame.object_masks[o], mask_threshold);
    bias.objects.push_back(seen ? factor_of(center, given.objects[o].translation, fitted.objects[o].translation) : 1.0);
  }
  return bias;
}

void remove_depth_bias(const Clip& clip, const DepthBias& bias, SceneState& state) {
  const Vector3<double> center = camera_center(state);
  const auto shift = [&](const Vector3<double>& place, double factor) -> Vector3<double> {
    return (place - center) * (1 / factor - 1);
  };
  for (std::size_t p = 0; p < clip.people(); ++p)
    state.person(p).transl += shift(pelvis_of(clip, state, p), bias.person(p));
  const std::vector<ObjectPose> before = state.objects;
  for (std::size_t o = 0; o < state.objects.size(); ++o) {
    if (const std::optional<ObjectJoint>& joint = clip.objects[o].joint) {
      if (!joint->parent) continue;
      const Rigid<double> on_parent = parent_from_object(*joint, before, o);
      state.objects[o] = pose_of(compose(world_from_parent(*joint, state.objects), on_parent));
      continue;
    }
    Vector3<double>& place = state.objects[o].translation;
    place += shift(place, bias.objects[o]);
  }
}

std::string depth_bias_text(const Clip& clip, const DepthBias& bias) {
  std::string text = "human " + rounded(bias.human, 6);
  for (std::size_t o = 0; o < bias.objects.size(); ++o)
    text += ", " + clip.objects[o].name + " " + rounded(bias.objects[o], 6);
  for (std::size_t p = 0; p < bias.others.size(); ++p)
    text += ", " + clip.others[p].name + " " + rounded(bias.others[p], 6);
  return text;
}

}  // namespace hsi4d
