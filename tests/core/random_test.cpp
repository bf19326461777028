#include "core/random.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <set>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/rotation.h"

namespace random_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto n = static_cast<double>(a.size());
  double sum_a = 0, sum_b = 0, sum_aa = 0, sum_bb = 0, sum_ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum_a += a[i], sum_b += b[i], sum_aa += a[i] * a[i], sum_bb += b[i] * b[i], sum_ab += a[i] * b[i];
  }
  return (sum_ab - sum_a * sum_b / n) / std::sqrt((sum_aa - sum_a * sum_a / n) * (sum_bb - sum_b * sum_b / n));
}

std::vector<double> draw(const Random& random, std::size_t count, std::uint64_t first = 0) {
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = random.uniform(first + i);
  return values;
}

/// χ² of counts that should all be equal.
double chi_square(const std::vector<double>& counts) {
  double total = 0, sum = 0;
  for (const double c : counts) total += c;
  const double expected = total / static_cast<double>(counts.size());
  for (const double c : counts) sum += (c - expected) * (c - expected) / expected;
  return sum;
}

constexpr std::size_t kMany = 200000;

}  // namespace

TEST_CASE("philox4x32-10 gives the known answers of Random123's kat_vectors") {
  CHECK(philox({0, 0, 0, 0}, {0, 0}) == PhiloxCounter{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
  CHECK(philox({0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}, {0xffffffff, 0xffffffff}) ==
        PhiloxCounter{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
  CHECK(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}) ==
        PhiloxCounter{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});
}

TEST_CASE("seed, stream and index enter the block as the header says") {
  CHECK(Random(0, 0).block(0) == PhiloxCounter{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
  CHECK(Random(0x299f31d0a4093822, 0x0370734413198a2e).block(0x85a308d3243f6a88) ==
        PhiloxCounter{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});
  CHECK(Random(0, 0).bits(0) == 0xe169c58d6627e8d5u);
}

TEST_CASE("the same seed, stream and index give the same number in any order, a sequence follows the indices") {
  const Random random(7, random_stream("noise"));
  const double third = random.uniform(3);
  CHECK(random.uniform(100) != third);
  CHECK(Random(7, random_stream("noise")).uniform(3) == third);
  RandomSequence sequence(7, random_stream("noise"));
  CHECK(sequence.uniform() == random.uniform(0));
  CHECK(sequence.normal() == random.normal(1));
  CHECK(sequence.below(10) == random.below(2, 10));
  CHECK(sequence.uniform<float>() == random.uniform<float>(3));
  CHECK(sequence.rotation() == random.rotation(4));
  CHECK(sequence.uniform(2, 5) == random.uniform(5, 2, 5));
  CHECK(sequence.permutation(8) == random.permutation(6, 8));
  CHECK(sequence.position() == 13);
  CHECK(sequence.bits() == random.bits(13));
  RandomSequence resumed(random, sequence.position());
  CHECK(resumed.uniform() == sequence.uniform());
}

TEST_CASE("a stream's number is FNV-1a of its name") {
  CHECK(random_stream("") == 0xcbf29ce484222325u);
  CHECK(random_stream("a") == 0xaf63dc4c8601ec8cu);  // of the published test vectors
  CHECK(random_stream("foobar") == 0x85944171f73967e8u);
}

TEST_CASE("golden numbers of seed 1, stream 2") {
  // Recorded from this implementation; the tests around check it against known answers and the platform's functions.
  const Random random(1, 2);
  CHECK(random.bits(0) == 0x8cedc5d3e73404cfu);
  CHECK(std::bit_cast<std::uint64_t>(random.uniform(1)) == 0x3feb60960a56f698u);
  CHECK(std::bit_cast<std::uint32_t>(random.uniform<float>(1)) == 0x3f5b04b0u);
  CHECK(random.below(2, 1000) == 353u);
  CHECK(std::bit_cast<std::uint64_t>(random.normal_pair(3).first) == 0xbfb26ab5baedb3ccu);
  CHECK(std::bit_cast<std::uint64_t>(random.normal_pair(3).second) == 0xbff5a597eeeb3486u);
  CHECK(std::bit_cast<std::uint64_t>(random.rotation(4)[0]) == 0x3fdbccc48ec09eb0u);
  CHECK(std::bit_cast<std::uint64_t>(random.rotation(4)[3]) == 0x3fbb46e66fbf1019u);
  CHECK(random.permutation(5, 8) == std::vector<Index>{1, 4, 2, 0, 7, 6, 3, 5});
}

TEST_CASE("uniform numbers: range, moments and flat histogram") {
  const Random random(11);
  double sum = 0, squares = 0, cubes = 0;
  std::vector<double> histogram(100), low_bits(64);
  for (std::size_t i = 0; i < kMany; ++i) {
    const double u = random.uniform(i);
    const float f = random.uniform<float>(i);
    if (!(u >= 0 && u < 1 && f >= 0 && f < 1 && static_cast<double>(f) <= u)) FAIL("out of range at " << i);
    sum += u, squares += u * u, cubes += u * u * u;
    ++histogram[static_cast<std::size_t>(u * 100)];
    ++low_bits[static_cast<std::size_t>(u * 0x1p53) % 64];
  }
  CHECK(sum / kMany == Approx(0.5).margin(0.002));  // 3 standard deviations
  CHECK(squares / kMany == Approx(1.0 / 3).margin(0.002));
  CHECK(cubes / kMany == Approx(0.25).margin(0.002));
  CHECK(chi_square(histogram) < 150);  // 99 degrees of freedom: 99.9 % below 149
  CHECK(chi_square(histogram) > 50);   // nor too even
  CHECK(chi_square(low_bits) < 105);
}

TEST_CASE("neighbouring indices, streams and seeds are uncorrelated") {
  const double bound = 4 / std::sqrt(static_cast<double>(kMany));
  const std::vector<double> base = draw(Random(5, 9), kMany);
  for (const std::uint64_t lag : {1, 2, 3, 64, 1 << 20}) {
    CHECK(std::fabs(correlation(base, draw(Random(5, 9), kMany, lag))) < bound);
  }
  for (const Random& other :
       {Random(5, 10), Random(6, 9), Random(9, 5), Random(5, 9ull << 32), Random(5ull << 32, 9)}) {
    const std::vector<double> values = draw(other, kMany);
    CHECK(std::fabs(correlation(base, values)) < bound);
    CHECK(values[0] != base[0]);
  }
}

TEST_CASE("streams of one seed share no block") {
  std::set<PhiloxCounter> seen;
  for (std::uint64_t stream = 0; stream < 100; ++stream) {
    for (std::uint64_t index = 0; index < 100; ++index) seen.insert(Random(3, stream).block(index));
  }
  CHECK(seen.size() == 10000);
}

TEST_CASE("integers below a count: in range and without modulo bias") {
  const Random random(12);
  for (const std::uint64_t count : {1ull, 2ull, 3ull, 7ull, 1000ull}) {
    std::vector<double> histogram(static_cast<std::size_t>(std::min<std::uint64_t>(count, 7)));
    for (std::size_t i = 0; i < 20000; ++i) {
      const std::uint64_t value = random.below(i, count);
      if (value >= count) FAIL("out of range");
      ++histogram[static_cast<std::size_t>(value * histogram.size() / count)];
    }
    if (count < 1000) CHECK(chi_square(histogram) < 25);
  }
  // ¾ of 2⁶⁴: a plain remainder would give the lower third twice as often; one value in four is rejected.
  const std::uint64_t large = 3ull << 62;
  std::vector<double> thirds(3);
  for (std::size_t i = 0; i < 30000; ++i) ++thirds[static_cast<std::size_t>(random.below(i, large) / (1ull << 62))];
  CHECK(chi_square(thirds) < 14);
  CHECK(random.below(0, ~0ull) < ~0ull);
  // 2⁶³ + 1: half of the values are rejected, so that whole blocks are, and the next one is taken.
  std::vector<double> halves(2);
  for (std::size_t i = 0; i < 30000; ++i) ++halves[static_cast<std::size_t>(random.below(i, (1ull << 63) + 1) >> 62)];
  CHECK(chi_square(halves) < 11);
  CHECK_THROWS_WITH(random.below(0, 0), Contains("no integer is below 0"));
}

TEST_CASE("a range: ends are kept, an empty one is refused") {
  const Random random(13);
  for (std::size_t i = 0; i < 1000; ++i) {
    const double value = random.uniform(i, -2, 3);
    if (!(value >= -2 && value < 3)) FAIL("out of range");
    const double narrow = random.uniform(i, 1, std::nextafter(1.0, 2.0));
    if (narrow != 1) FAIL("reached the excluded end");
  }
  CHECK_THROWS_AS(random.uniform(0, 1, 1), InternalError);
  CHECK_THROWS_WITH(random.uniform(0, 2, 1), Contains("2 against 1"));
  CHECK_THROWS_AS(random.uniform(0, 0, std::numeric_limits<double>::infinity()), InternalError);
}

TEST_CASE("normal numbers: moments, tails, independence, and Box and Muller by the platform's functions") {
  const Random random(14);
  std::vector<double> first, second;
  double worst = 0, fourth = 0;
  int beyond_two = 0;
  for (std::size_t i = 0; i < kMany; ++i) {
    const auto [a, b] = random.normal_pair(i);
    first.push_back(a);
    second.push_back(b);
    fourth += a * a * a * a;
    beyond_two += std::fabs(b) > 2;
    const PhiloxCounter w = random.block(i);
    const auto unit = [](std::uint32_t low, std::uint32_t high) {
      return static_cast<double>((low | static_cast<std::uint64_t>(high) << 32) >> 11) * 0x1p-53;
    };
    const double radius = std::sqrt(-2 * std::log(unit(w[0], w[1]) + 0x1p-53));
    const double angle = 2 * std::acos(-1.0) * unit(w[2], w[3]);
    worst = std::fmax(worst, std::hypot(a - radius * std::cos(angle), b - radius * std::sin(angle)));
  }
  CHECK(worst < 8e-15);
  double mean = 0, variance = 0;
  for (const double a : first) mean += a / kMany;
  for (const double a : first) variance += (a - mean) * (a - mean) / kMany;
  CHECK(mean == Approx(0).margin(0.007));
  CHECK(variance == Approx(1).margin(0.01));
  CHECK(fourth / kMany == Approx(3).margin(0.07));
  CHECK(beyond_two / static_cast<double>(kMany) == Approx(0.0455).margin(0.0015));
  CHECK(std::fabs(correlation(first, second)) < 0.009);
}

TEST_CASE("random rotations are unit quaternions, uniform over all rotations") {
  const Random random(15);
  Matrix3<double> mean = Matrix3<double>::Zero();
  std::vector<double> histogram(20);
  constexpr int kCount = 50000;
  for (int i = 0; i < kCount; ++i) {
    const Vector4<double> q = random.rotation(static_cast<std::uint64_t>(i));
    if (std::fabs(q.norm() - 1) > 1e-15) FAIL("not a unit quaternion");
    mean += quaternion_to_matrix(q) / kCount;
    // The angle t of a uniform rotation has the distribution (t − sin t)/π.
    const double angle = quaternion_log(q).norm();
    const double quantile = (angle - std::sin(angle)) / std::acos(-1.0);
    ++histogram[static_cast<std::size_t>(std::min(quantile * 20, 19.0))];
  }
  CHECK(mean.cwiseAbs().maxCoeff() < 0.012);
  CHECK(chi_square(histogram) < 44);
}

TEST_CASE("permutations hold every number once and are all equally likely") {
  const Random random(16);
  std::vector<double> counts(24);
  for (std::uint64_t i = 0; i < 24000; ++i) {
    const std::vector<Index> order = random.permutation(3 * i, 4);
    std::vector<Index> identity{0, 1, 2, 3};
    std::size_t rank = 0;
    while (identity != order) {
      std::next_permutation(identity.begin(), identity.end());
      ++rank;
    }
    ++counts[rank];
  }
  CHECK(chi_square(counts) < 50);
  CHECK(random.permutation(0, 0).empty());
  CHECK(random.permutation(0, 1) == std::vector<Index>{0});
  CHECK_THROWS_WITH(random.permutation(0, -1), Contains("count is -1"));
}

}  // namespace random_test
