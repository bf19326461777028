#include "pipelines/input/object_joint.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/angles.h"
#include "core/random.h"

namespace object_joint_test {

using namespace hsi4d;

namespace {

Vector3<double> some_vector(RandomSequence& random) {
  return {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
}

ObjectJoint some_joint(JointType type, RandomSequence& random) {
  const Vector3<double> axis = 3 * some_vector(random), origin = some_vector(random);
  JointSettings settings{type, "", {axis[0], axis[1], axis[2]}, {origin[0], origin[1], origin[2]}, {}};
  ObjectJoint joint = object_joint(settings, {});
  joint.rest = {so3_exp(some_vector(random)), some_vector(random)};
  return joint;
}

double difference(const Rigid<double>& a, const Rigid<double>& b) {
  return (a.rotation - b.rotation).norm() + (a.translation - b.translation).norm();
}

}  // namespace

TEST_CASE("a hinge turns about its axis and a slide moves along it, from where they rest") {
  RandomSequence random(1);
  for (int i = 0; i < 20; ++i) {
    const ObjectJoint hinge = some_joint(JointType::kHinge, random), slide = some_joint(JointType::kSlide, random);
    CHECK(hinge.axis.norm() == Approx(1));
    for (const ObjectJoint& joint : {hinge, slide}) CHECK(difference(on_joint(joint, 0), joint.rest) < 1e-14);
    // What is on the axis stays, and all else keeps its distance from it; turns add up.
    const auto moved = [&hinge](double q, const Vector3<double>& place) {
      return transform_point(compose(on_joint(hinge, q), inverse(hinge.rest)), place);
    };
    const double q = random.uniform(-3, 3);
    const Vector3<double> on_axis = hinge.origin + random.uniform(-2, 2) * hinge.axis, place = some_vector(random);
    CHECK((moved(q, on_axis) - on_axis).norm() < 1e-13);
    CHECK((moved(q, moved(0.4, place)) - moved(q + 0.4, place)).norm() < 1e-13);
    CHECK(hinge.axis.dot(moved(q, place) - place) == Approx(0).margin(1e-13));
    const Vector3<double> way = on_joint(slide, q).translation - slide.rest.translation;
    CHECK((way - q * slide.axis).norm() < 1e-14);
  }
  // By hand: a door of half a metre, hinged at (1, 0, 0), opened by a quarter of a turn.
  ObjectJoint door = object_joint({JointType::kHinge, "", {0, 0, 5}, {1, 0, 7}, {-0.1, 2}}, {});
  door.rest.translation = {1.5, 0, 1};
  const Rigid<double> open = on_joint(door, kPi / 2);
  CHECK((open.translation - Vector3<double>(1, 0.5, 1)).norm() < 1e-15);
  CHECK((open.rotation * Vector3<double>(1, 0, 0) - Vector3<double>(0, 1, 0)).norm() < 1e-15);
  CHECK(door.low == -0.1);
  CHECK(door.high == 2);
  CHECK(std::isinf(some_joint(JointType::kSlide, random).high));
}

TEST_CASE("the value of a pose on the joint is the one that made it, and of another the nearest one") {
  RandomSequence random(2);
  for (int i = 0; i < 20; ++i) {
    for (const JointType type : {JointType::kHinge, JointType::kSlide}) {
      const ObjectJoint joint = some_joint(type, random);
      const double q = random.uniform(-3.1, 3.1);
      CHECK(joint_value(joint, on_joint(joint, q)) == Approx(q).margin(1e-12));
      Rigid<double> pose = on_joint(joint, q);
      pose.rotation = so3_exp(Vector3<double>(0.3 * some_vector(random))) * pose.rotation;
      pose.translation += 0.3 * some_vector(random);
      const double found = joint_value(joint, pose);
      const auto distance = [&](double x) {
        const Rigid<double> on = on_joint(joint, x);
        return type == JointType::kHinge ? (on.rotation - pose.rotation).norm()
                                         : (on.translation - pose.translation).norm();
      };
      for (const double step : {-0.01, 0.01, -1.0, 1.0}) CHECK(distance(found) < distance(found + step));
    }
  }
}

TEST_CASE("a joint follows its parent") {
  RandomSequence random(3);
  ObjectJoint joint = some_joint(JointType::kHinge, random);
  const std::vector<ObjectPose> poses = {{some_vector(random), some_vector(random)},
                                         {some_vector(random), some_vector(random)}};
  CHECK(difference(parent_from_object(joint, poses, 1), rigid_of(poses[1])) < 1e-15);  // of the scene
  joint.parent = 0;
  const Rigid<double> relative = parent_from_object(joint, poses, 1);
  CHECK(difference(compose(rigid_of(poses[0]), relative), rigid_of(poses[1])) < 1e-14);
  const ObjectPose again = pose_of(rigid_of(poses[1]));
  CHECK((again.rotation - poses[1].rotation).norm() < 1e-13);
  CHECK(again.translation == poses[1].translation);
}

}  // namespace object_joint_test
