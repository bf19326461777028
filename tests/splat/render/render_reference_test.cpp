// The taped renderer in double against the brute-force one, which shares no code with it.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <catch2/catch.hpp>

#include "tests/support/failed_images.h"
#include "tests/support/real_splats.h"
#include "tests/support/taped_splats.h"

namespace render_reference_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// The largest errors seen since the last report.
struct WorstErrors {
  double image = 0, gradient = 0, row = 0;

  void report(const char* what) {
    std::printf("double against brute force, %s: image %.2g, gradients %.2g, worst row %.2g\n", what, image, gradient,
                row);
    *this = {};
  }
} worst_errors;

/// @tparam T  of the brute-force renderer
template <class T = double>
void check_against_reference(const SplatScene& scene, double gradient_tolerance, const RenderRequest& request = {},
                             const std::vector<float>& moved_by = {}) {
  SplatCotangent cotangent = cotangent_of(scene.camera, static_cast<Index>(request.groups.size()), request.depth);
  const ReferenceResult expected = reference_result<T>(scene, cotangent, request, moved_by);
  const auto opaque_enough = [&](std::size_t p) { return 1 - expected.transmittance[p] >= kOpaqueEnough; };
  for (std::size_t p = 0; p < cotangent.depth.size(); ++p) cotangent.depth[p] *= opaque_enough(p) ? 1 : 0;
  TapedSplats<double> taped(scene, cotangent, request, moved_by);
  taped.run_after_another();
  const int height = scene.camera.height, width = scene.camera.width;
  const auto check_plane = [&](const char* what, const std::vector<double>& computed,
                               const std::vector<double>& wanted) {
    return check_image(scene.name + " " + what, computed, wanted, height, width, 1e-10);
  };
  const double image_error = check_plane("image", taped.value(taped.rendered.image), expected.image);
  worst_errors.image = std::max(worst_errors.image, image_error);
  check_plane("transmittance", taped.value(taped.rendered.transmittance), expected.transmittance);
  if (request.depth) {
    std::vector<double> depth = taped.value(taped.rendered.depth);
    for (std::size_t p = 0; p < depth.size(); ++p) {
      if (!opaque_enough(p)) depth[p] = expected.depth[p];
    }
    check_plane("depth", depth, expected.depth);
  }
  if (!request.groups.empty()) {
    const std::vector<double> groups = taped.value(taped.rendered.group_opacity);
    const std::size_t pixels = expected.transmittance.size();
    REQUIRE(groups.size() == expected.groups.size());
    for (std::size_t first = 0; first < groups.size(); first += pixels) {
      const auto plane = [&](const std::vector<double>& all) {
        const auto begin = all.begin() + static_cast<std::ptrdiff_t>(first);
        return std::vector<double>(begin, begin + static_cast<std::ptrdiff_t>(pixels));
      };
      check_plane("group", plane(groups), plane(expected.groups));
    }
  }
  const std::vector<NamedNumbers> gradients = taped.gradients();
  REQUIRE(gradients.size() == expected.gradients.size());
  for (const NamedNumbers& g : expected.gradients) {
    if (scene.count() == 0 || g.name != "means") continue;  // that something is compared
    CHECK(std::any_of(g.numbers.begin(), g.numbers.end(), [](double x) { return x != 0; }));
  }
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    CHECK(gradients[i].name == expected.gradients[i].name);
  }
  for (const ClassError& error : gradient_errors(gradients, expected.gradients)) {
    INFO("gradient of " << error.name);
    CHECK(error.all <= gradient_tolerance);
    CHECK(error.worst_row <= 10 * gradient_tolerance);
    worst_errors.gradient = larger(worst_errors.gradient, error.all);
    worst_errors.row = larger(worst_errors.row, error.worst_row);
  }
}

}  // namespace

TEST_CASE("double agrees with the brute-force renderer: every kind of scene and of settings") {
  for (const SettingsVariant& variant : settings_variants()) {
    for (SplatScene scene : all_scenes(7)) {
      INFO(scene.name << ", " << variant.name);
      variant.apply(scene.settings);
      check_against_reference(scene, 1e-9);
    }
  }
  worst_errors.report("all scenes, all settings");
}

TEST_CASE("double agrees with the brute-force renderer: lists of several chunks [B12]") {
  for (const Quality quality : {Quality::kDefault, Quality::kReference}) {
    SplatScene scene = crowded(3500, 43);
    apply_quality(scene.settings, quality);
    check_against_reference(scene, 1e-9);
  }
  worst_errors.report("lists of several chunks");
}

TEST_CASE("double agrees with the brute-force renderer: needles, to 1e-16 times their condition number") {
  for (const double aspect : {1e1, 1e2, 1e3, 1e4}) {
    for (const double blur : {0.3, 1e-4, 1e-6, 0.0}) {
      SplatScene scene = needles(15, aspect, 3);
      scene.settings.blur = blur;
      INFO("aspect " << aspect << ", blur " << blur);
      // The image of a needle is about 13 px long; its width is that over the aspect, or the blur's. The condition is
      // that of the projected covariance.
      const double condition = std::pow(13 / std::max(std::sqrt(blur), 13 / aspect), 2);
      check_against_reference<long double>(scene, std::max(1e-9, 1e-16 * condition));
    }
  }
  worst_errors.report("needles");
}

TEST_CASE("double agrees with the brute-force renderer: numbers that are broken") {
  for (const SettingsVariant& variant : settings_variants()) {
    SplatScene scene = broken_numbers(5);
    // Giants are made round: as needles of aspect 1e10 they have no digits left to compare.
    for (std::size_t n = 0; n < scene.log_scales.size(); n += 3) {
      const auto first = scene.log_scales.begin() + static_cast<std::ptrdiff_t>(n);
      const float largest = *std::max_element(first, first + 3);
      if (largest > 15) std::fill_n(first, 3, largest);
    }
    INFO(variant.name);
    variant.apply(scene.settings);
    check_against_reference(scene, 1e-9);
  }
  worst_errors.report("broken numbers");
}

TEST_CASE("double agrees with the brute-force renderer: depth, groups and moved Gaussians") {
  for (const SettingsVariant& variant : settings_variants()) {
    INFO(variant.name);
    SplatScene scene = random_splats(40, 11);
    variant.apply(scene.settings);
    RenderRequest request;
    request.depth = true;
    request.groups = {{3, 17}, {17, 17}, {20, 40}};
    const std::vector<double> random = random_cotangent(12 * scene.count(), 12);
    std::vector<float> moved_by(random.size());
    for (std::size_t i = 0; i < random.size(); ++i) {
      moved_by[i] = static_cast<float>(0.2 * random[i] + (i % 12 % 5 == 0 ? 1 : 0));  // near the identity, no rotation
    }
    check_against_reference(scene, 1e-9, request, moved_by);
  }
  worst_errors.report("depth, groups, transforms");
}

TEST_CASE("double agrees with the brute-force renderer: real scenes", "[release]") {
  std::vector<RealView> views = close_views();
  views.push_back(cropped_view());
  for (const RealView& view : views) {
    SplatScene scene;
    if (!real_scene(view, scene)) {
      CHECK(view.file != cropped_view().file);
      WARN("skipped: no " << view.file);
      continue;
    }
    CHECK(scene.count() > 300);
    CHECK(scene.count() < 1500);  // brute force is slow
    for (const SettingsVariant& variant : settings_variants()) {
      INFO(scene.name << ", " << scene.count() << " Gaussians, " << variant.name);
      SplatScene changed = scene;
      variant.apply(changed.settings);
      check_against_reference(changed, 1e-9);
    }
  }
  worst_errors.report("real scenes");
}

}  // namespace render_reference_test
