// Gaussians given in the image, composited on a tape: for tests of compositing alone.
#pragma once

#include <string>
#include <vector>

#include "core/random.h"
#include "splat/render/composite.h"
#include "tests/support/taped_splats.h"

namespace hsi4d::test {

/// Nothing is cut, so that everything is smooth.
inline RenderSettings smooth_settings() {
  RenderSettings settings;
  apply_quality(settings, Quality::kReference);
  return settings;
}

inline SplatView view_of_size(int width, int height, const RenderSettings& settings) {
  SplatView view;
  view.camera = plain_camera({width, height});
  view.settings = settings;
  return view;
}

/// Gaussians given in the image.
struct FlatSplats {
  std::vector<double> means, factors, depths, opacities, features;
  Index channels = 1;

  Index count() const { return static_cast<Index>(depths.size()); }
  /// A round Gaussian of radius `sigma` (without the blur).
  void add(double x, double y, double depth, double sigma, double opacity, const std::vector<double>& feature) {
    means.insert(means.end(), {x, y});
    factors.insert(factors.end(), {sigma, 0, 0, 0, sigma, 0});
    depths.push_back(depth);
    opacities.push_back(opacity);
    features.insert(features.end(), feature.begin(), feature.end());
    channels = static_cast<Index>(feature.size());
  }
};

template <class S>
struct Flat {
  Tape<S> tape;
  Var<S> means, factors, depths, opacities, features;
  Projected<S> projected;
  Composited<S> out;

  Flat(const FlatSplats& splats, const SplatView& view) {
    const Index n = splats.count();
    means = leaf("means", shape_of(n, 2), splats.means);
    factors = leaf("factors", shape_of(n, 6), splats.factors);
    depths = leaf("depths", shape_of(n, 1), splats.depths);
    opacities = leaf("opacities", shape_of(n, 1), splats.opacities);
    features = leaf("features", shape_of(n, splats.channels), splats.features);
    const Var<S> rest = tape.constant("rest", shape_of(n, 1)), means_low = tape.constant("rest", shape_of(n, 2));
    projected = {means, factors, depths, rest, means_low};
    out = composite(SplatSet{projected, opacities, features}, view);
    tape.forward(out.channels);
  }
  void backward(const std::vector<S>& cotangent) { tape.backward(out.channels, cotangent); }
  void backward_ones() { backward(std::vector<S>(static_cast<std::size_t>(out.channels.shape().count()), S(1))); }
  std::vector<double> value(Var<S> of) { return wide_numbers<S>(tape.value(of)); }
  std::vector<double> d(Var<S> of) { return wide_numbers<S>(tape.gradient(of)); }

 private:
  Var<S> leaf(const char* name, const Shape& shape, const std::vector<double>& numbers) {
    const Var<S> var = tape.parameter(name, shape);
    tape.set(var, std::vector<S>(numbers.begin(), numbers.end()));
    return var;
  }
};

/// Gaussians all over an image, in random order.
inline FlatSplats random_flat(Index n, int width, int height, Index channels, std::uint64_t seed) {
  RandomSequence random(seed, 1);
  FlatSplats splats;
  for (Index i = 0; i < n; ++i) {
    std::vector<double> feature;
    for (Index k = 0; k < channels; ++k) feature.push_back(static_cast<float>(random.uniform(-1, 1)));
    splats.add(static_cast<float>(random.uniform(0, width)), static_cast<float>(random.uniform(0, height)),
               static_cast<float>(random.uniform(1, 5)), 1, static_cast<float>(random.uniform(0.1, 0.95)), feature);
    for (int k = 0; k < 6; ++k) {
      splats.factors[splats.factors.size() - 6 + static_cast<std::size_t>(k)] =
          static_cast<float>(random.uniform(-3, 3));
    }
  }
  return splats;
}

}  // namespace hsi4d::test
