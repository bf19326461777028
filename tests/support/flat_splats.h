// Gaussians given in the image, composited on a tape: those of the stress suite, for tests of compositing alone.
#pragma once

#include "stress/flat_splats.h"
#include "tests/support/taped_splats.h"

namespace hsi4d::test {

using stress::FlatRender;
using stress::FlatSplats;
using stress::front_view;
using stress::uncut_settings;

/// Gaussians all over an image, in random order.
inline FlatSplats random_flat(Index n, int width, int height, Index channels, std::uint64_t seed) {
  RandomSequence random(seed, 1);
  FlatSplats splats;
  for (Index i = 0; i < n; ++i) {
    std::vector<double> feature, factor;
    for (Index k = 0; k < channels; ++k) feature.push_back(random.uniform(-1, 1));
    const double opacity = random.uniform(0.1, 0.95), depth = random.uniform(1, 5), y = random.uniform(0, height);
    const double x = random.uniform(0, width);
    for (int k = 0; k < 6; ++k) factor.push_back(random.uniform(-3, 3));
    splats.add(x, y, depth, factor, opacity, feature);
  }
  return splats;
}

}  // namespace hsi4d::test
