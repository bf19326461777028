#include "body/pose_layout.h"

#include <numeric>

#include <catch2/catch.hpp>

#include "body/body_model.h"
#include "core/check.h"

namespace pose_layout_test {

using namespace hsi4d;

namespace {

/// 1, 2, 3, … so that every number tells where it comes from.
std::vector<double> counted(Index joints) {
  std::vector<double> numbers(static_cast<std::size_t>(3 * joints));
  std::iota(numbers.begin(), numbers.end(), 1.0);
  return numbers;
}

double first_of(const BodyPose& pose, const char* joint) { return pose.rotation_of(smplx_joint(joint))[0]; }

}  // namespace

TEST_CASE("poses of SMPL-X, SMPL-H and SMPL stand at the joints of SMPL-X") {
  CHECK(smplx_pose(counted(55), "a").axis_angle == counted(55));
  const BodyPose hands = smplx_pose(counted(52), "a");
  CHECK(first_of(hands, "right_wrist") == 3 * 21 + 1);
  CHECK(first_of(hands, "jaw") == 0);
  CHECK(first_of(hands, "right_eye_smplhf") == 0);
  CHECK(first_of(hands, "left_index1") == 3 * 22 + 1);
  CHECK(first_of(hands, "right_thumb3") == 3 * 51 + 1);
  for (const Index joints : {22, 23, 24}) {
    const BodyPose body = smplx_pose(counted(joints), "a");
    CHECK(body.joints() == 55);
    CHECK(first_of(body, "pelvis") == 1);
    CHECK(first_of(body, "right_wrist") == 3 * 21 + 1);
    for (Index j = 22; j < 55; ++j) CHECK(body.rotation_of(j).norm() == 0);
  }
}

TEST_CASE("poses of other sizes are refused") {
  for (const std::size_t numbers :
       {std::size_t{0}, std::size_t{3}, std::size_t{63}, std::size_t{67}, std::size_t{75}}) {
    CHECK_THROWS_WITH(smplx_pose(std::vector<double>(numbers), "m.npz: array 'poses'"),
                      "m.npz: array 'poses': a pose of " + std::to_string(numbers) +
                          " numbers; allowed: 165 (SMPL-X), 156 (SMPL-H), 66, 69 or 72 (SMPL)");
  }
  CHECK_THROWS_AS(smplx_pose(std::vector<double>(3), "a"), DataError);
}

}  // namespace pose_layout_test
