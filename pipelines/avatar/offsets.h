// Offsets of an avatar's Gaussians along the surface's normal: clothes and hair that stand out from the body, or a
// body that is another. A smooth field, of few numbers: a silhouette tells of a part of the surface at a time, and
// neighbours go along.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "autodiff/tape.h"
#include "body/avatar.h"

namespace hsi4d {

/// Numbers of a field, at most; on a body they are about 6 cm apart.
inline constexpr Index kOffsetControls = 500;

/// Where the numbers of a field are, and what each Gaussian takes of them.
struct OffsetField {
  static constexpr std::size_t kNear = 4;

  std::vector<float> normals;                                 ///< [N,3] of length 1, outwards
  Index controls = 0;                                         ///< K
  std::array<std::vector<std::uint32_t>, kNear> controls_of;  ///< [N] of each Gaussian, the nearest first
  std::array<std::vector<float>, kNear> shares;               ///< [N] of these; a Gaussian's sum to 1
};

/// The outward normals of an avatar's Gaussians in the rest pose: the axis of the smallest scale, away from the nearest
/// place on a bone.
/// @return  [N,3]
std::vector<float> outward_normals(const Avatar& avatar);

/// A field on an avatar: its numbers are at Gaussians that are as far from each other as can be [farthest point
/// sampling: Gonzalez 1985], and a Gaussian takes of the four nearest in the rest pose (1 − d/r)², r the distance of
/// the fifth. A function of the arguments alone. Throws InternalError for an avatar without Gaussians.
/// @param controls  at most the Gaussians
OffsetField offset_field(const Avatar& avatar, Index controls = kOffsetControls);

/// Means that are moved: μ + n Σ_k w_k d_k.
/// @param means    [N,3] metres, rest pose
/// @param offsets  [K,1] metres
/// Adjoint: both.
template <class S>
Var<S> offset_means(const OffsetField& field, Var<S> means, Var<S> offsets);

extern template Var<float> offset_means(const OffsetField&, Var<float>, Var<float>);
extern template Var<double> offset_means(const OffsetField&, Var<double>, Var<double>);

}  // namespace hsi4d
