#include <fstream>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "body/motion_io.h"
#include "core/camera_file.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "pipelines/input/state.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace errors_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// A folder with a copy of the dataset, to be spoilt, and the run of it.
class SpoiltDataset {
 public:
  SpoiltDataset() { fs::copy(TinyDataset::folder(), data(), fs::copy_options::recursive); }

  fs::path data() const { return folder_.path() / "data"; }
  std::string file(const std::string& name) const { return (data() / name).string(); }

  ProgramResult run(std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"run", file("config.json"), "--out", "run", "--threads", "1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_hsi4d(arguments);
  }

  /// The line of config.json that a text is in.
  std::string line_of(const std::string& text) const {
    const std::string config = file_text(file("config.json"));
    return std::to_string(1 + std::count(config.begin(), config.begin() + static_cast<int>(config.find(text)), '\n'));
  }

  /// Changes config.json.
  template <class F>
  void edit_config(F&& change) const {
    write_changed(file("config.json"), file("config.json"), change);
  }

 private:
  TemporaryFolder folder_;
};

/// The run is refused with this message, told once at the end, before anything is written.
void check_failure(const SpoiltDataset& dataset, const std::string& message) {
  const ProgramResult result = dataset.run();
  CHECK(result.status == 2);
  CHECK(result.out.empty());
  CHECK_THAT(result.err, Catch::Matchers::EndsWith(message + "\n"));
  CHECK(result.err.find(message) == result.err.rfind(message));
  CHECK_FALSE(fs::exists("run"));
}

/// The run is refused with this message before anything is written.
void check_refusal(const ProgramResult& result, const std::string& message) {
  CHECK(result.status == 2);
  CHECK(result.out.empty());
  CHECK(result.err == message + "\n");
}

struct NoSettings {};
void describe(ConfigFields&, NoSettings&) {}

Image black(int width, int height, int channels = 3) { return Image(channels, height, width); }

}  // namespace

TEST_CASE("inputs that are not given are all told before anything is written", "[run]") {
  const TemporaryFolder here;
  here.write("empty.json", "{}");
  const std::string inputs =
      "/data: no inputs are given; a run needs scene, avatar, frames, masks, camera, initial. `hsi4d synth` makes a "
      "dataset with a config beside it to run; `hsi4d demo` makes one and runs it";
  const std::string both =
      "2 problems in empty.json:\nempty.json:1: /stages: a run needs at least one stage\nempty.json:1: " + inputs;
  check_refusal(run_hsi4d({"run", "empty.json", "--out", "run"}), both);
  check_refusal(run_hsi4d({"run", "empty.json", "--dry-run"}), both);
  here.write("tiny.json", kTinyStages);
  CHECK(run_hsi4d({"run", "tiny.json", "--out", "run"}).err == "tiny.json:1: " + inputs + "\n");
  here.write("instance.json",
             R"({"extends": "tiny.json", "instance": {"scene": "Room", "type": "indoor", "source": "made",
    "object": "static", "prompt": "A person sits.", "folder": "nowhere"}})");
  CHECK_THAT(run_hsi4d({"run", "instance.json", "--out", "run"}).err,
             Contains("/data: no inputs are given, and /instance/folder is no folder (" +
                      (here.path() / "nowhere").string() + "); a run"));
  CHECK(run_hsi4d({"run", tiny_config_file(), "--out", "run", "--set", "data.masks=", "--set", "data.frames="}).err ==
        "2 problems:\n"
        "--set data.masks=: /data/masks: not given; a run needs masks of the human and the objects\n"
        "--set data.frames=: /data/frames: not given; a run needs the frames of a video\n");
  CHECK_FALSE(fs::exists("run"));
  const ProgramResult missing = run_hsi4d({"run", tiny_config_file(), "--set", "data.scene=none.ply"});
  check_refusal(missing, "--set data.scene=none.ply: /data/scene: \"none.ply\" does not exist (looked for none.ply)");
}

TEST_CASE("stages that cannot work are refused before anything is written", "[run]") {
  const SpoiltDataset dataset;
  dataset.edit_config([](nlohmann::ordered_json& config) {
    config["stages"]["camera"]["optimize"]["transl"] = {{"lr", 0.1}};
    config["stages"]["interaction"]["optimize"] = {{"bodypose", {{"lr", 0.1}}}};
    config["stages"]["last"] = {{"iterations", 1}, {"optimize", nlohmann::ordered_json::object()}};
  });
  const ProgramResult result = dataset.run();
  CHECK(result.status == 2);
  CHECK_THAT(result.err,
             Contains("/stages/camera/optimize/transl: there is no such parameter group; known here: camera\n"));
  CHECK_THAT(result.err, Contains("/stages/interaction/optimize/bodypose: there is no such parameter group; did you "
                                  "mean \"body_pose\"?\n"));
  CHECK_THAT(result.err, Contains("/stages/last/optimize: no parameter group is named; known here: "));
  CHECK_THAT(result.err, Contains("/stages/last/losses: a stage needs a loss\n"));
  CHECK_FALSE(fs::exists("run"));
  CHECK(dataset.run({"--dry-run"}).err == result.err);
}

TEST_CASE("a damaged file that a loss names is found before anything is written, by check too", "[run]") {
  const SpoiltDataset dataset;
  std::ofstream(dataset.file("vposer.npz")) << "no archive";
  dataset.edit_config([](nlohmann::ordered_json& config) {
    config["stages"]["interaction"]["losses"]["pose_prior"]["weights"] = "vposer.npz";
  });
  const std::string place = dataset.file("config.json") + ":" + dataset.line_of("\"vposer.npz\"") +
                            ": /stages/interaction/losses/pose_prior/weights: " + dataset.file("vposer.npz") + ": ";
  const ProgramResult run = dataset.run();
  check_refusal(run, place + "looks like text, not like a .npz archive");
  CHECK(dataset.run({"--dry-run"}).err == run.err);
  CHECK(run_hsi4d({"check", dataset.file("config.json")}).err == run.err);
  CHECK_FALSE(fs::exists("run"));
  const RunConfig config = load_run_config(dataset.file("config.json"), {}, descriptions_of(loss_terms()));
  CHECK_THROWS_WITH(execute_tiny(config, "run"),
                    "/stages/interaction/losses/pose_prior/weights: " + dataset.file("vposer.npz") +
                        ": looks like text, not like a .npz archive");
  CHECK_FALSE(fs::exists("run"));
}

TEST_CASE("what a loss reads is read once in a run", "[run]") {
  static int reads = 0;
  const TemporaryFolder here;
  std::vector<LossTerm> terms = loss_terms();
  terms.push_back(make_loss_term<NoSettings>(
      "counted", "Counts what it reads", [](const NoSettings&) { return ++reads; },
      [](const auto& in, int) { return mean(square(in.rendered - in.target)); }));
  const RunConfig config =
      load_run_config(tiny_config_file(), {R"(stages.interaction.losses={"counted": {}})"}, descriptions_of(terms));
  CHECK(reads == 0);
  execute_run(config, terms, {.folder = "run", .threads = 1, .observer = {}});
  CHECK(reads == 1);  // over three frames
}

TEST_CASE("losses of what a stage does not draw are refused, as parameters are", "[run]") {
  const SpoiltDataset dataset;
  dataset.edit_config([](nlohmann::ordered_json& config) {
    config["stages"]["camera"]["losses"]["joint_limits"] = {{"weight", 0.25}};
    config["stages"]["camera"]["losses"]["depth"] = {{"weight", 0}};
  });
  check_refusal(dataset.run(), dataset.file("config.json") + ":" + dataset.line_of("\"joint_limits\"") +
                                   ": /stages/camera/losses/joint_limits: this loss needs the body, which a stage with "
                                   "\"draw\": \"scene\" does not have");
}

TEST_CASE("an object's name must not be the human's", "[run]") {
  const SpoiltDataset dataset;
  dataset.edit_config([](nlohmann::ordered_json& config) {
    config["data"]["objects"] = {{"human", config["data"]["objects"][kTinyObject]}};
  });
  const std::string place = dataset.file("config.json") + ":" + dataset.line_of("\"human\"") + ": ";
  check_refusal(dataset.run(),
                place + "/data/objects/human: \"human\" is the folder of the human's masks; use another name");
  CHECK_FALSE(fs::exists("run"));
}

TEST_CASE("frames and masks of the wrong size are told before anything is written", "[run]") {
  const SpoiltDataset dataset;
  SECTION("a frame") {
    write_image(dataset.file("frames/0002.png"), black(40, 48));
    check_failure(dataset,
                  dataset.file("frames/0002.png") + ": is 40x48 with 3 channels; the camera's image is 48x48 with 3");
  }
  SECTION("a frame without colours") {
    write_image(dataset.file("frames/0001.png"), black(48, 48, 1));
    check_failure(dataset,
                  dataset.file("frames/0001.png") + ": is 48x48 with 1 channels; the camera's image is 48x48 with 3");
  }
  SECTION("the human's mask") {
    write_image(dataset.file("masks/human/0001.png"), black(48, 24, 1));
    check_failure(dataset, dataset.file("masks/human/0001.png") + ": is 48x24 pixels, the camera's image 48x48");
  }
  SECTION("an object's mask of frame 0") {
    write_image(dataset.file("masks/watering_can/0000.png"), black(47, 48, 1));
    check_failure(dataset, dataset.file("masks/watering_can/0000.png") + ": is 47x48 pixels, the camera's image 48x48");
  }
}

TEST_CASE("inputs of another length are told with both", "[run]") {
  const SpoiltDataset dataset;
  SECTION("truth of the motion") {
    Motion motion = read_motion(dataset.file("truth/motion.npz"));
    motion.poses.resize(3);
    write_motion(dataset.file("truth/motion.npz"), motion);
    check_failure(dataset,
                  dataset.file("truth/motion.npz") + ": holds 3 poses, the video has 4 frames; allowed: that many");
  }
  SECTION("truth of the cameras") {
    std::vector<Camera> cameras = read_cameras(dataset.file("truth/cameras.json"));
    cameras.push_back(cameras.front());
    write_cameras(dataset.file("truth/cameras.json"), cameras);
    check_failure(dataset,
                  dataset.file("truth/cameras.json") + ": holds 5 cameras, the video has 4 frames; allowed: that many");
  }
  SECTION("truth of the objects") {
    std::vector<SceneState> frames(2);
    for (SceneState& frame : frames) frame.objects.resize(1);
    write_object_tracks(dataset.file("truth/objects.npz"), {kTinyObject}, frames);
    check_failure(dataset,
                  dataset.file("truth/objects.npz") + ": holds 2 frames, the video has 4 frames; allowed: that many");
  }
  SECTION("the estimate") {
    Motion motion = read_motion(dataset.file("initial_motion.npz"));
    motion.poses.resize(2);
    write_motion(dataset.file("initial_motion.npz"), motion);
    check_failure(dataset, dataset.file("initial_motion.npz") +
                               ": holds 2 poses, the video has 4 frames; allowed: that many, or frame 0 alone");
  }
  SECTION("the video") {
    for (const char* name : {"frames/0001.png", "frames/0002.png", "frames/0003.png"}) fs::remove(dataset.file(name));
    check_failure(dataset, dataset.file("frames") + ": holds 1 .png files; a clip needs at least 2 frames");
  }
}

TEST_CASE("an object without a pose is told", "[run]") {
  const SpoiltDataset dataset;
  fs::copy_file(dataset.file("objects/watering_can.ply"), dataset.file("objects/box.ply"));
  dataset.edit_config([](nlohmann::ordered_json& config) {
    config["data"]["objects"]["box"] = {{"gaussians", "objects/box.ply"}};
  });
  check_failure(dataset, dataset.file("initial.json") + ": /objects: there is no pose of the object \"box\"");
}

TEST_CASE("a folder of masks that is not there is an error, a mask that is not there a warning", "[run]") {
  const SpoiltDataset dataset;
  fs::remove(dataset.file("masks/watering_can/0002.png"));
  const ProgramResult result = dataset.run();
  CHECK(result.status == 0);
  CHECK_THAT(result.err, Contains("hsi4d: warning: " + dataset.file("masks/watering_can") +
                                  ": has no mask for 1 of 4 frames; these count as empty\n"));
  fs::remove_all("run");
  fs::remove_all(dataset.file("masks/watering_can"));
  check_failure(dataset, dataset.file("masks/watering_can") +
                             ": there is no such folder of masks, nor a video \"watering_can.mp4\"");
}

TEST_CASE("a folder that holds a run is not run into, and resumed with its own config only", "[run]") {
  const SpoiltDataset dataset;
  CHECK(dataset.run().status == 0);
  const auto before = result_of("run");
  const std::string status = file_text("run/status.json");
  check_refusal(dataset.run(),
                "run: holds a run that is done; choose another folder, remove this one, or go on with it "
                "by --resume");
  check_refusal(dataset.run({"--resume", "--seed", "3", "--set", "stages.camera.iterations=9"}),
                "run/config.resolved.json: the run cannot be resumed, its config is another one:\n"
                "  /seed: 0 in the folder, 3 now\n"
                "  /stages/camera/iterations: 8 in the folder, 9 now");
  CHECK(result_of("run") == before);
  CHECK(file_text("run/status.json") == status);
}

TEST_CASE("a damaged checkpoint is told, and how to go on without it", "[run]") {
  const SpoiltDataset dataset;
  CHECK(dataset.run().status == 0);
  const auto before = result_of("run");
  const std::string file = "run/checkpoint/progress.npz";
  SECTION("cut short") {
    fs::resize_file(file, 1000);
    const ProgramResult result = dataset.run({"--resume"});
    CHECK(result.status == 2);
    const std::string message = file +
                                ": cannot be read as a zip archive: Not a zip archive; without this file the run "
                                "begins anew";
    CHECK_THAT(result.err, Catch::Matchers::EndsWith(message + "\n"));
    check_has_failed("run", message);
  }
  SECTION("bits flipped") {
    std::string bytes = file_text(file);
    // More than the head of an entry, of whose times nobody asks.
    for (std::size_t i = bytes.size() / 2; i < bytes.size() / 2 + 200; ++i) bytes[i] = static_cast<char>(bytes[i] ^ 4);
    std::ofstream(file, std::ios::binary) << bytes;
    const ProgramResult result = dataset.run({"--resume"});
    CHECK(result.status == 2);
    CHECK_THAT(result.err, Contains(file + ": ") && Contains("; without this file the run begins anew\n"));
  }
  fs::remove(file);
  CHECK(dataset.run({"--resume"}).status == 0);
  CHECK(result_of("run") == before);
}

TEST_CASE("a checkpoint of other inputs is refused", "[run]") {
  const SpoiltDataset dataset;
  fs::remove_all(dataset.data() / "truth");
  dataset.edit_config([](nlohmann::ordered_json& config) { config["data"].erase("truth"); });
  CHECK(dataset.run().status == 0);
  fs::remove(dataset.file("frames/0003.png"));
  Motion motion = read_motion(dataset.file("initial_motion.npz"));
  motion.poses.resize(3);
  write_motion(dataset.file("initial_motion.npz"), motion);
  const ProgramResult result = dataset.run({"--resume"});
  CHECK(result.status == 2);
  const std::string message =
      "run/checkpoint/progress.npz: 4 frames done, the clip has 3; without this file the run begins anew";
  CHECK_THAT(result.err, Catch::Matchers::EndsWith(message + "\n"));
  check_has_failed("run", message);
  CHECK_THAT(file_text("run/log.txt"), Contains("failed: " + message + "\n"));
}

}  // namespace errors_test
