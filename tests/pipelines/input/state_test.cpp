#include "pipelines/input/state.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/npz.h"
#include "tests/support/small_clip.h"
#include "tests/support/temporary_folder.h"

namespace state_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;

namespace {

/// Frames in which every number is another one.
std::vector<SceneState> numbered_states(std::size_t frames, std::size_t objects) {
  std::vector<SceneState> states(frames);
  double x = 0.1;
  const auto three = [&x] {
    x += 1.0 / 3;
    return Vector3<double>(x, x + 100, x + 200);
  };
  for (SceneState& state : states) {
    state.body = rest_pose(kSmplxJoints);
    state.body.transl = three();
    state.camera_from_world.translation = three();
    for (std::size_t o = 0; o < objects; ++o) state.objects.push_back({three(), three()});
  }
  return states;
}

template <class F>
std::string data_error_of(F&& action) {
  try {
    action();
  } catch (const DataError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("tracks of objects survive being written and read bit for bit") {
  const TemporaryFolder here;
  const std::vector<SceneState> states = numbered_states(5, 2);
  write_object_tracks("objects.npz", {"box", "ball"}, states);
  const Npz file = Npz::read("objects.npz");
  const std::vector<double> rotation = file.array("ball/rotation").require_shape({5, 3}).as<double>();
  CHECK(rotation[3] == states[1].objects[1].rotation[0]);

  const auto read = read_object_tracks("objects.npz", {"ball", "box"});  // in the order that is asked for
  REQUIRE(read.size() == 5);
  for (std::size_t t = 0; t < 5; ++t) {
    REQUIRE(read[t].size() == 2);
    for (std::size_t o = 0; o < 2; ++o) {
      CHECK(read[t][o].rotation == states[t].objects[1 - o].rotation);
      CHECK(read[t][o].translation == states[t].objects[1 - o].translation);
    }
  }
  CHECK(read_object_tracks("objects.npz", {"box"})[4][0].translation == states[4].objects[0].translation);
}

TEST_CASE("tracks of objects that are missing or of another shape are told by file and array") {
  const TemporaryFolder here;
  write_object_tracks("objects.npz", {"box"}, numbered_states(3, 1));
  CHECK_THAT(data_error_of([] {
               read_object_tracks("objects.npz", {"box", "ball"});
             }),
             Contains("objects.npz") && Contains("ball/rotation"));
  NpzWriter writer;
  writer.add<double>("box/rotation", {2, 3}, std::vector<double>(6));
  writer.add<double>("box/translation", {3, 3}, std::vector<double>(9));
  writer.add<double>("ball/rotation", {2, 4}, std::vector<double>(8));
  writer.write("wrong.npz");
  CHECK_THAT(data_error_of([] { read_object_tracks("wrong.npz", {"box"}); }),
             Contains("wrong.npz") && Contains("box/translation") && Contains("[2,3] is needed"));
  CHECK_THAT(data_error_of([] { read_object_tracks("wrong.npz", {"ball"}); }),
             Contains("wrong.npz") && Contains("ball/rotation"));
}

TEST_CASE("bodies and cameras are those of the frames") {
  const std::vector<SceneState> states = numbered_states(3, 1);
  const Camera intrinsics{48, 36, 50, 51, 24.5, 17.5, {}};
  const std::vector<Camera> cameras = cameras_of(states, intrinsics);
  const std::vector<BodyPose> bodies = bodies_of(states);
  REQUIRE(cameras.size() == 3);
  REQUIRE(bodies.size() == 3);
  for (std::size_t t = 0; t < 3; ++t) {
    CHECK(cameras[t].camera_from_world.translation == states[t].camera_from_world.translation);
    CHECK(cameras[t].width == 48);
    CHECK(cameras[t].fy == 51);
    CHECK(cameras[t].cy == 17.5);
    CHECK(bodies[t].transl == states[t].body.transl);
  }
}

}  // namespace state_test
