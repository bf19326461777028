#include "tests/support/complex_step_check.h"

#include <algorithm>
#include <random>

namespace hsi4d::test {

namespace {

/// Gradient of Re Σ u f by the numbers of one input.
std::vector<double> complex_gradient(const std::function<Complexes(const ComplexInputs&)>& formula, ComplexInputs at,
                                     std::size_t input, const std::vector<double>& u) {
  constexpr double kStep = 1e-30;
  std::vector<double> gradient;
  for (Complex& x : at[input]) {
    const Complex before = x;
    x += Complex(0, kStep);
    const Complexes y = formula(at);
    x = before;
    double sum = 0;
    for (std::size_t i = 0; i < y.size(); ++i) sum += u[i] * (y[i].imag() / kStep);
    gradient.push_back(sum);
  }
  return gradient;
}

}  // namespace

void check_complex_step(const std::vector<OperatorInput>& inputs,
                        const std::function<Var<double>(const std::vector<Var<double>>&)>& record,
                        const std::function<Complexes(const ComplexInputs&)>& formula,
                        const ComplexStepCheck& options) {
  std::mt19937_64 random(7);
  detail::Values values;
  ComplexInputs at;
  for (const OperatorInput& input : inputs) {
    values.push_back(detail::random_numbers(input, random));
    at.emplace_back(values.back().begin(), values.back().end());
  }
  detail::Recorded<double> r;
  detail::record(r, inputs, values, record);
  TapeInspector<double> inspect(r.tape);
  const std::string name = inspect.operator_name(inspect.nodes_of(r.out).back());
  const bool is_loss = !options.loss.empty();
  INFO((is_loss ? "loss " + options.loss : "operator " + name));
  const std::vector<double> u = detail::random_numbers({"cotangent", r.out.shape()}, random);
  r.tape.forward(r.out);
  r.tape.backward(r.out, u);
  const std::vector<double> value = detail::numbers<double>(r.tape.value(r.out));
  std::vector<double> expected;
  for (const Complex& y : formula(at)) expected.push_back(y.real());
  CHECK(detail::relative_difference(value, expected) <= options.value_tolerance);
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    INFO("gradient of input " << inputs[i].name);
    const std::vector<double> exact = complex_gradient(formula, at, i, u);
    if (is_loss && !r.tape.has_gradient(r.in[i])) {
      CHECK(std::all_of(exact.begin(), exact.end(), [](double d) { return d == 0; }));
      continue;
    }
    const double error = detail::relative_difference(detail::numbers<double>(r.tape.gradient(r.in[i])), exact);
    CHECK(error <= options.tolerance);
    record_gradient({is_loss ? options.loss : "complex step", is_loss ? "" : name, is_loss ? -1 : static_cast<int>(i),
                     inputs[i].name, "complex step", error, std::ssize(exact)});
  }
}

}  // namespace hsi4d::test
