#include "pipelines/input/joint_fit.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/angles.h"
#include "core/check.h"
#include "core/random.h"
#include "tests/support/small_clip.h"

namespace joint_fit_test {

using namespace hsi4d;

namespace {

Vector3<double> some_vector(RandomSequence& random, double size) {
  return size * Vector3<double>(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
}

/// A leaf of 0.6 × 0.9 m about its centroid.
Gaussians leaf() {
  Gaussians g = test::random_gaussians(200, {0, 0, 0}, 0.3, -3, 5);
  Vector3<double> sum = Vector3<double>::Zero();
  for (std::size_t i = 0; i < g.means.size(); ++i) {
    if (i % 3 == 0) g.means[i] *= 0.05F;
    if (i % 3 == 2) g.means[i] *= 1.5F;
    sum[static_cast<Index>(i % 3)] += static_cast<double>(g.means[i]) / 200;
  }
  for (std::size_t i = 0; i < g.means.size(); ++i) g.means[i] -= static_cast<float>(sum[static_cast<Index>(i % 3)]);
  return g;
}

ObjectJoint door(JointType type) {
  ObjectJoint joint = object_joint({type, "", {0.05, -0.03, 1}, {1, 0.5, 0.9}, {}}, {});
  joint.rest = {so3_exp(Vector3<double>(0.1, 0.2, 0.7)), {1.25, 0.3, 0.8}};
  return joint;
}

/// @param noise  of places, metres, and turns, radians, but of frame 0
std::vector<Rigid<double>> poses_of(const ObjectJoint& joint, double noise) {
  RandomSequence random(7);
  std::vector<Rigid<double>> poses;
  for (int t = 0; t < 20; ++t) {
    Rigid<double> pose = on_joint(joint, 0.04 * t);
    if (t > 0) {
      pose.rotation = so3_exp(some_vector(random, noise)) * pose.rotation;
      pose.translation += some_vector(random, noise);
    }
    poses.push_back(pose);
  }
  return poses;
}

/// Between the axes of hinges, where they are nearest to a place: metres.
double distance(const ObjectJoint& a, const ObjectJoint& b) {
  const Vector3<double> way = a.origin - b.origin;
  return (way - b.axis * b.axis.dot(way)).norm();
}

/// Σ |J(q) P₀ x − P x|² over all centres and frames, plainly, with the best q of a fine search.
double plain_cost(const ObjectJoint& joint, const std::vector<Rigid<double>>& poses, const Gaussians& object) {
  double sum = 0;
  for (std::size_t t = 0; t < poses.size(); ++t) {
    double least = 1e9;
    for (double q = 0.04 * static_cast<double>(t) - 0.1; q < 0.04 * static_cast<double>(t) + 0.1; q += 1e-3) {
      const Rigid<double> on = on_joint(joint, q);
      double cost = 0;
      for (Index i = 0; i < object.count(); ++i) {
        const Vector3<double> x = Vector3<float>(object.means.data() + 3 * i).cast<double>();
        cost += (transform_point(on, x) - transform_point(poses[t], x)).squaredNorm();
      }
      least = std::min(least, cost);
    }
    sum += least;
  }
  return sum;
}

}  // namespace

TEST_CASE("exact poses give back the joint that made them") {
  const Gaussians object = leaf();
  for (const JointType type : {JointType::kHinge, JointType::kSlide}) {
    const ObjectJoint truth = door(type);
    const JointFit found = fit_joint(type, poses_of(truth, 0), object);
    CHECK((found.joint.axis - truth.axis).norm() < 1e-8);
    if (type == JointType::kHinge) CHECK(distance(found.joint, truth) < 1e-8);
    for (std::size_t t = 0; t < found.values.size(); ++t) {
      CHECK(found.values[t] == Approx(0.04 * static_cast<double>(t)).margin(1e-8));
      CHECK(found.distances[t] < 1e-8);
    }
    const Vector3<double> arm = found.joint.rest.translation - found.joint.origin;
    if (type == JointType::kHinge) CHECK(std::abs(arm.dot(found.joint.axis)) < 1e-12);
  }
}

TEST_CASE("of disturbed poses the joint is the one with the least squares") {
  const Gaussians object = leaf();
  const ObjectJoint truth = door(JointType::kHinge);
  const std::vector<Rigid<double>> poses = poses_of(truth, 0.02);
  const JointFit found = fit_joint(JointType::kHinge, poses, object);
  CHECK(std::acos(found.joint.axis.dot(truth.axis)) < 3 * kDegree);
  CHECK(distance(found.joint, truth) < 0.03);
  const double cost = plain_cost(found.joint, poses, object);
  double sum = 0;
  for (const double d : found.distances) sum += d * d * static_cast<double>(object.count());
  CHECK(sum == Approx(cost).epsilon(1e-3));  // the search has steps of a thousandth
  CHECK(cost < plain_cost(truth, poses, object));
  RandomSequence random(9);
  for (int i = 0; i < 6; ++i) {
    ObjectJoint other = found.joint;
    other.axis = (other.axis + some_vector(random, 0.02)).normalized();
    other.origin += some_vector(random, 0.01);
    CHECK(plain_cost(other, poses, object) > cost);
  }
}

TEST_CASE("a hinge that turns by little is found in poses that are off") {
  const Gaussians object = leaf();
  const ObjectJoint truth = door(JointType::kHinge);
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    RandomSequence random(seed);
    std::vector<Rigid<double>> poses;
    for (int t = 0; t < 8; ++t) {
      Rigid<double> pose = on_joint(truth, t * 8 * kDegree / 7);
      if (t > 0) pose.rotation = so3_exp(some_vector(random, 0.004)) * pose.rotation;
      if (t > 0) pose.translation += some_vector(random, 0.002);
      poses.push_back(pose);
    }
    const JointFit found = fit_joint(JointType::kHinge, poses, object);
    INFO("seed " << seed);
    for (const double distance : found.distances) CHECK(distance < 0.006);
  }
}

TEST_CASE("an object that hardly moves tells no joint") {
  const Gaussians object = leaf();
  std::vector<Rigid<double>> poses(3, door(JointType::kHinge).rest);
  poses[2].rotation = so3_exp(Vector3<double>(0, 0, 2 * kDegree)) * poses[2].rotation;
  poses[1].translation[0] += 0.004;
  CHECK_THROWS_WITH(fit_joint(JointType::kHinge, poses, object),
                    "the object turns by less than 5 degrees, which tells no axis");
  CHECK_THROWS_WITH(fit_joint(JointType::kSlide, poses, object),
                    "the object moves by less than 20 mm, which tells no axis");
}

}  // namespace joint_fit_test
