#include "autodiff/gradcheck.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"

namespace gradcheck_test {

using namespace hsi4d;
using Catch::Contains;

namespace {

/// y = a b elementwise with an adjoint that is wrong on purpose.
enum class Fault { kNone, kHalved, kZero, kOverwrites, kOneEntry, kSign };

struct FaultyProductOp {
  static constexpr const char* kName = "faulty_product";
  Fault fault;
  void forward(NodeIo<double>& io) {
    for (Index i = 0; i < io.out().shape.count(); ++i) io.out().data[i] = io.in(0).data[i] * io.in(1).data[i];
  }
  void backward(NodeIo<double>& io) {
    for (Index i = 0; i < io.d_out().shape.count(); ++i) {
      const double d = io.d_out().data[i];
      io.d_in(0).data[i] += io.in(1).data[i] * d;
      double d_b = io.in(0).data[i] * d;
      if (fault == Fault::kHalved) d_b *= 0.5;
      if (fault == Fault::kZero) d_b = 0;
      if (fault == Fault::kSign) d_b = -d_b;
      if (fault == Fault::kOneEntry && i == 7) d_b *= 1.001;
      if (fault == Fault::kOverwrites) {
        io.d_in(1).data[i] = d_b;
      } else {
        io.d_in(1).data[i] += d_b;
      }
    }
  }
};

GradcheckReport check(Fault fault, bool b_has_other_users) {
  Tape<double> tape;
  const auto a = tape.parameter("a", shape_of(4, 3));
  const auto b = tape.parameter("b", shape_of(4, 3));
  for (Index i = 0; i < 12; ++i) {
    tape.write(a).data[i] = std::sin(static_cast<double>(i) + 0.5);
    tape.write(b).data[i] = std::cos(static_cast<double>(i) * 1.7);
  }
  auto y = exp(tape.record(FaultyProductOp{fault}, {a, b}, a.shape(), Source::current()));
  if (b_has_other_users) y = y + sin(b);
  return gradcheck(tape, mean(y));
}

}  // namespace

TEST_CASE("a right adjoint passes the gradient check") {
  const GradcheckReport report = check(Fault::kNone, true);
  INFO(report.text());
  CHECK(report.ok());
  CHECK(report.kinks == 0);
  CHECK(report.entries >= 24 * 2);
  CHECK(report.worst_error < 1e-9);
}

TEST_CASE("a wrong adjoint is caught, and the operator, input and entry are named") {
  for (const Fault fault : {Fault::kHalved, Fault::kZero, Fault::kSign, Fault::kOneEntry}) {
    const GradcheckReport report = check(fault, false);
    INFO(report.text());
    CHECK_FALSE(report.ok());
    bool named = false;
    for (const GradcheckFailure& failure : report.failures) {
      CHECK(failure.array == "b");  // a's gradient is right and is not blamed
      CHECK((failure.node == "faulty_product" || failure.node == "whole tape"));
      named = named || failure.node == "faulty_product";
      if (fault == Fault::kOneEntry) {
        CHECK(failure.row == 2);
        CHECK(failure.col == 1);
      }
    }
    CHECK(named);
    CHECK_THAT(report.text(),
               Contains("faulty_product (gradcheck_test.cpp:") && Contains("gradient of 'b' is wrong at "));
  }
}

TEST_CASE("an adjoint that overwrites instead of adding is caught where the input has other users") {
  const GradcheckReport report = check(Fault::kOverwrites, true);
  INFO(report.text());
  CHECK_FALSE(report.ok());
  CHECK_THAT(report.text(), Contains("whole tape: gradient of 'b'") && Contains("faulty_product (gradcheck_test.cpp:"));
}

namespace {

/// y = x³ for x above a threshold, else x: a jump. Its signature tells the two sides apart.
struct JumpOp {
  static constexpr const char* kName = "jump";
  void forward(NodeIo<double>& io) {
    const double x = io.in(0).scalar();
    io.out().scalar() = x > 1 ? x * x * x + 5 : x;
  }
  void backward(NodeIo<double>& io) {
    const double x = io.in(0).scalar();
    io.d_in(0).scalar() += io.d_out().scalar() * (x > 1 ? 3 * x * x : 1);
  }
  void add_signature(Signature& signature, NodeIo<double>& io) { signature.add(io.in(0).scalar() > 1); }
};

}  // namespace

TEST_CASE("a kink is told from a bug, and too many kinks are not a pass") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  const auto y = tape.record(JumpOp{}, {x}, kScalarShape, Source::current());
  tape.set(x, {2});
  CHECK(gradcheck(tape, y).ok());
  tape.set(x, {1.0001});
  const GradcheckReport report = gradcheck(tape, y);
  CHECK(report.failures.empty());
  CHECK(report.kinks == 2);
  CHECK(report.too_many_kinks);
  CHECK_FALSE(report.ok());
}

TEST_CASE("a kink at the point itself is seen, where central differences of all steps agree") {
  for (const double at : {1e-12, 3e-9, 2e-7, 1e-5, 3e-4}) {
    for (const bool is_upside_down : {false, true}) {
      INFO("|x| at " << at);
      Tape<double> tape;
      const auto x = tape.parameter("x", shape_of(20, 1));
      for (Index i = 0; i < 20; ++i) tape.write(x).data[i] = i == 7 ? at : 0.3 + 0.02 * static_cast<double>(i);
      const auto y = abs(x) * (is_upside_down ? -2.0 : 0.5);
      GradcheckOptions options;
      options.kink_share = 0.25;
      const GradcheckReport report = gradcheck(tape, sum(y + square(x)), options);
      INFO(report.text());
      CHECK(report.failures.empty());
      CHECK(report.kinks >= 1);
      CHECK(report.worst_error < 1e-7);
      CHECK(report.ok());
    }
  }
}

TEST_CASE("where a choice changes within the step shorter ones are tried, if any are allowed") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  const auto y = tape.record(JumpOp{}, {x}, kScalarShape, Source::current());
  tape.set(x, {1.0001});
  GradcheckOptions options;
  options.tolerance = 1e-6;
  options.shortest_step = 1e-5;
  CHECK(gradcheck(tape, y, options).ok());
  CHECK(gradcheck(tape, y, options).kinks == 0);
  tape.set(x, {1.00001});
  CHECK(gradcheck(tape, y, options).kinks == 2);
}

namespace {

/// y = x², which throws away from its first value.
struct FragileOp {
  static constexpr const char* kName = "fragile";
  void forward(NodeIo<double>& io) {
    if (io.in(0).scalar() > 3.001) throw DataError("too far");
    io.out().scalar() = io.in(0).scalar() * io.in(0).scalar();
  }
  void backward(NodeIo<double>& io) { io.d_in(0).scalar() += 2 * io.in(0).scalar() * io.d_out().scalar(); }
};

}  // namespace

TEST_CASE("values are restored when an evaluation throws, and a check of nothing is no pass") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  tape.set(x, {3});
  const auto y = tape.record(FragileOp{}, {x}, kScalarShape, Source::current());
  CHECK_THROWS_AS(gradcheck(tape, y), DataError);
  CHECK(tape.value(x).scalar() == 3);
  tape.forward(y);
  CHECK(tape.value(y).scalar() == 9);
  tape.freeze(x);
  CHECK_FALSE(gradcheck(tape, y).ok());
}

TEST_CASE("values are restored after a check") {
  Tape<double> tape;
  const auto x = tape.parameter("x", shape_of(3, 3));
  for (Index i = 0; i < 9; ++i) tape.write(x).data[i] = 0.1 * static_cast<double>(i) + 0.3;
  const auto loss = sum(log(matmul(x, x)));
  tape.forward(loss);
  tape.backward(loss);
  const double value = tape.value(loss).scalar();
  const double slope = tape.gradient(x)(1, 2);
  CHECK(gradcheck(tape, loss).ok());
  tape.forward(loss);
  tape.backward(loss);
  CHECK(tape.value(loss).scalar() == value);
  CHECK(tape.gradient(x)(1, 2) == slope);
}

}  // namespace gradcheck_test
