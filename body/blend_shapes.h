// A body's shape: what is added to its template before skinning.
//
//   x = x̄ + S β + E ψ                     shape and expression            [Pavlakos et al. 2019, SMPL-X, eqs. 2-3]
//   y = x + Σ_j P_j vec(R_j − I)          pose correctives, j = 1 …       [Loper et al. 2015, SMPL, eq. 9]
//
// vec is by rows, P_j the nine columns of joint j's rotation relative to its parent. The root has none: it turns the
// body as a whole.
#pragma once

#include <span>
#include <vector>

#include "autodiff/tape.h"
#include "body/directions.h"

namespace hsi4d {

/// Directions, and the coefficients by which points move along them.
template <class S>
struct BlendTerm {
  Directions<S> directions;
  Var<S> coefficients;  ///< [1,C]
};

/// x = x̄ + Σ_k P_k c_k. Computed once while no coefficient is written.
///
/// @param rest   [V,3] metres, the template
/// @param terms  at least one
/// @return       [V,3] metres
/// Adjoint: the coefficients, each computed only when wanted. The template and the directions are constants.
/// Throws InternalError when a shape does not fit the directions.
template <class S>
Var<S> blend_shapes(std::span<const double> rest, std::span<const BlendTerm<S>> terms,
                    Source where = Source::current());

/// How far packing may move a vertex along an axis (see directions.h), metres.
inline constexpr double kCorrectivePacking = 5e-6;

/// P of the pose correctives of consecutive joints, prepared. Immutable; copies share the numbers.
template <class S>
class PoseDirections {
 public:
  /// No correctives.
  PoseDirections() = default;
  /// @param values   [3V, 9(J−1)], rows are coordinates (3v + i)
  /// @param first    the first of `count` joints, at least 1
  /// @param packing  see directions.h, for any rotations; float only. 0: exact
  /// Throws InternalError when sizes do not fit or a joint is not there.
  PoseDirections(std::span<const double> values, Index vertices, Index first, Index count,
                 double packing = kCorrectivePacking);

  Index vertices() const { return directions_.vertices(); }
  Index joints() const { return directions_.columns() / 9; }
  const Directions<S>& directions() const { return directions_; }

 private:
  Directions<S> directions_;
};

/// y = x + Σ_j P_j f_j over the joints of `directions`.
///
/// @param offsets  [joints,9] f_j = vec(R_j − I), see rotation_offsets
/// @param points   [V,3] metres, rest pose
/// @return         [V,3] metres
/// Adjoint: offsets, points; each computed only when wanted. Throws InternalError when a shape does not fit.
template <class S>
Var<S> pose_correctives(const PoseDirections<S>& directions, Var<S> offsets, Var<S> points,
                        Source where = Source::current());

/// R_j − I of axis-angle vectors, with nothing subtracted: as accurate for small rotations as for large ones (row D3).
///
/// @param axis_angle  [J,3] radians
/// @return            [J,9] by rows
/// Adjoint: axis_angle, as that of rotations_from_axis_angle. Throws InternalError when the rows are not of 3.
template <class S>
Var<S> rotation_offsets_from_axis_angle(Var<S> axis_angle, Source where = Source::current());

/// R_j − I of rotation matrices.
///
/// @param rotations  [J,9] by rows
/// @return           [J,9] by rows
/// Adjoint: rotations. Throws InternalError when the rows are not of 9.
template <class S>
Var<S> rotation_offsets(Var<S> rotations, Source where = Source::current());

}  // namespace hsi4d
