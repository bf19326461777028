#include <array>
#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "body/skinning.h"
#include "body/skinning_kernel.h"
#include "core/check.h"
#include "core/random.h"
#include "core/simd.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/operator_check.h"

namespace skin_frames_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

Numbers random_numbers(Index count, std::uint64_t seed) {
  const Random random(seed);
  Numbers numbers;
  for (Index i = 0; i < count; ++i) numbers.push_back(random.uniform(static_cast<std::uint64_t>(i), -1, 1));
  return numbers;
}

SparseWeights random_weights(Index vertices, Index joints, Index per_vertex, std::uint64_t seed) {
  SparseWeights weights{vertices, joints, per_vertex, {}, {}};
  const Random random(seed);
  for (Index v = 0; v < vertices; ++v) {
    double sum = 0;
    for (Index k = 0; k < per_vertex; ++k) {
      const auto at = static_cast<std::uint64_t>(v * per_vertex + k);
      weights.indices.push_back(static_cast<std::int32_t>(random.below(2 * at, static_cast<std::uint64_t>(joints))));
      weights.weights.push_back(0.05 + random.uniform(2 * at + 1));
      sum += weights.weights.back();
    }
    for (Index k = 0; k < per_vertex; ++k) weights.weights[static_cast<std::size_t>(v * per_vertex + k)] /= sum;
  }
  return weights;
}

/// Value and adjoint as the formulas say, without any table.
struct Reference {
  Numbers points, frames, d_transforms, d_points, d_frames;
};

Reference reference(const SparseWeights& w, const Numbers& transforms, const Numbers& points, const Numbers& frames,
                    const Numbers& d_y, const Numbers& d_f) {
  Reference r{Numbers(points.size()), Numbers(frames.size()), Numbers(transforms.size()), Numbers(points.size()),
              Numbers(frames.size())};
  for (std::size_t v = 0; v < static_cast<std::size_t>(w.vertices); ++v) {
    for (std::size_t k = 0; k < static_cast<std::size_t>(w.per_vertex); ++k) {
      const std::size_t at = v * static_cast<std::size_t>(w.per_vertex) + k;
      const std::size_t joint = 12 * static_cast<std::size_t>(w.indices[at]);
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t c = 0; c < 3; ++c) {
          const double a = w.weights[at] * transforms[joint + 4 * row + c];
          double& d_a = r.d_transforms[joint + 4 * row + c];
          r.points[3 * v + row] += a * points[3 * v + c];
          d_a += w.weights[at] * d_y[3 * v + row] * points[3 * v + c];
          r.d_points[3 * v + c] += a * d_y[3 * v + row];
          for (std::size_t e = 0; e < 3; ++e) {
            r.frames[9 * v + 3 * row + e] += a * frames[9 * v + 3 * c + e];
            d_a += w.weights[at] * d_f[9 * v + 3 * row + e] * frames[9 * v + 3 * c + e];
            r.d_frames[9 * v + 3 * c + e] += a * d_f[9 * v + 3 * row + e];
          }
        }
        r.points[3 * v + row] += w.weights[at] * transforms[joint + 4 * row + 3];
        r.d_transforms[joint + 4 * row + 3] += w.weights[at] * d_y[3 * v + row];
      }
    }
  }
  return r;
}

template <class S>
double relative_error(const S* found, const Numbers& expected) {
  double error = 0, size = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    error += std::pow(static_cast<double>(found[i]) - expected[i], 2);
    size += expected[i] * expected[i];
  }
  return std::sqrt(error / std::max(size, 1e-300));
}

template <class S>
void check_kernels(const SparseWeights& w, Isa isa, double tolerance) {
  const SkinWeights<S> weights(w);
  const auto& table = weights.tables().sparse;
  const hsi4d::detail::SkinKernels<S> kernels = hsi4d::detail::skin_kernels<S>(isa);
  const Numbers transforms = random_numbers(w.joints * 12, 1), points = random_numbers(w.vertices * 3, 2),
                frames = random_numbers(w.vertices * 9, 3), d_y = random_numbers(w.vertices * 3, 4),
                d_f = random_numbers(w.vertices * 9, 5);
  const auto as = [](const Numbers& numbers) { return std::vector<S>(numbers.begin(), numbers.end()); };
  const std::vector<S> a = as(transforms), x = as(points), f = as(frames), g = as(d_y), h = as(d_f);
  const Reference expected = reference(w, transforms, points, frames, d_y, d_f);
  // What lies behind the results stays.
  std::vector<S> y(x.size() + 4, S(7)), e(f.size() + 4, S(7)), d_a(a.size() + 4, S(7));
  kernels.sparse_frames(table, a.data(), x.data(), f.data(), y.data(), e.data(), 0, w.vertices);
  kernels.sparse_frames_adjoint(table, x.data(), f.data(), g.data(), h.data(), d_a.data(), 0, w.vertices);
  CAPTURE(w.vertices, w.per_vertex, isa_name(isa));
  CHECK(relative_error(y.data(), expected.points) < tolerance);
  CHECK(relative_error(e.data(), expected.frames) < tolerance);
  CHECK(relative_error(d_a.data(), expected.d_transforms) < tolerance);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(y[x.size() + i] == 7);
    CHECK(e[f.size() + i] == 7);
    CHECK(d_a[a.size() + i] == 7);
  }
}

struct BothPrecisions {
  SkinWeights<float> single;
  SkinWeights<double> full;
  explicit BothPrecisions(const SparseWeights& w) : single(w), full(w) {}
  const SkinWeights<float>& operator()(const Var<float>&) const { return single; }
  const SkinWeights<double>& operator()(const Var<double>&) const { return full; }
};

}  // namespace

TEST_CASE("skinned frames and their adjoint are those of the formula, for every size and instruction set") {
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa > best_isa()) continue;
    for (const Index vertices : {1, 2, 3, 4, 5, 7, 8, 9, 127, 128, 129, 1000}) {
      for (const Index per_vertex : {1, 4, 8}) {
        const SparseWeights w = random_weights(vertices, 11, per_vertex, static_cast<std::uint64_t>(vertices));
        check_kernels<float>(w, isa, 2e-6);
        check_kernels<double>(w, isa, 2e-15);
      }
    }
  }
}

TEST_CASE("skinned frames pass the operator checks, both results or one of them") {
  for (const Index per_vertex : {3, 4}) {
    const SparseWeights w = random_weights(133, 5, per_vertex, 9);
    const BothPrecisions both(w);
    const OperatorInput transforms{"transforms", shape_of(5, 12)}, points{"points", shape_of(133, 3)},
        frames{"frames", shape_of(133, 9)};
    const auto skinned = [&](const auto& in) { return skin_frames(both(in[0]), in[0], in[1], in[2]); };
    check_operator("frames beside points", {transforms, points, frames}, [&](const auto& in) {
      const auto result = skinned(in);
      const std::array parts = {result.points, result.frames};
      return concat_cols(std::span<const std::remove_cvref_t<decltype(in[0])>>(parts));
    });
    check_operator("points alone", {transforms, points}, [&](const auto& in) {
      auto& tape = in[0].owner();
      return skin_frames(both(in[0]), in[0], in[1], tape.constant("frames", shape_of(133, 9))).points;
    });
    check_operator("frames alone", {transforms, frames}, [&](const auto& in) {
      auto& tape = in[0].owner();
      return skin_frames(both(in[0]), in[0], tape.constant("points", shape_of(133, 3)), in[1]).frames;
    });
  }
}

TEST_CASE("D2: frames between two opposite bones are finite, and so is the gradient") {
  // Half of the identity and half of a half turn about z: singular, x and y shrink to nothing.
  Tape<double> tape;
  const auto a = tape.parameter("transforms", shape_of(2, 12));
  tape.set(a, Numbers{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0});
  const auto x = tape.constant("points", shape_of(1, 3)), f = tape.constant("frames", shape_of(1, 9));
  tape.set(x, Numbers{1, 2, 3});
  tape.set(f, Numbers{1, 0, 0, 0, 1, 0, 0, 0, 1});
  const SkinWeights<double> weights(SparseWeights{1, 2, 2, {0, 1}, {0.5, 0.5}});
  const auto posed = skin_frames(weights, a, x, f);
  const auto loss = sum(square(posed.frames)) + sum(posed.points);
  tape.forward(loss);
  tape.backward(loss);
  const ConstArray<double> frames = tape.value(posed.frames);
  CHECK(Numbers(frames.data, frames.data + 9) == Numbers{0, 0, 0, 0, 0, 0, 0, 0, 1});
  for (Index i = 0; i < 24; ++i) CHECK(std::isfinite(tape.gradient(a).data[i]));
  CHECK(tape.gradient(a).data[10] == 0.5 * 2 * 1 + 0.5 * 3);  // d (F'_zz)² + d y_z, both by A_zz of the first
}

TEST_CASE("a steady iteration of skinned frames allocates nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  Tape<float> tape;
  const auto a = tape.parameter("transforms", shape_of(10, 12));
  const auto x = tape.parameter("points", shape_of(5000, 3)), f = tape.parameter("frames", shape_of(5000, 9));
  const auto posed = skin_frames(SkinWeights<float>(random_weights(5000, 10, 4, 20)), a, x, f);
  const auto loss = sum(square(posed.points)) + sum(square(posed.frames));
  const auto iterate = [&] {
    tape.write(a).data[0] += 0.25F;
    tape.forward(loss);
    tape.backward(loss);
  };
  CHECK(steady_allocations([&] {
          for (int i = 0; i < 20; ++i) iterate();
        }) == 0);
}

TEST_CASE("frames that do not fit the weights are refused") {
  Tape<double> tape;
  const SkinWeights<double> weights(random_weights(4, 2, 2, 22));
  const auto a = tape.parameter("transforms", shape_of(2, 12));
  const auto x = tape.parameter("points", shape_of(4, 3)), f = tape.parameter("frames", shape_of(4, 9));
  CHECK_THROWS_WITH(skin_frames(weights, a, x, x), Catch::Contains("[4,3] against [4,9]"));
  CHECK_THROWS_WITH(skin_frames(weights, a, f, f), Catch::Contains("[4,9] against [4,3]"));
  CHECK_THROWS_WITH(skin_frames(weights, x, x, f), Catch::Contains("[4,3] against [2,12]"));
  const SkinWeights<double> dense(DenseWeights{4, 2, Numbers(8, 0.5)});
  CHECK_THROWS_WITH(skin_frames(dense, a, x, f), Catch::Contains("frames need sparse weights"));
}

}  // namespace skin_frames_test
