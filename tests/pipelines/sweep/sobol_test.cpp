#include "pipelines/sweep/sobol.h"

#include <bit>
#include <set>
#include <vector>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace sobol_test {

using namespace hsi4d;

namespace {

/// Calls `check` with every way to write `sum` as numbers ≥ 0, one a dimension.
template <class Check>
void for_all_splits(int dimensions, int sum, std::vector<int>& split, const Check& check) {
  if (dimensions == 1) {
    split.push_back(sum);
    check(split);
    split.pop_back();
    return;
  }
  for (int first = 0; first <= sum; ++first) {
    split.push_back(first);
    for_all_splits(dimensions - 1, sum - first, split, check);
    split.pop_back();
  }
}

/// True where the 2^m points from `first` on are a (t, m, s)-net in these dimensions: every box of volume 2^(t − m)
/// with sides that are powers of two holds 2^t of them.
bool is_net(int t, int m, const std::vector<int>& dimensions, std::uint32_t first, std::uint32_t shift = 0) {
  bool is_even = true;
  std::vector<int> split;
  for_all_splits(static_cast<int>(dimensions.size()), m - t, split, [&](const std::vector<int>& bits) {
    std::vector<int> counts(std::size_t{1} << (m - t));
    for (std::uint32_t i = 0; i < std::uint32_t{1} << m; ++i) {
      std::size_t box = 0;
      for (std::size_t d = 0; d < dimensions.size(); ++d) {
        const std::uint32_t x = sobol_point(first + i, dimensions[d]) ^ shift * static_cast<std::uint32_t>(d + 1);
        box = (box << bits[d]) | (bits[d] == 0 ? 0 : x >> (32 - bits[d]));
      }
      ++counts[box];
    }
    for (const int count : counts) is_even &= count == 1 << t;
  });
  return is_even;
}

double coordinate(std::uint32_t index, int dimension) { return sobol_point(index, dimension) * 0x1p-32; }

}  // namespace

TEST_CASE("the first points of Sobol's sequence are those in print") {
  // Bratley and Fox 1988 take the points in the order of Gray's code: theirs number n is ours n ^ n / 2.
  const double first[3][4] = {{0.5, 0.5, 0.5, 0.5}, {0.75, 0.25, 0.25, 0.25}, {0.25, 0.75, 0.75, 0.75}};
  for (std::uint32_t n = 1; n <= 3; ++n) {
    for (int d = 0; d < 4; ++d) CHECK(coordinate(n ^ n / 2, d) == first[n - 1][d]);
  }
  for (int d = 0; d < kMostSobolDimensions; ++d) CHECK(sobol_point(0, d) == 0);
  CHECK_THROWS_AS(sobol_point(0, kMostSobolDimensions), InternalError);
  CHECK_THROWS_AS(sobol_point(0, -1), InternalError);
}

TEST_CASE("each of Sobol's dimensions takes every multiple of a power of two once") {
  for (int d = 0; d < kMostSobolDimensions; ++d) {
    INFO("dimension " << d);
    for (const int m : {1, 4, 10}) {
      CHECK(is_net(0, m, {d}, 0));
      CHECK(is_net(0, m, {d}, std::uint32_t{5} << m));
    }
  }
}

TEST_CASE("points of several of Sobol's dimensions are nets, shifted or not") {
  for (const int m : {1, 2, 5, 8}) {
    CHECK(is_net(0, m, {0, 1}, 0));
    CHECK(is_net(0, m, {0, 1}, std::uint32_t{3} << m));
    CHECK(is_net(0, m, {0, 1}, 0, 0x9e3779b9u));
  }
  // The degrees less one of the polynomials are 0, 1 and 2.
  CHECK(is_net(1, 7, {0, 1, 2}, 0));
  CHECK(is_net(3, 8, {0, 1, 2, 3}, 0));
  CHECK(is_net(3, 8, {0, 1, 2, 3}, std::uint32_t{7} << 8, 0x85ebca6bu));
  CHECK_FALSE(is_net(0, 7, {0, 1, 2, 3}, 0));  // so the check can fail
}

TEST_CASE("no two of Sobol's dimensions are alike in 256 points") {
  for (int a = 0; a < kMostSobolDimensions; ++a) {
    for (int b = 0; b < a; ++b) {
      INFO("dimensions " << a << " and " << b);
      std::set<std::pair<std::uint32_t, std::uint32_t>> boxes;  // of 16 by 16
      for (std::uint32_t i = 0; i < 256; ++i) boxes.insert({sobol_point(i, a) >> 28, sobol_point(i, b) >> 28});
      CHECK(boxes.size() >= 64);
    }
  }
}

}  // namespace sobol_test
