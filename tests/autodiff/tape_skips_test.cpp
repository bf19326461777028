// What a tape skips: the same bits with it and without, and less done with it.
#include <catch2/catch.hpp>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "autodiff/ssim.h"
#include "autodiff/tape.h"
#include "autodiff/weighted_image.h"
#include "tests/support/random_numbers.h"

namespace tape_skips_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// base · x of the squares that are needed alone.
struct ImageOnDemand {
  static constexpr const char* kName = "image_on_demand";
  static constexpr bool kPersistentOutputs = true;
  Index* squares;  ///< that were made in the last run
  void forward(NodeIo<double>& io) {
    const ConstArray<double> base = io.in(0);
    *squares = 0;
    for (Index r = 0; r < base.shape.rows; ++r) {
      for (Index c = 0; c < base.shape.cols; ++c) {
        const Index row = r / kMaskSquare, col = c / kMaskSquare;
        if (io.needed() != nullptr && !io.needed()->has(row, col)) continue;
        io.out()(0, r, c) = base(0, r, c) * io.in(1).scalar();
        *squares += r % kMaskSquare == 0 && c % kMaskSquare == 0 ? 1 : 0;
      }
    }
  }
  void backward(NodeIo<double>& io) {
    const Shape& shape = io.in(0).shape;
    for (Index r = 0; r < shape.rows; ++r) {
      for (Index c = 0; c < shape.cols; ++c) io.d_in(1).scalar() += io.d_out()(0, r, c) * io.in(0)(0, r, c);
    }
  }
};

constexpr Index kRows = 40, kCols = 70, kSquares = 3 * 5;

/// An image that is made on demand, and a weight that counts in some squares alone.
struct DemandScene {
  Shape shape = image_shape<double>(1, kRows, kCols);
  Index squares = 0;
  Tape<double> tape;
  Var<double> base = tape.constant("base", shape), x = tape.parameter("x", kScalarShape);
  Var<double> target = tape.constant("target", shape), weight = tape.parameter("weight", shape);
  Var<double> image = tape.record(ImageOnDemand{&squares}, {base, x}, shape, Source::current());
  Var<double> weighted = l2(image, target, weight), whole = l1(image, target), both = weighted + whole;
  Var<double> similar = d_ssim(weighted_image(image, weight), weighted_image(target, weight));

  explicit DemandScene(bool skips) {
    tape.set_skips({.unread_pixels = skips});
    tape.freeze(weight);
    RandomNumbers random(4);
    for (const Var<double>& var : {base, target}) {
      const Array<double> numbers = tape.write(var);
      for (Index r = 0; r < kRows; ++r) {
        for (Index c = 0; c < kCols; ++c) numbers(0, r, c) = random(0, 1);
      }
    }
    weigh(kMaskSquare, kMaskSquare);
    tape.set(x, {0.5});
  }
  /// 1 in the first rows of the first columns, 0 elsewhere.
  void weigh(Index rows, Index cols) {
    const Array<double> w = tape.write(weight);
    for (Index r = 0; r < kRows; ++r) {
      for (Index c = 0; c < kCols; ++c) w(0, r, c) = r < rows && c < cols ? 1 : 0;
    }
  }
  /// Value and derivative.
  std::pair<double, double> run(Var<double> result) {
    tape.forward(result);
    tape.backward(result);
    return {tape.value(result).scalar(), tape.gradient(x).scalar()};
  }
};

}  // namespace

TEST_CASE("frozen inputs have an adjoint only where the tape is told to make one and the others keep their bits") {
  const auto run = [](bool skips) {
    Tape<double> tape;
    tape.set_skips({.frozen_inputs = skips});
    const auto x = tape.parameter("x", shape_of(3, 2)), y = tape.parameter("y", shape_of(3, 2));
    const auto constant = tape.constant("constant", shape_of(3, 2));
    tape.set(x, {0.1, 0.2, 0.3, 0.4, 0.5, 0.6});
    tape.set(y, {1, 2, 3, 4, 5, 6});
    tape.set(constant, {0.7, 0.7, 0.7, 0.7, 0.7, 0.7});
    const auto loss = sum(exp(x) * square(y) * constant);
    tape.freeze(y);
    tape.forward(loss);
    tape.backward(loss);
    CHECK_FALSE(tape.has_gradient(y));
    CHECK_FALSE(tape.has_gradient(constant));
    const ConstArray<double> d = tape.gradient(x);
    return std::tuple(std::vector<double>(d.data, d.data + 6), tape.value(loss).scalar(), tape.counters());
  };
  const auto [d, loss, counters] = run(true);
  const auto [all_d, all_loss, all_counters] = run(false);
  CHECK(d == all_d);
  CHECK(loss == all_loss);
  CHECK(counters.forward_nodes == all_counters.forward_nodes);
  CHECK(counters.backward_nodes + 1 == all_counters.backward_nodes);  // of the square
  CHECK(counters.adjoint_numbers < all_counters.adjoint_numbers);
}

TEST_CASE("nodes whose inputs did not change run again only where the tape is told so") {
  const auto run = [](bool skips) {
    Tape<double> tape;
    tape.set_skips({.unchanged_inputs = skips});
    const auto x = tape.parameter("x", kScalarShape), still = tape.constant("still", kScalarShape);
    tape.set(still, {0.3});
    const auto loss = exp(still) * square(x);
    double all = 0;
    Index nodes = 0;
    for (int i = 0; i < 4; ++i) {
      tape.set(x, {0.1 * i});
      tape.forward(loss);
      tape.backward(loss);
      nodes += tape.counters().forward_nodes;
      all += tape.value(loss).scalar() + tape.gradient(x).scalar();
    }
    return std::pair(all, nodes);
  };
  const auto [numbers, nodes] = run(true);
  const auto [all_numbers, all_nodes] = run(false);
  CHECK(numbers == all_numbers);
  CHECK(nodes == 4 * 2 + 1);
  CHECK(all_nodes == 4 * 3);
}

TEST_CASE("squares of an image that its only reader does not look at are not made") {
  DemandScene some(true), all(false);
  const auto check_equal = [&](Var<double> DemandScene::*result, Index squares) {
    CHECK(some.run(some.*result) == all.run(all.*result));
    CHECK(some.squares == squares);
    CHECK(all.squares == kSquares);
  };
  check_equal(&DemandScene::weighted, 1);
  for (const double value : {0.7, 0.2}) {
    for (DemandScene* scene : {&some, &all}) scene->tape.set(scene->x, {value});
    check_equal(&DemandScene::weighted, 1);
  }
  for (DemandScene* scene : {&some, &all}) scene->weigh(kMaskSquare + 1, kCols);  // more is read
  check_equal(&DemandScene::weighted, 10);
  check_equal(&DemandScene::both, kSquares);  // another term reads all
  for (DemandScene* scene : {&some, &all}) scene->weigh(1, 1);
  check_equal(&DemandScene::weighted, kSquares);  // what is there is not made again
  for (DemandScene* scene : {&some, &all}) scene->tape.set(scene->x, {0.6});
  check_equal(&DemandScene::weighted, 1);
  check_equal(&DemandScene::whole, kSquares);
  for (DemandScene* scene : {&some, &all}) scene->tape.set(scene->x, {0.4});
  check_equal(&DemandScene::similar, 1);
  for (DemandScene* scene : {&some, &all}) scene->weigh(kMaskSquare + 1, kCols);
  check_equal(&DemandScene::similar, 10);
}

TEST_CASE("an image that somebody asks for is made whole") {
  DemandScene scene(true);
  scene.tape.forward(scene.weighted);
  CHECK(scene.squares == 1);
  scene.tape.forward(scene.image);
  CHECK(scene.squares == kSquares);
  scene.tape.unfreeze(scene.weight);  // its gradient depends on every pixel
  scene.tape.set(scene.x, {0.1});
  scene.tape.forward(scene.weighted);
  CHECK(scene.squares == kSquares);
  scene.tape.freeze(scene.weight);
  scene.tape.set(scene.x, {0.3});
  scene.tape.forward(scene.weighted);
  CHECK(scene.squares == 1);
}

TEST_CASE("of two results that look at different squares of one image, each wants a forward of its own") {
  DemandScene some(true), all(false);
  const auto other = [](DemandScene& scene) {
    const Var<double> weight = scene.tape.constant("other weight", scene.shape);
    const Array<double> w = scene.tape.write(weight);
    for (Index r = 0; r < kRows; ++r) {
      for (Index c = 0; c < kCols; ++c) w(0, r, c) = c >= 3 * kMaskSquare ? 1 : 0;
    }
    return l2(scene.image, scene.target, weight);
  };
  const Var<double> some_other = other(some), all_other = other(all);
  const auto forward_both = [&] {
    some.tape.forward(some.weighted), some.tape.forward(some_other);
    all.tape.forward(all.weighted), all.tape.forward(all_other);
  };
  const auto gradients = [](DemandScene& scene, Var<double> result) {
    scene.tape.backward(result);
    return scene.tape.gradient(scene.x).scalar();
  };
  forward_both();
  CHECK_THROWS_AS(some.tape.backward(some.weighted), StaleError);
  const double of_all = gradients(all, all.weighted);  // whose image is whole
  CHECK(of_all != 0);
  CHECK(some.run(some.weighted).second == of_all);
  CHECK_THROWS_AS(some.tape.backward(some_other), StaleError);
  for (DemandScene* scene : {&some, &all}) scene->tape.set(scene->x, {0.7});
  forward_both();
  CHECK(gradients(some, some_other) == gradients(all, all_other));
  // An image that was made whole between serves both.
  some.tape.forward(some.weighted), some.tape.forward(some.whole);
  CHECK(gradients(some, some.weighted) == gradients(all, all.weighted));
  // Made again in part, it no longer serves a result that looks at all of it.
  some.tape.set_skips({.unchanged_inputs = false});
  some.tape.forward(some.whole), some.tape.forward(some.weighted);
  CHECK_THROWS_AS(some.tape.backward(some.whole), StaleError);
}

}  // namespace tape_skips_test
