#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "pipelines/scan/density.h"
#include "pipelines/scan/start.h"
#include "stress/scratch_folder.h"

namespace density_change_test {

using namespace hsi4d;

namespace {

/// Gaussians in a row, each alike: opacity one half, and their gradients in the image.
ScanState row_of(int count, double scale, const std::vector<float>& gradients) {
  ScanState state;
  std::vector<ColoredPoint> points(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) points[static_cast<std::size_t>(i)].place = Vector3<double>(i, 0, 0);
  state.gaussians = gaussians_at(points, {}, 0, Vector3<double>::Zero());
  std::fill(state.gaussians.log_scales.begin(), state.gaussians.log_scales.end(), static_cast<float>(std::log(scale)));
  std::fill(state.gaussians.opacity_logits.begin(), state.gaussians.opacity_logits.end(), 0.0F);
  const auto columns = state.columns();
  for (std::size_t g = 0; g < kScanGroups; ++g) {
    state.moments[g].resize(count, columns[g]);
    std::fill(state.moments[g].steps.begin(), state.moments[g].steps.end(), 7);
  }
  state.gradient_sums = gradients;
  state.gradient_counts.assign(gradients.size(), 2);
  return state;
}

DensitySettings adc_settings() {
  DensitySettings settings;
  settings.method = DensityMethod::kAdc;
  return settings;
}

}  // namespace

TEST_CASE("faint Gaussians share places of others, and the number grows to its bound") {
  ScanState state;
  ColoredPoint point;
  std::vector<ColoredPoint> points;
  for (int i = 0; i < 100; ++i) {
    point.place = Vector3<double>(i, 0, 0);
    points.push_back(point);
  }
  state.gaussians = gaussians_at(points, {}, 0, Vector3<double>::Zero());
  for (std::size_t i = 0; i < 30; ++i) state.gaussians.opacity_logits[i] = -10;
  const auto columns = state.columns();
  for (std::size_t g = 0; g < kScanGroups; ++g) {
    state.moments[g].resize(100, columns[g]);
    std::fill(state.moments[g].mean.begin(), state.moments[g].mean.end(), 1.0F);
    std::fill(state.moments[g].steps.begin(), state.moments[g].steps.end(), 7);
  }
  DensitySettings settings;
  settings.most = 103;
  const DensityChange change = change_density(settings, 1, 1, state);
  CHECK(change.moved == 30);
  CHECK(change.added == 3);
  CHECK(state.gaussians.count() == 103);
  check_sizes(state.gaussians);
  // Nobody is faint any more, all are where a seen one was, and those that share a place have shared its opacity.
  std::map<float, std::vector<std::size_t>> at;
  for (std::size_t i = 0; i < 103; ++i) at[state.gaussians.means[3 * i]].push_back(i);
  CHECK(at.size() == 70);
  for (const auto& [x, rows] : at) {
    CHECK(x >= 30);
    double transmitted = 1;
    for (const std::size_t row : rows) {
      const double o = 1 / (1 + std::exp(-static_cast<double>(state.gaussians.opacity_logits[row])));
      transmitted *= 1 - o;
      CHECK((rows.size() == 1 ? state.moments[0].steps[row] == 7 : state.moments[0].steps[row] == 0));
    }
    CHECK(transmitted == Approx(0.5).epsilon(1e-5));
  }
}

TEST_CASE("what moves in the image becomes two: small ones are doubled, large ones split") {
  const DensitySettings settings = adc_settings();  // sums of two pictures: 5e-4 is above the bound, 3e-4 is not
  for (const double scale : {0.005, 0.05}) {
    ScanState state = row_of(3, scale, {3e-4F, 5e-4F, 0});
    state.iteration = 600;
    const Gaussians before = state.gaussians;
    const DensityChange change = change_density(settings, 1, 1.0, state);
    CHECK(change.added == 1);
    CHECK(change.removed == 0);
    REQUIRE(state.gaussians.count() == 4);
    check_sizes(state.gaussians);
    CHECK(state.gradient_sums.empty());
    CHECK(state.moments[0].steps == std::vector<std::int32_t>{7, scale < 0.01 ? 7 : 0, 7, 0});
    const auto x = [&](std::size_t row) { return state.gaussians.means[3 * row]; };
    const auto size = [&](std::size_t row) { return std::exp(state.gaussians.log_scales[3 * row]); };
    CHECK((x(0) == 0 && x(2) == 2));
    if (scale < 0.01) {
      CHECK((x(1) == 1 && x(3) == 1));
      CHECK(size(3) == Approx(scale));
    } else {
      for (const std::size_t row : {1, 3}) {
        CHECK(x(row) != 1);
        CHECK(x(row) == Approx(1).margin(5 * scale));
        CHECK(size(row) == Approx(scale / 1.6));
      }
      CHECK(x(1) != x(3));
    }
    CHECK(state.gaussians.opacity_logits == std::vector<float>(4, 0.0F));
  }
}

TEST_CASE("adaptive density control keeps the bound, and the largest gradients go first") {
  DensitySettings settings = adc_settings();
  settings.most = 6;
  ScanState state = row_of(4, 0.001, {1, 4, 2, 3});
  state.iteration = 600;
  CHECK(change_density(settings, 1, 1.0, state).added == 2);
  REQUIRE(state.gaussians.count() == 6);
  CHECK(state.gaussians.means[3 * 4] == 1);
  CHECK(state.gaussians.means[3 * 5] == 3);
}

TEST_CASE("faint Gaussians go, large ones after the first reset, which makes all faint") {
  const DensitySettings settings = adc_settings();
  ScanState state = row_of(5, 0.001, std::vector<float>(5, 0));
  state.gaussians.opacity_logits[1] = -6;  // 0.0025
  state.gaussians.log_scales[3 * 3 + 2] = std::log(0.2F);
  state.gaussians.opacity_logits[4] = 3;
  ScanState later = state;
  state.iteration = 3000;
  CHECK(change_density(settings, 1, 1.0, state).removed == 1);
  REQUIRE(state.gaussians.count() == 4);
  CHECK(state.gaussians.means[3 * 1] == 2);
  for (const float logit : state.gaussians.opacity_logits)  // this was the reset
    CHECK(1 / (1 + std::exp(-logit)) == Approx(0.01));
  CHECK(state.moments[3].steps == std::vector<std::int32_t>(4, 0));
  CHECK(state.moments[0].steps == std::vector<std::int32_t>(4, 7));
  later.iteration = 3100;
  CHECK(change_density(settings, 1, 1.0, later).removed == 2);
  CHECK(later.gaussians.opacity_logits == std::vector<float>{0, 0, 3});

  ScanState all_faint = row_of(2, 0.001, {0, 0});
  all_faint.iteration = 700;
  std::fill(all_faint.gaussians.opacity_logits.begin(), all_faint.gaussians.opacity_logits.end(), -9.0F);
  CHECK(change_density(settings, 1, 1.0, all_faint).removed == 0);
}

TEST_CASE("large Gaussians go only after a reset, whatever it is a multiple of") {
  DensitySettings settings = adc_settings();
  settings.reset_every = 3050;
  for (const auto& [done, removed] : {std::pair{3000, 0}, {3100, 0}, {3200, 1}}) {
    ScanState state = row_of(3, 0.001, {0, 0, 0});
    state.gaussians.log_scales[3] = std::log(0.2F);
    state.iteration = done;
    CHECK(change_density(settings, 1, 1.0, state).removed == removed);
    CHECK((state.gaussians.opacity_logits[0] < -4) == (done == 3100));
  }
}

TEST_CASE("a damaged checkpoint of a reconstruction is told") {
  const ScratchFolder folder;
  const std::string file = std::string(folder.path()) + "/checkpoint.npz";
  ScanState state = row_of(4, 0.01, {1, 2, 3, 4});
  state.exposures.assign(2 * kExposureNumbers, 0.1F);
  state.exposure_moments.resize(2);
  for (RowMoments<float>& moments : state.exposure_moments) moments.resize(kExposureNumbers, 1);
  save_scan_state(file, state, "x");
  const ScanState again = load_scan_state(file, "x");
  CHECK(again.exposures == state.exposures);
  CHECK(again.exposure_moments == state.exposure_moments);
  CHECK(again.gradient_counts == state.gradient_counts);
  const std::vector<std::function<void(ScanState&)>> damages = {
      [](ScanState& s) { s.exposures.pop_back(); },
      [](ScanState& s) { s.exposure_moments.pop_back(); },
      [](ScanState& s) { s.exposure_moments[0].steps[0] = -1; },
      [](ScanState& s) { s.moments[1].steps[2] = -7; },
      [](ScanState& s) { s.moments[2].mean.pop_back(); },
      [](ScanState& s) { s.gradient_sums.pop_back(); },
      [](ScanState& s) { s.gradient_counts[0] = -2; },
  };
  for (const auto& damage : damages) {
    ScanState damaged = state;
    damage(damaged);
    save_scan_state(file, damaged, "x");
    CHECK_THROWS_AS(load_scan_state(file, "x"), DataError);
  }
}

}  // namespace density_change_test
