#include "pipelines/report/view3d.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/quaternion.h"
#include "core/rotation.h"
#include "tests/support/measures.h"
#include "tests/support/small_clip.h"
#include "tests/support/temporary_folder.h"

namespace view3d_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// Two frames: the given one, and one in which everything has moved.
std::vector<SceneState> two_states(const Clip& clip) {
  SceneState later = clip.first;
  later.body = bent_pose(77);
  later.objects[1] = {{0.4, -1.2, 0.3}, {0.1, 0.2, 1.5}};
  later.camera_from_world = look_at({0.6, -3.2, 1.4}, {0, 0.1, 0.9});
  return {clip.first, later};
}

Matrix3<double> rotation_of(const std::vector<float>& numbers, std::size_t at) {
  return quaternion_to_matrix(Vector4<double>(Vector4<float>(numbers.data() + at).cast<double>()));
}

/// The joints' transforms [J,12] of a frame, by the formula of the header, as a viewer has them.
std::vector<double> transforms_of(const Safetensors& file, const std::string& name, std::size_t frame) {
  const auto rest = file.array("skeleton/joints").as<double>();
  const auto parents = file.array("skeleton/parents").as<int>();
  const auto rotations = file.array(name + "/rotations").as<double>();
  const auto moves = file.array(name + "/translations").as<double>();
  std::vector<Matrix3<double>> turns;
  std::vector<Vector3<double>> places;
  std::vector<double> transforms;
  for (std::size_t j = 0; j < parents.size(); ++j) {
    const auto q = static_cast<std::size_t>(std::max(parents[j], 0));
    const Vector3<double> r(rest.data() + 3 * j), of_parent(rest.data() + 3 * q);
    turns.push_back(quaternion_to_matrix(Vector4<double>(rotations.data() + 4 * (parents.size() * frame + j))));
    places.push_back(parents[j] < 0 ? r : Vector3<double>(places[q] + turns[q] * (r - of_parent)));
    const Vector3<double> shift = places[j] - turns[j] * r + Vector3<double>(moves.data() + 3 * frame);
    for (Index row = 0; row < 3; ++row) {
      for (Index column = 0; column < 3; ++column) transforms.push_back(turns[j](row, column));
      transforms.push_back(shift[row]);
    }
  }
  return transforms;
}

}  // namespace

TEST_CASE("the file of the 3D view has the motion of camera, objects and body") {
  const Clip clip = small_clip(64, 48, 30);
  const std::vector<SceneState> states = two_states(clip);
  const Safetensors file = Safetensors::decode(view3d_file(clip, states, nullptr).encode(), "view");
  CHECK(file.require_format(kView3dFormat, kView3dVersion) == 1);
  CHECK(file.texts("objects") == std::vector<std::string>{"box", "ball"});
  CHECK(file.text("frame_rate") == "10");
  CHECK(file.array("splats/counts").as<int>() == std::vector<int>{30, 8, 6});
  CHECK(file.array("splats/positions").shape() == std::vector<std::int64_t>{44, 3});
  CHECK_FALSE(file.has("mesh/faces"));
  CHECK_FALSE(file.has("truth/rotations"));

  const auto objects = file.array("objects/poses").require_shape({2, 2, 7}).as<float>();
  const auto cameras = file.array("cameras/poses").require_shape({2, 7}).as<float>();
  for (std::size_t t = 0; t < 2; ++t) {
    const Rigid<double>& camera = states[t].camera_from_world;
    CHECK((rotation_of(cameras, 7 * t) - camera.rotation).cwiseAbs().maxCoeff() < 1e-6);
    for (std::size_t o = 0; o < 2; ++o) {
      const std::size_t at = 7 * (2 * t + o);
      CHECK((rotation_of(objects, at) - so3_exp(states[t].objects[o].rotation)).cwiseAbs().maxCoeff() < 1e-6);
      for (std::size_t a = 0; a < 3; ++a)
        CHECK(objects[at + 4 + a] == Approx(states[t].objects[o].translation[static_cast<Index>(a)]));
    }
    CHECK(largest_difference(transforms_of(file, "body", t), pose_skeleton(clip.avatar, states[t].body).transforms) <
          2e-4);
  }
  const auto intrinsics = file.array("cameras/intrinsics").as<float>();
  CHECK(intrinsics[0] == 64);
  CHECK(intrinsics[2] == Approx(clip.camera.fx));
}

TEST_CASE("the file of the 3D view has the people beside the first one, each with its own skeleton") {
  Clip clip = small_clip(64, 48, 30);
  std::vector<SceneState> states = two_states(clip);
  CHECK_FALSE(Safetensors::decode(view3d_file(clip, states, nullptr).encode(), "view").has("others/1/joints"));
  clip.others.emplace_back().avatar = clip.avatar;
  for (double& place : clip.others[0].avatar.joints) place *= 1.25;
  for (std::size_t t = 0; t < 2; ++t) {
    states[t].others = {states[1 - t].body};
    states[t].others[0].transl[0] += 0.5;
  }
  const Safetensors file = Safetensors::decode(view3d_file(clip, states, nullptr).encode(), "view");
  const auto joints = file.array("others/1/joints").as<float>();
  CHECK(joints[5] == Approx(clip.others[0].avatar.joints[5]));
  const auto places = file.array("others/1/translations").require_shape({2, 3}).as<float>();
  CHECK(places[0] == Approx(states[0].others[0].transl[0]));
  CHECK(file.array("others/1/rotations").shape() == std::vector<std::int64_t>{2, kSmplxJoints, 4});
  CHECK_FALSE(file.has("others/2/joints"));
}

TEST_CASE("the file of the 3D view has the true body where it is known, and its mesh") {
  Clip clip = small_clip(64, 48, 30);
  const std::vector<SceneState> states = two_states(clip);
  clip.truth = std::vector<SceneState>{states[1], states[0]};
  const BodyModel body = procedural_body();
  const TemporaryFolder here;
  view3d_file(clip, states, &body).write("view.safetensors");
  const View3d view = read_view3d("view.safetensors");
  CHECK(view.frames == 2);
  CHECK(view.frame_rate == 10);
  CHECK(view.has_truth);
  const Safetensors file = Safetensors::decode(view.file, "view");
  CHECK(largest_difference(transforms_of(file, "truth", 0), pose_skeleton(clip.avatar, states[1].body).transforms) <
        2e-4);

  // The vertices as a viewer skins them are those of the body in its pose.
  const auto box = file.array("mesh/box").as<double>(), packed = file.array("mesh/positions").as<double>();
  const auto joints = file.array("mesh/joints").as<int>(), weights = file.array("mesh/weights").as<int>();
  CHECK(file.array("mesh/faces").as<std::int32_t>() == body.faces);
  const std::vector<double> transforms = transforms_of(file, "body", 1), expected = pose_vertices(body, states[1].body);
  REQUIRE(packed.size() == expected.size());
  double largest = 0, sum = 0;
  for (std::size_t v = 0; v < packed.size() / 3; ++v) {
    int share = 0;
    Vector3<double> place = Vector3<double>::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
      share += weights[4 * v + k];
      const double* const rows = transforms.data() + 12 * joints[4 * v + k];
      for (Index row = 0; row < 3; ++row) {
        double value = rows[4 * row + 3];
        for (std::size_t a = 0; a < 3; ++a)
          value += rows[4 * row + static_cast<Index>(a)] * (box[a] + packed[3 * v + a] / 65535 * (box[3 + a] - box[a]));
        place[row] += weights[4 * v + k] / 255.0 * value;
      }
    }
    if (share != 255) FAIL("the weights of vertex " << v << " sum to " << share);
    const double off = (place - Vector3<double>(expected.data() + 3 * v)).norm();
    largest = larger(largest, off);
    sum += off;
  }
  CHECK(largest < 1.5e-3);
  CHECK(3 * sum / static_cast<double>(packed.size()) < 2e-4);
}

TEST_CASE("a clip without objects or Gaussians has a 3D view") {
  Clip clip = small_clip(64, 48, 30, 0);
  clip.objects.clear();
  clip.first.objects.clear();
  const Safetensors file = Safetensors::decode(view3d_file(clip, {clip.first}, nullptr).encode(), "view");
  CHECK(file.array("splats/counts").as<int>() == std::vector<int>{0});
  CHECK(file.array("objects/poses").shape() == std::vector<std::int64_t>{1, 0, 7});
}

TEST_CASE("files that are no 3D view are refused") {
  const TemporaryFolder here;
  here.write("text", "no such file");
  CHECK_THROWS_WITH(read_view3d("text"), Contains("text: "));
  CHECK_THROWS_AS(read_view3d("nowhere"), UserError);
  SafetensorsWriter newer(kView3dFormat, kView3dVersion + 1);
  newer.write("newer");
  CHECK_THROWS_AS(read_view3d("newer"), DataError);
  SafetensorsWriter rateless(kView3dFormat, kView3dVersion);
  rateless.add("body/translations", {1, 3}, std::vector<float>{0, 0, 0});
  rateless.set_text("frame_rate", "-3");
  rateless.write("rateless");
  CHECK_THROWS_WITH(read_view3d("rateless"), "rateless: frame_rate is \"-3\", not a positive number");
}

}  // namespace view3d_test
