// Gradients of every parameter of a body against plain loops in complex numbers, f'(x) = Im f(x + ih)/h: exact to
// rounding, so that an adjoint that is right to eight digits only would fail.
#include <complex>
#include <numbers>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "body/smplx_body.h"
#include "core/rotation.h"
#include "tests/support/operator_check.h"
#include "tests/support/random_numbers.h"
#include "tests/support/smplx_reference.h"

namespace smplx_gradient_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Complex = std::complex<double>;
using ComplexNumbers = std::vector<Complex>;
constexpr double kStep = 1e-30;

/// How the numbers of a body are given.
enum class Form { kAxisAngle, kSixD, kComponents };

constexpr std::size_t kComponentCount = 7;

struct Group {
  const char* name;
  std::size_t first_joint, joints;  // none: no rotation
};
constexpr Group kGroups[] = {{"betas", 0, 0},      {"expression", 0, 0},       {"global_orient", 0, 1},
                             {"body_pose", 1, 21}, {"jaw_pose", 22, 1},        {"leye_pose", 23, 1},
                             {"reye_pose", 24, 1}, {"left_hand_pose", 25, 15}, {"right_hand_pose", 40, 15},
                             {"transl", 0, 0}};
constexpr std::size_t kCount = std::size(kGroups);

/// The numbers of all groups, in the order of kGroups.
template <class C>
using State = std::array<std::vector<C>, kCount>;

bool is_hand(std::size_t group) { return kGroups[group].joints == 15; }

/// What is looked at: hands are flat or have their mean, as the form has it.
struct Case {
  const SmplxArrays& arrays;
  Form form;
};

/// Two columns made a rotation by Gram and Schmidt.
std::array<std::array<Complex, 3>, 3> columns_to_rotation(const Complex* x) {
  const auto dot3 = [](const Complex* a, const Complex* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; };
  Complex b1[3], b2[3];
  const Complex length = std::sqrt(dot3(x, x));
  for (int i = 0; i < 3; ++i) b1[i] = x[i] / length;
  const Complex along = dot3(b1, x + 3);
  for (int i = 0; i < 3; ++i) b2[i] = x[3 + i] - along * b1[i];
  const Complex second = std::sqrt(dot3(b2, b2));
  for (Complex& c : b2) c /= second;
  const Complex b3[3] = {b1[1] * b2[2] - b1[2] * b2[1], b1[2] * b2[0] - b1[0] * b2[2], b1[0] * b2[1] - b1[1] * b2[0]};
  std::array<std::array<Complex, 3>, 3> r;
  for (std::size_t i = 0; i < 3; ++i) r[i] = {b1[i], b2[i], b3[i]};
  return r;
}

/// Vertices and joints by plain loops.
SmplxResultOf<Complex> plain_body(const Case& c, const State<Complex>& state) {
  SmplxPoseOf<Complex> pose;
  pose.betas = state[0];
  pose.expression = state[1];
  std::copy(state[9].begin(), state[9].end(), pose.transl.begin());
  pose.axis_angle.resize(165);
  for (std::size_t g = 2; g < 9; ++g) {
    if (c.form == Form::kSixD) continue;
    Complex* to = pose.axis_angle.data() + 3 * kGroups[g].first_joint;
    if (c.form == Form::kAxisAngle || !is_hand(g)) {
      std::copy(state[g].begin(), state[g].end(), to);
      continue;
    }
    const std::size_t side = g - 7;
    for (std::size_t i = 0; i < 45; ++i) {
      to[i] = c.arrays.hand_means[side][i];
      for (std::size_t k = 0; k < kComponentCount; ++k)
        to[i] += state[g][k] * c.arrays.hand_components[side][45 * k + i];
    }
  }
  auto rotations = reference_rotations(pose);
  for (std::size_t g = 2; g < 9 && c.form == Form::kSixD; ++g) {
    for (std::size_t j = 0; j < kGroups[g].joints; ++j)
      rotations[kGroups[g].first_joint + j] = columns_to_rotation(state[g].data() + 6 * j);
  }
  return reference_smplx(c.arrays, pose, rotations);
}

/// Cotangents of vertices and joints.
struct Cotangent {
  Numbers vertices, joints;
};

double derivative(const Case& c, State<Complex> state, const Cotangent& g) {
  const SmplxResultOf<Complex> r = plain_body(c, state);
  double sum = 0;
  for (std::size_t i = 0; i < r.vertices.size(); ++i) sum += g.vertices[i] * r.vertices[i].imag();
  for (std::size_t i = 0; i < r.joints.size(); ++i) sum += g.joints[i] * r.joints[i].imag();
  return sum / kStep;
}

/// Gradients of all groups by the tape.
template <class S>
State<double> taped_gradients(const SmplxBody<S>& body, const Case& c, const State<double>& state, const Cotangent& g) {
  Tape<S> tape;
  SmplxParameters<S> p;
  Var<S>* const vars[] = {&p.betas,     &p.expression, &p.global_orient,  &p.body_pose,       &p.jaw_pose,
                          &p.leye_pose, &p.reye_pose,  &p.left_hand_pose, &p.right_hand_pose, &p.transl};
  for (std::size_t i = 0; i < kCount; ++i) {
    const bool is_one_row = kGroups[i].joints == 0 || (is_hand(i) && c.form == Form::kComponents);
    const Index rows = is_one_row ? 1 : static_cast<Index>(kGroups[i].joints);
    *vars[i] = tape.parameter(kGroups[i].name, shape_of(rows, static_cast<Index>(state[i].size()) / rows));
    tape.set(*vars[i], std::vector<S>(state[i].begin(), state[i].end()));
  }
  const PosedSmplx<S> posed = pose_smplx(tape, body, p);
  const auto weighed = [&](Var<S> result, const Numbers& numbers) {
    const Var<S> by = tape.constant("cotangent", result.shape());
    tape.set(by, std::vector<S>(numbers.begin(), numbers.end()));
    return sum(result * Operand<S>(by));
  };
  const Var<S> loss = weighed(posed.vertices, g.vertices) + Operand<S>(weighed(posed.joints, g.joints));
  tape.forward(loss);
  tape.backward(loss);
  State<double> gradients;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto d = tape.gradient(*vars[i]);
    gradients[i].assign(d.data, d.data + d.shape.count());
  }
  return gradients;
}

/// Poses that are told apart by the kinds of their angles.
enum class Angles { kRandom, kNone, kTiny, kHalfTurns, kFullTurns };

State<double> state_of(Form form, Angles angles, RandomNumbers& random) {
  State<double> state;
  state[0] = random.numbers(10, 2);
  state[1] = random.numbers(10, 2);
  state[9] = random.numbers(3, 3);
  for (std::size_t g = 2; g < 9; ++g) {
    if (is_hand(g) && form == Form::kComponents) {
      state[g] = random.numbers(kComponentCount, angles == Angles::kNone ? 0 : 1);
      continue;
    }
    for (std::size_t j = 0; j < kGroups[g].joints; ++j) {
      Vector3<double> w(random(), random(), random());
      if (angles == Angles::kNone) w.setZero();
      if (angles == Angles::kTiny) w *= 1e-7;
      if (angles == Angles::kRandom) w *= 1.5;
      if (angles == Angles::kHalfTurns)
        w = j % 2 == 0 ? Vector3<double>(w.normalized() * std::numbers::pi) : Vector3<double>(0, -std::numbers::pi, 0);
      if (angles == Angles::kFullTurns) w = w.normalized() * (2 * std::numbers::pi);
      if (form == Form::kSixD) {
        const Matrix3<double> r = so3_exp(w);
        for (int i = 0; i < 6; ++i)
          state[g].push_back((i < 3 ? 0.7 : 1.9) * r(i % 3, i / 3) + (i < 3 ? 0 : 0.3 * r(i % 3, 0)));
      } else {
        for (int i = 0; i < 3; ++i) state[g].push_back(w[i]);
      }
    }
  }
  return state;
}

State<Complex> complex_state(const State<double>& state) {
  State<Complex> result;
  for (std::size_t g = 0; g < kCount; ++g) result[g].assign(state[g].begin(), state[g].end());
  return result;
}

double largest(const Numbers& numbers) {
  double result = 0;
  for (const double x : numbers) result = std::max(result, std::abs(x));
  return result;
}

SmplxBodyOptions options_of(Form form) {
  SmplxBodyOptions options;
  options.flat_hand_mean = form != Form::kComponents;
  options.packing = 0;
  return options;
}

/// Compares every entry, or `directions` random directions of each group where that many are asked for.
void check_gradients(const SmplxArrays& arrays, const SmplxModel& model, Form form, Angles angles, int directions,
                     std::uint64_t seed) {
  INFO("form " << static_cast<int>(form) << ", angles " << static_cast<int>(angles));
  RandomNumbers random(seed);
  const Case c{arrays, form};
  const State<double> state = state_of(form, angles, random);
  const Cotangent g{random.numbers(3 * static_cast<std::size_t>(arrays.vertices)), random.numbers(165)};
  const State<double> exact = taped_gradients(SmplxBody<double>(model, options_of(form)), c, state, g);
  const State<double> fast = taped_gradients(SmplxBody<float>(model, options_of(form)), c, state, g);
  double all = 0;
  for (const Numbers& numbers : exact) all = std::max(all, largest(numbers));
  for (std::size_t i = 0; i < kCount; ++i) {
    INFO(kGroups[i].name);
    const double size = largest(exact[i]);
    REQUIRE(size > 0);
    // An eye's vertices are a centimetre from their joint and metres from the origin, which costs two digits of a
    // float. After a full turn a rotation's own gradient is along its axis only, and small beside what it is the sum
    // of.
    const double scale = angles == Angles::kFullTurns ? all : size;
    for (std::size_t k = 0; k < exact[i].size(); ++k) REQUIRE(std::abs(fast[i][k] - exact[i][k]) <= 1e-4 * scale);
    const std::size_t tries = directions > 0 ? static_cast<std::size_t>(directions) : state[i].size();
    for (std::size_t k = 0; k < tries; ++k) {
      Numbers direction(state[i].size());
      if (directions > 0) {
        direction = random.numbers(state[i].size());
      } else {
        direction[k] = 1;
      }
      State<Complex> moved = complex_state(state);
      double along = 0, magnitude = 0;
      for (std::size_t n = 0; n < direction.size(); ++n) {
        moved[i][n] += Complex(0, kStep * direction[n]);
        along += exact[i][n] * direction[n];
        magnitude += std::abs(exact[i][n] * direction[n]);
      }
      REQUIRE(std::abs(derivative(c, moved, g) - along) <= 1e-11 * std::max(size, magnitude));
    }
  }
}

constexpr Angles kAllAngles[] = {Angles::kRandom, Angles::kNone, Angles::kTiny, Angles::kHalfTurns, Angles::kFullTurns};

}  // namespace

TEST_CASE("the plain loops in complex numbers are those in double") {
  const SmplxArrays arrays = random_smplx({.vertices = 20, .seed = 40});
  const SmplxPose pose = random_smplx_pose(10, 10, 41);
  SmplxPoseOf<Complex> same;
  same.betas.assign(pose.betas.begin(), pose.betas.end());
  same.expression.assign(pose.expression.begin(), pose.expression.end());
  same.axis_angle.assign(pose.axis_angle.begin(), pose.axis_angle.end());
  std::copy(pose.transl.begin(), pose.transl.end(), same.transl.begin());
  const SmplxResult real = reference_smplx(arrays, pose);
  const SmplxResultOf<Complex> complex = reference_smplx(arrays, same);
  for (std::size_t i = 0; i < real.vertices.size(); ++i)
    CHECK(std::abs(complex.vertices[i] - real.vertices[i]) < 1e-13);
}

TEST_CASE("gradients of every parameter agree with complex step, in double to rounding, and float with double") {
  const SmplxArrays arrays = random_smplx({.vertices = 30, .seed = 42});
  const SmplxModel model = decode_smplx(smplx_writer(arrays).encode(), "body.npz");
  for (const Form form : {Form::kAxisAngle, Form::kSixD, Form::kComponents}) {
    for (const Angles angles : kAllAngles) check_gradients(arrays, model, form, angles, 0, 43);
  }
}

TEST_CASE("gradients of the MakeHuman body agree with complex step") {
  std::string path;
  const std::optional<SmplxArrays> arrays = makehuman_arrays(path);
  if (!arrays) {
    WARN("skipped: " << path << " is not there");
    return;
  }
  const SmplxModel model = read_smplx(path);
  for (const Angles angles : kAllAngles) check_gradients(*arrays, model, Form::kAxisAngle, angles, 2, 44);
  for (const Form form : {Form::kSixD, Form::kComponents}) {
    check_gradients(*arrays, model, form, Angles::kRandom, 2, 45);
  }
}

}  // namespace smplx_gradient_test
