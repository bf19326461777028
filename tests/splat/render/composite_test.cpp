#include "splat/render/composite.h"

#include <cmath>
#include <limits>

#include "autodiff/elementwise.h"
#include "core/random.h"
#include "tests/support/flat_splats.h"
#include "tests/support/isa.h"
#include "tests/support/operator_check.h"
#include "tests/support/pixel_choices.h"

namespace composite_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Gaussians all over an image, at depths 1, 1.125, …
FlatSplats checked_splats(const SplatView& view, Index channels) {
  FlatSplats splats = random_flat(25, view.camera.width, view.camera.height, channels, 9);
  for (std::size_t i = 0; i < splats.depths.size(); ++i) splats.depths[i] = 1 + 0.125 * static_cast<double>(i * 7 % 25);
  return splats;
}

/// With Gaussians that the cap holds near the centres of some pixels, and others that stop pixels, in between.
FlatSplats with_cuts(FlatSplats splats) {
  const auto add = [&](double x, double y, double sigma, double opacity) {
    const double depth = 1.0625 + 0.25 * static_cast<double>(splats.count() - 25);
    std::vector<double> feature;
    for (Index k = 0; k < splats.channels; ++k) feature.push_back(0.25 * static_cast<double>(k) - 0.5);
    splats.add(x, y, depth, sigma, opacity, feature);
  };
  for (const double x : {5.5, 16.5, 27.5}) add(x + 0.01, 8.49, 2, 1);
  for (const double x : {8.3, 9.1, 10.2, 11.7}) add(x, 11.2, 4, 0.97);
  return splats;
}

void check_composite(const std::string& name, const FlatSplats& splats, const SplatView& view,
                     const OperatorCheck& options) {
  const Index n = splats.count();
  const auto record = [&](const auto& in) {
    auto& tape = in[0].owner();
    const auto rest = tape.constant("rest", shape_of(n, 1));
    const auto means_low = tape.constant("means rest", shape_of(n, 2));
    const auto out = composite(SplatSet{Projected{in[0], in[1], in[2], rest, means_low}, in[3], in[4]}, view);
    return out.channels + out.transmittance;  // the transmittance is added to every channel
  };
  check_operator(name,
                 {{"means", shape_of(n, 2), 0, 1, splats.means},
                  {"factors", shape_of(n, 6), 0, 1, splats.factors},
                  {"depths", shape_of(n, 1), 0, 1, splats.depths},
                  {"opacities", shape_of(n, 1), 0, 1, splats.opacities},
                  {"features", shape_of(n, splats.channels), 0, 1, splats.features}},
                 record, options);
}

/// The operator checks on an image that every cut takes part in.
void check_composite_with_cuts(const std::string& name, const SplatView& view, const OperatorCheck& options) {
  const FlatSplats splats = with_cuts(checked_splats(view, 3));
  FlatRender<double> flat(splats, view);
  const PixelChoices choices = pixel_choices(flat.tape, flat.projected, flat.opacities, view);
  CHECK(choices.fragments == flat.out.counters->fragments);
  INFO(name);
  CHECK(choices.skipped > 1000);
  CHECK(choices.capped >= 3);
  CHECK(choices.stopped >= 8);
  check_composite(name, splats, view, options);
}

}  // namespace

TEST_CASE("compositing passes the operator checks where nothing is cut [B6, B21]", "[parallel][isa]") {
  OperatorCheck options;
  options.entries = is_held_isa() ? 6 : 24;
  SplatView view = front_view(35, 20, uncut_settings());
  check_composite("composite", checked_splats(view, 3), view, options);
  view = front_view(19, 17, uncut_settings());
  view.settings.tile = 8;
  check_composite("composite, small tiles, 5 channels", checked_splats(view, 5), view, options);
  view.settings.antialias = true;
  view.settings.blur = 2;
  check_composite("composite, antialias, 1 channel", checked_splats(view, 1), view, options);
}

TEST_CASE("compositing passes the operator checks with every cut", "[release][parallel][isa]") {
  // A cut at any pixel of the image is a kink. Steps so small that they hardly ever reach one still leave differences
  // with nine digits.
  OperatorCheck options;
  options.step = 1e-5;
  options.kink_share = 0.05;
  options.float_tolerance = 3e-4;  // a pixel may be cut in one precision alone
  if (is_held_isa()) options.entries = 6;
  SplatView view = front_view(35, 20);
  check_composite_with_cuts("composite, default", view, options);
  apply_compatibility(view.settings, Compatibility::kGsplat);
  check_composite_with_cuts("composite, gsplat", view, options);
}

TEST_CASE("transmittance is kept, not recovered: stacks down to 1e-8 [B1, B2]") {
  for (const double end : {1e-2, 1e-4, 1e-6, 1e-8}) {
    for (const double stop : {1e-4, 1e-7, 0.0}) {
      const int layers = 37;  // so that no threshold is met exactly
      const double alpha = 1 - std::pow(end, 1.0 / layers);
      FlatSplats splats;
      RandomSequence random(3, 1);
      for (int i = 0; i < layers; ++i) {
        splats.add(8.5, 8.5, 1 + i, 3, static_cast<float>(alpha), {static_cast<float>(random.uniform(0, 1))});
      }
      SplatView view = front_view(17, 17, uncut_settings());
      view.settings.transmittance_stop = stop;
      FlatRender<float> fast(splats, view);
      FlatRender<double> exact(splats, view);
      const double t = exact.value(exact.out.transmittance)[8 * 17 + 8];
      INFO("T down to " << end << ", stop " << stop);
      CHECK(std::abs(fast.value(fast.out.transmittance)[8 * 17 + 8] / t - 1) < 1e-5);
      fast.backward();
      exact.backward();
      CHECK(relative_l2(fast.d(fast.opacities), exact.d(exact.opacities)) < 1e-4);
      CHECK(relative_l2(fast.d(fast.factors), exact.d(exact.factors)) < 1e-4);
    }
  }
}

TEST_CASE("opaque Gaussians have finite and right gradients without a cap [B2]") {
  for (const double opacity : {1 - 1e-7, 1.0, 0.999, 1 / (1 + std::exp(-20.)), 1 / (1 + std::exp(-40.))}) {
    FlatSplats splats;
    RandomSequence random(4, 1);
    for (int i = 0; i < 12; ++i) {
      splats.add(8.5, 8.5, 1 + i, 2, i % 3 == 1 ? static_cast<float>(opacity) : 0.5f,
                 {static_cast<float>(random.uniform(0, 1))});
    }
    const SplatView view = front_view(17, 17, uncut_settings());
    FlatRender<float> fast(splats, view);
    FlatRender<double> exact(splats, view);
    fast.backward();
    exact.backward();
    INFO("opacity 1 - " << 1 - opacity);
    const auto computed = fast.d(fast.opacities), expected = exact.d(exact.opacities);
    const double largest = std::abs(*std::max_element(expected.begin(), expected.end(),
                                                      [](double a, double b) { return std::abs(a) < std::abs(b); }));
    CHECK(largest_difference(computed, expected) < 1e-5 * largest);
  }
}

TEMPLATE_TEST_CASE("where the cap holds alpha there is no gradient, or all of it [B3]", "[isa]", float, double) {
  using S = TestType;
  const double rounding = 8 * static_cast<double>(std::numeric_limits<S>::epsilon());
  FlatSplats splats;
  splats.add(0.5, 0.5, 1, 3, 0.9999, {1});  // the image is its centre pixel
  SplatView view = front_view(1, 1);
  FlatRender<S> held(splats, view);
  held.backward();
  CHECK(held.value(held.out.channels)[0] == view.settings.alpha_cap);
  for (const auto& d : {held.d(held.opacities), held.d(held.means), held.d(held.factors)}) {
    CHECK(std::all_of(d.begin(), d.end(), [](double x) { return x == 0; }));
  }
  CHECK(held.d(held.features)[0] == view.settings.alpha_cap);
  view.settings.cap_gradient = CapGradient::kPass;
  FlatRender<S> passed(splats, view);
  passed.backward();
  CHECK(passed.d(passed.opacities)[0] == Approx(1).epsilon(rounding));
  splats.opacities[0] = view.settings.alpha_cap * (1 - rounding);
  view.settings.cap_gradient = CapGradient::kZero;
  FlatRender<S> below(splats, view);
  below.backward();
  CHECK(below.d(below.opacities)[0] == Approx(1).epsilon(rounding));
}

TEMPLATE_TEST_CASE("an inclusive stop loses at most the threshold, an exclusive one the last Gaussian [B4]", "[isa]",
                   float, double) {
  using S = TestType;
  FlatSplats splats;
  splats.add(0.5, 0.5, 1, 3, 1 - 0.0999, {0});
  splats.add(0.5, 0.5, 2, 3, 0.9995, {1});
  splats.add(0.5, 0.5, 3, 3, 0.9, {1});
  SplatView view = front_view(1, 1);
  view.settings.alpha_cap = 0.9999;
  FlatRender<S> inclusive(splats, view);
  CHECK(std::abs(inclusive.value(inclusive.out.channels)[0] - 0.0999) < 1.1e-4);
  CHECK(inclusive.out.counters->fragments == 2);
  view.settings.stop_rule = StopRule::kExclusive;
  FlatRender<S> exclusive(splats, view);
  CHECK(exclusive.value(exclusive.out.channels)[0] == 0);
  CHECK(exclusive.out.counters->fragments == 1);
  CHECK(exclusive.value(exclusive.out.transmittance)[0] == Approx(0.0999));

  // Over random stacks. Each of 60 sums rounds.
  const double bound = kTransmittanceStop + 60 * static_cast<double>(std::numeric_limits<S>::epsilon());
  RandomSequence random(5, 1);
  for (int i = 0; i < 50; ++i) {
    FlatSplats stack;
    for (int k = 0; k < 60; ++k) stack.add(0.5, 0.5, 1 + k, 3, random.uniform(0, 1), {random.uniform(0, 1)});
    SplatView endless = front_view(1, 1);
    FlatRender<S> stopped(stack, endless);
    endless.settings.transmittance_stop = 0;
    FlatRender<S> whole(stack, endless);
    CHECK(largest_difference(stopped.value(stopped.out.channels), whole.value(whole.out.channels)) <= bound);
  }
}

TEST_CASE("whether a transmittance equal to the threshold stops is a setting") {
  FlatSplats splats;
  for (int i = 0; i < 4; ++i) splats.add(0.5, 0.5, 1 + i, 3, 0.5, {1});
  SplatView view = front_view(1, 1);
  view.settings.transmittance_stop = 0.25;  // exactly what two of them leave
  for (const bool at : {false, true}) {
    for (const bool exclusive : {false, true}) {
      view.settings.stop_when = at ? StopWhen::kAtOrBelow : StopWhen::kBelow;
      view.settings.stop_rule = exclusive ? StopRule::kExclusive : StopRule::kInclusive;
      const Index fragments = (at ? 2 : 3) - (exclusive ? 1 : 0);
      CHECK(FlatRender<double>(splats, view).out.counters->fragments == fragments);
      CHECK(FlatRender<float>(splats, view).out.counters->fragments == fragments);
    }
  }
}

TEST_CASE("shapes that do not fit are refused") {
  Tape<float> tape;
  const auto v = [&](Index rows, Index cols) { return tape.parameter("v", shape_of(rows, cols)); };
  const SplatView view = front_view(16, 16);
  const auto set = [&](Index opacities, Index features) {
    return SplatSet<float>{{v(3, 2), v(3, 6), v(3, 1), v(3, 1), v(3, 2)}, v(opacities, 1), v(3, features)};
  };
  CHECK_THROWS_AS(composite(set(2, 3), view), InternalError);
  CHECK_THROWS_AS(composite(set(3, 0), view), InternalError);
  CHECK_THROWS_AS(composite(set(3, 3), view, v(1, 4)), InternalError);
  CHECK_THROWS_AS(composite(set(3, 3), view, v(2, 3)), InternalError);
  SplatView odd = view;
  odd.settings.tile = 12;
  CHECK_THROWS_AS(composite(set(3, 3), odd), InternalError);
}

TEST_CASE("tiles without a cotangent are left out of the adjoint, which keeps its bits") {
  const FlatSplats splats = random_flat(600, 100, 60, 3, 21);
  SplatView all = front_view(100, 60, {}), some = all;
  all.skip.zero_cotangent = false;
  FlatRender<float> full(splats, all), skipped(splats, some);
  std::vector<float> cotangent(3 * 100 * 60, 0.0f);
  for (std::size_t i = 0; i < cotangent.size(); ++i) {
    if (i % 100 < 40) cotangent[i] = std::sin(static_cast<float>(i));
  }
  for (int i = 0; i < 2; ++i) {  // the second time with what is left of the first
    full.backward(cotangent);
    skipped.backward(cotangent);
    for (const auto var : {0, 1, 2, 3}) {
      const auto of = [var](FlatRender<float>& f) {
        return f.d(std::array{f.means, f.factors, f.opacities, f.features}[var]);
      };
      CHECK(of(skipped) == of(full));
    }
    CHECK(full.out.counters->adjoint_tiles == 7 * 4);
    CHECK(skipped.out.counters->adjoint_tiles == 3 * 4);
    std::fill(cotangent.begin(), cotangent.begin() + 100 * 60, 0.0f);
  }
}

}  // namespace composite_test
