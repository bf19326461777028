// Points in the image against where something found them: what terms over points share.
#pragma once

#include <array>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "core/config.h"
#include "optim/losses/robust.h"

namespace hsi4d {

inline constexpr std::array<ConfigChoice<RobustKernel>, 3> kPointKernels = {
    {{RobustKernel::kGemanMcClure, "geman_mcclure"},
     {RobustKernel::kHuber, "huber"},
     {RobustKernel::kNone, "squared"}}};

/// As of `center`: an error of 5 px is worth 0.025, as much as a photometric difference of 6 grey levels.
inline constexpr double kPointWeight = 1e-3;

/// (1/K) Σ c ρ(|p − q|²), 0 for what is not before the camera, or has a confidence c below `least`.
/// @param points   [K,2] x px, y px; zeros where a point is not before the camera
/// @param targets  [K,3] x px, y px, c
/// Adjoint: both.
template <class S>
Var<S> mean_robust_distance(Var<S> points, Var<S> targets, RobustKernel kernel, float scale, float least) {
  const auto column = [](Var<S> x, Index c) { return slice_cols(x, c, 1); };
  const Var<S> total = sum_over(
      {column(points, 0), column(points, 1), column(targets, 0), column(targets, 1), column(targets, 2)},
      [kernel, scale, least](auto x, auto y, auto target_x, auto target_y, auto confidence) {
        const auto squared = square(x - target_x) + square(y - target_y);
        const auto zero = confidence * 0.0F;
        const bool is_before = value_of(x) != 0.0F || value_of(y) != 0.0F;  // the camera
        return select(is_before && value_of(confidence) >= least, confidence * robust(squared, kernel, scale), zero);
      });
  return total * (1 / static_cast<double>(points.shape().rows));
}

}  // namespace hsi4d
