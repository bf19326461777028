// A clip of a few Gaussians, made in memory: a wall and a floor, one object, a body.
#pragma once

#include <algorithm>
#include <cmath>

#include "body/procedural_body.h"
#include "core/random.h"
#include "pipelines/input/clip.h"

namespace hsi4d::test {

/// Gaussians of random shape around `center_world`, within `spread` of it to each side, SH of degree 1.
inline Gaussians random_gaussians(Index count, const Vector3<double>& center_world, double spread, double log_scale,
                                  std::uint64_t seed) {
  Gaussians g;
  g.sh_degree = 1;
  RandomSequence random(seed);
  for (Index i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c)
      g.means.push_back(static_cast<float>(center_world[c] + random.uniform(-spread, spread)));
    for (int c = 0; c < 4; ++c) g.quats.push_back(static_cast<float>(random.normal()));
    for (int c = 0; c < 3; ++c) g.log_scales.push_back(static_cast<float>(log_scale + random.uniform(-0.7, 0.7)));
    g.opacity_logits.push_back(static_cast<float>(random.uniform(-1, 2)));
    for (int k = 0; k < 12; ++k) g.sh.push_back(static_cast<float>((k < 3 ? 1.0 : 0.15) * random.uniform(-0.5, 1.2)));
  }
  return g;
}

/// A pose with every joint bent a little.
inline BodyPose bent_pose(std::uint64_t seed) {
  BodyPose pose = rest_pose(kSmplxJoints);
  RandomSequence random(seed);
  for (double& x : pose.axis_angle) x = random.uniform(-0.2, 0.2);
  pose.set_rotation(0, Vector3<double>(1.5, 0.1, 0.05));  // upright: the body's y to the world's z
  pose.transl = {0.1, 0.2, 1.1};
  return pose;
}

/// The clip: a camera at (0.2, -3, 1.2) that looks at a body at the origin, `gaussians` Gaussians on it.
inline Clip small_clip(int width, int height, Index gaussians, Index of_scene = 30) {
  Clip clip;
  clip.scene = random_gaussians(of_scene, {0, 1, 0.9}, 1.2, -1.2, 11);
  clip.objects.push_back({"box", random_gaussians(8, {0, 0, 0}, 0.12, -2.2, 12)});
  clip.objects.push_back({"ball", random_gaussians(6, {0, 0, 0}, 0.1, -2.0, 13)});
  AvatarSettings avatar;
  avatar.gaussians = gaussians;
  clip.avatar = surface_avatar(procedural_body(), avatar);
  clip.camera = {
      width, height, 1.1 * width, 1.12 * width, 0.52 * width, 0.47 * height, look_at({0.2, -3, 1.2}, {0, 0, 0.9})};
  clip.first.camera_from_world = clip.camera.camera_from_world;
  clip.first.objects = {{{0.2, -0.1, 0.3}, {0.5, -0.2, 1.0}}, {{-0.3, 0.2, 0.1}, {-0.5, -0.1, 0.8}}};
  clip.first.body = bent_pose(14);
  clip.frame_files = {"0000.png", "0001.png"};
  return clip;
}

/// The avatar with the `per_joint` Gaussians alone that each joint moves most, so that few of them show every joint;
/// larger, so that they cover as much.
inline Avatar avatar_of_every_joint(const Avatar& dense, Index per_joint) {
  std::vector<Index> kept;
  for (Index joint = 0; joint < dense.joint_count(); ++joint) {
    std::vector<std::pair<double, Index>> moved;  // minus by how much, which
    for (std::size_t at = 0; at < dense.weights.weights.size(); ++at) {
      if (dense.weights.indices[at] != joint || dense.weights.weights[at] == 0) continue;
      moved.emplace_back(-dense.weights.weights[at], static_cast<Index>(at) / dense.weights.per_vertex);
    }
    std::sort(moved.begin(), moved.end());
    moved.resize(std::min(moved.size(), static_cast<std::size_t>(per_joint)));
    for (const auto& [amount, gaussian] : moved) kept.push_back(gaussian);
  }
  std::sort(kept.begin(), kept.end());
  kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
  Avatar few = dense;
  const auto take = [&kept](auto& numbers, Index width) {
    auto taken = numbers;
    taken.clear();
    for (const Index i : kept) {
      const auto row = numbers.begin() + static_cast<std::ptrdiff_t>(i * width);
      taken.insert(taken.end(), row, row + static_cast<std::ptrdiff_t>(width));
    }
    numbers = taken;
  };
  take(few.means, 3), take(few.quats, 4), take(few.log_scales, 3), take(few.opacity_logits, 1), take(few.colors, 3);
  take(few.weights.indices, dense.weights.per_vertex), take(few.weights.weights, dense.weights.per_vertex);
  few.weights.vertices = few.count();
  const double larger = std::sqrt(static_cast<double>(dense.count()) / static_cast<double>(few.count()));
  for (float& log_scale : few.log_scales) log_scale += static_cast<float>(std::log(larger));
  check_sizes(few);
  return few;
}

}  // namespace hsi4d::test
