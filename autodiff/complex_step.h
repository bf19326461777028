// Complex numbers for derivatives by complex step: f'(x) = Im f(x + i h) / h, exact to rounding for h = 1e-30.
// Lambdas written for `map` and `sum_over` run on them unchanged; comparisons look at the real part.
#pragma once

#include <complex>
#include <tuple>

#include "autodiff/dual.h"

namespace hsi4d {

/// Own type, because std::abs, which argument-dependent lookup would find for std::complex, breaks the derivative.
struct ComplexStep {
  std::complex<double> z;

  ComplexStep() = default;
  ComplexStep(double real, double imaginary = 0) : z(real, imaginary) {}  // NOLINT(google-explicit-constructor)
  explicit ComplexStep(const std::complex<double>& value) : z(value) {}

  ComplexStep operator-() const { return ComplexStep(-z); }
  ComplexStep& operator+=(const ComplexStep& b) { return z += b.z, *this; }
  ComplexStep& operator-=(const ComplexStep& b) { return z -= b.z, *this; }
  ComplexStep& operator*=(const ComplexStep& b) { return z *= b.z, *this; }
  ComplexStep& operator/=(const ComplexStep& b) { return z /= b.z, *this; }
  friend ComplexStep operator+(ComplexStep a, const ComplexStep& b) { return a += b; }
  friend ComplexStep operator-(ComplexStep a, const ComplexStep& b) { return a -= b; }
  friend ComplexStep operator*(ComplexStep a, const ComplexStep& b) { return a *= b; }
  friend ComplexStep operator/(ComplexStep a, const ComplexStep& b) { return a /= b; }
  friend bool operator<(const ComplexStep& a, const ComplexStep& b) { return a.z.real() < b.z.real(); }
  friend bool operator>(const ComplexStep& a, const ComplexStep& b) { return b < a; }
  friend bool operator<=(const ComplexStep& a, const ComplexStep& b) { return !(b < a); }
  friend bool operator>=(const ComplexStep& a, const ComplexStep& b) { return !(a < b); }
};

inline double value_of(const ComplexStep& x) { return x.z.real(); }
inline ComplexStep abs(const ComplexStep& x) { return x.z.real() < 0 ? -x : x; }
inline ComplexStep sqrt(const ComplexStep& x) { return ComplexStep(std::sqrt(x.z)); }
inline ComplexStep exp(const ComplexStep& x) { return ComplexStep(std::exp(x.z)); }
inline ComplexStep log(const ComplexStep& x) { return ComplexStep(std::log(x.z)); }
inline ComplexStep sin(const ComplexStep& x) { return ComplexStep(std::sin(x.z)); }
inline ComplexStep cos(const ComplexStep& x) { return ComplexStep(std::cos(x.z)); }
inline ComplexStep tanh(const ComplexStep& x) { return ComplexStep(std::tanh(x.z)); }
inline ComplexStep softplus(const ComplexStep& x) { return ComplexStep(std::log(1.0 + std::exp(x.z))); }
inline ComplexStep sigmoid(const ComplexStep& x) { return ComplexStep(1.0 / (1.0 + std::exp(-x.z))); }

/// Derivative of f, a function of K numbers, with respect to the k-th.
template <std::size_t K, class F>
double complex_step_derivative(const F& f, const std::array<double, K>& at, std::size_t k) {
  constexpr double kStep = 1e-30;
  std::array<ComplexStep, K> x;
  for (std::size_t i = 0; i < K; ++i) x[i] = ComplexStep(at[i], i == k ? kStep : 0.0);
  return std::apply(f, x).z.imag() / kStep;
}

}  // namespace hsi4d
