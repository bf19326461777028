#include "body/skinning.h"

#include <cmath>
#include <limits>
#include <random>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "body/skinning_kernel.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/measures.h"
#include "tests/support/operator_check.h"

namespace skinning_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

Numbers random_numbers(Index count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Numbers numbers(static_cast<std::size_t>(count));
  for (double& x : numbers) x = uniform(random);
  return numbers;
}

/// Random joints (repetitions allowed) and weights that sum to 1.
SparseWeights random_weights(Index vertices, Index joints, Index per_vertex, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  SparseWeights w{vertices, joints, per_vertex, {}, {}};
  for (Index i = 0; i < vertices * per_vertex; ++i) {
    w.indices.push_back(static_cast<std::int32_t>(std::uniform_int_distribution<Index>(0, joints - 1)(random)));
    w.weights.push_back(std::uniform_real_distribution<double>(0.1, 1)(random));
  }
  for (Index v = 0; v < vertices; ++v) {
    double sum = 0;
    for (Index k = 0; k < per_vertex; ++k) sum += w.weights[static_cast<std::size_t>(v * per_vertex + k)];
    for (Index k = 0; k < per_vertex; ++k) w.weights[static_cast<std::size_t>(v * per_vertex + k)] /= sum;
  }
  return normalized_weights(w, "test");
}

DenseWeights dense_of(const SparseWeights& sparse) {
  DenseWeights dense{sparse.vertices, sparse.joints,
                     Numbers(static_cast<std::size_t>(sparse.vertices * sparse.joints))};
  for (std::size_t i = 0; i < sparse.indices.size(); ++i) {
    const Index v = static_cast<Index>(i) / sparse.per_vertex;
    dense.weights[static_cast<std::size_t>(v * sparse.joints + sparse.indices[i])] += sparse.weights[i];
  }
  return dense;
}

/// Every weight positive.
DenseWeights full_weights(Index vertices, Index joints, std::uint64_t seed) {
  DenseWeights w{vertices, joints, random_numbers(vertices * joints, seed)};
  for (Index v = 0; v < vertices; ++v) {
    double sum = 0;
    for (Index j = 0; j < joints; ++j) sum += w.weights[static_cast<std::size_t>(v * joints + j)] += 1.1;
    for (Index j = 0; j < joints; ++j) w.weights[static_cast<std::size_t>(v * joints + j)] /= sum;
  }
  return normalized_weights(w, "test");
}

/// The definition, and its derivatives, one number after the other.
struct Reference {
  Numbers y, d_transforms, d_points;
};
Reference reference(const DenseWeights& w, const Numbers& transforms, const Numbers& points, const Numbers& d_y) {
  Reference r{Numbers(points.size()), Numbers(transforms.size()), Numbers(points.size())};
  const auto at = [](Index i) { return static_cast<std::size_t>(i); };
  for (Index v = 0; v < w.vertices; ++v) {
    for (Index j = 0; j < w.joints; ++j) {
      const double weight = w.weights[at(v * w.joints + j)];
      for (Index row = 0; row < 3; ++row) {
        for (Index col = 0; col < 4; ++col) {
          const double x = col < 3 ? points[at(3 * v + col)] : 1;
          const double a = transforms[at(12 * j + 4 * row + col)];
          r.y[at(3 * v + row)] += weight * a * x;
          r.d_transforms[at(12 * j + 4 * row + col)] += weight * d_y[at(3 * v + row)] * x;
          if (col < 3) r.d_points[at(3 * v + col)] += weight * a * d_y[at(3 * v + row)];
        }
      }
    }
  }
  return r;
}

/// |a − b| / |b|
template <class S>
double relative_error(const std::vector<S>& a, const Numbers& b) {
  REQUIRE(a.size() == b.size());
  double error = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = static_cast<double>(a[i]) - b[i];
    error += difference * difference;
    size += b[i] * b[i];
  }
  return std::sqrt(error / std::max(size, 1e-300));
}

template <class S>
std::vector<S> numbers_of(const ConstArray<S>& array) {
  return {array.data, array.data + array.shape.count()};
}

template <class S>
std::vector<S> rounded(const Numbers& numbers) {
  return {numbers.begin(), numbers.end()};
}

/// Taped skinning against the reference, value and both gradients.
template <class S, class W>
void check_against_reference(const W& weights, const DenseWeights& same, double tolerance) {
  const Numbers transforms = random_numbers(same.joints * 12, 1), points = random_numbers(same.vertices * 3, 2);
  const Numbers d_y = random_numbers(same.vertices * 3, 3);
  const Reference expected = reference(same, transforms, points, d_y);
  Tape<S> tape;
  const auto a = tape.parameter("transforms", shape_of(same.joints, 12));
  const auto x = tape.parameter("points", shape_of(same.vertices, 3));
  tape.set(a, rounded<S>(transforms));
  tape.set(x, rounded<S>(points));
  const SkinWeights<S> prepared(weights);
  const Var<S> y = skin_points(prepared, a, x);
  const Var<S> split = transform_points(blend_transforms(prepared, a), x);
  for (const Var<S>& result : {y, split}) {
    tape.forward(result);
    tape.backward(result, rounded<S>(d_y));
    CHECK(relative_error(numbers_of(tape.value(result)), expected.y) <= tolerance);
    CHECK(relative_error(numbers_of(tape.gradient(a)), expected.d_transforms) <= tolerance);
    CHECK(relative_error(numbers_of(tape.gradient(x)), expected.d_points) <= tolerance);
  }
  std::vector<S> untaped(points.size());
  skin_points(prepared, rounded<S>(transforms).data(), rounded<S>(points).data(), untaped.data());
  CHECK(untaped == numbers_of(tape.value(y)));
}

/// The operators on tapes of both precisions.
struct BothPrecisions {
  SkinWeights<float> single;
  SkinWeights<double> full;
  template <class W>
  explicit BothPrecisions(const W& w) : single(w), full(w) {}
  const SkinWeights<float>& operator()(const Var<float>&) const { return single; }
  const SkinWeights<double>& operator()(const Var<double>&) const { return full; }
};

template <class W>
void check_operators(const std::string& name, const W& weights) {
  const BothPrecisions both(weights);
  const OperatorInput transforms{"transforms", shape_of(weights.joints, 12)};
  const OperatorInput points{"points", shape_of(weights.vertices, 3)};
  check_operator(name + ", points", {transforms, points},
                 [&](const auto& in) { return skin_points(both(in[0]), in[0], in[1]); });
  check_operator(name + ", moved", {transforms, points, {"transl", shape_of(1, 3)}},
                 [&](const auto& in) { return skin_points(both(in[0]), in[0], in[1], in[2]); });
  check_operator(name + ", blended", {transforms},
                 [&](const auto& in) { return blend_transforms(both(in[0]), in[0]); });
}

Numbers identity_transforms(Index joints) {
  Numbers transforms;
  for (Index j = 0; j < joints; ++j) transforms.insert(transforms.end(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
  return transforms;
}

}  // namespace

TEST_CASE("skinning operators pass the operator checks", "[parallel]") {
  check_operators("sparse, several chunks", random_weights(4500, 7, 4, 1));
  check_operators("sparse, K = 3", random_weights(131, 5, 3, 2));
  check_operators("sparse, K = 8, one joint", random_weights(9, 1, 8, 3));
  check_operators("dense, several chunks", full_weights(4133, 5, 4));
  check_operators("dense, one vertex", full_weights(1, 3, 5));
  check_operator("transform_points", {{"transforms", shape_of(2100, 12)}, {"points", shape_of(2100, 3)}},
                 [](const auto& in) { return transform_points(in[0], in[1]); });
}

TEST_CASE("skinning is its definition for every K and any number of vertices") {
  for (Index per_vertex = 1; per_vertex <= kMaxWeightsPerVertex; ++per_vertex) {
    for (const Index vertices : {0, 1, 2, 3, 4, 5, 31, 128, 129, 2048, 2051}) {
      for (const Index joints : {1, 2, 55}) {
        INFO("K = " << per_vertex << ", V = " << vertices << ", J = " << joints);
        const SparseWeights weights = random_weights(vertices, joints, per_vertex, 11);
        check_against_reference<double>(weights, dense_of(weights), 1e-14);
        check_against_reference<float>(weights, dense_of(weights), 2e-6);
      }
    }
  }
}

TEST_CASE("dense skinning is its definition for any number of vertices and joints") {
  for (const Index vertices : {0, 1, 15, 16, 17, 31, 32, 33, 255, 256, 257, 2048, 2500}) {
    for (const Index joints : {1, 2, 3, 55}) {
      INFO("V = " << vertices << ", J = " << joints);
      const DenseWeights weights = full_weights(vertices, joints, 12);
      check_against_reference<double>(weights, weights, 1e-14);
      check_against_reference<float>(weights, weights, 2e-6);
    }
  }
}

TEST_CASE("float gradients of a body agree with double to 1e-5") {
  const DenseWeights dense = full_weights(10475, 55, 13);
  check_against_reference<float>(dense, dense, 5e-6);
  const SparseWeights sparse = random_weights(10475, 55, 4, 14);
  check_against_reference<float>(sparse, dense_of(sparse), 5e-6);
}

TEMPLATE_TEST_CASE("the kernels of every instruction set agree with the definition", "", float, double) {
  using S = TestType;
  const Index vertices = 1037, joints = 23;
  const SparseWeights weights = random_weights(vertices, joints, 4, 15);
  const SkinWeights<S> sparse(weights), dense(dense_of(weights));
  const Numbers transforms = random_numbers(joints * 12, 1), points = random_numbers(vertices * 3, 2);
  const Numbers d_y = random_numbers(vertices * 3, 3);
  const Reference expected = reference(dense_of(weights), transforms, points, d_y);
  const auto a = rounded<S>(transforms), x = rounded<S>(points), g = rounded<S>(d_y);
  const double tolerance = sizeof(S) == 8 ? 1e-14 : 2e-6;
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa > best_isa()) continue;
    INFO(isa_name(isa));
    const auto k = hsi4d::detail::skin_kernels<S>(isa);
    std::vector<S> y(x.size()), d_x(x.size()), partial(a.size()),
        blended(a.size() / static_cast<std::size_t>(joints) * static_cast<std::size_t>(vertices));
    k.sparse_points(sparse.tables().sparse, a.data(), x.data(), y.data(), 0, vertices);
    k.sparse_point_adjoint(sparse.tables().sparse, a.data(), g.data(), d_x.data(), 0, vertices);
    k.sparse_transform_adjoint(sparse.tables().sparse, x.data(), g.data(), partial.data(), 0, vertices);
    CHECK(relative_error(y, expected.y) <= tolerance);
    CHECK(relative_error(d_x, expected.d_points) <= tolerance);
    CHECK(relative_error(partial, expected.d_transforms) <= tolerance);
    k.sparse_blend(sparse.tables().sparse, a.data(), blended.data(), 0, vertices);
    std::vector<S> dense_blended(blended.size());
    k.dense_blend(dense.tables().dense, a.data(), dense_blended.data(), 0, vertices);
    CHECK(relative_error(blended, Numbers(dense_blended.begin(), dense_blended.end())) <= tolerance);
    std::vector<S> saved(static_cast<std::size_t>(round_up(vertices, hsi4d::detail::kPanel) * 12));
    std::vector<S> lanes(partial.size() * static_cast<std::size_t>(hsi4d::detail::kMaxLanes));
    std::fill(d_x.begin(), d_x.end(), S(0));
    std::fill(partial.begin(), partial.end(), S(0));
    k.dense_points(dense.tables().dense, a.data(), x.data(), y.data(), saved.data(), 0, vertices);
    k.dense_point_adjoint(saved.data(), g.data(), d_x.data(), 0, vertices);
    k.dense_transform_adjoint(dense.tables().dense, x.data(), g.data(), lanes.data(), 0, vertices);
    k.dense_reduce(dense.tables().dense, lanes.data(), 1, partial.data());
    CHECK(relative_error(y, expected.y) <= tolerance);
    CHECK(relative_error(d_x, expected.d_points) <= tolerance);
    CHECK(relative_error(partial, expected.d_transforms) <= tolerance);
  }
}

TEST_CASE("D1: weights are normalised: the rest pose is the template, and a translation moves all points alike") {
  const Index vertices = 1000, joints = 20;
  SparseWeights raw = random_weights(vertices, joints, 4, 16);
  std::mt19937_64 random(17);
  for (Index v = 0; v < vertices; ++v) {
    const double scale = std::uniform_real_distribution<double>(0.991, 1.009)(random);
    for (Index k = 0; k < 4; ++k) raw.weights[static_cast<std::size_t>(4 * v + k)] *= scale;
  }
  const SparseWeights weights = normalized_weights(raw, "test");
  const Numbers points = random_numbers(vertices * 3, 18);
  const auto run = [&](auto zero, const Numbers& transforms, bool dense) {
    using S = decltype(zero);
    const SkinWeights<S> prepared = dense ? SkinWeights<S>(dense_of(weights)) : SkinWeights<S>(weights);
    std::vector<S> y(points.size());
    skin_points(prepared, rounded<S>(transforms).data(), rounded<S>(points).data(), y.data());
    return Numbers(y.begin(), y.end());
  };
  const auto largest_difference = [](const Numbers& a, const Numbers& b, double shift) {
    double largest = 0;
    for (std::size_t i = 0; i < a.size(); ++i) largest = larger(largest, std::fabs(a[i] - b[i] - shift));
    return largest;
  };
  for (const bool dense : {false, true}) {
    const Numbers rest = identity_transforms(joints);
    CHECK(largest_difference(run(0.0, rest, dense), points, 0) <= 1e-14);
    CHECK(largest_difference(run(0.0f, rest, dense), points, 0) <= 1e-6);
    const Numbers posed = random_numbers(joints * 12, 19);
    Numbers moved = posed;
    for (std::size_t i = 3; i < moved.size(); i += 4) moved[i] += 1000;
    CHECK(largest_difference(run(0.0, moved, dense), run(0.0, posed, dense), 1000) <= 1e-11);
    // Float has steps of 6e-5 at a kilometre: a few roundings of the result, and 1e-7 of the sum of the weights.
    CHECK(largest_difference(run(0.0f, moved, dense), run(0.0f, posed, dense), 1000) <= 3e-4);
  }
}

TEST_CASE("D1: tiny weights are dropped, and unused places repeat a used joint") {
  const SparseWeights w = normalized_weights({2, 5, 3, {3, 1, 4, 0, 2, 0}, {0.6, 0.4, 1e-7, 0, 1.005, 0}}, "test");
  CHECK(w.indices == std::vector<std::int32_t>{3, 1, 3, 2, 2, 2});
  CHECK(w.weights == Numbers{0.6, 0.4, 0, 0, 1, 0});
  const DenseWeights d = normalized_weights({1, 3, {0.5, 5e-7, 0.5}}, "test");
  CHECK(d.weights == Numbers{0.5, 0, 0.5});
}

TEST_CASE("D1: wrong weights are named") {
  const auto sparse = [](std::vector<std::int32_t> indices, Numbers weights) {
    return normalized_weights({2, 3, 2, std::move(indices), std::move(weights)}, "body.npz: lbs_weights");
  };
  const auto dense = [](Numbers weights) {
    return normalized_weights({2, 2, std::move(weights)}, "body.npz: lbs_weights");
  };
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  CHECK_THROWS_WITH(sparse({0, 1, 2, 0}, {1, 0, 0.5, 0.25}),
                    "body.npz: lbs_weights: vertex 1: the weights sum to 0.75; allowed: 1 within 0.01");
  CHECK_THROWS_WITH(sparse({0, 1, 2, 0}, {1, nan, 1, 0}),
                    "body.npz: lbs_weights: vertex 0: weight 1 is nan; allowed: 0 to 1");
  CHECK_THROWS_WITH(sparse({0, 1, 2, 0}, {1, 0, inf, 0}),
                    "body.npz: lbs_weights: vertex 1: weight 0 is inf; allowed: 0 to 1");
  CHECK_THROWS_WITH(sparse({0, 1, 2, 0}, {1, 0, 1.25, -0.25}),
                    "body.npz: lbs_weights: vertex 1: weight 1 is -0.25; allowed: 0 to 1");
  CHECK_THROWS_WITH(sparse({0, 3, 2, 0}, {1, 0, 1, 0}),
                    "body.npz: lbs_weights: vertex 0: joint 3 does not exist; allowed: 0 to 2");
  CHECK_THROWS_WITH(sparse({0, 1, -1, 0}, {1, 0, 0, 1}),
                    "body.npz: lbs_weights: vertex 1: joint -1 does not exist; allowed: 0 to 2");
  CHECK_THROWS_WITH(dense({1, 0, 0, 0.98}),
                    "body.npz: lbs_weights: vertex 1: the weights sum to 0.98; allowed: 1 within 0.01");
  CHECK_THROWS_WITH(dense({1, 0, nan, 1}), "body.npz: lbs_weights: vertex 1: weight 0 is nan; allowed: 0 to 1");
  CHECK_THROWS_AS(dense({1, 0, 0, 0.98}), DataError);
  CHECK_THROWS_AS(normalized_weights(SparseWeights{1, 1, 9, {}, {}}, "x"), InternalError);
  CHECK_THROWS_AS(normalized_weights(SparseWeights{1, 1, 1, {0, 0}, {1}}, "x"), InternalError);
  CHECK_THROWS_WITH(SkinWeights<double>(SparseWeights{1, 1, 1, {0}, {0.999}}),
                    Catch::Contains("weights of vertex 0 are not normalised"));
}

TEST_CASE("the largest weights of a dense table are kept") {
  const DenseWeights dense{2, 4, {0.3, 0.395, 0.005, 0.3, 0, 0, 1, 0}};
  const SparseWeights sparse = largest_weights(dense, 3, "test");
  CHECK(sparse.indices == std::vector<std::int32_t>{1, 0, 3, 2, 2, 2});
  CHECK(sparse.weights[0] == Approx(0.395 / 0.995).epsilon(1e-15));
  CHECK(sparse.weights[3] == 1);
  CHECK(largest_weights({1, 2, {0.5, 0.5}}, 4, "test").indices == std::vector<std::int32_t>{0, 1, 0, 0});
  CHECK_THROWS_WITH(largest_weights({1, 3, {0.5, 0.25, 0.25}}, 2, "m.npz"),
                    "m.npz: vertex 0: the weights sum to 0.75; allowed: 1 within 0.01");
}

TEST_CASE("D2: two bones at half a turn give a singular blend, and finite points and gradients") {
  Numbers transforms = identity_transforms(2);
  transforms[12 + 5] = transforms[12 + 10] = -1;
  const SparseWeights half{3, 2, 2, {0, 1, 0, 1, 1, 0}, {0.5, 0.5, 0.5, 0.5, 0.5, 0.5}};
  const BothPrecisions both(half);
  check_operator("half a turn", {{"transforms", shape_of(2, 12), 0, 0, transforms}, {"points", shape_of(3, 3)}},
                 [&](const auto& in) { return skin_points(both(in[0]), in[0], in[1]); });
  Tape<double> tape;
  const auto a = tape.parameter("transforms", shape_of(2, 12));
  tape.set(a, transforms);
  const auto blended = blend_transforms(both.full, a);
  tape.forward(blended);
  tape.backward(blended, Numbers(36, 1));
  CHECK(numbers_of(tape.value(blended)) == Numbers{1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0,
                                                   0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  CHECK(numbers_of(tape.gradient(a)) == Numbers(24, 1.5));
}

TEST_CASE("a NaN of a joint or of a point stays with those that it concerns") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const SparseWeights weights = normalized_weights(
      {5, 3, 4, {0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 1, 2, 0, 0, 2, 0, 0, 0}, {1, 0, 0,   0,   1, 0, 0, 0, 1, 0,
                                                                               0, 0, 0.5, 0.5, 0, 0, 1, 0, 0, 0}},
      "test");
  Tape<double> tape;
  const auto a = tape.parameter("transforms", shape_of(3, 12));
  const auto x = tape.parameter("points", shape_of(5, 3));
  const auto y = skin_points(SkinWeights<double>(weights), a, x);
  tape.set(a, identity_transforms(3));
  tape.write(a)(0, 0) = nan;
  tape.set(x, Numbers(15, 1));
  tape.forward(y);
  for (Index v = 0; v < 5; ++v) CHECK(std::isnan(tape.value(y)(v, 0)) == (v == 0));
  tape.set(a, identity_transforms(3));
  tape.write(x)(3, 1) = nan;
  tape.forward(y);
  tape.backward(y, Numbers(15, 1));
  for (Index j = 0; j < 3; ++j) CHECK(std::isnan(tape.gradient(a)(j, 1)) == (j != 0));
  CHECK(tape.gradient(x)(4, 0) == 1);
}

TEMPLATE_TEST_CASE("a steady iteration of skinning allocates nothing", "", float, double) {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      Tape<TestType> tape;
      const auto a = tape.parameter("transforms", shape_of(10, 12));
      const auto x = tape.parameter("points", shape_of(5000, 3));
      const SkinWeights<TestType> sparse(random_weights(5000, 10, 4, 20)), dense(full_weights(5000, 10, 21));
      const auto loss = sum(square(skin_points(sparse, a, x))) + sum(square(skin_points(dense, a, x))) +
                        sum(square(transform_points(blend_transforms(sparse, a), x))) +
                        sum(square(blend_transforms(dense, a)));
      const auto iterate = [&](int i) {
        tape.write(a).data[i] += TestType(0.25);
        if (i % 3 == 0) tape.freeze(x);
        if (i % 3 == 1) tape.unfreeze(x);
        tape.forward(loss);
        tape.backward(loss);
      };
      CHECK(steady_allocations([&] {
              for (int i = 0; i < 30; ++i) iterate(i);
            }) == 0);
    });
  }
}

TEST_CASE("shapes that do not fit the weights are refused") {
  Tape<double> tape;
  const SkinWeights<double> weights(random_weights(4, 2, 2, 22));
  const auto a = tape.parameter("transforms", shape_of(2, 12));
  const auto x = tape.parameter("points", shape_of(4, 3));
  CHECK_THROWS_WITH(skin_points(weights, a, a), Catch::Contains("[2,12] against [4,3]"));
  CHECK_THROWS_WITH(skin_points(weights, x, x), Catch::Contains("[4,3] against [2,12]"));
  CHECK_THROWS_WITH(blend_transforms(weights, x), Catch::Contains("[4,3] against [2,12]"));
  CHECK_THROWS_WITH(transform_points(a, x), Catch::Contains("[2,12] against [4,12]"));
}

}  // namespace skinning_test
