// Float against double, and any number of threads, through the whole renderer.
//
// A pixel flips a cut when what the compositor chose there in float is not what it chose in double (pixel_choices.h).
// There an α within a rounding error of a threshold is drawn in one precision alone, and gradients jump by what that α
// is worth. Everywhere else both are the same smooth function. So gradients are compared twice: over all pixels, and
// with the loss left out at exactly the pixels that flip.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "splat/render/block_kernel.h"
#include "splat/render/conic.h"
#include "tests/support/failed_images.h"
#include "tests/support/isa.h"
#include "tests/support/measures.h"
#include "tests/support/pixel_choices.h"
#include "tests/support/real_splats.h"
#include "tests/support/taped_splats.h"

namespace render_precision_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr double kMostFlips = 1e-3;  // of the pixels
constexpr double kMeanImage = 2e-6;  // mean difference of images
constexpr double kGradients = 3e-4;  // relative L2 of every class, all pixels; see Summary::check

/// Of gradients away from pixels that flip: the relative L2 of a class, and the worst row.
struct Bounds {
  double all, row;
};
constexpr Bounds kElsewhere{1e-5, 3e-4};

/// The class of gradients that is off most, and the row.
struct WorstClass {
  std::string name, row_name;
  double error = 0, row = 0;
};

WorstClass worst_class(const std::vector<NamedNumbers>& computed, const std::vector<NamedNumbers>& expected) {
  WorstClass worst;
  for (const ClassError& e : gradient_errors(computed, expected)) {
    if (!(e.all <= worst.error)) worst.name = e.name, worst.error = e.all;
    if (!(e.worst_row <= worst.row)) worst.row_name = e.name, worst.row = e.worst_row;
  }
  return worst;
}

double mean_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
  return sum / static_cast<double>(a.size());
}

/// sqrt of the largest condition number of the projected covariances, blur included: how many times longer than wide.
double longest_needle(const TapedSplats<double>& splats) {
  const std::vector<double> factors = splats.value(splats.rendered.projected.factors);
  double longest = 1;
  for (std::size_t i = 0; i < factors.size(); i += 6) {
    hsi4d::detail::Conic conic;
    if (!hsi4d::detail::conic_of(&factors[i], splats.view.settings.blur, conic)) continue;
    const double larger = 0.5 * (conic.xx + conic.yy) + std::hypot(0.5 * (conic.xx - conic.yy), conic.xy);
    longest = std::max(longest, larger / std::sqrt(conic.determinant));
  }
  return longest;
}

/// Float against double on one scene at the same depth keys.
struct FloatErrors {
  std::size_t pixels = 0, flips = 0;
  double mean_image = 0;
  WorstClass gradients, elsewhere;
};

template <class S>
PixelChoices choices_of(const TapedSplats<S>& splats) {
  const PixelChoices choices = pixel_choices(splats.tape, splats.rendered.projected, splats.opacities, splats.view);
  CHECK(choices.fragments == splats.rendered.counters->fragments);  // that they are the compositor's own
  return choices;
}

FloatErrors float_errors(SplatScene scene) {
  scene.settings.depth_key = DepthKey::kFloat;
  SplatCotangent cotangent = cotangent_of(scene.camera);
  FloatErrors errors;
  std::vector<std::size_t> flipped;
  {
    TapedSplats<double> exact(scene, cotangent);
    TapedSplats<float> fast(scene, cotangent);
    exact.run();
    fast.run_after_another();
    flipped = flipped_pixels(choices_of(exact), choices_of(fast));
    const std::vector<double> computed = fast.value(fast.rendered.image), expected = exact.value(exact.rendered.image);
    errors.mean_image = mean_difference(computed, expected);
    if (!(errors.mean_image <= kMeanImage)) {
      UNSCOPED_INFO(save_failed_images(scene.name, computed, expected, scene.camera.height, scene.camera.width));
    }
    errors.gradients = errors.elsewhere = worst_class(fast.gradients(), exact.gradients());
  }
  errors.pixels = cotangent.transmittance.size();
  errors.flips = flipped.size();
  if (flipped.empty()) return errors;
  for (const std::size_t p : flipped) {
    cotangent.transmittance[p] = 0;
    for (std::size_t c = 0; c < 3; ++c) cotangent.image[c * errors.pixels + p] = 0;
  }
  TapedSplats<double> exact(scene, cotangent);
  TapedSplats<float> fast(scene, cotangent);
  exact.run();
  fast.run_after_another();
  errors.elsewhere = worst_class(fast.gradients(), exact.gradients());
  return errors;
}

/// The worst of a test's comparisons.
struct Summary {
  std::size_t comparisons = 0, above = 0, pixels = 0, flips = 0;
  double mean_image = 0, gradients = 0, elsewhere = 0, row = 0;

  void add(const FloatErrors& e) {
    ++comparisons;
    above += e.gradients.error > kGradients ? 1 : 0;
    pixels += e.pixels;
    flips += e.flips;
    mean_image = larger(mean_image, e.mean_image);
    gradients = larger(gradients, e.gradients.error);
    elsewhere = larger(elsewhere, e.elsewhere.error);
    row = larger(row, e.elsewhere.row);
  }
  void print(const char* what) const {
    std::printf("float against double, %s: %zu of %zu pixels flip a cut (%.2g %%)\n", what, flips, pixels,
                100 * static_cast<double>(flips) / static_cast<double>(pixels));
    std::printf("  largest: mean image error %.2g, gradients %.2g, away from flips %.2g, there of a row %.2g\n",
                mean_image, gradients, elsewhere, row);
  }
  /// One flip is an α of alpha_min there or not there. How much of a class's gradient that is depends on the class and
  /// the pixel: at the end of a needle it turns the needle by its lever, and the camera's six numbers are what is left
  /// of a sum over all pixels whose terms cancel. Which pixels flip differs between instruction sets. So one comparison
  /// may be above kGradients; without a flip none can be, for then kElsewhere holds.
  void check(const char* what) const {
    print(what);
    if (above > 0) std::printf("  above %.0e with its flips: %zu of %zu comparisons\n", kGradients, above, comparisons);
    CHECK(above <= 1);
  }
};

/// Checks one comparison; Summary::check the gradients over all pixels.
FloatErrors check_float(const SplatScene& scene, Bounds bounds, Summary& summary) {
  const FloatErrors errors = float_errors(scene);
  INFO(errors.flips << " of " << errors.pixels << " pixels flip; away from them " << errors.elsewhere.name
                    << " is off by " << errors.elsewhere.error << ", a row of " << errors.elsewhere.row_name << " by "
                    << errors.elsewhere.row);
  CHECK(static_cast<double>(errors.flips) <= kMostFlips * static_cast<double>(errors.pixels));
  CHECK(errors.mean_image <= kMeanImage);
  CHECK(errors.elsewhere.error <= bounds.all);
  CHECK(errors.elsewhere.row <= bounds.row);
  summary.add(errors);
  return errors;
}

/// The one comparison that is farther off than all others: 1.85e-5 of the camera's gradient, 1.7e-3 of a row. The
/// camera's six numbers of norm 197 are what is left of sums that cancel 20-fold; the means' gradient beside them has
/// norm 3600, and nothing is cut. Two rows of opacity_logits alone are beyond 7.5e-4: 1.1e-5 and 6.2e-5 where the
/// largest is 0.37. Both Gaussians are flat, 24 times as long as thick, with a blur of a hundredth of a pixel².
struct Exception {
  std::string scene = "playbot_object_robot.ply", settings = "antialias, reference, hardly any blur";
  Bounds bounds{2.5e-5, 2.5e-3};
};

Bounds bounds_of(const SplatScene& scene, const SettingsVariant& variant) {
  const Exception exception;
  return scene.name == exception.scene && variant.name == exception.settings ? exception.bounds : kElsewhere;
}

void check_all_settings(const SplatScene& scene, Summary& summary) {
  for (const SettingsVariant& variant : settings_variants()) {
    INFO(scene.name << ", " << variant.name);
    SplatScene changed = scene;
    variant.apply(changed.settings);
    check_float(changed, bounds_of(scene, variant), summary);
  }
}

/// Faint Gaussians of a pixel's size in front of others, the α of each at one pixel as near to alpha_min as a float's
/// logit allows. Their places are floats exactly.
SplatScene at_the_cut(Index faint) {
  const int size = 128;
  SplatScene scene = random_splats(100, 41, {size, size});
  scene.name = "at the cut";
  scene.camera = plain_camera({size, size});
  for (std::size_t i = 2; i < scene.means.size(); i += 3) scene.means[i] += 4;
  for (Index i = 0; i < faint; ++i) {
    // 1 m away, `offset` pixels beside the centre of a pixel: V Vᵀ = σ² (I + h hᵀ) with h = (x, y)/z.
    const double offset = static_cast<double>(i % 29 - 14) / 64;
    const double x = (static_cast<double>(15 * (i % 8) + 7 - size / 2) + 0.5 + offset) / size;
    const double y = (static_cast<double>(15 * (i / 8) + 9 - size / 2) + 0.5) / size;
    scene.add({x, y, 1}, 1.0 / size, 0, {1, 0.5, 0});
    const double variance = std::exp(2 * static_cast<double>(scene.log_scales.back())) * size * size;
    const double xx = variance * (1 + x * x) + kBlur, yy = variance * (1 + y * y) + kBlur, xy = variance * x * y;
    const double opacity = kAlphaMin * std::exp(0.5 * offset * offset * yy / (xx * yy - xy * xy));
    scene.opacity_logits.back() = static_cast<float>(std::log(opacity / (1 - opacity)));
  }
  return scene;
}

}  // namespace

TEST_CASE("float agrees with double at the same depth keys: every kind of scene and of settings", "[isa]") {
  const SceneSize size{96, 64};
  Summary summary;
  for (const SplatScene& scene :
       {random_splats(300, 21, size), saturated(21, size), behind_and_beside(21, size), near_plane(21, size),
        raw_quaternions(100, 21, size), off_centre(100, 21, size), depth_ties(21, size), stack(40, 0.3, 21, size)}) {
    check_all_settings(scene, summary);
  }
  summary.check("all scenes, all settings");
}

TEST_CASE("float agrees with double at the same depth keys: lists of several chunks [B12, F7]", "[isa]") {
  const SplatScene scene = crowded(3500, 43);
  TapedSplats<float> taped(scene, cotangent_of(scene.camera));
  taped.run();
  CHECK(taped.rendered.counters->reached > 2 * hsi4d::detail::kBlockChunk);  // by the first tile, nearly all
  Summary summary;
  check_all_settings(scene, summary);
  summary.check("lists of several chunks");
}

TEST_CASE("float agrees with double at the same depth keys: where cuts flip, only there", "[isa]") {
  Summary summary;
  const FloatErrors errors = check_float(at_the_cut(40), kElsewhere, summary);
  CHECK(errors.flips > 0);
  CHECK(errors.gradients.error > kElsewhere.all);  // the flips are what is left out, not nothing
  summary.print("alphas at the cut");
}

TEST_CASE("float agrees with double at the same depth keys: needles, to 1.2e-7 times their aspect", "[isa]") {
  // V is kept in float. Rounded by half a unit in the last place, 6e-8, it turns a needle by as much; its ends move by
  // 6e-8 of its length. Measured in its width that is 6e-8 times the aspect (of the projected ellipse with the blur,
  // the root of the covariance's condition number): so large is the change of u, of G and of all gradients. Twice that
  // is allowed, and what round Gaussians have beside.
  const double rounding = 0.5 * static_cast<double>(std::numeric_limits<float>::epsilon());
  Summary summary;
  constexpr double kRowsOfNeedles = 30;  // the worst row comes to 14 times the bound of all
  double largest_share = 0;
  for (const double aspect : {1e1, 1e2, 1e3, 1e4}) {
    for (const double blur : {0.3, 1e-2, 1e-4, 1e-6, 0.0}) {
      for (const Quality quality : {Quality::kDefault, Quality::kReference}) {
        SplatScene scene = needles(60, aspect, 3, {96, 64});
        apply_quality(scene.settings, quality);
        scene.settings.blur = blur;
        TapedSplats<double> exact(scene, cotangent_of(scene.camera));
        exact.run();
        const double bound = 1e-6 + 2 * rounding * longest_needle(exact);
        INFO("aspect " << aspect << ", blur " << blur << ", bound " << bound);
        largest_share = std::max(largest_share,
                                 check_float(scene, {bound, kRowsOfNeedles * bound}, summary).elsewhere.error / bound);
      }
    }
  }
  summary.print("needles");
  std::printf("  at most %.2f of what the aspect allows\n", largest_share);
}

TEST_CASE("float agrees with double at the same depth keys: real scenes", "[release]") {
  Summary summary;
  std::vector<RealView> views = close_views();
  views.insert(views.begin(), cropped_view());
  for (const RealView& view : views) {
    SplatScene scene;
    if (real_scene(view, scene)) {
      check_all_settings(scene, summary);
    } else {
      CHECK(view.file != cropped_view().file);
      WARN("skipped: no " << view.file);
    }
  }
  summary.check("real scenes");
}

TEST_CASE("float agrees with double at the same depth keys: a whole real scene", "[full]") {
  Summary summary;
  for (const RealView& view : whole_views()) {
    SplatScene scene;
    if (!real_scene(view, scene)) {
      WARN("skipped: no " << view.file);
      return;
    }
    INFO("from " << view.from.transpose());
    check_float(scene, kElsewhere, summary);
  }
  summary.check("a whole scene");
}

TEST_CASE("the renderer gives the same bits on any number of threads", "[parallel][isa]") {
  RenderRequest request;
  request.depth = true;
  const Index n = is_held_isa() ? 300 : 1600;  // several chunks of the loops over Gaussians
  request.groups = {{0, n / 2}, {n / 4, n}};
  const SplatScene scene = random_splats(n, 31, {97, 65});
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
          for (const Var<S> leaf : taped.leaves()) taped.tape.write(leaf);  // what is up to date would not run again
          taped.tape.drop_state();
          taped.run();
        });
        std::vector<std::vector<double>> all = {
            taped.value(taped.loss), taped.value(taped.rendered.image), taped.value(taped.rendered.transmittance),
            taped.value(taped.rendered.depth), taped.value(taped.rendered.group_opacity)};
        for (const NamedNumbers& g : taped.gradients()) all.push_back(g.numbers);
        if (threads == 1) first = all;
        const bool has_the_bits = all == first;  // a failure would print every number
        CHECK(has_the_bits);
      }
    };
    check(float());
    check(double());
  }
}

}  // namespace render_precision_test
