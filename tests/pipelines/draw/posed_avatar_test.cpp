#include "pipelines/draw/posed_avatar.h"

#include <array>
#include <cmath>
#include <numeric>

#include <catch2/catch.hpp>

#include "body/motion_edit.h"
#include "body/procedural_body.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/npz.h"
#include "pipelines/cli/render_command.h"
#include "splat/files/io_ply.h"
#include "tests/support/measures.h"
#include "tests/support/program.h"

namespace posed_avatar_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Two bones along x: joint 0 at the origin, joint 1 at x = 1; a Gaussian on each and one that hangs on both.
Avatar two_bones() {
  Avatar a;
  a.means = {0.5F, 0, 0, 1.5F, 0, 0, 1, 0, 0.25F};
  a.quats = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  a.log_scales = {-2, -3, -3, -2, -3, -3, -2, -3, -3};
  a.opacity_logits = {1, 2, 3};
  a.colors = {0, 0.5F, 1, 0.25F, 0.5F, 0.75F, 1, 1, 1};
  a.weights = {3, 2, 2, {0, 1, 1, 0, 0, 1}, {1, 0, 1, 0, 0.5, 0.5}};
  a.parents = {-1, 0};
  a.joints = {0, 0, 0, 1, 0, 0};
  a.joint_names = {"root", "tip"};
  return a;
}

Vector3<double> mean_of(const PosedGaussians& posed, std::size_t n) {
  Vector3<double> result;
  for (int r = 0; r < 3; ++r) {
    const double* row = posed.transforms.data() + 12 * n + 4 * static_cast<std::size_t>(r);
    result[r] = row[3];
    for (std::size_t c = 0; c < 3; ++c) result[r] += row[c] * static_cast<double>(posed.gaussians.means[3 * n + c]);
  }
  return result;
}

}  // namespace

TEST_CASE("a posed avatar has the colours of its color net") {
  Avatar avatar = two_bones();
  for (float& color : avatar.colors) color = 0.2F + 0.6F * color;
  const auto colors_of = [](const PosedGaussians& posed) {
    std::vector<double> rgb;
    for (const float sh : posed.gaussians.sh) rgb.push_back(0.5 + static_cast<double>(sh) * 0.28209479177387814);
    return rgb;
  };
  const auto distance = [](const std::vector<double>& a, const std::vector<double>& b) {
    double most = 0;
    for (std::size_t i = 0; i < a.size(); ++i) most = larger(most, std::fabs(a[i] - b[i]));
    return most;
  };
  BodyPose bent = rest_pose(2);
  bent.set_rotation(1, {0, 0, 1});
  const std::vector<double> own = colors_of(posed_avatar(avatar, bent));
  avatar.color_net = new_color_net(avatar.means, 2, {4, 8, 1, false, 1});
  CHECK(distance(colors_of(posed_avatar(avatar, bent)), own) < 1e-6);  // a new one changes nothing
  for (std::size_t i = 0; i < 24; ++i) avatar.color_net->layers[1].weights[i] = 0.1 * static_cast<double>(i) - 1;
  const std::vector<double> rest = colors_of(posed_avatar(avatar, rest_pose(2)));
  CHECK(distance(rest, own) > 0.05);
  CHECK(distance(colors_of(posed_avatar(avatar, bent)), rest) > 0.01);  // they follow the pose
  avatar.color_net = new_color_net(avatar.means, 2, {4, 8, 1, true, 1});
  for (std::size_t i = 0; i < 24; ++i) avatar.color_net->layers[1].weights[i] = 0.1 * static_cast<double>(i) - 1;
  const Vector3<double> front(0, -3, 0), behind(0, 3, 0);
  CHECK(distance(colors_of(posed_avatar(avatar, bent, &front)), colors_of(posed_avatar(avatar, bent, &behind))) > 0.01);
  CHECK_THROWS_AS(posed_avatar(avatar, bent), InternalError);
}

TEST_CASE("an avatar's Gaussians follow their joints") {
  const Avatar avatar = two_bones();
  BodyPose pose = rest_pose(2);
  pose.transl = {10, 20, 30};
  pose.set_rotation(1, {0, 0, std::acos(-1.0) / 2});  // the tip bends from +x to +y
  const PosedGaussians posed = posed_avatar(avatar, pose);
  check_sizes(posed.gaussians);
  CHECK(posed.gaussians.sh_degree == 0);
  CHECK((mean_of(posed, 0) - Vector3<double>(10.5, 20, 30)).norm() < 1e-12);
  CHECK((mean_of(posed, 1) - Vector3<double>(11, 20.5, 30)).norm() < 1e-12);
  CHECK((mean_of(posed, 2) - Vector3<double>(11, 20, 30.25)).norm() < 1e-12);  // on the joint's axis: both agree
  CHECK(posed.transforms[12 * 2] == Approx(0.5));                              // a blend, which shrinks
  for (std::size_t i = 0; i < avatar.colors.size(); ++i)
    CHECK(0.5 + 0.28209479177387814 * static_cast<double>(posed.gaussians.sh[i]) ==
          Approx(static_cast<double>(avatar.colors[i])).margin(1e-7));
  CHECK_THROWS_AS(posed_avatar(avatar, rest_pose(3)), InternalError);
}

TEST_CASE("parts without transforms stand still beside those that have some") {
  const PosedGaussians body = posed_avatar(two_bones(), rest_pose(2));
  const PosedGaussians still{body.gaussians, {}};
  const std::vector<PosedGaussians> parts = {still, body, still};
  const PosedGaussians all = concatenated(parts);
  CHECK(all.gaussians.count() == 9);
  REQUIRE(all.transforms.size() == 12 * 9);
  for (std::size_t n = 0; n < 9; ++n) CHECK((mean_of(all, n) - mean_of(body, n % 3)).norm() < 1e-15);
  CHECK(concatenated(std::vector<PosedGaussians>{still, still}).transforms.empty());
}

TEST_CASE("render draws a body of a motion, in every precision") {
  const TemporaryFolder folder;
  const Avatar avatar = surface_avatar(procedural_body(), {.gaussians = 400});
  write_avatar("avatar.safetensors", avatar);
  Motion motion;
  for (int frame = 0; frame < 2; ++frame) {
    BodyPose pose = rest_pose(55);
    pose.set_rotation(0, {std::acos(-1.0) / 2, 0, 0});  // y up to z up
    pose.transl = {0.2 * frame, 0, 0};
    pose.set_rotation(16, {0, 0, -0.9 * frame});  // an arm
    motion.poses.push_back(pose);
  }
  write_motion("motion.npz", motion);
  Camera camera;
  camera.width = 40;
  camera.height = 60;
  camera.fx = camera.fy = 60;
  camera.cx = 20;
  camera.cy = 30;
  camera.camera_from_world = look_at({0, -3, 0}, {0, 0, 0});
  write_camera("camera.json", camera);
  Gaussians ball;
  ball.sh_degree = 1;
  ball.means = {0.5F, -0.5F, 0.3F};
  ball.quats = {1, 0, 0, 0};
  ball.log_scales = {-2, -2, -2};
  ball.opacity_logits = {3};
  ball.sh.assign(12, 0.5F);
  write_ply("ball.ply", ball);

  cli::RenderOptions options;
  options.shared.scene = "ball.ply";
  options.shared.camera = "camera.json";
  options.motion = "motion.npz";
  options.avatar = "avatar.safetensors";
  std::vector<std::vector<double>> images;
  for (const int frame : {0, 1}) {
    for (const char* precision : {"reference", "double", "float"}) {
      options.frame = frame;
      options.shared.precision = precision;
      options.out = "a.npz";
      CHECK_THAT(cli::render_command(options), Catch::Matchers::StartsWith("a.npz: 40 x 60 pixels of 401 Gaussians"));
      images.push_back(Npz::read("a.npz").array("image").as<double>());
    }
  }
  const auto largest_difference = [&](std::size_t a, std::size_t b) {
    double largest = 0;
    for (std::size_t i = 0; i < images[a].size(); ++i)
      largest = larger(largest, std::fabs(images[a][i] - images[b][i]));
    return largest;
  };
  CHECK(largest_difference(1, 0) < 1e-9);
  CHECK(largest_difference(2, 0) < 2e-2);  // a Gaussian at the edge of its footprint may count or not
  CHECK(largest_difference(4, 3) < 1e-9);
  CHECK(largest_difference(3, 0) > 0.3);  // the body moved
  const double sum = std::accumulate(images[0].begin(), images[0].end(), 0.0);
  CHECK(sum / static_cast<double>(images[0].size()) > 0.03);  // and was seen

  const ProgramResult outside =
      run_hsi4d({"render", "--scene", "ball.ply", "--camera", "camera.json", "--motion", "motion.npz", "--avatar",
                 "avatar.safetensors", "--frame", "2", "--out", "a.png"});
  CHECK(outside.status == 2);
  CHECK(outside.err == "hsi4d render: --frame: motion.npz has no frame 2; allowed: 0 to 1\n");
}

namespace {

Camera camera_at(const Vector3<double>& place) {
  Camera camera;
  camera.width = 40;
  camera.height = 60;
  camera.fx = camera.fy = 60;
  camera.cx = 20;
  camera.cy = 30;
  camera.camera_from_world = look_at(place, place + Vector3<double>(0.1, 3, 0.2));
  return camera;
}

}  // namespace

TEST_CASE("render puts the pelvis where the motion's body model has it") {
  const TemporaryFolder folder;
  const Avatar avatar = surface_avatar(procedural_body(), {.gaussians = 400});
  write_avatar("avatar.safetensors", avatar);
  write_camera("camera.json", camera_at({0, -3, 0}));
  write_ply("nothing.ply", Gaussians{});
  cli::RenderOptions options;
  options.shared.scene = "nothing.ply";
  options.shared.camera = "camera.json";
  options.shared.precision = "double";
  options.avatar = "avatar.safetensors";
  options.out = "a.npz";
  const auto rendered = [&](const char* motion) {
    options.motion = motion;
    cli::render_command(options);
    return Npz::read("a.npz").array("image").as<double>();
  };
  Motion own;
  own.poses = {rest_pose(55)};
  own.poses[0].set_rotation(0, {std::acos(-1.0) / 2, 0, 0});
  own.poses[0].transl = {0.1, 0.05, 0.2};
  own.pelvis_rest = pelvis_of(avatar.joints);
  write_motion("own.npz", own);
  const std::vector<double> expected = rendered("own.npz");
  CHECK(std::accumulate(expected.begin(), expected.end(), 0.0) / static_cast<double>(expected.size()) > 0.01);
  const Vector3<double> there = own.poses[0].transl + *own.pelvis_rest;
  for (const auto& [width, pelvis] : {std::pair{156, kSmplhPelvis}, {72, kSmplPelvis}, {165, kSmplxPelvis}}) {
    const Vector3<double> trans = there - pelvis;
    std::vector<double> pose = own.poses[0].axis_angle;
    pose.resize(static_cast<std::size_t>(width));
    NpzWriter file;
    file.add<double>("trans", {1, 3}, std::vector<double>(trans.data(), trans.data() + 3));
    file.add<double>("poses", {1, width}, pose);
    file.write("other.npz");
    CHECK(largest_difference(rendered("other.npz"), expected) < 1e-9);
  }
}

TEST_CASE("render draws a body alone, wherever it is, and with the color net of a run") {
  const TemporaryFolder folder;
  Avatar avatar = surface_avatar(procedural_body(), {.gaussians = 400});
  write_avatar("avatar.safetensors", avatar);
  write_ply("nothing.ply", Gaussians{});
  cli::RenderOptions options;
  options.shared.camera = "camera.json";
  options.motion = "motion.npz";
  options.avatar = "avatar.safetensors";
  options.out = "a.npz";
  const auto rendered = [&](double distance) {
    const Vector3<double> shift(distance, -distance, 0);
    Motion motion;
    motion.poses = {rest_pose(55)};
    motion.poses[0].set_rotation(0, {std::acos(-1.0) / 2, 0, 0});
    motion.poses[0].set_rotation(16, {0, 0, -0.9});
    motion.poses[0].transl = shift;
    write_motion("motion.npz", motion);
    write_camera("camera.json", camera_at(shift + Vector3<double>(0, -3, 0)));
    CHECK_THAT(cli::render_command(options), Catch::Matchers::StartsWith("a.npz: 40 x 60 pixels of 400 Gaussians"));
    return Npz::read("a.npz").array("image").as<double>();
  };
  const std::vector<double> alone = rendered(0);
  CHECK(std::accumulate(alone.begin(), alone.end(), 0.0) / static_cast<double>(alone.size()) > 0.01);
  CHECK(largest_difference(rendered(1e6), alone) < 1e-2);  // a Gaussian at the edge of its footprint may count or not
  options.shared.scene = "nothing.ply";
  CHECK(rendered(0) == alone);

  options.shared.scene.clear();
  options.color_net = "net.safetensors";
  ColorNet net = new_color_net(avatar.means, 55, {4, 8, 1, false, 1});
  for (std::size_t i = 0; i < 24; ++i) net.layers[1].weights[i] = 0.1 * static_cast<double>(i) - 1;
  write_color_net("net.safetensors", net);
  const std::vector<double> learnt = rendered(0);
  CHECK(largest_difference(learnt, alone) > 0.1);
  avatar.color_net = net;
  write_avatar("avatar.safetensors", avatar);
  options.color_net.clear();
  CHECK(rendered(0) == learnt);

  options.color_net = "net.safetensors";
  write_avatar("avatar.safetensors", surface_avatar(procedural_body(), {.gaussians = 300}));
  CHECK_THROWS_WITH(cli::render_command(options),
                    "net.safetensors: array 'color_net/features': has features of 400 Gaussians; the avatar has 300: "
                    "the network is of another avatar, or of another run's");
  options.color_net = "avatar.safetensors";
  CHECK_THROWS_WITH(cli::render_command(options),
                    "avatar.safetensors: the format is 'hsi4d avatar'; allowed: 'hsi4d color net'");
}

TEST_CASE("a body looks the same wherever in the world it is, in float too (row A10)") {
  const TemporaryFolder folder;
  write_avatar("avatar.safetensors", surface_avatar(procedural_body(), {.gaussians = 400}));
  cli::RenderOptions options;
  options.shared.scene = "ball.ply";
  options.shared.camera = "camera.json";
  options.shared.settings = {"render.quality=reference"};  // no cuts, which the last bit of a number may decide
  options.motion = "motion.npz";
  options.avatar = "avatar.safetensors";
  options.out = "a.npz";
  const auto rendered = [&](double distance, const char* precision) {
    const Vector3<double> shift(distance, -distance, 0.5 * distance);
    Motion motion;
    motion.poses = {rest_pose(55)};
    motion.poses[0].set_rotation(0, {std::acos(-1.0) / 2, 0, 0});
    motion.poses[0].set_rotation(16, {0, 0, -0.9});
    motion.poses[0].transl = shift + Vector3<double>(0.1, 0, 0);
    write_motion("motion.npz", motion);
    write_camera("camera.json", camera_at(shift + Vector3<double>(0, -3, 0)));
    Gaussians ball;
    for (int i = 0; i < 3; ++i) {
      const double place = std::array{0.5, -0.5, 0.25}[static_cast<std::size_t>(i)] + shift[i];
      ball.means.push_back(static_cast<float>(place));
      REQUIRE(static_cast<double>(ball.means.back()) == place);  // a file has floats: these are exact
    }
    ball.quats = {1, 0, 0, 0};
    ball.log_scales = {-2, -2, -2};
    ball.opacity_logits = {3};
    ball.sh_degree = 1;
    ball.sh.assign(12, 0.5F);
    write_ply("ball.ply", ball);
    options.shared.precision = precision;
    cli::render_command(options);
    return Npz::read("a.npz").array("image").as<double>();
  };
  const std::vector<double> reference = rendered(0, "reference");
  CHECK(std::accumulate(reference.begin(), reference.end(), 0.0) / static_cast<double>(reference.size()) > 0.03);
  for (const double distance : {0.0, 1e2, 1e4, 1e6}) {
    INFO(distance);
    CHECK(largest_difference(rendered(distance, "float"), reference) <= 1e-4);
    CHECK(largest_difference(rendered(distance, "double"), reference) <= 1e-7);
    CHECK(largest_difference(rendered(distance, "reference"), reference) <= 1e-7);
  }
}

TEST_CASE("transforms act in the world, whatever the means are relative to") {
  PosedGaussians posed = posed_avatar(two_bones(), [] {
    BodyPose pose = rest_pose(2);
    pose.set_rotation(0, {0.2, -0.4, 0.3});
    pose.set_rotation(1, {0, 0, 1.1});
    return pose;
  }());
  SceneView view{camera_at({0.7, -3, 0.2}), {0.1, 0.2, 0.3}, cli::render_settings({"render.quality=reference"}), {}};
  const auto rendered = [&](Precision precision) {
    view.precision = precision;
    return render_scene(posed, view).image;
  };
  const std::vector<double> at_zero = rendered(Precision::kReference);
  posed.gaussians.origin_world = {64, -256, 32};
  for (std::size_t i = 0; i < posed.gaussians.means.size(); ++i)
    posed.gaussians.means[i] -= static_cast<float>(posed.gaussians.origin_world[static_cast<Index>(i % 3)]);
  CHECK(largest_difference(at_zero, std::vector<double>(at_zero.size())) > 0.3);
  CHECK(largest_difference(rendered(Precision::kReference), at_zero) < 1e-9);
  CHECK(largest_difference(rendered(Precision::kDouble), at_zero) < 1e-9);
  CHECK(largest_difference(rendered(Precision::kFloat), at_zero) < 1e-5);
  posed.transforms.clear();
  posed.gaussians.means[7] += 0.125F;  // at rest two are equally deep, and rounding would order them
  const std::vector<double> still = rendered(Precision::kReference);
  CHECK(largest_difference(rendered(Precision::kDouble), still) < 1e-9);
  CHECK(largest_difference(rendered(Precision::kFloat), still) < 1e-4);
}

}  // namespace posed_avatar_test
