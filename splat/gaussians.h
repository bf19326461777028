// Gaussians as structure of arrays: what files hold and what a run starts from.
#pragma once

#include <span>
#include <vector>

#include "core/linear.h"
#include "core/types.h"

namespace hsi4d {

/// Gaussians, the numbers as files hold them: before exp, sigmoid and normalisation.
struct Gaussians {
  int sh_degree = 0;                                       ///< 0 to kHighestShDegree
  Vector3<double> origin_world = Vector3<double>::Zero();  ///< what the means are relative to, metres
  std::vector<float> means;                                ///< [N,3] metres
  std::vector<float> quats;                                ///< [N,4] wxyz, of any length
  std::vector<float> log_scales;                           ///< [N,3] log of metres
  std::vector<float> opacity_logits;                       ///< [N]
  std::vector<float> sh;                                   ///< [N,K,3] spherical harmonics, K = sh_coefficients()

  /// N.
  Index count() const { return static_cast<Index>(opacity_logits.size()); }
  /// K = (sh_degree + 1)².
  int sh_coefficients() const { return (sh_degree + 1) * (sh_degree + 1); }
};

/// Throws InternalError unless the degree is 0 to kHighestShDegree and every array has the length that count() and the
/// degree ask for.
void check_sizes(const Gaussians& gaussians);

/// All rows of `parts`, one part after the other. Harmonics are padded with zeros to the highest degree.
///
/// Throws InternalError when the parts' origins differ, or as check_sizes. No parts give no Gaussians.
Gaussians concatenated(std::span<const Gaussians* const> parts);

/// The rows of `gaussians` that are named, in this order. Throws InternalError as check_sizes, or for a row that is not
/// there.
Gaussians selected(const Gaussians& gaussians, std::span<const Index> rows);

/// The same Gaussians with harmonics of another degree, 0 to kHighestShDegree: those above it left out, or zeros added.
/// Throws InternalError as check_sizes, or for another degree.
Gaussians with_sh_degree(const Gaussians& gaussians, int degree);

}  // namespace hsi4d
