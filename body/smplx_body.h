// The whole SMPL-X body on the tape: from its parameters to joints and vertices, as the public implementation has it.
//
//   x̄ = template + shape β + expression ψ            blend_shapes       once while β and ψ stay
//   r = joints of x̄                                   blend_shapes
//   R = rotations of the pose parameters              rotations
//   x = x̄ + Σ_j P_j vec(R_j − I)                      pose_correctives   what moves last is added last
//   A, p = chain of R about r                         kinematic_chain
//   y = Σ_j w_j A_j (x, 1) + t,   joints = p + t      skin_points        the translation last
//
// [Pavlakos et al. 2019, SMPL-X, section 3]. Nothing runs that a loss does not need: vertices only where one looks at
// them, joints without the surface.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "autodiff/tape.h"
#include "body/blend_shapes.h"
#include "body/kinematics.h"
#include "body/smplx_file.h"

namespace hsi4d {

/// How a body is prepared.
struct SmplxBodyOptions {
  bool correctives = true;              ///< false: none, even if the model has them
  double packing = kCorrectivePacking;  ///< of all correctives together; see PoseDirections
  bool flat_hand_mean = false;          ///< true: hands are flat, not in the file's mean pose, where parameters are 0
};

/// The parts of the pose that have correctives, each a node of the tape: what stays is not computed again.
enum class SmplxPart { kLeftHand, kRightHand, kFace, kBody };
inline constexpr std::size_t kSmplxParts = 4;

/// A body model prepared for the tape in precision S. Immutable; copies share the tables.
template <class S>
class SmplxBody {
 public:
  /// Throws InternalError when sizes do not fit.
  explicit SmplxBody(const SmplxModel& model, const SmplxBodyOptions& options = {});

  struct Tables {
    std::vector<int> parents;
    std::vector<double> vertices, joints;  // template
    Directions<S> shape, expression, joint_shape, joint_expression;
    std::array<PoseDirections<S>, kSmplxParts> correctives;  // none or all
    std::unique_ptr<SkinWeights<S>> weights;
    std::array<std::vector<S>, 2> hand_means;       // [45]; zeros where flat_hand_mean
    std::array<std::vector<S>, 2> hand_components;  // [n,45]
    Index betas = 0, expressions = 0;
  };
  const Tables& tables() const { return *tables_; }

  Index vertex_count() const { return static_cast<Index>(tables_->vertices.size()) / 3; }
  Index joint_count() const { return static_cast<Index>(tables_->parents.size()); }
  Index betas() const { return tables_->betas; }
  Index expressions() const { return tables_->expressions; }

 private:
  std::shared_ptr<const Tables> tables_;
};

/// The parameters of a body on a tape; an empty Var is zero (no rotation).
///
/// Rotations [n,3] are axis-angle vectors in radians, [n,6] pairs of columns (rotations_from_6d), [n,9] matrices by
/// rows, relative to the parent. A hand [15,3] adds to the hand's mean pose, axis-angle to axis-angle; a hand [1,n], n
/// coefficients of the file's first n components (PCA), too. A hand [15,6] or [15,9] is its whole rotation, without the
/// mean.
template <class S>
struct SmplxParameters {
  Var<S> betas;          ///< [1,B]
  Var<S> expression;     ///< [1,E]
  Var<S> global_orient;  ///< [1,3], [1,6] or [1,9]; turns the body about its pelvis
  Var<S> body_pose;      ///< [21,3], [21,6] or [21,9]
  Var<S> jaw_pose;       ///< [1,3], [1,6] or [1,9], as the eyes
  Var<S> leye_pose, reye_pose;
  Var<S> left_hand_pose;  ///< [15,3], [15,6], [15,9] or [1,n]
  Var<S> right_hand_pose;
  Var<S> transl;  ///< [1,3] metres
};

/// What a body is in a pose; each Var is computed only when a result depends on it.
template <class S>
struct PosedSmplx {
  Var<S> rest_vertices;  ///< [V,3] metres, shaped, before correctives
  Var<S> rest_joints;    ///< [J,3] metres
  Var<S> rotations;      ///< [J,9] relative to the parent
  Var<S> transforms;     ///< [J,12] posed_from_rest with the translation, for Gaussians on the body
  Var<S> joints;         ///< [J,3] metres, world
  Var<S> vertices;       ///< [V,3] metres, world
};

/// Records the body in a pose.
///
/// Adjoint: every parameter. Parts of the pose that are frozen, or were not written, cost nothing: their correctives
/// are computed once. Throws InternalError when a parameter has another shape than above, or is not on `tape`.
template <class S>
PosedSmplx<S> pose_smplx(Tape<S>& tape, const SmplxBody<S>& body, const SmplxParameters<S>& parameters,
                         Source where = Source::current());

/// 15 joints of a hand by its first n components and its mean: m + Σ_k c_k C_k.
///
/// @param coefficients  [1,n] or [15,3]
/// @param side          0 left, 1 right
/// @return              [15,3] axis-angle, radians
/// Adjoint: coefficients. Throws InternalError when the shape is another, or n more than the file has.
template <class S>
Var<S> hand_pose(const SmplxBody<S>& body, Var<S> coefficients, int side, Source where = Source::current());

}  // namespace hsi4d
