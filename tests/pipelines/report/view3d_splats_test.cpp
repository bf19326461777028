#include "pipelines/report/view3d_splats.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <catch2/catch.hpp>

#include "core/quaternion.h"
#include "splat/sh_basis.h"
#include "tests/support/small_clip.h"

namespace view3d_splats_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

/// Number of part 0, axis `a` of splat i, as the header says to read it.
double position_of(const QuantisedSplats& s, Index i, Index a) {
  const double low = s.boxes[static_cast<std::size_t>(a)], high = s.boxes[static_cast<std::size_t>(3 + a)];
  return low + s.positions[static_cast<std::size_t>(3 * i + a)] / 65535.0 * (high - low);
}

double log_scale_of(const QuantisedSplats& s, Index i, Index a) {
  return kLeastLogScale +
         s.log_scales[static_cast<std::size_t>(3 * i + a)] / 255.0 * (kLargestLogScale - kLeastLogScale);
}

}  // namespace

TEST_CASE("a weighted sample takes the rows of weight if they are few") {
  const Sample sample = weighted_sample({0, 2, 0, 0.5, 7}, 3);
  CHECK(sample.rows == std::vector<Index>{1, 3, 4});
  CHECK(sample.probabilities == std::vector<double>{1, 1, 1});
  CHECK(weighted_sample({}, 3).rows.empty());
  CHECK(weighted_sample({1, 2}, 0).rows.empty());
}

TEST_CASE("a weighted sample has as many rows as asked for, each as likely as its weight says") {
  RandomSequence random(5);
  std::vector<double> weights;
  for (int i = 0; i < 4000; ++i) weights.push_back(i % 7 == 0 ? 0.0 : random.uniform(0.1, 1));
  weights[100] = 1e6;  // surely taken
  const Sample sample = weighted_sample(weights, 500);
  CHECK(std::abs(static_cast<Index>(sample.rows.size()) - 500) <= 1);
  CHECK(std::is_sorted(sample.rows.begin(), sample.rows.end()));
  double weight_taken = 0, ratio_low = 1e9, ratio_high = 0;
  for (std::size_t s = 0; s < sample.rows.size(); ++s) {
    const double w = weights[static_cast<std::size_t>(sample.rows[s])];
    CHECK(w > 0);
    if (sample.rows[s] == 100) {
      CHECK(sample.probabilities[s] == 1);
      continue;
    }
    ratio_low = std::min(ratio_low, sample.probabilities[s] / w);
    ratio_high = std::max(ratio_high, sample.probabilities[s] / w);
    weight_taken += w / sample.probabilities[s];
  }
  CHECK(ratio_low == Approx(ratio_high));
  CHECK(std::binary_search(sample.rows.begin(), sample.rows.end(), Index{100}));
  // The sample stands for all: Horvitz and Thompson's estimate of the sum.
  const double all = std::accumulate(weights.begin(), weights.end(), 0.0) - 1e6;
  CHECK(weight_taken == Approx(all).epsilon(0.01));
}

TEST_CASE("Gaussians for a viewer are what they were to the last bits") {
  const Gaussians g = random_gaussians(40, {1, -2, 0.5}, 1.5, -2, 3);
  QuantisedSplats splats;
  add_part(g, {.count = 100, .center_world = {1, -2, 0.5}, .radius = 20, .least_opacity = 0}, splats);
  REQUIRE(splats.counts == std::vector<std::int32_t>{40});
  REQUIRE(splats.colors.size() == 160);
  for (Index i = 0; i < 40; ++i) {
    const auto at = static_cast<std::size_t>(i);
    INFO("Gaussian " << i);
    for (Index a = 0; a < 3; ++a) {
      const auto of_axis = static_cast<std::size_t>(3 * i + a);
      CHECK(position_of(splats, i, a) == Approx(g.means[of_axis]).margin(3.0 / 65535));
      CHECK(log_scale_of(splats, i, a) == Approx(g.log_scales[of_axis]).margin(0.021));
      const double color = 0.5 + kShC0 * g.sh[12 * at + static_cast<std::size_t>(a)];
      CHECK(splats.colors[4 * at + static_cast<std::size_t>(a)] / 255.0 ==
            Approx(std::clamp(color, 0.0, 1.0)).margin(0.003));
    }
    CHECK(splats.colors[4 * at + 3] / 255.0 == Approx(sigmoid(g.opacity_logits[at])).margin(0.003));
    Vector4<double> q, raw;
    for (Index a = 0; a < 4; ++a) {
      q[a] = splats.rotations[static_cast<std::size_t>(4 * i + a)] / 127.0;
      raw[a] = g.quats[static_cast<std::size_t>(4 * i + a)];
    }
    CHECK(std::fabs(q.normalized().dot(raw.normalized())) == Approx(1).margin(1e-4));
  }
}

TEST_CASE("what is far, faint or huge is not for a viewer, and fewer Gaussians are larger") {
  Gaussians g = random_gaussians(400, {0, 0, 0}, 1, -3, 4);
  std::fill(g.opacity_logits.begin(), g.opacity_logits.end(), 1.0F);
  std::fill(g.log_scales.begin(), g.log_scales.end(), -3.0F);
  g.means[0] = 50;              // far
  g.opacity_logits[1] = -10;    // faint
  g.log_scales[3 * 2 + 1] = 5;  // huge
  g.origin_world = {100, 0, 0};
  const SplatSelection around{.count = 1000, .center_world = {100, 0, 0}, .radius = 10};
  QuantisedSplats all, few;
  add_part(g, around, all);
  CHECK(all.counts == std::vector<std::int32_t>{397});
  CHECK(all.boxes[0] > 98.9F);
  CHECK(all.boxes[3] < 101.1F);
  SplatSelection fewer = around;
  fewer.count = 100;
  add_part(g, fewer, few);
  REQUIRE(few.counts == std::vector<std::int32_t>{100});
  CHECK(log_scale_of(few, 0, 0) == Approx(-3 + std::log(397.0 / 100) / 2).margin(0.03));
  fewer.count = 5;
  add_part(g, fewer, few);  // a second part, after the first
  REQUIRE(few.counts == std::vector<std::int32_t>{100, 5});
  CHECK(log_scale_of(few, 100, 0) == Approx(-3 + std::log(3.0)).margin(0.03));
  add_part(Gaussians{}, fewer, few);
  CHECK(few.counts.back() == 0);
  CHECK(few.boxes.size() == 18);
}

}  // namespace view3d_splats_test
