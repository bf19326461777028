// Linear blend skinning.
//
//   B_v = Σ_j w_vj A_j         y_v = B_v (x_v, 1)         [Loper et al. 2015, SMPL, eq. 2]
//
// A_j [3,4] takes the rest pose of joint j to its pose. B_v is an affine map and in general no rotation: it shrinks,
// and is singular for two opposite bones. No rotation is ever extracted from it; Gaussians use its linear part as it is
// (docs/numerics/failures.md, D2), so everything here is finite and linear in A and in x.
//
// skin_points is for vertices, skin_frames for Gaussians, whose axes follow too: in both B_v never leaves the
// registers. Who needs B_v itself takes blend_transforms, and then transform_points.
#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

/// Most weights a vertex may have in sparse form; four is the fast case.
inline constexpr Index kMaxWeightsPerVertex = 8;

/// Weights below this are dropped, and the rest normalised: at most a micrometre on a body of one metre.
inline constexpr double kTinyWeight = 1e-6;

/// How far from 1 the weights of a vertex may sum up in a file.
inline constexpr double kWeightSumTolerance = 1e-2;

/// How far from 1 they may sum up by the rounding of floats, which is left as it is.
inline constexpr double kWeightRounding = 1e-6;

/// K = per_vertex weights for each of V vertices; a joint may repeat, unused places have weight 0 and any valid joint.
struct SparseWeights {
  Index vertices = 0, joints = 0, per_vertex = 0;
  std::vector<std::int32_t> indices;  ///< [V,K], joints
  std::vector<double> weights;        ///< [V,K]
};

/// A weight for every vertex and joint.
struct DenseWeights {
  Index vertices = 0, joints = 0;
  std::vector<double> weights;  ///< [V,J]
};

/// The weights of a file, made to sum to 1: tiny ones dropped, the rest divided by their sum, in double.
///
/// @param source  the file and key, for messages
/// Throws DataError naming the vertex when a weight is not finite or negative, a joint is out of range, or a sum is
/// further than kWeightSumTolerance from 1; InternalError when the arrays do not have V·K, V·J numbers or K is not 1
/// to 8.
SparseWeights normalized_weights(SparseWeights raw, std::string_view source);
DenseWeights normalized_weights(DenseWeights raw, std::string_view source);

/// Divides the weights of those vertices by their sum, as normalized_weights does, whose sum is farther than
/// kWeightRounding from 1; all others stay bit for bit what a file says, down to the smallest. Returns how many.
///
/// Throws DataError naming the vertex as normalized_weights does.
Index repair_weights(DenseWeights& weights, std::string_view source);

/// The same weights with as few places a vertex as hold all that are not zero; nothing when that is more than
/// kMaxWeightsPerVertex.
std::optional<SparseWeights> sparse_weights(const DenseWeights& dense);

/// The `per_vertex` largest weights of each vertex (ties: the lower joint), normalised. SMPL-X has few that are not
/// zero.
///
/// Throws DataError naming the vertex as normalized_weights does, of which the dropped weights count towards the sum.
SparseWeights largest_weights(const DenseWeights& dense, Index per_vertex, std::string_view source);

namespace detail {
template <class S>
struct SkinTables;
}

/// Weights prepared for the kernels in precision S: rounded to S, and transposed once. Immutable; copies share the
/// tables.
template <class S>
class SkinWeights {
 public:
  /// Takes normalised weights. Throws InternalError when those of a vertex do not sum to 1 within kWeightRounding.
  explicit SkinWeights(const SparseWeights& weights);
  explicit SkinWeights(const DenseWeights& weights);

  Index vertices() const;
  Index joints() const;
  const detail::SkinTables<S>& tables() const { return *tables_; }

 private:
  std::shared_ptr<const detail::SkinTables<S>> tables_;
};

/// y_v = Σ_j w_vj A_j (x_v, 1), not taped.
///
/// @param transforms  [J,3,4] posed_from_rest, rotation part and metres
/// @param points      [V,3] metres, rest pose
/// @param result      [V,3] metres, posed; must not overlap the inputs
template <class S>
void skin_points(const SkinWeights<S>& weights, const S* transforms, const S* points, S* result);

/// y_v = Σ_j w_vj A_j (x_v, 1)                                                                   [SMPL, eq. 2]
///
/// @param transforms  [J,12], rows [3,4] of posed_from_rest, rotation part and metres
/// @param points      [V,3] metres, rest pose
/// @return            [V,3] metres, posed
/// Adjoint: transforms, points; each computed only when wanted. The weights are constants.
/// Throws InternalError when a shape differs from the weights'.
template <class S>
Var<S> skin_points(const SkinWeights<S>& weights, Var<S> transforms, Var<S> points, Source where = Source::current());

/// y_v = Σ_j w_vj A_j (x_v, 1) + t: the translation last, whatever the weights sum to by their rounding.
///
/// @param transl  [1,3] metres
/// Adjoint: transforms, points, transl; each computed only when wanted.
template <class S>
Var<S> skin_points(const SkinWeights<S>& weights, Var<S> transforms, Var<S> points, Var<S> transl,
                   Source where = Source::current());

/// B_v = Σ_j w_vj A_j, the blended transform of each vertex; its linear part is in general no rotation.
///
/// @param transforms  [J,12], rows [3,4] of posed_from_rest
/// @return            [V,12], rows [3,4] of posed_from_rest
/// Adjoint: transforms. The weights are constants.
/// Throws InternalError when the shape differs from the weights'.
template <class S>
Var<S> blend_transforms(const SkinWeights<S>& weights, Var<S> transforms, Source where = Source::current());

/// Points and the frames that they carry (the axes of Gaussians), under their blended transforms B_v = Σ_j w_vj A_j.
template <class S>
struct SkinnedFrames {
  Var<S> points;  ///< [V,3] metres, y_v = B_v (x_v, 1)
  Var<S> frames;  ///< [V,9] rows of F'_v = B_v(:,0:3) F_v
};

/// As transform_points and the product with the linear part, of blend_transforms, without B_v in memory: of 50,000
/// Gaussians less than half the time.
///
/// @param transforms  [J,12], rows [3,4] of posed_from_rest
/// @param points      [V,3] metres
/// @param frames      [V,9] rows of 3×3 matrices, whose columns are turned and stretched
/// Adjoint: transforms, points, frames; each computed only when wanted. The weights are constants.
/// Throws InternalError when a shape differs from the weights', or these are dense.
template <class S>
SkinnedFrames<S> skin_frames(const SkinWeights<S>& weights, Var<S> transforms, Var<S> points, Var<S> frames,
                             Source where = Source::current());

/// y_v = B_v (x_v, 1), a transform of its own for each point.
///
/// @param transforms  [V,12], rows [3,4]
/// @param points      [V,3] metres
/// @return            [V,3] metres
/// Adjoint: transforms, points; each computed only when wanted.
/// Throws InternalError when the two V differ.
template <class S>
Var<S> transform_points(Var<S> transforms, Var<S> points, Source where = Source::current());

}  // namespace hsi4d
