// `hsi4d init` as a user runs it.
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "core/camera_file.h"
#include "core/image_io.h"
#include "core/lens.h"
#include "core/process.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace init_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// Writes what a perfect detector would find in the tiny dataset, filmed through a lens.
void write_keypoints(const std::string& file, const Lens& lens = {}) {
  const Clip clip = read_clip(tiny_config().data);
  nlohmann::json joints = nlohmann::json::array(), frames = nlohmann::json::array();
  for (Index j = 0; j < 22; ++j) joints.push_back(smplx_joint_names()[static_cast<std::size_t>(j)]);
  for (const SceneState& state : *clip.truth) {
    const std::vector<double> places = pose_joints(clip.avatar.parents, clip.avatar.joints, state.body);
    nlohmann::json frame = nlohmann::json::array();
    for (Index j = 0; j < 22; ++j) {
      const Vector3<double> at = state.camera_from_world.rotation * Vector3<double>(places.data() + 3 * j) +
                                 state.camera_from_world.translation;
      const Vector2<double> bent = bent_by(lens, {at[0] / at[2], at[1] / at[2]});
      const Vector2<double> pixel = project_point(clip.camera, Vector3<double>(bent[0], bent[1], 1));
      frame.push_back({pixel[0], pixel[1], 1});
    }
    frames.push_back(frame);
  }
  std::ofstream(file) << nlohmann::json(
      {{"format", "hsi4d keypoints"}, {"version", 1}, {"joints", joints}, {"frames", frames}});
}

struct Footage {
  TemporaryFolder folder;
  std::string frames = (TinyDataset::folder() / "frames").string(), masks = (TinyDataset::folder() / "masks").string(),
              avatar = (TinyDataset::folder() / "avatar.safetensors").string();
  Footage() { write_keypoints("keypoints.json"); }

  ProgramResult init(std::vector<std::string> more) const {
    std::vector<std::string> arguments = {"init",    frames, "--keypoints", "keypoints.json",
                                          "--masks", masks,  "--avatar",    avatar};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_hsi4d(arguments);
  }
};

}  // namespace

TEST_CASE("hsi4d init makes a dataset of a video without a scene, which runs") {
  const Footage footage;
  const Camera truth = read_camera((TinyDataset::folder() / "camera.json").string());
  const ProgramResult init =
      footage.init({"--focal-px", std::to_string(truth.fx), "--video-rate", "10", "--out", "clip"});
  CAPTURE(init.err);
  REQUIRE(init.status == 0);
  CHECK_THAT(init.out, Contains("clip/config.json: the camera is ") && Contains("of the background"));
  const Camera camera = read_camera("clip/camera.json");
  CHECK(camera.width == kTinyPixels);
  CHECK(camera.fx == Approx(truth.fx));
  CHECK(camera_center_world(camera)[2] == Approx(camera_center_world(truth)[2]).margin(0.4));
  const auto down = [](const Camera& c) { return std::asin(-c.camera_from_world.rotation(2, 2)); };
  CHECK(down(camera) == Approx(down(truth)).margin(0.15));
  CHECK(read_image("clip/plate.png").width() == kTinyPixels);
  CHECK(json_of("clip/config.json")["data"]["frames"].get<std::string>().starts_with(".."));  // relative, to be moved

  std::vector<std::string> run = {"run", "clip/config.json", "--out", "run", "--quiet"};
  for (const char* const setting :
       {"stages.fit_first_pose.iterations=80", "stages.fit_first_frame.iterations=2", "stages.pose.iterations=10",
        "stages.pose.losses.keypoints_2d.weight=0.1", "stages.fit_first_pose.losses.keypoints_2d.weight=0.1",
        "stages.interaction.iterations=2", "stages.refinement.iterations=2"})
    run.insert(run.end(), {"--set", setting});
  const ProgramResult result = run_hsi4d(run);
  CAPTURE(result.err);
  REQUIRE(result.status == 0);
  CHECK_THAT(result.out, Contains("quality: "));
  const nlohmann::json summary = json_of("run/summary.json");
  CHECK(summary["quality"]["silhouette_iou"]["word"].is_string());
  CHECK(summary["metrics"].back()["keypoints_pck"].get<double>() >
        summary["baselines"]["start"]["keypoints_pck"].get<double>());
  CHECK(file_text("run/report.html").find("<h2>Quality</h2>") != std::string::npos);
  CHECK(file_text("run/report.html").find("<dt>scene</dt><dd>a plate") != std::string::npos);
  CHECK_THAT(file_text("run/log.txt"), Contains("the scene is a plate"));
}

TEST_CASE("hsi4d init makes a person where none is given, and leaves out what it cannot use") {
  const Footage footage;
  const ProgramResult init =
      run_hsi4d({"init", footage.frames, "--keypoints", "keypoints.json", "--masks", footage.masks, "--out", "clip"});
  CAPTURE(init.err);
  REQUIRE(init.status == 0);
  CHECK(fs::exists("clip/avatar.safetensors"));
  const nlohmann::json stages = json_of("clip/config.json")["stages"];
  CHECK(stages.contains("camera") == (init.out.find(" it moves (") != std::string::npos));
  CHECK_FALSE(stages["pose"]["losses"].contains("bone_directions"));  // without landmarks
  CHECK(stages["pose"]["losses"].contains("keypoints_2d"));
}

TEST_CASE("hsi4d init takes a lens that is known") {
  const Footage footage;
  const double focal = read_camera((TinyDataset::folder() / "camera.json").string()).fx;
  const auto height = [&](const char* k1, const char* out) {
    const ProgramResult init = footage.init({"--focal-px", std::to_string(focal), "--lens-k1", k1, "--out", out});
    CAPTURE(init.err);
    REQUIRE(init.status == 0);
    return camera_center_world(read_camera(std::string(out) + "/camera.json"))[2];
  };
  const double pinhole = height("0", "pinhole");
  write_keypoints("keypoints.json", {.k1 = -0.3});
  CHECK(height("-0.3", "lens") == Approx(pinhole).margin(0.02));
  CHECK(json_of("lens/config.json")["data"]["lens"]["k1"] == -0.3);
  CHECK(load_run_config("lens/config.json", {}, descriptions_of(loss_terms())).data.lens.lens.k1 == -0.3);
}

TEST_CASE("hsi4d init takes a camera that is known") {
  const Footage footage;
  const std::string camera = (TinyDataset::folder() / "camera.json").string();
  const ProgramResult init = footage.init({"--camera", camera, "--out", "clip"});
  CAPTURE(init.err);
  REQUIRE(init.status == 0);
  CHECK(read_camera("clip/camera.json").camera_from_world.translation ==
        read_camera(camera).camera_from_world.translation);
}

TEST_CASE("hsi4d init puts a person into a scene that is known") {
  const Footage footage;
  const std::string camera = (TinyDataset::folder() / "camera.json").string(),
                    scene = (TinyDataset::folder() / "scene.ply").string();
  const ProgramResult init =
      footage.init({"--scene", scene, "--camera", camera, "--video-rate", "10", "--out", "clip"});
  CAPTURE(init.err);
  REQUIRE(init.status == 0);
  CHECK_THAT(init.out, Contains("clip/config.json: the camera ") && !Contains("background"));
  for (const char* const of_plate : {"clip/plate.png", "clip/scene.ply"}) CHECK_FALSE(fs::exists(of_plate));
  const nlohmann::json config = json_of("clip/config.json");
  CHECK(fs::equivalent(fs::path("clip") / config["data"]["scene"].get<std::string>(), scene));
  const ProgramResult dry = run_hsi4d({"run", "clip/config.json", "--out", "run", "--dry-run"});
  CAPTURE(dry.err);
  CHECK(dry.status == 0);
}

TEST_CASE("hsi4d init takes a portrait video that its file says to turn") {
  const Footage footage;
  // The middle of the tiny frames, upright; as a telephone writes it: lying, with a note that it is to be turned.
  constexpr int kCut = 8;
  const auto middle = [](const fs::path& file) {
    const Image whole = read_image(file.string());
    Image part(whole.channels(), whole.height(), whole.width() - 2 * kCut);
    for (int c = 0; c < part.channels(); ++c) {
      for (int y = 0; y < part.height(); ++y) std::copy_n(whole.row(c, y) + kCut, part.width(), part.row(c, y));
    }
    return part;
  };
  fs::create_directories("upright");
  fs::create_directories("masks/human");
  for (int t = 0; t < kTinyFrames; ++t) {
    const std::string name = "000" + std::to_string(t) + ".png";
    write_image("upright/" + name, middle(fs::path(footage.frames) / name));
    write_image("masks/human/" + name, middle(fs::path(footage.masks) / "human" / name));
  }
  run_process({"ffmpeg", "-v", "error", "-nostdin", "-framerate", "10", "-i", "upright/%04d.png", "-vf",
               "transpose=clock", "-pix_fmt", "yuv444p", "-colorspace", "bt709", "lying.mp4"});
  run_process({"ffmpeg", "-v", "error", "-nostdin", "-i", "lying.mp4", "-c", "copy", "-metadata:s:v", "rotate=90",
               "turned.mp4"});
  write_changed("keypoints.json", "keypoints.json", [](auto& k) {
    for (auto& frame : k["frames"]) {
      for (auto& point : frame) point[0] = point[0].template get<double>() - kCut;
    }
  });
  const ProgramResult init = run_hsi4d({"init", "turned.mp4", "--keypoints", "keypoints.json", "--masks", "masks",
                                        "--avatar", footage.avatar, "--out", "clip"});
  CAPTURE(init.err);
  REQUIRE(init.status == 0);
  const Camera camera = read_camera("clip/camera.json");
  CHECK(camera.width == kTinyPixels - 2 * kCut);
  CHECK(camera.height == kTinyPixels);
  const Image plate = read_image("clip/plate.png"), frame = read_image("upright/0000.png");
  double difference = 0;  // along the upper border, where nobody is
  for (int x = 0; x < camera.width; ++x)
    difference += std::abs(static_cast<double>(plate(1, 1, x)) - static_cast<double>(frame(1, 1, x))) / camera.width;
  CHECK(difference < 0.1);
}

TEST_CASE("hsi4d init keeps some of the frames of a fast video, with the keypoints of all") {
  const Footage footage;
  const ProgramResult init = footage.init({"--video-rate", "60", "--frame-rate", "30", "--out", "clip"});
  CAPTURE(init.err);
  REQUIRE(init.status == 0);
  CHECK(json_of("clip/config.json")["data"]["frame_rate"] == 30);
  const ProgramResult dry = run_hsi4d({"run", "clip/config.json", "--out", "run", "--dry-run"});
  CAPTURE(dry.err);
  CHECK(dry.status == 0);
  CHECK_THAT(dry.out, Contains("2 frames of "));
}

TEST_CASE("hsi4d init takes a person whose feet are out of the picture in some frames, not in all") {
  const Footage footage;
  const auto without_feet = [](std::size_t from) {
    write_changed("keypoints.json", "cut.json", [from](auto& k) {
      for (std::size_t t = from; t < k["frames"].size(); ++t) {
        for (const std::size_t ankle : {7U, 8U}) k["frames"][t][ankle] = {20, 60, 0.2};  // below the border, a guess
      }
    });
    return run_hsi4d({"init", (TinyDataset::folder() / "frames").string(), "--keypoints", "cut.json", "--masks",
                      (TinyDataset::folder() / "masks").string(), "--avatar",
                      (TinyDataset::folder() / "avatar.safetensors").string(), "--video-rate", "10", "--out", "clip"});
  };
  const ProgramResult all = without_feet(0);
  CHECK(all.status == 2);
  CHECK_THAT(all.err, Contains("cut.json: no frame shows both ankles and two other pairs of knees, hips, shoulders and "
                               "eyes with a confidence of at least 0.5"));
  const ProgramResult some = without_feet(1);
  CAPTURE(some.err);
  CHECK(some.status == 0);
  CHECK_THAT(some.err, !Contains("the first state has the person of frame"));

  write_changed("keypoints.json", "late.json", [](auto& k) {
    for (const std::size_t ankle : {7U, 8U}) k["frames"][0][ankle] = {20, 60, 0.2};
  });
  const ProgramResult late =
      run_hsi4d({"init", (TinyDataset::folder() / "frames").string(), "--keypoints", "late.json", "--masks",
                 (TinyDataset::folder() / "masks").string(), "--avatar",
                 (TinyDataset::folder() / "avatar.safetensors").string(), "--video-rate", "10", "--out", "later"});
  CHECK(late.status == 0);
  CHECK_THAT(late.err, Contains("late.json: no ankles are on the ground in frame 0; the first state has the person of "
                                "frame 1"));
}

TEST_CASE("hsi4d init --check looks at what is there before keypoints and masks are") {
  const Footage footage;
  const auto check = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"init",  footage.frames, "--keypoints", "later.json", "--masks",
                                      "later", "--out",        "clip",        "--check"};
    words.insert(words.end(), more.begin(), more.end());
    const ProgramResult run = run_hsi4d(words);
    CHECK_FALSE(fs::exists("clip"));
    return std::to_string(run.status) + " " + run.out + run.err;
  };
  CHECK_THAT(check({}), Contains("0 " + footage.frames + ": 4 frames of "));
  CHECK_THAT(check({"--longest-side-px", "1"}), Contains("2 ") && Contains("--longest-side-px: 1 is out of range"));
  CHECK_THAT(check({"--lens-k1", "-9"}), Contains("2 ") && Contains("--lens-k1 is -9"));
  CHECK_THAT(check({"--avatar", "none.safetensors"}), Contains("2 ") && Contains("none.safetensors"));
  CHECK_THAT(check({"--scene", "none.ply"}), Contains("2 ") && Contains("none.ply"));
  const std::string scene = (TinyDataset::folder() / "scene.ply").string();
  CHECK_THAT(check({"--scene", scene}), Contains("0 " + footage.frames));  // its camera is found later
  CHECK_THAT(check({"--scene", scene, "--focal-px", "500"}), Contains("2 ") && Contains("leave out --focal-px"));
  CHECK_THAT(check({"--frame-rate", "1000"}), Contains("2 ") && Contains("frame"));
}

TEST_CASE("hsi4d init refuses what it cannot do, and leaves nothing") {
  const Footage footage;
  const auto error = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--out", "clip"});
    const ProgramResult run = footage.init(more);
    CHECK(run.status == 2);
    CHECK_FALSE(fs::exists("clip"));
    return run.err;
  };
  CHECK_THAT(error({"--focal-px", "-3"}), Contains("hsi4d init: --focal-px: -3 is out of range; allowed: 1 to "));
  CHECK_THAT(error({"--camera-height", "0"}), Contains("--camera-height: 0 is out of range"));
  CHECK_THAT(error({"--lens-k1", "11"}), Contains("--lens-k1: 11 is out of range; allowed: -10 to 10"));
  CHECK_THAT(error({"--lens-k1", "-9"}), Contains("hsi4d init: --lens-k1 is -9: such a lens turns back before an "
                                                  "edge of the picture"));
  CHECK_THAT(error({"--longest-side-px", "8"}), Contains("--longest-side-px: 8 is out of range; allowed: 64 to 4096"));
  CHECK_THAT(error({"--frame-rate", "-1"}), Contains("--frame-rate: -1"));
  const std::string camera = (TinyDataset::folder() / "camera.json").string();
  CHECK_THAT(error({"--camera", camera, "--focal-px", "500"}), Contains("leave out --focal-px"));
  write_changed(camera, "other.json", [](auto& c) { c["width"] = 80; });
  CHECK_THAT(error({"--camera", "other.json"}), Contains("the camera's image is 80x48"));
  CHECK_THAT(error({"--scene", camera}), Contains("hsi4d init: --scene needs --camera: "));
  CHECK_THAT(error({"--scene", camera, "--camera", camera}), Contains(camera));
  write_changed("keypoints.json", "keypoints.json", [](auto& k) {
    for (auto& frame : k["frames"]) {
      for (auto& point : frame) point[2] = 0.1;
    }
  });
  CHECK_THAT(error({}), Contains("keypoints.json: no frame shows both ankles"));
  write_changed("keypoints.json", "keypoints.json", [](auto& k) { k["frames"].erase(0); });
  CHECK_THAT(error({}), Contains("holds 3 frames of keypoints, the video has 4 frames"));
}

}  // namespace init_command_test
