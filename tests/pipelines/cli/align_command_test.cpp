// `hsi4d align` and `hsi4d place` as a user runs them.
#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "body/avatar.h"
#include "body/procedural_body.h"
#include "core/camera_file.h"
#include "core/image_io.h"
#include "pipelines/scan/align.h"
#include "pipelines/synthetic/object.h"
#include "pipelines/synthetic/photos.h"
#include "pipelines/synthetic/scene.h"
#include "splat/files/splat_file.h"
#include "splat/files/transform.h"
#include "tests/support/program.h"

namespace align_command_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// A living room in metres, z up.
struct Room {
  Gaussians scene = synthetic_scene(SyntheticSceneKind::kLivingRoom, 12000, {}, 0);
  std::vector<Camera> cameras = cameras_in_scene(30, 64, 0);
};

/// Writes scene.ply and cameras.json of the room after a similarity.
void write_moved(const Room& room, const Similarity& away) {
  write_splats("scene.ply", transformed(room.scene, away));
  std::vector<Camera> cameras;
  for (const Camera& camera : room.cameras) cameras.push_back(moved_camera(camera, away));
  write_cameras("cameras.json", cameras);
}

Similarity some_similarity() {
  Similarity away;
  away.scale = 0.37;
  away.rotation = Eigen::Quaterniond(0.3, 0.8, -0.4, 0.33).normalized().toRotationMatrix();
  away.translation = {4, -2, 7};
  return away;
}

double median_height(std::vector<Camera> cameras) {
  std::vector<double> heights;
  for (const Camera& camera : cameras) heights.push_back(camera_center_world(camera)[2]);
  std::sort(heights.begin(), heights.end());
  return heights[heights.size() / 2];
}

}  // namespace

TEST_CASE("hsi4d align puts a scene that lies anyhow on its ground, in metres, with its cameras") {
  const TemporaryFolder folder;
  const Room room;
  const Similarity away = some_similarity();
  write_moved(room, away);
  const ProgramResult run = run_hsi4d({"align", "scene.ply", "--cameras", "cameras.json", "--camera-height",
                                       std::to_string(median_height(room.cameras)), "--out", "o"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  CHECK_THAT(run.out, Catch::Contains("o: the ground holds"));
  const Gaussians placed = read_splats("o/scene.ply").gaussians;
  REQUIRE(placed.count() == room.scene.count());
  // Heights and lengths are those of the room; it may be turned about z.
  double highest_error = 0, distance_error = 0;
  for (std::size_t i = 0; i + 6 < placed.means.size(); i += 300) {
    highest_error =
        std::max(highest_error, std::abs(static_cast<double>(placed.means[i + 2] - room.scene.means[i + 2])));
    const auto between = [&](const Gaussians& g) {
      return (Vector3<float>(g.means.data() + i) - Vector3<float>(g.means.data() + i + 3)).cast<double>().norm();
    };
    distance_error = std::max(distance_error, std::abs(between(placed) - between(room.scene)));
  }
  CHECK(highest_error < 0.01);
  CHECK(distance_error < 0.02);
  CHECK(median_height(read_cameras("o/cameras.json")) == Approx(median_height(room.cameras)).epsilon(1e-6));
  CHECK(read_image("o/ground.png").width() == 64);
  // Asked again, it has nothing to do.
  REQUIRE(run_hsi4d({"align", "o/scene.ply", "--cameras", "o/cameras.json", "--out", "again"}).status == 0);
  const nlohmann::json again = nlohmann::json::parse(file_text("again/alignment.json"));
  CHECK(again["scale"] == 1);
  CHECK(again["matrix"][2][2].get<double>() > std::cos(0.5 * std::acos(-1.0) / 180));
  CHECK(std::abs(again["matrix"][2][3].get<double>()) < 0.01);
}

TEST_CASE("hsi4d align takes its scale from a distance or a height, and refuses what says nothing") {
  const TemporaryFolder folder;
  const Room room;
  write_moved(room, some_similarity());
  const auto scale_by = [](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"align", "scene.ply", "--cameras", "cameras.json", "--out", "o"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult run = run_hsi4d(arguments);
    CAPTURE(run.err);
    REQUIRE(run.status == 0);
    const double scale = nlohmann::json::parse(file_text("o/alignment.json"))["scale"];
    std::filesystem::remove_all("o");
    return scale;
  };
  const auto listed = [](const Vector3<double>& point) {
    return std::to_string(point[0]) + "," + std::to_string(point[1]) + "," + std::to_string(point[2]);
  };
  const Similarity away = some_similarity();
  const Vector3<double> low = transform_point(away, Vector3<double>(1, -1, 0.2)),
                        high = transform_point(away, Vector3<double>(1, -1, 2.2));
  CHECK(scale_by({"--distance", listed(low) + "," + listed(high) + ",2"}) == Approx(1 / 0.37).epsilon(1e-4));
  CHECK(scale_by({"--height", listed(high) + ",2.2"}) == Approx(1 / 0.37).epsilon(0.01));
  CHECK(scale_by({}) == 1);

  const auto error = [](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"align", "scene.ply", "--out", "o"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult run = run_hsi4d(arguments);
    CHECK(run.status != 0);
    CHECK_FALSE(std::filesystem::exists("o"));
    return run.err;
  };
  CHECK_THAT(error({}), Catch::Contains("which way is about up? --cameras"));
  CHECK_THAT(error({"--up", "0,0,0"}), Catch::Contains("--up: 0,0,0 is no direction"));
  CHECK_THAT(error({"--up", "0,0"}), Catch::Contains("x,y,z"));
  CHECK_THAT(error({"--cameras", "cameras.json", "--camera-height", "0"}), Catch::Contains("allowed: above 0 metres"));
  const Vector3<double> up = away.rotation.col(2);
  CHECK_THAT(error({"--up", listed(up), "--camera-height", "1"}), Catch::Contains("--camera-height needs --cameras"));
  CHECK_THAT(error({"--cameras", "cameras.json", "--camera-height", "1", "--distance", "0,0,0,1,0,0,1"}),
             Catch::Contains("one of --distance, --height and --camera-height"));
  CHECK_THAT(error({"--cameras", "cameras.json", "--distance", "1,1,1,1,1,1,2"}), Catch::Contains("measures nothing"));
  CHECK_THAT(error({"--cameras", "cameras.json", "--picture", "30"}), Catch::Contains("allowed: 0 to 29"));
  write_splats("scene.ply", synthetic_object(SyntheticSettings{}).gaussians);
  folder.write("none.json", "{}");
  CHECK_THAT(error({"--cameras", "none.json"}), Catch::Contains("none.json"));
}

TEST_CASE("hsi4d place writes the state of frame 0, which is read where data.initial names it") {
  const TemporaryFolder folder;
  write_avatar("avatar.safetensors", surface_avatar(procedural_body(), {.gaussians = 300}));
  write_splats("can.ply", synthetic_object(SyntheticSettings{}).gaussians);
  const ProgramResult run = run_hsi4d({"place", "--avatar", "avatar.safetensors", "--at", "1.5,-2,90,0.25", "--object",
                                       "can=can.ply,2,-2,0,0.25", "--out", "o"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  CHECK_THAT(run.out, Catch::Contains("o/initial.json: a person at 1.5, -2 m, 1 object"));
  const nlohmann::json state = nlohmann::json::parse(file_text("o/initial.json"));
  CHECK(state["objects"]["can"]["translation"][0].get<double>() == Approx(2));
  CHECK(std::filesystem::exists("o/initial_motion.npz"));
  const ProgramResult info = run_hsi4d({"info", "o/initial_motion.npz"});
  CAPTURE(info.out, info.err);
  CHECK(info.status == 0);
}

TEST_CASE("hsi4d place refuses what stands nowhere") {
  const TemporaryFolder folder;
  write_avatar("avatar.safetensors", surface_avatar(procedural_body(), {.gaussians = 300}));
  const auto error = [](const char* at, std::vector<std::string> more) {
    std::vector<std::string> arguments = {"place", "--avatar", "avatar.safetensors", "--at", at, "--out", "o"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult run = run_hsi4d(arguments);
    CHECK(run.status != 0);
    CHECK_FALSE(std::filesystem::exists("o"));
    return run.err;
  };
  CHECK_THAT(error("1,2", {}), Catch::Contains("x,y,heading"));
  CHECK_THAT(error("1,2,nan", {}), Catch::Contains("--at"));
  CHECK_THAT(error("1,2,0", {"--object", "can"}), Catch::Contains("allowed: NAME=FILE,x,y,heading"));
  CHECK_THAT(error("1,2,0", {"--object", "can=no.ply,0,0,0"}), Catch::Contains("no.ply"));
  CHECK_THAT(error("1,2,0", {"--object", "a/b=can.ply,0,0,0"}), Catch::Contains("is no name of a file"));
  CHECK_THAT(error("1,2,0", {"--object", "can=c.ply,0,0,0", "--object", "can=d.ply,1,0,0"}),
             Catch::Contains("two are called can"));
  CHECK_THAT(error("1,2,0", {"--frame-rate", "0"}), Catch::Contains("--frame-rate"));
}

}  // namespace align_command_test
