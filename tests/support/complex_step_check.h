// Adjoints of taped operators against complex steps of a formula that is written down a second time:
// ∂f/∂x = Im f(x + ih)/h, exact to rounding as h = 1e-30 is never subtracted from anything.
//
//   check_complex_step({{"a", shape_of(3, 4)}, {"b", shape_of(4, 2)}},
//                      [](const auto& in) { return matmul(in[0], in[1]); }, [](const ComplexInputs& in) { … });
#pragma once

#include <complex>
#include <functional>
#include <string>
#include <vector>

#include "tests/support/operator_check.h"

namespace hsi4d::test {

using Complex = std::complex<double>;
/// Row-major numbers of an array, without padding.
using Complexes = std::vector<Complex>;
using ComplexInputs = std::vector<Complexes>;

struct ComplexStepCheck {
  double tolerance = 1e-12;        ///< of values and gradients, relative L2
  double value_tolerance = 1e-12;  ///< of values; larger where the operator computes an approximation
  std::string loss = {};           ///< of a loss term: its name; all inputs that it has no gradient in count as 0
};

/// Checks in double that the operator has the formula's value and, with a random cotangent, its gradient by complex
/// steps, for every input; both go to the audit of gradients under the name of the operator that makes the result, or
/// of the loss term.
///
/// @param record  Vars of the inputs to the result
/// @param formula the same of complex numbers, analytic in all inputs
void check_complex_step(const std::vector<OperatorInput>& inputs,
                        const std::function<Var<double>(const std::vector<Var<double>>&)>& record,
                        const std::function<Complexes(const ComplexInputs&)>& formula,
                        const ComplexStepCheck& options = {});

// Of complex numbers by their real part, without conjugation.
inline Complex complex_abs(Complex x) { return x.real() < 0 ? -x : x; }
inline Complex complex_max(Complex a, Complex b) { return a.real() < b.real() ? b : a; }

}  // namespace hsi4d::test
