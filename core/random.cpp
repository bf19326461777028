#include "core/random.h"

#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>

#include "core/check.h"

namespace hsi4d {
namespace {

std::uint64_t join(std::uint32_t low, std::uint32_t high) { return low | static_cast<std::uint64_t>(high) << 32; }
std::uint32_t low_word(std::uint64_t x) { return static_cast<std::uint32_t>(x); }
std::uint32_t high_word(std::uint64_t x) { return static_cast<std::uint32_t>(x >> 32); }

/// A multiple of 2⁻⁵³ in [0, 1).
double unit_interval(std::uint64_t bits) { return static_cast<double>(bits >> 11) * 0x1p-53; }

/// a b as (high, low) 64-bit halves, from 32-bit digits.
std::pair<std::uint64_t, std::uint64_t> wide_product(std::uint64_t a, std::uint64_t b) {
  const std::uint64_t a0 = low_word(a), a1 = high_word(a), b0 = low_word(b), b1 = high_word(b);
  const std::uint64_t inner = high_word(a0 * b0) + a1 * b0;  // at most (2³²−1)² + 2³² − 1, which fits
  const std::uint64_t middle = low_word(inner) + a0 * b1;
  return {a1 * b1 + high_word(inner) + high_word(middle), a * b};
}

/// Natural logarithm of a positive normal number, 2 artanh((m − 1)/(m + 1)) + e log 2 with m in [√½, √2). Within 2 ulp
/// on (0, 1]; the platform's own differs between platforms.
double portable_log(double x) {
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(x);
  auto exponent = static_cast<int>(bits >> 52) - 1023;
  auto mantissa = std::bit_cast<double>((bits & 0x000fffffffffffffu) | 0x3ff0000000000000u);
  if (mantissa > std::numbers::sqrt2) mantissa /= 2, ++exponent;
  const double s = (mantissa - 1) / (mantissa + 1);
  const double s2 = s * s;
  double sum = 0;
  for (int k = 23; k >= 3; k -= 2) sum = sum * s2 + 1.0 / k;
  return exponent * std::numbers::ln2 + 2 * (s + s * (s2 * sum));
}

/// (cos, sin) of 2π turns, turns in [0, 1): exact reduction to an eighth of a turn, then Taylor series.
std::pair<double, double> portable_cos_sin(double turns) {
  const double quarter = std::floor(turns * 4 + 0.5);
  const double x = (turns - quarter / 4) * (2 * std::numbers::pi);
  const double x2 = x * x;
  double sine = 1, cosine = 1;
  for (int k = 16; k >= 2; k -= 2) {
    sine = 1 - x2 / (k * (k + 1)) * sine;
    cosine = 1 - x2 / (k * (k - 1)) * cosine;
  }
  sine *= x;
  switch (static_cast<int>(quarter) & 3) {
    case 0:
      return {cosine, sine};
    case 1:
      return {-sine, cosine};
    case 2:
      return {-cosine, -sine};
    default:
      return {sine, -cosine};
  }
}

}  // namespace

PhiloxCounter philox(PhiloxCounter counter, PhiloxKey key) {
  constexpr std::uint64_t kMultiplier0 = 0xD2511F53, kMultiplier1 = 0xCD9E8D57;  // the paper's constants
  constexpr std::uint32_t kStep0 = 0x9E3779B9, kStep1 = 0xBB67AE85;              // golden ratio, √3 − 1
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t p0 = kMultiplier0 * counter[0];
    const std::uint64_t p1 = kMultiplier1 * counter[2];
    counter = {high_word(p1) ^ counter[1] ^ key[0], low_word(p1), high_word(p0) ^ counter[3] ^ key[1], low_word(p0)};
    key = {key[0] + kStep0, key[1] + kStep1};
  }
  return counter;
}

PhiloxCounter Random::block(std::uint64_t index) const {
  return philox({low_word(index), high_word(index), low_word(stream_), high_word(stream_)},
                {low_word(seed_), high_word(seed_)});
}

std::uint64_t Random::bits(std::uint64_t index) const {
  const PhiloxCounter words = block(index);
  return join(words[0], words[1]);
}

template <>
double Random::uniform<double>(std::uint64_t index) const {
  return unit_interval(bits(index));
}

template <>
float Random::uniform<float>(std::uint64_t index) const {
  return static_cast<float>(bits(index) >> 40) * 0x1p-24f;
}

double Random::uniform(std::uint64_t index, double low, double high) const {
  HSI4D_CHECK(low < high && std::isfinite(high - low), detail::both_values(low, high));
  const double u = uniform(index);
  const double value = low + (high - low) * u;
  return value < high ? value : std::nextafter(high, low);  // rounding may reach `high`
}

std::uint64_t Random::below(std::uint64_t index, std::uint64_t count) const {
  HSI4D_CHECK(count > 0, "no integer is below 0");
  const std::uint64_t rejected = (0 - count) % count;  // 2⁶⁴ mod count: this many of the 2⁶⁴ values are too many
  PhiloxCounter words = block(index);
  for (;;) {
    for (const std::uint64_t random : {join(words[0], words[1]), join(words[2], words[3])}) {
      const auto [high, low] = wide_product(random, count);
      if (low >= rejected) return high;
    }
    // Both were rejected: go on from the block itself, a place that no index starts from except by chance.
    words = philox(words, {low_word(seed_), high_word(seed_)});
  }
}

std::pair<double, double> Random::normal_pair(std::uint64_t index) const {
  const PhiloxCounter words = block(index);
  const double positive = unit_interval(join(words[0], words[1])) + 0x1p-53;  // (0, 1], exact
  const double radius = std::sqrt(-2 * portable_log(positive));
  const auto [cosine, sine] = portable_cos_sin(unit_interval(join(words[2], words[3])));
  return {radius * cosine, radius * sine};
}

Vector4<double> Random::rotation(std::uint64_t index) const {
  const PhiloxCounter words = block(index);
  const double share = unit_interval(join(words[0], words[1]));
  const auto [c1, s1] = portable_cos_sin(words[2] * 0x1p-32);
  const auto [c2, s2] = portable_cos_sin(words[3] * 0x1p-32);
  const double first = std::sqrt(1 - share), second = std::sqrt(share);
  return {second * c2, first * s1, first * c1, second * s2};
}

std::vector<Index> Random::permutation(std::uint64_t index, Index count) const {
  HSI4D_CHECK(count >= 0, "count is " + std::to_string(count));
  std::vector<Index> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), Index{0});
  for (std::size_t last = order.size(); last-- > 1; ++index) std::swap(order[last], order[below(index, last + 1)]);
  return order;
}

}  // namespace hsi4d
