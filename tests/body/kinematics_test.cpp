#include "body/kinematics.h"

#include <cmath>

#include <Eigen/Geometry>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "autodiff/rotations.h"
#include "body/skinning.h"
#include "core/random.h"
#include "core/rotation.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/measures.h"
#include "tests/support/operator_check.h"

namespace kinematics_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

struct Skeleton {
  std::vector<int> parents;
  Numbers rest;
};

/// A chain of `joints` bones of 10 to 40 cm, or a random tree; rest joints as floats have them.
Skeleton random_skeleton(Index joints, bool chain, RandomSequence& random) {
  Skeleton s;
  for (Index j = 0; j < joints; ++j) {
    const Index q = j == 0 ? -1 : chain ? j - 1 : static_cast<Index>(random.below(static_cast<std::uint64_t>(j)));
    s.parents.push_back(static_cast<int>(q));
    for (Index i = 0; i < 3; ++i) {
      const double from = q < 0 ? 0 : s.rest[static_cast<std::size_t>(3 * q + i)];
      s.rest.push_back(static_cast<float>(from + random.uniform(-0.25, 0.25)));
    }
  }
  return s;
}

BodyPose random_pose(Index joints, double size, RandomSequence& random) {
  BodyPose pose = rest_pose(joints);
  for (double& x : pose.axis_angle) x = size * random.normal();
  pose.transl = {random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2)};
  return pose;
}

Matrix4<double> homogeneous(const Matrix3<double>& r, const Vector3<double>& t) {
  Matrix4<double> m = Matrix4<double>::Identity();
  m.topLeftCorner<3, 3>() = r;
  m.topRightCorner<3, 1>() = t;
  return m;
}

/// World transform of a joint, by recursion and products of 4×4 matrices: T(r_root) L T(-r_root) … : each joint turns
/// everything below it about its own rest position.
Matrix4<double> slow_transform(const Skeleton& s, const BodyPose& pose, Index joint) {
  const Vector3<double> r(s.rest.data() + 3 * joint);
  const Matrix3<double> none = Matrix3<double>::Identity();
  const Eigen::AngleAxisd turn = [&] {
    const Vector3<double> w = pose.rotation_of(joint);
    return w.norm() == 0 ? Eigen::AngleAxisd(0, Vector3<double>::UnitX()) : Eigen::AngleAxisd(w.norm(), w.normalized());
  }();
  const Matrix4<double> own =
      homogeneous(none, r) * homogeneous(turn.toRotationMatrix(), Vector3<double>::Zero()) * homogeneous(none, -r);
  const int parent = s.parents[static_cast<std::size_t>(joint)];
  return parent < 0 ? Matrix4<double>(homogeneous(none, pose.transl) * own)
                    : Matrix4<double>(slow_transform(s, pose, parent) * own);
}

template <class S>
struct Taped {
  Tape<S> tape;
  Var<S> axis_angle, transl;
  PosedSkeleton<S> posed;

  Taped(const Skeleton& s, const BodyPose& pose) {
    const Index joints = static_cast<Index>(s.parents.size());
    axis_angle = tape.parameter("axis_angle", shape_of(joints, 3));
    transl = tape.parameter("transl", shape_of(1, 3));
    posed = kinematic_chain(rotations_from_axis_angle(axis_angle), transl, s.parents, s.rest);
    tape.set(axis_angle, std::vector<S>(pose.axis_angle.begin(), pose.axis_angle.end()));
    tape.set(transl, {static_cast<S>(pose.transl[0]), static_cast<S>(pose.transl[1]), static_cast<S>(pose.transl[2])});
    tape.forward(posed.transforms);
    tape.forward(posed.joints);
  }
};

template <class S>
Numbers numbers_of(const ConstArray<S>& array) {
  return {array.data, array.data + array.shape.count()};
}

}  // namespace

TEST_CASE("the kinematic chain of several frames passes the operator checks", "[parallel]") {
  RandomSequence random(61);
  const Skeleton s = random_skeleton(6, false, random);
  const std::vector<OperatorInput> inputs = {
      {"rotations", shape_of(9 * 6, 9)}, {"transl", shape_of(9, 3)}, {"rest", shape_of(6, 3)}};
  check_operator("frames", inputs, [&](const auto& in) {
    const auto posed = kinematic_chain(in[0], in[1], s.parents, s.rest);
    return transform_points(posed.transforms, posed.joints) + 0.0 * sum(in[2]);
  });
  check_operator("frames and rest joints", inputs, [&](const auto& in) {
    const auto posed = kinematic_chain(in[0], in[1], s.parents, in[2]);
    return transform_points(posed.transforms, posed.joints);
  });
}

TEST_CASE("frames of a kinematic chain are the same bits as each alone") {
  RandomSequence random(62);
  constexpr Index kFrames = 7, kJoints = 11;
  const Skeleton s = random_skeleton(kJoints, false, random);
  Tape<float> tape;
  const auto rotations = tape.parameter("rotations", shape_of(kFrames * kJoints, 9));
  const auto transl = tape.parameter("transl", shape_of(kFrames, 3));
  for (const auto& leaf : {rotations, transl}) {
    const auto array = tape.write(leaf);
    for (Index i = 0; i < array.shape.count(); ++i) array.data[i] = static_cast<float>(random.normal());
  }
  const auto all = kinematic_chain(rotations, transl, s.parents, s.rest);
  tape.forward(all.joints);
  for (Index t = 0; t < kFrames; ++t) {
    const auto one =
        kinematic_chain(slice_rows(rotations, t * kJoints, kJoints), slice_rows(transl, t, 1), s.parents, s.rest);
    tape.forward(one.joints);
    for (Index j = 0; j < kJoints; ++j) {
      for (Index c = 0; c < 12; ++c)
        CHECK(tape.value(one.transforms)(j, c) == tape.value(all.transforms)(t * kJoints + j, c));
      for (Index c = 0; c < 3; ++c) CHECK(tape.value(one.joints)(j, c) == tape.value(all.joints)(t * kJoints + j, c));
    }
  }
}

TEST_CASE("the kinematic chain passes the operator checks, for each output and both") {
  RandomSequence random(60);
  for (const bool chain : {false, true}) {
    const Skeleton s = random_skeleton(7, chain, random);
    const std::vector<OperatorInput> inputs = {{"rotations", shape_of(7, 9)}, {"transl", shape_of(1, 3)}};
    check_operator("transforms", inputs,
                   [&](const auto& in) { return kinematic_chain(in[0], in[1], s.parents, s.rest).transforms; });
    check_operator("joints", inputs,
                   [&](const auto& in) { return kinematic_chain(in[0], in[1], s.parents, s.rest).joints; });
    check_operator("both", inputs, [&](const auto& in) {
      const auto posed = kinematic_chain(in[0], in[1], s.parents, s.rest);
      return transform_points(posed.transforms, posed.joints);
    });
  }
  for (const bool chain : {false, true}) {
    const Skeleton s = random_skeleton(7, chain, random);
    const std::vector<OperatorInput> inputs = {
        {"rotations", shape_of(7, 9)}, {"transl", shape_of(1, 3)}, {"rest_joints", shape_of(7, 3)}};
    const auto posed = [&](const auto& in) { return kinematic_chain(in[0], in[1], s.parents, in[2]); };
    check_operator("transforms, rest joints move", inputs, [&](const auto& in) { return posed(in).transforms; });
    check_operator("joints, rest joints move", inputs, [&](const auto& in) { return posed(in).joints; });
    check_operator("both, rest joints move", inputs, [&](const auto& in) {
      const auto both = posed(in);
      return transform_points(both.transforms, both.joints);
    });
  }
  const std::vector<OperatorInput> root = {{"rotations", shape_of(1, 9)}, {"transl", shape_of(1, 3)}};
  check_operator("a single joint", root, [](const auto& in) {
    return kinematic_chain(in[0], in[1], {-1}, {0.25, 0.5, -0.125}).transforms;
  });
}

TEST_CASE("the kinematic chain agrees with products of 4x4 matrices") {
  RandomSequence random(61);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Skeleton s = random_skeleton(20, repeat % 2 == 0, random);
    const BodyPose pose = random_pose(20, 1, random);
    Numbers transforms, joints;
    for (Index j = 0; j < 20; ++j) {
      const Matrix4<double> m = slow_transform(s, pose, j);
      for (int i = 0; i < 12; ++i) transforms.push_back(m(i / 4, i % 4));
      for (int i = 0; i < 3; ++i) {
        joints.push_back((m * Vector3<double>(s.rest.data() + 3 * j).homogeneous())[i]);
      }
    }
    const Taped<double> taped(s, pose);
    CHECK(largest_difference(numbers_of(taped.tape.value(taped.posed.transforms)), transforms) < 1e-14);
    CHECK(largest_difference(numbers_of(taped.tape.value(taped.posed.joints)), joints) < 1e-14);
    const PosedJoints untaped = pose_skeleton(s.parents, s.rest, pose);
    CHECK(untaped.transforms == numbers_of(taped.tape.value(taped.posed.transforms)));
    CHECK(untaped.joints == numbers_of(taped.tape.value(taped.posed.joints)));
    CHECK(pose_joints(s.parents, s.rest, pose) == untaped.joints);
  }
}

TEST_CASE("without rotation the chain is a translation, with the root's alone a rigid motion about the pelvis") {
  RandomSequence random(62);
  const Skeleton s = random_skeleton(10, false, random);
  BodyPose pose = rest_pose(10);
  pose.transl = {1, 2, 3};
  const PosedJoints moved = pose_skeleton(s.parents, s.rest, pose);
  for (std::size_t i = 0; i < 30; ++i) {
    CHECK(moved.joints[i] == Approx(s.rest[i] + pose.transl[static_cast<Index>(i % 3)]).margin(1e-15));
  }
  pose.set_rotation(0, {0.3, -1, 0.7});
  const PosedJoints turned = pose_skeleton(s.parents, s.rest, pose);
  const Matrix3<double> r = so3_exp(Vector3<double>(0.3, -1, 0.7));
  const Vector3<double> pelvis(s.rest.data());
  for (Index j = 0; j < 10; ++j) {
    const Vector3<double> expected = r * (Vector3<double>(s.rest.data() + 3 * j) - pelvis) + pelvis + pose.transl;
    CHECK((Vector3<double>(turned.joints.data() + 3 * j) - expected).norm() < 1e-15);
  }
}

TEST_CASE("a translation of the root translates everything, also far away") {
  RandomSequence random(63);
  const Skeleton s = random_skeleton(12, true, random);
  const BodyPose here = random_pose(12, 1, random);
  BodyPose there = here;
  there.transl += Vector3<double>(1024, -2048, 512);
  const Taped<float> near(s, here), far(s, there);
  const Numbers a = numbers_of(near.tape.value(near.posed.transforms));
  const Numbers b = numbers_of(far.tape.value(far.posed.transforms));
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (i % 4 != 3) CHECK(a[i] == b[i]);  // rotations: not one bit
    if (i % 4 == 3) CHECK(std::fabs(b[i] - a[i] - Vector3<double>(1024, -2048, 512)[i % 12 / 4]) < 2.5e-4);
  }
}

TEST_CASE("C12: a chain of ten joints stays orthonormal in float and its points near those of double") {
  RandomSequence random(64);
  double orthogonality = 0, distance = 0;
  for (int repeat = 0; repeat < 200; ++repeat) {
    const Skeleton s = random_skeleton(10, true, random);
    BodyPose pose = random_pose(10, 1, random);
    for (double& x : pose.axis_angle) x = static_cast<float>(x);
    for (double& x : pose.transl) x = static_cast<float>(x);
    const Taped<float> fast(s, pose);
    const Taped<double> exact(s, pose);
    const auto a = fast.tape.value(fast.posed.transforms);
    const auto b = exact.tape.value(exact.posed.transforms);
    for (Index j = 0; j < 10; ++j) {
      Eigen::Matrix<double, 3, 4> x, y;
      for (int i = 0; i < 12; ++i) x(i / 4, i % 4) = a(j, i), y(i / 4, i % 4) = b(j, i);
      const Matrix3<double> r = x.leftCols<3>();
      orthogonality = larger(orthogonality, (r * r.transpose() - Matrix3<double>::Identity()).cwiseAbs().maxCoeff());
      const Vector3<double> point = Vector3<double>(s.rest.data() + 3 * j) + Vector3<double>(0.1, -0.1, 0.1);
      distance = larger(distance, ((x - y) * point.homogeneous()).norm());
    }
  }
  INFO("orthogonality " << orthogonality / std::numeric_limits<float>::epsilon() << " eps, points " << distance);
  CHECK(orthogonality <= 20 * static_cast<double>(std::numeric_limits<float>::epsilon()));
  CHECK(distance < 1e-5);
}

TEMPLATE_TEST_CASE("a steady iteration of the kinematic chain allocates nothing", "", float, double) {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  RandomSequence random(65);
  const Skeleton s = random_skeleton(20, false, random);
  Tape<TestType> tape;
  const auto w = tape.parameter("w", shape_of(20, 3));
  const auto x = tape.parameter("x", shape_of(20, 6));
  const auto t = tape.parameter("t", shape_of(1, 3));
  const auto one = kinematic_chain(rotations_from_axis_angle(w), t, s.parents, s.rest);
  const auto two = kinematic_chain(rotations_from_6d(x), t, s.parents, s.rest);
  const auto loss = sum(square(one.transforms)) + sum(square(two.joints));
  CHECK(steady_allocations([&] {
          for (int i = 0; i < 20; ++i) {
            tape.write(w).data[i] += TestType(0.25);
            tape.forward(loss);
            tape.backward(loss);
          }
        }) == 0);
}

TEST_CASE("skeletons that are no tree, and other sizes, are refused") {
  CHECK(tree_fault(smplx_parents()).empty());
  CHECK(tree_fault({}) == "there are no joints");
  CHECK(tree_fault(std::vector{0}) == "the parent of joint 0 is 0; allowed: -1, the root");
  CHECK(tree_fault(std::vector{-1, 0, 2}) ==
        "the parent of joint 2 is 2; allowed: 0 to 1, a joint that comes before it");
  CHECK(tree_fault(std::vector{-1, -1}) ==
        "the parent of joint 1 is -1; allowed: 0 to 0, a joint that comes before it");
  Tape<double> tape;
  const auto r = tape.parameter("r", shape_of(2, 9));
  const auto t = tape.parameter("t", shape_of(1, 3));
  CHECK_THROWS_AS(kinematic_chain(r, t, {-1, 1}, Numbers(6)), InternalError);
  CHECK_THROWS_AS(kinematic_chain(r, t, {-1, 0}, Numbers(5)), InternalError);
  CHECK_THROWS_WITH(kinematic_chain(r, t, {-1, 0, 0}, Numbers(9)), Catch::Contains("[2,9] against [3,9]"));
  CHECK_THROWS_AS(kinematic_chain(r, r, {-1, 0}, Numbers(6)), InternalError);
  CHECK_THROWS_AS(pose_joints(std::vector{-1, 0}, Numbers(6), rest_pose(3)), InternalError);
}

}  // namespace kinematics_test
