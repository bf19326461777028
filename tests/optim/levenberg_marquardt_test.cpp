#include "optim/levenberg_marquardt.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "core/parallel.h"

namespace levenberg_marquardt_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

ParameterGroupSettings moving(double lr) {
  ParameterGroupSettings settings;
  settings.lr = lr;
  return settings;
}

OptimizerSettings damped(double damping) {
  OptimizerSettings settings;
  settings.kind = OptimizerKind::kLm;
  settings.damping = damping;
  return settings;
}

/// ½ |A (x − x*)|², A a reflection with its columns scaled by 1 to 1/30.
template <class S>
struct Valley {
  Tape<S> tape;
  Var<S> x, loss;
  static constexpr Index kNumbers = 6;

  Valley() {
    x = tape.parameter("x", shape_of(1, kNumbers));
    const Var<S> a = tape.constant("a", shape_of(kNumbers, kNumbers)), goal = tape.constant("goal", x.shape());
    for (Index r = 0; r < kNumbers; ++r) {
      for (Index c = 0; c < kNumbers; ++c) {
        const double turned = (r == c ? 1 : 0) - 2 * static_cast<double>((r + 1) * (c + 1)) / 91;  // 91 = Σ (r + 1)²
        tape.write(a).row(r)[c] = static_cast<S>(turned * std::pow(10.0, -0.3 * static_cast<double>(c)));
      }
      tape.write(goal).data[r] = static_cast<S>(0.02 * std::sin(2.0 * static_cast<double>(r)));
    }
    loss = sum(square(matmul(x - goal, a))) * S(0.5);
  }
};

/// (1 − x)² + 100 (y − x²)², from (−1.2, 1).
struct Rosenbrock {
  Tape<double> tape;
  Var<double> x, y, loss;

  Rosenbrock() {
    x = tape.parameter("x", kScalarShape);
    y = tape.parameter("y", kScalarShape);
    tape.write(x).data[0] = -1.2;
    tape.write(y).data[0] = 1;
    // Squares of linear operators' outputs: what a matrix knows of.
    const Var<double> ten = tape.constant("ten", kScalarShape), one = tape.constant("one", kScalarShape);
    tape.write(ten).data[0] = 10;
    tape.write(one).data[0] = 1;
    loss = sum(square(matmul(y - square(x), ten))) + sum(square(matmul(1.0 - x, one)));
  }
};

/// One evaluation and a step.
template <class S>
StepReport step(Tape<S>& tape, Var<S> loss, LevenbergMarquardt<S>& method, Index i, Index most) {
  tape.forward(loss);
  tape.backward(loss);
  return method.step(i, most, static_cast<double>(tape.value(loss).scalar()));
}

/// Evaluations until it is done.
template <class S>
Index run(Tape<S>& tape, Var<S> loss, LevenbergMarquardt<S>& method, Index most) {
  for (Index i = 0; i < most; ++i) {
    step(tape, loss, method, i, most);
    if (method.is_done()) return i + 1;
  }
  return most;
}

template <class S>
double value(Tape<S>& tape, Var<S> loss) {
  tape.forward(loss);
  return static_cast<double>(tape.value(loss).scalar());
}

}  // namespace

TEST_CASE("a linear problem is solved by one step of lm without damping, which gains what was said") {
  Valley<double> valley;
  const double before = value(valley.tape, valley.loss);
  LevenbergMarquardt<double> method(valley.tape, valley.loss, {{{"x", {valley.x}}, moving(0.01)}}, damped(1e-9));
  const StepReport first = step(valley.tape, valley.loss, method, 0, 10);
  REQUIRE(first.matrix);
  CHECK_FALSE(first.matrix->gain_ratio);
  CHECK(first.matrix->damping == 1e-9);
  CHECK(first.matrix->condition > 100);
  CHECK(first.matrix->condition < 1e5);
  CHECK(value(valley.tape, valley.loss) < 1e-12 * before);
  const StepReport second = step(valley.tape, valley.loss, method, 1, 10);
  CHECK(*second.matrix->gain_ratio == Approx(1).epsilon(1e-6));
  CHECK_FALSE(second.matrix->refused);
}

TEST_CASE("lm follows a curved valley to its end, and says that it is done") {
  Rosenbrock problem;
  const std::vector<OptimizerGroup<double>> groups = {{{"x", {problem.x}}, moving(0.1)},
                                                      {{"y", {problem.y}}, moving(0.1)}};
  LevenbergMarquardt<double> method(problem.tape, problem.loss, groups, damped(0.01));
  Index refused = 0, evaluations = 0;
  for (; evaluations < 100 && !method.is_done(); ++evaluations)
    refused += step(problem.tape, problem.loss, method, evaluations, 100).matrix->refused ? 1 : 0;
  INFO(evaluations << " evaluations, " << refused << " steps taken back");
  CHECK(evaluations < 50);
  CHECK(refused > 0);
  CHECK(method.rollbacks() == 0);
  CHECK(problem.tape.value(problem.x).scalar() == Approx(1).epsilon(0.01));
  CHECK(problem.tape.value(problem.y).scalar() == Approx(1).epsilon(0.02));
}

TEST_CASE("lm ends at the best point that it evaluated") {
  for (const Index most : {1, 2, 3, 5, 8, 13}) {
    Rosenbrock problem;
    LevenbergMarquardt<double> method(problem.tape, problem.loss,
                                      {{{"x", {problem.x}}, moving(0.1)}, {{"y", {problem.y}}, moving(0.1)}},
                                      damped(1e-9));
    double least = HUGE_VAL;
    for (Index i = 0; i < most && !method.is_done(); ++i) {
      least = std::min(least, value(problem.tape, problem.loss));
      step(problem.tape, problem.loss, method, i, most);
    }
    CHECK(value(problem.tape, problem.loss) == least);
    CHECK(method.is_done());
  }
}

TEST_CASE("a singular matrix, and numbers that nothing depends on, do not disturb lm") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", shape_of(1, 3)), ones = tape.constant("ones", shape_of(3, 1));
  tape.set(ones, {1.0, 1.0, 0.0});
  const Var<double> loss = sum(square(matmul(x, ones) - 1.0));  // of x0 + x1 alone
  LevenbergMarquardt<double> method(tape, loss, {{{"x", {x}}, moving(0.1)}}, damped(1e-9));
  CHECK(run(tape, loss, method, 20) < 10);
  const double* const found = tape.value(x).data;
  CHECK(found[0] + found[1] == Approx(1));
  CHECK(std::fabs(found[0] - found[1]) < 0.1);
  CHECK(found[2] == 0);
}

TEST_CASE("a loss without a curvature is followed by its gradient") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
  const Var<double> one = tape.constant("one", kScalarShape);
  tape.set(x, {1.0});
  tape.set(one, {1.0});
  const Var<double> loss = sum(exp(x) - x) + sum(square(matmul(y - 0.3, one)));
  LevenbergMarquardt<double> method(tape, loss, {{{"x", {x}}, moving(0.04)}, {{"y", {y}}, moving(0.04)}}, damped(0.01));
  const StepReport report = step(tape, loss, method, 0, 60);
  CHECK(1 - tape.value(x).scalar() <= kLongestMatrixStep * 0.04 * (1 + 1e-12));
  CHECK(std::isfinite(report.matrix->condition));
  run(tape, loss, method, 60);
  CHECK(tape.value(x).scalar() == Approx(0).margin(0.05));
  CHECK(tape.value(y).scalar() == Approx(0.3).epsilon(0.01));
}

TEST_CASE("an evaluation that is not finite damps the step of lm, and is told") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", kScalarShape);
  const Var<double> loss = sum(x * 2.0 - log(x));  // least at 0.5, NaN below 0
  tape.set(x, {0.9});
  LevenbergMarquardt<double> method(tape, loss, {{{"x", {x}}, moving(0.4)}}, damped(1e-9));
  Index bad = 0;
  double damping = 0;
  for (Index i = 0; i < 60 && !method.is_done(); ++i) {
    const StepReport report = step(tape, loss, method, i, 60);
    if (report.rolled_back) {
      ++bad;
      CHECK(report.bad);
      CHECK(report.matrix->refused);
      CHECK(report.matrix->damping >= 9 * damping);
    }
    damping = report.matrix->damping;
  }
  CHECK(bad > 0);
  CHECK(method.rollbacks() == bad);
  CHECK(tape.value(x).scalar() == Approx(0.5).epsilon(0.03));
}

TEST_CASE("a start that is not finite is left as it is") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", kScalarShape);
  tape.set(x, {-1.0});
  const Var<double> loss = sum(log(x));
  LevenbergMarquardt<double> method(tape, loss, {{{"x", {x}}, moving(0.1)}}, damped(0.01));
  for (Index i = 0; i < 3; ++i) CHECK(step(tape, loss, method, i, 10).rolled_back);
  CHECK(method.rollbacks() == 3);
  CHECK(tape.value(x).scalar() == -1);
}

TEST_CASE("lm keeps to ranges: what is at an end stands still while the others go on") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", shape_of(1, 2)), a = tape.constant("a", shape_of(2, 2));
  tape.set(a, {1.0, 0.5, 0.5, 1.0});
  const Var<double> goal = tape.constant("goal", shape_of(1, 2));
  tape.set(goal, {0.9, -0.2});
  const Var<double> loss = sum(square(matmul(x - goal, a)));
  OptimizerGroup<double> group{{"x", {x}}, moving(0.05)};
  group.parameters.range = ParameterRange{-1, 0.5};
  LevenbergMarquardt<double> method(tape, loss, {group}, damped(1e-6));
  CHECK(run(tape, loss, method, 40) < 40);
  const double* const found = tape.value(x).data;
  CHECK(found[0] == Approx(0.5).epsilon(1e-12));
  CHECK(found[0] <= 0.5 + 1e-12);
  CHECK(found[1] == Approx(-0.2 + 0.4 * 0.8).epsilon(1e-3));  // the least along the edge: 1.25 (y + 0.2) = 0.4
}

TEST_CASE("groups of many numbers move by Adam beside lm, and are taken back with its step") {
  Tape<double> tape;
  const Index many = kMostMatrixNumbers + 1;
  const Var<double> net = tape.parameter("net", shape_of(1, many)), x = tape.parameter("x", kScalarShape);
  tape.set(x, {0.9});
  const Var<double> loss = sum(x * 2.0 - log(x)) + mean(square(net - 1.0));
  ParameterGroupSettings slow = moving(0.01);
  slow.every = 2;
  LevenbergMarquardt<double> method(tape, loss, {{{"net", {net}}, slow}, {{"x", {x}}, moving(0.4)}}, damped(1e-9));
  CHECK(method.is_beside("net"));
  CHECK_FALSE(method.is_beside("x"));
  const StepReport first = step(tape, loss, method, 0, 40);
  REQUIRE(first.groups.size() == 2);
  CHECK(first.groups[0].name == "net");
  CHECK(first.groups[0].moved);
  CHECK(first.groups[1].moved);
  CHECK(tape.value(net).data[7] == Approx(0.01));
  REQUIRE(tape.value(x).scalar() < 0);  // the step was too long
  const StepReport second = step(tape, loss, method, 1, 40);
  CHECK(second.matrix->refused);
  CHECK(second.undone);
  CHECK(tape.value(net).data[7] == 0);
  for (Index i = 2; i < 40 && !method.is_done(); ++i) step(tape, loss, method, i, 40);
  CHECK(tape.value(net).data[7] > 0.01);
  CHECK(tape.value(x).scalar() == Approx(0.5).epsilon(0.1));
}

TEST_CASE("a group with a learning rate of 0 keeps its numbers under lm") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
  tape.set(x, {3.0});
  tape.set(y, {0.7});
  const Var<double> loss = sum(square(x - 1.0)) + sum(square(y + x));
  LevenbergMarquardt<double> method(tape, loss, {{{"x", {x}}, moving(0.1)}, {{"y", {y}}, moving(0)}}, damped(0.01));
  run(tape, loss, method, 30);
  CHECK(tape.value(y).scalar() == 0.7);
  CHECK(tape.value(x).scalar() == Approx(0.15).epsilon(0.02));  // ((1 − 0.7)/2)
}

TEST_CASE("no number moves further than lm is said to") {
  for (const double lr : {0.0001, 0.0003, 0.001}) {
    INFO("lr " << lr);
    Valley<float> valley;  // goals are up to 0.02 away
    LevenbergMarquardt<float> method(valley.tape, valley.loss, {{{"x", {valley.x}}, moving(lr)}}, damped(1e-6));
    for (const Index evaluations : {1, 2, 40}) {
      for (Index i = 0; i < evaluations && !method.is_done(); ++i) step(valley.tape, valley.loss, method, i, 100);
      const double way = longest_matrix_way(moving(lr), 100);
      for (Index i = 0; i < 6; ++i)
        CHECK(std::fabs(static_cast<double>(valley.tape.value(valley.x)(0, i))) <= way * (1 + 1e-6));
    }
  }
}

TEST_CASE("the steps of lm have the same bits for any number of threads", "[parallel]") {
  std::vector<float> first;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      Valley<float> valley;
      LevenbergMarquardt<float> method(valley.tape, valley.loss, {{{"x", {valley.x}}, moving(0.01)}}, damped(0.1));
      run(valley.tape, valley.loss, method, 8);
      const ConstArray<float> x = valley.tape.value(valley.x);
      const std::vector<float> numbers(x.data, x.data + 6);
      if (first.empty()) first = numbers;
      CHECK(numbers == first);
    });
  }
}

TEST_CASE("lm refuses what it cannot move") {
  Tape<double> tape;
  const Var<double> many = tape.parameter("many", shape_of(33, 32)), few = tape.parameter("few", shape_of(2, 3));
  const Var<double> loss = sum(square(many)) + sum(square(few));
  CHECK_THROWS_WITH((LevenbergMarquardt<double>(tape, loss, {{{"colours", {many}}, moving(1)}}, damped(1))),
                    "lm: every group has more than 512 numbers; allowed: the optimizer adam");
  OptimizerGroup<double> angles{{"global_orient", {few}}, moving(1)};
  angles.parameters.are_axis_angles = true;
  CHECK_THROWS_WITH((LevenbergMarquardt<double>(tape, loss, {angles}, damped(1))),
                    Contains("group \"global_orient\": lm does not move rotations as axis and angle"));
}

}  // namespace levenberg_marquardt_test
