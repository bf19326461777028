// Curvatures of renders, against the dense Jacobian of every pixel, made by backward runs in double.
#include "autodiff/curvature.h"

#include <array>
#include <functional>

#include <Eigen/Eigenvalues>
#include <catch2/catch.hpp>

#include "autodiff/difference.h"
#include "autodiff/image_difference.h"
#include "autodiff/map.h"
#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "autodiff/ssim.h"
#include "autodiff/ssim_weights.h"
#include "autodiff/weighted_image.h"
#include "body/kinematics.h"
#include "core/parallel.h"
#include "tests/support/random_numbers.h"
#include "tests/support/taped_splats.h"

namespace curvature_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Matrix = Eigen::MatrixXd;

namespace {

constexpr Index kBody = 24, kObject = 10, kScene = 40, kWidth = 40, kHeight = 30;

/// A chain of three bones and a rigid object before a scene, seen by a camera that may move: only the places of
/// Gaussians follow them.
template <class S>
struct Graph {
  Tape<S> tape;
  SplatScene numbers = random_splats(kBody + kObject + kScene, 7, {kWidth, kHeight});
  SplatView view{numbers.camera, Vector3<double>::Zero(), numbers.settings};
  Var<S> bones, transl, object_turn, object_transl, xi, placed;
  Composited<S> render;
  Var<S> target, weight, mask;

  explicit Graph(bool camera = false) {
    bones = leaf("bones", shape_of(3, 6), 1);
    transl = leaf("transl", shape_of(1, 3), 2, 0.05);
    object_turn = leaf("object_turn", shape_of(1, 6), 3);
    object_transl = leaf("object_transl", shape_of(1, 3), 4, 0.05);
    xi = leaf("xi", shape_of(1, 6), 5, 0.02);
    if (!camera) tape.freeze(xi);
    const PosedSkeleton<S> body =
        kinematic_chain(rotations_from_6d(bones), transl, {-1, 0, 1}, {0.1, 0.2, 0, 0.3, 0.2, 0.1, 0.5, 0, 0.1});
    const PosedSkeleton<S> object =
        kinematic_chain(rotations_from_6d(object_turn), object_transl, {-1}, std::vector<double>{0, 0, 0});
    const std::array parts = {skinned(body.transforms, 0, kBody, 3), skinned(object.transforms, kBody, kObject, 1)};
    placed = concat_rows<S>(parts);
    render = composite(set(constant(numbers.means, kBody + kObject, kScene, 3), kBody + kObject, kScene),
                       set(placed, 0, kBody + kObject), view, background());
    target = tape.constant("target", render.channels.shape());
    weight = tape.constant("weight", render.transmittance.shape());
    mask = tape.constant("mask", render.more_channels.shape());
    write_random(target, 11, 0.5, 0.5);
    write_random(weight, 12, 0.4, 0.6);
    write_random(mask, 13, 0.5, 0.5);
    for (Index x = 0; x < kWidth / 2; ++x) tape.write(weight)(0, 3, x) = 0;
  }

  Var<S> leaf(const char* name, const Shape& shape, std::uint64_t seed, double size = 0.3) {
    const Var<S> var = tape.parameter(name, shape);
    write_random(var, seed, size, 0);
    if (shape.cols == 6 && size > 0.1) {
      for (Index r = 0; r < shape.rows; ++r) {
        tape.write(var)(r, 0) += 1;
        tape.write(var)(r, 4) += 1;
      }
    }
    return var;
  }
  void write_random(Var<S> var, std::uint64_t seed, double size, double middle) {
    const std::vector<double> random = random_cotangent(var.shape().count(), seed);
    std::vector<S> values;
    for (const double x : random) values.push_back(static_cast<S>(middle + size * x));
    tape.set(var, values);
  }
  Var<S> constant(const std::vector<float>& from, Index row, Index rows, Index cols) {
    const Var<S> var = tape.constant("given", shape_of(rows, cols));
    const auto first = from.begin() + row * cols;
    tape.set(var, std::vector<S>(first, first + rows * cols));
    return var;
  }
  Var<S> background() {
    const Var<S> var = tape.constant("background", shape_of(1, 3));
    tape.set(var, {S(0.3), S(0.5), S(0.2)});
    return var;
  }
  /// Rows of the scene's Gaussians on joints, two of them each.
  Var<S> skinned(Var<S> transforms, Index row, Index rows, Index joints) {
    SparseWeights weights{rows, joints, 2, {}, {}};
    for (Index v = 0; v < rows; ++v) {
      const double share = joints == 1 ? 1 : 0.2 + 0.6 * static_cast<double>(v) / static_cast<double>(rows);
      weights.indices.push_back(static_cast<std::int32_t>(v % joints));
      weights.indices.push_back(static_cast<std::int32_t>((v + 1) % joints));
      weights.weights.push_back(share);
      weights.weights.push_back(1 - share);
    }
    const Var<S> frames = tape.constant("frames", shape_of(rows, 9));
    return skin_frames(SkinWeights<S>(weights), transforms, constant(numbers.means, row, rows, 3), frames).points;
  }
  SplatSet<S> set(Var<S> means, Index row, Index rows) {
    Projected<S> projected =
        project(means, gaussian_axes(constant(numbers.quats, row, rows, 4), constant(numbers.log_scales, row, rows, 3)),
                xi, view);
    projected.factors = stop_gradient(projected.factors);
    const Var<S> features = tape.constant("features", shape_of(rows, 4));
    write_random(features, static_cast<std::uint64_t>(20 + row), 0.5, 0.5);
    for (Index n = 0; n < rows; ++n) tape.write(features)(n, 3) = row == 0 && n >= kBody ? 1 : 0;
    return {projected, gaussian_opacities(constant(numbers.opacity_logits, row, rows, 1)), features};
  }

  std::vector<Var<S>> leaves() const { return {bones, transl, object_turn, object_transl, xi}; }
  Matrix curvature(Var<S> loss) {
    Curvature<S> of(tape, loss, leaves());
    tape.forward(loss);
    tape.backward(loss);
    return of.compute();
  }
};

/// Σ w r rᵀ over the numbers of an array, r by a backward run each.
Matrix dense(Graph<double>& graph, Var<double> array,
             const std::function<double(Index plane, Index row, Index col)>& w) {
  Index count = 0;
  for (const auto leaf : graph.leaves()) count += leaf.shape().count();
  Matrix sum = Matrix::Zero(count, count);
  const Shape shape = array.shape();
  std::vector<double> one(static_cast<std::size_t>(shape.count()), 0);
  graph.tape.forward(array);
  for (Index e = 0; e < shape.count(); ++e) {
    const Index plane = e / (shape.rows * shape.cols), row = e / shape.cols % shape.rows, col = e % shape.cols;
    const double weight = w(plane, row, col);
    if (weight == 0) continue;
    one[static_cast<std::size_t>(e)] = 1;
    graph.tape.backward(array, one);
    one[static_cast<std::size_t>(e)] = 0;
    Eigen::VectorXd r = Eigen::VectorXd::Zero(count);
    Index at = 0;
    for (const auto leaf : graph.leaves()) {
      if (graph.tape.has_gradient(leaf)) {
        for (const double x : numbers_of<double>(graph.tape.gradient(leaf))) r[at++] = x;
      } else {
        at += leaf.shape().count();
      }
    }
    sum += weight * r * r.transpose();
  }
  return sum;
}

double error(const Matrix& a, const Matrix& b) { return (a - b).norm() / b.norm(); }

/// A weighted sum of squares of colours, absolute differences of colours that are weighted themselves, and squares of a
/// silhouette.
template <class S>
Var<S> loss_of(Graph<S>& g) {
  return l2(g.render.channels, g.target, g.weight) * 0.7 +
         l1(weighted_image(g.render.channels, g.weight), weighted_image(g.target, g.weight)) * 0.4 +
         l2(slice_planes(g.render.more_channels, 0, 1), g.mask) * 0.2 + sum(square(g.transl)) * 0.3;
}

/// The same by formulas.
Matrix dense_of_loss(Graph<double>& g) {
  const double colors = static_cast<double>(g.render.channels.shape().count()),
               pixels = static_cast<double>(g.mask.shape().count());
  g.tape.forward(g.render.channels);
  const std::vector<double> image = numbers_of<double>(g.tape.value(g.render.channels)),
                            target = numbers_of<double>(g.tape.value(g.target)),
                            weight = numbers_of<double>(g.tape.value(g.weight));
  const Matrix of_colors = dense(g, g.render.channels, [&](Index plane, Index row, Index col) {
    const auto pixel = static_cast<std::size_t>(row * kWidth + col);
    const auto at = static_cast<std::size_t>(plane * kWidth * kHeight) + pixel;
    const double w = weight[pixel], d = std::abs(w * (image[at] - target[at]));
    return 0.7 * 2 * w / colors + 0.4 * w * w / std::max(d, CurvatureRule{}.least_difference) / colors;
  });
  const Matrix of_mask = dense(g, g.render.more_channels, [&](Index, Index, Index) { return 0.2 * 2 / pixels; });
  return of_colors + of_mask + dense(g, g.transl, [](Index, Index, Index) { return 0.3 * 2; });
}

}  // namespace

TEST_CASE("a curvature is that of the dense Jacobian") {
  for (const bool camera : {false, true}) {
    INFO("the camera moves: " << camera);
    Graph<double> g(camera);
    const Matrix expected = dense_of_loss(g), found = g.curvature(loss_of(g));
    CHECK(error(found, expected) < 1e-10);
    CHECK(found == found.transpose());
    CHECK(found.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff() > -1e-12 * found.norm());
    CHECK((found.bottomRightCorner(6, 6).norm() > 0) == camera);
    Graph<float> single(camera);
    CHECK(error(single.curvature(loss_of(single)), expected) < 1e-4);
  }
}

TEST_CASE("a curvature is the same over static layers and without them") {
  Graph<float> layered, plain;
  plain.view.skip.static_layer = false;
  CHECK(error(layered.curvature(loss_of(layered)), plain.curvature(loss_of(plain))) < 1e-5);
}

TEST_CASE("samples of tiles are together the whole curvature") {
  Graph<double> g, whole;
  const Matrix expected = whole.curvature(loss_of(whole));
  const Var<double> loss = loss_of(g);
  for (const Index tiles : {2, 3, 4}) {
    INFO("one tile of " << tiles);
    Curvature<double> curvature(g.tape, loss, g.leaves(), {.tiles = tiles});
    Matrix sum = Matrix::Zero(expected.rows(), expected.cols()), last = sum;
    for (Index turn = 0; turn < tiles; ++turn) {
      g.tape.forward(loss);
      g.tape.backward(loss);
      const Matrix sample = curvature.compute();
      CHECK(error(sample, last) > 1e-3);  // others than before
      sum += sample;
      last = sample;
    }
    CHECK(error(sum / static_cast<double>(tiles), expected) < 1e-12);
  }
}

TEST_CASE("a curvature has the same bits on any number of threads", "[parallel]") {
  const auto on = [](int threads) {
    Matrix found;
    with_threads(threads, [&] {
      Graph<float> g(true);
      found = g.curvature(loss_of(g));
    });
    return found;
  };
  const Matrix one = on(1);
  for (const int threads : {2, 3, 8}) CHECK(on(threads) == one);
}

TEST_CASE("what is frozen has no curvature, and the rest keeps its own") {
  Graph<double> all, some;
  some.tape.freeze(some.object_turn);
  some.tape.freeze(some.transl);
  Var<double> loss = loss_of(some);
  Curvature<double> curvature(some.tape, loss, some.leaves());
  some.tape.forward(loss);
  some.tape.backward(loss);
  const Matrix found = curvature.compute(), whole = all.curvature(loss_of(all));
  CHECK_FALSE(curvature.sees(some.object_turn));
  CHECK(curvature.sees(some.bones));
  CHECK(found.block(18, 0, 9, found.cols()).norm() == 0);
  CHECK(error(found.topLeftCorner(18, 18), whole.topLeftCorner(18, 18)) < 1e-12);
}

TEST_CASE("a curvature needs the backward run of its loss") {
  Graph<double> g;
  const Var<double> loss = loss_of(g), other = sum(square(g.transl));
  Curvature<double> curvature(g.tape, loss, g.leaves());
  g.tape.forward(loss);
  CHECK_THROWS_AS(curvature.compute(), StaleError);
  g.tape.backward(loss);
  CHECK(curvature.compute().norm() > 0);
  CHECK_THROWS_AS(curvature.compute(), StaleError);  // it has taken the gradients
  g.tape.forward(other);
  g.tape.backward(other);
  CHECK_THROWS_AS(curvature.compute(), StaleError);
}

TEST_CASE("a render that moves by something else says by what") {
  Graph<double> g;
  const Var<double> means = g.tape.parameter("means of my own", shape_of(kScene, 3));
  const auto made = composite(g.set(means * 2, kBody + kObject, kScene), g.view, g.background());
  CHECK_THROWS_WITH(g.curvature(l2(made.channels, g.target)),
                    Catch::Contains("moves by 'scale'") && Catch::Contains("curvature_test.cpp"));
}

TEST_CASE("sums of squares of any lambda have their curvature, others go by their gradient alone") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", shape_of(3, 2)), y = tape.parameter("y", shape_of(3, 2));
  tape.set(x, {0.3, -0.2, 0.5, 0.1, -0.7, 0.4});
  tape.set(y, {0.2, 0.6, -0.1, 0.3, 0.8, -0.4});
  const auto curvature_of = [&](Var<double> loss) {
    Curvature<double> curvature(tape, loss, {x});
    tape.forward(loss);
    tape.backward(loss);
    return Matrix(curvature.compute());
  };
  const Var<double> one = tape.constant("one", shape_of(3, 2));
  tape.set(one, {1, 1, 1, 1, 1, 1});
  CHECK(error(curvature_of(sum_over({x, one}, [](auto a, auto b) { return square(3 * a - b); })),
              18 * Matrix::Identity(6, 6)) < 1e-12);
  CHECK(error(curvature_of(sum(square(x * 3 - 1)) * 2), 36 * Matrix::Identity(6, 6)) < 1e-12);
  CHECK(curvature_of(sum_over({x, y}, [](auto a, auto b) { return square(a - b); })).norm() == 0);
  CHECK(curvature_of(sum(x)).norm() == 0);
}

TEST_CASE("more numbers than a curvature takes are left out and named") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", shape_of(1, 1)),
                    many = tape.constant("many", shape_of(Curvature<double>::kMostResiduals + 1, 1));
  std::fill_n(tape.write(many).data, many.shape().count(), 1.0);
  const Var<double> loss = sum(square(x * many - 1));
  Curvature<double> curvature(tape, loss, {x});
  tape.forward(loss);
  tape.backward(loss);
  CHECK(curvature.compute().norm() == 0);
  REQUIRE(curvature.left_out().size() == 1);
  CHECK_THAT(curvature.left_out()[0], Catch::Contains("curvature_test.cpp"));
}

TEST_CASE("weights of a structural difference bound its curvature from above") {
  constexpr Index kSide = 24;
  const Shape shape = image_shape<double>(1, kSide, kSide);
  Tape<double> tape;
  const Var<double> image = tape.parameter("image", shape), target = tape.constant("target", shape),
                    weights = tape.constant("weights", shape);
  const std::vector<double> a = random_cotangent(kSide * kSide, 1), b = random_cotangent(kSide * kSide, 2);
  std::vector<double> numbers, near;
  for (std::size_t i = 0; i < a.size(); ++i) {
    numbers.push_back(0.5 + 0.4 * a[i]);
    near.push_back(numbers.back() + 0.02 * b[i]);
  }
  tape.set(image, numbers);
  tape.set(target, near);
  hsi4d::detail::add_ssim_weights<double>(tape.value(image), tape.value(target), nullptr, 1, 1, tape.write(weights));
  const Var<double> loss = d_ssim(image, target);
  const auto gradient_at = [&](const std::vector<double>& at) {
    tape.set(image, at);
    tape.forward(loss);
    tape.backward(loss);
    return numbers_of<double>(tape.gradient(image));
  };
  const std::vector<double> w = numbers_of<double>(tape.value(weights));
  for (const std::uint64_t seed : {5, 6, 7}) {
    const std::vector<double> direction = random_cotangent(kSide * kSide, seed);
    std::vector<double> before = numbers, after = numbers;
    for (std::size_t i = 0; i < numbers.size(); ++i) before[i] -= 1e-5 * direction[i], after[i] += 1e-5 * direction[i];
    const std::vector<double> g0 = gradient_at(before), g1 = gradient_at(after);
    double bend = 0, bound = 0;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      bend += (g1[i] - g0[i]) / 2e-5 * direction[i];
      bound += w[i] / static_cast<double>(kSide * kSide) * direction[i] * direction[i];
    }
    CHECK(bend > 0.5 * bound);  // noise changes pixels of a window in different ways: the bound is near
    CHECK(bend < 1.05 * bound);
  }
}

}  // namespace curvature_test
