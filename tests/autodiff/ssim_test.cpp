#include "autodiff/ssim.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <hwy/targets.h>

#include "core/parallel.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/operator_check.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// An image with its own memory; the padding is NaN, so that reading it shows.
template <class S>
struct Image {
  explicit Image(Shape s) : shape(s), data(static_cast<std::size_t>(s.memory()), S(NAN)) {}
  Array<S> view() { return {data.data(), shape}; }
  ConstArray<S> view() const { return {data.data(), shape}; }
  Shape shape;
  std::vector<S> data;
};

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }

 private:
  std::mt19937_64 engine_;
};

/// value(r, c) + noise·uniform(−1, 1).
template <class S, class F>
Image<S> noisy(const Shape& shape, double noise, Random& random, const F& value) {
  Image<S> image(shape);
  for (Index p = 0; p < shape.planes; ++p) {
    for (Index r = 0; r < shape.rows; ++r) {
      for (Index c = 0; c < shape.cols; ++c) {
        image.view()(p, r, c) = static_cast<S>(value(r, c) + noise * random(-1, 1));
      }
    }
  }
  return image;
}
template <class S>
Image<S> random_image(const Shape& shape, Random& random, double range = 1) {
  return noisy<S>(shape, range / 2, random, [&](Index, Index) { return range / 2; });
}

/// The obvious SSIM: a 121-tap window in double around every pixel.
struct Reference {
  double mean = 0;
  std::vector<double> map, d_x;  // without padding
};
template <class S>
Reference reference(const Image<S>& x, const Image<S>& y, double range = 1) {
  const Shape& s = x.shape;
  std::vector<double> w(11);
  double total = 0;
  for (int i = 0; i < 11; ++i) total += w[i] = std::exp(-(i - 5) * (i - 5) / (2 * 1.5 * 1.5));
  for (double& v : w) v /= total;
  const double c1 = 0.01 * range * 0.01 * range, c2 = 0.03 * range * 0.03 * range;
  Reference result;
  result.map.resize(static_cast<std::size_t>(s.count()));
  result.d_x.resize(static_cast<std::size_t>(s.count()));
  for (Index p = 0; p < s.planes; ++p) {
    const auto inside = [&](Index r, Index c) { return r >= 0 && c >= 0 && r < s.rows && c < s.cols; };
    const auto at = [&](const Image<S>& image, Index r, Index c) {
      return inside(r, c) ? static_cast<double>(image.view()(p, r, c)) : 0.0;
    };
    const auto over_window = [&](Index r, Index c, const auto& f) {
      for (Index i = -5; i <= 5; ++i) {
        for (Index j = -5; j <= 5; ++j) f(w[i + 5] * w[j + 5], r + i, c + j);
      }
    };
    for (Index r = 0; r < s.rows; ++r) {
      for (Index c = 0; c < s.cols; ++c) {
        double mx = 0, my = 0, vx = 0, vy = 0, vxy = 0;
        over_window(r, c, [&](double q, Index i, Index j) {
          mx += q * at(x, i, j);
          my += q * at(y, i, j);
        });
        over_window(r, c, [&](double q, Index i, Index j) {
          vx += q * (at(x, i, j) - mx) * (at(x, i, j) - mx);
          vy += q * (at(y, i, j) - my) * (at(y, i, j) - my);
          vxy += q * (at(x, i, j) - mx) * (at(y, i, j) - my);
        });
        const double a1 = 2 * mx * my + c1, a2 = 2 * vxy + c2, b1 = mx * mx + my * my + c1, b2 = vx + vy + c2;
        const double value = a1 * a2 / (b1 * b2);
        result.map[static_cast<std::size_t>((p * s.rows + r) * s.cols + c)] = value;
        result.mean += value / static_cast<double>(s.count());
        const double d_mean = 2 * my * a2 / (b1 * b2) - 2 * mx * value / b1, d_vx = -value / b2;
        const double d_vxy = 2 * a1 / (b1 * b2);
        over_window(r, c, [&](double q, Index i, Index j) {
          if (!inside(i, j)) return;
          result.d_x[static_cast<std::size_t>((p * s.rows + i) * s.cols + j)] -=
              q * (d_mean + 2 * d_vx * (at(x, i, j) - mx) + d_vxy * (at(y, i, j) - my)) /
              static_cast<double>(s.count());
        });
      }
    }
  }
  return result;
}

template <class S>
struct Result {
  double value = 0;  // d_ssim as the tape holds it
  double mean = 0;   // mean ssim in double
  std::vector<double> map, d_x;
};
template <class S>
std::vector<double> wide(const ConstArray<S>& a) {
  const std::vector<S> numbers = test::detail::numbers<S>(a);
  return {numbers.begin(), numbers.end()};
}
template <class S>
Result<S> compute(const Image<S>& x, const Image<S>& y, double range = 1) {
  Tape<S> tape;
  const auto image = tape.parameter("image", x.shape), target = tape.constant("target", y.shape);
  std::copy(x.data.begin(), x.data.end(), tape.write(image).data);
  std::copy(y.data.begin(), y.data.end(), tape.write(target).data);
  const auto loss = d_ssim(image, target, {range});
  tape.forward(loss);
  tape.backward(loss);
  Image<S> map(x.shape);
  Result<S> result;
  result.mean = ssim_map(x.view(), y.view(), map.view(), {range});
  result.value = static_cast<double>(tape.value(loss).scalar());
  result.map = wide<S>(map.view());
  result.d_x = wide<S>(tape.gradient(image));
  return result;
}

double norm(const std::vector<double>& a) {
  double sum = 0;
  for (const double v : a) sum += v * v;
  return std::sqrt(sum);
}
double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::fabs(a[i] - b[i]));
  return worst;
}

/// The bounds of row E1, and a tighter one for the gradient (1e-4 there).
void check_against_reference(const Image<float>& x, const Image<float>& y) {
  const Reference expected = reference(x, y);
  const Result<float> computed = compute(x, y);
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
      Random random(7);
      const auto x = random_image<TestType>(shape, random, range), y = random_image<TestType>(shape, random, range);
      const Reference expected = reference(x, y, range);
      const Result<TestType> computed = compute(x, y, range);
      CHECK(std::fabs(computed.value - (1 - expected.mean)) < tolerance);
      CHECK(std::fabs(computed.mean - expected.mean) < tolerance);
      CHECK(largest_difference(computed.map, expected.map) < tolerance);
      CHECK(test::detail::relative_difference(computed.d_x, expected.d_x) < tolerance);
    }
  }
}

TEST_CASE("ssim of flat images has its closed form away from the border") {
  const Shape shape{1, 31, 31, 32};
  Random random(1);
  const auto x = noisy<double>(shape, 0, random, [](Index, Index) { return 0.3; });
  const auto y = noisy<double>(shape, 0, random, [](Index, Index) { return 0.7; });
  Image<double> map(shape);
  ssim_map<double>(x.view(), y.view(), map.view());
  CHECK(map.view()(15, 15) == Approx((2 * 0.21 + 1e-4) / (0.09 + 0.49 + 1e-4)).epsilon(1e-14));
}

TEST_CASE("E1: ssim is right in flat areas, in float") {
  const Shape shape{1, 40, 93, 112};
  const double level = GENERATE(0.1, 0.6, 0.9);
  const double noise = GENERATE(0.0, 1e-7, 1e-4, 1e-3, 1e-2);
  const double offset = GENERATE(0.0, 0.01, 0.05);
  INFO("level " << level << ", noise " << noise << ", offset of the target " << offset);
  Random random(3);
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
  Random random(5);
  const auto x = noisy<float>(shape, noise, random, band);
  const auto y = noisy<float>(shape, noise, random, [&](Index r, Index c) { return target < 0 ? band(r, c) : target; });
  check_against_reference(x, y);

  // Each band by itself, where no window meets another band or the border: an edge must not hide it.
  const Reference expected = reference(x, y);
  const Result<float> computed = compute(x, y);
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
  Random random(11);
  const Shape shape{1, 33, 47, 48};
  const auto checker = [](Index r, Index c) { return (r + c) % 2 == 0 ? 1.0 : 0.0; };
  const auto x = noisy<float>(shape, 0, random, checker);
  const auto y = noisy<float>(shape, 0, random, [&](Index r, Index c) { return 1 - checker(r, c); });
  const Result<float> result = compute(x, y);
  CHECK(*std::min_element(result.map.begin(), result.map.end()) >= -1);
  CHECK(result.mean < -0.9);
  check_against_reference(x, y);
}

TEMPLATE_TEST_CASE("ssim of an image with itself is 1, with no gradient", "", float, double) {
  Random random(2);
  const auto x = random_image<TestType>({3, 37, 50, 64}, random);
  const Result<TestType> result = compute(x, x);
  CHECK(result.value == 0);
  CHECK(result.mean == 1);
  CHECK(std::all_of(result.map.begin(), result.map.end(), [](double v) { return v == 1; }));
  CHECK(norm(result.d_x) == 0);
}

TEST_CASE("E2: the data range scales with the values") {
  Random random(4);
  const Shape shape{1, 30, 45, 48};
  const auto x = random_image<float>(shape, random), y = random_image<float>(shape, random);
  auto x255 = x, y255 = y;
  for (float& v : x255.data) v *= 255;
  for (float& v : y255.data) v *= 255;
  CHECK(std::fabs(compute(x255, y255, 255).mean - compute(x, y).mean) < 1e-6);
  CHECK(std::fabs(compute(x255, y255, 1).mean - compute(x, y).mean) > 1e-3);
}

TEST_CASE("a value that is not finite stays local in the map and makes the loss NaN") {
  const float bad = GENERATE(std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity());
  const bool in_target = GENERATE(false, true);
  Random random(6);
  const Shape shape{2, 40, 60, 64};
  auto x = random_image<float>(shape, random), y = random_image<float>(shape, random);
  const Result<float> clean = compute(x, y);
  (in_target ? y : x).view()(0, 17, 30) = bad;
  const Result<float> result = compute(x, y);
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
  Random random(8);
  const Shape shape{1, 230, 1100, 1104};
  const auto x = random_image<float>(shape, random), y = random_image<float>(shape, random);
  Result<float> first;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      const Result<float> result = compute(x, y);
      if (threads == 1) first = result;
      CHECK(result.mean == first.mean);
      CHECK(result.d_x == first.d_x);
    });
  }
  Image<double> wide_x(shape), wide_y(shape);
  std::copy(x.data.begin(), x.data.end(), wide_x.data.begin());
  std::copy(y.data.begin(), y.data.end(), wide_y.data.begin());
  const Result<double> exact = compute(wide_x, wide_y);
  CHECK(std::fabs(first.mean - exact.mean) <= 2e-8 * (1 - exact.mean));  // of the loss; the row asks for 1e-7
  CHECK(test::detail::relative_difference(first.d_x, exact.d_x) < 1e-6);
}

namespace {

/// A scene of a base image on which a square moves.
template <class S>
struct RegionScene {
  Shape shape{2, 150, 1210, 1216};
  Random random{9};
  Image<S> base = random_image<S>(shape, random), target = random_image<S>(shape, random);
  Tape<S> tape;
  Var<S> image = tape.parameter("image", shape);
  Var<S> goal = tape.constant("target", shape);
  Var<S> still = tape.constant("base", shape);
  Var<S> touched = tape.constant("touched", shape_of(ssim_tiles(150), ssim_tiles(1210)));
  Var<S> whole, region;

  RegionScene() {
    std::copy(target.data.begin(), target.data.end(), tape.write(goal).data);
    std::copy(base.data.begin(), base.data.end(), tape.write(still).data);
    whole = d_ssim(image, goal);
    region = d_ssim_region(image, goal, SsimRegion<S>{touched, ssim_tile_sums(still, goal)});
  }

  /// The image with a square at (row, col), and the tiles that it touches.
  void place(Index row, Index col, Index side) {
    const Array<S> to = tape.write(image), tiles = tape.write(touched);
    std::copy(base.data.begin(), base.data.end(), to.data);
    for (Index r = 0; r < tiles.shape.rows; ++r) std::fill_n(tiles.row(r), tiles.shape.cols, S(0));
    for (Index r = row; r < std::min(row + side, shape.rows); ++r) {
      for (Index c = col; c < std::min(col + side, shape.cols); ++c) {
        to(0, r, c) = S(0.25) + to(0, r, c) / 2;
        to(1, r, c) = S(0.5);
        tiles(r / kSsimTilePx, c / kSsimTilePx) = 1;
      }
    }
  }
  std::pair<S, std::vector<S>> run(Var<S> loss) {
    tape.forward(loss);
    tape.backward(loss);
    return {tape.value(loss).scalar(), test::detail::numbers<S>(tape.gradient(image))};
  }
};

}  // namespace

TEMPLATE_TEST_CASE("the region form gives the bits of the whole form, wherever the region was before", "[parallel]",
                   float, double) {
  RegionScene<TestType> scene;
  struct Place {
    Index row, col, side;
  };
  for (const Place p : {Place{40, 600, 30}, Place{0, 0, 20}, Place{140, 1200, 40}, Place{70, 3, 0}, Place{0, 0, 1210},
                        Place{31, 1000, 2}, Place{40, 600, 30}}) {
    INFO("square of " << p.side << " at " << p.row << "," << p.col);
    scene.place(p.row, p.col, p.side);
    const auto [whole, d_whole] = scene.run(scene.whole);
    const auto [region, d_region] = scene.run(scene.region);
    CHECK(region == whole);
    const ConstArray<TestType> tiles = scene.tape.value(scene.touched);
    bool same = true;
    Index untouched = 0;
    for (Index i = 0; i < scene.shape.count(); ++i) {
      const Index r = i / scene.shape.cols % scene.shape.rows, c = i % scene.shape.cols;
      const TestType d = d_region[static_cast<std::size_t>(i)];
      if (tiles(r / kSsimTilePx, c / kSsimTilePx) != 0) {
        same &= d == d_whole[static_cast<std::size_t>(i)];
      } else if (d == 0) {
        ++untouched;
      } else {
        same &= d == d_whole[static_cast<std::size_t>(i)];
      }
    }
    CHECK(same);
    if (p.side <= 40) CHECK(untouched > scene.shape.count() * 8 / 10);
  }
}

TEST_CASE("the region form sums the base's tiles once, and again when base or target changes") {
  RegionScene<float> scene;
  const auto runs = [&] {
    for (const NodeStatistics& node : scene.tape.statistics()) {
      if (node.name == "ssim_tile_sums") return node.forward_runs;
    }
    return Index(-1);
  };
  for (Index i = 0; i < 5; ++i) {
    scene.place(10 * i, 50 * i, 30);
    scene.tape.forward(scene.region);
  }
  CHECK(runs() == 1);
  const float before = scene.tape.value(scene.region).scalar();
  for (const Var<float> changed : {scene.goal, scene.still}) scene.tape.write(changed)(1, 140, 1000) += 0.5f;
  scene.tape.forward(scene.region);
  CHECK(runs() == 2);
  CHECK(scene.tape.value(scene.region).scalar() != before);
}

TEST_CASE("a constant image costs no gradient") {
  Random random(12);
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

TEST_CASE("steady iterations of d_ssim allocate nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      RegionScene<float> scene;
      const auto iterate = [&](Index i) {
        scene.place(i % 100, 10 * (i % 100), 40);
        for (const Var<float> loss : {scene.whole, scene.region}) {
          scene.tape.forward(loss);
          scene.tape.backward(loss);
        }
      };
      CHECK(steady_allocations([&] {
              for (Index i = 0; i < 20; ++i) iterate(i);
            }) == 0);
    });
  }
}

TEMPLATE_TEST_CASE("every instruction set gives the same result to rounding", "", float, double) {
  Random random(13);
  const Shape shape{1, 45, 101, 112};
  const auto x = random_image<TestType>(shape, random), y = random_image<TestType>(shape, random);
  const Reference expected = reference(x, y);
  const double tolerance = sizeof(TestType) == 4 ? 1e-6 : 1e-14;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    INFO("target " << hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    const Result<TestType> result = compute(x, y);
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
  const auto sums = ssim_tile_sums(c, c);
  CHECK(tape.shape(sums) == Shape{6, 2, 2, 2});
  const auto touched = tape.constant("touched", shape_of(2, 3));
  CHECK_THROWS_WITH(d_ssim_region(a, c, SsimRegion<double>{touched, sums}), Catch::Contains("[2,3] against [2,2]"));
  CHECK_THROWS_WITH(d_ssim_region(a, c, SsimRegion<double>{touched, touched}),
                    Catch::Contains("[2,3] against [6,2,2]"));
  const Image<double> x({3, 20, 30, 32});
  Image<double> map({3, 20, 29, 32});
  CHECK_THROWS_WITH(ssim_map<double>(x.view(), x.view(), map.view()), Catch::Contains("[3,20,29] against [3,20,30]"));
}
