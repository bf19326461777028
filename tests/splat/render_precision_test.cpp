// Float against double, and any number of threads, through the whole renderer.
#include <algorithm>
#include <cstdio>

#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "tests/support/operator_check.h"
#include "tests/support/real_splats.h"
#include "tests/support/taped_splats.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Above this difference a pixel of float and double is taken for one where a cut or stop fell differently.
constexpr double kFlip = 4e-6;

double mean_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
  return sum / static_cast<double>(a.size());
}

/// Returns the largest error of a class.
double check_gradients(const TapedSplats<float>& fast, const TapedSplats<double>& exact, double tolerance) {
  double worst = 0;
  for (const NamedNumbers& error : gradient_errors(fast.gradients(), exact.gradients())) {
    INFO("gradient of " << error.name);
    CHECK(error.numbers[0] <= tolerance);
    worst = std::max(worst, error.numbers[0]);
  }
  return worst;
}

/// Counts of pixels, all and those that flip, and the largest errors.
struct FlipCount {
  Index pixels = 0, flips = 0;
  double mean_image = 0, gradients = 0, gradients_elsewhere = 0;
};

void check_float(SplatScene scene, FlipCount& count) {
  scene.settings.depth_key = DepthKey::kFloat;
  SplatCotangent cotangent = cotangent_of(scene.camera);
  TapedSplats<double> exact(scene, cotangent);
  TapedSplats<float> fast(scene, cotangent);
  exact.run();
  fast.run();
  const auto image = fast.value(fast.rendered.image), expected = exact.value(exact.rendered.image);
  const double mean_image = mean_difference(image, expected);
  CHECK(mean_image <= 2e-6);
  count.mean_image = std::max(count.mean_image, mean_image);
  count.gradients = std::max(count.gradients, check_gradients(fast, exact, 3e-4));

  const std::size_t pixels = cotangent.transmittance.size();
  const auto t = fast.value(fast.rendered.transmittance), expected_t = exact.value(exact.rendered.transmittance);
  for (std::size_t p = 0; p < pixels; ++p) {
    double difference = std::abs(t[p] - expected_t[p]);
    for (std::size_t c = 0; c < 3; ++c) {
      difference = std::max(difference, std::abs(image[c * pixels + p] - expected[c * pixels + p]));
    }
    ++count.pixels;
    if (difference <= kFlip) continue;
    ++count.flips;
    cotangent.transmittance[p] = 0;
    for (std::size_t c = 0; c < 3; ++c) cotangent.image[c * pixels + p] = 0;
  }
  TapedSplats<double> exact_there(scene, cotangent);
  TapedSplats<float> fast_there(scene, cotangent);
  exact_there.run();
  fast_there.run();
  INFO("away from pixels that flip a cut");
  count.gradients_elsewhere = std::max(count.gradients_elsewhere, check_gradients(fast_there, exact_there, 1e-5));
}

std::vector<SplatScene> larger_scenes() {
  const SceneSize size{96, 64};
  return {
      random_splats(300, 21, size),   saturated(21, size),       behind_and_beside(21, size), near_plane(21, size),
      raw_quaternions(100, 21, size), off_centre(100, 21, size), depth_ties(21, size),        stack(40, 0.3, 21, size)};
}

}  // namespace

TEST_CASE("float agrees with double at the same depth keys") {
  FlipCount count;
  for (const SplatScene& scene : larger_scenes()) {
    for (const SettingsVariant& variant : settings_variants()) {
      INFO(scene.name << ", " << variant.name);
      SplatScene changed = scene;
      variant.apply(changed.settings);
      check_float(changed, count);
    }
  }
  for (const RealView& view : real_views()) {
    SplatScene scene;
    if (!real_scene(view, scene)) {
      WARN("skipped: no " << view.file);
      continue;
    }
    for (const SettingsVariant& variant : settings_variants()) {
      INFO(view.file << ", " << variant.name);
      SplatScene changed = scene;
      variant.apply(changed.settings);
      check_float(changed, count);
    }
  }
  std::printf("float against double: %ld of %ld pixels flip a cut\n", static_cast<long>(count.flips),
              static_cast<long>(count.pixels));
  std::printf("  largest: mean image error %.2g, gradients %.2g, away from flips %.2g\n", count.mean_image,
              count.gradients, count.gradients_elsewhere);
  CHECK(static_cast<double>(count.flips) <= 1e-3 * static_cast<double>(count.pixels));
}

TEST_CASE("the renderer gives the same bits on any number of threads", "[parallel]") {
  RenderRequest request;
  request.depth = true;
  request.groups = {{0, 100}, {50, 300}};
  SplatScene scene = random_splats(300, 31, {97, 65});
  for (const SettingsVariant& variant : settings_variants()) {
    INFO(variant.name);
    SplatScene changed = scene;
    variant.apply(changed.settings);
    const SplatCotangent cotangent = cotangent_of(changed.camera, 2, true);
    const auto check = [&]<class S>(S) {
      TapedSplats<S> taped(changed, cotangent, request);
      std::vector<std::vector<double>> first;
      for (const int threads : {1, 2, 3, 8}) {
        with_threads(threads, [&] {
          taped.tape.write(taped.means);
          taped.tape.write(taped.quats);
          taped.run();
        });
        std::vector<std::vector<double>> all = {
            taped.value(taped.loss), taped.value(taped.rendered.image), taped.value(taped.rendered.transmittance),
            taped.value(taped.rendered.depth), taped.value(taped.rendered.group_opacity)};
        for (const NamedNumbers& g : taped.gradients()) all.push_back(g.numbers);
        if (threads == 1) first = all;
        CHECK(all == first);
      }
    };
    check(float());
    check(double());
  }
}
