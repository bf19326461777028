// What made a pixel: the sums are the image's, the choices the compositor's.
#include "splat/reference/debug_pixel.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "tests/support/flat_splats.h"

namespace debug_pixel_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Every pixel of a render: T is bitwise the image's, Σ w c + T background and Σ w z / Σ w are within `bound`. Returns
/// the fragments.
template <class S>
Index check_all_pixels(const TapedSplats<S>& taped, double bound) {
  const Camera& camera = taped.view.camera;
  const ConstArray<S> image = taped.tape.value(taped.rendered.image), background = taped.tape.value(taped.background);
  const ConstArray<S> through = taped.tape.value(taped.rendered.transmittance);
  const ConstArray<S> depth = taped.tape.value(taped.rendered.depth);
  const Var<S> colors = taped.colors;
  Index fragments = 0, wrong_sums = 0, wrong_rest = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const PixelTrace trace =
          trace_pixel(taped.tape, taped.rendered.projected, taped.opacities, colors, taped.view, {x, y});
      for (Index c = 0; c < 3; ++c) {
        const double sum =
            trace.color()[static_cast<std::size_t>(c)] + trace.transmittance * static_cast<double>(background.data[c]);
        wrong_sums += std::abs(sum - static_cast<double>(image(c, y, x))) <= bound ? 0 : 1;
      }
      const double weight = trace.weight_sum();
      if (weight > 1e-3) {
        const double far = std::abs(trace.depth_sum / weight / static_cast<double>(depth(y, x)) - 1);
        wrong_sums += far <= 2 * bound ? 0 : 1;
      }
      wrong_rest += trace.transmittance == static_cast<double>(through(y, x)) ? 0 : 1;
      for (const PixelSplat& splat : trace.composited)
        fragments += splat.alpha >= static_cast<double>(std::numeric_limits<S>::min()) ? 1 : 0;
    }
  }
  CHECK(wrong_sums == 0);
  CHECK(wrong_rest == 0);
  return fragments;
}

template <class S>
void check_scene(const SplatScene& scene, double bound) {
  RenderRequest request;
  request.depth = true;
  TapedSplats<S> taped(scene, cotangent_of(scene.camera, 0, true), request);
  taped.tape.forward(taped.loss);
  CHECK(check_all_pixels(taped, bound) == taped.rendered.counters->fragments);
}

}  // namespace

TEST_CASE("a pixel's Gaussians sum to the image, with its T and fragments: all settings") {
  const SceneSize size{24, 20};
  for (const SplatScene& base : {random_splats(60, 5, size), saturated(5, size), stack(60, 0.2, 5, size)}) {
    for (const SettingsVariant& variant : settings_variants()) {
      INFO(base.name << ", " << variant.name);
      SplatScene scene = base;
      variant.apply(scene.settings);
      check_scene<float>(scene, 2e-6);
      check_scene<double>(scene, 1e-14);
    }
  }
}

TEST_CASE("a pixel's Gaussians in float with more features than blocks take") {
  const FlatSplats splats = random_flat(50, 20, 20, 20, 3);
  const SplatView view = front_view(20, 20);
  FlatRender<float> flat(splats, view);
  const std::vector<double> channels = flat.value(flat.out.channels);
  Index fragments = 0;
  for (int p = 0; p < 400; ++p) {
    const PixelTrace trace =
        trace_pixel(flat.tape, flat.projected, flat.opacities, flat.features, view, {p % 20, p / 20});
    for (std::size_t c = 0; c < 3; ++c)
      CHECK(trace.color()[c] == Approx(channels[400 * c + static_cast<std::size_t>(p)]).margin(1e-6));
    fragments += static_cast<Index>(trace.composited.size());
  }
  CHECK(fragments == flat.out.counters->fragments);
}

TEST_CASE("what a pixel's trace says of each Gaussian") {
  // At the centre of pixel (1, 2): G = 1, so that α before the cap is o.
  SplatView view = front_view(4, 4);
  view.settings.alpha_cap = 0.75;
  view.settings.transmittance_stop = 0.15;
  FlatSplats splats;
  splats.add(1.5, 2.5, 5, 1, 0.5, {1, 1, 1});     // 0: behind the stop
  splats.add(1.5, 2.5, 2, 1, 0.875, {0, 1, 0});   // 1: capped
  splats.add(1.5, 2.5, 1, 1, 0.25, {1, 0, 0.5});  // 2: the first
  splats.add(4.5, 2.5, 1.5, 1, 0.1, {1, 1, 1});   // 3: the nearest miss
  splats.add(4.5, 2.5, 1.2, 1, 0.01, {1, 1, 1});  // 4: another miss
  splats.add(1.5, 2.5, 3, 1, 0.5, {0, 0, 1});     // 5: takes T from 0.1875 to 0.09375
  const auto check = [&]<class S>(S) {
    FlatRender<S> flat(splats, view);
    const PixelTrace trace = trace_pixel(flat.tape, flat.projected, flat.opacities, flat.features, view, {1, 2});
    const bool exclusive = view.settings.stop_rule == StopRule::kExclusive;
    REQUIRE(trace.composited.size() == (exclusive ? 2U : 3U));
    const PixelSplat &first = trace.composited[0], &second = trace.composited[1];
    CHECK((first.index == 2 && second.index == 1));
    CHECK(first.depth == 1);
    CHECK_FALSE(first.capped);
    CHECK(first.full == first.alpha);
    CHECK(first.alpha == Approx(0.25).epsilon(1e-6));
    CHECK(first.so_far[2] == Approx(0.125).epsilon(1e-6));
    CHECK(second.capped);
    CHECK(second.full == Approx(0.875).epsilon(1e-6));
    CHECK(second.alpha == 0.75);
    CHECK(second.transmittance == Approx(0.75).epsilon(1e-6));
    CHECK(second.weight() == Approx(0.5625).epsilon(1e-6));
    CHECK(second.so_far[1] == Approx(0.5625).epsilon(1e-6));
    CHECK(trace.skipped == 2);
    REQUIRE(trace.nearest_miss);
    CHECK(trace.nearest_miss->index == 3);
    CHECK(trace.nearest_miss->full == Approx(0.1 * std::exp(-0.5 * 9 / (1 + kBlur))).epsilon(1e-5));
    CHECK(trace.stopped);
    CHECK(trace.behind_stop == 1);
    CHECK(trace.refused.has_value() == exclusive);
    if (exclusive) CHECK(trace.refused->index == 5);
    CHECK(trace.transmittance == Approx(exclusive ? 0.1875 : 0.09375).epsilon(1e-6));
  };
  for (const StopRule rule : {StopRule::kInclusive, StopRule::kExclusive}) {
    view.settings.stop_rule = rule;
    check(float());
    check(double());
  }
  view.settings.transmittance_stop = 0;
  FlatRender<double> flat(splats, view);
  const PixelTrace trace = trace_pixel(flat.tape, flat.projected, flat.opacities, flat.features, view, {1, 2});
  CHECK(trace.composited.size() == 4);
  CHECK_FALSE(trace.stopped);
  CHECK(trace.behind_stop == 0);
  for (const PixelPlace outside : {PixelPlace{4, 0}, PixelPlace{0, 4}, PixelPlace{-1, 0}, PixelPlace{0, -1}})
    CHECK_THROWS_AS(trace_pixel(flat.tape, flat.projected, flat.opacities, flat.features, view, outside),
                    InternalError);
}

}  // namespace debug_pixel_test
