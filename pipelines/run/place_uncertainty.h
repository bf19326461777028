// How sure the places of joints and objects are at the end of a stage of a frame.
//
// The stage's estimate x is that of a likelihood, whose information matrix is the curvature at x
// (autodiff/curvature.h):
//
//   H = Σ_pixels a aᵀ / v + f H_priors,   a = ∂pixel/∂x,   cov x = H⁻¹,   cov y = J H⁻¹ Jᵀ,   J = ∂joints, objects/∂x
//
// - v, of colours and of silhouettes, is the variance of a residual times the number of pixels that err together, both
//   from the frame's residuals r: v = Σ_squares (Σ_{p in square} r_p)² / N over squares of kSquares to the foreground's
//   side. Residuals that have nothing to do with their neighbours leave v = σ², those that are alike in a square make
//   it σ² times its pixels.
// - Terms that read no pixel are priors. f is how much more a loss of pixels weighs in the likelihood than in the
// stage's
//   sum. With a mean of |r| over n numbers, of weight w: f = n σ² / (v b w), b the mean |r| of the foreground; with a
//   mean of r²: f = n / (2 v w).
// - A rotation of six numbers has three directions: numbers that the columns lose as they become a rotation count for
//   nothing.
// - What is held is known: the camera, the color net, the light on objects, all frames before, and in a later pass
// those after.
#pragma once

#include <vector>

#include "core/image.h"
#include "optim/loss_term.h"
#include "optim/parameters.h"
#include "pipelines/input/state.h"
#include "pipelines/run/reconstruct_stage.h"

namespace hsi4d {

/// By how much errors are larger than the curvature says, measured on clips: docs/numerics/accuracy.md.
inline constexpr double kSigmaFactor = 2.5;

/// At the parameters that are on the tape. It is as it was afterwards.
///
/// @param task              the stage
/// @param available, inputs what the stage was recorded with
/// @param objects           [1,3] where each object's centroid is
/// @param foreground        [1,H,W] of the frame's masks
/// @param camera_from_world rotation of the frame's camera
template <class S>
PlaceSigmas place_sigmas(Tape<S>& tape, const StageTask& task, const std::vector<ParameterGroup<S>>& available,
                         const LossInputs<S>& inputs, const std::vector<Var<S>>& objects, const Image& foreground,
                         const Matrix3<double>& camera_from_world);

extern template PlaceSigmas place_sigmas(Tape<float>&, const StageTask&, const std::vector<ParameterGroup<float>>&,
                                         const LossInputs<float>&, const std::vector<Var<float>>&, const Image&,
                                         const Matrix3<double>&);
extern template PlaceSigmas place_sigmas(Tape<double>&, const StageTask&, const std::vector<ParameterGroup<double>>&,
                                         const LossInputs<double>&, const std::vector<Var<double>>&, const Image&,
                                         const Matrix3<double>&);

}  // namespace hsi4d
