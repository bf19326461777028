// Whole composited images: nothing to draw, very much to draw, and what has to leave an image as it is.
#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "splat/reference/debug_pixel.h"
#include "splat/render/composite.h"
#include "tests/support/flat_splats.h"
#include "tests/support/measures.h"

namespace composite_image_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("nothing to draw, and images of every edge: exact zeros [B11]") {
  for (const int width : {1, 8, 15, 16, 17}) {
    for (const int height : {1, 16, 17}) {
      for (const int tile : {8, 16}) {
        SplatView view = front_view(width, height);
        view.settings.tile = tile;
        INFO(width << " x " << height << ", tiles of " << tile);
        FlatSplats none, behind, drawn;
        none.channels = 3;
        behind.add(3, 3, -1, 1, 0.9, {1, 1, 1});            // behind the camera
        behind.add(3, 3, 2, 0, 0.9, {1, 1, 1});             // six zeros
        behind.add(-1000, 3, 2, 1, 0.9, {1, 1, 1});         // beside the image
        behind.add(3, 3, 2, 1, 0.9 / 255, {1, 1, 1});       // too faint
        behind.add(std::nan(""), 3, 2, 1, 0.9, {1, 1, 1});  // broken
        behind.add(3, 3, 2, 1, 0.9, {1, std::nan(""), 1});  // broken
        for (const FlatSplats* splats : {&none, &behind}) {
          FlatRender<float> flat(*splats, view);
          flat.backward();
          for (const double x : flat.value(flat.out.channels)) CHECK(x == 0);
          for (const double t : flat.value(flat.out.transmittance)) CHECK(t == 1);
          for (const auto& d :
               {flat.d(flat.means), flat.d(flat.factors), flat.d(flat.opacities), flat.d(flat.features)}) {
            CHECK(std::all_of(d.begin(), d.end(), [](double x) { return x == 0; }));
          }
          const RenderCounters& counters = *flat.out.counters;
          CHECK((counters.visible == 0 && counters.pairs == 0 && counters.fragments == 0 && counters.tiles == 0));
        }
        drawn.add(width / 2.0, height / 2.0, 2, 30, 0.9, {1, 2, 3});
        FlatRender<double> flat(drawn, view);
        flat.backward();
        CHECK(flat.out.counters->fragments == width * height);
        CHECK(flat.d(flat.features)[0] == Approx(flat.d(flat.features)[1]));
      }
    }
  }
}

TEST_CASE(
    "a million Gaussians on one pixel keep their order and stay finite, for the cost of those that are seen [B12]") {
  const auto stack_of = [](int n) {
    FlatSplats stack;
    for (int i = 0; i < n; ++i) stack.add(8.5, 8.5, 2, 0.2, 0.3, {i < 8 ? 1.0 : 0.0, 1});
    return stack;
  };
  const FlatSplats splats = stack_of(1000000);
  SplatView view = front_view(17, 17);
  FlatRender<float> flat(splats, view);
  flat.backward();
  const auto channels = flat.value(flat.out.channels), t = flat.value(flat.out.transmittance);
  for (std::size_t p = 0; p < t.size(); ++p) {
    CHECK((t[p] >= 0 && t[p] <= 1));
    CHECK(channels[t.size() + p] + t[p] == Approx(1).margin(1e-6));
  }
  // Equal depths are composited by index: the first eight are in front.
  const double g = 0.3;
  CHECK(channels[8 * 17 + 8] == Approx(1 - std::pow(1 - g, 8)).margin(1e-6));
  const auto d = flat.d(flat.opacities);
  CHECK(std::all_of(d.begin(), d.end(), [](double x) { return std::isfinite(x); }));
  CHECK(d[0] != 0);
  CHECK(d[999999] == 0);
  CHECK(flat.out.counters->visible == 1000000);
  // The backward pass ends where the last pixel does: of 4 tiles, where 0.3 G is hardly above alpha_min.
  CHECK(flat.out.counters->pairs >= 1000000);
  CHECK(flat.out.counters->reached < 20000);
  // log(transmittance_stop)/log(1 − alpha_min) layers finish any pixel that one of them is drawn in; 5×5 pixels are.
  // What lies behind them costs nothing, however much it is.
  CHECK(flat.out.counters->fragments < 25 * 2360);
  FlatRender<float> fewer(stack_of(20000), view);
  fewer.backward();
  CHECK(fewer.out.counters->fragments == flat.out.counters->fragments);
  CHECK(fewer.out.counters->reached == flat.out.counters->reached);
  CHECK(fewer.out.counters->adjoint_tiles == flat.out.counters->adjoint_tiles);
  CHECK(fewer.out.counters->kept_bytes <= flat.out.counters->kept_bytes);
}

TEMPLATE_TEST_CASE("an opaque wall leaks what the cap lets through [B16]", "[isa]", float, double) {
  using S = TestType;
  FlatSplats splats;
  splats.add(8, 8, 1, 1e5, 1, {0});
  splats.add(8, 8, 2, 1e5, 1, {1});
  for (const double cap : {0.99, kAlphaCap}) {
    SplatView view = front_view(16, 16, uncut_settings());
    view.settings.alpha_cap = cap;
    FlatRender<S> flat(splats, view);
    const auto held = static_cast<double>(static_cast<S>(cap));
    const double leak = (1 - held) * held, rounding = static_cast<double>(std::numeric_limits<S>::epsilon());
    for (const double x : flat.value(flat.out.channels)) CHECK(x == Approx(leak).epsilon(rounding));
  }
}

TEMPLATE_TEST_CASE("a mirrored scene makes a mirrored image, and a padded image the same pixels [B20]", "[isa]", float,
                   double) {
  using S = TestType;
  const int width = 37, height = 23;
  FlatSplats splats = random_flat(40, width, height, 3, 6);
  for (double& x : splats.means)
    x = std::round(1024 * x) / 1024;  // mirrored and shifted without rounding, in float too
  FlatSplats mirrored = splats, shifted = splats;
  for (std::size_t n = 0; n < splats.depths.size(); ++n) {
    mirrored.means[2 * n] = width - splats.means[2 * n];
    for (std::size_t k = 0; k < 3; ++k) mirrored.factors[6 * n + k] *= -1;
    shifted.means[2 * n] += 32;
    shifted.means[2 * n + 1] += 16;
  }
  const SplatView view = front_view(width, height);
  FlatRender<S> plain(splats, view), mirror(mirrored, view);
  FlatRender<S> padded(shifted, front_view(width + 50, height + 40));
  const auto a = plain.tape.value(plain.out.channels), b = mirror.tape.value(mirror.out.channels);
  const auto c = padded.tape.value(padded.out.channels);
  double mirror_error = 0, padding_error = 0;
  for (Index k = 0; k < 3; ++k) {
    for (Index r = 0; r < height; ++r) {
      for (Index x = 0; x < width; ++x) {
        const auto of = static_cast<double>(a(k, r, x));
        mirror_error = larger(mirror_error, std::abs(of - static_cast<double>(b(k, r, width - 1 - x))));
        padding_error = larger(padding_error, std::abs(of - static_cast<double>(c(k, r + 16, x + 32))));
      }
    }
  }
  CHECK(mirror_error <= 8 * static_cast<double>(std::numeric_limits<S>::epsilon()));
  CHECK(padding_error == 0);  // whole tiles: the same numbers
}

TEST_CASE("the size of tiles changes nothing but rounding [B7]") {
  const FlatSplats splats = random_flat(200, 61, 45, 3, 8);
  SplatView view = front_view(61, 45);
  FlatRender<float> large(splats, view);
  view.settings.tile = 8;
  FlatRender<float> small(splats, view);
  CHECK(largest_difference(large.value(large.out.channels), small.value(small.out.channels)) <= 1e-6);
  CHECK(large.out.counters->fragments == small.out.counters->fragments);
  large.backward();
  small.backward();
  CHECK(relative_l2(small.d(small.factors), large.d(large.factors)) <= 1e-5);
}

TEMPLATE_TEST_CASE("rows in another order, equal depths in the same, make the same bits [B8]", "", float, double) {
  using S = TestType;
  const Index n = 20000;
  FlatSplats splats = random_flat(n, 64, 48, 2, 14);
  for (std::size_t i = 0; i < splats.depths.size(); ++i) splats.depths[i] = 2 + 0.5 * static_cast<double>(i * i % 4);
  // The layers are interleaved anew at random; within each the rows keep their order.
  std::vector<Index> layers[4], order;
  for (Index i = n - 1; i >= 0; --i) layers[i * i % 4].push_back(i);
  RandomSequence random(15, 1);
  while (static_cast<Index>(order.size()) < n) {
    auto& layer = layers[static_cast<std::size_t>(random.uniform(0, 4))];
    if (layer.empty()) continue;
    order.push_back(layer.back());
    layer.pop_back();
  }
  const FlatSplats shuffled = splats.picked(order);
  CHECK(shuffled.depths != splats.depths);
  const SplatView view = front_view(64, 48);
  FlatRender<S> a(splats, view), b(shuffled, view);
  const bool same_image = a.value(a.out.channels) == b.value(b.out.channels);
  CHECK(same_image);
  a.backward();
  b.backward();
  const auto expected = a.d(a.opacities), d = b.d(b.opacities);
  Index different = 0;
  for (std::size_t k = 0; k < order.size(); ++k) different += d[k] != expected[static_cast<std::size_t>(order[k])];
  CHECK(different == 0);
}

TEMPLATE_TEST_CASE("what is skipped changes a pixel by no more than its alphas' sum [B5]", "", float, double) {
  using S = TestType;
  const int width = 24, height = 16;
  FlatSplats splats = random_flat(400, width, height, 3, 16);
  for (double& x : splats.opacities) x *= 0.03;  // many layers around alpha_min
  for (double& x : splats.features) x = 0.5 + 0.5 * x;
  SplatView cut = front_view(width, height), whole = cut;
  whole.settings.alpha_min = 0;
  FlatRender<S> flat(splats, cut), exact(splats, whole);
  const auto a = flat.value(flat.out.channels), b = exact.value(exact.out.channels);
  const std::size_t pixels = a.size() / 3;
  double largest_sum = 0, largest_error = 0;
  for (std::size_t p = 0; p < pixels; ++p) {
    const PixelTrace trace = trace_pixel(exact.tape, exact.projected, exact.opacities, exact.features, whole,
                                         {static_cast<int>(p) % width, static_cast<int>(p) / width});
    double sum = 0;
    for (const PixelSplat& splat : trace.composited) sum += splat.alpha < cut.settings.alpha_min ? splat.alpha : 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double error = std::abs(a[k * pixels + p] - b[k * pixels + p]);
      CHECK(error <= sum + 2e-6);
      largest_error = larger(largest_error, error);
    }
    largest_sum = std::max(largest_sum, sum);
  }
  INFO("sum of skipped alphas up to " << largest_sum << ", error up to " << largest_error);
  CHECK(largest_sum > 0.02);
  CHECK(largest_error > 0.1 * largest_sum);  // and the bound is of the right size
}

TEST_CASE("what is kept from forward to backward is at most 12 bytes a pixel beside the outputs") {
  // With T, one of the outputs, 16. The larger Gaussians make 70 fragments in each pixel.
  const int side = 192;
  for (const double radius : {1.0, 4.0}) {
    FlatSplats splats = random_flat(8000, side, side, 3, 17);
    for (double& x : splats.factors) x *= radius / 3;
    const SplatView view = front_view(side, side);
    FlatRender<float> flat(splats, view);
    const RenderCounters& counters = *flat.out.counters;
    const double per_pixel = static_cast<double>(counters.kept_bytes) / (side * side);
    INFO("radius " << radius << ": " << per_pixel << " bytes a pixel, "
                   << static_cast<double>(counters.fragments) / (side * side) << " fragments");
    CHECK(per_pixel > 0);
    CHECK(per_pixel <= 12);
  }
}

TEMPLATE_TEST_CASE("long lists are composited over many segments as over one", "[isa]", float, double) {
  using S = TestType;
  FlatSplats splats;
  RandomSequence random(11, 1);
  for (int i = 0; i < 700; ++i) {
    const auto number = [&](double low, double high) { return static_cast<float>(random.uniform(low, high)); };
    const double x = number(0, 16), y = number(0, 16), opacity = number(0.001, 0.02);
    splats.add(x, y, 1 + i, 4, opacity, {number(0, 1)});
  }
  const SplatView view = front_view(16, 16, uncut_settings());
  FlatRender<S> flat(splats, view);
  flat.backward();
  // v_i by its definition, at every pixel, for a few Gaussians.
  const auto d = flat.d(flat.opacities);
  for (const std::size_t i : {std::size_t(0), std::size_t(63), std::size_t(64), std::size_t(500), std::size_t(699)}) {
    double expected = 0;
    for (int p = 0; p < 256; ++p) {
      double through = 1, behind = 0, before_i = 0, g_i = 0;
      std::vector<double> alphas;
      for (std::size_t k = 0; k < 700; ++k) {
        const double dx = p % 16 + 0.5 - splats.means[2 * k], dy = p / 16 + 0.5 - splats.means[2 * k + 1];
        const double g = std::exp(-0.5 * (dx * dx + dy * dy) / (16 + kBlur));
        if (k == i) before_i = through, g_i = g;
        alphas.push_back(splats.opacities[k] * g);
        through *= 1 - alphas.back();
      }
      for (std::size_t k = 699; k > i; --k) behind = alphas[k] * splats.features[k] + (1 - alphas[k]) * behind;
      expected += before_i * g_i * (splats.features[i] - behind);
    }
    CHECK(d[i] == Approx(expected).epsilon(std::is_same_v<S, float> ? 1e-5 : 1e-11));
  }
}

}  // namespace composite_image_test
