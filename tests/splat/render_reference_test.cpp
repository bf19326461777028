// The taped renderer against the brute-force one, which shares no code with it, and float against double.
#include <cstdio>
#include <functional>

#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "tests/support/operator_check.h"
#include "tests/support/taped_splats.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

struct Variant {
  std::string name;
  std::function<void(RenderSettings&)> apply;
};

/// Every family of settings whose numbers differ. `near` stays that of the scene.
std::vector<Variant> variants() {
  const auto with_near = [](auto&& change) {
    return [change](RenderSettings& s) {
      const double near = s.near;
      change(s);
      s.near = std::max(near, s.near);
    };
  };
  return {
      {"default", [](RenderSettings&) {}},
      {"accurate", [](RenderSettings& s) { apply_quality(s, Quality::kAccurate); }},
      {"reference", [](RenderSettings& s) { apply_quality(s, Quality::kReference); }},
      {"gsplat", with_near([](RenderSettings& s) { apply_compatibility(s, Compatibility::kGsplat); })},
      {"inria", with_near([](RenderSettings& s) { apply_compatibility(s, Compatibility::kInria); })},
      {"antialias", [](RenderSettings& s) { s.antialias = true; }},
      {"antialias, reference, no blur to speak of",
       [](RenderSettings& s) {
         apply_quality(s, Quality::kReference);
         s.antialias = true;
         s.blur = 0.01;
       }},
      {"small tiles, degree 1, float keys",
       [](RenderSettings& s) {
         s.tile = 8;
         s.sh_degree = 1;
         s.depth_key = DepthKey::kFloat;
       }},
      {"inria in small tiles, inclusive", with_near([](RenderSettings& s) {
         apply_compatibility(s, Compatibility::kInria);
         s.stop_rule = StopRule::kInclusive;
         s.tile = 8;
       })},
  };
}

SplatCotangent cotangent_of(const Camera& camera, Index groups = 0, bool depth = false) {
  const Index pixels = static_cast<Index>(camera.width) * camera.height;
  SplatCotangent d;
  d.image = random_cotangent(3 * pixels, 1);
  d.transmittance = random_cotangent(pixels, 2);
  if (depth) d.depth = random_cotangent(pixels, 3);
  if (groups > 0) d.groups = random_cotangent(groups * pixels, 4);
  return d;
}

void check_against_reference(const SplatScene& scene, double gradient_tolerance, const RenderRequest& request = {},
                             const std::vector<float>& moved_by = {}) {
  SplatCotangent cotangent = cotangent_of(scene.camera, static_cast<Index>(request.groups.size()), request.depth);
  const ReferenceResult expected = reference_result(scene, cotangent, request, moved_by);
  const auto opaque_enough = [&](std::size_t p) { return 1 - expected.transmittance[p] >= kOpaqueEnough; };
  for (std::size_t p = 0; p < cotangent.depth.size(); ++p) cotangent.depth[p] *= opaque_enough(p) ? 1 : 0;
  TapedSplats<double> taped(scene, cotangent, request, moved_by);
  taped.run();
  CHECK(largest_difference(taped.value(taped.rendered.image), expected.image) <= 1e-10);
  CHECK(largest_difference(taped.value(taped.rendered.transmittance), expected.transmittance) <= 1e-10);
  if (request.depth) {
    const std::vector<double> depth = taped.value(taped.rendered.depth);
    double worst = 0;
    for (std::size_t p = 0; p < depth.size(); ++p) {
      if (opaque_enough(p)) worst = std::max(worst, std::abs(depth[p] - expected.depth[p]));
    }
    CHECK(worst <= 1e-10);
  }
  if (!request.groups.empty()) {
    CHECK(largest_difference(taped.value(taped.rendered.group_opacity), expected.groups) <= 1e-10);
  }
  std::vector<NamedNumbers> gradients = taped.gradients();
  REQUIRE(gradients.size() == expected.gradients.size());
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    INFO("gradient of " << gradients[i].name);
    CHECK(gradients[i].name == expected.gradients[i].name);
    for (std::size_t n = 0; gradients[i].name == "opacity_logits" && n < scene.opacity_logits.size(); ++n) {
      if (std::isnan(scene.opacity_logits[n])) gradients[i].numbers[n] = 0;  // the sigmoid's own, 0 · NaN
    }
    CHECK(relative_l2(gradients[i].numbers, expected.gradients[i].numbers) <= gradient_tolerance);
  }
}

}  // namespace

TEST_CASE("double agrees with the brute-force renderer: every kind of scene and of settings") {
  for (const Variant& variant : variants()) {
    for (SplatScene scene : all_scenes(7)) {
      INFO(scene.name << ", " << variant.name);
      variant.apply(scene.settings);
      check_against_reference(scene, 1e-9);
    }
  }
}

TEST_CASE("double agrees with the brute-force renderer: needles, to 1e-16 times their condition number") {
  for (const double aspect : {1e1, 1e2, 1e4, 1e6}) {
    for (const double blur : {0.3, 1e-4}) {
      SplatScene scene = needles(15, aspect, 3);
      scene.settings.blur = blur;
      INFO("aspect " << aspect << ", blur " << blur);
      // The image of a needle is about 13 px long; its width is that over the aspect, or the blur's.
      const double condition = 13 / std::max(std::sqrt(blur), 13 / aspect);
      check_against_reference(scene, std::max(1e-9, 1e-16 * condition * condition));
    }
  }
}

TEST_CASE("double agrees with the brute-force renderer: numbers that are broken") {
  for (const Variant& variant : variants()) {
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
}

TEST_CASE("double agrees with the brute-force renderer: depth, groups and moved Gaussians") {
  for (const Variant& variant : variants()) {
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
}
