// `hsi4d locate` as a user runs it.
#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/image_io.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/synthetic/scene.h"
#include "splat/files/splat_file.h"
#include "tests/support/program.h"

namespace locate_command_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

const Camera kTruth{96, 72, 96, 96, 48, 36, look_at({0.3, -3, 1.5}, {0, 0.8, 0.8})};

/// A scene, frame 0 and the truth.
void write_files() {
  const Gaussians scene = synthetic_scene(SyntheticSceneKind::kLivingRoom, 4000, ScenePlan{}, 3);
  write_splats("scene.ply", scene);
  SceneView view;
  view.camera = kTruth;
  write_image("frame.png", render_picture({scene, {}}, view).image);
  write_camera("truth.json", kTruth);
}

ProgramResult locate(std::vector<std::string> more) {
  std::vector<std::string> arguments = {"locate", "frame.png", "--scene", "scene.ply", "--quiet", "--out", "c.json"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_hsi4d(arguments);
}

PoseError error_of_file() { return camera_error(read_camera("c.json").camera_from_world, kTruth.camera_from_world); }

/// Picks of points by the true camera.
std::string picks_text() {
  std::string text = "frame_x,frame_y,x,y,z\n";
  for (const Vector3<double>& point :
       {Vector3<double>(-0.8, 0.5, 0), Vector3<double>(0.7, 0.4, 0.1), Vector3<double>(0, 1.5, 1.2),
        Vector3<double>(-0.5, 1.2, 1), Vector3<double>(0.6, 1.9, 0.4), Vector3<double>(0.3, 0.9, 0.75)}) {
    const Vector2<double> pixel = project_point(kTruth, transform_point(kTruth.camera_from_world, point));
    text += number_text(pixel[0]) + "," + number_text(pixel[1]) + "," + number_text(point[0]) + "," +
            number_text(point[1]) + "," + number_text(point[2]) + "\n";
  }
  return text;
}

}  // namespace

TEST_CASE("hsi4d locate finds a camera from a rough place, and writes what it sees") {
  const TemporaryFolder folder;
  write_files();
  const ProgramResult run = locate({"--position", "0.35,-3.05,1.45", "--target", "0.1,0.8,0.8", "--focal-px", "96",
                                    "--spread", "0.1,4", "--starts", "24", "--threads", "2"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  CHECK(error_of_file().translation_cm < 1);
  CHECK(error_of_file().rotation_deg < 0.2);
  CHECK_THAT(run.out, Catch::StartsWith("c.json: the camera is at 0.3") &&
                          Catch::Contains("best starts end near there") &&
                          Catch::Contains("PSNR of the compared pixels: ") && Catch::Contains("(pass)") &&
                          Catch::Contains("c.png: frame, render, difference"));
  CHECK(read_image("c.png").width() == 3 * 96);
}

TEST_CASE("hsi4d locate finds a camera from picks, and tells of those that are wrong") {
  const TemporaryFolder folder;
  write_files();
  folder.write("picks.csv", picks_text() + "5,5,0,0,0\n");
  const ProgramResult known = locate({"--picks", "picks.csv", "--focal-px", "96", "--no-refine"});
  CAPTURE(known.err);
  REQUIRE(known.status == 0);
  CHECK(error_of_file().translation_cm < 0.01);
  CHECK_THAT(known.out, Catch::Contains("picks: 6 of 7 agree within 0.96 px") &&
                            Catch::Contains("picks that do not agree: lines 8"));
  const ProgramResult refined = locate({"--picks", "picks.csv"});
  REQUIRE(refined.status == 0);
  CHECK(error_of_file().translation_cm < 0.5);
  CHECK(read_camera("c.json").fx == Approx(96).epsilon(0.01));
  CHECK_THAT(refined.out, Catch::Contains("of the focal length open"));
}

TEST_CASE("hsi4d locate takes the camera of COLMAP's model") {
  const TemporaryFolder folder;
  write_files();
  folder.write("model/cameras.txt", "1 PINHOLE 96 72 96 96 48 36\n");
  folder.write("model/images.txt", "1 1 0 0 0 0 0 0 1 frame.png\n\n");
  // The model's world is the camera's own frame, half as large; the alignment is the way from there.
  const Rigid<double> away = inverse(kTruth.camera_from_world);
  std::string matrix;
  for (Index i = 0; i < 3; ++i) {
    for (Index j = 0; j < 3; ++j) matrix += (j == 0 ? "[" : "") + number_text(2 * away.rotation(i, j)) + ", ";
    matrix += number_text(away.translation[i]) + "], ";
  }
  folder.write("alignment.json", "{\"matrix\": [" + matrix + "[0, 0, 0, 1]]}");
  const ProgramResult run = locate({"--colmap", "model", "--alignment", "alignment.json", "--no-refine"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  CHECK(error_of_file().translation_cm < 1e-6);
}

TEST_CASE("a result that is poor says so") {
  const TemporaryFolder folder;
  write_files();
  Camera away = kTruth;
  away.camera_from_world = look_at({0.3, -3, 1.5}, {3, -6, 1});
  write_camera("away.json", away);
  const ProgramResult run = locate({"--guess", "away.json", "--no-refine"});
  REQUIRE(run.status == 0);
  CHECK_THAT(run.out, Catch::Contains("check: scene and frame differ much"));
}

TEST_CASE("hsi4d locate refuses options and files that say too little or contradict each other") {
  const TemporaryFolder folder;
  write_files();
  folder.write("picks.csv", picks_text());
  const auto error = [](std::vector<std::string> more) {
    const ProgramResult run = locate(std::move(more));
    CHECK(run.status == 2);
    return run.err;
  };
  CHECK_THAT(error({}), Catch::Contains("what is known of the camera? One of --picks, --colmap, --guess"));
  CHECK_THAT(error({"--guess", "truth.json", "--picks", "picks.csv"}), Catch::Contains("several ways to a camera"));
  CHECK_THAT(error({"--position", "0,0,1", "--fov", "60"}), Catch::Contains("--position and --target go together"));
  CHECK_THAT(error({"--position", "0,0,1", "--target", "0,1,1"}), Catch::Contains("how wide does the camera see?"));
  CHECK_THAT(error({"--position", "0,0,nan", "--target", "0,1,1", "--fov", "60"}), Catch::Contains("--position"));
  CHECK_THAT(error({"--guess", "truth.json", "--fov", "60"}), Catch::Contains("--fov has no meaning without"));
  CHECK_THAT(error({"--guess", "truth.json", "--view", "truth.json"}),
             Catch::Contains("--view has no meaning without"));
  CHECK_THAT(error({"--picks", "picks.csv", "--fov", "60", "--focal-px", "96"}), Catch::Contains("give one"));
  CHECK_THAT(error({"--picks", "picks.csv", "--fov", "0"}),
             Catch::Contains("--fov: 0 is out of range; allowed: 1 to 170"));
  CHECK_THAT(error({"--guess", "truth.json", "--spread", "1"}), Catch::Contains("--spread"));
  CHECK_THAT(error({"--guess", "truth.json", "--spread", "1,120"}), Catch::Contains("0 to 90 degrees"));
  CHECK_THAT(error({"--guess", "none.json"}), Catch::Contains("none.json"));
  CHECK_THAT(error({"--picks", "none.csv"}), Catch::Contains("none.csv"));
  CHECK_THAT(error({"--guess", "truth.json", "--masks", "none"}), Catch::Contains("none: is no folder of masks"));
  Camera wide = kTruth;
  wide.width = 192;
  write_camera("wide.json", wide);
  CHECK_THAT(error({"--guess", "wide.json"}),
             Catch::Contains("is 96x72 pixels, the image of the camera of wide.json 192x72"));
  CHECK_FALSE(std::filesystem::exists("c.json"));
}

}  // namespace locate_command_test
