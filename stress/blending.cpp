// Rows B: alpha, blending, sorting.
#include <array>

#include "stress/blending_rows.h"

namespace hsi4d {

std::span<const StressCase> blending_cases() {
  using namespace stress;
  static constexpr std::array kCases = {
      StressCase{"B1", "T from 1 - alpha loses its digits", "T itself is kept", kept_transmittance},
      StressCase{"B2", "the backward pass divides by 1 - alpha", "no division: what is seen behind", opaque_gradients},
      StressCase{"B3", "a gradient passes where the cap holds alpha", "the gate of the forward pass", cap_gradient},
      StressCase{"B4", "the Gaussian that ends a pixel is left out", "it is added first", stop_rule},
      StressCase{"B5", "layers below 1/255 are skipped, however many", "alpha_min = 0, and the loss is told",
                 faint_layers},
      StressCase{"B6", "cuts make differences wrong", "tests cut nothing", differences_across_cuts},
      StressCase{"B7", "a square of 3 sigma cuts rims and is too large for faint ones", "the ellipse of alpha_min",
                 footprint, "", false, "5000 Gaussians, 75 x 50 px"},
      StressCase{"B8", "NaN in a sort; ties in any order", "not sorted; a stable sort", depth_sort},
      StressCase{"B9", "bits of negative depths sort backwards", "bits made monotone", depth_keys},
      StressCase{"B10", "pairs overflow 32 bits", "64 bits, refused before memory is taken", pair_counts, "", false,
                 "30 Gaussians, 240 x 240 px"},
      StressCase{"B11", "nothing to draw: outputs are not written", "every output is", nothing_to_draw, "", false,
                 "0 to 3 Gaussians, 1 x 1 to 17 x 17 px"},
      StressCase{"B12", "a million Gaussians on one pixel take hours", "a tile ends when its pixels have",
                 million_on_one_pixel, "", false, "1,000,000 Gaussians, 17 x 17 px"},
      StressCase{"B13", "forward and backward differ by a bit in alpha", "one function, no contraction",
                 recomputed_alpha},
      StressCase{"B14", "depth divides by a weight of 0", "0 there, without a gradient", normalized_depth},
      StressCase{"B15", "o (1 - o) is 0 long before the sigmoid's slope is", "e/(1 + e)^2, e = exp(-|x|)",
                 saturated_sigmoid},
      StressCase{"B16", "a cap of 0.99 leaks what is behind a wall", "a cap of 1 - 2^-12, or none", opaque_wall},
      StressCase{"B17", "a quick exponential shows as bands", "a polynomial", quick_exponential},
      StressCase{"B18", "a colour held at 0 has a gradient, or goes below", "held, and gated", held_color},
      StressCase{"B19", "a colour's direction gives the mean no gradient", "it does; none at the centre",
                 color_direction},
      StressCase{"B20", "half a pixel between conventions; borders differ", "centres at +0.5, culled by footprint",
                 pixel_centres, "", false, "40 and 120 Gaussians, 37 x 23 and 101 x 55 px"},
      StressCase{"B21", "the off-diagonal's gradient is halved twice", "the adjoint is by V", conic_gradient},
  };
  return kCases;
}

}  // namespace hsi4d
