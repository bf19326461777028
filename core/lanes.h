// Arithmetic on eight or four numbers in step, for loops over rows whose numbers follow from each other.
//
// A function template over T that is written with + − · /, comparisons, `?:`, &, | and the functions of this file works
// on one number (T = double) and on eight (T = Lanes<double>), with the same bits for each of them on every instruction
// set. There are no branches on numbers in it: what does not apply is computed too, and left out by `?:`. Call it in
// on_best_isa, so that eight numbers are a register; where these are doubles and time counts, in with_best_lanes of
// core/simd.h, which says how many are: GCC makes slow code of vectors that are longer than a register.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

#include "core/types.h"

namespace hsi4d {

inline constexpr Index kLanes = 8;

namespace detail {

template <class S, Index kCount>
struct LaneVector {
  typedef S Type __attribute__((vector_size(kCount * sizeof(S))));
};

}  // namespace detail

/// Eight numbers, or fewer.
template <class S, Index kCount = kLanes>
using Lanes = typename detail::LaneVector<S, kCount>::Type;

/// How many V has: lanes, or what comparing them gives.
template <class V>
inline constexpr Index kLanesOf = sizeof(V) / sizeof(std::declval<V>()[0]);

using WideLanes = Lanes<double>;

/// So many doubles.
template <Index kCount>
using DoubleLanes = Lanes<double, kCount>;

/// What comparing two T gives: a bool, or one for each lane.
template <class T>
using LaneMask = decltype(T() < T());

/// x in every lane.
template <class T>
T lane_constant(double x) {
  if constexpr (std::is_constructible_v<T, double>) {
    return T(x);
  } else {
    return T{} + static_cast<std::decay_t<decltype(T{}[0])>>(x);
  }
}

/// f of a number or of each lane.
template <class T, class F>
T each_lane(const T& x, const F& f) {
  if constexpr (std::is_floating_point_v<T>) {
    return f(x);
  } else {
    T result{};
    for (Index i = 0; i < kLanesOf<T>; ++i) result[i] = f(x[i]);
    return result;
  }
}

template <class T>
T lane_sqrt(const T& x) {
  return each_lane(x, [](auto v) { return std::sqrt(v); });
}

template <class T>
T lane_abs(const T& x) {
  return each_lane(x, [](auto v) { return std::fabs(v); });
}

/// a b + c, rounded once.
template <class T>
T lane_fma(const T& a, const T& b, const T& c) {
  if constexpr (std::is_floating_point_v<T>) {
    return std::fma(a, b, c);
  } else {
    T result{};
    for (Index i = 0; i < kLanesOf<T>; ++i) result[i] = std::fma(a[i], b[i], c[i]);
    return result;
  }
}

/// The larger one; b may be one number for all lanes. A NaN in a gives b.
template <class T, class U>
T lane_max(const T& a, const U& b) {
  return a > b ? a : b;
}

/// Neither infinite nor NaN: for those x − x is NaN.
template <class T>
LaneMask<T> lane_finite(const T& x) {
  const T none = x - x;
  return none == none;
}

/// True in the first `count` lanes.
template <class S, Index kCount = kLanes>
LaneMask<Lanes<S, kCount>> first_lanes(Index count) {
  LaneMask<Lanes<S, kCount>> result{};
  for (Index i = 0; i < kCount; ++i) result[i] = i < count ? -1 : 0;
  return result;
}

/// @param mask  of Lanes
template <class M>
bool any_lane(const M& mask) {
  auto any = mask[0];
  for (Index i = 1; i < kLanesOf<M>; ++i) any |= mask[i];
  return any != 0;
}

/// Σ of the lanes, in a fixed order.
template <class S>
S sum_of_lanes(const Lanes<S>& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

/// A sum over rows that come in lanes, from row 0 on: with the same bits for four lanes at a time as for eight.
class RowSum {
 public:
  /// @param row  of the first lane, a multiple of their number
  template <class V>
  void add(Index row, const V& x) {
    V sum;
    double* const to = lanes_ + row % kLanes;
    std::memcpy(&sum, to, sizeof sum);
    sum = sum + x;
    std::memcpy(to, &sum, sizeof sum);
  }
  double total() const {
    Lanes<double> all;
    std::memcpy(&all, lanes_, sizeof all);
    return sum_of_lanes<double>(all);
  }

 private:
  alignas(sizeof(Lanes<double>)) double lanes_[kLanes] = {};
};

/// The same numbers in another precision.
template <class To, class From>
To convert_lanes(const From& x) {
  return __builtin_convertvector(x, To);
}

/// x, which are doubles, rounded to S.
template <class S, class V>
V rounded_to(const V& x) {
  return convert_lanes<V>(convert_lanes<Lanes<S, kLanesOf<V>>>(x));
}

/// Numbers of as many rows as there are lanes, `stride` apart; where there are only `count` rows (at least one), the
/// last one again.
template <Index kCount = kLanes, class S>
Lanes<S, kCount> load_lanes(const S* x, Index stride, Index count) {
  Lanes<S, kCount> result{};
  if (count >= kCount && stride == 1) {
    std::memcpy(&result, x, sizeof result);
  } else if (count >= kCount) {
    for (Index i = 0; i < kCount; ++i) result[i] = x[i * stride];
  } else {
    for (Index i = 0; i < kCount; ++i) result[i] = x[std::min(i, count - 1) * stride];
  }
  return result;
}

/// The same, in double.
template <Index kCount = kLanes, class S>
DoubleLanes<kCount> load_wide(const S* x, Index stride, Index count) {
  return convert_lanes<DoubleLanes<kCount>>(load_lanes<kCount>(x, stride, count));
}

/// Writes the first `count` lanes, rounded to S.
template <class S, class V>
void store_lanes(const V& x, S* to, Index stride, Index count) {
  constexpr Index kCount = kLanesOf<V>;
  const Lanes<S, kCount> rounded = convert_lanes<Lanes<S, kCount>>(x);
  if (count >= kCount) {
    for (Index i = 0; i < kCount; ++i) to[i * stride] = rounded[i];
  } else {
    for (Index i = 0; i < count; ++i) to[i * stride] = rounded[i];
  }
}

/// Adds the first `count` lanes, rounded to S.
template <class S, class V>
void add_lanes(const V& x, S* to, Index stride, Index count) {
  constexpr Index kCount = kLanesOf<V>;
  const Lanes<S, kCount> rounded = convert_lanes<Lanes<S, kCount>>(x);
  if (count >= kCount) {
    for (Index i = 0; i < kCount; ++i) to[i * stride] += rounded[i];
  } else {
    for (Index i = 0; i < count; ++i) to[i * stride] += rounded[i];
  }
}

}  // namespace hsi4d
