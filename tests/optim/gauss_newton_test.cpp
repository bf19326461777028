#include "optim/gauss_newton.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "core/parallel.h"
#include "tests/support/allocation_counter.h"

namespace gauss_newton_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

ParameterGroupSettings moving(double lr) {
  ParameterGroupSettings settings;
  settings.lr = lr;
  return settings;
}

/// Evaluates and steps until the method is done; returns how often. @param each  called after every step
template <class S, class F>
Index run(Tape<S>& tape, Var<S> loss, GaussNewton<S>& method, Index most, const F& each) {
  for (Index i = 0; i < most; ++i) {
    tape.forward(loss);
    tape.backward(loss);
    each(method.step(i, most, static_cast<double>(tape.value(loss).scalar())));
    if (method.is_done()) return i + 1;
  }
  return most;
}
template <class S>
Index run(Tape<S>& tape, Var<S> loss, GaussNewton<S>& method, Index most) {
  return run(tape, loss, method, most, [](const StepReport&) {});
}

/// Rosenbrock's function as squares, for every pair of neighbours: Σ 100 (x_{i+1} − x_i²)² + (1 − x_i)²; least, 0, at
/// 1 everywhere.
template <class S>
struct Rosenbrock {
  Tape<S> tape;
  Var<S> x, loss;
  SeamMode seams;

  explicit Rosenbrock(Index numbers, double start = -0.5) {
    x = tape.parameter("x", shape_of(1, numbers));
    for (Index i = 0; i < numbers; ++i) tape.write(x).data[i] = static_cast<S>(start + 0.1 * static_cast<double>(i));
    const Var<S> before = slice_cols(x, 0, numbers - 1), after = slice_cols(x, 1, numbers - 1);
    loss = sum(square(seam(after - square(before), seams))) * S(100) + sum(square(seam(before - S(1), seams)));
  }
  std::vector<S> numbers() const {
    const ConstArray<S> now = tape.value(x);
    return {now.data, now.data + now.shape.count()};
  }
};

/// r(x) = A sin(x) − b, ½ |r|².
struct Dense {
  static constexpr Index kNumbers = 4, kResiduals = 7;
  Tape<double> tape;
  Var<double> x, loss;
  SeamMode seams;
  Eigen::MatrixXd a = Eigen::MatrixXd(kResiduals, kNumbers);

  Dense() {
    x = tape.parameter("x", shape_of(1, kNumbers));
    const Var<double> left = tape.constant("a", shape_of(kNumbers, kResiduals));
    const Var<double> right = tape.constant("b", shape_of(1, kResiduals));
    for (Index r = 0; r < kResiduals; ++r) {
      for (Index c = 0; c < kNumbers; ++c) {
        a(r, c) = std::sin(static_cast<double>(3 * r + 5 * c + r * c)) * std::pow(4.0, -static_cast<double>(c));
        tape.write(left)(c, r) = a(r, c);
      }
      tape.write(right).data[r] = 0.1 * std::cos(static_cast<double>(r));
    }
    for (Index c = 0; c < kNumbers; ++c) tape.write(x).data[c] = 0.1 * static_cast<double>(c + 1);
    loss = sum(square(seam(matmul(sin(x), left) - right, seams))) * 0.5;
  }
  Eigen::VectorXd numbers() const { return Eigen::Map<const Eigen::VectorXd>(tape.value(x).data, kNumbers); }
};

}  // namespace

TEST_CASE("gauss_newton finds the least of Rosenbrock's function, faster than linearly at last") {
  Rosenbrock<double> valley(6);
  GaussNewton<double> method(valley.tape, {{{"x", {valley.x}}, moving(0.1)}}, 6, valley.seams);
  std::vector<double> losses;  // of the best so far
  bool is_product = false;
  const Index evaluations = run(valley.tape, valley.loss, method, 400, [&](const StepReport&) {
    const double loss = valley.tape.value(valley.loss).scalar();
    if (!is_product && (losses.empty() || loss < losses.back())) losses.push_back(loss);
    is_product = valley.seams.of_change;
  });
  INFO(evaluations << " evaluations");
  CHECK(evaluations < 200);
  for (const double x : valley.numbers()) CHECK(x == Approx(1).margin(5e-3));
  REQUIRE(losses.size() > 4);
  // The least is 0, so that steps square the distance but for what is left of the damping: faster than linear.
  const std::size_t last = losses.size() - 1;
  INFO(losses[last - 2] << ", " << losses[last - 1] << ", " << losses[last]);
  CHECK(losses[last] < 0.1 * losses[last - 1]);
  CHECK(losses[last] / losses[last - 1] < losses[last - 1] / losses[last - 2]);
}

TEST_CASE("a step of gauss_newton is that of dense normal equations") {
  Dense dense;
  const double lr = 0.05;
  const Eigen::VectorXd start = dense.numbers();
  GaussNewton<double> method(dense.tape, {{{"x", {dense.x}}, moving(lr)}}, Dense::kNumbers, dense.seams);
  Eigen::VectorXd first_direction;
  double first_curvature = 0, products = 0;
  Eigen::VectorXd stepped = start;
  const Eigen::MatrixXd jacobian = lr * dense.a * start.array().cos().matrix().asDiagonal();
  Eigen::VectorXd gradient;
  for (Index i = 0; i < 40; ++i) {
    dense.tape.forward(dense.loss);
    dense.tape.backward(dense.loss);
    if (i == 0) gradient = lr * Eigen::Map<const Eigen::VectorXd>(dense.tape.gradient(dense.x).data, Dense::kNumbers);
    method.step(i, 40, dense.tape.value(dense.loss).scalar());
    if (!dense.seams.of_change) {
      stepped = dense.numbers();
      break;
    }
    ++products;
    if (i == 0) first_direction = (dense.numbers() - start).normalized();
  }
  REQUIRE(products >= 2);
  const Eigen::MatrixXd whole = jacobian.transpose() * jacobian;
  first_curvature = first_direction.dot(whole * first_direction);
  CHECK(first_direction.dot(gradient.normalized()) == Approx(-1));
  const Eigen::MatrixXd damped = whole + 1e-4 * first_curvature * Eigen::MatrixXd::Identity(whole.rows(), whole.cols());
  const auto model = [&](const Eigen::VectorXd& step) { return gradient.dot(step) + 0.5 * step.dot(damped * step); };
  const Eigen::VectorXd best = -damped.ldlt().solve(gradient), found = (stepped - start) / lr;
  INFO(products << " products; " << best.transpose() << " against " << found.transpose());
  if (products == Dense::kNumbers) {
    CHECK((found - best).norm() < 1e-2 * best.norm());
  } else {
    CHECK(model(found) < 0.9 * model(best));
  }
}

TEST_CASE("gauss_newton with a product for each number solves the normal equations") {
  Dense dense;
  const double lr = 0.05;
  GaussNewton<double> method(dense.tape, {{{"x", {dense.x}}, moving(lr)}}, Dense::kNumbers, dense.seams);
  run(dense.tape, dense.loss, method, 100);
  CHECK(method.is_done());
  // At the least Jᵀ r is 0.
  dense.tape.forward(dense.loss);
  dense.tape.backward(dense.loss);
  const ConstArray<double> gradient = dense.tape.gradient(dense.x);
  double slope = 0;
  for (Index i = 0; i < Dense::kNumbers; ++i) slope = std::max(slope, std::fabs(gradient.data[i]));
  Dense start;
  start.tape.forward(start.loss);
  start.tape.backward(start.loss);
  CHECK(slope < 0.02 * std::fabs(start.tape.gradient(start.x).data[0]));
}

TEST_CASE("gauss_newton takes fewer evaluations with the curvature that it learnt before") {
  std::vector<double> learnt;
  const auto evaluations = [&learnt] {
    Dense dense;
    GaussNewton<double> method(dense.tape, {{{"x", {dense.x}}, moving(0.05)}}, Dense::kNumbers, dense.seams);
    CHECK(method.curvature().empty());
    if (!learnt.empty()) method.set_curvature(learnt);
    const Index count = run(dense.tape, dense.loss, method, 100);
    learnt = method.curvature();
    return count;
  };
  const Index first = evaluations();
  REQUIRE(learnt.size() == Dense::kNumbers * Dense::kNumbers);
  const Index second = evaluations();
  INFO(first << " evaluations, then " << second);
  CHECK(second < first);
  learnt.assign(9, 1);  // of another number of numbers
  CHECK(evaluations() == first);
}

TEST_CASE("gauss_newton ends at the best point that it evaluated") {
  for (const Index most : {1, 2, 3, 4, 5, 8, 13}) {
    INFO(most << " evaluations");
    Rosenbrock<double> valley(4);
    GaussNewton<double> method(valley.tape, {{{"x", {valley.x}}, moving(1)}}, 3, valley.seams);
    double least = HUGE_VAL;
    for (Index i = 0; i < most; ++i) {
      const bool is_product = valley.seams.of_change;
      valley.tape.forward(valley.loss);
      valley.tape.backward(valley.loss);
      const double loss = valley.tape.value(valley.loss).scalar();
      if (!is_product) least = std::min(least, loss);
      method.step(i, most, loss);
    }
    valley.tape.forward(valley.loss);
    CHECK(valley.tape.value(valley.loss).scalar() == least);
    CHECK(method.is_done());
    CHECK_FALSE(valley.seams.of_change);
  }
}

TEST_CASE("a learning rate is the unit of its group: gauss_newton takes the same steps in other units") {
  const auto losses_of = [](double unit, double lr) {
    Tape<double> tape;
    SeamMode seams;
    const Var<double> x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
    const Var<double> u = seam(x * unit - 0.3, seams), v = seam(y - 0.1 + square(x * unit), seams);
    const Var<double> loss = sum(square(u)) + sum(square(v)) * 40.0;
    GaussNewton<double> method(tape, {{{"x", {x}}, moving(lr)}, {{"y", {y}}, moving(0.01)}}, 2, seams);
    std::vector<double> losses;
    run(tape, loss, method, 30, [&](const StepReport&) { losses.push_back(tape.value(loss).scalar()); });
    return losses;
  };
  const std::vector<double> metres = losses_of(1, 0.01), others = losses_of(1024, 0.01 / 1024);
  CHECK(metres == others);  // a power of two: the same bits
}

TEST_CASE("an evaluation that is not finite makes the step of gauss_newton shorter, and is told") {
  Tape<double> tape;
  SeamMode seams;
  const Var<double> x = tape.parameter("x", kScalarShape);
  const Var<double> y = seam(log(x), seams);  // NaN below 0
  const Var<double> loss = sum(square(y - std::log(0.5)));
  tape.write(x).data[0] = 2.5;  // the first step leads to −1.5
  GaussNewton<double> method(tape, {{{"x", {x}}, moving(0.5)}}, 1, seams);
  Index bad = 0;
  run(tape, loss, method, 60, [&](const StepReport& report) {
    CHECK(report.rolled_back == report.bad.has_value());
    if (report.rolled_back) ++bad;
  });
  CHECK(bad > 0);
  CHECK(method.rollbacks() == bad);
  CHECK(tape.value(x).scalar() == Approx(0.5).epsilon(0.02));
}

TEST_CASE("a product that is not finite is asked for again, nearer") {
  Tape<double> tape;
  SeamMode seams;
  const Var<double> x = tape.parameter("x", kScalarShape);
  const Var<double> loss = sum(square(seam(log(x), seams) - std::log(0.05)));
  tape.write(x).data[0] = 0.08;  // the first product is asked for at 0.08 − 0.1
  GaussNewton<double> method(tape, {{{"x", {x}}, moving(1)}}, 1, seams);
  bool was_bad_product = false;
  double nearest = HUGE_VAL;
  for (Index i = 0; i < 4; ++i) {
    const bool is_product = seams.of_change;
    tape.forward(loss);
    tape.backward(loss);
    const StepReport report = method.step(i, 4, tape.value(loss).scalar());
    was_bad_product = was_bad_product || (is_product && report.rolled_back);
    nearest = std::min(nearest, std::fabs(tape.value(x).scalar() - 0.05));
  }
  CHECK(was_bad_product);
  CHECK(nearest < 0.01);
}

TEST_CASE("a group with a learning rate of 0 keeps its numbers under gauss_newton") {
  Tape<double> tape;
  SeamMode seams;
  const Var<double> x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
  tape.write(x).data[0] = 3;
  tape.write(y).data[0] = 0.7;
  const Var<double> loss = sum(square(seam(x - 1.0, seams))) + sum(square(seam(y + x, seams)));
  GaussNewton<double> method(tape, {{{"x", {x}}, moving(0.1)}, {{"y", {y}}, moving(0)}}, 2, seams);
  run(tape, loss, method, 60);
  CHECK(tape.value(y).scalar() == 0.7);
  CHECK(tape.value(x).scalar() == Approx(0.15).epsilon(0.05));  // ((1 − 0.7)/2)
}

TEST_CASE("no number moves further than gauss_newton is said to") {
  struct Case {
    double lr;
    Index evaluations;
  };
  for (const auto& [lr, evaluations] : {Case{0.01, 3}, Case{0.001, 100}, Case{0.01, 100}}) {
    INFO("lr " << lr << ", evaluations " << evaluations);
    Rosenbrock<float> valley(6, 0);
    const std::vector<float> start = valley.numbers();
    const ParameterGroupSettings settings = moving(lr);
    GaussNewton<float> method(valley.tape, {{{"x", {valley.x}}, settings}}, 6, valley.seams);
    const double way = longest_gauss_newton_way(settings, evaluations);
    double furthest = 0;
    run(valley.tape, valley.loss, method, evaluations, [&](const StepReport&) {
      for (std::size_t i = 0; i < start.size(); ++i)
        furthest = std::max(furthest, std::fabs(static_cast<double>(valley.numbers()[i] - start[i])));
    });
    CHECK(furthest <= way);
    CHECK(furthest >= 0.25 * way);
  }
}

TEST_CASE("the steps of gauss_newton have the same bits for any number of threads", "[parallel]") {
  std::vector<float> first;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      Rosenbrock<float> valley(40);
      GaussNewton<float> method(valley.tape, {{{"x", {valley.x}}, moving(0.05)}}, 8, valley.seams);
      run(valley.tape, valley.loss, method, 40);
      if (first.empty()) first = valley.numbers();
      CHECK(valley.numbers() == first);
    });
  }
}

TEST_CASE("gauss_newton refuses what it cannot move") {
  Tape<double> tape;
  SeamMode seams;
  const Var<double> many = tape.parameter("many", shape_of(33, 32)), few = tape.parameter("few", shape_of(2, 3));
  CHECK_THROWS_WITH((GaussNewton<double>(tape, {{{"colours", {many}}, moving(1)}}, 3, seams)),
                    "gauss_newton keeps a matrix of all pairs of the numbers that move: 1056 numbers, at most 1024 are "
                    "allowed");
  OptimizerGroup<double> angles{{"global_orient", {few}}, moving(1)};
  angles.parameters.are_axis_angles = true;
  CHECK_THROWS_WITH((GaussNewton<double>(tape, {angles}, 3, seams)),
                    Contains("group \"global_orient\": gauss_newton does not move"));
}

TEST_CASE("a steady step of gauss_newton allocates nothing") {
  if (!test::allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  with_threads(1, [] {
    Rosenbrock<double> valley(20);
    GaussNewton<double> method(valley.tape, {{{"x", {valley.x}}, moving(0.1)}}, 4, valley.seams);
    constexpr Index kSteps = 40;
    Index i = 0;
    const auto round = [&] {
      for (Index k = 0; k < kSteps / 2; ++k) {
        valley.tape.forward(valley.loss);
        valley.tape.backward(valley.loss);
        method.step(i++, kSteps + 4, valley.tape.value(valley.loss).scalar());
      }
    };
    CHECK(test::steady_allocations(round) == 0);
    CHECK(i == kSteps);
    CHECK_FALSE(method.is_done());
  });
}

}  // namespace gauss_newton_test
