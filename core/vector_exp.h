// The exponential function in plain arithmetic without branches, so that loops over it become vector code.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <type_traits>

namespace hsi4d {

namespace detail {

/// The numbers of vector_exp, also for code that computes it in vectors of its own.
template <class S>
struct ExpNumbers {
  static_assert(std::is_same_v<S, float> || std::is_same_v<S, double>);
  static constexpr bool kIsFloat = std::is_same_v<S, float>;
  using Bits = std::conditional_t<kIsFloat, std::uint32_t, std::uint64_t>;
  using Signed = std::make_signed_t<Bits>;

  static constexpr int kMantissa = kIsFloat ? 23 : 52;
  static constexpr Signed kBias = kIsFloat ? 127 : 1023;
  static constexpr S kRound = S(Bits(3) << (kMantissa - 1));  ///< 1.5 · 2^mantissa: adding it rounds to a whole number
  static constexpr S kLog2E = S(1.44269504088896340736);
  static constexpr S kLn2High = kIsFloat ? S(0.693359375) : S(6.93145751953125e-1);
  static constexpr S kLn2Low = kIsFloat ? S(-2.12194440e-4) : S(1.42860682030941723212e-6);

  /// 1/n!, from the highest n down to 2.
  static constexpr auto kTaylor = [] {
    constexpr int kHighest = kIsFloat ? 7 : 13;
    std::array<S, kHighest - 1> result{};
    double factorial = 1;
    for (int n = 2; n <= kHighest; ++n) {
      factorial *= n;
      result[static_cast<std::size_t>(kHighest - n)] = S(1 / factorial);
    }
    return result;
  }();
};

}  // namespace detail

/// eˣ, within 2 ulp; exactly 1 at 0; 0 below the smallest normal number's logarithm (the result is flushed), ∞ above
/// the largest's; NaN stays NaN. The same bits on every instruction set.
///
/// x = n ln 2 + r with |r| ≤ ½ ln 2 (ln 2 in two parts, so that n ln 2 is exact in the first), eʳ by its Taylor series,
/// 2ⁿ by two exponents, so that the ends of the range come out right.
template <class S>
inline S vector_exp(S x) {
  using N = detail::ExpNumbers<S>;
  using Bits = typename N::Bits;
  using Signed = typename N::Signed;
  constexpr S kLowest = N::kIsFloat ? S(-104) : S(-746), kHighest = N::kIsFloat ? S(89) : S(710);

  const S held = x < kLowest ? kLowest : (x > kHighest ? kHighest : x);
  const S shifted = held * N::kLog2E + N::kRound;
  const S n = shifted - N::kRound;
  const S r = (held - n * N::kLn2High) - n * N::kLn2Low;
  S y = N::kTaylor[0];
  for (std::size_t k = 1; k < N::kTaylor.size(); ++k) y = y * r + N::kTaylor[k];
  y = y * (r * r) + r + S(1);
  const Signed power = static_cast<Signed>(std::bit_cast<Bits>(shifted) - std::bit_cast<Bits>(N::kRound));
  const Signed half = power >> 1;
  const S first = std::bit_cast<S>(static_cast<Bits>(half + N::kBias) << N::kMantissa);
  const S second = std::bit_cast<S>(static_cast<Bits>(power - half + N::kBias) << N::kMantissa);
  return y * first * second;
}

}  // namespace hsi4d
