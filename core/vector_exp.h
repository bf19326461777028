// The exponential function in plain arithmetic without branches, so that loops over it become vector code.
#pragma once

#include <bit>
#include <cstdint>
#include <type_traits>

namespace hsi4d {

/// eˣ, within 2 ulp; exactly 1 at 0; 0 below the smallest normal number's logarithm (the result is flushed), ∞ above
/// the largest's; NaN stays NaN. The same bits on every instruction set.
///
/// x = n ln 2 + r with |r| ≤ ½ ln 2 (ln 2 in two parts, so that n ln 2 is exact in the first), eʳ by its Taylor series,
/// 2ⁿ by two exponents, so that the ends of the range come out right.
template <class S>
inline S vector_exp(S x) {
  static_assert(std::is_same_v<S, float> || std::is_same_v<S, double>);
  constexpr bool kIsFloat = std::is_same_v<S, float>;
  using Bits = std::conditional_t<kIsFloat, std::uint32_t, std::uint64_t>;
  using Signed = std::make_signed_t<Bits>;
  constexpr int kMantissa = kIsFloat ? 23 : 52;
  constexpr Signed kBias = kIsFloat ? 127 : 1023;
  constexpr S kLowest = kIsFloat ? S(-104) : S(-746), kHighest = kIsFloat ? S(89) : S(710);
  constexpr S kRound = S(Bits(3) << (kMantissa - 1));  // 1.5 · 2^mantissa: adding it rounds to a whole number
  constexpr S kLog2E = S(1.44269504088896340736);
  constexpr S kLn2High = kIsFloat ? S(0.693359375) : S(6.93145751953125e-1);
  constexpr S kLn2Low = kIsFloat ? S(-2.12194440e-4) : S(1.42860682030941723212e-6);

  const S held = x < kLowest ? kLowest : (x > kHighest ? kHighest : x);
  const S shifted = held * kLog2E + kRound;
  const S n = shifted - kRound;
  const S r = (held - n * kLn2High) - n * kLn2Low;
  S y;
  if constexpr (kIsFloat) {
    y = S(1.0 / 5040);
  } else {
    y = S(1.0 / 6227020800.0);
    y = y * r + S(1.0 / 479001600);
    y = y * r + S(1.0 / 39916800);
    y = y * r + S(1.0 / 3628800);
    y = y * r + S(1.0 / 362880);
    y = y * r + S(1.0 / 40320);
    y = y * r + S(1.0 / 5040);
  }
  y = y * r + S(1.0 / 720);
  y = y * r + S(1.0 / 120);
  y = y * r + S(1.0 / 24);
  y = y * r + S(1.0 / 6);
  y = y * r + S(1.0 / 2);
  y = y * (r * r) + r + S(1);
  const Signed power = static_cast<Signed>(std::bit_cast<Bits>(shifted) - std::bit_cast<Bits>(kRound));
  const Signed half = power >> 1;
  const S first = std::bit_cast<S>(static_cast<Bits>(half + kBias) << kMantissa);
  const S second = std::bit_cast<S>(static_cast<Bits>(power - half + kBias) << kMantissa);
  return y * first * second;
}

}  // namespace hsi4d
