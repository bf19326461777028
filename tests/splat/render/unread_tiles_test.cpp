// Tiles that no loss reads are not composited.
#include <catch2/catch.hpp>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/weighted_image.h"
#include "tests/support/flat_splats.h"

namespace unread_tiles_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr int kWidth = 100, kHeight = 60;
constexpr Index kSquares = 7 * 4;

/// A weighted difference of an image, and what it depends on.
template <class S>
struct WeightedRender {
  FlatRender<S> flat;
  Var<S> target, weight, loss;

  WeightedRender(const FlatSplats& splats, const SplatView& view, bool skips) : flat(splats, view) {
    Tape<S>& tape = flat.tape;
    tape.set_skips({.unread_pixels = skips});
    target = tape.constant("target", flat.out.channels.shape());
    weight = tape.constant("weight", flat.out.transmittance.shape());
    tape.set(target, std::vector<S>(static_cast<std::size_t>(target.shape().count()), S(0.3)));
    loss = l2(flat.out.channels, target, weight);
  }
  /// Pixels of columns from `left` on count.
  void weigh(Index left) {
    const Array<S> w = flat.tape.write(weight);
    for (Index r = 0; r < kHeight; ++r) {
      for (Index c = 0; c < kWidth; ++c) w(0, r, c) = c < left ? S(0) : S(0.5);
    }
  }
  /// The loss and all gradients, where everything has been moved by `dx` pixels.
  std::vector<double> moved(FlatSplats splats, double dx) {
    for (std::size_t i = 0; i < splats.means.size(); i += 2) splats.means[i] += dx;
    flat.tape.set(flat.means, std::vector<S>(splats.means.begin(), splats.means.end()));
    flat.tape.forward(loss);
    flat.tape.backward(loss);
    std::vector<double> all = flat.value(loss);
    for (const Var<S>& var : {flat.means, flat.factors, flat.opacities, flat.features}) {
      const std::vector<double> d = flat.d(var);
      all.insert(all.end(), d.begin(), d.end());
    }
    return all;
  }
};

/// How a difference is weighed.
struct Weighing {
  const char* name;
  bool of_image;  ///< the image is multiplied, not its difference
  bool computed;  ///< by the square of a leaf, not by the leaf
};
constexpr Weighing kWeighings[] = {{"difference", false, false},
                                   {"difference, computed", false, true},
                                   {"image", true, false},
                                   {"image, computed", true, true}};

/// Gaussians in the left half of an image over a background, and a weighted difference from a target: of everything
/// that skips or of nothing.
template <class S>
struct OverBackground {
  FlatRender<S> flat;
  Weighing weighing;
  Var<S> target, weight, loss;  ///< the weight is the square of a leaf where it is computed

  OverBackground(Weighing weighs, int tile, bool skips)
      : flat(random_flat(90, kWidth / 2, kHeight, 3, 22), view_of(tile, skips), {0.2, -0.7, 1.5}), weighing(weighs) {
    Tape<S>& tape = flat.tape;
    tape.set_skips({skips, skips, skips});
    target = tape.constant("target", flat.out.channels.shape());
    tape.set(target, std::vector<S>(static_cast<std::size_t>(target.shape().count()), S(0.3)));
    weight = tape.parameter("weight", flat.out.transmittance.shape());
    const Var<S> by = weighs.computed ? square(weight) : weight;
    loss = weighs.of_image ? l2(weighted_image(flat.out.channels, by), target) : l2(flat.out.channels, target, by);
  }
  static SplatView view_of(int tile, bool skips) {
    RenderSettings settings;
    settings.tile = tile;
    SplatView view = front_view(kWidth, kHeight, settings);
    view.skip = {skips, skips, skips, skips, skips};
    return view;
  }
  /// Pixels of columns [left, right) count, a little more from row to row.
  void weigh(Index left, Index right) {
    const Array<S> w = flat.tape.write(weight);
    for (Index r = 0; r < kHeight; ++r) {
      for (Index c = 0; c < kWidth; ++c)
        w(0, r, c) = c < left || c >= right ? S(0) : static_cast<S>(0.5 + 0.01 * static_cast<double>(r));
    }
  }
  void move(double dx) {
    std::vector<double> means = flat.value(flat.means);
    for (std::size_t i = 0; i < means.size(); i += 2) means[i] += dx;
    stress::set_numbers(flat.tape, flat.means, means);
  }
  /// The loss, and the gradients of all leaves that have one.
  std::vector<std::vector<double>> run() {
    flat.tape.forward(loss);
    flat.tape.backward(loss);
    std::vector<std::vector<double>> all = {flat.value(loss)};
    for (const Var<S>& var : {flat.means, flat.factors, flat.opacities, flat.features, flat.background, weight})
      all.push_back(flat.tape.has_gradient(var) ? flat.d(var) : std::vector<double>());
    return all;
  }
  /// The gradients of background and weight by their formulas, from images of which all was made.
  std::pair<std::vector<double>, std::vector<double>> plain_gradients() const {
    const std::vector<double> image = flat.value(flat.out.channels), t = flat.value(flat.out.transmittance);
    const std::vector<double> w = flat.value(weight);
    std::vector<double> d_background(3, 0.0), d_weight(t.size(), 0.0);
    for (std::size_t i = 0; i < image.size(); ++i) {
      const std::size_t p = i % t.size();
      const double each = 1 / static_cast<double>(image.size()), target_x = S(0.3);
      const double by = weighing.computed ? w[p] * w[p] : w[p], d_by = weighing.computed ? 2 * w[p] : 1;
      const double d = weighing.of_image ? by * image[i] - target_x : image[i] - target_x;
      d_background[i / t.size()] += 2 * each * d * by * t[p];
      d_weight[p] += each * d_by * (weighing.of_image ? 2 * d * image[i] : d * d);
    }
    return {d_background, d_weight};
  }
};

constexpr std::size_t kOfBackground = 5, kOfWeight = 6;  // in OverBackground::run

}  // namespace

TEMPLATE_TEST_CASE("a background and a learned weight have their gradients from every pixel, read or not", "", float,
                   double) {
  using S = TestType;
  const double rounding = 100 * static_cast<double>(std::numeric_limits<S>::epsilon());
  for (const Weighing& weighing : kWeighings) {
    for (const int tile : {8, 16}) {
      OverBackground<S> all(weighing, tile, false), some(weighing, tile, true);
      // The weights cover everything, then what is empty, what is not, both in part, one column, nothing.
      for (const auto& [left, right] :
           {std::pair{0, 100}, {70, 100}, {0, 40}, {20, 75}, {99, 100}, {50, 50}, {0, 64}}) {
        for (const auto& [behind, learned] : {std::pair{false, false}, {false, true}, {true, false}, {true, true}}) {
          INFO(weighing.name << ", tiles of " << tile << " px, columns " << left << " to " << right
                             << (behind ? ", the background's gradient" : "") << (learned ? ", the weight's" : ""));
          std::vector<std::vector<double>> expected, computed;
          for (OverBackground<S>* render : {&all, &some}) {
            Tape<S>& tape = render->flat.tape;
            render->weigh(left, right);
            render->move(0.25);
            behind ? tape.unfreeze(render->flat.background) : tape.freeze(render->flat.background);
            learned ? tape.unfreeze(render->weight) : tape.freeze(render->weight);
            (render == &all ? expected : computed) = render->run();
          }
          const bool has_the_bits = computed == expected;
          CHECK(has_the_bits);
          const auto [d_background, d_weight] = all.plain_gradients();
          if (behind) CHECK(largest_difference(computed[kOfBackground], d_background) <= rounding);
          if (learned) CHECK(relative_l2(computed[kOfWeight], d_weight) <= rounding);
        }
      }
    }
  }
}

TEMPLATE_TEST_CASE("tiles that the loss has no weight for are not composited and nothing else changes", "", float,
                   double) {
  const FlatSplats splats = random_flat(600, kWidth, kHeight, 3, 21);
  for (const int tile : {8, 16}) {
    RenderSettings settings;
    settings.tile = tile;
    const SplatView view = front_view(kWidth, kHeight, settings);
    WeightedRender<TestType> all(splats, view, false), some(splats, view, true);
    const RenderCounters &of_all = *all.flat.out.counters, &of_some = *some.flat.out.counters;
    // Columns of squares that count in part: 3, then 6, then 1, then all 7.
    for (const auto& [left, columns] : {std::pair{70, 3}, {20, 6}, {99, 1}, {0, 7}, {64, 3}}) {
      INFO("tiles of " << tile << " px, columns from " << left);
      for (WeightedRender<TestType>* render : {&all, &some}) render->weigh(left);
      for (const double dx : {0.0, 0.25, 0.5}) CHECK(some.moved(splats, dx) == all.moved(splats, dx));
      CHECK(of_all.tiles >= kSquares);
      if (tile == 16) CHECK(of_all.tiles == kSquares);
      if (tile == 16) CHECK(of_some.tiles == 4 * columns);
      CHECK(of_some.adjoint_tiles == of_all.adjoint_tiles);
      if (columns == 7) continue;
      CHECK(of_some.tiles < of_all.tiles);
      CHECK(of_some.pairs < of_all.pairs);
      CHECK(of_some.fragments < of_all.fragments);
    }
  }
}

}  // namespace unread_tiles_test
