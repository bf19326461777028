#include "core/lanes.h"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "core/simd.h"

namespace lanes_test {

using namespace hsi4d;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Numbers of all kinds, a whole number of lanes.
template <class S>
std::vector<S> nasty_numbers() {
  using Limits = std::numeric_limits<S>;
  std::vector<S> numbers = {S(0),          S(-0.0),           S(1),          S(-1),
                            S(kInfinity),  S(-kInfinity),     S(kNan),       Limits::max(),
                            Limits::min(), Limits::lowest(),  S(0.1),        S(-1e30),
                            S(1e-30),      Limits::epsilon(), S(1) / S(3.0), -Limits::min()};
  const Random random(7);
  for (std::uint64_t i = numbers.size(); i < 256; ++i) {
    numbers.push_back(static_cast<S>(random.normal(2 * i) * std::exp(10 * random.normal(2 * i + 1))));
  }
  return numbers;
}

template <class S>
bool same(S a, S b) {
  return std::isnan(a) ? std::isnan(b) : std::memcmp(&a, &b, sizeof a) == 0;
}

/// Numbers of what f makes of kCount numbers and of each of them alone that differ.
template <class S, Index kCount, class F>
int different_of(const F& f) {
  const std::vector<S> x = nasty_numbers<S>();
  int count = 0;
  on_best_isa([&] {
    for (std::size_t i = 0; i + 3 * kCount <= x.size(); ++i) {
      const auto load = [&](std::size_t at) { return load_lanes<kCount>(&x[at], 1, kCount); };
      const Lanes<S, kCount> all = f(load(i), load(i + kCount), load(i + 2 * kCount));
      for (std::size_t k = 0; k < kCount; ++k) {
        count += same<S>(all[k], f(x[i + k], x[i + k + kCount], x[i + k + 2 * kCount])) ? 0 : 1;
      }
    }
  });
  return count;
}

/// Of eight numbers and of four.
template <class S, class F>
int different(const F& f) {
  return different_of<S, kLanes>(f) + different_of<S, 4>(f);
}

template <class S>
void check_lanes_are_numbers() {
  CHECK(different<S>([](auto a, auto, auto) { return lane_sqrt(lane_abs(a)); }) == 0);
  CHECK(different<S>([](auto a, auto b, auto c) { return lane_fma(a, b, c); }) == 0);
  CHECK(different<S>([](auto a, auto b, auto) { return lane_max(a, b); }) == 0);
  CHECK(different<S>([](auto a, auto, auto) { return lane_max(a, S(0.5)); }) == 0);
  CHECK(different<S>([](auto a, auto b, auto c) { return lane_finite(a) ? b : c; }) == 0);
  CHECK(different<S>([](auto a, auto, auto) { return a * lane_constant<decltype(a)>(3); }) == 0);
  CHECK(different<S>([](auto a, auto b, auto c) { return (a - b) / c + a * b; }) == 0);
  CHECK(different<S>([](auto a, auto b, auto c) { return (a < b) & (b != c) ? -a : b; }) == 0);
}

}  // namespace

TEST_CASE("eight numbers in step, and four, have the bits of each alone") {
  check_lanes_are_numbers<float>();
  check_lanes_are_numbers<double>();
}

TEST_CASE("lanes are finite where numbers are") {
  for (const double x : {kInfinity, -kInfinity, kNan}) CHECK_FALSE(lane_finite(x));
  for (const double x : {0.0, -1e308, 1e308, 5e-324}) CHECK(lane_finite(x));
  CHECK(lane_finite(std::numeric_limits<float>::max()));
  CHECK_FALSE(lane_finite(static_cast<float>(kInfinity)));
}

TEST_CASE("lane_max gives its second number for a NaN") {
  CHECK(lane_max(kNan, 2.0) == 2);
  CHECK(std::isnan(lane_max(2.0, kNan)));
}

TEST_CASE("lanes are loaded, stored and added with a stride, the last ones in part") {
  std::array<float, 40> from;
  for (std::size_t i = 0; i < from.size(); ++i) from[i] = static_cast<float>(i) + 0.25f;
  for (const Index stride : {1, 3, 5}) {
    for (Index count = 1; count <= kLanes + 2; ++count) {
      const Index rows = std::min(count, kLanes);
      const Lanes<float> x = load_lanes(from.data(), stride, count);
      const WideLanes wide = load_wide(from.data(), stride, count);
      std::array<float, 40> to{}, sum;
      sum.fill(1);
      store_lanes<float>(x, to.data(), stride, count);
      add_lanes<float>(wide, sum.data(), stride, count);
      for (Index i = 0; i < kLanes; ++i) {
        const float wanted = from[static_cast<std::size_t>(std::min(i, rows - 1) * stride)];
        CHECK(x[i] == wanted);
        CHECK(wide[i] == static_cast<double>(wanted));
      }
      for (Index i = 0; i < 40; ++i) {
        const bool touched = i % stride == 0 && i / stride < rows;
        const std::size_t at = static_cast<std::size_t>(i);
        CHECK(to[at] == (touched ? from[at] : 0.0f));
        CHECK(sum[at] == (touched ? from[at] + 1 : 1.0f));
      }
    }
  }
}

TEST_CASE("what is stored is rounded once") {
  const double third = 1.0 / 3;
  const WideLanes x = lane_constant<WideLanes>(1) / 3.0;
  std::array<float, 8> single{};
  std::array<double, 8> whole{};
  store_lanes<float>(x, single.data(), 1, kLanes);
  store_lanes<double>(x, whole.data(), 1, kLanes);
  CHECK(single[7] == static_cast<float>(third));
  CHECK(whole[7] == third);
  CHECK(rounded_to<float>(x)[3] == static_cast<double>(static_cast<float>(third)));
  CHECK(rounded_to<double>(x)[3] == third);
}

TEST_CASE("rows in fours have the sum of rows in eights, to the bit") {
  const Random random(11);
  std::array<double, 40> x;
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::exp(20 * random.normal(i));
  RowSum fours, eights;
  for (Index row = 0; row < 40; row += 4) fours.add(row, load_wide<4>(&x[static_cast<std::size_t>(row)], 1, 4));
  for (Index row = 0; row < 40; row += 8) eights.add(row, load_wide(&x[static_cast<std::size_t>(row)], 1, 8));
  CHECK(fours.total() == eights.total());
  double sum = 0;
  for (const double number : x) sum += number;
  CHECK(eights.total() == Approx(sum).epsilon(1e-12));
}

TEST_CASE("with_best_lanes tells as many doubles as a register has") {
  Index count = 0;
  with_best_lanes([&](auto lanes) { count = lanes(); });
  CHECK(count == (best_isa() == Isa::kAvx512 ? 8 : 4));
}

TEST_CASE("lanes are chosen, looked at and summed") {
  WideLanes x{};
  for (Index i = 0; i < kLanes; ++i) x[i] = static_cast<double>(1 << i);
  for (Index count = 0; count <= kLanes; ++count) {
    const LaneMask<WideLanes> some = first_lanes<double>(count);
    CHECK(any_lane(some) == (count > 0));
    CHECK(sum_of_lanes<double>(some ? x : WideLanes{}) == static_cast<double>((1 << count) - 1));
  }
  CHECK_FALSE(any_lane(LaneMask<WideLanes>{}));
  CHECK(any_lane(x == 128.0));
}

}  // namespace lanes_test
