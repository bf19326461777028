// The compiler's flags leave IEEE 754 arithmetic alone. Each of these fails under -ffast-math or one of its parts, or
// (the products and sums) without -ffp-contract=off; cmake/hsi4d_build.cmake says why they matter.
#include <array>
#include <bit>
#include <cfenv>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d::arithmetic_test {
namespace {

/// A value that the compiler knows nothing of.
template <class S>
S opaque(S value) {
  volatile S hidden = value;
  return hidden;
}

/// The bits of a number, so that a comparison does not itself depend on the flags under test.
std::uint32_t bits(float x) { return std::bit_cast<std::uint32_t>(x); }
std::uint64_t bits(double x) { return std::bit_cast<std::uint64_t>(x); }

constexpr int kCount = 32;
template <class S>
using Numbers = std::array<S, kCount>;

/// Numbers whose products need every bit of the significand.
template <class S>
Numbers<S> uneven_numbers(S first, S factor) {
  Numbers<S> numbers{};
  S x = opaque(first);
  for (S& number : numbers) number = (x *= factor);
  return numbers;
}

/// a·b + c in a loop that on_isa compiles with fused multiply-add at hand.
template <class S>
[[gnu::noinline]] Numbers<S> multiply_add(Isa isa, const Numbers<S>& a, const Numbers<S>& b, const Numbers<S>& c) {
  Numbers<S> result{};
  on_isa(isa, [&] {
    for (std::size_t i = 0; i < kCount; ++i) result[i] = a[i] * b[i] + c[i];
  });
  return result;
}

std::vector<Isa> usable_isas() {
  std::vector<Isa> isas;
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa <= best_isa()) isas.push_back(isa);
  }
  return isas;
}

template <class S>
void check_products_are_rounded() {
  const Numbers<S> a = uneven_numbers<S>(S(0.7), S(1.1)), b = uneven_numbers<S>(S(1.3), S(0.93));
  Numbers<S> c{}, rounded{};
  for (std::size_t i = 0; i < kCount; ++i) {
    c[i] = opaque(-a[i] * b[i]);
    rounded[i] = opaque(opaque(a[i] * b[i]) + c[i]);
  }
  for (const Isa isa : usable_isas()) {
    INFO(isa_name(isa));
    const Numbers<S> computed = multiply_add(isa, a, b, c);
    for (std::size_t i = 0; i < kCount; ++i) CHECK(bits(computed[i]) == bits(rounded[i]));
  }
  // The inputs do tell the two apart: with one rounding, a·b − (a·b rounded) is what the rounding lost.
  int differ = 0;
  for (std::size_t i = 0; i < kCount; ++i) differ += std::fma(a[i], b[i], c[i]) != rounded[i];
  CHECK(differ > kCount / 2);
}

/// Σ values with compensation (Kahan): what one addition loses is added to the next.
template <class S>
[[gnu::noinline]] S kahan_sum(const std::vector<S>& values) {
  S sum = 0, lost = 0;
  for (const S value : values) {
    const S y = value - lost;
    const S next = sum + y;
    lost = (next - sum) - y;
    sum = next;
  }
  return sum;
}

template <class S>
S half_of_smallest_normal() {
  return opaque(std::numeric_limits<S>::min()) / opaque(S(2));
}

}  // namespace

TEST_CASE("isfinite and isnan see what is not finite") {
  const double nan = opaque(std::numeric_limits<double>::quiet_NaN());
  const double infinity = opaque(std::numeric_limits<double>::infinity());
  CHECK_FALSE(std::isfinite(nan));
  CHECK_FALSE(std::isfinite(infinity));
  CHECK_FALSE(std::isfinite(-infinity));
  CHECK_FALSE(std::isfinite(infinity - infinity));
  CHECK(std::isfinite(opaque(std::numeric_limits<double>::max())));
  CHECK(std::isnan(nan));
  CHECK_FALSE(std::isnan(infinity));
  CHECK(nan != nan);
  CHECK_FALSE(std::isfinite(opaque(std::numeric_limits<float>::quiet_NaN())));
  CHECK_FALSE(std::isfinite(static_cast<float>(opaque(1e39))));
}

TEST_CASE("a NaN in an array is found by a loop that vectorises") {
  std::vector<float> values(1000, 1.0f);
  values[777] = opaque(std::numeric_limits<float>::quiet_NaN());
  for (const Isa isa : usable_isas()) {
    INFO(isa_name(isa));
    int bad = 0;
    on_isa(isa, [&] {
      for (const float value : values) bad += std::isfinite(value) ? 0 : 1;
    });
    CHECK(bad == 1);
  }
}

TEST_CASE("products are rounded before they are added, on every instruction set") {
  check_products_are_rounded<float>();
  check_products_are_rounded<double>();
}

TEST_CASE("sums keep the order in which they are written") {
  const double tiny = opaque(1e-17), one = opaque(1.0);
  CHECK((one + tiny) - one == 0.0);
  CHECK(one - one + tiny == 1e-17);
  const double huge = opaque(std::numeric_limits<double>::max());
  CHECK_FALSE(std::isfinite((huge + huge) - huge));
}

TEST_CASE("a compensated sum keeps what plain addition loses") {
  // 2²⁴ is the first whole number whose float neighbours are 2 apart: adding 1 to it is lost every time.
  std::vector<float> values(1025, 1.0f);
  values[0] = 16777216.0f;
  float plain = 0;
  for (const float value : values) plain = opaque(plain + value);
  CHECK(plain == 16777216.0f);
  CHECK(kahan_sum(values) == 16777216.0f + 1024.0f);
  CHECK(kahan_sum(std::vector<double>(10, 0.1)) == 1.0);
}

TEST_CASE("denormals survive outside of parallel loops") {
  CHECK(bits(half_of_smallest_normal<float>()) == 0x00400000u);
  CHECK(bits(half_of_smallest_normal<double>()) == 0x0008000000000000u);
  CHECK(bits(opaque(std::numeric_limits<float>::denorm_min()) * opaque(1.0f)) == 1u);
}

TEST_CASE("parallel loops flush denormals on their threads and leave the caller's mode alone", "[parallel]") {
  constexpr Index kChunks = 64;
  std::array<std::uint32_t, kChunks> inside{};
  inside.fill(1);
  parallel_for(kChunks, 1, [&](Index begin, Index) {
    inside[static_cast<std::size_t>(begin)] = bits(half_of_smallest_normal<float>());
  });
#if defined(__x86_64__)
  for (const std::uint32_t value : inside) CHECK(value == 0u);
#endif
  CHECK(bits(half_of_smallest_normal<float>()) == 0x00400000u);
}

TEST_CASE("zeros keep their sign, quotients are divisions, and nothing is computed in excess precision") {
  CHECK(std::signbit(opaque(-0.0) * opaque(1.0)));
  CHECK_FALSE(std::signbit(opaque(-0.0) + opaque(0.0)));
  CHECK(opaque(5.0) / opaque(5.0) == 1.0);
  int inexact = 0;
  for (int i = 1; i < 1000; ++i) {
    const double x = opaque(static_cast<double>(i));
    CHECK(std::fma(x / 49.0, 49.0, -x) == std::fma(opaque(x) / opaque(49.0), 49.0, -x));
    inexact += x * (1.0 / 49.0) != x / 49.0;
  }
  CHECK(inexact > 0);  // so that a reciprocal in place of the division would show
  CHECK(FLT_EVAL_METHOD == 0);
  CHECK(std::fegetround() == FE_TONEAREST);
}

}  // namespace hsi4d::arithmetic_test
