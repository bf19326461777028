#include "autodiff/difference.h"

#include <cmath>
#include <limits>

#include "autodiff/complex_step.h"
#include "tests/support/operator_check.h"

namespace difference_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {
const Shape kImage = {3, 5, 7, 16};
const Shape kMask = {1, 5, 7, 16};

/// Value of a difference measure for scalars a and b.
template <class F>
double value(double a, double b, const F& measure) {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
  tape.set(x, {a});
  tape.set(y, {b});
  const auto d = measure(x, y);
  tape.forward(d);
  return tape.value(d).scalar();
}
}  // namespace

TEST_CASE("difference measures pass the operator checks", "[parallel]") {
  const std::vector<OperatorInput> images = {{"a", kImage}, {"b", kImage}};
  const std::vector<OperatorInput> masked = {{"a", kImage}, {"b", kImage}, {"weight", kMask, 0, 1}};
  check_operator("l1", images, [](const auto& in) { return l1(in[0], in[1]); });
  check_operator("l2", images, [](const auto& in) { return l2(in[0], in[1]); });
  check_operator("masked l1", masked, [](const auto& in) { return l1(in[0], in[1], in[2]); });
  check_operator("masked l2", masked, [](const auto& in) { return l2(in[0], in[1], in[2]); });
  check_operator("huber", images, [](const auto& in) { return huber(in[0], in[1], 0.3); }, {.kink_share = 0.2});
  check_operator("charbonnier", images, [](const auto& in) { return charbonnier(in[0], in[1], 0.01); },
                 {.tolerance = 1e-5});
}

TEST_CASE("differences of images with squares pass the operator checks", "[parallel]") {
  const OperatorCheck few{.entries = 24};
  const Shape image = image_shape<double>(3, 18, 35), weight = image_shape<double>(1, 18, 35);
  const std::vector<OperatorInput> images = {{"a", image}, {"b", image}};
  const std::vector<OperatorInput> masked = {{"a", image}, {"b", image}, {"weight", weight, 0, 1}};
  const std::vector<OperatorInput> weighted = {{"a", image}, {"b", image}, {"weight", image, 0, 1}};
  check_operator(
      "l1", images, [](const auto& in) { return l1(in[0], in[1]); }, few);
  check_operator(
      "l2", images, [](const auto& in) { return l2(in[0], in[1]); }, few);
  for (const auto& inputs : {masked, weighted}) {
    check_operator(
        "masked l1", inputs, [](const auto& in) { return l1(in[0], in[1], in[2]); }, few);
    check_operator(
        "masked l2", inputs, [](const auto& in) { return l2(in[0], in[1], in[2]); }, few);
  }
}

TEST_CASE("difference measures have their textbook values") {
  CHECK(value(3, 1.5, [](auto a, auto b) { return l1(a, b); }) == 1.5);
  CHECK(value(3, 1.5, [](auto a, auto b) { return l2(a, b); }) == 2.25);
  CHECK(value(1, 0.75, [](auto a, auto b) { return huber(a, b, 0.5); }) == 0.5 * 0.25 * 0.25);
  CHECK(value(3, 1, [](auto a, auto b) { return huber(a, b, 0.5); }) == 0.5 * (2 - 0.25));
  CHECK(value(4, 1, [](auto a, auto b) { return charbonnier(a, b, 4); }) == Approx(1).epsilon(1e-15));
  // Without cancellation: d²/2e to many digits where d is far below epsilon.
  CHECK(value(1e-9, 0, [](auto a, auto b) { return charbonnier(a, b, 1); }) == Approx(0.5e-18).epsilon(1e-12));
}

TEST_CASE("the mean is over all elements, also those that the mask leaves out") {
  Tape<double> tape;
  const auto a = tape.parameter("a", kImage);
  const auto b = tape.constant("b", kImage);
  const auto mask = tape.constant("mask", kMask);
  const Array<double> x = tape.write(a);
  for (Index r = 0; r < x.total_rows(); ++r) std::fill_n(x.row(r), x.shape.cols, 2.0);
  tape.write(mask)(1, 2) = 1;
  const auto d = l2(a, b, mask);
  tape.forward(d);
  CHECK(tape.value(d).scalar() == Approx(4.0 * 3 / (3 * 5 * 7)).epsilon(1e-15));
}

namespace {

/// l1 or l2 of images of which one pixel has weight 0 and holds `poison`: the value, and the gradients of both images.
template <class S>
std::vector<S> with_unread(Index height, bool squared, S poison) {
  Tape<S> tape;
  const Shape image = image_shape<S>(2, height, 20);
  const Var<S> a = tape.parameter("a", image), b = tape.parameter("b", image),
               weight = tape.parameter("weight", image_shape<S>(1, height, 20));
  tape.freeze(weight);
  for (const Var<S> var : {a, b, weight}) {
    const Array<S> x = tape.write(var);
    for (Index r = 0; r < x.total_rows(); ++r) {
      for (Index c = 0; c < x.shape.cols; ++c)
        x.row(r)[c] = static_cast<S>(std::sin(0.7 * static_cast<double>(r * 20 + c)));
    }
  }
  tape.write(weight)(2, 3) = 0;
  tape.write(b)(1, 2, 3) = poison;
  const Var<S> mean = squared ? l2(a, b, weight) : l1(a, b, weight);
  tape.forward(mean);
  tape.backward(mean);
  std::vector<S> all = {tape.value(mean).scalar()};
  for (const Var<S> var : {a, b}) {
    const ConstArray<S> d = tape.gradient(var);
    for (Index r = 0; r < d.total_rows(); ++r) all.insert(all.end(), d.row(r), d.row(r) + d.shape.cols);
  }
  return all;
}

}  // namespace

TEMPLATE_TEST_CASE("a pixel of weight 0 is not looked at, whatever is there", "", float, double) {
  using Limits = std::numeric_limits<TestType>;
  for (const Index height : {5, 18}) {  // as arrays, and as images with squares
    for (const bool squared : {false, true}) {
      const std::vector<TestType> clean = with_unread<TestType>(height, squared, TestType(0.25));
      CHECK(std::all_of(clean.begin(), clean.end(), [](TestType x) { return std::isfinite(x); }));
      for (const TestType poison : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), Limits::max()})
        CHECK(with_unread<TestType>(height, squared, poison) == clean);
    }
  }
}

TEST_CASE("dual numbers agree with complex step on the same lambda") {
  const auto f = [](auto x, auto y, auto z) {
    return sqrt(square(x) + 0.25f) * tanh(y) + exp(-z) / (abs(x - y) + 1.0f) + softplus(x) * sigmoid(z) +
           max(x, y) * log(z + 3.0f) + select(value_of(x) > 0, sin(x * y), cos(z));
  };
  for (const std::array<double, 3> at :
       {std::array{0.3, -0.7, 1.2}, std::array{-1.5, 0.2, 0.1}, std::array{2.0, 3.0, -2.0}}) {
    const Dual<double, 7u> y = f(dual_variable<0>(at[0]), dual_variable<1>(at[1]), dual_variable<2>(at[2]));
    CHECK(y.value == Approx(f(at[0], at[1], at[2])).epsilon(1e-15));
    for (std::size_t k = 0; k < 3; ++k)
      CHECK(y.d[k] == Approx(complex_step_derivative(f, at, k)).epsilon(1e-13).margin(1e-15));
  }
}

TEST_CASE("bad parameters are refused") {
  Tape<double> tape;
  const auto a = tape.parameter("a", kImage);
  CHECK_THROWS_WITH(huber(a, a, 0), Catch::Contains("delta = 0"));
  CHECK_THROWS_WITH(charbonnier(a, a, -1), Catch::Contains("epsilon = -1"));
}

}  // namespace difference_test
