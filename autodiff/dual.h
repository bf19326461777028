// Dual numbers, and the mathematics that lambdas of `map` and `sum_over` may use on plain and dual numbers alike
// (complex_step.h adds complex ones). A lambda that is not in namespace hsi4d says `using namespace hsi4d` or `using
// hsi4d::sqrt`: the functions of <cmath> do not know dual numbers, and std::abs, min, max break them. Constants are
// best floats (0.5f), which serve both precisions.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <type_traits>

namespace hsi4d {

/// Value and K partial derivatives. Comparisons look at the value, so a branch is differentiated where it is taken.
template <class S, int K>
struct Dual {
  S value{};
  std::array<S, K> d{};

  Dual() = default;
  Dual(S v) : value(v) {}  // NOLINT(google-explicit-constructor): constants in formulas
  template <class T>
  requires(std::is_arithmetic_v<T> && !std::same_as<T, S>) Dual(T v)
      : value(static_cast<S>(v)) {}  // NOLINT(google-explicit-constructor)

  /// The k-th variable.
  static Dual variable(S v, int k) {
    Dual x(v);
    x.d[static_cast<std::size_t>(k)] = 1;
    return x;
  }
  /// f(x) from f's value and derivative at x.
  Dual chain(S f, S derivative) const {
    Dual y(f);
    for (std::size_t k = 0; k < K; ++k) y.d[k] = derivative * d[k];
    return y;
  }

  Dual operator-() const { return chain(-value, S(-1)); }
  Dual& operator+=(const Dual& b) { return *this = *this + b; }
  Dual& operator-=(const Dual& b) { return *this = *this - b; }
  Dual& operator*=(const Dual& b) { return *this = *this * b; }
  Dual& operator/=(const Dual& b) { return *this = *this / b; }

  friend Dual operator+(const Dual& a, const Dual& b) {
    Dual y(a.value + b.value);
    for (std::size_t k = 0; k < K; ++k) y.d[k] = a.d[k] + b.d[k];
    return y;
  }
  friend Dual operator-(const Dual& a, const Dual& b) {
    Dual y(a.value - b.value);
    for (std::size_t k = 0; k < K; ++k) y.d[k] = a.d[k] - b.d[k];
    return y;
  }
  friend Dual operator*(const Dual& a, const Dual& b) {
    Dual y(a.value * b.value);
    for (std::size_t k = 0; k < K; ++k) y.d[k] = a.d[k] * b.value + a.value * b.d[k];
    return y;
  }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const S inverse = S(1) / b.value;
    Dual y(a.value * inverse);
    for (std::size_t k = 0; k < K; ++k) y.d[k] = (a.d[k] - y.value * b.d[k]) * inverse;
    return y;
  }
  // With a plain number no partial derivative is touched or multiplied.
  friend Dual operator+(Dual a, S b) { return a.value += b, a; }
  friend Dual operator+(S a, Dual b) { return b.value += a, b; }
  friend Dual operator-(Dual a, S b) { return a.value -= b, a; }
  friend Dual operator-(S a, const Dual& b) { return b.chain(a - b.value, S(-1)); }
  friend Dual operator*(const Dual& a, S b) { return a.chain(a.value * b, b); }
  friend Dual operator*(S a, const Dual& b) { return b.chain(a * b.value, a); }
  friend Dual operator/(const Dual& a, S b) { return a.chain(a.value / b, S(1) / b); }

  friend bool operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  friend bool operator>(const Dual& a, const Dual& b) { return a.value > b.value; }
  friend bool operator<=(const Dual& a, const Dual& b) { return a.value <= b.value; }
  friend bool operator>=(const Dual& a, const Dual& b) { return a.value >= b.value; }
};

/// The number that comparisons look at.
template <std::floating_point T>
T value_of(T x) {
  return x;
}
template <class S, int K>
S value_of(const Dual<S, K>& x) {
  return x.value;
}
/// Numbers that lambdas work on: plain, dual, complex-step.
template <class T>
concept LambdaNumber = requires(const T& x) {
  value_of(x);
};

/// `yes` where the condition holds, else `no`. The branch not taken contributes nothing, not even a NaN.
template <LambdaNumber T>
T select(bool condition, const T& yes, const T& no) {
  return condition ? yes : no;
}
template <class S, int K>
Dual<S, K> select(bool condition, const Dual<S, K>& yes, const Dual<S, K>& no) {
  Dual<S, K> y(condition ? yes.value : no.value);
  for (std::size_t k = 0; k < K; ++k) y.d[k] = condition ? yes.d[k] : no.d[k];
  return y;
}

/// |x|; its derivative at 0 is 0 (row E4 of the stability catalogue).
template <std::floating_point T>
T abs(T x) {
  return std::fabs(x);
}
template <class S, int K>
Dual<S, K> abs(const Dual<S, K>& x) {
  return x.chain(std::fabs(x.value), S(x.value > 0) - S(x.value < 0));
}
/// The larger / smaller; on a tie the first.
template <LambdaNumber T>
T max(const T& a, const std::type_identity_t<T>& b) {
  return select(value_of(b) > value_of(a), b, a);
}
template <LambdaNumber T>
T min(const T& a, const std::type_identity_t<T>& b) {
  return select(value_of(b) < value_of(a), b, a);
}

/// x held within [low, high]; no gradient where it is held.
template <LambdaNumber T, class B>
T clamp(const T& x, B low, B high) {
  return min(max(x, T(low)), T(high));
}

template <LambdaNumber T>
T square(const T& x) {
  return x * x;
}
template <class S, int K>
Dual<S, K> square(const Dual<S, K>& x) {
  return x.chain(x.value * x.value, 2 * x.value);
}

// Elementary functions: the standard ones for plain numbers, and these for dual ones.
using std::cos;
using std::exp;
using std::log;
using std::sin;
using std::sqrt;
using std::tanh;

/// √x; the derivative at 0 is 0, not ∞ (row D5).
template <class S, int K>
Dual<S, K> sqrt(const Dual<S, K>& x) {
  const S root = std::sqrt(x.value);
  return x.chain(root, root > 0 ? S(0.5) / root : S(0));
}
template <class S, int K>
Dual<S, K> exp(const Dual<S, K>& x) {
  const S y = std::exp(x.value);
  return x.chain(y, y);
}
template <class S, int K>
Dual<S, K> log(const Dual<S, K>& x) {
  return x.chain(std::log(x.value), S(1) / x.value);
}
template <class S, int K>
Dual<S, K> sin(const Dual<S, K>& x) {
  return x.chain(std::sin(x.value), std::cos(x.value));
}
template <class S, int K>
Dual<S, K> cos(const Dual<S, K>& x) {
  return x.chain(std::cos(x.value), -std::sin(x.value));
}
template <class S, int K>
Dual<S, K> tanh(const Dual<S, K>& x) {
  const S y = std::tanh(x.value);
  return x.chain(y, (1 - y) * (1 + y));
}

/// log(1 + eˣ) without overflow.
template <std::floating_point T>
T softplus(T x) {
  return std::fmax(x, T(0)) + std::log1p(std::exp(-std::fabs(x)));
}
/// 1 / (1 + e⁻ˣ) without overflow, and its derivative, exact to rounding far into saturation (row B15).
template <std::floating_point T>
T sigmoid(T x) {
  const T e = std::exp(-std::fabs(x));
  return (x >= 0 ? T(1) : e) / (1 + e);
}
template <std::floating_point T>
T sigmoid_derivative(T x) {
  const T e = std::exp(-std::fabs(x));
  return e / ((1 + e) * (1 + e));
}
template <class S, int K>
Dual<S, K> softplus(const Dual<S, K>& x) {
  return x.chain(softplus(x.value), sigmoid(x.value));
}
template <class S, int K>
Dual<S, K> sigmoid(const Dual<S, K>& x) {
  return x.chain(sigmoid(x.value), sigmoid_derivative(x.value));
}

}  // namespace hsi4d
