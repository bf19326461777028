#include "optim/whitened_adam.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "core/parallel.h"

namespace whitened_adam_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

constexpr Index kNumbers = 4;
constexpr double kRate = 0.01;

OptimizerGroup<double> group_of(Var<double> x, double lr = kRate) {
  OptimizerGroup<double> group{{"x", {x}}, {}};
  group.settings.lr = lr;
  return group;
}

OptimizerSettings whitened(double damping, int every) {
  OptimizerSettings settings;
  settings.kind = OptimizerKind::kWhitenedAdam;
  settings.damping = damping;
  settings.matrix_every = every;
  return settings;
}

/// ½ |A (x − 1)|². A is diagonal, or has rows that are nearly alike.
struct Bowl {
  Tape<double> tape;
  Var<double> x, loss;

  explicit Bowl(bool is_diagonal) {
    x = tape.parameter("x", shape_of(1, kNumbers));
    const Var<double> a = tape.constant("a", shape_of(kNumbers, kNumbers));
    for (Index r = 0; r < kNumbers; ++r) {
      for (Index c = 0; c < kNumbers; ++c) {
        const double scale = std::pow(10.0, static_cast<double>(r) - 2);
        tape.write(a).row(r)[c] = is_diagonal ? (r == c ? scale : 0) : 1 + (r == c ? 0.15 : 0);
      }
    }
    loss = sum(square(matmul(x - 1.0, a))) * 0.5;
  }
  double evaluate() {
    tape.forward(loss);
    tape.backward(loss);
    return tape.value(loss).scalar();
  }
  std::vector<double> numbers() const {
    const ConstArray<double> value = tape.value(x);
    return {value.data, value.data + kNumbers};
  }
  /// Numbers after so many steps.
  template <class Method>
  std::vector<double> after(Method& method, Index steps) {
    for (Index i = 0; i < steps; ++i) method.step(i, 1000, evaluate());
    return numbers();
  }
};

void check_near(const std::vector<double>& found, const std::vector<double>& expected) {
  for (std::size_t i = 0; i < expected.size(); ++i) CHECK(found[i] == Approx(expected[i]).epsilon(1e-9));
}

}  // namespace

TEST_CASE("where numbers are not correlated whitened_adam is Adam, whatever their scales") {
  Bowl plain(true), white(true);
  Adam<double> adam(plain.tape, {group_of(plain.x)}, {});
  WhitenedAdam<double> method(white.tape, white.loss, {group_of(white.x)}, whitened(0.01, 3));
  check_near(white.after(method, 20), plain.after(adam, 20));
}

TEST_CASE("where numbers look alike whitened_adam takes fewer steps than Adam") {
  const auto evaluations = [](auto&& make) {
    Bowl bowl(false);
    bowl.tape.set(bowl.x, {0.6, 1.3, 1.1, 0.7});
    auto method = make(bowl);
    const double goal = 1e-3 * bowl.evaluate();
    Index i = 0;
    for (; i < 2000 && bowl.evaluate() > goal; ++i) method->step(i, 2000, bowl.tape.value(bowl.loss).scalar());
    return i;
  };
  const Index adam = evaluations([](Bowl& bowl) {
    return std::make_unique<Adam<double>>(bowl.tape, std::vector{group_of(bowl.x)}, OptimizerSettings{});
  });
  const Index white = evaluations([](Bowl& bowl) {
    return std::make_unique<WhitenedAdam<double>>(bowl.tape, bowl.loss, std::vector{group_of(bowl.x)},
                                                  whitened(1e-3, 10));
  });
  INFO(adam << " steps of Adam, " << white << " whitened");
  CHECK(2 * white < adam);
}

TEST_CASE("a new matrix turns the moments along: an equal one changes nothing") {
  Bowl once(false), often(false);
  WhitenedAdam<double> first(once.tape, once.loss, {group_of(once.x)}, whitened(0.01, 1000)),
      second(often.tape, often.loss, {group_of(often.x)}, whitened(0.01, 1));
  check_near(often.after(second, 15), once.after(first, 15));
}

TEST_CASE("whitened_adam goes on from a matrix that it is given") {
  Bowl before(false), given(false), fresh(false);
  WhitenedAdam<double> maker(before.tape, before.loss, {group_of(before.x)}, whitened(0.01, 1000)),
      taker(given.tape, given.loss, {group_of(given.x)}, whitened(0.01, 1000)),
      own(fresh.tape, fresh.loss, {group_of(fresh.x)}, whitened(0.01, 1000));
  CHECK(maker.curvature().empty());
  before.after(maker, 1);
  const std::vector<double> learnt = maker.curvature();
  REQUIRE(learnt.size() == kNumbers * kNumbers);
  taker.set_curvature(learnt);
  const std::vector<double> taken = given.after(taker, 5), made = fresh.after(own, 5);
  CHECK(taken == made);
  Bowl other(false);
  WhitenedAdam<double> passing(other.tape, other.loss, {group_of(other.x)}, whitened(0.01, 1000));
  passing.set_curvature({1, 2, 3, 4});                              // of another number of numbers
  passing.set_curvature(std::vector<double>(learnt.size(), -1.0));  // not positive
  passing.set_curvature(std::vector<double>(learnt.size(), std::nan("")));
  CHECK(passing.curvature().empty());
  CHECK(other.after(passing, 5) == made);
}

TEST_CASE("a bad evaluation takes the last whitened step back, bitwise, and halves the rate") {
  Bowl bowl(false), twin(false);
  WhitenedAdam<double> method(bowl.tape, bowl.loss, {group_of(bowl.x)}, whitened(1, 10)),
      same(twin.tape, twin.loss, {group_of(twin.x)}, whitened(1, 10));
  const std::vector<double> good = bowl.after(method, 3);
  twin.after(same, 3);
  method.step(3, 1000, bowl.evaluate());
  const StepReport bad = method.step(4, 1000, std::numeric_limits<double>::quiet_NaN());
  CHECK(bad.rolled_back);
  CHECK(bad.undone);
  CHECK(bad.bad);
  CHECK(bowl.numbers() == good);
  CHECK(method.rollbacks() == 1);
  CHECK(method.bad_in_a_row() == 1);
  method.step(5, 1000, bowl.evaluate());
  same.step(3, 1000, twin.evaluate());
  const std::vector<double> slow = bowl.numbers(), fast = twin.numbers();
  for (std::size_t i = 0; i < kNumbers; ++i)
    CHECK(slow[i] - good[i] == Approx(0.5 * (fast[i] - good[i])).epsilon(1e-9));
  CHECK(method.bad_in_a_row() == 0);
}

TEST_CASE("groups of many numbers move by Adam beside whitened_adam") {
  Tape<double> tape;
  const Var<double> net = tape.parameter("net", shape_of(1, kMostMatrixNumbers + 1)),
                    x = tape.parameter("x", kScalarShape);
  const Var<double> loss = sum(square(x - 1.0)) + mean(square(net - 1.0));
  OptimizerGroup<double> slow = group_of(net);
  slow.parameters.name = "net";
  WhitenedAdam<double> method(tape, loss, {group_of(x), slow}, whitened(0.01, 1));
  tape.forward(loss);
  tape.backward(loss);
  const StepReport report = method.step(0, 10, tape.value(loss).scalar());
  REQUIRE(report.groups.size() == 2);
  CHECK(report.groups[1].moved);
  CHECK(tape.value(net).data[3] == Approx(kRate));
  CHECK(tape.value(x).scalar() == Approx(kRate));
  CHECK(method.undo());
  CHECK_FALSE(method.undo());
  CHECK(tape.value(net).data[3] == 0);
  CHECK(tape.value(x).scalar() == 0);
}

TEST_CASE("a group with a learning rate of 0 keeps its numbers under whitened_adam") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
  tape.set(y, {0.7});
  const Var<double> loss = sum(square(x - 1.0)) + sum(square(y + x));
  OptimizerGroup<double> still = group_of(y, 0);
  still.parameters.name = "y";
  WhitenedAdam<double> method(tape, loss, {group_of(x), still}, whitened(0.1, 2));
  for (Index i = 0; i < 60; ++i) {
    tape.forward(loss);
    tape.backward(loss);
    method.step(i, 60, tape.value(loss).scalar());
  }
  CHECK(tape.value(y).scalar() == 0.7);
  CHECK(tape.value(x).scalar() == Approx(0.15).margin(0.03));  // ((1 − 0.7)/2)
}

TEST_CASE("the steps of whitened_adam have the same bits for any number of threads", "[parallel]") {
  std::vector<double> first;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      Bowl bowl(false);
      WhitenedAdam<double> method(bowl.tape, bowl.loss, {group_of(bowl.x)}, whitened(0.01, 3));
      const std::vector<double> numbers = bowl.after(method, 10);
      if (first.empty()) first = numbers;
      CHECK(numbers == first);
    });
  }
}

TEST_CASE("whitened_adam refuses what it cannot move") {
  Tape<double> tape;
  const Var<double> few = tape.parameter("few", shape_of(2, 3));
  const Var<double> loss = sum(square(few));
  OptimizerGroup<double> angles = group_of(few);
  angles.parameters.are_axis_angles = true;
  CHECK_THROWS_WITH((WhitenedAdam<double>(tape, loss, {angles}, whitened(1, 1))),
                    Contains("whitened_adam does not move rotations as axis and angle"));
}

}  // namespace whitened_adam_test
