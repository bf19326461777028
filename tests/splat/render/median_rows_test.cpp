// The Gaussian at a pixel's median depth is the one that the trace of the pixel names.
#include "splat/render/median_rows.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "splat/reference/debug_pixel.h"
#include "tests/support/taped_splats.h"

namespace median_rows_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

std::int32_t traced_row(const PixelTrace& trace) {
  for (const PixelSplat& splat : trace.composited) {
    const std::size_t next = static_cast<std::size_t>(&splat - trace.composited.data()) + 1;
    const double behind = next < trace.composited.size() ? trace.composited[next].transmittance : trace.transmittance;
    if (behind <= 0.5) return static_cast<std::int32_t>(splat.index);
  }
  return -1;
}

/// Returns how many pixels have a median.
template <class S>
Index check_scene(const SplatScene& scene) {
  TapedSplats<S> taped(scene, cotangent_of(scene.camera, 0));
  taped.tape.forward(taped.loss);
  const Projected<S>& projected = taped.rendered.projected;
  const std::vector<std::int32_t> rows = median_rows(taped.tape, projected, taped.opacities, taped.view);
  REQUIRE(std::ssize(rows) == Index{scene.camera.width} * scene.camera.height);
  std::vector<PixelPlace> places;
  for (int y = 0; y < scene.camera.height; ++y)
    for (int x = 0; x < scene.camera.width; ++x) places.push_back({x, y});
  const std::vector<PixelTrace> traces =
      trace_pixels<S>(taped.tape, projected, taped.opacities, taped.colors, taped.view, places);
  Index found = 0, wrong = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    wrong += rows[i] == traced_row(traces[i]) ? 0 : 1;
    found += rows[i] >= 0 ? 1 : 0;
  }
  CHECK(wrong == 0);
  return found;
}

}  // namespace

TEST_CASE("the median Gaussian of each pixel is that of its trace: all scenes and settings", "[parallel]") {
  Index found = 0;
  for (const SplatScene& base : all_scenes(3)) {
    for (const SettingsVariant& variant : settings_variants()) {
      INFO(base.name << ", " << variant.name);
      SplatScene scene = base;
      variant.apply(scene.settings);
      found += check_scene<float>(scene);
      found += check_scene<double>(scene);
    }
  }
  CHECK(found > 1000);
}

TEST_CASE("a Gaussian with numbers that are not finite is nowhere the median") {
  const SplatScene scene = broken_numbers(1);
  TapedSplats<float> taped(scene, cotangent_of(scene.camera, 0));
  taped.tape.forward(taped.loss);
  Index found = 0;
  for (const std::int32_t row : median_rows(taped.tape, taped.rendered.projected, taped.opacities, taped.view)) {
    REQUIRE(row < scene.count());
    if (row < 0) continue;
    ++found;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t at = 3 * static_cast<std::size_t>(row) + i;
      CHECK((std::isfinite(scene.means[at]) && !std::isnan(scene.log_scales[at])));
    }
  }
  CHECK(found > 0);
}

}  // namespace median_rows_test
