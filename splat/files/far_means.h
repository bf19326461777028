// Means so far from the origin that floats cannot tell apart what lies within one Gaussian.
#pragma once

#include <string>

#include "splat/gaussians.h"

namespace hsi4d {

/// Gaussians that are narrower than the step from one number to the next where their mean lies, if it is 10 µm or more.
struct FarMeans {
  Index count = 0;
  double largest_step = 0;                                 ///< of these, metres
  Vector3<double> middle_world = Vector3<double>::Zero();  ///< of the box of all means, metres, rounded to whole ones
};

/// Those among Gaussians whose means, `origin` added, are held as floats. How wide a Gaussian is its second longest
/// axis says: along the shortest one most are flat.
FarMeans far_means(const Gaussians& gaussians, const Vector3<double>& origin);

/// The same of numbers that all have one step, metres.
FarMeans means_narrower_than(double step, const Gaussians& gaussians);

/// "3 of 40 Gaussians are narrower than ..., up to 0.5 m", with what helps; nothing for none.
/// @param is_finer  the file has the means in more digits than a float's
std::string far_means_text(const FarMeans& far, Index all, bool is_finer);

}  // namespace hsi4d
