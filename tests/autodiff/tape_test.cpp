#include "autodiff/tape.h"

#include <limits>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/inspect.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"

namespace tape_test {

using namespace hsi4d;
using Catch::Contains;

namespace {

/// y = x² with a record of how it was run.
struct CountingOp {
  static constexpr const char* kName = "counting";
  int* forwards;
  int* backwards;
  void forward(NodeIo<double>& io) {
    ++*forwards;
    for (Index i = 0; i < io.in(0).shape.count(); ++i) io.out().data[i] = io.in(0).data[i] * io.in(0).data[i];
  }
  void backward(NodeIo<double>& io) {
    ++*backwards;
    for (Index i = 0; i < io.in(0).shape.count(); ++i) io.d_in(0).data[i] += 2 * io.in(0).data[i] * io.d_out().data[i];
  }
};

/// y = x + (a table that depends on the sign of x alone), kept between runs under its key.
struct StatefulOp {
  static constexpr const char* kName = "stateful";
  int* builds;
  double table = 0;
  std::uint64_t state_key(NodeIo<double>& io) { return io.in(0).scalar() > 0 ? 1 : 2; }
  void build_state(NodeIo<double>& io) {
    ++*builds;
    table = io.in(0).scalar() > 0 ? 10 : 20;
  }
  void forward(NodeIo<double>& io) { io.out().scalar() = io.in(0).scalar() + table; }
  void backward(NodeIo<double>& io) { io.d_in(0).scalar() += io.d_out().scalar(); }
  void add_signature(Signature& signature, NodeIo<double>& io) { signature.add(state_key(io)); }
};

/// Two outputs: x² and x³. A missing output adjoint costs nothing.
struct TwoOutputsOp {
  static constexpr const char* kName = "two_outputs";
  bool* saw_first;
  bool* saw_second;
  void forward(NodeIo<double>& io) {
    const double x = io.in(0).scalar();
    io.out(0).scalar() = x * x;
    io.out(1).scalar() = x * x * x;
  }
  void backward(NodeIo<double>& io) {
    const double x = io.in(0).scalar();
    *saw_first = static_cast<bool>(io.d_out(0));
    *saw_second = static_cast<bool>(io.d_out(1));
    if (io.d_out(0)) io.d_in(0).scalar() += 2 * x * io.d_out(0).scalar();
    if (io.d_out(1)) io.d_in(0).scalar() += 3 * x * x * io.d_out(1).scalar();
  }
};

struct ThrowingOp {
  static constexpr const char* kName = "throwing";
  bool* fail;
  void forward(NodeIo<double>& io) {
    run_chunks(8, [&](Index chunk) {
      if (*fail && chunk >= 3) throw DataError("chunk " + std::to_string(chunk));
    });
    io.out().scalar() = io.in(0).scalar();
  }
  void backward(NodeIo<double>& io) { io.d_in(0).scalar() += io.d_out().scalar(); }
};

struct Counted {
  Tape<double> tape;
  int forwards = 0, backwards = 0;
  Var<double> add(Var<double> x) {
    return tape.record(CountingOp{&forwards, &backwards}, {x}, x.shape(), Source::current());
  }
};

}  // namespace

TEST_CASE("recorded once, replayed many times") {
  Tape<double> tape;
  const auto x = tape.parameter("x", shape_of(2, 2));
  const auto loss = sum(square(x) * 0.5);
  for (const double scale : {1.0, 3.0}) {
    tape.set(x, {scale, 2 * scale, 3 * scale, 4 * scale});
    tape.forward(loss);
    tape.backward(loss);
    CHECK(tape.value(loss).scalar() == 15 * scale * scale);
    for (Index i = 0; i < 4; ++i) CHECK(tape.gradient(x).data[i] == tape.value(x).data[i]);
  }
}

TEST_CASE("forward runs only nodes whose inputs changed") {
  Counted c;
  const auto x = c.tape.parameter("x", kScalarShape);
  const auto constant = c.tape.constant("target", kScalarShape);
  const auto squared_target = c.add(constant);
  const auto loss = square(x) + squared_target;
  c.tape.set(constant, {3});
  for (int i = 0; i < 5; ++i) {
    c.tape.set(x, {static_cast<double>(i)});
    c.tape.forward(loss);
    CHECK(c.tape.value(loss).scalar() == i * i + 9);
  }
  CHECK(c.forwards == 1);
  c.tape.set(constant, {4});
  c.tape.forward(loss);
  CHECK(c.forwards == 2);
  CHECK(c.tape.value(loss).scalar() == 32);
}

TEST_CASE("frozen and unreachable inputs cost nothing") {
  Counted c;
  const auto x = c.tape.parameter("x", kScalarShape);
  const auto y = c.tape.parameter("y", kScalarShape);
  const auto unrelated = c.tape.parameter("unrelated", kScalarShape);
  c.tape.set(x, {3});
  c.tape.set(y, {5});
  const auto from_x = c.add(x);
  const auto loss = from_x * y;
  const auto other = c.add(unrelated);
  c.tape.freeze(x);
  c.tape.forward(loss);
  c.tape.backward(loss);
  CHECK(c.backwards == 0);
  CHECK(c.forwards == 1);  // `other` is not on the way
  CHECK_FALSE(c.tape.has_gradient(x));
  CHECK_FALSE(c.tape.has_gradient(from_x));
  CHECK_FALSE(c.tape.has_gradient(unrelated));
  CHECK(c.tape.gradient(y).scalar() == 9);
  CHECK_THROWS_WITH(c.tape.gradient(x), Contains("'x' has no gradient"));
  for (const NodeStatistics& node : c.tape.statistics()) {
    if (node.name == "counting") CHECK(node.adjoint_bytes == 0);
  }
  c.tape.unfreeze(x);
  c.tape.forward(loss);
  c.tape.backward(loss);
  CHECK(c.tape.gradient(x).scalar() == 30);
  CHECK(c.backwards == 1);
  (void)other;
}

TEST_CASE("backward after a write, a freeze or without forward is an error") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  const auto loss = square(x);
  CHECK_THROWS_AS(tape.backward(loss), StaleError);
  tape.forward(loss);
  tape.set(x, {1});
  CHECK_THROWS_WITH(tape.backward(loss), Contains("Stale: array 'x' was written"));
  tape.forward(loss);
  CHECK_NOTHROW(tape.backward(loss));
  CHECK_NOTHROW(tape.backward(loss));
  tape.freeze(x);
  CHECK_THROWS_AS(tape.backward(loss), StaleError);
  tape.unfreeze(x);
  const auto other = x * 2.0;
  tape.forward(loss);
  tape.set(x, {2});
  tape.forward(other);  // brings another result up to date, not this one
  CHECK_THROWS_AS(tape.backward(loss), StaleError);
}

TEST_CASE("several results on one tape keep their own gradients") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  const auto y = tape.parameter("y", kScalarShape);
  tape.set(x, {2});
  tape.set(y, {3});
  const auto first = x * y;
  const auto second = square(x);
  for (int repeat = 0; repeat < 3; ++repeat) {
    tape.forward(first);
    tape.forward(second);
    tape.backward(first);
    CHECK(tape.gradient(x).scalar() == 3);
    CHECK(tape.gradient(y).scalar() == 2);
    tape.backward(second);
    CHECK(tape.gradient(x).scalar() == 4);
    CHECK_FALSE(tape.has_gradient(y));
  }
}

TEST_CASE("an intermediate can be frozen: no gradient flows behind it") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  tape.set(x, {2});
  const auto inner = square(x);
  const auto loss = inner * x;
  tape.freeze(inner);
  tape.forward(loss);
  tape.backward(loss);
  CHECK(tape.gradient(x).scalar() == 4);
  CHECK_FALSE(tape.has_gradient(inner));
  tape.unfreeze(inner);
  tape.forward(loss);
  tape.backward(loss);
  CHECK(tape.gradient(x).scalar() == 12);
}

TEST_CASE("what is held stays as it is, costs nothing, and follows its inputs again when it is released") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape);
  const auto curved = exp(x);
  const auto loss = square(curved * y);
  CHECK_THROWS_AS(tape.hold(x), InternalError);
  CHECK_THROWS_AS(tape.hold(curved), InternalError);  // not computed yet
  const auto run = [&](double new_x, double new_y) {
    tape.set(x, {new_x});
    tape.set(y, {new_y});
    tape.forward(loss);
    tape.backward(loss);
    return tape.value(loss).scalar();
  };
  const double e = std::exp(1.0);
  CHECK(run(1, 1) == Approx(e * e).epsilon(1e-14));
  tape.hold(curved);
  CHECK(tape.held(curved));
  CHECK_THROWS_AS(tape.backward(loss), StaleError);
  CHECK(run(2, 3) == Approx(9 * e * e).epsilon(1e-14));
  CHECK(tape.counters().forward_nodes == 2);
  CHECK_FALSE(tape.has_gradient(x));
  CHECK(tape.gradient(y).scalar() == Approx(2 * 3 * e * e).epsilon(1e-14));
  tape.forward(curved);  // asked for by itself
  CHECK(tape.value(curved).scalar() == Approx(e * e).epsilon(1e-14));
  tape.hold(curved);
  tape.release(curved);
  CHECK_FALSE(tape.held(curved));
  CHECK(run(0.5, 3) == Approx(9 * e).epsilon(1e-14));
  CHECK(tape.gradient(x).scalar() == Approx(2 * 9 * e).epsilon(1e-14));
}

TEST_CASE("what is held is held by a tape without skips too") {
  Tape<double> tape;
  tape.set_skips({.frozen_inputs = false, .unchanged_inputs = false, .unread_pixels = false});
  const auto x = tape.parameter("x", kScalarShape);
  const auto held = exp(x), loss = held * x;
  tape.set(x, {0.0});
  tape.forward(loss);
  tape.hold(held);
  tape.set(x, {5.0});
  tape.forward(loss);
  tape.backward(loss);
  CHECK(tape.value(loss).scalar() == 5);
  CHECK(tape.gradient(x).scalar() == 1);
}

TEST_CASE("nothing runs backward behind a frozen array, and no NaN leaks from there (row C11)") {
  Counted c;
  const auto x = c.tape.parameter("x", kScalarShape);
  c.tape.set(x, {0});
  const auto far = c.add(c.add(log(x)));
  const auto loss = exp(stop_gradient(min(far, 5.0 + 0.0 * x))) + x;
  c.tape.forward(loss);
  c.tape.backward(loss);
  CHECK(c.backwards == 0);
  CHECK(c.tape.gradient(x).scalar() == 1);
  const auto only_behind = stop_gradient(c.add(x)) * 2.0;
  c.tape.forward(only_behind);
  c.tape.backward(only_behind);
  CHECK(c.backwards == 0);
  CHECK_FALSE(c.tape.has_gradient(x));
}

TEST_CASE("an operator may have several outputs, an unused one has no adjoint") {
  Tape<double> tape;
  bool first = false, second = false;
  const auto x = tape.parameter("x", kScalarShape);
  tape.set(x, {2});
  const std::array inputs = {x};
  const std::array shapes = {kScalarShape, kScalarShape};
  const auto square_of_x = tape.record(TwoOutputsOp{&first, &second}, std::span<const Var<double>>(inputs),
                                       std::span<const Shape>(shapes), Source::current());
  const auto cube_of_x = tape.output(square_of_x, 1);
  tape.forward(cube_of_x);
  tape.backward(cube_of_x);
  CHECK(tape.value(cube_of_x).scalar() == 8);
  CHECK(tape.gradient(x).scalar() == 12);
  CHECK_FALSE(first);
  CHECK(second);
  const auto both = square_of_x + cube_of_x;
  tape.forward(both);
  tape.backward(both);
  CHECK(tape.gradient(x).scalar() == 16);
  CHECK(first);
  CHECK_THROWS_AS(tape.output(x, 0), InternalError);
}

TEST_CASE("mark and rewind forget a suffix, old handles are refused") {
  Tape<double> tape;
  const auto x = tape.parameter("x", shape_of(100, 3));
  const auto mark = tape.mark();
  Var<double> old;
  Index bytes = 0;
  for (int round = 0; round < 5; ++round) {
    const auto loss = round % 2 == 0 ? sum(square(x)) : sum(exp(x) * x);
    tape.forward(loss);
    tape.backward(loss);
    CHECK(tape.has_gradient(x));
    old = loss;
    tape.rewind(mark);
    if (round == 2) bytes = tape.memory_bytes();
  }
  CHECK(tape.memory_bytes() == bytes);
  CHECK_THROWS_WITH(tape.forward(old), Contains("before a rewind"));
  const auto loss = sum(x);
  CHECK_THROWS_WITH(tape.forward(old), Contains("before a rewind"));
  CHECK_NOTHROW(tape.forward(loss));
  Tape<double> other;
  CHECK_THROWS_WITH(other.forward(loss), Contains("another tape"));
  CHECK_THROWS_WITH(other.forward({}), Contains("empty Var"));
}

TEST_CASE("a mark of a rewound recording is refused") {
  Tape<double> tape;
  const auto start = tape.mark();
  tape.parameter("old", shape_of(10, 1));
  const auto stale = tape.mark();
  tape.rewind(start);
  tape.parameter("first", shape_of(1000, 1));
  tape.parameter("second", shape_of(1000, 1));
  CHECK_THROWS_WITH(tape.rewind(stale), Contains("recording that was rewound"));
}

TEST_CASE("a record that fails leaves the tape as it was") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  bool fail = false;
  CHECK_THROWS_AS(tape.record(ThrowingOp{&fail}, {x}, Shape{1, 2, 3, 1}, Source::current()), InternalError);
  const std::vector<Var<double>> many(65, x);
  CHECK_THROWS_WITH(tape.record(ThrowingOp{&fail}, many, std::array{kScalarShape}, Source::current()),
                    Contains("throwing: 65 inputs; at most 64"));
  CHECK(tape.statistics().empty());
  const auto loss = square(x);
  tape.set(x, {3});
  tape.forward(loss);
  CHECK(tape.value(loss).scalar() == 9);
}

TEST_CASE("declared state is a function of its key, and can be dropped") {
  Tape<double> tape;
  int builds = 0;
  const auto x = tape.parameter("x", kScalarShape);
  const auto y = tape.record(StatefulOp{&builds}, {x}, kScalarShape, Source::current());
  const auto at = [&](double value) {
    tape.set(x, {value});
    tape.forward(y);
    return tape.value(y).scalar();
  };
  CHECK(at(1) == 11);
  CHECK(at(2) == 12);
  CHECK(builds == 1);
  const std::uint64_t positive = tape.signature(y);
  CHECK(at(-1) == 19);
  CHECK(builds == 2);
  CHECK(tape.signature(y) != positive);
  CHECK(at(2) == 12);
  CHECK(tape.signature(y) == positive);
  tape.drop_state();
  tape.forward(y);
  CHECK(builds == 4);
}

TEST_CASE("after an error in a node the tape wants another forward", "[parallel]") {
  Tape<double> tape;
  bool fail = false;
  const auto x = tape.parameter("x", kScalarShape);
  const auto loss = square(tape.record(ThrowingOp{&fail}, {x}, kScalarShape, Source::current()));
  tape.set(x, {3});
  tape.forward(loss);
  fail = true;
  tape.set(x, {4});
  CHECK_THROWS_WITH(tape.forward(loss), "chunk 3");
  CHECK_THROWS_AS(tape.backward(loss), StaleError);
  fail = false;
  tape.forward(loss);
  tape.backward(loss);
  CHECK(tape.gradient(x).scalar() == 8);
}

TEST_CASE("anomaly mode names the first non-finite number") {
  Tape<double> tape;
  tape.set_anomaly(true);
  const auto x = tape.parameter("x", shape_of(2, 3));
  tape.set(x, {1, 2, 3, 4, -5, 6});
  const auto y = tape.name(log(x), "log of x");
  const auto loss = sum(y * 2.0);
  try {
    tape.forward(loss);
    FAIL("no error");
  } catch (const NonFiniteError& error) {
    CHECK(error.place().node == "log");
    CHECK(error.place().array == "log of x");
    CHECK(error.place().phase == "forward");
    CHECK(error.place().row == 1);
    CHECK(error.place().col == 1);
    CHECK_THAT(error.place().source, Contains("tape_test.cpp:"));
    CHECK_THAT(error.what(), Contains("nan in forward of 'log' (recorded at tape_test.cpp:") &&
                                 Contains("array 'log of x', row 1, column 1"));
  }
  tape.set(x, {1, 2, 3, 4, 5, std::numeric_limits<double>::infinity()});
  CHECK_THROWS_WITH(tape.forward(loss), Contains("inf in forward of 'leaf'") && Contains("'x', row 1, column 2"));
  const auto scaled = sum(log(x) * 1e150);  // finite at 1e-200; its gradient 1e150 / x is not
  tape.set(x, {1, 1e-200, 3, 4, 5, 6});
  tape.forward(scaled);
  CHECK_THROWS_WITH(tape.backward(scaled), Contains("inf in backward of 'log'") && Contains("row 0, column 1"));
  CHECK_THROWS_AS(tape.backward(scaled), StaleError);
  CHECK_FALSE(tape.has_gradient(x));
}

TEST_CASE("anomaly mode looks at what ran before it was switched on, and again after an error") {
  Tape<double> tape;
  const auto x = tape.parameter("x", kScalarShape);
  const auto loss = log(x);
  tape.set(x, {-1});
  tape.forward(loss);
  tape.set_anomaly(true);
  for (int repeat = 0; repeat < 2; ++repeat) CHECK_THROWS_AS(tape.forward(loss), NonFiniteError);
  CHECK_THROWS_AS(tape.backward(loss), StaleError);
}

TEST_CASE("after an error other results that share its nodes want a forward too") {
  Tape<double> tape;
  bool fail = false;
  const auto x = tape.parameter("x", kScalarShape);
  const auto shared = tape.record(ThrowingOp{&fail}, {square(x)}, kScalarShape, Source::current());
  const auto first = shared * 2.0, second = shared + x;
  tape.forward(first);
  tape.forward(second);
  fail = true;
  tape.write(x);
  CHECK_THROWS_AS(tape.forward(first), DataError);
  CHECK_THROWS_AS(tape.backward(second), StaleError);
}

TEST_CASE("statistics count runs, skips, time and memory") {
  Tape<float> tape;
  tape.set_profiling(true);
  const auto x = tape.parameter("x", shape_of(1000, 3));
  const auto loss = sum(square(x));
  tape.forward(loss);
  tape.forward(loss);
  tape.backward(loss);
  const auto nodes = tape.statistics();
  REQUIRE(nodes.size() == 2);
  CHECK(nodes[0].name == "square");
  CHECK(nodes[0].forward_runs == 1);
  CHECK(nodes[0].forward_skips == 1);
  CHECK(nodes[0].backward_runs == 1);
  CHECK(nodes[0].forward_ns > 0);
  CHECK(nodes[0].value_bytes == 12000);
  CHECK(nodes[0].adjoint_bytes == 12000);
  CHECK(tape.memory_bytes() >= 4 * 12000);
  tape.clear_statistics();
  CHECK(tape.statistics()[0].forward_runs == 0);
}

TEST_CASE("the graph is drawn with operators, leaves, shapes and source lines") {
  Tape<double> tape;
  const auto x = tape.parameter("points \"p\"", shape_of(4, 3));
  const auto c = tape.constant("target", shape_of(4, 3));
  const auto loss = tape.name(sum(square(x - c)), "loss");
  const std::string dot = graphviz(tape, loss);
  CHECK_THAT(dot, Contains("digraph tape {"));
  CHECK_THAT(dot, Contains("label=\"subtract\\ntape_test.cpp:"));
  CHECK_THAT(dot, Contains("label=\"points \\\"p\\\"\""));
  CHECK_THAT(dot, Contains("label=\"[4,3]\""));
  CHECK_THAT(dot, Contains("sum\\nloss\\n"));
  CHECK_THAT(dot, Contains("color=gray60, label=\"target\""));
}

TEST_CASE("misuse is refused with a clear message") {
  Tape<double> tape;
  const auto x = tape.parameter("x", shape_of(2, 3));
  const auto c = tape.constant("c", kScalarShape);
  const auto y = square(x);
  tape.name(y, "y");
  const Var<double> empty;
  CHECK_THROWS_WITH(x * empty, Contains("an empty Var"));
  CHECK_THROWS_WITH(empty * x, Contains("an empty Var"));
  CHECK_THROWS_WITH(sum(empty), Contains("an empty Var"));
  CHECK_THROWS_WITH(tape.write(y), Contains("only leaves are written; 'y' is computed"));
  CHECK_THROWS_WITH(tape.set(x, {1, 2}), Contains("2 against 6"));
  CHECK_THROWS_WITH(tape.unfreeze(c), Contains("constant 'c' can not be unfrozen"));
  tape.forward(y);
  CHECK_THROWS_WITH(tape.backward(y), Contains("a loss is one number; shape against [2,3]"));
}

}  // namespace tape_test
