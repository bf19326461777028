#include "pipelines/draw/standing.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/procedural_body.h"
#include "core/rotation.h"
#include "pipelines/draw/posed_avatar.h"

namespace standing_test {

using namespace hsi4d;

TEST_CASE("a person stands on the ground, over the place, looking along the heading") {
  AvatarSettings settings;
  settings.gaussians = 1500;
  const Avatar avatar = surface_avatar(procedural_body(), settings);
  for (const double heading : {0.0, 90.0, -135.0}) {
    const BodyPose pose = standing_pose(avatar, {1.5, -2, heading, 0.25});
    const std::vector<double> joints = pose_joints(avatar, pose);
    CHECK(joints[0] == Approx(1.5));
    CHECK(joints[1] == Approx(-2));
    const PosedGaussians posed{rest_gaussians(avatar), blended_transforms(avatar, pose)};
    double lowest = 1e9, highest = -1e9;
    for (Index i = 0; i < avatar.count(); ++i) {
      const Vector3<double> mean = Vector3<float>(avatar.means.data() + 3 * i).cast<double>();
      const double* const row = posed.transforms.data() + 12 * i + 8;
      const double z = row[0] * mean[0] + row[1] * mean[1] + row[2] * mean[2] + row[3];
      lowest = std::min(lowest, z);
      highest = std::max(highest, z);
    }
    CHECK(lowest == Approx(0.25).margin(1e-9));
    CHECK(highest > 1.5);
    // From hip to hip is across the heading: the left one is to its left.
    const auto joint = [&](const char* name) {
      const auto at = static_cast<std::size_t>(3 * smplx_joint(name));
      return Vector3<double>(joints[at], joints[at + 1], joints[at + 2]);
    };
    const Vector3<double> left = (joint("left_hip") - joint("right_hip")).normalized();
    const double radians = heading * std::acos(-1.0) / 180;
    CHECK(left.dot(Vector3<double>(-std::sin(radians), std::cos(radians), 0)) > 0.99);
    // Toes point along it; hands hang below the elbows.
    const Vector3<double> toes = joint("left_foot") - joint("left_ankle");
    CHECK(toes.dot(Vector3<double>(std::cos(radians), std::sin(radians), 0)) > 0.7 * toes.norm());
    CHECK(joint("left_wrist")[2] < joint("left_elbow")[2] - 0.1);
    CHECK(joint("right_wrist")[2] < joint("right_elbow")[2] - 0.1);
  }
}

TEST_CASE("an object stands on the ground, turned about its centroid") {
  Gaussians object;
  object.means = {1, 0, -0.5F, -1, 0, 0.5F};
  object.quats = {1, 0, 0, 0, 1, 0, 0, 0};
  object.log_scales.assign(6, -3);
  object.opacity_logits = {1, 1};
  object.sh.assign(6, 0);
  const ObjectPose pose = standing_object(object, {3, 4, 90, 1});
  CHECK(pose.translation.isApprox(Vector3<double>(3, 4, 1.5), 1e-12));
  const Vector3<double> first = so3_exp(pose.rotation) * Vector3<double>(1, 0, -0.5) + pose.translation;
  CHECK(first.isApprox(Vector3<double>(3, 5, 1), 1e-12));
}

}  // namespace standing_test
