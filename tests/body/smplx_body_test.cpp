#include "body/smplx_body.h"

#include <cmath>
#include <numbers>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "core/rotation.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/measures.h"
#include "tests/support/operator_check.h"
#include "tests/support/smplx_reference.h"

namespace smplx_body_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

SmplxModel model_of(const SmplxArrays& arrays, const SmplxFileOptions& options = {}) {
  return decode_smplx(smplx_writer(arrays).encode(), "body.npz", options);
}

template <class S>
Numbers numbers_of(const ConstArray<S>& array) {
  return {array.data, array.data + array.shape.count()};
}

/// How rotations are given.
enum class Kind { kAxisAngle, kSixD };

/// A body on a tape in a pose.
template <class S>
struct Taped {
  Tape<S> tape;
  SmplxParameters<S> p;
  PosedSmplx<S> posed;

  /// @param hand_means  what is taken off the pose's hands, because the body adds it
  Taped(const SmplxBody<S>& body, const SmplxPose& pose, Kind kind = Kind::kAxisAngle,
        const std::array<Numbers, 2>& hand_means = {}) {
    if (!pose.betas.empty()) p.betas = leaf("betas", 1, pose.betas);
    if (!pose.expression.empty()) p.expression = leaf("expression", 1, pose.expression);
    p.global_orient = rotations("global_orient", pose, 0, 1, kind);
    p.body_pose = rotations("body_pose", pose, 1, 21, kind);
    p.jaw_pose = rotations("jaw_pose", pose, 22, 1, kind);
    p.leye_pose = rotations("leye_pose", pose, 23, 1, kind);
    p.reye_pose = rotations("reye_pose", pose, 24, 1, kind);
    p.left_hand_pose = rotations("left_hand_pose", pose, 25, 15, kind, hand_means[0]);
    p.right_hand_pose = rotations("right_hand_pose", pose, 40, 15, kind, hand_means[1]);
    p.transl = leaf("transl", 1, {pose.transl[0], pose.transl[1], pose.transl[2]});
    posed = pose_smplx(tape, body, p);
  }

  Var<S> leaf(const char* name, Index rows, const Numbers& numbers) {
    const Var<S> var = tape.parameter(name, shape_of(rows, static_cast<Index>(numbers.size()) / rows));
    tape.set(var, std::vector<S>(numbers.begin(), numbers.end()));
    return var;
  }
  Var<S> rotations(const char* name, const SmplxPose& pose, Index first, Index count, Kind kind,
                   const Numbers& mean = {}) {
    Numbers numbers;
    for (Index j = first; j < first + count; ++j) {
      const double* w = pose.axis_angle.data() + 3 * j;
      if (kind == Kind::kAxisAngle) {
        for (Index i = 0; i < 3; ++i) {
          numbers.push_back(w[i] - (mean.empty() ? 0 : mean[static_cast<std::size_t>(3 * (j - first) + i)]));
        }
      } else {
        const Matrix3<double> r = so3_exp(Vector3<double>(w[0], w[1], w[2]));
        for (int c = 0; c < 2; ++c) {
          for (int i = 0; i < 3; ++i) numbers.push_back((c == 0 ? 0.7 : 1.9) * r(i, c));  // of any length
        }
      }
    }
    return leaf(name, count, numbers);
  }
  Numbers vertices() {
    tape.forward(posed.vertices);
    return numbers_of(tape.value(posed.vertices));
  }
  Numbers joints() {
    tape.forward(posed.joints);
    return numbers_of(tape.value(posed.joints));
  }
};

/// Vertices and joints of both precisions against the reference, with axis-angle and 6D parameters.
void check_pose(const SmplxArrays& arrays, const SmplxModel& model, const SmplxPose& pose) {
  const SmplxResult expected = reference_smplx(arrays, pose);
  SmplxBodyOptions flat;
  flat.flat_hand_mean = true;
  const SmplxBody<double> full(model, flat), with_mean(model);
  const SmplxBody<float> single(model, flat);
  for (const Kind kind : {Kind::kAxisAngle, Kind::kSixD}) {
    Taped<double> exact(full, pose, kind);
    CHECK(largest_difference(exact.vertices(), expected.vertices) <= 1e-9);
    CHECK(largest_difference(exact.joints(), expected.joints) <= 1e-9);
    Taped<float> fast(single, pose, kind);
    CHECK(largest_difference(fast.vertices(), expected.vertices) <= 1e-5);
    CHECK(largest_difference(fast.joints(), expected.joints) <= 1e-5);
  }
  Taped<double> relative(with_mean, pose, Kind::kAxisAngle, arrays.hand_means);
  CHECK(largest_difference(relative.vertices(), expected.vertices) <= 1e-9);
}

/// Poses that are told apart by the kinds of their angles.
std::vector<SmplxPose> telling_poses(int betas, int expressions) {
  std::vector<SmplxPose> poses;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) poses.push_back(random_smplx_pose(betas, expressions, seed));
  SmplxPose identity = random_smplx_pose(betas, expressions, 5);
  identity.axis_angle.assign(165, 0.0);
  poses.push_back(identity);
  SmplxPose rest = identity;
  rest.betas.assign(rest.betas.size(), 0.0);
  rest.expression.assign(rest.expression.size(), 0.0);
  rest.transl = {};
  poses.push_back(rest);
  SmplxPose tiny = identity;
  for (std::size_t i = 0; i < 165; ++i) tiny.axis_angle[i] = 1e-6 * static_cast<double>(i % 7);
  poses.push_back(tiny);
  for (int axis = 0; axis < 3; ++axis) {  // half a turn of every joint, exactly
    SmplxPose half = identity;
    for (std::size_t j = 0; j < 55; ++j) {
      half.axis_angle[3 * j + (j + static_cast<std::size_t>(axis)) % 3] =
          j % 2 == 0 ? std::numbers::pi : -std::numbers::pi;
    }
    poses.push_back(half);
  }
  SmplxPose diagonal = identity;
  for (double& x : diagonal.axis_angle) x = std::numbers::pi / std::sqrt(3.0);
  poses.push_back(diagonal);
  return poses;
}

/// d (g_vertices · vertices + g_joints · joints) by `numbers` of the pose, by central differences of the reference.
Numbers reference_gradient(const SmplxArrays& arrays, const SmplxPose& pose, std::span<double> numbers,
                           const Numbers& g_vertices, const Numbers& g_joints) {
  const auto loss = [&] {
    const SmplxResult r = reference_smplx(arrays, pose);
    double sum = 0;
    for (std::size_t i = 0; i < r.vertices.size(); ++i) sum += g_vertices[i] * r.vertices[i];
    for (std::size_t i = 0; i < r.joints.size(); ++i) sum += g_joints[i] * r.joints[i];
    return sum;
  };
  Numbers gradient;
  for (double& x : numbers) {
    const double before = x, step = 1e-5;
    x = before + step;
    const double above = loss();
    x = before - step;
    const double below = loss();
    x = before;
    gradient.push_back((above - below) / (2 * step));
  }
  return gradient;
}

/// a · vertices + b · joints with fixed random numbers.
template <class S>
Var<S> weighed(Taped<S>& taped, const Numbers& g_vertices, const Numbers& g_joints) {
  Tape<S>& tape = taped.tape;
  const auto constant = [&](const Numbers& numbers) {
    const Var<S> var = tape.constant("cotangent", shape_of(static_cast<Index>(numbers.size()) / 3, 3));
    tape.set(var, std::vector<S>(numbers.begin(), numbers.end()));
    return var;
  };
  return sum(taped.posed.vertices * Operand<S>(constant(g_vertices))) +
         sum(taped.posed.joints * Operand<S>(constant(g_joints)));
}

Numbers random_numbers(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Numbers numbers(count);
  for (double& x : numbers) x = std::uniform_real_distribution<double>(-1, 1)(random);
  return numbers;
}

/// Largest difference over the largest number.
double relative_difference(const Numbers& a, const Numbers& b) {
  double largest = 0;
  for (const double x : b) largest = std::max(largest, std::abs(x));
  return largest_difference(a, b) / largest;
}

}  // namespace

TEST_CASE("a body agrees with plain loops: random poses, identity, half turns, both precisions") {
  for (const bool correctives : {true, false}) {
    const SmplxArrays arrays = random_smplx({.vertices = 77, .correctives = correctives, .seed = 11});
    const SmplxModel model = model_of(arrays);
    for (const SmplxPose& pose : telling_poses(10, 10)) check_pose(arrays, model, pose);
  }
}

TEST_CASE("a body of 400 directions, or weights on many joints, agrees with plain loops") {
  const SmplxArrays wide = random_smplx({.vertices = 40, .columns = 400, .seed = 12});
  const SmplxModel model = model_of(wide, {.betas = 12, .expressions = 33});
  CHECK(model.betas_in_file == 300);
  CHECK(model.expressions_in_file == 100);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) check_pose(wide, model, random_smplx_pose(12, 33, seed));
  const SmplxArrays dense = random_smplx({.vertices = 300, .weights_per_vertex = 20, .seed = 13});
  for (std::uint64_t seed = 1; seed <= 3; ++seed) check_pose(dense, model_of(dense), random_smplx_pose(10, 10, seed));
}

TEST_CASE("the size of the correctives and their packing keep float within 1e-5 m") {
  for (const double size : {1e-4, 7e-4, 5e-3, 0.05}) {
    const SmplxArrays arrays = random_smplx({.vertices = 500, .corrective_size = size, .seed = 14});
    const SmplxModel model = model_of(arrays);
    for (const SmplxPose& pose : telling_poses(10, 10)) {
      const SmplxResult expected = reference_smplx(arrays, pose);
      Taped<float> fast(SmplxBody<float>(model), pose, Kind::kAxisAngle, arrays.hand_means);
      CHECK(largest_difference(fast.vertices(), expected.vertices) <= 1e-5);
    }
  }
}

TEST_CASE("the MakeHuman body agrees with plain loops") {
  std::string path;
  const std::optional<SmplxArrays> arrays = makehuman_arrays(path);
  if (!arrays) {
    WARN("skipped: " << path << " is not there");
    return;
  }
  const SmplxModel model = read_smplx(path);
  CHECK(model.vertex_count() == 13524);
  CHECK(model.correctives.empty());
  CHECK(model.rescaled_weights == 0);
  for (const SmplxPose& pose : telling_poses(10, 10)) check_pose(*arrays, model, pose);
}

TEST_CASE("gradients of every parameter agree with differences of plain loops") {
  const SmplxArrays arrays = random_smplx({.vertices = 40, .seed = 15});
  const SmplxModel model = model_of(arrays);
  SmplxBodyOptions flat;
  flat.flat_hand_mean = true;
  for (const bool at_rest : {false, true}) {
    SmplxPose pose = random_smplx_pose(10, 10, 16);
    if (at_rest) pose.axis_angle.assign(165, 0.0);
    const Numbers g_vertices = random_numbers(120, 1), g_joints = random_numbers(165, 2);
    Taped<double> taped(SmplxBody<double>(model, flat), pose);
    const Var<double> loss = weighed(taped, g_vertices, g_joints);
    taped.tape.forward(loss);
    taped.tape.backward(loss);
    const auto check = [&](const char* name, Var<double> parameter, std::span<double> numbers) {
      INFO(name);
      const Numbers expected = reference_gradient(arrays, pose, numbers, g_vertices, g_joints);
      CHECK(relative_difference(numbers_of(taped.tape.gradient(parameter)), expected) <= 1e-8);
    };
    check("betas", taped.p.betas, pose.betas);
    check("expression", taped.p.expression, pose.expression);
    check("transl", taped.p.transl, pose.transl);
    const std::span<double> w = pose.axis_angle;
    check("global_orient", taped.p.global_orient, w.subspan(0, 3));
    check("body_pose", taped.p.body_pose, w.subspan(3, 63));
    check("jaw_pose", taped.p.jaw_pose, w.subspan(66, 3));
    check("leye_pose", taped.p.leye_pose, w.subspan(69, 3));
    check("reye_pose", taped.p.reye_pose, w.subspan(72, 3));
    check("left_hand_pose", taped.p.left_hand_pose, w.subspan(75, 45));
    check("right_hand_pose", taped.p.right_hand_pose, w.subspan(120, 45));
  }
}

TEST_CASE("the whole body passes the operator checks in axis-angle, 6D and hand components", "[parallel]") {
  const SmplxArrays arrays = random_smplx({.vertices = 33, .seed = 17});
  const SmplxModel model = model_of(arrays, {.betas = 3, .expressions = 2});
  SmplxBodyOptions exact;
  exact.packing = 0;
  const SmplxBody<double> full(model, exact);
  const SmplxBody<float> single(model, exact);
  const auto record = [&](const auto& in, const auto& body) {
    using S = std::remove_pointer_t<decltype(in[0].tape->value(in[0]).data)>;
    using T = std::remove_const_t<S>;
    const SmplxParameters<T> p{in[0], in[1], in[2], in[3], in[4], in[5], in[6], in[7], in[8], in[9]};
    const PosedSmplx<T> posed = pose_smplx(*in[0].tape, body, p);
    const std::array<Var<T>, 2> results = {posed.vertices, posed.joints};
    return concat_rows(std::span<const Var<T>>(results));
  };
  struct Pick {
    const SmplxBody<float>& single;
    const SmplxBody<double>& full;
    const SmplxBody<float>& operator()(const Var<float>&) const { return single; }
    const SmplxBody<double>& operator()(const Var<double>&) const { return full; }
  };
  const Pick pick{single, full};
  for (const int form : {0, 1, 2}) {
    const Index n = form == 1 ? 6 : 3;
    const auto hand = [&](const char* name) {
      return OperatorInput{name, form == 2 ? shape_of(1, 6) : shape_of(15, n)};
    };
    OperatorCheck options;
    options.entries = 12;
    check_operator(
        "pose_smplx, form " + std::to_string(form),
        {{"betas", shape_of(1, 3)},
         {"expression", shape_of(1, 2)},
         {"global_orient", shape_of(1, n)},
         {"body_pose", shape_of(21, n)},
         {"jaw_pose", shape_of(1, n)},
         {"leye_pose", shape_of(1, n)},
         {"reye_pose", shape_of(1, n)},
         hand("left_hand_pose"),
         hand("right_hand_pose"),
         {"transl", shape_of(1, 3)}},
        [&](const auto& in) { return record(in, pick(in[0])); }, options);
  }
}

TEST_CASE("hand components are the file's, with its mean unless hands are flat") {
  const SmplxArrays arrays = random_smplx({.vertices = 40, .seed = 18});
  const SmplxModel model = model_of(arrays);
  const Numbers coefficients = {0.4, -0.7, 1.1};
  for (const bool flat : {false, true}) {
    SmplxBodyOptions options;
    options.flat_hand_mean = flat;
    const SmplxBody<double> body(model, options);
    SmplxPose pose = random_smplx_pose(0, 0, 19);
    Taped<double> taped(body, pose);
    SmplxParameters<double> p = taped.p;
    p.left_hand_pose = taped.leaf("left", 1, coefficients);
    p.right_hand_pose = {};  // at its mean
    const PosedSmplx<double> posed = pose_smplx(taped.tape, body, p);
    for (std::size_t side = 0; side < 2; ++side) {
      for (std::size_t i = 0; i < 45; ++i) {
        double x = flat ? 0 : arrays.hand_means[side][i];
        for (std::size_t k = 0; side == 0 && k < 3; ++k) x += coefficients[k] * arrays.hand_components[0][45 * k + i];
        pose.axis_angle[75 + 45 * side + i] = x;
      }
    }
    taped.tape.forward(posed.vertices);
    CHECK(largest_difference(numbers_of(taped.tape.value(posed.vertices)), reference_smplx(arrays, pose).vertices) <=
          1e-9);
    CHECK_THROWS_AS(hand_pose(body, taped.leaf("many", 1, Numbers(46, 0.0)), 0), InternalError);
  }
}

TEST_CASE("correctives of what is frozen are computed once and gathered never") {
  const SmplxArrays arrays = random_smplx({.vertices = 200, .seed = 20});
  const SmplxPose pose = random_smplx_pose(10, 10, 21);
  const SmplxBody<double> body(model_of(arrays), {.flat_hand_mean = true});
  Taped<double> taped(body, pose), whole(body, pose);
  const std::vector<Var<double>> frozen = {taped.p.left_hand_pose, taped.p.right_hand_pose, taped.p.jaw_pose,
                                           taped.p.leye_pose,      taped.p.reye_pose,       taped.p.betas,
                                           taped.p.expression};
  for (const Var<double> v : frozen) taped.tape.freeze(v);
  const Numbers cotangent = random_numbers(600, 3);
  const auto iterate = [&](Taped<double>& t) {
    t.tape.write(t.p.body_pose).data[5] += 0.1;
    t.tape.forward(t.posed.vertices);
    t.tape.backward(t.posed.vertices, cotangent);
  };
  const auto runs = [&] {
    std::array<Index, 2> count = {0, 0};
    for (const NodeStatistics& node : taped.tape.statistics()) {
      if (node.name == "pose_correctives") count[0] += node.forward_runs, count[1] += node.backward_runs;
    }
    return count;
  };
  iterate(taped);
  CHECK(runs() == std::array<Index, 2>{4, 1});
  iterate(taped);
  iterate(taped);
  CHECK(runs() == std::array<Index, 2>{6, 3});
  for (int i = 0; i < 3; ++i) iterate(whole);
  CHECK(taped.vertices() == whole.vertices());
  CHECK(numbers_of(taped.tape.gradient(taped.p.body_pose)) == numbers_of(whole.tape.gradient(whole.p.body_pose)));

  SmplxPose mixed = pose;  // a part that is written is computed, frozen or not
  mixed.axis_angle[3 + 5] += 0.3;
  mixed.axis_angle[75] += 0.2;
  taped.tape.write(taped.p.left_hand_pose).data[0] += 0.2;
  CHECK(largest_difference(taped.vertices(), reference_smplx(arrays, mixed).vertices) <= 1e-9);
}

TEST_CASE("only what a loss needs is computed, and shape once") {
  const SmplxArrays arrays = random_smplx({.vertices = 200, .seed = 23});
  const SmplxBody<double> body(model_of(arrays));
  Taped<double> taped(body, random_smplx_pose(10, 10, 24));
  const auto runs = [&](const std::string& name) {
    Index count = 0;
    for (const NodeStatistics& node : taped.tape.statistics()) count += node.name == name ? node.forward_runs : 0;
    return count;
  };
  taped.joints();
  CHECK(runs("skin_points") == 0);
  CHECK(runs("pose_correctives") == 0);
  CHECK(runs("blend_shapes") == 1);  // of the joints
  for (int i = 0; i < 3; ++i) {
    taped.tape.write(taped.p.body_pose).data[5] += 0.1;
    taped.vertices();
  }
  CHECK(runs("skin_points") == 3);
  CHECK(runs("blend_shapes") == 2);
  taped.tape.write(taped.p.betas).data[0] += 0.1;
  taped.vertices();
  CHECK(runs("blend_shapes") == 4);
}

TEST_CASE("the translation moves every point alike, a kilometre away too") {
  const SmplxArrays arrays = random_smplx({.vertices = 100, .seed = 25});
  SmplxPose near = random_smplx_pose(10, 10, 26), far = near;
  near.transl = {0, 0, 0};
  far.transl = {1024, -1024, 512};
  const SmplxBody<double> body(model_of(arrays));
  Taped<double> a(body, near), b(body, far);
  const Numbers from = a.vertices(), to = b.vertices();
  for (std::size_t i = 0; i < from.size(); ++i) CHECK(std::abs(to[i] - from[i] - far.transl[i % 3]) < 1e-12);
}

TEMPLATE_TEST_CASE("a steady iteration of a body allocates nothing", "", float, double) {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  const SmplxModel model = model_of(random_smplx({.vertices = 3000, .seed = 27}));
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      Taped<TestType> taped(SmplxBody<TestType>(model), random_smplx_pose(10, 10, 28));
      const auto loss = sum(square(taped.posed.vertices));
      const auto iterate = [&](int i) {
        taped.tape.write(taped.p.body_pose).data[i] += TestType(0.01);
        if (i % 3 == 0) taped.tape.write(taped.p.left_hand_pose).data[i] += TestType(0.01);
        if (i % 4 == 0) taped.tape.write(taped.p.betas).data[0] += TestType(0.01);
        if (i % 5 == 0) taped.tape.freeze(taped.p.betas);
        if (i % 5 == 2) taped.tape.unfreeze(taped.p.betas);
        taped.tape.forward(loss);
        taped.tape.backward(loss);
      };
      CHECK(steady_allocations([&] {
              for (int i = 0; i < 30; ++i) iterate(i);
            }) == 0);
    });
  }
}

TEST_CASE("parameters of a wrong shape are refused") {
  const SmplxBody<double> body(model_of(random_smplx({.vertices = 5, .seed = 29})));
  Tape<double> tape;
  SmplxParameters<double> p;
  p.body_pose = tape.parameter("body_pose", shape_of(20, 3));
  CHECK_THROWS_AS(pose_smplx(tape, body, p), InternalError);
  p = {};
  p.betas = tape.parameter("betas", shape_of(1, 9));
  CHECK_THROWS_WITH(pose_smplx(tape, body, p), Catch::Contains("[1,9] against [1,10]"));
}

TEST_CASE("rotations may be matrices") {
  const SmplxArrays arrays = random_smplx({.vertices = 40, .seed = 31});
  const SmplxModel model = model_of(arrays);
  SmplxBodyOptions flat;
  flat.flat_hand_mean = true;
  const SmplxBody<double> body(model, flat);
  const SmplxPose pose = random_smplx_pose(10, 10, 32);
  Taped<double> taped(body, pose);
  const auto matrices = [&](const char* name, Index first, Index count) {
    Numbers numbers;
    for (Index j = first; j < first + count; ++j) {
      const double* w = pose.axis_angle.data() + 3 * j;
      const Matrix3<double> r = so3_exp(Vector3<double>(w[0], w[1], w[2]));
      for (int i = 0; i < 9; ++i) numbers.push_back(r(i / 3, i % 3));
    }
    return taped.leaf(name, count, numbers);
  };
  SmplxParameters<double> p = taped.p;
  p.global_orient = matrices("global_orient", 0, 1);
  p.body_pose = matrices("body_pose", 1, 21);
  p.left_hand_pose = matrices("left_hand_pose", 25, 15);
  const PosedSmplx<double> posed = pose_smplx(taped.tape, body, p);
  taped.tape.forward(posed.vertices);
  CHECK(largest_difference(numbers_of(taped.tape.value(posed.vertices)), reference_smplx(arrays, pose).vertices) <=
        1e-9);
  p.body_pose = taped.tape.parameter("wrong", shape_of(21, 4));
  CHECK_THROWS_AS(pose_smplx(taped.tape, body, p), InternalError);
}

}  // namespace smplx_body_test
