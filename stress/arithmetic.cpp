// Rows F5 and F10: the arithmetic itself.
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "autodiff/finite.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "stress/rows.h"

namespace hsi4d::stress {

namespace {

/// A value that the compiler knows nothing of.
template <class S>
S opaque(S value) {
  volatile S hidden = value;
  return hidden;
}

/// Σ values with compensation [Kahan 1965], or what is left of it where sums may be reordered: lost = (next − sum) − y
/// is then 0 by algebra.
float compensated_sum(const std::vector<float>& values, Remedy remedy) {
  float sum = 0, lost = 0;
  for (const float value : values) {
    const float y = value - lost, next = sum + y;
    lost = remedy == Remedy::kOn ? (next - sum) - y : 0;
    sum = next;
  }
  return sum;
}

/// a·b + c over arrays, compiled for an instruction set with fused multiply-add where there is one.
template <class S, std::size_t N>
[[gnu::noinline]] std::array<S, N> multiply_add(Isa isa, const std::array<S, N>& a, const std::array<S, N>& b,
                                                const std::array<S, N>& c, Remedy remedy) {
  std::array<S, N> result{};
  if (remedy == Remedy::kOff && isa != Isa::kBaseline) {  // what contraction makes of it
    for (std::size_t i = 0; i < N; ++i) result[i] = std::fma(a[i], b[i], c[i]);
    return result;
  }
  on_isa(isa, [&] {
    for (std::size_t i = 0; i < N; ++i) result[i] = a[i] * b[i] + c[i];
  });
  return result;
}

/// Results that are not a·b rounded, plus c, rounded, on some instruction set. c is −a·b as rounded, so that a fused
/// product leaves nothing but the difference.
template <class S>
double contracted(Remedy remedy) {
  constexpr std::size_t kCount = 256;
  std::array<S, kCount> a{}, b{}, c{}, rounded{};
  S x = opaque(S(0.7)), y = opaque(S(1.3));
  for (std::size_t i = 0; i < kCount; ++i) {
    a[i] = x *= S(1.01), b[i] = y *= S(0.993);
    c[i] = opaque(-a[i] * b[i]);
    rounded[i] = opaque(opaque(a[i] * b[i]) + c[i]);
  }
  double different = 0;
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa > best_isa() && remedy == Remedy::kOn) continue;
    const std::array<S, kCount> computed = multiply_add(isa, a, b, c, remedy);
    for (std::size_t i = 0; i < kCount; ++i) different += computed[i] == rounded[i] ? 0 : 1;
  }
  return different;
}

/// Rules of arithmetic that one part of fast-math each sets aside, broken in loops compiled for `isa`: sums reordered,
/// quotients by reciprocals, 0·x as 0, −0 as 0, denormals as 0.
double broken_rules(Isa isa, Remedy remedy) {
  constexpr std::size_t kCount = 64;
  std::array<float, kCount> huge{}, third{}, none{}, zero{}, least{}, one{}, sum{}, quotient{}, product{}, sign{},
      half{};
  huge.fill(opaque(1e20f)), third.fill(opaque(3.0f)), none.fill(opaque(std::numeric_limits<float>::quiet_NaN()));
  zero.fill(opaque(-0.0f)), least.fill(opaque(1e-40f)), one.fill(opaque(1.0f));
  for (std::size_t i = 0; i < kCount; ++i) one[i] += static_cast<float>(i);
  const auto usual = [&] {
    for (std::size_t i = 0; i < kCount; ++i) {
      sum[i] = (one[i] + huge[i]) - huge[i];
      quotient[i] = one[i] / third[i];
      product[i] = 0 * none[i];
      sign[i] = zero[i] + 0.0f * zero[i];
      half[i] = least[i] * 0.5f;
    }
  };
  const auto fast = [&] {  // what a compiler may make of it
    const float by_third = 1 / third[0];
    for (std::size_t i = 0; i < kCount; ++i) {
      sum[i] = one[i];
      quotient[i] = one[i] * by_third;
      product[i] = sign[i] = half[i] = 0;
    }
  };
  remedy == Remedy::kOn ? on_isa(isa, usual) : fast();
  double broken = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto exact = static_cast<float>(static_cast<double>(one[i]) / 3.0);
    broken += (sum[i] == 0 ? 0 : 1) + (quotient[i] == exact ? 0 : 1) + (std::isnan(product[i]) ? 0 : 1);
    broken += (std::signbit(sign[i]) ? 0 : 1) + (half[i] > 0 ? 0 : 1);
  }
  return broken;
}

}  // namespace

/// F5: numbers that are none among a thousand, one at a time, and a sum whose order matters; in the flags of this
/// build. Without: the comparisons that fast-math makes of isfinite where no number may be NaN.
std::vector<StressFigure> fast_math(Remedy remedy) {
  constexpr Index kNumbers = 1000;
  double missed = 0;
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::quiet_NaN(),
                          std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()}) {
    for (const Index place : {Index(0), Index(3), Index(777), kNumbers - 1}) {
      std::vector<float> numbers(kNumbers, 1.0f);
      numbers[static_cast<std::size_t>(place)] = opaque(bad);
      bool is_seen = false;
      if (remedy == Remedy::kOn) {
        is_seen = first_non_finite<float>({numbers.data(), shape_of(kNumbers, 1)}) == place;
        Index counted = 0;
        on_best_isa([&] {
          for (const float x : numbers) counted += std::isfinite(x) ? 0 : 1;
        });
        is_seen = is_seen && counted == 1;
      } else {
        constexpr float kMax = std::numeric_limits<float>::max();
        for (const float x : numbers) is_seen = is_seen || x > kMax || x < -kMax;
      }
      missed += is_seen ? 0 : 1;
    }
  }
  // 2²⁴ is the first whole number whose float neighbours are 2 apart: adding 1 to it is lost every time.
  std::vector<float> values(4097, opaque(1.0f));
  values[0] = opaque(16777216.0f);
  const double sum = static_cast<double>(compensated_sum(values, remedy));
  double broken = 0;
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512})
    broken += isa > best_isa() ? 0 : broken_rules(isa, remedy);
  return {{"numbers that are none and are not seen, of 16", missed, 0},
          {"sums, quotients, zeros and denormals against the rules", broken, 0},
          {"of 4096 ones, lost in a compensated sum", std::abs(sum - 16777216.0 - 4096.0), 0}};
}

/// F10
std::vector<StressFigure> contraction(Remedy remedy) {
  return {{"products in float that are not rounded", contracted<float>(remedy), 0},
          {"products in double that are not rounded", contracted<double>(remedy), 0}};
}

}  // namespace hsi4d::stress
