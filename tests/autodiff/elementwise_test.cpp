#include "autodiff/elementwise.h"

#include <cmath>
#include <limits>
#include <utility>

#include "autodiff/map.h"
#include "tests/support/operator_check.h"

namespace elementwise_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {
const Shape kSmall = shape_of(5, 3);
const Shape kRow = shape_of(1, 3);
const Shape kColumn = shape_of(5, 1);
const Shape kImage = {3, 5, 7, 16};
const Shape kMask = {1, 5, 7, 16};
const Shape kLarge = shape_of(9000, 7);  // several parallel chunks
const OperatorCheck kFew{.entries = 8};  // for them: each evaluation takes its time
}  // namespace

TEST_CASE("elementwise arithmetic passes the operator checks", "[parallel]") {
  check_operator("a + b", {{"a", kSmall}, {"b", kSmall}}, [](const auto& in) { return in[0] + in[1]; });
  check_operator("a - b", {{"a", kSmall}, {"b", kRow}}, [](const auto& in) { return in[0] - in[1]; });
  check_operator("a * b", {{"a", kSmall}, {"b", kColumn}}, [](const auto& in) { return in[0] * in[1]; });
  check_operator("a / b", {{"a", kSmall}, {"b", kSmall, 0.5, 2}}, [](const auto& in) { return in[0] / in[1]; });
  check_operator("row * column", {{"a", kRow}, {"b", kColumn}}, [](const auto& in) { return in[0] * in[1]; });
  check_operator("scalar / b", {{"a", kScalarShape}, {"b", kSmall, 0.5, 2}},
                 [](const auto& in) { return in[0] / in[1]; });
  check_operator("image * mask", {{"a", kImage}, {"b", kMask}}, [](const auto& in) { return in[0] * in[1]; });
  check_operator("numbers", {{"a", kSmall, 0.5, 2}},
                 [](const auto& in) { return 2.0 - (1.0 / in[0] + 3.0) * 0.5 + (-in[0]) / 4.0; });
  check_operator("x * x", {{"x", kSmall}}, [](const auto& in) { return in[0] * in[0]; });
}

TEST_CASE("broadcasting over many chunks passes the operator checks", "[parallel]") {
  check_operator(
      "large * row", {{"a", kLarge}, {"b", shape_of(1, 7)}}, [](const auto& in) { return in[0] * in[1]; }, kFew);
  check_operator(
      "large * scalar", {{"a", kLarge}, {"b", kScalarShape}}, [](const auto& in) { return in[0] * in[1]; }, kFew);
}

TEST_CASE("elementwise functions pass the operator checks", "[parallel]") {
  check_operator("min", {{"a", kSmall}, {"b", kSmall}}, [](const auto& in) { return min(in[0], in[1]); });
  check_operator("max", {{"a", kSmall}, {"b", kSmall}}, [](const auto& in) { return max(in[0], in[1]); });
  check_operator("clamp", {{"x", kSmall}}, [](const auto& in) { return clamp(in[0], -0.5, 0.25); });
  check_operator("abs", {{"x", kSmall}}, [](const auto& in) { return abs(in[0]); });
  check_operator("square", {{"x", kImage}}, [](const auto& in) { return square(in[0]); });
  check_operator("sqrt", {{"x", kSmall, 0.1, 2}}, [](const auto& in) { return sqrt(in[0]); });
  check_operator("exp", {{"x", kSmall}}, [](const auto& in) { return exp(in[0]); });
  check_operator("log", {{"x", kSmall, 0.1, 2}}, [](const auto& in) { return log(in[0]); });
  check_operator("sin", {{"x", kSmall, -3, 3}}, [](const auto& in) { return sin(in[0]); });
  check_operator("cos", {{"x", kSmall, -3, 3}}, [](const auto& in) { return cos(in[0]); });
  check_operator("tanh", {{"x", kSmall, -3, 3}}, [](const auto& in) { return tanh(in[0]); });
  check_operator("sigmoid", {{"x", kSmall, -9, 9}}, [](const auto& in) { return sigmoid(in[0]); });
  check_operator("softplus", {{"x", kSmall, -9, 9}}, [](const auto& in) { return softplus(in[0]); });
  check_operator("leaky_relu", {{"x", kSmall}}, [](const auto& in) { return leaky_relu(in[0], 0.01); });
}

TEST_CASE("map and its dual numbers pass the operator checks", "[parallel]") {
  const auto bump = [](auto x, auto y, auto w) { return w * exp(-square(x - y) / (1 + abs(y))) + max(x, y * 0.5f); };
  check_operator("map", {{"x", kImage}, {"y", kImage}, {"w", kMask}}, [&](const auto& in) {
    return map({in[0], in[1], in[2]}, bump);
  });
  check_operator("sum_over", {{"x", kImage}, {"y", kImage}, {"w", kMask}}, [&](const auto& in) {
    return sum_over({in[0], in[1], in[2]}, bump);
  });
  check_operator(
      "sum_over, many chunks", {{"x", kLarge}, {"y", kLarge}, {"w", shape_of(1, 7)}},
      [&](const auto& in) {
        return sum_over({in[0], in[1], in[2]}, bump);
      },
      kFew);
}

TEST_CASE("the smaller and the larger are NaN where either number is") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  Tape<double> tape;
  const Var<double> a = tape.parameter("a", shape_of(1, 4)), b = tape.parameter("b", shape_of(1, 4));
  const double first[] = {kNan, 1, kNan, 1}, second[] = {2, kNan, kNan, 2};
  for (Index c = 0; c < 4; ++c) tape.write(a)(0, c) = first[c], tape.write(b)(0, c) = second[c];
  const auto smaller = map({a, b}, [](auto x, auto y) { return min(x, y); });
  const auto larger = map({a, b}, [](auto x, auto y) { return max(x, y); });
  const std::pair<Var<double>, double> results[] = {{min(a, b), 1}, {max(a, b), 2}, {smaller, 1}, {larger, 2}};
  for (const auto& [result, last] : results) {
    tape.forward(result);
    const ConstArray<double> y = tape.value(result);
    for (Index c = 0; c < 3; ++c) CHECK(std::isnan(y(0, c)));
    CHECK(y(0, 3) == last);
  }
}

TEST_CASE("stop_gradient copies the value and has no gradient behind it") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  tape.set(x, {3});
  const auto y = stop_gradient(x) * x;
  tape.forward(y);
  tape.backward(y);
  CHECK(tape.value(y).scalar() == 9);
  CHECK(tape.gradient(x).scalar() == 3);
}

TEST_CASE("B15, D5, E4: gradients in saturation, at zero and at ties") {
  Tape<float> tape;
  const auto x = tape.parameter("x", shape_of(1, 9));
  const auto gradient_of = [&](Var<float> y, std::vector<float> values) {
    values.resize(9, 1);
    tape.set(x, values);
    tape.forward(y);
    tape.backward(y, std::vector<float>(9, 1));
    return tape.gradient(x);
  };
  const std::vector<float> logits = {0, 15, -15, 20, -20, 40, -40, 80, -80};
  const auto d = gradient_of(sigmoid(x), logits);
  for (Index i = 0; i < 9; ++i) {
    const double e = std::exp(-std::fabs(static_cast<double>(logits[static_cast<std::size_t>(i)])));
    CHECK(d(0, i) == Approx(e / ((1 + e) * (1 + e))).epsilon(1e-6));
  }
  CHECK(gradient_of(sqrt(x), {0, 4})(0, 0) == 0);
  CHECK(gradient_of(sqrt(x), {0, 4})(0, 1) == 0.25f);
  CHECK(gradient_of(abs(x), {0, -2})(0, 0) == 0);
  CHECK(gradient_of(abs(x), {0, -2})(0, 1) == -1);
}

TEST_CASE("C11: a NaN in a branch that is not taken never reaches the gradient") {
  Tape<double> tape;
  const auto x = tape.parameter("x", shape_of(1, 2));
  tape.set(x, {-1, 4});
  const auto y = sum_over({x}, [](auto v) { return select(value_of(v) > 0, sqrt(v), v * 2.0f); });
  tape.forward(y);
  tape.backward(y);
  CHECK(tape.value(y).scalar() == 0);
  CHECK(tape.gradient(x)(0, 0) == 2);
  CHECK(tape.gradient(x)(0, 1) == 0.25);
}

TEST_CASE("shapes that do not fit are named") {
  Tape<double> tape;
  const auto a = tape.parameter("a", shape_of(5, 3));
  const auto b = tape.parameter("b", shape_of(4, 3));
  CHECK_THROWS_WITH(a + b, Catch::Contains("[5,3] against [4,3]"));
}

TEST_CASE("results are the same bits on every instruction set") {
  std::vector<double> x(1000), y(1000), reference(1000);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::sin(static_cast<double>(i)) * 3;
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa > best_isa()) continue;
    on_isa(isa, [&] {
      for (std::size_t i = 0; i < x.size(); ++i)
        y[i] = x[i] * x[i] * 1.1 + std::sqrt(std::fabs(x[i])) / (1 + x[i] * x[i]);
    });
    if (isa == Isa::kBaseline) reference = y;
    CHECK(y == reference);
  }
}

}  // namespace elementwise_test
