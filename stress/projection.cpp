// Rows A: projection, covariance.
#include <array>

#include "stress/projection_rows.h"

namespace hsi4d {

std::span<const StressCase> projection_cases() {
  using namespace stress;
  static constexpr std::array kCases = {
      StressCase{"A1", "det and exponent of needles cancel", "minors of V; the exponent as a sum of squares", needles},
      StressCase{"A2", "the gradient of a held x/z is that of a free one", "the adjoint branches as the forward",
                 held_ratios},
      StressCase{"A3", "what lies beside the view opens into it like a fan", "x/z held, each side at its own limit",
                 beside_the_view},
      StressCase{"A4", "z -> 0: the Jacobian overflows; one Gaussian paints all", "near, double, finite or not drawn",
                 near_and_far},
      StressCase{"A5", "exp of a log-scale overflows", "log-scales held within 20, without a gradient there",
                 wild_log_scales},
      StressCase{"A6", "NaN, infinite and huge floats become ints", "held within the image before the cast",
                 wild_places},
      StressCase{"A7", "factor of antialias: root of a cancelled determinant", "minors; gradients by logarithms, gated",
                 antialias_factor},
      StressCase{"A8", "an absolute epsilon depends on the unit of length", "no epsilon", units_of_length},
      StressCase{"A9", "the blur makes small Gaussians fat and opaque", "opacity compensated (antialias)",
                 small_gaussians},
      StressCase{"A10", "far from the origin R p + t cancels", "means relative to an origin in double; R (p - c)",
                 far_from_the_origin},
      StressCase{"A11", "order by distance instead of z: another picture", "z, as in the brute-force renderer",
                 turning_camera},
      StressCase{"A12", "edge-on flat Gaussians: a ray's hit divides by n.r", "projection with a filter, no rays",
                 edge_on},
      StressCase{"A13", "a quaternion that is not of unit length scales", "normalised where it is used, with adjoint",
                 lengths_of_quaternions},
  };
  return kCases;
}

}  // namespace hsi4d
