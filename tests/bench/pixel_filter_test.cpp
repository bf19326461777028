#include "bench/pixel_filter.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "bench/pixel_filter_table.h"
#include "core/check.h"

namespace pixel_filter_test {

using namespace hsi4d;

namespace {

/// A disc in the middle of 48 × 40 pixels whose edge falls from 1 to 0 over one pixel.
SceneImage disc(double radius) {
  SceneImage image{48, 40, {}, {}, {}, {}};
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const double r = std::hypot(column + 0.5 - 24.2, row + 0.5 - 19.7);
      const double alpha = std::clamp(radius - r + 0.5, 0.0, 1.0);
      image.alpha.push_back(alpha);
      for (const double c : {0.2, 0.5, 0.8}) image.image.push_back(c * alpha);
    }
  }
  return image;
}

SceneView with_filter(SceneView view, double blur, bool antialias) {
  view.settings.blur = blur;
  view.settings.antialias = antialias;
  return view;
}

/// The figure and the pixel's square as its filter.
struct Judge {
  PosedGaussians figure;
  SceneView view;
  SceneImage truth;

  Judge(Index gaussians, double height_px, int factor = 8, double truth_blur = 0)
      : figure(filter_figure(gaussians)),
        view(figure_view(figure, height_px, {0.13, 0.29})),
        truth(supersampled(figure, with_filter(view, truth_blur, false), factor)) {}

  SilhouetteError error(double blur, bool antialias) const {
    return silhouette_error(render_scene(figure, with_filter(view, blur, antialias)), truth);
  }
};

}  // namespace

TEST_CASE("the width error of a disc is twice what its radius has too much") {
  for (const double more : {-0.2, -0.05, 0.05, 0.2}) {
    const SilhouetteError e = silhouette_error(disc(12 + more), disc(12));
    CHECK(e.width_px == Approx(2 * more).epsilon(0.03));
    CHECK(e.half_width_px == Approx(2 * more).epsilon(0.12));
    CHECK(e.brightness == Approx(std::pow((12 + more) / 12, 2) - 1).epsilon(0.02));
    CHECK(e.rms > 0);
  }
  const SilhouetteError none = silhouette_error(disc(12), disc(12));
  CHECK(none.width_px == 0);
  CHECK(none.half_width_px == 0);
  CHECK(none.brightness == 0);
  CHECK(none.rms == 0);
  SceneImage empty = disc(12);
  empty.alpha.assign(empty.alpha.size(), 0);
  CHECK_THROWS_AS(silhouette_error(disc(12), empty), InternalError);
}

TEST_CASE("a soft lens keeps light and width") {
  const SilhouetteError e = silhouette_error(softened(disc(12), 0.25), disc(12));
  CHECK(std::abs(e.width_px) < 1e-9);
  CHECK(std::abs(e.brightness) < 1e-9);
  CHECK(std::abs(e.half_width_px) < 0.03);
  CHECK(e.rms > 0.01);
}

TEST_CASE("a supersampled image in bands is the large image averaged") {
  const PosedGaussians figure = filter_figure(200);
  const SceneView view = figure_view(figure, 90, {0.2, 0.4});  // three bands
  const SceneImage small = supersampled(figure, with_filter(view, 0.3, true), 3);
  SceneView whole = with_filter(view, 0.3, true);
  whole.camera.width *= 3, whole.camera.height *= 3;
  whole.camera.fx *= 3, whole.camera.fy *= 3, whole.camera.cx *= 3, whole.camera.cy *= 3;
  const SceneImage large = render_scene(figure, whole);
  const auto at = [](const SceneImage& image, int row, int column) {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(column);
  };
  double most = 0;
  for (int row = 0; row < small.height; ++row) {
    for (int column = 0; column < small.width; ++column) {
      double alpha = 0, green = 0;
      for (int i = 0; i < 9; ++i) {
        const std::size_t from = at(large, 3 * row + i / 3, 3 * column + i % 3);
        alpha += large.alpha[from] / 9;
        green += large.image[3 * from + 1] / 9;
      }
      const std::size_t to = at(small, row, column);
      most = std::max({most, std::abs(alpha - small.alpha[to]), std::abs(green - small.image[3 * to + 1])});
    }
  }
  CHECK(most < 1e-12);
  CHECK_THROWS_AS(supersampled(figure, view, 0), InternalError);
}

TEST_CASE("with a small blur antialias keeps a figure's width to 0.05 px, with 0.3 it does not") {
  const Judge judge(1000, 128);
  const SilhouetteError small = judge.error(kSharpBlur, true), plain = judge.error(0.3, false),
                        wide = judge.error(0.3, true);
  INFO(small.width_px << " " << small.half_width_px << " " << wide.width_px << " " << plain.width_px);
  CHECK(std::abs(small.width_px) <= kWidthGoalPx);
  CHECK(std::abs(small.half_width_px) <= kWidthGoalPx);
  CHECK(std::abs(small.brightness) < 0.005);
  CHECK(wide.width_px > 0.3);
  CHECK(plain.width_px > wide.width_px + 0.2);
  CHECK(plain.rms > wide.rms);
  CHECK(wide.rms > small.rms);
}

TEST_CASE("with blur 0.13 antialias keeps the widths of generated clips to 0.05 px") {
  const Judge judge(1000, 128, 2, 0.3);
  const SilhouetteError matched = judge.error(0.13, true), plain = judge.error(0.3, false);
  INFO(matched.width_px << " " << matched.half_width_px << " " << plain.width_px);
  CHECK(std::abs(matched.width_px) <= kWidthGoalPx);
  CHECK(std::abs(matched.half_width_px) <= kWidthGoalPx);
  CHECK(plain.width_px > 0.3);
}

TEST_CASE("antialias keeps the width of a lone thread thinner than a pixel") {
  PosedGaussians thread;  // 0.15 px across, upright, a little aslant
  thread.gaussians.means = {0, 0, 0};
  thread.gaussians.quats = {1, 0, 0, 0.1F};
  for (const double s : {0.15, 8.0, 0.15}) thread.gaussians.log_scales.push_back(static_cast<float>(std::log(s)));
  thread.gaussians.opacity_logits = {2};
  thread.gaussians.sh = {1, 1, 1};
  SceneView view;
  view.precision = Precision::kDouble;
  view.camera.width = 40, view.camera.height = 70;
  view.camera.fx = view.camera.fy = 1000;
  view.camera.cx = 20.3, view.camera.cy = 35.1;
  view.camera.camera_from_world.translation = {0, 0, 1000};
  apply_quality(view.settings, Quality::kAccurate);
  const SceneImage truth = supersampled(thread, with_filter(view, 0, false), 8);
  const SilhouetteError plain = silhouette_error(render_scene(thread, with_filter(view, 0.3, false)), truth);
  const SilhouetteError antialias = silhouette_error(render_scene(thread, with_filter(view, 0.3, true)), truth);
  INFO(plain.width_px << " " << antialias.width_px);
  CHECK(std::abs(antialias.width_px) < 0.01);
  CHECK(std::abs(antialias.brightness) < 0.01);
  CHECK(plain.width_px > 0.5);
}

}  // namespace pixel_filter_test
