#include "optim/quasi_newton.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "core/parallel.h"
#include "tests/support/allocation_counter.h"

namespace quasi_newton_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

ParameterGroupSettings moving(double lr) {
  ParameterGroupSettings settings;
  settings.lr = lr;
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
    loss = sum_of_squares(matmul(x - goal, a)) * S(0.5);
  }
  static Var<S> sum_of_squares(Var<S> y) { return sum(square(y)); }

  /// Evaluations until it is done.
  Index run(QuasiNewton<S>& method, Index most) {
    for (Index i = 0; i < most; ++i) {
      tape.forward(loss);
      tape.backward(loss);
      method.step(i, most, static_cast<double>(tape.value(loss).scalar()));
      if (method.is_done()) return i + 1;
    }
    return most;
  }
};

}  // namespace

TEST_CASE("bfgs finds the least of a quadratic in few evaluations and says that it is done") {
  Valley<double> valley;
  QuasiNewton<double> method(valley.tape, {{{"x", {valley.x}}, moving(0.001)}});
  valley.tape.forward(valley.loss);
  const double before = valley.tape.value(valley.loss).scalar();
  const Index evaluations = valley.run(method, 200);
  valley.tape.forward(valley.loss);
  INFO(evaluations << " evaluations");
  CHECK(evaluations < 60);
  CHECK(valley.tape.value(valley.loss).scalar() < 1e-6 * before);
}

TEST_CASE("bfgs takes fewer evaluations with the curvature that it learnt before") {
  std::vector<double> learnt;
  const auto evaluations = [&learnt] {
    Valley<double> valley;
    QuasiNewton<double> method(valley.tape, {{{"x", {valley.x}}, moving(0.001)}});
    CHECK(method.curvature().empty());
    if (!learnt.empty()) method.set_curvature(learnt);
    const Index count = valley.run(method, 200);
    learnt = method.curvature();
    return count;
  };
  const Index first = evaluations();
  const auto n = static_cast<std::size_t>(std::llround(std::sqrt(learnt.size())));
  REQUIRE(n * n == learnt.size());
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) {
    largest = std::max(largest, learnt[i * n + i]);
    for (std::size_t j = 0; j < i; ++j) CHECK(learnt[i * n + j] == learnt[j * n + i]);
  }
  CHECK(largest == 1);
  const Index second = evaluations();
  INFO(first << " evaluations, then " << second);
  CHECK(2 * second < first);
  learnt.assign(4, 1);  // of another number of numbers
  CHECK(evaluations() == first);
}

TEST_CASE("bfgs ends at the best point that it evaluated") {
  for (const Index most : {1, 2, 3, 4, 7}) {
    Valley<double> valley;
    QuasiNewton<double> method(valley.tape, {{{"x", {valley.x}}, moving(0.5)}});  // the first steps are far too long
    double least = HUGE_VAL;
    for (Index i = 0; i < most; ++i) {
      valley.tape.forward(valley.loss);
      valley.tape.backward(valley.loss);
      least = std::min(least, valley.tape.value(valley.loss).scalar());
      method.step(i, most, valley.tape.value(valley.loss).scalar());
    }
    valley.tape.forward(valley.loss);
    CHECK(valley.tape.value(valley.loss).scalar() == least);
    CHECK(method.is_done());
  }
}

TEST_CASE("a learning rate is the unit of its group: bfgs takes the same steps in other units") {
  const auto run = [](double unit, double lr) {
    Tape<double> tape;
    const Var<double> x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
    const Var<double> u = x * unit - 0.3, v = y - 0.1;
    const Var<double> loss = sum(square(u)) + sum(square(v)) * 40.0 + sum(u * v);
    QuasiNewton<double> method(tape, {{{"x", {x}}, moving(lr)}, {{"y", {y}}, moving(0.01)}});
    std::vector<double> losses;
    for (Index i = 0; i < 12 && !method.is_done(); ++i) {
      tape.forward(loss);
      tape.backward(loss);
      losses.push_back(tape.value(loss).scalar());
      method.step(i, 12, losses.back());
    }
    return losses;
  };
  const std::vector<double> metres = run(1, 0.01), others = run(1024, 0.01 / 1024);  // a power of two: the same bits
  CHECK(metres == others);
}

TEST_CASE("an evaluation that is not finite shortens the step, and is told") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", kScalarShape);
  const Var<double> loss = sum(x * 2.0 - log(x));  // least at 0.5, NaN below 0
  tape.write(x).data[0] = 0.05;
  QuasiNewton<double> method(tape, {{{"x", {x}}, moving(0.4)}});
  Index bad = 0;
  for (Index i = 0; i < 40 && !method.is_done(); ++i) {
    tape.forward(loss);
    tape.backward(loss);
    const StepReport report = method.step(i, 40, tape.value(loss).scalar());
    if (report.rolled_back) {
      ++bad;
      CHECK(report.bad);
    }
  }
  CHECK(method.rollbacks() == bad);
  CHECK(tape.value(x).scalar() == Approx(0.5).epsilon(0.02));
}

TEST_CASE("a group with a learning rate of 0 keeps its numbers under bfgs") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
  tape.write(x).data[0] = 3;
  tape.write(y).data[0] = 0.7;
  const Var<double> loss = sum(square(x - 1.0)) + sum(square(y + x));
  QuasiNewton<double> method(tape, {{{"x", {x}}, moving(0.1)}, {{"y", {y}}, moving(0)}});
  for (Index i = 0; i < 30 && !method.is_done(); ++i) {
    tape.forward(loss);
    tape.backward(loss);
    method.step(i, 30, tape.value(loss).scalar());
  }
  CHECK(tape.value(y).scalar() == 0.7);
  CHECK(tape.value(x).scalar() == Approx(0.15).epsilon(0.05));  // ((1 − 0.7)/2)
}

TEST_CASE("no number moves further than bfgs is said to") {
  struct Case {
    double lr;
    Index evaluations;
  };
  for (const auto& [lr, evaluations] : {Case{0.001, 3}, Case{0.0001, 100}, Case{0.0003, 100}}) {
    INFO("lr " << lr << ", evaluations " << evaluations);
    Valley<float> valley;  // goals are up to 0.02 away
    const ParameterGroupSettings settings = moving(lr);
    QuasiNewton<float> method(valley.tape, {{{"x", {valley.x}}, settings}});
    const double goal = valley.run(method, evaluations) < evaluations ? 0.9 : 0;
    const double way = longest_quasi_newton_way(settings, evaluations);
    double furthest = 0;
    for (Index i = 0; i < 6; ++i)
      furthest = std::max(furthest, std::fabs(static_cast<double>(valley.tape.value(valley.x)(0, i))));
    CHECK(furthest <= way);
    CHECK(furthest >= goal * std::min(way, 0.02));
  }
}

TEST_CASE("the steps of bfgs have the same bits for any number of threads", "[parallel]") {
  std::vector<float> first;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      Valley<float> valley;
      QuasiNewton<float> method(valley.tape, {{{"x", {valley.x}}, moving(0.01)}});
      valley.run(method, 20);
      const ConstArray<float> x = valley.tape.value(valley.x);
      const std::vector<float> numbers(x.data, x.data + 6);
      if (first.empty()) first = numbers;
      CHECK(numbers == first);
    });
  }
}

TEST_CASE("bfgs refuses what it cannot move") {
  Tape<double> tape;
  const Var<double> many = tape.parameter("many", shape_of(33, 32)), few = tape.parameter("few", shape_of(2, 3));
  CHECK_THROWS_WITH(
      (QuasiNewton<double>(tape, {{{"colours", {many}}, moving(1)}})),
      "bfgs keeps a matrix of all pairs of the numbers that move: 1056 numbers, at most 1024 are allowed");
  OptimizerGroup<double> angles{{"global_orient", {few}}, moving(1)};
  angles.parameters.are_axis_angles = true;
  CHECK_THROWS_WITH((QuasiNewton<double>(tape, {angles})), Contains("group \"global_orient\": bfgs does not move"));
}

TEST_CASE("a steady step of bfgs allocates nothing") {
  if (!test::allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  with_threads(1, [] {
    Valley<double> valley;
    QuasiNewton<double> method(valley.tape, {{{"x", {valley.x}}, moving(1e-3)}});  // it takes twenty or more
    constexpr Index kSteps = 12;
    Index i = 0;
    const auto round = [&] {
      for (Index k = 0; k < kSteps / 2; ++k) {
        valley.tape.forward(valley.loss);
        valley.tape.backward(valley.loss);
        method.step(i++, kSteps + 1, valley.tape.value(valley.loss).scalar());
      }
    };
    CHECK(test::steady_allocations(round) == 0);
    CHECK(i == kSteps);
    CHECK_FALSE(method.is_done());
  });
}

}  // namespace quasi_newton_test
