#include "pipelines/posed_avatar.h"

#include <algorithm>

#include "core/check.h"
#include "splat/sh.h"

namespace hsi4d {

Gaussians rest_gaussians(const Avatar& avatar) {
  check_sizes(avatar);
  Gaussians g;
  g.means = avatar.means;
  g.quats = avatar.quats;
  g.log_scales = avatar.log_scales;
  g.opacity_logits = avatar.opacity_logits;
  g.sh.resize(avatar.colors.size());
  std::transform(avatar.colors.begin(), avatar.colors.end(), g.sh.begin(),
                 [](float color) { return static_cast<float>((static_cast<double>(color) - 0.5) / kShC0); });
  return g;
}

PosedGaussians posed_avatar(const Avatar& avatar, const BodyPose& pose) {
  PosedGaussians posed{rest_gaussians(avatar), {}};
  const PosedJoints skeleton = pose_skeleton(avatar, pose);
  const SparseWeights& weights = avatar.weights;
  posed.transforms.assign(12 * static_cast<std::size_t>(avatar.count()), 0.0);
  for (Index i = 0; i < weights.vertices * weights.per_vertex; ++i) {
    const double* joint = skeleton.transforms.data() + 12 * Index{weights.indices[static_cast<std::size_t>(i)]};
    double* blended = posed.transforms.data() + 12 * (i / weights.per_vertex);
    for (int e = 0; e < 12; ++e) blended[e] += weights.weights[static_cast<std::size_t>(i)] * joint[e];
  }
  return posed;
}

PosedGaussians concatenated(std::span<const PosedGaussians> parts) {
  std::vector<const Gaussians*> gaussians;
  bool moved = false;
  for (const PosedGaussians& part : parts) {
    gaussians.push_back(&part.gaussians);
    moved = moved || !part.transforms.empty();
  }
  PosedGaussians all{concatenated(gaussians), {}};
  if (!moved) return all;
  constexpr std::array<double, 12> kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  for (const PosedGaussians& part : parts) {
    all.transforms.insert(all.transforms.end(), part.transforms.begin(), part.transforms.end());
    if (!part.transforms.empty()) continue;
    for (Index n = 0; n < part.gaussians.count(); ++n)
      all.transforms.insert(all.transforms.end(), kIdentity.begin(), kIdentity.end());
  }
  return all;
}

}  // namespace hsi4d
