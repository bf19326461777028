// Stumpff functions: the coefficients of rotations as functions of the squared angle.
//
//   c_k(x) = Σ_j (−x)^j / (2j + k)!
//
//   c0 = cos t    c1 = sin t / t    c2 = (1 − cos t)/t²    c3 = (t − sin t)/t³    with x = t²
//
// They are smooth in x, so nothing is special at t = 0; the derivative of each is a combination of the next two,
//
//   c_k'(x) = (k c_{k+2} − c_{k+1}) / 2,
//
// and c_k = 1/k! − x c_{k+2}. [Stiefel and Scheifele 1971, Linear and Regular Celestial Mechanics, section 11]
// The textbook quotients above cancel for small t (rows C1-C4 of the stability catalogue, table M5). Three branches
// avoid it: the series below kStumpffSeries, doubling of the angle below kStumpffDouble by formulas whose terms all
// have one sign while half the angle is below π,
//
//   4 c3(4x) = c3 + c1 c2        8 c4(4x) = c3 (1 + c1)        16 c5(4x) = c5 + c4 + c3 c2,
//
// and the quotients above that, where they no longer cancel.
#pragma once

#include <array>
#include <cmath>

#include "core/linear.h"

namespace hsi4d {

/// c1 … c5 at one x.
template <class S>
struct Stumpff {
  S c1, c2, c3, c4, c5;

  /// Derivatives with respect to x.
  S d_c1() const { return (c3 - c2) / S(2); }
  S d_c2() const { return c4 - c3 / S(2); }
  S d_c3() const { return (S(3) * c5 - c4) / S(2); }
};

/// Below this x (t < 0.5) c1 and c2 come from c3 and c4, above from sines.
inline constexpr double kStumpffSines = 0.25;
/// Below this x (t < 2) c3, c4 and c5 are series.
inline constexpr double kStumpffSeries = 4;
/// Below this x (t < 4.2) c3, c4 and c5 are made from those of half the angle.
inline constexpr double kStumpffDouble = 18;

namespace detail {

inline constexpr int kStumpffTerms = 12;  // the first term left out is below 1e-17 of the sum for x ≤ 8

/// 1/n! for n ≤ 29.
inline constexpr auto kInverseFactorial = [] {
  std::array<double, 30> table{1.0};
  double factorial = 1;  // exact to 22!, rounded once a step after it
  for (int n = 1; n < 30; ++n) {
    factorial *= n;
    table[static_cast<std::size_t>(n)] = 1 / factorial;
  }
  return table;
}();

template <class S>
S inverse_factorial(int n) {
  return S(static_cast<Real<S>>(kInverseFactorial[static_cast<std::size_t>(n)]));
}

template <int K, class S>
S stumpff_series(const S& x) {
  S sum = inverse_factorial<S>(K + 2 * (kStumpffTerms - 1));
  for (int j = kStumpffTerms - 2; j >= 0; --j) sum = inverse_factorial<S>(K + 2 * j) - x * sum;
  return sum;
}

template <class S>
Stumpff<S> stumpff_from_sines(const S& x) {
  using std::sin;
  using std::sqrt;
  const S t = sqrt(x);
  const S chord = sin(t / S(2)) / t;
  return {sin(t) / t, S(2) * chord * chord, S(0), S(0), S(0)};
}

/// c3, c4, c5 by their quotients.
template <class S>
void add_quotients(const S& x, Stumpff<S>& c) {
  c.c3 = (S(1) - c.c1) / x;
  c.c4 = (S(0.5) - c.c2) / x;
  c.c5 = (inverse_factorial<S>(3) - c.c3) / x;
}

/// c3, c4, c5 at 4x from all at x.
template <class S>
void add_doubled(const Stumpff<S>& half, Stumpff<S>& c) {
  c.c3 = (half.c3 + half.c1 * half.c2) / S(4);
  c.c4 = half.c3 * (S(1) + half.c1) / S(8);
  c.c5 = (half.c5 + half.c4 + half.c3 * half.c2) / S(16);
}

}  // namespace detail

/// c1 and c2 alone (the others are left 0): all that the value of a rotation needs.
///
/// @param x  squared angle in radians², ≥ 0
/// @return   c1 within 5 ulp for t ≤ 2.5, c2 for t ≤ π; up to their zeros (π, 2π) within a ulp of c1(0) = 1, c2(0) = ½
template <class S>
Stumpff<S> stumpff_12(const S& x) {
  if (!(detail::real_part(x) < kStumpffSines)) return detail::stumpff_from_sines(x);
  return {S(1) - x * detail::stumpff_series<3>(x), S(0.5) - x * detail::stumpff_series<4>(x), S(0), S(0), S(0)};
}

/// c1 … c5.
///
/// @param x  squared angle in radians², ≥ 0
/// @return   c3, c4, c5 within 5 ulp up to a whole turn, c1 and c2 as stumpff_12 (docs/numerics/functions.md)
/// Derivatives with respect to x: d_c1(), d_c2(), d_c3() of the result.
template <class S>
Stumpff<S> stumpff(const S& x) {
  Stumpff<S> c = stumpff_12(x);
  if (detail::real_part(x) < kStumpffSeries) {
    c.c3 = detail::stumpff_series<3>(x);
    c.c4 = detail::stumpff_series<4>(x);
    c.c5 = detail::stumpff_series<5>(x);
  } else if (detail::real_part(x) < kStumpffDouble) {
    detail::add_doubled(stumpff(S(x / S(4))), c);
  } else {
    detail::add_quotients(x, c);
  }
  return c;
}

}  // namespace hsi4d
