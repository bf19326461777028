// What a run does with what the camera does not see, and with pictures that say nothing.
#include <limits>

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/image_io.h"
#include "core/log.h"
#include "pipelines/draw/visibility.h"
#include "splat/files/io_ply.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace unseen_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

using Texts = std::vector<std::string>;

/// The texts of warnings while `action` runs.
template <class F>
Texts warnings_of(F&& action) {
  Texts texts;
  const LogSink sink =
      log_to([&texts](LogLevel, std::string_view text) { texts.emplace_back(text); }, LogLevel::kWarning);
  action();
  return texts;
}

Index count_holding(const Texts& texts, const std::string& part) {
  return std::count_if(texts.begin(), texts.end(), [&](const std::string& text) { return Contains(part).match(text); });
}

/// A copy of the dataset, to be spoilt, and runs of it.
struct Spoilt : CopiedDataset {
  std::string file(const std::string& name) const { return (path / name).string(); }
  RunConfig config(const Texts& overrides = {}) const {
    return load_run_config(path / "config.json", overrides, descriptions_of(loss_terms()));
  }
  Texts run(const std::string& out, const Texts& overrides = {}) const {
    return warnings_of([&] { execute_tiny(config(overrides), out); });
  }
  /// The program refuses it before anything is written, with these words; a dry run too.
  void check_refused(const std::string& message) const {
    for (const Texts& more : {Texts{"--out", "run"}, Texts{"--out", "run", "--dry-run"}}) {
      Texts words = {"run", file("config.json")};
      words.insert(words.end(), more.begin(), more.end());
      const ProgramResult result = run_hsi4d(words);
      CHECK(result.status == 2);
      CHECK(result.out.empty());
      CHECK(result.err == message + "\n");
      CHECK_FALSE(fs::exists("run"));
    }
  }
  /// An image of every mask of `name`.
  void write_masks(const std::string& name, const Image& image) const {
    for (const auto& entry : fs::directory_iterator(path / "masks" / name)) write_image(entry.path().string(), image);
  }
  /// Every mean of a file of Gaussians moved.
  void move_gaussians(const std::string& name, std::size_t axis, float metres) const {
    Gaussians g = read_ply(file(name)).gaussians;
    for (std::size_t i = axis; i < g.means.size(); i += 3) g.means[i] += metres;
    write_ply(file(name), g);
  }
};

Image of_one_value(float value) {
  Image image(1, kTinyPixels, kTinyPixels);
  for (int y = 0; y < kTinyPixels; ++y) std::fill_n(image.row(0, y), kTinyPixels, value);
  return image;
}

/// An image of floats under a name that ends as a PNG's; what a file is, its content tells.
void write_as_exr(const std::string& name, const Image& image) {
  const fs::path exr = fs::path(name).replace_extension(".exr");
  write_image(exr.string(), image);
  fs::rename(exr, name);
}

const std::string kNoGradient = " (its gradient was 0 in every iteration) in ";

}  // namespace

TEST_CASE("what is in view has a centre in the image, in front of the camera") {
  const Clip clip = read_clip(dataset_inputs(TinyDataset::folder()));
  CHECK(parts_in_view(clip, clip.first) == PartsInView{true, true, {true}});
  const Matrix3<double>& rotation = clip.camera.camera_from_world.rotation;
  const Vector3<double> right = rotation.row(0).transpose(), forward = rotation.row(2).transpose();
  SceneState moved = clip.first;
  moved.objects[0].translation -= 20 * forward;  // behind the camera, where it would be projected into the image
  CHECK(parts_in_view(clip, moved) == PartsInView{true, true, {false}});
  for (const double side : {-20.0, 20.0}) {
    moved.body.transl = clip.first.body.transl + side * right;
    CHECK(parts_in_view(clip, moved) == PartsInView{true, false, {false}});
  }
  moved = clip.first;
  moved.body.transl += right;  // a part of it is still there
  CHECK(parts_in_view(clip, moved) == PartsInView{true, true, {true}});
  moved.camera_from_world.translation[2] -= 50;  // past all of it
  CHECK(parts_in_view(clip, moved) == PartsInView{false, false, {false}});
}

TEST_CASE("a body that leaves the view is told with its frames, and comes back", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  Motion motion = read_motion(dataset.file("initial_motion.npz"));
  motion.poses[2].transl += Vector3<double>(50, 0, 0);
  write_motion(dataset.file("initial_motion.npz"), motion);
  const Texts overrides = {"start.root=estimate"};
  const Texts told = dataset.run("run", overrides);
  CHECK(told ==
        Texts{"stage interaction: what the losses see did not depend on the group \"body_pose\"" + kNoGradient +
                  "frame 2",
              "stage interaction: what the losses see did not depend on the group \"global_orient\"" + kNoGradient +
                  "frame 2",
              "stage interaction: what the losses see did not depend on the group \"transl\"" + kNoGradient + "frame 2",
              "the human is out of view in frame 2: none of its 500 Gaussians has its centre in the image, "
              "which tells nothing of it there"});
  const Motion result = read_motion("run/motion.npz");
  CHECK(result.poses[2].transl[0] == Approx(motion.poses[2].transl[0]).epsilon(1e-6));
  CHECK((result.poses[3].transl - motion.poses[3].transl).norm() < 0.2);
  CHECK(result.poses[3].transl != motion.poses[3].transl);
  CHECK(json_of("run/status.json")["state"] == "done");

  int count = 0;  // stopped in frame 3, when frame 2 is in the checkpoint
  const RunConfig config = dataset.config(overrides);
  CHECK_THROWS_AS(execute_tiny(config, "halves", 1, false, [&] { return ++count == 2 * kPerFrame + 3; }), Interrupted);
  CHECK(warnings_of([&] { execute_tiny(config, "halves", 1, true); }) == told);
  CHECK(differences("run", "halves").empty());
}

TEST_CASE("a hand that nothing shows is told in the log alone", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  Avatar avatar = read_avatar(dataset.file("avatar.safetensors"));
  for (std::size_t i = 0; i < avatar.weights.indices.size(); ++i) {  // its Gaussians become those of the forearm
    std::int32_t& joint = avatar.weights.indices[i];
    if (joint >= 25 && joint < 40) joint = 18;
  }
  write_avatar(dataset.file("avatar.safetensors"), avatar);
  write_changed(dataset.file("config.json"), dataset.file("config.json"), [](nlohmann::ordered_json& config) {
    config["stages"]["interaction"]["optimize"]["left_hand_pose"] = {{"lr", 0.01}};
  });
  CHECK(dataset.run("run").empty());
  CHECK_THAT(file_text("run/log.txt"), Contains(" info stage interaction: what the losses see did not depend on the "
                                                "group \"left_hand_pose\"" +
                                                kNoGradient + "frames 1-3\n"));
}

TEST_CASE("an object that is never seen stays where it is given, and all that is off for it is told", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  dataset.write_masks(kTinyObject, of_one_value(0));
  write_changed(dataset.file("initial.json"), dataset.file("initial.json"), [](nlohmann::ordered_json& initial) {
    initial["objects"][kTinyObject]["translation"] = {0, -30, 0};
  });
  const Texts told = dataset.run("run", {"stages.interaction.losses.depth.weight=0"});
  CHECK(count_holding(told,
                      "masks/watering_can: the object is hidden in frames 1-3: no pixel reaches "
                      "data.mask_threshold; the loss \"center\" is off for it there") == 1);
  CHECK(count_holding(told, "what the losses see did not depend on the group \"object_transl\"" + kNoGradient +
                                "frames 1-3") == 1);
  CHECK(count_holding(told, "what the losses see did not depend on the group \"object_orient\"" + kNoGradient +
                                "frames 1-3") == 1);
  CHECK(count_holding(told, "the object \"watering_can\" is out of view in frames 1-3: none of its ") == 1);
  const auto tracks = read_object_tracks("run/objects.npz", {kTinyObject});
  for (const std::vector<ObjectPose>& frame : tracks) CHECK(frame[0].translation[1] == Approx(-30).epsilon(1e-6));
  for (const nlohmann::json& line : metrics_of("run"))
    if (line["stage"] == "interaction") CHECK(line["losses"]["center"] == 0);
}

TEST_CASE("an object that the frames show and the render does not is led back, where center moves the object alone",
          "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  const Vector3<double> side = 3 * read_cameras(dataset.file("camera.json"))[0].camera_from_world.rotation.row(0);
  Vector3<double> truth;
  write_changed(dataset.file("initial.json"), dataset.file("initial.json"), [&](nlohmann::ordered_json& initial) {
    nlohmann::ordered_json& translation = initial["objects"][kTinyObject]["translation"];
    for (Index i = 0; i < 3; ++i) {
      truth[i] = translation[static_cast<std::size_t>(i)];
      translation[static_cast<std::size_t>(i)] = truth[i] + side[i];  // out of the image
    }
  });
  const auto error_at_the_end = [&](const std::string& moves) {
    dataset.run("run_" + moves,
                {"stages.interaction.iterations=60", "stages.interaction.optimize.object_transl.lr=0.1",
                 "stages.interaction.losses.depth.weight=100", "stages.interaction.losses.center.moves=" + moves});
    const Vector3<double> place =
        read_object_tracks("run_" + moves + "/objects.npz", {kTinyObject}).back()[0].translation;
    return (place - truth).norm();
  };
  const double lost = error_at_the_end("all"), found = error_at_the_end("object");
  CAPTURE(lost, found);
  CHECK(lost > 2.5);
  CHECK(found < 0.3);
}

TEST_CASE("a camera that has nothing of the scene in view is told before the work, and finds nothing by it", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  dataset.move_gaussians("scene.ply", 1, -60);
  const Texts told = dataset.run("run");
  const std::string count = std::to_string(read_ply(dataset.file("scene.ply")).gaussians.count());
  REQUIRE_FALSE(told.empty());
  CHECK(told.front() == dataset.file("camera.json") + ": none of the scene's " + count +
                            " Gaussians is in view in frame 0; what a stage is to find by the scene, it cannot");
  CHECK(count_holding(told, "stage camera: what the losses see did not depend on the group \"camera\"" + kNoGradient +
                                "frames 1-3") == 1);
  CHECK(count_holding(told, "the scene is out of view in frames 1-3: none of its " + count +
                                " Gaussians has its "
                                "centre in the image, which tells nothing of it there") == 1);
  const std::vector<Camera> cameras = read_cameras("run/cameras.json");
  for (const Camera& camera : cameras)
    CHECK((camera.camera_from_world.translation - cameras[0].camera_from_world.translation).norm() < 1e-9);
}

TEST_CASE("a camera that sees nothing at all is refused before anything is written", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  Camera camera = read_camera(dataset.file("camera.json"));
  for (const Index row : {0, 2}) {  // y up and z backwards, as OpenGL has them, but for the sign of y
    camera.camera_from_world.rotation.row(row) *= -1;
    camera.camera_from_world.translation[row] *= -1;
  }
  write_camera(dataset.file("camera.json"), camera);
  dataset.check_refused(dataset.file("camera.json") +
                        ": nothing is in view in frame 0, neither scene nor human nor objects. The pose must be "
                        "camera_from_world in OpenCV's axes (x right, y down, z forward), in metres");
}

TEST_CASE("masks that cover everything leave the camera where it is, which is told", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  dataset.write_masks("human", of_one_value(1));
  CHECK(dataset.run("run") ==
        Texts{"stage camera: what the losses see did not depend on the group \"camera\"" + kNoGradient + "frames 1-3"});
}

TEST_CASE("masks that show nothing of the human are told with their frames", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  write_image(dataset.file("masks/human/0002.png"), of_one_value(0));
  CHECK(dataset.run("run") ==
        Texts{dataset.file("masks/human") + ": the human is hidden in frame 2: no pixel reaches data.mask_threshold"});
  CHECK(json_of("run/status.json")["state"] == "done");
}

TEST_CASE("an object or a human whose mask shows nothing in a frame is not drawn away by the loss mask", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  write_changed(dataset.file("config.json"), dataset.file("config.json"), [](nlohmann::ordered_json& config) {
    config["stages"]["interaction"]["losses"]["mask"] = {{"weight", 1}};
  });
  CHECK(dataset.run("whole").empty());
  const RunSummary whole = parse_summary(file_text("whole/summary.json"), "whole");
  const auto error_in = [](const RunSummary& summary, std::size_t frame, const char* name) {
    return number_in(summary.per_frame.at(frame - 1).values, name);
  };
  SECTION("an object") {
    write_image(dataset.file("masks/watering_can/0002.png"), of_one_value(0));
    CHECK(dataset.run("run") == Texts{dataset.file("masks/watering_can") +
                                      ": the object is hidden in frame 2: no pixel reaches data.mask_threshold; "
                                      "the losses \"center\", \"mask\" are off for it there"});
    CHECK_THAT(file_text("run/log.txt"), Contains(", mask without watering_can in 11 of 11 evaluations\n"));
    const double before = error_in(whole, 2, "object_translation_cm"),
                 now = error_in(parse_summary(file_text("run/summary.json"), "run"), 2, "object_translation_cm");
    INFO("object off by " << before << " cm with all masks, " << now << " cm without one");
    CHECK(now < before + 0.5);
  }
  SECTION("the human") {
    write_image(dataset.file("masks/human/0002.png"), of_one_value(0));
    CHECK(dataset.run("run") ==
          Texts{dataset.file("masks/human") + ": the human is hidden in frame 2: no pixel reaches data.mask_threshold; "
                                              "the loss \"mask\" is off for it there"});
    CHECK_THAT(file_text("run/log.txt"), Contains(", mask without the human in 11 of 11 evaluations\n"));
    const double before = error_in(whole, 2, "root_translation_mm"),
                 now = error_in(parse_summary(file_text("run/summary.json"), "run"), 2, "root_translation_mm");
    INFO("root off by " << before << " mm with all masks, " << now << " mm without one");
    CHECK(now < before + 15);
  }
}

TEST_CASE("channels are rendered only for terms that are on and read them", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  const auto channels = [&](const std::string& mask, const std::string& out, const Texts& overrides) {
    write_changed(TinyDataset::folder() / "config.json", dataset.file("config.json"), [&](nlohmann::ordered_json& c) {
      if (!mask.empty()) c["stages"]["interaction"]["losses"]["mask"] = nlohmann::ordered_json::parse(mask);
    });
    dataset.run(out, overrides);
    std::vector<int> counts;
    for (const nlohmann::json& line : metrics_of(out)) {
      const int count = line.at("channels").get<int>();
      if (line["stage"] == "camera") CHECK(count == 3);
      if (line["stage"] == "interaction" && (counts.empty() || counts.back() != count)) counts.push_back(count);
    }
    return counts;
  };
  const std::string no_center = "stages.interaction.losses.center.weight=0";
  CHECK(channels(R"({})", "both", {}) == std::vector<int>{5});
  CHECK(channels(R"({"human": false})", "objects", {}) == std::vector<int>{4});
  CHECK(channels(R"({"objects": false})", "human", {no_center}) == std::vector<int>{4});
  CHECK(channels(R"({"weight": 0})", "center", {}) == std::vector<int>{4});
  CHECK(channels("", "none", {no_center}) == std::vector<int>{3});
}

TEST_CASE("frames and masks with numbers that are not finite are refused before anything is written", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  SECTION("a frame") {
    Image frame = read_image(dataset.file("frames/0002.png"));
    frame(1, 5, 7) = std::numeric_limits<float>::quiet_NaN();
    write_as_exr(dataset.file("frames/0002.png"), frame);
    dataset.check_refused(dataset.file("frames/0002.png") +
                          ": the number at row 5, column 7, channel 1 is NaN; frames and masks hold finite numbers");
  }
  SECTION("a mask") {
    Image mask = of_one_value(0);
    mask(0, 40, 0) = std::numeric_limits<float>::infinity();
    write_as_exr(dataset.file("masks/watering_can/0001.png"), mask);
    dataset.check_refused(
        dataset.file("masks/watering_can/0001.png") +
        ": the number at row 40, column 0, channel 0 is infinite; frames and masks hold finite numbers");
  }
  SECTION("floats that are finite are read as they are") {
    for (const char* name : {"frames/0001.png", "frames/0003.png"})
      write_as_exr(dataset.file(name), read_image(dataset.file(name)));
    CHECK(dataset.run("run").empty());
    execute_tiny(tiny_config(), "plain");
    CHECK(file_text("run/motion.npz") == file_text("plain/motion.npz"));
  }
}

TEST_CASE("a folder of frames in another format is told, and numbers that leave a gap", "[run]") {
  const TemporaryFolder here;
  const Spoilt dataset;
  SECTION("JPEG") {
    fs::remove_all(dataset.path / "frames");
    fs::create_directory(dataset.path / "frames");
    for (const char* name : {"frames/0000.jpg", "frames/0001.jpg", "frames/0002.JPG", "frames/notes"})
      std::ofstream(dataset.file(name)) << "x";
    dataset.check_refused(
        dataset.file("frames") +
        ": holds 0 .png files; a clip needs at least 2 frames; its 1 .JPG, 2 .jpg files are not read");
  }
  SECTION("a frame is missing, and the motion is of frame 0 alone") {
    const auto remove_frame = [&](const std::string& name) {
      for (const char* folder : {"frames/", "masks/human/", "masks/watering_can/"})
        fs::remove(dataset.path / (folder + name));
    };
    remove_frame("0002.png");
    fs::remove_all(dataset.path / "truth");
    Motion motion = read_motion(dataset.file("initial_motion.npz"));
    motion.poses.resize(1);
    write_motion(dataset.file("initial_motion.npz"), motion);
    RunConfig config = dataset.config({"data.truth=", "data.surface="});
    CHECK(warnings_of([&] { read_clip(config.data); }) ==
          Texts{dataset.file("frames") +
                ": \"0001.png\" is followed by \"0003.png\"; frames count as equally far apart in time, so one seems "
                "to be missing"});
    remove_frame("0000.png");  // 1 and 3 are left
    CHECK(warnings_of([&] { read_clip(config.data); }).empty());
  }
}

}  // namespace unseen_test
