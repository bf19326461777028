#include "pipelines/run_results.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/rotation.h"
#include "core/video.h"
#include "tests/pipelines/tiny_run.h"

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("a camera turned about a pivot sees it at the same place, from another side") {
  const Rigid<double> camera = look_at({3, -2, 1.5}, {0.2, 0.1, 0.9});
  const Vector3<double> pivot(0.3, -0.1, 1);
  const Rigid<double> turned = turned_camera(camera, pivot, std::numbers::pi / 2);
  CHECK((transform_point(turned, pivot) - transform_point(camera, pivot)).norm() < 1e-12);
  const auto center = [](const Rigid<double>& c) -> Vector3<double> {
    return -(c.rotation.transpose() * c.translation);
  };
  const Vector3<double> before = center(camera) - pivot, after = center(turned) - pivot;
  CHECK((after - Vector3<double>(-before[1], before[0], before[2])).norm() < 1e-12);  // counter-clockwise from above
  CHECK((turned.rotation * Vector3<double>(0, 0, 1) - camera.rotation * Vector3<double>(0, 0, 1)).norm() < 1e-12);
}

TEST_CASE("a run leaves its result in forms that other programs take", "[run]") {
  const TemporaryFolder here;
  carry_out_tiny(tiny_config(), "run");
  const RunPaths paths{"run"};
  const Motion motion = read_motion(paths.motion()), dense = read_motion(paths.motion_at_30());
  CHECK(dense.frame_rate == 30);
  REQUIRE(dense.poses.size() == 3 * (motion.poses.size() - 1) + 1);
  for (std::size_t t = 0; t < motion.poses.size(); ++t)
    CHECK((dense.poses[3 * t].transl - motion.poses[t].transl).norm() < 1e-12);
  VideoReader preview(paths.preview());
  CHECK(preview.frames() == kTinyFrames);
  CHECK(preview.frame_rate() == 10);
  const Image frame = preview.read(2);
  CHECK(frame.width() == 4 * kTinyPixels);
  CHECK(frame.height() == kTinyPixels);
  CHECK(std::filesystem::exists(paths.body()));
  CHECK(read_text_file("run/log.txt").find("not written") == std::string::npos);
}

TEST_CASE("the body of another avatar is not written, and the log says so", "[run]") {
  const TemporaryFolder here;
  RunConfig config = tiny_config();
  config.body.shape = {8};  // much taller
  carry_out_tiny(config, "run");
  CHECK_FALSE(std::filesystem::exists(RunPaths{"run"}.body()));
  CHECK(read_text_file("run/log.txt").find("body.glb is not written: joints of the avatar are ") != std::string::npos);
}
