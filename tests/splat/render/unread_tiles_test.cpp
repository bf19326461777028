// Tiles that no loss reads are not composited.
#include <catch2/catch.hpp>

#include "autodiff/difference.h"
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

}  // namespace

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
