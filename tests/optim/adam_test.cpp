#include "optim/adam.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/measures.h"

namespace adam_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Parameters whose gradient is whatever `slopes` hold: loss = Σ slopes · x.
template <class S>
struct Slopes {
  Tape<S> tape;
  Var<S> x, slopes, loss;

  explicit Slopes(const Shape& shape) {
    x = tape.parameter("x", shape);
    slopes = tape.constant("slopes", shape);
    loss = sum(x * slopes);
  }
  OptimizerGroup<S> group(const ParameterGroupSettings& settings) const { return {{"all", {x}}, settings}; }
  StepReport step(Adam<S>& adam, Index i = 0, Index n = 1000) {
    tape.forward(loss);
    tape.backward(loss);
    return adam.step(i, n, 1.0);
  }
  std::vector<S> numbers() const {
    const ConstArray<S> value = tape.value(x);
    std::vector<S> all;
    for (Index r = 0; r < value.total_rows(); ++r) all.insert(all.end(), value.row(r), value.row(r) + value.shape.cols);
    return all;
  }
};

/// The definition, number by number.
struct TextbookAdam {
  double lr, beta1 = 0.9, beta2 = 0.999, eps = 1e-8;
  double m = 0, v = 0;
  int t = 0;

  double step(double x, double g) {
    ++t;
    m = beta1 * m + (1 - beta1) * g;
    v = beta2 * v + (1 - beta2) * g * g;
    const double m_hat = m / (1 - std::pow(beta1, t)), v_hat = v / (1 - std::pow(beta2, t));
    return x - lr * m_hat / (std::sqrt(v_hat) + eps);
  }
};

double slope_at(int step, int entry) { return std::sin(1.3 * step + 0.7 * entry) * std::pow(10.0, entry % 7 - 5); }

template <class S>
void check_trace(double tolerance) {
  // Padded rows, and more than one plane.
  const Shape shape{2, 3, 5, 16};
  Slopes<S> problem(shape);
  ParameterGroupSettings settings;
  settings.lr = 0.01;
  Adam<S> adam(problem.tape, {problem.group(settings)}, {});
  std::vector<TextbookAdam> textbook(30, {0.01});
  std::vector<double> expected(30, 0);
  for (int step = 0; step < 10; ++step) {
    std::vector<S> slopes;
    for (int k = 0; k < 30; ++k) slopes.push_back(static_cast<S>(slope_at(step, k)));
    problem.tape.set(problem.slopes, slopes);
    problem.step(adam, step);
    const std::vector<S> now = problem.numbers();
    for (std::size_t k = 0; k < 30; ++k) {
      expected[k] = textbook[k].step(expected[k], static_cast<double>(slopes[k]));
      INFO("step " << step << ", number " << k);
      CHECK(std::fabs(static_cast<double>(now[k]) - expected[k]) <= tolerance * 0.1);  // of ten steps of 0.01
    }
  }
}

}  // namespace

TEST_CASE("no number gets further in a stage than Adam is said to let it") {
  ParameterGroupSettings settings;
  settings.lr = 0.01;
  const Index n = 60;
  const auto furthest = [&](const auto& slope) {
    Slopes<double> slopes(kScalarShape);
    Adam<double> adam(slopes.tape, {slopes.group(settings)}, {});
    for (Index i = 0; i < n; ++i) {
      slopes.tape.write(slopes.slopes).data[0] = slope(i);
      slopes.step(adam, i, n);
    }
    return std::fabs(slopes.numbers()[0]);
  };
  for (const double share : {1.0, 0.05}) {
    settings.lr_final_share = share;
    const double way = longest_adam_way(settings, n, {});
    const double straight = furthest([](Index) { return 1.0; });
    CHECK(straight <= way);
    CHECK(straight > 0.6 * way);
    // Growing slopes are what makes a step longer than the rate.
    CHECK(furthest([](Index i) { return std::pow(1.1, static_cast<double>(i)); }) <= way);
    CHECK(furthest([](Index i) { return i < 3 ? 1e-12 : 1.0; }) <= way);
    for (int seed = 0; seed < 20; ++seed)
      CHECK(furthest([seed](Index i) { return std::sin(static_cast<double>(seed * 37 + i * i)); }) <= way);
  }
  settings.from = 10;
  settings.every = 5;
  CHECK(longest_adam_way(settings, n, {}) < 0.011 * 10);
}

TEST_CASE("Adam is the textbook's") {
  check_trace<double>(1e-14);
  check_trace<float>(1e-6);
}

TEST_CASE("the bias correction is right for small and large step counts") {
  for (const double beta : {0.5, 0.9, 0.999, 0.999999}) {
    double worst = 0;
    for (Index t = 1; t <= 1000000; t += t < 1000 ? 1 : 997) {
      const long double exact = -std::expm1(static_cast<long double>(t) * std::log(static_cast<long double>(beta)));
      worst = larger(worst, std::fabs(static_cast<double>(bias_correction(beta, t) / exact - 1)));
    }
    INFO("beta " << beta);
    CHECK(worst < 1e-12);
  }
  CHECK(bias_correction(0, 1) == 1);
  CHECK(std::fabs(bias_correction(0.999, 1) - 0.001) < 1e-18);
}

TEST_CASE("steps do not depend on the scale of the loss when eps does not count") {
  const auto trace = [](double scale, double eps) {
    Slopes<double> problem(shape_of(4, 3));
    ParameterGroupSettings settings;
    settings.lr = 0.01;
    OptimizerSettings optimizer;
    optimizer.eps = eps;
    Adam<double> adam(problem.tape, {problem.group(settings)}, optimizer);
    for (int step = 0; step < 10; ++step) {
      std::vector<double> slopes;
      for (int k = 0; k < 12; ++k) slopes.push_back(scale * std::sin(1.3 * step + 0.7 * k + 0.1));
      problem.tape.set(problem.slopes, slopes);
      problem.step(adam, step);
    }
    return problem.numbers();
  };
  const double scale = std::ldexp(1.0, -20);
  const std::vector<double> full = trace(1, 1e-15), small = trace(scale, 1e-15);
  for (std::size_t k = 0; k < full.size(); ++k) CHECK(small[k] == Approx(full[k]).epsilon(1e-4));
  CHECK(trace(scale, 1e-8 * scale) == trace(1, 1e-8));  // powers of two: to the bit
  CHECK(trace(scale, 1e-8) != trace(1, 1e-8));
}

// Rows D4 and F1: at step 7 of a run.
TEMPLATE_TEST_CASE("one bad number takes the step before it back, bitwise", "", float, double) {
  using S = TestType;
  const S largest = static_cast<S>(3e38);
  for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(),
                      -std::numeric_limits<S>::infinity(), largest}) {
    INFO("bad number " << bad);
    Slopes<S> problem(shape_of(5, 3));
    ParameterGroupSettings settings;
    settings.lr = 0.01;
    Adam<S> adam(problem.tape, {problem.group(settings)}, {});
    std::vector<S> slopes(15, S(0.5));
    problem.tape.set(problem.slopes, slopes);
    for (int i = 0; i < 5; ++i) problem.step(adam, i);
    const std::vector<S> after_five = problem.numbers();
    const GroupMoments moments = adam.moments("all");
    problem.step(adam, 5);
    CHECK(problem.numbers() != after_five);
    slopes[10] = bad;
    problem.tape.set(problem.slopes, slopes);
    const StepReport report = problem.step(adam, 6);
    CHECK(report.rolled_back);
    CHECK(report.undone);
    CHECK(report.rollbacks == 1);
    REQUIRE(report.bad.has_value());
    CHECK(report.bad->row == 3);
    CHECK(report.bad->col == 1);
    CHECK(report.bad->text().find("the gradient of group 'all', array 'x', row 3, column 1 is ") == 0);
    CHECK_FALSE(report.groups[0].moved);
    CHECK(problem.numbers() == after_five);
    CHECK(adam.moments("all") == moments);
    // The next clean step goes on, with half the learning rate.
    slopes[10] = S(0.5);
    problem.tape.set(problem.slopes, slopes);
    const StepReport next = problem.step(adam, 7);
    CHECK_FALSE(next.rolled_back);
    CHECK(next.rollbacks == 1);
    CHECK(next.groups[0].learning_rate == 0.005);
    CHECK(adam.moments("all").steps == 6);
    CHECK(static_cast<double>(after_five[0] - problem.numbers()[0]) == Approx(0.005).epsilon(1e-5));
  }
}

TEST_CASE("a denormal gradient counts as zero") {
  Slopes<float> problem(shape_of(2, 2));
  ParameterGroupSettings settings;
  settings.lr = 0.01;
  Adam<float> adam(problem.tape, {problem.group(settings)}, {});
  problem.tape.set(problem.slopes, {1, 1e-45f, 0, 1});
  const StepReport report = problem.step(adam);
  CHECK_FALSE(report.rolled_back);
  CHECK(problem.numbers()[1] == 0);
  CHECK(adam.moments("all").blocks[0].mean[1] == 0);
}

// Row D4.
TEST_CASE("a loss that is not finite is a bad step too") {
  Slopes<double> problem(shape_of(2, 2));
  ParameterGroupSettings settings;
  settings.lr = 0.01;
  Adam<double> adam(problem.tape, {problem.group(settings)}, {});
  problem.tape.set(problem.slopes, {1, 1, 1, 1});
  problem.tape.forward(problem.loss);
  problem.tape.backward(problem.loss);
  const StepReport report = adam.step(0, 10, std::numeric_limits<double>::infinity());
  CHECK(report.rolled_back);
  CHECK(report.bad->text() == "the loss is inf");
  CHECK(problem.numbers() == std::vector<double>(4, 0));
}

// Row D4.
TEST_CASE("bad evaluations in a row take one step back and halve the rate each, good ones double it in eight") {
  Slopes<float> problem(shape_of(5, 3));
  ParameterGroupSettings settings;
  settings.lr = 0.01;
  Adam<float> adam(problem.tape, {problem.group(settings)}, {});
  const std::vector<float> good(15, 0.5f), bad(15, std::numeric_limits<float>::quiet_NaN());
  problem.tape.set(problem.slopes, good);
  for (int i = 0; i < 5; ++i) problem.step(adam, i);
  const std::vector<float> after_five = problem.numbers();
  problem.step(adam, 5);
  problem.tape.set(problem.slopes, bad);
  CHECK(problem.step(adam, 6).undone);
  const StepReport second = problem.step(adam, 7);  // there is one step to take back, no more
  CHECK(second.rollbacks == 2);
  CHECK_FALSE(second.undone);
  CHECK(problem.numbers() == after_five);
  CHECK(adam.bad_in_a_row() == 2);
  problem.tape.set(problem.slopes, good);
  CHECK(problem.step(adam, 8).groups[0].learning_rate == 0.01 / 4);
  CHECK(adam.moments("all").steps == 6);
  for (int i = 9; i < 16; ++i) problem.step(adam, i);
  CHECK(problem.step(adam, 16).groups[0].learning_rate == Approx(0.01 / 2));
  CHECK(adam.bad_in_a_row() == 0);
  for (int i = 17; i < 26; ++i) problem.step(adam, i);
  CHECK(adam.rate() == 1);
}

// Row D4: a number that is pulled over the edge of a root does not end the way of another.
TEST_CASE("steps over an edge again and again do not end a stage") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", shape_of(1, 1)), y = tape.parameter("y", shape_of(1, 1));
  tape.set(x, {0.055});
  const Var<double> loss = sum(sqrt(x)) + sum(square(y - Operand<double>(5.0)));
  ParameterGroupSettings settings;
  settings.lr = 0.02;
  Adam<double> adam(tape, {{{"xy", {x, y}}, settings}}, {});
  Index most_in_a_row = 0;
  for (int i = 0; i < 400; ++i) {
    tape.forward(loss);
    tape.backward(loss);
    adam.step(i, 400, tape.value(loss).scalar());
    most_in_a_row = std::max(most_in_a_row, adam.bad_in_a_row());
  }
  CHECK(adam.rollbacks() > 5);
  CHECK(most_in_a_row <= 2);
  CHECK(tape.value(x).scalar() > 0);
}

// Row D9: whenever numbers get another meaning, steps under a constant slope are no longer than before.
TEST_CASE("steps after a row's mean was cleared are no longer than the rate") {
  for (const int before : {10, 63, 300, 1000}) {
    Slopes<double> problem(shape_of(1, 3));
    ParameterGroupSettings settings;
    settings.lr = 0.01;
    Adam<double> adam(problem.tape, {problem.group(settings)}, {});
    problem.tape.set(problem.slopes, std::vector<double>(3, 1));
    for (int i = 0; i < before; ++i) problem.step(adam, i);
    adam.clear_mean(problem.x, 0);
    double last = problem.numbers()[0], way = 0;
    for (int i = 0; i < 60; ++i) {
      problem.step(adam, before + i);
      const double step = last - problem.numbers()[0];
      last = problem.numbers()[0];
      CHECK(step <= 0.01 * (1 + 1e-6));
      way += step;
    }
    INFO("after " << before << " steps");
    CHECK(way > 0.8 * 60 * 0.01);
  }
}

TEST_CASE("groups move from, until and every as they are told") {
  Tape<double> tape;
  const auto a = tape.parameter("a", kScalarShape), b = tape.parameter("b", kScalarShape);
  const auto loss = a * 2.0 + b * 3.0;
  ParameterGroupSettings early, late;
  early.lr = late.lr = 0.01;
  early.until = 4;
  late.from = 3;
  late.every = 3;
  Adam<double> adam(tape, {{{"a", {a}}, early}, {{"b", {b}}, late}}, {});
  for (Index i = 0; i < 10; ++i) {
    tape.forward(loss);
    tape.backward(loss);
    const StepReport report = adam.step(i, 10, 0);
    INFO("iteration " << i);
    CHECK(report.groups[0].moved == (i < 4));
    CHECK(report.groups[1].moved == (i == 3 || i == 6 || i == 9));
    CHECK(report.groups[0].gradient_norm == (i < 4 ? 2 : 0));
  }
  CHECK(adam.moments("a").steps == 4);
  CHECK(adam.moments("b").steps == 3);
  CHECK(tape.value(a).scalar() == Approx(-0.04).epsilon(1e-6));
  CHECK(tape.value(b).scalar() == Approx(-0.03).epsilon(1e-6));
}

TEST_CASE("a bad gradient of a group that is off does no harm") {
  Tape<double> tape;
  const auto a = tape.parameter("a", kScalarShape), b = tape.parameter("b", kScalarShape);
  const auto loss = a + b * std::numeric_limits<double>::quiet_NaN();
  ParameterGroupSettings on, off;
  on.lr = off.lr = 0.01;
  off.from = 1;
  Adam<double> adam(tape, {{{"a", {a}}, on}, {{"b", {b}}, off}}, {});
  tape.forward(loss);
  tape.backward(loss);
  CHECK_FALSE(adam.step(0, 2, 0).rolled_back);
  CHECK(adam.step(1, 2, 0).rolled_back);
}

TEST_CASE("the learning rate falls geometrically to its final share") {
  ParameterGroupSettings settings;
  settings.lr = 0.02;
  CHECK(scheduled_rate(settings, 7, 10) == 0.02);
  settings.lr_final_share = 0.01;
  CHECK(scheduled_rate(settings, 0, 101) == 0.02);
  CHECK(scheduled_rate(settings, 50, 101) == Approx(0.002).epsilon(1e-14));
  CHECK(scheduled_rate(settings, 100, 101) == Approx(0.0002).epsilon(1e-14));
  CHECK(scheduled_rate(settings, 0, 1) == 0.02);
}

TEST_CASE("steps are the same for any number of threads", "[parallel]") {
  const auto trace = [](int threads) {
    std::vector<float> result;
    std::vector<double> norms;
    with_threads(threads, [&] {
      Slopes<float> problem(shape_of(30000, 3));
      ParameterGroupSettings settings;
      settings.lr = 0.01;
      Adam<float> adam(problem.tape, {problem.group(settings)}, {});
      for (int step = 0; step < 5; ++step) {
        std::vector<float> slopes;
        for (int k = 0; k < 90000; ++k) slopes.push_back(static_cast<float>(slope_at(step, k)));
        problem.tape.set(problem.slopes, slopes);
        norms.push_back(problem.step(adam, step).groups[0].gradient_norm);
      }
      result = problem.numbers();
    });
    return std::pair(result, norms);
  };
  const auto one = trace(1);
  for (const int threads : {2, 3, 8}) CHECK(trace(threads) == one);
}

TEST_CASE("an optimiser goes on from stored moments as if it had never stopped") {
  const auto run = [](int stop_after) {
    Slopes<float> problem(shape_of(4, 3));
    ParameterGroupSettings settings;
    settings.lr = 0.01;
    auto adam = std::make_unique<Adam<float>>(problem.tape, std::vector{problem.group(settings)}, OptimizerSettings{});
    for (int step = 0; step < 20; ++step) {
      if (step == stop_after) {
        const GroupMoments moments = adam->moments("all");
        adam = std::make_unique<Adam<float>>(problem.tape, std::vector{problem.group(settings)}, OptimizerSettings{});
        adam->set_moments("all", moments);
        CHECK_FALSE(adam->undo());
      }
      std::vector<float> slopes;
      for (int k = 0; k < 12; ++k) slopes.push_back(static_cast<float>(slope_at(step, k)));
      problem.tape.set(problem.slopes, slopes);
      problem.step(*adam, step);
    }
    return problem.numbers();
  };
  CHECK(run(7) == run(-1));
}

TEST_CASE("moments of other parameters are refused, and the means of rows can be cleared") {
  Slopes<double> problem(shape_of(4, 3));
  ParameterGroupSettings settings;
  settings.lr = 0.01;
  Adam<double> adam(problem.tape, {problem.group(settings)}, {});
  problem.tape.set(problem.slopes, std::vector<double>(12, 1));
  problem.step(adam);
  GroupMoments moments = adam.moments("all");
  adam.clear_mean(problem.x, 2);
  const GroupMoments cleared = adam.moments("all");
  for (std::size_t k = 0; k < 12; ++k) {
    CHECK(cleared.blocks[0].mean[k] == (k / 3 == 2 ? 0 : moments.blocks[0].mean[k]));
    CHECK(cleared.blocks[0].square[k] == moments.blocks[0].square[k]);
  }
  REQUIRE(adam.undo());  // takes the step back with what was forgotten since
  CHECK(problem.tape.value(problem.x)(2, 0) == 0);
  CHECK(adam.moments("all").blocks[0].mean == std::vector<double>(12, 0));
  moments.blocks[0].mean.pop_back();
  CHECK_THROWS_AS(adam.set_moments("all", moments), DataError);
  CHECK_THROWS_AS(adam.moments("none"), InternalError);
  using Groups = std::vector<OptimizerGroup<double>>;
  CHECK_THROWS_AS(Adam<double>(problem.tape, Groups{{{"a", {problem.x, problem.x}}, settings}}, {}), InternalError);
  CHECK_THROWS_AS(Adam<double>(problem.tape, Groups{{{"a", {problem.loss}}, settings}}, {}), InternalError);
}

TEST_CASE("a steady step allocates nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      Slopes<float> problem(shape_of(9000, 3));
      ParameterGroupSettings settings;
      settings.lr = 0.01;
      Adam<float> adam(problem.tape, {problem.group(settings)}, {});
      problem.tape.set(problem.slopes, std::vector<float>(27000, 0.5f));
      CHECK(steady_allocations([&] {
              for (int i = 0; i < 30; ++i) problem.step(adam, i);
            }) == 0);
    });
  }
}

}  // namespace adam_test
