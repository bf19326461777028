// Gaussians given in the image, composited on a tape: for rows about compositing alone.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "core/random.h"
#include "splat/render/composite.h"
#include "splat/render/splat_records.h"
#include "stress/front_view.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

/// Settings under which nothing is cut.
inline RenderSettings uncut_settings() {
  RenderSettings settings;
  apply_quality(settings, Quality::kReference);
  return settings;
}

/// Gaussians in the image, see SplatSet. All numbers are floats, so that every precision starts from equal ones.
struct FlatSplats {
  Index channels = 1;
  std::vector<double> means, factors, depths, opacities, features;

  Index count() const { return static_cast<Index>(depths.size()); }
  std::array<double, 6> factor(Index n) const {
    std::array<double, 6> v;
    std::copy_n(factors.begin() + 6 * n, 6, v.begin());
    return v;
  }
  void add(double x, double y, double depth, const std::vector<double>& factor, double opacity,
           const std::vector<double>& feature) {
    put(means, {x, y});
    put(factors, factor);
    put(depths, {depth});
    put(opacities, {opacity});
    put(features, feature);
    channels = static_cast<Index>(feature.size());
  }
  /// A round Gaussian of radius `sigma`, without the blur.
  void add(double x, double y, double depth, double sigma, double opacity, const std::vector<double>& feature) {
    add(x, y, depth, {sigma, 0, 0, 0, sigma, 0}, opacity, feature);
  }
  /// These rows, in this order.
  FlatSplats picked(std::span<const Index> rows) const {
    FlatSplats result;
    result.channels = channels;
    const auto take = [&rows](const std::vector<double>& from, Index size, std::vector<double>& to) {
      for (const Index n : rows) to.insert(to.end(), from.begin() + n * size, from.begin() + (n + 1) * size);
    };
    take(means, 2, result.means);
    take(factors, 6, result.factors);
    take(depths, 1, result.depths);
    take(opacities, 1, result.opacities);
    take(features, channels, result.features);
    return result;
  }

 private:
  static void put(std::vector<double>& to, const std::vector<double>& numbers) {
    for (const double x : numbers) to.push_back(static_cast<double>(static_cast<float>(x)));
  }
};

/// Gaussians of any shape all over an image, at depths 1 to 5.
inline FlatSplats random_splats(Index n, int width, int height, Index channels, std::uint64_t seed) {
  RandomSequence random(seed, 1);
  FlatSplats splats;
  for (Index i = 0; i < n; ++i) {
    std::vector<double> feature(static_cast<std::size_t>(channels)), factor(6);
    for (double& x : feature) x = random.uniform(0, 1);
    for (double& x : factor) x = random.uniform(-3, 3);
    const double x = random.uniform(0, width), y = random.uniform(0, height), depth = random.uniform(1, 5);
    splats.add(x, y, depth, factor, random.uniform(0.1, 0.95), feature);
  }
  return splats;
}

/// Their image by the program.
template <class S>
struct FlatRender {
  Tape<S> tape;
  Var<S> means, factors, depths, opacities, features, background;
  Projected<S> projected;
  Composited<S> out;

  /// @param behind  the background; empty: none
  FlatRender(const FlatSplats& splats, const SplatView& view, const std::vector<double>& behind = {}) {
    const Index n = splats.count();
    means = leaf(tape, "means", shape_of(n, 2), splats.means);
    factors = leaf(tape, "factors", shape_of(n, 6), splats.factors);
    depths = leaf(tape, "depths", shape_of(n, 1), splats.depths);
    opacities = leaf(tape, "opacities", shape_of(n, 1), splats.opacities);
    features = leaf(tape, "features", shape_of(n, splats.channels), splats.features);
    projected = {means, factors, depths, tape.constant("rest", shape_of(n, 1)),
                 tape.constant("means rest", shape_of(n, 2))};
    if (!behind.empty()) background = leaf(tape, "background", shape_of(1, static_cast<Index>(behind.size())), behind);
    out = composite(SplatSet<S>{projected, opacities, features}, view, background);
    tape.forward(out.channels);
  }
  /// From ones in every channel.
  void backward() { backward(std::vector<S>(static_cast<std::size_t>(out.channels.shape().count()), S(1))); }
  void backward(const std::vector<S>& cotangent) { tape.backward(out.channels, cotangent); }
  std::vector<double> value(Var<S> of) const { return numbers_of<S>(tape.value(of)); }
  std::vector<double> d(Var<S> of) const { return numbers_of<S>(tape.gradient(of)); }
  std::vector<double> image() const { return value(out.channels); }
  detail::SplatArrays<S> arrays() const {
    return {tape.value(means),
            tape.value(factors),
            tape.value(depths),
            tape.value(projected.depth_low),
            tape.value(projected.means_low),
            tape.value(opacities),
            tape.value(features)};
  }
};

}  // namespace hsi4d::stress
