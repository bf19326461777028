#include "pipelines/input/clip_unknowns.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/text.h"
#include "splat/files/transform.h"

namespace hsi4d {

namespace {

std::vector<double> products(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || b.empty()) return a.empty() ? b : a;
  std::vector<double> all = a;
  for (std::size_t i = 0; i < all.size(); ++i) all[i] *= b.at(i);
  return all;
}

/// Numbers beyond the end are 0.
std::vector<double> sums(std::vector<double> a, const std::vector<double>& b) {
  a.resize(std::max(a.size(), b.size()));
  for (std::size_t i = 0; i < b.size(); ++i) a[i] += b[i];
  return a;
}

Similarity world_from_scene(const ClipUnknowns& unknowns) {
  return {unknowns.scene_scale, Matrix3<double>::Identity(), {0, 0, unknowns.scene_height}};
}

/// p = s x + h: camera coordinates, which scale along, are s (R x + t) = R (p − h) + s t.
Rigid<double> camera_in_world(const ClipUnknowns& unknowns, const Rigid<double>& camera_from_scene) {
  const Vector3<double> rise(0, 0, unknowns.scene_height);
  return {camera_from_scene.rotation,
          unknowns.scene_scale * camera_from_scene.translation - camera_from_scene.rotation * rise};
}

/// How far the pelvis, joint 0, moves in the rest pose.
Vector3<double> rise_of_pelvis(const ClipUnknowns& unknowns, const Clip& clip) {
  HSI4D_CHECK(clip.directions.has_value(), "an avatar without a shape cannot follow betas");
  Vector3<double> rise = Vector3<double>::Zero();
  for (std::size_t b = 0; b < unknowns.betas.size(); ++b) {
    for (std::size_t i = 0; i < 3; ++i)
      rise[static_cast<Index>(i)] += clip.directions->joints[i * unknowns.betas.size() + b] * unknowns.betas[b];
  }
  return rise;
}

bool moves_scene(const ClipUnknowns& unknowns) { return unknowns.scene_scale != 1 || unknowns.scene_height != 0; }

/// Calls see(name, factor, value): a factor of what the file says, and the value that is told.
template <class F>
void for_factors(const ClipUnknowns& unknowns, const Clip& clip, const F& see) {
  if (unknowns.focal_length != 1) see("focal_length_px", unknowns.focal_length, clip.camera.fx);
  if (unknowns.scene_scale != 1) see("scene_scale", unknowns.scene_scale, unknowns.scene_scale);
  for (std::size_t o = 0; o < unknowns.object_scales.size(); ++o) {
    const double scale = unknowns.object_scales[o];
    if (scale != 1) see("object_scale_" + clip.objects[o].name, scale, scale);
  }
}

}  // namespace

ClipUnknowns compose(const ClipUnknowns& first, const ClipUnknowns& second) {
  return {first.focal_length * second.focal_length, first.scene_scale * second.scene_scale,
          second.scene_scale * first.scene_height + second.scene_height,
          products(first.object_scales, second.object_scales), sums(first.betas, second.betas)};
}

void apply_unknowns(const ClipUnknowns& unknowns, Clip& clip) {
  clip.camera.fx *= unknowns.focal_length;
  clip.camera.fy *= unknowns.focal_length;
  if (moves_scene(unknowns)) {
    clip.scene = transformed(clip.scene, world_from_scene(unknowns));
    for (std::size_t i = 0; i < clip.scene.means.size(); ++i)  // graphs want means in the world
      clip.scene.means[i] += static_cast<float>(clip.scene.origin_world[static_cast<Index>(i % 3)]);
    clip.scene.origin_world.setZero();
    clip.camera.camera_from_world = camera_in_world(unknowns, clip.camera.camera_from_world);
  }
  apply_unknowns(unknowns, clip, clip.first);
  for (std::size_t o = 0; o < unknowns.object_scales.size(); ++o) {
    if (unknowns.object_scales[o] != 1)
      clip.objects[o].gaussians = transformed(clip.objects[o].gaussians, {.scale = unknowns.object_scales[o]});
  }
  if (unknowns.betas.empty()) return;
  add_betas(*clip.directions, unknowns.betas, clip.avatar);
  if (!clip.betas.empty()) clip.betas = sums(clip.betas, unknowns.betas);
  const Vector3<double> rise = rise_of_pelvis(unknowns, clip);
  for (BodyPose& pose : clip.estimate) pose.transl -= rise;
  if (!clip.truth) return;
  for (SceneState& state : *clip.truth) state.body.transl -= rise;
}

void apply_unknowns(const ClipUnknowns& unknowns, const Clip& clip, SceneState& state) {
  state.camera_from_world = camera_in_world(unknowns, state.camera_from_world);
  if (!unknowns.betas.empty()) state.body.transl -= rise_of_pelvis(unknowns, clip);
}

std::vector<std::pair<std::string, double>> unknowns_by_name(const ClipUnknowns& unknowns, const Clip& clip) {
  std::vector<std::pair<std::string, double>> values;
  for_factors(unknowns, clip, [&](const std::string& name, double, double value) { values.emplace_back(name, value); });
  if (unknowns.scene_height != 0) values.emplace_back("scene_height_m", unknowns.scene_height);
  for (std::size_t b = 0; b < unknowns.betas.size(); ++b)
    values.emplace_back("beta_" + std::to_string(b), unknowns.betas[b]);
  return values;
}

std::string unknowns_text(const ClipUnknowns& unknowns, const Clip& clip) {
  std::vector<std::string> parts;
  for (const auto& [name, value] : unknowns_by_name(unknowns, clip)) parts.push_back(name + " " + rounded(value, 5));
  return joined(parts);
}

std::vector<std::string> doubtful_unknowns(const ClipUnknowns& unknowns, const Clip& clip) {
  std::vector<std::string> names;
  for_factors(unknowns, clip, [&](const std::string& name, double factor, double) {
    if (!(std::abs(std::log(factor)) <= std::log(kLargestUnknownFactor)))
      names.push_back(name + ", " + rounded(factor, 3) + " times what was given");
  });
  return names;
}

}  // namespace hsi4d
