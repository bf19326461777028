// Checks of hand-written adjoints against complex steps and central differences, and comparisons in units of rounding.
#pragma once

#include <cmath>
#include <complex>
#include <limits>

#include <Eigen/Core>
#include <catch2/catch.hpp>

#include "core/linear.h"
#include "core/random.h"
#include "stress/rotation_measures.h"
#include "tests/support/seeds.h"

namespace hsi4d::testing {

using Complex = std::complex<double>;

template <class S, int N>
using Column = Eigen::Matrix<S, N, 1>;

template <int N>
Column<double, N> random_column(RandomSequence& random) {
  Column<double, N> x;
  for (int i = 0; i < N; ++i) x[i] = random.normal();
  return x;
}

template <class S>
Column<S, 9> flat(const Matrix3<S>& m) {
  return m.reshaped();
}
template <class S>
Matrix3<S> square(const Column<S, 9>& v) {
  return v.reshaped(3, 3);
}

using stress::narrow;
using stress::orthogonality_error;
using stress::ulps;
using stress::widen;

/// Gradient of g · f(x) by complex step.
template <int N, class F, int M>
Column<double, N> complex_step_gradient(const F& f, const Column<double, N>& x, const Column<double, M>& g) {
  constexpr double kStep = 1e-30;
  Column<double, N> gradient;
  for (int i = 0; i < N; ++i) {
    Column<Complex, N> z = x.template cast<Complex>();
    z[i] += Complex(0, kStep);
    const Column<Complex, M> y = f(z);
    gradient[i] = y.imag().dot(g) / kStep;
  }
  return gradient;
}

template <int N, class F, int M>
Column<double, N> central_gradient(const F& f, const Column<double, N>& x, const Column<double, M>& g) {
  const double step = 1e-5 * std::fmax(x.norm(), 1e-3);
  Column<double, N> gradient;
  for (int i = 0; i < N; ++i) {
    Column<double, N> above = x, below = x;
    above[i] += step;
    below[i] -= step;
    gradient[i] = (Column<double, M>(f(above)) - Column<double, M>(f(below))).dot(g) / (above[i] - below[i]);
  }
  return gradient;
}

/// What check_adjoint found; compared in a function that is no template, which compiles in a tenth of the time.
struct AdjointResult {
  Eigen::VectorXd x, once, complex_step, central;
  Eigen::VectorXd noise, noise_and_once, noise_and_twice, noise_and_zero;
};

inline void check_adjoint_result(const AdjointResult& r, double tolerance) {
  const double size = std::fmax(r.complex_step.norm(), 1e-3);
  CAPTURE(r.x.transpose(), r.once.transpose(), r.complex_step.transpose(), r.central.transpose());
  CHECK((r.once - r.complex_step).norm() <= tolerance * size);
  CHECK((r.once - r.central).norm() <= 1e-6 * size);
  CHECK((r.noise_and_once - r.noise - r.once).norm() <= 1e-14 * (r.noise.norm() + size));
  CHECK((r.noise_and_twice - r.noise - 2 * r.once).norm() <= 1e-14 * (r.noise.norm() + 2 * size));
  CHECK(r.noise_and_zero == r.noise);
}

/// f: column of N scalars (double or complex) to a column of M; adjoint(x, g, d_x) adds to d_x. Checks with a random
/// cotangent, and again with one of this run's fresh seed, that it is the gradient (complex step, to `tolerance` of its
/// norm; central differences, to 1e-6), that it adds, that twice adds twice, and that a zero cotangent adds nothing.
template <int M, int N, class F, class A>
void check_adjoint(const F& f, const A& adjoint, const Column<double, N>& x, RandomSequence& random,
                   double tolerance = 1e-12) {
  static RandomSequence fresh(test::fresh_seed());
  for (RandomSequence* sequence : {&random, &fresh}) {
    const Column<double, M> g = random_column<M>(*sequence);
    const Column<double, N> noise = random_column<N>(*sequence);
    Column<double, N> once = Column<double, N>::Zero();
    adjoint(x, g, once);
    Column<double, N> added = noise;
    adjoint(x, g, added);
    Column<double, N> twice = added;
    adjoint(x, g, twice);
    Column<double, N> untouched = noise;
    adjoint(x, Column<double, M>(Column<double, M>::Zero()), untouched);
    INFO("fresh seed of this run: " << test::fresh_seed());
    check_adjoint_result(
        {x, once, complex_step_gradient<N>(f, x, g), central_gradient<N>(f, x, g), noise, added, twice, untouched},
        tolerance);
  }
}

}  // namespace hsi4d::testing
