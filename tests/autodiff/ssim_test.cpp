#include "autodiff/ssim.h"

#include <cmath>
#include <limits>

#include <hwy/targets.h>

#include "core/parallel.h"
#include "tests/autodiff/ssim_images.h"

namespace ssim_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// The bounds of row E1, and a tighter one for the gradient (1e-4 there).
void check_against_reference(const PaddedImage<float>& x, const PaddedImage<float>& y) {
  const ReferenceSsim expected = reference_ssim(x, y);
  const SsimResult<float> computed = compute_ssim(x, y);
  CHECK(std::fabs(computed.mean - expected.mean) < 1e-7);
  // 1 − ssim is what is minimised: a relative bound too, as far as the reference's own sums (1e-12) can tell.
  CHECK(std::fabs(computed.mean - expected.mean) <= 1e-7 * (1 - expected.mean) + 1e-12);
  CHECK(largest_difference(computed.map, expected.map) < 1e-6);
  CHECK(*std::min_element(computed.map.begin(), computed.map.end()) >= -1);
  CHECK(*std::max_element(computed.map.begin(), computed.map.end()) <= 1);
  const double size = norm(expected.d_x);
  if (size > 1e-15) {
    CHECK(test::detail::relative_difference(computed.d_x, expected.d_x) < 3e-5);
  } else {  // x = y: the double reference has only rounding, float nothing at all
    CHECK(norm(computed.d_x) == 0);
  }
}

}  // namespace

TEMPLATE_TEST_CASE("ssim equals the windowed definition at all sizes", "", float, double) {
  const double tolerance = sizeof(TestType) == 4 ? 1e-6 : 1e-14;
  for (const Shape shape : {Shape{1, 1, 1, 1}, Shape{1, 5, 3, 3}, Shape{2, 11, 11, 16}, Shape{1, 3, 40, 40},
                            Shape{1, 70, 2, 5}, Shape{3, 21, 33, 37}, Shape{1, 64, 64, 80}, Shape{1, 18, 131, 144}}) {
    for (const double range : {1.0, 255.0}) {
      INFO(shape << ", data range " << range);
      TestRandom random(7);
      const auto x = random_image<TestType>(shape, random, range), y = random_image<TestType>(shape, random, range);
      const ReferenceSsim expected = reference_ssim(x, y, range);
      const SsimResult<TestType> computed = compute_ssim(x, y, range);
      CHECK(std::fabs(computed.value - (1 - expected.mean)) < tolerance);
      CHECK(std::fabs(computed.mean - expected.mean) < tolerance);
      CHECK(largest_difference(computed.map, expected.map) < tolerance);
      CHECK(test::detail::relative_difference(computed.d_x, expected.d_x) < tolerance);
    }
  }
}

TEST_CASE("ssim of flat images has its closed form away from the border") {
  const Shape shape{1, 31, 31, 32};
  TestRandom random(1);
  const auto x = noisy<double>(shape, 0, random, [](Index, Index) { return 0.3; });
  const auto y = noisy<double>(shape, 0, random, [](Index, Index) { return 0.7; });
  PaddedImage<double> map(shape);
  ssim_map<double>(x.view(), y.view(), map.view());
  CHECK(map.view()(15, 15) == Approx((2 * 0.21 + 1e-4) / (0.09 + 0.49 + 1e-4)).epsilon(1e-14));
}

TEST_CASE("E1: ssim is right in flat areas, in float") {
  const Shape shape{1, 40, 93, 112};
  const double level = GENERATE(0.1, 0.6, 0.9);
  const double noise = GENERATE(0.0, 1e-7, 1e-4, 1e-3, 1e-2);
  const double offset = GENERATE(0.0, 0.01, 0.05);
  INFO("level " << level << ", noise " << noise << ", offset of the target " << offset);
  TestRandom random(3);
  const auto x = noisy<float>(shape, noise, random, [&](Index, Index) { return level; });
  const auto y = noisy<float>(shape, noise, random, [&](Index, Index) { return level + offset; });
  check_against_reference(x, y);
}

TEST_CASE("E1: ssim is right in every band of an image of three flat bands, in float") {
  const Shape shape{1, 50, 121, 128};
  const std::array<double, 3> levels = {0.1, 0.6, 0.9};
  const double noise = GENERATE(0.0, 1e-7, 1e-4, 1e-2);
  const double target = GENERATE(-1.0, 0.1, 0.5, 0.9);  // −1: the bands too
  const bool across = GENERATE(false, true);
  INFO("noise " << noise << ", target " << target << (across ? ", bands of columns" : ", bands of rows"));
  const auto band = [&](Index r, Index c) {
    return levels[static_cast<std::size_t>(across ? c * 3 / 121 : r * 3 / 50)];
  };
  TestRandom random(5);
  const auto x = noisy<float>(shape, noise, random, band);
  const auto y = noisy<float>(shape, noise, random, [&](Index r, Index c) { return target < 0 ? band(r, c) : target; });
  check_against_reference(x, y);

  // Each band by itself, where no window meets another band or the border: an edge must not hide it.
  const ReferenceSsim expected = reference_ssim(x, y);
  const SsimResult<float> computed = compute_ssim(x, y);
  for (Index b = 0; b < 3 && across; ++b) {
    std::vector<double> e, g;
    for (Index r = 10; r < shape.rows - 10; ++r) {
      for (Index c = b * 121 / 3 + 11; c < (b + 1) * 121 / 3 - 11; ++c) {
        e.push_back(expected.d_x[static_cast<std::size_t>(r * shape.cols + c)]);
        g.push_back(computed.d_x[static_cast<std::size_t>(r * shape.cols + c)]);
      }
    }
    INFO("band " << b);
    REQUIRE(!e.empty());
    if (norm(e) > 1e-12) CHECK(test::detail::relative_difference(g, e) < 1e-4);
  }
}

TEST_CASE("E1: anti-correlated textures stay within -1 and 1") {
  TestRandom random(11);
  const Shape shape{1, 33, 47, 48};
  const auto checker = [](Index r, Index c) { return (r + c) % 2 == 0 ? 1.0 : 0.0; };
  const auto x = noisy<float>(shape, 0, random, checker);
  const auto y = noisy<float>(shape, 0, random, [&](Index r, Index c) { return 1 - checker(r, c); });
  const SsimResult<float> result = compute_ssim(x, y);
  CHECK(*std::min_element(result.map.begin(), result.map.end()) >= -1);
  CHECK(result.mean < -0.9);
  check_against_reference(x, y);
}

TEMPLATE_TEST_CASE("ssim of an image with itself is 1, with no gradient", "", float, double) {
  TestRandom random(2);
  const auto x = random_image<TestType>({3, 37, 50, 64}, random);
  const SsimResult<TestType> result = compute_ssim(x, x);
  CHECK(result.value == 0);
  CHECK(result.mean == 1);
  CHECK(std::all_of(result.map.begin(), result.map.end(), [](double v) { return v == 1; }));
  CHECK(norm(result.d_x) == 0);
}

TEST_CASE("E2: the data range scales with the values") {
  TestRandom random(4);
  const Shape shape{1, 30, 45, 48};
  const auto x = random_image<float>(shape, random), y = random_image<float>(shape, random);
  auto x255 = x, y255 = y;
  for (float& v : x255.data) v *= 255;
  for (float& v : y255.data) v *= 255;
  CHECK(std::fabs(compute_ssim(x255, y255, 255).mean - compute_ssim(x, y).mean) < 1e-6);
  CHECK(std::fabs(compute_ssim(x255, y255, 1).mean - compute_ssim(x, y).mean) > 1e-3);
}

TEST_CASE("a value that is not finite stays local in the map and makes the loss NaN") {
  const float bad = GENERATE(std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity());
  const bool in_target = GENERATE(false, true);
  TestRandom random(6);
  const Shape shape{2, 40, 60, 64};
  auto x = random_image<float>(shape, random), y = random_image<float>(shape, random);
  const SsimResult<float> clean = compute_ssim(x, y);
  (in_target ? y : x).view()(0, 17, 30) = bad;
  const SsimResult<float> result = compute_ssim(x, y);
  CHECK(std::isnan(result.value));
  for (Index p = 0; p < 2; ++p) {
    for (Index r = 0; r < shape.rows; ++r) {
      for (Index c = 0; c < shape.cols; ++c) {
        const std::size_t i = static_cast<std::size_t>((p * shape.rows + r) * shape.cols + c);
        const Index distance = std::max(std::abs(r - 17), std::abs(c - 30));
        if (p == 0 && distance <= 5) {
          REQUIRE(std::isnan(result.map[i]));
        } else {
          REQUIRE(result.map[i] == clean.map[i]);
        }
        if (p == 1 || distance > 10) REQUIRE(result.d_x[i] == clean.d_x[i]);
      }
    }
  }
}

TEST_CASE("d_ssim and ssim pass the operator checks", "[parallel]") {
  const OperatorCheck few{.entries = 16};  // each evaluation is a whole image, slow under sanitizers
  const Shape image{2, 37, 23, 32};
  const std::vector<OperatorInput> inputs = {{"image", image, 0, 1}, {"target", image, 0, 1}};
  check_operator(
      "d_ssim", inputs, [](const auto& in) { return d_ssim(in[0], in[1]); }, few);
  check_operator(
      "ssim", inputs, [](const auto& in) { return ssim(in[0], in[1]); }, few);
  const std::vector<OperatorInput> bytes = {{"image", {1, 9, 70, 70}, 0, 255}, {"target", {1, 9, 70, 80}, 0, 255}};
  check_operator(
      "ssim of bytes", bytes, [](const auto& in) { return ssim(in[0], in[1], {.data_range = 255}); }, few);
}

TEST_CASE("E5: many bands and strips give the same bits for any number of threads, close to double", "[parallel]") {
  TestRandom random(8);
  const Shape shape{1, 230, 1100, 1104};
  const auto x = random_image<float>(shape, random), y = random_image<float>(shape, random);
  SsimResult<float> first;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      const SsimResult<float> result = compute_ssim(x, y);
      if (threads == 1) first = result;
      CHECK(result.mean == first.mean);
      CHECK(result.d_x == first.d_x);
    });
  }
  PaddedImage<double> wide_x(shape), wide_y(shape);
  std::copy(x.data.begin(), x.data.end(), wide_x.data.begin());
  std::copy(y.data.begin(), y.data.end(), wide_y.data.begin());
  const SsimResult<double> exact = compute_ssim(wide_x, wide_y);
  CHECK(std::fabs(first.mean - exact.mean) <= 2e-8 * (1 - exact.mean));  // of the loss; the row asks for 1e-7
  CHECK(test::detail::relative_difference(first.d_x, exact.d_x) < 1e-6);
}
TEST_CASE("a constant image costs no gradient") {
  TestRandom random(12);
  const Shape shape{1, 64, 64, 80};
  Tape<float> tape;
  const auto image = tape.parameter("image", shape), target = tape.constant("target", shape);
  const auto loss = d_ssim(image, target);
  tape.freeze(image);
  tape.forward(loss);
  CHECK(tape.statistics().front().saved_bytes == 0);
  tape.unfreeze(image);
  tape.forward(loss);
  CHECK(tape.statistics().front().saved_bytes == shape.memory() * static_cast<Index>(sizeof(float)));
}

TEMPLATE_TEST_CASE("every instruction set gives the same result to rounding", "", float, double) {
  TestRandom random(13);
  const Shape shape{1, 45, 101, 112};
  const auto x = random_image<TestType>(shape, random), y = random_image<TestType>(shape, random);
  const ReferenceSsim expected = reference_ssim(x, y);
  const double tolerance = sizeof(TestType) == 4 ? 1e-6 : 1e-14;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    INFO("target " << hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    const SsimResult<TestType> result = compute_ssim(x, y);
    CHECK(largest_difference(result.map, expected.map) < tolerance);
    CHECK(test::detail::relative_difference(result.d_x, expected.d_x) < tolerance);
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST_CASE("ssim refuses what it can not compare") {
  Tape<double> tape;
  const auto a = tape.parameter("a", {3, 20, 30, 32}), b = tape.constant("b", {3, 20, 31, 32});
  const auto empty = tape.constant("empty", {3, 0, 30, 32}), c = tape.constant("c", {3, 20, 30, 32});
  CHECK_THROWS_WITH(d_ssim(a, b), Catch::Contains("[3,20,30] against [3,20,31]"));
  CHECK_THROWS_WITH(d_ssim(empty, empty), Catch::Contains("ssim of an empty image"));
  CHECK_THROWS_WITH(d_ssim(a, c, {0}), Catch::Contains("data_range = 0.000000, allowed are 1e-6 to 1e6"));
  CHECK_THROWS_WITH(d_ssim(a, c, {NAN}), Catch::Contains("data_range = nan, allowed are 1e-6 to 1e6"));
  const PaddedImage<double> x({3, 20, 30, 32});
  PaddedImage<double> map({3, 20, 29, 32});
  CHECK_THROWS_WITH(ssim_map<double>(x.view(), x.view(), map.view()), Catch::Contains("[3,20,29] against [3,20,30]"));
}

}  // namespace ssim_test
