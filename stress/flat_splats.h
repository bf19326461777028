// Gaussians given in the image, composited on a tape: for rows about compositing alone.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include "core/random.h"
#include "splat/render/composite.h"
#include "splat/render/splat_records.h"
#include "stress/measures.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

/// A leaf that holds these numbers.
template <class S>
Var<S> leaf(Tape<S>& tape, std::string_view name, const Shape& shape, const std::vector<double>& numbers) {
  const Var<S> var = tape.parameter(name, shape);
  tape.set(var, std::vector<S>(numbers.begin(), numbers.end()));
  return var;
}

inline double largest_size(const std::vector<double>& a) {
  return largest_difference(a, std::vector<double>(a.size(), 0.0));
}

/// How many numbers are not the same.
inline double changed(const std::vector<double>& a, const std::vector<double>& b) {
  double count = 0;
  for (std::size_t i = 0; i < b.size(); ++i) count += a[i] == b[i] ? 0 : 1;
  return count;
}

/// Settings under which nothing is cut.
inline RenderSettings uncut_settings() {
  RenderSettings settings;
  apply_quality(settings, Quality::kReference);
  return settings;
}

/// A camera at the origin with the world's axes, its principal point in the middle, focal length = width.
inline SplatView plain_view(int width, int height, const RenderSettings& settings) {
  SplatView view;
  view.camera.width = width;
  view.camera.height = height;
  view.camera.fx = view.camera.fy = width;
  view.camera.cx = 0.5 * width;
  view.camera.cy = 0.5 * height;
  view.settings = settings;
  return view;
}

/// Gaussians in the image, see SplatSet. All numbers are floats, so that every precision starts from equal ones.
struct FlatSplats {
  Index channels = 1;
  std::vector<double> means, factors, depths, opacities, features;

  Index count() const { return static_cast<Index>(depths.size()); }
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
  void add_round(double x, double y, double depth, double sigma, double opacity, const std::vector<double>& feature) {
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
  Var<S> means, factors, depths, opacities, features;
  Projected<S> projected;
  Composited<S> out;

  FlatRender(const FlatSplats& splats, const SplatView& view) {
    const Index n = splats.count();
    means = leaf(tape, "means", shape_of(n, 2), splats.means);
    factors = leaf(tape, "factors", shape_of(n, 6), splats.factors);
    depths = leaf(tape, "depths", shape_of(n, 1), splats.depths);
    opacities = leaf(tape, "opacities", shape_of(n, 1), splats.opacities);
    features = leaf(tape, "features", shape_of(n, splats.channels), splats.features);
    projected = {means, factors, depths, tape.constant("rest", shape_of(n, 1)),
                 tape.constant("means rest", shape_of(n, 2))};
    out = composite(SplatSet<S>{projected, opacities, features}, view);
    tape.forward(out.channels);
  }
  /// From ones in every channel.
  void backward() { backward(std::vector<double>(static_cast<std::size_t>(out.channels.shape().count()), 1)); }
  void backward(const std::vector<double>& cotangent) {
    tape.backward(out.channels, std::vector<S>(cotangent.begin(), cotangent.end()));
  }
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
