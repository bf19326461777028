// Two loss terms for tests of configs, independent of those that the library has.
#pragma once

#include <vector>

#include "optim/loss_description.h"

namespace hsi4d::test {

struct PhotoSettings {
  double ssim_share = 0.1;
  bool masked = false;
};

inline void describe(ConfigFields& f, PhotoSettings& s) {
  f.number("ssim_share", s.ssim_share, {.min = 0, .max = 1}, "Share of the structural term");
  f.boolean("masked", s.masked, "Only where the mask is set");
}

/// "photo" with two settings of its own, "centre" with none.
inline std::vector<LossDescription> test_losses() {
  return {describe_loss<PhotoSettings>("photo", "Difference of images"),
          describe_loss("centre", "Distance of centres")};
}

}  // namespace hsi4d::test
