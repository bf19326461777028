// The similarity, or the rigid transform, that lays points on points best in least squares.
#pragma once

#include <span>

#include "core/linear.h"

namespace hsi4d {

/// y = s R (x − x̄) + ȳ.
struct Similarity {
  double scale = 1;
  Matrix3<double> rotation = Matrix3<double>::Identity();
  Vector3<double> from_mean = Vector3<double>::Zero(), to_mean = Vector3<double>::Zero();  ///< x̄, ȳ, metres

  Vector3<double> operator()(const Vector3<double>& point) const {
    return to_mean + rotation * (point - from_mean) * scale;
  }
};

/// What may change beside place and heading.
enum class FitScale { kFree, kOne };

/// The one that fits best, x̄ and ȳ the means of all points:
///
///   min over R and, where it is free, s ≥ 0 of Σ_i |s R (x_i − x̄) − (y_i − ȳ)|²      [Umeyama 1991, eqs. 40-42]
///
/// R is a rotation, never a reflection. Where the points of one side are in one place, R is no turn and a free scale 0.
///
/// @param from, to  arrays [N,3] in metres, of which those at the same place have as many points
/// @return          with a scale that is not finite where a number in them is not
/// Throws InternalError where sizes differ or there is no point.
Similarity fit_similarity(std::span<const std::span<const double>> from, std::span<const std::span<const double>> to,
                          FitScale scale);

}  // namespace hsi4d
