// Dual numbers, and the mathematics that lambdas of `map` and `sum_over` may use on plain and dual numbers alike
// (complex_step.h adds complex ones). A lambda that is not in namespace hsi4d says `using namespace hsi4d` or `using
// hsi4d::sqrt`: the functions of <cmath> do not know dual numbers, and std::abs, min, max break them. Constants are
// best floats (0.5f), which serve both precisions.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <type_traits>
#include <utility>

#include "core/vector_exp.h"

namespace hsi4d {

/// Value and partial derivatives with respect to some of up to 32 variables: those whose bits are set in Mask. What an
/// expression does not depend on is known when it is compiled and costs nothing; nor does a zero ever meet an infinity.
/// Comparisons look at the value, so a branch is differentiated where it is taken.
///
/// The partial derivatives are factor · d: a function of one argument multiplies one number, however many there are.
template <class S, unsigned Mask>
struct Dual {
  static constexpr std::size_t kPartials = std::popcount(Mask);
  S value{};
  std::array<S, kPartials> d{};
  S factor = 1;

  /// True when there is a partial derivative with respect to variable k.
  static constexpr bool depends_on(std::size_t k) { return (Mask >> k & 1u) != 0; }
  /// Partial derivative with respect to variable k, which must be in the mask.
  S partial(std::size_t k) const { return factor * d[slot(k)]; }
  static constexpr std::size_t slot(std::size_t k) {
    return static_cast<std::size_t>(std::popcount(Mask & ((1u << k) - 1u)));
  }

  /// f(x) from f's value and derivative at x.
  Dual chain(S f, S derivative) const { return {f, d, derivative * factor}; }

  Dual operator-() const { return {-value, d, -factor}; }
  // An accumulator can only take what depends on no other variables; else write `auto sum = a + b;`.
  template <class B>
  Dual& operator+=(const B& b) {
    return *this = *this + b;
  }
  template <class B>
  Dual& operator-=(const B& b) {
    return *this = *this - b;
  }
  template <class B>
  Dual& operator*=(const B& b) {
    return *this = *this * b;
  }
  template <class B>
  Dual& operator/=(const B& b) {
    return *this = *this / b;
  }

  // With a plain number.
  friend Dual operator+(Dual a, S b) { return a.value += b, a; }
  friend Dual operator+(S a, Dual b) { return b.value = a + b.value, b; }
  friend Dual operator-(Dual a, S b) { return a.value -= b, a; }
  friend Dual operator-(S a, const Dual& b) {
    Dual y = -b;
    y.value = a - b.value;
    return y;
  }
  friend Dual operator*(const Dual& a, S b) { return a.chain(a.value * b, b); }
  friend Dual operator*(S a, const Dual& b) { return b.chain(a * b.value, a); }
  friend Dual operator/(const Dual& a, S b) { return a.chain(a.value / b, S(1) / b); }
  friend Dual operator/(S a, const Dual& b) {
    const S y = a / b.value;
    return b.chain(y, -y / b.value);
  }
};

/// The variable of number k.
template <std::size_t k, class S>
Dual<S, (1u << k)> dual_variable(S value) {
  return {value, {S(1)}};
}

namespace detail {

/// A dual number of value `value` over the variables of a and b, each partial derivative from those of a and b: `both`
/// where there are two, `left` or `right` where there is one.
template <class S, unsigned A, unsigned B, class Both, class Left, class Right>
Dual<S, (A | B)> combine(S value, const Dual<S, A>& a, const Dual<S, B>& b, const Both& both, const Left& left,
                         const Right& right) {
  Dual<S, (A | B)> y{value, {}};
  [&]<std::size_t... k>(std::index_sequence<k...>) {
    const auto one = [&]<std::size_t i>(std::integral_constant<std::size_t, i>) {
      if constexpr (Dual<S, A>::depends_on(i) && Dual<S, B>::depends_on(i)) {
        y.d[y.slot(i)] = both(a.d[a.slot(i)], b.d[b.slot(i)]);
      } else if constexpr (Dual<S, A>::depends_on(i)) {
        y.d[y.slot(i)] = left(a.d[a.slot(i)]);
      } else if constexpr (Dual<S, B>::depends_on(i)) {
        y.d[y.slot(i)] = right(b.d[b.slot(i)]);
      }
    };
    (one(std::integral_constant<std::size_t, k>()), ...);
  }
  (std::make_index_sequence<std::bit_width(A | B)>());
  return y;
}

/// f(a, b) from its value and its two derivatives.
template <class S, unsigned A, unsigned B>
Dual<S, (A | B)> chain(S f, const Dual<S, A>& a, S f_a, const Dual<S, B>& b, S f_b) {
  const S u = f_a * a.factor, v = f_b * b.factor;
  return combine(
      f, a, b, [=](S x, S y) { return u * x + v * y; }, [=](S x) { return u * x; }, [=](S y) { return v * y; });
}

}  // namespace detail

template <class S, unsigned A, unsigned B>
auto operator+(const Dual<S, A>& a, const Dual<S, B>& b) {
  return detail::chain(a.value + b.value, a, S(1), b, S(1));
}
template <class S, unsigned A, unsigned B>
auto operator-(const Dual<S, A>& a, const Dual<S, B>& b) {
  return detail::chain(a.value - b.value, a, S(1), b, S(-1));
}
template <class S, unsigned A, unsigned B>
auto operator*(const Dual<S, A>& a, const Dual<S, B>& b) {
  return detail::chain(a.value * b.value, a, b.value, b, a.value);
}
template <class S, unsigned A, unsigned B>
auto operator/(const Dual<S, A>& a, const Dual<S, B>& b) {
  // (d_a − ratio d_b) / b: the division goes into the common factor.
  const S ratio = a.value / b.value;
  auto y = detail::chain(ratio, a, S(1), b, -ratio);
  y.factor = S(1) / b.value;
  return y;
}

/// The number that comparisons look at.
template <std::floating_point T>
T value_of(T x) {
  return x;
}
template <class S, unsigned A>
S value_of(const Dual<S, A>& x) {
  return x.value;
}

/// Numbers that lambdas work on: plain, dual, complex-step.
template <class T>
concept LambdaNumber = requires(const T& x) {
  value_of(x);
};

template <class T>
concept IsDual = requires {
  T::kPartials;
};

/// At least one of two is a dual number; the other may be a plain one.
template <class A, class B>
concept DualOperands = (IsDual<A> && (IsDual<B> || std::is_arithmetic_v<B>)) || (std::is_arithmetic_v<A> && IsDual<B>);

template <class A, class B>
requires DualOperands<A, B>
bool operator<(const A& a, const B& b) { return value_of(a) < value_of(b); }
template <class A, class B>
requires DualOperands<A, B>
bool operator>(const A& a, const B& b) { return value_of(a) > value_of(b); }
template <class A, class B>
requires DualOperands<A, B>
bool operator<=(const A& a, const B& b) { return value_of(a) <= value_of(b); }
template <class A, class B>
requires DualOperands<A, B>
bool operator>=(const A& a, const B& b) { return value_of(a) >= value_of(b); }

/// `yes` where the condition holds, else `no`. The branch not taken contributes nothing, not even a NaN.
template <class A, class B>
requires(!IsDual<A> && !IsDual<B>) auto select(bool condition, const A& yes, const B& no) -> std::common_type_t<A, B> {
  return condition ? yes : no;
}
template <class S, unsigned A, unsigned B>
Dual<S, (A | B)> select(bool condition, const Dual<S, A>& yes, const Dual<S, B>& no) {
  const S u = yes.factor, v = no.factor;
  return detail::combine(
      condition ? yes.value : no.value, yes, no, [=](S x, S y) { return condition ? u * x : v * y; },
      [=](S x) { return condition ? u * x : S(0); }, [=](S y) { return condition ? S(0) : v * y; });
}
template <class S, unsigned A>
Dual<S, A> select(bool condition, const Dual<S, A>& yes, std::type_identity_t<S> no) {
  return select(condition, yes, Dual<S, 0>{no, {}});
}
template <class S, unsigned B>
Dual<S, B> select(bool condition, std::type_identity_t<S> yes, const Dual<S, B>& no) {
  return select(condition, Dual<S, 0>{yes, {}}, no);
}

/// |x|; its derivative at 0 is 0 (row E4: |x| at 0).
template <std::floating_point T>
T abs(T x) {
  return std::fabs(x);
}
template <class S, unsigned A>
Dual<S, A> abs(const Dual<S, A>& x) {
  return x.chain(std::fabs(x.value), S(x.value > 0) - S(x.value < 0));
}

/// The larger / smaller; on a tie the first. NaN where either is: a comparison alone would lose the second's.
template <LambdaNumber A, LambdaNumber B>
auto max(const A& a, const B& b) {
  const auto x = value_of(a);
  const auto y = value_of(b);
  return select((y > x) | (y != y), b, a);
}
template <LambdaNumber A, LambdaNumber B>
auto min(const A& a, const B& b) {
  const auto x = value_of(a);
  const auto y = value_of(b);
  return select((y < x) | (y != y), b, a);
}

/// x held within [low, high]; no gradient where it is held.
template <LambdaNumber T, class B>
auto clamp(const T& x, B low, B high) {
  return min(max(x, low), high);
}

template <LambdaNumber T>
T square(const T& x) {
  return x * x;
}
template <class S, unsigned A>
Dual<S, A> square(const Dual<S, A>& x) {
  return x.chain(x.value * x.value, 2 * x.value);
}

// Elementary functions: the standard ones for plain numbers, and these for dual ones.
using std::cos;
using std::log;
using std::sin;
using std::sqrt;
using std::tanh;

/// eˣ in plain arithmetic, so that loops over lambdas become vector code.
template <std::floating_point T>
T exp(T x) {
  return vector_exp(x);
}

/// √x; the derivative at 0 is 0, not ∞ (row D5: distance 0).
template <class S, unsigned A>
Dual<S, A> sqrt(const Dual<S, A>& x) {
  const S root = std::sqrt(x.value);
  return x.chain(root, root > 0 ? S(0.5) / root : S(0));
}
template <class S, unsigned A>
Dual<S, A> exp(const Dual<S, A>& x) {
  const S y = vector_exp(x.value);
  return x.chain(y, y);
}
template <class S, unsigned A>
Dual<S, A> log(const Dual<S, A>& x) {
  return x.chain(std::log(x.value), S(1) / x.value);
}
template <class S, unsigned A>
Dual<S, A> sin(const Dual<S, A>& x) {
  return x.chain(std::sin(x.value), std::cos(x.value));
}
template <class S, unsigned A>
Dual<S, A> cos(const Dual<S, A>& x) {
  return x.chain(std::cos(x.value), -std::sin(x.value));
}
template <class S, unsigned A>
Dual<S, A> tanh(const Dual<S, A>& x) {
  const S y = std::tanh(x.value);
  return x.chain(y, (1 - y) * (1 + y));
}

/// log(1 + eˣ) without overflow.
template <std::floating_point T>
T softplus(T x) {
  return std::fmax(x, T(0)) + std::log1p(vector_exp(-std::fabs(x)));
}
/// 1 / (1 + e⁻ˣ) without overflow, and its derivative, exact to rounding far into saturation (row B15).
template <std::floating_point T>
T sigmoid(T x) {
  const T e = vector_exp(-std::fabs(x));
  return (x >= 0 ? T(1) : e) / (1 + e);
}
template <std::floating_point T>
T sigmoid_derivative(T x) {
  const T e = vector_exp(-std::fabs(x));
  return e / ((1 + e) * (1 + e));
}
template <class S, unsigned A>
Dual<S, A> softplus(const Dual<S, A>& x) {
  return x.chain(softplus(x.value), sigmoid(x.value));
}
template <class S, unsigned A>
Dual<S, A> sigmoid(const Dual<S, A>& x) {
  return x.chain(sigmoid(x.value), sigmoid_derivative(x.value));
}

}  // namespace hsi4d
