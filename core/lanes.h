// Arithmetic on eight numbers in step, for loops over rows whose numbers follow from each other.
//
// A function template over T that is written with + − · /, comparisons, `?:`, &, | and the functions of this file works
// on one number (T = double) and on eight (T = Lanes<double>), with the same bits for each of them on every instruction
// set. There are no branches on numbers in it: what does not apply is computed too, and left out by `?:`. Call it in
// on_best_isa, so that eight numbers are a register.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "core/types.h"

namespace hsi4d {

inline constexpr Index kLanes = 8;

namespace detail {

template <class S>
struct LaneVector;
template <>
struct LaneVector<float> {
  typedef float Type __attribute__((vector_size(kLanes * sizeof(float))));
};
template <>
struct LaneVector<double> {
  typedef double Type __attribute__((vector_size(kLanes * sizeof(double))));
};

}  // namespace detail

/// Eight numbers.
template <class S>
using Lanes = typename detail::LaneVector<S>::Type;

using WideLanes = Lanes<double>;

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
    for (Index i = 0; i < kLanes; ++i) result[i] = f(x[i]);
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
    for (Index i = 0; i < kLanes; ++i) result[i] = std::fma(a[i], b[i], c[i]);
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
template <class S>
LaneMask<Lanes<S>> first_lanes(Index count) {
  LaneMask<Lanes<S>> result{};
  for (Index i = 0; i < kLanes; ++i) result[i] = i < count ? -1 : 0;
  return result;
}

/// @param mask  of Lanes
template <class M>
bool any_lane(const M& mask) {
  auto any = mask[0];
  for (Index i = 1; i < kLanes; ++i) any |= mask[i];
  return any != 0;
}

/// Σ of the lanes, in a fixed order.
template <class S>
S sum_of_lanes(const Lanes<S>& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

/// The same numbers in another precision.
template <class To, class From>
To convert_lanes(const From& x) {
  return __builtin_convertvector(x, To);
}

/// x rounded to S.
template <class S>
WideLanes rounded_to(const WideLanes& x) {
  return convert_lanes<WideLanes>(convert_lanes<Lanes<S>>(x));
}

/// Numbers of eight rows, `stride` apart; where there are only `count` rows (at least one), the last one again.
template <class S>
Lanes<S> load_lanes(const S* x, Index stride, Index count) {
  Lanes<S> result{};
  if (count >= kLanes && stride == 1) {
    std::memcpy(&result, x, sizeof result);
  } else if (count >= kLanes) {
    for (Index i = 0; i < kLanes; ++i) result[i] = x[i * stride];
  } else {
    for (Index i = 0; i < kLanes; ++i) result[i] = x[std::min(i, count - 1) * stride];
  }
  return result;
}

/// The same, in double.
template <class S>
Lanes<double> load_wide(const S* x, Index stride, Index count) {
  return convert_lanes<Lanes<double>>(load_lanes(x, stride, count));
}

/// Writes the first `count` lanes, rounded to S.
template <class S, class V>
void store_lanes(const V& x, S* to, Index stride, Index count) {
  const Lanes<S> rounded = convert_lanes<Lanes<S>>(x);
  if (count >= kLanes) {
    for (Index i = 0; i < kLanes; ++i) to[i * stride] = rounded[i];
  } else {
    for (Index i = 0; i < count; ++i) to[i * stride] = rounded[i];
  }
}

/// Adds the first `count` lanes, rounded to S.
template <class S, class V>
void add_lanes(const V& x, S* to, Index stride, Index count) {
  const Lanes<S> rounded = convert_lanes<Lanes<S>>(x);
  if (count >= kLanes) {
    for (Index i = 0; i < kLanes; ++i) to[i * stride] += rounded[i];
  } else {
    for (Index i = 0; i < count; ++i) to[i * stride] += rounded[i];
  }
}

}  // namespace hsi4d
