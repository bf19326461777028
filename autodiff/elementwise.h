// Elementwise arithmetic and functions of arrays, with broadcasting.
//
// Sizes of planes, rows and columns must be equal or 1. Either operand of + − * / may be a plain number. Derivatives
// are written by hand, so that a factor 0 never meets an infinity (row C11: 0·∞).
#pragma once

#include <string_view>

#include "autodiff/tape.h"

namespace hsi4d {

/// Right-hand side of an arithmetic operator: an array or a number. Converts implicitly, and so learns the caller's
/// line.
template <class S>
struct Operand {
  Operand(Var<S> v, Source w = Source::current()) : var(v), where(w) {}  // NOLINT(google-explicit-constructor)
  Operand(double x, Source w = Source::current())
      : number(static_cast<S>(x)), is_number(true), where(w) {}  // NOLINT(google-explicit-constructor)

  Var<S> var;
  S number = 0;
  bool is_number = false;
  Source where;
};

/// Left-hand side that is a plain number.
template <class S>
struct Number {
  Number(double x, Source w = Source::current())
      : value(static_cast<S>(x)), where(w) {}  // NOLINT(google-explicit-constructor)
  S value;
  Source where;
};

// clang-format off
template <class S> Var<S> operator+(Var<S> a, std::type_identity_t<Operand<S>> b);
template <class S> Var<S> operator-(Var<S> a, std::type_identity_t<Operand<S>> b);
template <class S> Var<S> operator*(Var<S> a, std::type_identity_t<Operand<S>> b);
template <class S> Var<S> operator/(Var<S> a, std::type_identity_t<Operand<S>> b);
template <class S> Var<S> operator+(std::type_identity_t<Number<S>> a, Var<S> b);
template <class S> Var<S> operator-(std::type_identity_t<Number<S>> a, Var<S> b);
template <class S> Var<S> operator*(std::type_identity_t<Number<S>> a, Var<S> b);
template <class S> Var<S> operator/(std::type_identity_t<Number<S>> a, Var<S> b);
template <class S> Var<S> operator-(Var<S> a);

/// The smaller / larger of two arrays; on a tie value and gradient are the first's.
template <class S> Var<S> min(Var<S> a, Var<S> b, Source where = Source::current());
template <class S> Var<S> max(Var<S> a, Var<S> b, Source where = Source::current());
/// x held within [low, high]; the gradient is zero where it is held.
template <class S> Var<S> clamp(Var<S> x, double low, double high, Source where = Source::current());
/// |x|; the gradient at 0 is 0.
template <class S> Var<S> abs(Var<S> x, Source where = Source::current());
template <class S> Var<S> square(Var<S> x, Source where = Source::current());
/// √x; the gradient at 0 is 0 (row D5: no infinity from coincident points).
template <class S> Var<S> sqrt(Var<S> x, Source where = Source::current());
template <class S> Var<S> exp(Var<S> x, Source where = Source::current());
template <class S> Var<S> log(Var<S> x, Source where = Source::current());
template <class S> Var<S> sin(Var<S> x, Source where = Source::current());
template <class S> Var<S> cos(Var<S> x, Source where = Source::current());
template <class S> Var<S> tanh(Var<S> x, Source where = Source::current());
/// 1/(1 + e⁻ˣ); the gradient is right far into saturation (row B15: saturated sigmoid).
template <class S> Var<S> sigmoid(Var<S> x, Source where = Source::current());
/// log(1 + eˣ).
template <class S> Var<S> softplus(Var<S> x, Source where = Source::current());
/// x where x > 0, else slope·x; the gradient at 0 is slope.
template <class S> Var<S> leaky_relu(Var<S> x, double slope, Source where = Source::current());
/// The value of x with no gradient behind it.
template <class S> Var<S> stop_gradient(Var<S> x, Source where = Source::current());
// clang-format on

/// Whether an operator of this name is that of stop_gradient.
bool is_stop_gradient(std::string_view operator_name);

}  // namespace hsi4d
