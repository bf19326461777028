#include "pipelines/input/pose_estimate.h"

#include <numbers>

#include <catch2/catch.hpp>

#include "body/pose.h"
#include "core/log.h"
#include "tests/support/temporary_folder.h"

namespace pose_estimate_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// A folder of six frames, and what is logged.
struct Here {
  TemporaryFolder folder;
  FrameSource frames = made();
  std::vector<std::string> told;
  LogSink sink = log_to([this](LogLevel, std::string_view message) { told.emplace_back(message); });

  FrameSource made() {
    for (int t = 0; t < 6; ++t) folder.write("frames/" + std::to_string(t) + ".png", "");
    return FrameSource("frames", {.video = 10});
  }
};

/// Frame k of the video has x = k.
Motion walk(Index first, Index count) {
  Motion motion;
  motion.frame_rate = 10;
  motion.first_frame = static_cast<double>(first);
  for (Index k = first; k < first + count; ++k) {
    motion.poses.push_back(rest_pose(kSmplxJoints));
    motion.poses.back().transl = {static_cast<double>(k), 0, 0};
  }
  return motion;
}

std::vector<double> places(const std::vector<BodyPose>& poses) {
  std::vector<double> x;
  for (const BodyPose& pose : poses) x.push_back(pose.transl[0]);
  return x;
}

}  // namespace

TEST_CASE("an estimate that begins later is put where it says") {
  Here here;
  CHECK(places(estimated_poses(walk(0, 6), "m.npz", here.frames)) == std::vector<double>{0, 1, 2, 3, 4, 5});
  CHECK(here.told.empty());
  CHECK(places(estimated_poses(walk(1, 5), "m.npz", here.frames)) == std::vector<double>{0, 1, 2, 3, 4, 5});
  REQUIRE(here.told.size() == 1);
  CHECK(here.told[0] ==
        "m.npz: begins with frame 1 of the video; the poses before it are a guess, its first step carried back");
  // The step is carried back by two frames at most.
  CHECK(places(estimated_poses(walk(4, 2), "m.npz", here.frames)) == std::vector<double>{2, 2, 2, 3, 4, 5});
  CHECK_THROWS_WITH(estimated_poses(walk(1, 3), "m.npz", here.frames),
                    Catch::StartsWith("m.npz: holds 4 poses, the video has 6 frames"));
}

TEST_CASE(
    "an estimate that begins after the clip's last frame is refused before poses are made for the time before it") {
  Here here;
  const std::string allowed = "; allowed: a motion that begins with the clip's last frame at the latest";
  CHECK(places(estimated_poses(walk(5, 2), "m.npz", here.frames)) == std::vector<double>{3, 3, 3, 3, 4, 5});
  CHECK_THROWS_WITH(estimated_poses(walk(6, 9), "m.npz", here.frames),
                    "m.npz: its poses are of frames 6 to 14 (0.6 to 1.4 s) of a video, the clip's frames are 0 to 5 (0 "
                    "to 0.5 s)" +
                        allowed);
  Motion fast = walk(11, 6);  // 20 a second: 0.55 s
  fast.frame_rate = 20;
  CHECK_THROWS_WITH(estimated_poses(fast, "m.npz", here.frames), Catch::StartsWith("m.npz: its poses are of frames"));
  Motion far = walk(10'000'000, 2);
  far.says_frame_rate = false;
  CHECK_THROWS_WITH(
      estimated_poses(far, "m.npz", here.frames),
      "m.npz: its poses are of frames 10000000 to 10000001 of a video, the clip's frames are 0 to 5" + allowed);
}

TEST_CASE("an estimate that begins between two frames needs a rate") {
  Here here;
  Motion motion = walk(0, 6);  // as many as frames, which are not those
  motion.first_frame = 2.5;
  motion.says_frame_rate = false;
  CHECK_THROWS_WITH(estimated_poses(motion, "m.npz", here.frames),
                    Catch::StartsWith("m.npz: begins with frame 2.5 of the video; between two frames"));
}

TEST_CASE("an estimate of another rate that begins later is put there too") {
  Here here;
  Motion fast = walk(2, 9);  // 20 a second: frame 2 is that of 0.1 s, frame 10 that of 0.5 s
  fast.frame_rate = 20;
  CHECK(places(estimated_poses(fast, "m.npz", here.frames)) == std::vector<double>{0, 2, 4, 6, 8, 10});
  fast.first_frame = 2.5;
  fast.poses.push_back(fast.poses.back());
  CHECK(places(estimated_poses(fast, "m.npz", here.frames))[1] == Approx(1.5));
}

TEST_CASE("as many poses as frames are taken one a frame, and another rate is told") {
  Here here;
  Motion motion = walk(0, 6);
  motion.frame_rate = 30;
  const std::vector<double> all = {0, 1, 2, 3, 4, 5};
  CHECK(places(estimated_poses(motion, "m.npz", here.frames)) == all);
  CHECK(here.told == std::vector<std::string>{
                         "m.npz: its poses, 30 a second as it says, are taken one a frame, of which there are 10 a "
                         "second, as they are as many"});
  here.told.clear();
  motion.says_frame_rate = false;
  CHECK(places(estimated_poses(motion, "m.npz", here.frames)) == all);
  CHECK(here.told.empty());
}

TEST_CASE("as many poses as kept frames have the rate of these") {
  Here here;
  const FrameSource kept("frames", {.video = 10, .kept = 5});
  Motion motion = walk(0, 3);
  motion.frame_rate = 5;
  CHECK(places(estimated_poses(motion, "m.npz", kept)) == std::vector<double>{0, 1, 2});
  CHECK(here.told.empty());
  motion.frame_rate = 10;
  CHECK(places(estimated_poses(motion, "m.npz", kept)) == std::vector<double>{0, 1, 2});
  CHECK(here.told == std::vector<std::string>{
                         "m.npz: its poses, 10 a second as it says, are taken one a frame, of which there are 5 a "
                         "second, as they are as many"});
  motion = walk(0, 6);
  CHECK(places(estimated_poses(motion, "m.npz", kept)) == std::vector<double>{0, 2, 4});
  CHECK(here.told.size() == 1);
}

TEST_CASE("which way is up in an estimate the human of frame 0 tells") {
  Here here;
  constexpr double kQuarter = std::numbers::pi / 2;
  BodyPose first = rest_pose(kSmplxJoints);
  first.set_rotation(0, Vector3<double>(kQuarter, 0, 0));  // stands, z up
  Avatar avatar;
  avatar.body = "somebody";
  avatar.joints.assign(3 * kSmplxJoints, 0.0);
  const auto read = [&](const Vector3<double>& root, MotionAlign align) {
    Motion motion = walk(0, 6);
    for (BodyPose& pose : motion.poses) {
      pose.set_rotation(0, root);
      pose.transl = {0, 1, 2};
    }
    write_motion("m.npz", motion);  // by AMASS's names
    return read_estimate("m.npz", avatar, here.frames, first, align);
  };
  CHECK(read({kQuarter, 0, 0}, MotionAlign::kHeading)[3].transl == Vector3<double>(0, 1, 2));
  CHECK(here.told.empty());
  const BodyPose turned = read({0, 0, 0}, MotionAlign::kHeading)[3];  // y up
  CHECK((turned.transl - Vector3<double>(0, -2, 1)).norm() < 1e-12);
  CHECK((turned.rotation_of(0) - Vector3<double>(kQuarter, 0, 0)).norm() < 1e-12);
  REQUIRE(here.told.size() == 1);
  CHECK(here.told[0] == "m.npz: y is up, as the body is in frame 0: turned to z up");
  CHECK_THROWS_WITH(read({std::numbers::pi, 0, 0}, MotionAlign::kHeading),
                    Catch::StartsWith("m.npz: y points down, by how the body is in frame 0"));
  CHECK(read({std::numbers::pi, 0, 0}, MotionAlign::kRotation).size() == 6);
  read({0, 0, kQuarter}, MotionAlign::kNone);
  CHECK(here.told.back() == "m.npz: no axis is up as the body is in frame 0; z is taken for up, which may be wrong");
}

}  // namespace pose_estimate_test
