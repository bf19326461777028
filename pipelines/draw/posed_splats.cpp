#include "pipelines/draw/posed_splats.h"

#include <array>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "body/canonical_directions.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/sh.h"

namespace hsi4d {

namespace {

template <class S>
Var<S> net_colors(const HumanColors<S>& colors, Var<S> own, Var<S> rotations, const SkinWeights<S>& weights,
                  Var<S> joint_transforms, Var<S> means) {
  Var<S> directions;
  if (colors.camera_center.tape != nullptr) {
    // skin_frames keeps these in registers. To blend them once, into memory for all three, takes as long at best.
    const Var<S> blended = blend_transforms(weights, joint_transforms);
    directions = canonical_directions(blended, means, colors.camera_center);
  }
  return color_net(colors.net, own, pose_code(rotations, colors.code_joints), directions);
}

template <class S, class Member>
Var<S> stacked(const std::vector<SplatInputs<S>>& parts, Member member) {
  if (parts.size() == 1) return parts.front().*member;
  std::vector<Var<S>> rows;
  for (const SplatInputs<S>& part : parts) rows.push_back(part.*member);
  return concat_rows<S>(rows);
}

/// A rigid object is a body of one joint: points and axes are moved in one operator, in vectors.
template <class S>
SkinWeights<S> weights_of_one_joint(Index rows) {
  const auto count = static_cast<std::size_t>(rows);
  return SkinWeights<S>(SparseWeights{rows, 1, 1, std::vector<std::int32_t>(count, 0), std::vector<double>(count, 1)});
}

}  // namespace

template <class S>
Var<S> rigid_rows(Var<S> rotation, Var<S> translation) {
  std::array<Var<S>, 6> parts;
  for (Index r = 0; r < 3; ++r) {
    parts[static_cast<std::size_t>(2 * r)] = slice_cols(rotation, 3 * r, 3);
    parts[static_cast<std::size_t>(2 * r + 1)] = slice_cols(translation, r, 1);
  }
  return concat_cols<S>(parts);
}

template <class S>
SplatInputs<S> standing_splats(const GaussianVars<S>& scene, Var<S> xi, const SplatView& view) {
  return {scene.means, gaussian_axes(scene.quats, scene.log_scales), gaussian_opacities(scene.opacity_logits),
          sh_colors(scene.colors, scene.means, xi, view)};
}

template <class S>
SplatInputs<S> rigid_splats(const GaussianVars<S>& object, Var<S> rotation, Var<S> transl, Var<S> xi,
                            const SplatView& view) {
  const Var<S> transform = rigid_rows(rotation, transl);
  return moved_splats(object, transform, transform, xi, view);
}

template <class S>
SplatInputs<S> moved_splats(const GaussianVars<S>& object, Var<S> transform, Var<S> turn, Var<S> xi,
                            const SplatView& view) {
  const Index rows = object.means.shape().rows;
  const SkinnedFrames<S> posed = skin_frames(weights_of_one_joint<S>(rows), transform, object.means,
                                             gaussian_axes(object.quats, object.log_scales));
  return {posed.points, posed.frames, gaussian_opacities(object.opacity_logits),
          sh_colors(object.colors, posed.points, xi, view, turn)};
}

template <class S>
SplatInputs<S> skinned_splats(const GaussianVars<S>& human, Var<S> rotations, const PosedSkeleton<S>& skeleton,
                              const Avatar& avatar, const HumanColors<S>* colors) {
  const SkinWeights<S> weights(avatar.weights);
  const SkinnedFrames<S> posed =
      skin_frames(weights, skeleton.transforms, human.means, gaussian_axes(human.quats, human.log_scales));
  return {posed.points, posed.frames, gaussian_opacities(human.opacity_logits),
          colors == nullptr ? human.colors
                            : net_colors(*colors, human.colors, rotations, weights, skeleton.transforms, posed.points)};
}

template <class S>
SplatInputs<S> skinned_splats(const GaussianVars<S>& human, Var<S> rotations, Var<S> transl, const Avatar& avatar,
                              const HumanColors<S>* colors) {
  return skinned_splats(human, rotations, kinematic_chain(rotations, transl, avatar.parents, avatar.joints), avatar,
                        colors);
}

template <class S>
SplatInputs<S> stacked_splats(const std::vector<SplatInputs<S>>& parts) {
  return {stacked(parts, &SplatInputs<S>::means), stacked(parts, &SplatInputs<S>::axes),
          stacked(parts, &SplatInputs<S>::opacities), stacked(parts, &SplatInputs<S>::colors)};
}

#define HSI4D_INSTANTIATE(S)                                                                                     \
  template SplatInputs<S> standing_splats(const GaussianVars<S>&, Var<S>, const SplatView&);                     \
  template SplatInputs<S> rigid_splats(const GaussianVars<S>&, Var<S>, Var<S>, Var<S>, const SplatView&);        \
  template SplatInputs<S> moved_splats(const GaussianVars<S>&, Var<S>, Var<S>, Var<S>, const SplatView&);        \
  template Var<S> rigid_rows(Var<S>, Var<S>);                                                                    \
  template SplatInputs<S> skinned_splats(const GaussianVars<S>&, Var<S>, const PosedSkeleton<S>&, const Avatar&, \
                                         const HumanColors<S>*);                                                 \
  template SplatInputs<S> skinned_splats(const GaussianVars<S>&, Var<S>, Var<S>, const Avatar&,                  \
                                         const HumanColors<S>*);                                                 \
  template SplatInputs<S> stacked_splats(const std::vector<SplatInputs<S>>&);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
