// The protocol of outside services, tried with the stand-ins of tools/services, which are run for real: the whole path
// from a config without video, masks and poses to a result, and what happens when a service fails.
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>

#include <catch2/catch.hpp>

#include "body/motion_edit.h"
#include "core/rotation.h"
#include "core/video.h"
#include "optim/metrics.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/pose_estimate.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace services_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;
namespace fs = std::filesystem;

namespace {

using Names = std::vector<std::string>;

/// A Python with NumPy, Debian's or the first one of PATH. Fails the test where there is none.
std::string python() {
  setenv("PYTHONDONTWRITEBYTECODE", "1", 1);
  for (const char* const program : {"/usr/bin/python3", "python3"}) {
    if (std::system((std::string(program) + " -c 'import numpy' 2> /dev/null").c_str()) == 0) return program;
  }
  FAIL("there is no python3 with NumPy; python3-numpy of tools/packages.txt has it");
  return "";
}

std::string stand_in(const std::string& name) {
  return (fs::path(HSI4D_SOURCE_DIR) / "tools" / "services" / "stand_in" / name).string();
}

std::string data(const std::string& name) { return (TinyDataset::folder() / name).string(); }

/// The state of frame 0 with its motion cut to that frame: all else is to be estimated.
void write_initial_alone() {
  Motion motion = read_motion(data("initial_motion.npz"));
  motion.poses.resize(1);
  write_motion("first.npz", motion);
  write_changed(TinyDataset::folder() / "initial.json", "initial.json", [](auto& initial) {
    initial["motion"] = "first.npz";
    initial.erase("object_tracks");
  });
}

/// A config of the tiny dataset that has video, masks and poses made.
struct Services {
  TemporaryFolder here;
  nlohmann::json config;

  Services() {
    write_initial_alone();
    config = {{"extends", tiny_config_file()},
              {"data", {{"frames", ""}, {"masks", ""}, {"initial", "initial.json"}, {"video_rate", 10}}},
              {"stages", {{"camera", {{"iterations", 1}}}, {"interaction", {{"iterations", 1}}}}},
              {"sources", {{"prompt", "A person lifts a can"}}}};
    set("video", {stand_in("video.py"), "--image", "{first_frame}", "--prompt", "{prompt}", "--out", "{out}", "--clip",
                  data("frames")});
    config["sources"]["video"]["output"] = "frames";
    set("masks", {stand_in("masks.py"), "--video", "{video}", "--objects", "{objects}", "--first", "{first_masks}",
                  "--out", "{out}"});
    set("motion", {stand_in("poses.py"), "--video", "{video}", "--out", "{out}", "--motion", data("truth/motion.npz"),
                   "--turn", "120", "--move", "5,-3,0.4", "--noise", "1"});
    for (const char* part : {"video", "masks", "motion"}) config["sources"][part]["retry_wait_s"] = 0.05;
  }

  nlohmann::json& part(const std::string& name) { return config["sources"][name]; }
  /// @param command  a stand-in and its arguments
  void set(const std::string& name, const Names& command) {
    part(name)["command"] = {python()};
    add(name, command);
  }
  void add(const std::string& name, const Names& words) {
    for (const std::string& word : words) part(name)["command"].push_back(word);
  }

  ProgramResult run(const std::string& out, const Names& more = {}) const {
    std::ofstream("config.json") << config.dump(2);
    Names words = {"run", "config.json", "--threads", "1", "--out", out};
    words.insert(words.end(), more.begin(), more.end());
    return run_hsi4d(words);
  }
};

std::size_t lines_in(const std::string& file) {
  const std::string text = fs::exists(file) ? file_text(file) : "";
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

Names made(const std::string& ending) {
  Names names;
  for (const auto& entry : fs::directory_iterator("generated")) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(ending)) names.push_back(name);
  }
  return names;
}

/// The largest angle between the same joints of two poses, radians.
double largest_turn(const BodyPose& a, const BodyPose& b) {
  double most = 0;
  for (Index j = 0; j < a.joints(); ++j) {
    const Matrix3<double> turn = so3_exp(a.rotation_of(j)).transpose() * so3_exp(b.rotation_of(j));
    most = std::max(most, so3_log(turn).norm());
  }
  return most;
}

}  // namespace

TEST_CASE("a run has video and masks and poses made by services", "[run]") {
  Services services;
  const ProgramResult plan = services.run("run", {"--dry-run"});
  INFO(plan.err);
  CHECK_THAT(plan.out, Contains("would run " + python() + ", " + stand_in("video.py")) &&
                           Contains("would then run " + python() + ", " + stand_in("masks.py")) &&
                           Contains("would then run " + python() + ", " + stand_in("poses.py")));
  CHECK_FALSE(fs::exists("generated"));
  const ProgramResult result = services.run("run");
  INFO(result.err);
  REQUIRE(result.status == 0);
  CHECK(made(".npz").size() == 1);
  CHECK(made(".npz.json").size() == 1);
  CHECK(temporaries_in("generated").empty());
  CHECK_THAT(file_text("run/log.txt"), Contains("motion: runs " + python() + ", " + stand_in("poses.py")));

  // The estimate is laid on frame 0: what the run begins with is the truth but for the noise.
  DataSettings inputs = dataset_inputs(TinyDataset::folder());
  inputs.initial = fs::absolute("initial.json");
  inputs.motion = fs::absolute("generated") / made(".npz").front();
  const Clip clip = read_clip(inputs);
  REQUIRE(clip.estimate.size() == 4);
  REQUIRE(clip.truth);
  const BodyPose first = read_motion_for("first.npz", clip.avatar).poses.front();
  CHECK(clip.estimate[0].axis_angle == first.axis_angle);
  for (std::size_t t = 1; t < 4; ++t) {
    const BodyPose& truth = (*clip.truth)[t].body;
    CHECK((clip.estimate[t].transl - truth.transl).norm() < 0.05);
    CHECK(largest_turn(clip.estimate[t], truth) < 0.2);
    CHECK(largest_turn(clip.estimate[t], truth) > 0.001);
  }
  inputs.motion_align = MotionAlign::kNone;
  CHECK((read_clip(inputs).estimate[1].transl - (*clip.truth)[1].body.transl).norm() > 3);

  // All is there: nothing is made again, not after other waits either, and without the programs.
  services.add("video", {"--count", "video.txt"});  // a command of its own: made once more
  REQUIRE(services.run("again").status == 0);
  CHECK(lines_in("video.txt") == 1);
  services.part("video")["timeout_s"] = 5;
  services.part("video")["retries"] = 7;
  services.part("motion")["retry_on"] = "any";
  CHECK(services.run("third").status == 0);
  CHECK(lines_in("video.txt") == 1);
  CHECK(made(".npz").size() == 1);  // the same video has the same poses, whoever made it
}

TEST_CASE("a service that makes a film of the first frame is enough", "[run]") {
  Services services;
  services.set("video", {stand_in("video.py"), "--image", "{first_frame}", "--prompt", "{prompt}", "--out", "{out}",
                         "--frames", "4", "--rate", "10"});
  services.part("video")["output"] = "mp4";
  services.part("video")["frames"] = 4;
  services.part("motion")["command"] = nlohmann::json::array();
  const ProgramResult result = services.run("run");
  INFO(result.err);
  CHECK(result.status == 0);
  CHECK(made(".mp4").size() == 1);
  CHECK(VideoReader("generated/" + made(".mp4").front()).frames() == 4);
}

TEST_CASE("a service that could not now is asked again", "[run]") {
  Services services;
  services.part("masks")["command"] = nlohmann::json::array();
  services.config["data"]["masks"] = data("masks");
  services.part("motion")["command"] = nlohmann::json::array();
  const std::string program = "/sources/video: " + python();
  SECTION("and then it can") {
    services.add("video", {"--fail", "75", "--fail-first", "2", "--count", "count.txt"});
    const ProgramResult result = services.run("run");
    INFO(result.err);
    CHECK(result.status == 0);
    CHECK(lines_in("count.txt") == 3);
    CHECK_THAT(
        result.err,
        Contains(program + ": ended with status 75:\nfails on purpose, time 1\nIt is run again in 0.05 s, 1 of 2") &&
            Contains("time 2\nIt is run again in 0.1 s, 2 of 2"));
    CHECK_THAT(file_text("run/log.txt"), Contains("It is run again in 0.1 s, 2 of 2"));
  }
  SECTION("as often as it says") {
    services.add("video", {"--fail", "75", "--count", "count.txt"});
    const ProgramResult result = services.run("run");
    CHECK(result.status == 2);
    CHECK_THAT(result.err,
               Contains(program + ": ended with status 75:\nfails on purpose, time 3\nIt was run 3 times.\n"));
    CHECK(lines_in("count.txt") == 3);
    CHECK_FALSE(fs::exists("run"));
    CHECK(made("").empty());
  }
  SECTION("after other failures only where that is wanted") {
    services.add("video", {"--fail", "1", "--fail-first", "1", "--count", "count.txt"});
    const ProgramResult once = services.run("run");
    CHECK(once.status == 2);
    CHECK_THAT(once.err,
               Contains(program + ": ended with status 1:\nfails on purpose, time 1\n") && !Contains("times."));
    CHECK(lines_in("count.txt") == 1);
    fs::remove("count.txt");
    services.part("video")["retry_on"] = "any";
    CHECK(services.run("run").status == 0);
    CHECK(lines_in("count.txt") == 2);
  }
  SECTION("not where it was asked wrongly") {
    services.add("video", {"--fail", "2", "--count", "count.txt"});
    services.part("video")["retry_on"] = "any";
    CHECK(services.run("run").status == 2);
    CHECK(lines_in("count.txt") == 1);
  }
  SECTION("when it hangs") {
    services.add("video", {"--hang", "--fail-first", "1", "--count", "count.txt"});
    services.part("video")["timeout_s"] = 4;
    services.part("video")["retry_on"] = "any";
    const ProgramResult result = services.run("run");
    CHECK(result.status == 0);
    CHECK_THAT(result.err,
               Contains(program +
                        ": was ended after 4 seconds, which is all the time it has:\nwaits for ever\nIt is run again"));
    CHECK(lines_in("count.txt") == 2);
  }
  SECTION("when it writes nothing") {
    services.add("video", {"--empty", "--fail-first", "1", "--count", "count.txt"});
    services.part("video")["retry_on"] = "any";
    const ProgramResult result = services.run("run");
    CHECK(result.status == 0);
    CHECK_THAT(result.err, Contains("ended with status 0 and wrote nothing at {out}"));
    CHECK(lines_in("count.txt") == 2);
  }
}

TEST_CASE("poses that do not fit the video are refused and kept", "[run]") {
  Services services;
  services.part("masks")["command"] = nlohmann::json::array();
  services.config["data"]["masks"] = data("masks");
  services.set("motion", {stand_in("poses.py"), "--video", "{video}", "--out", "{out}", "--motion", "short.npz"});
  Motion motion = read_motion(data("truth/motion.npz"));
  motion.poses.resize(3);
  write_motion("short.npz", motion);
  const ProgramResult result = services.run("run");
  CHECK(result.status == 2);
  CHECK_THAT(result.err,
             Contains("/sources/motion: " + python() + " wrote what cannot be used, kept as ") &&
                 Contains("holds 3 poses, the video has 4 frames; allowed: that many; it printed nothing\n"));
  CHECK(made(".refused.npz").size() == 1);
  services.config["data"]["motion"] = data("truth/motion.npz");
  CHECK_THAT(services.run("run").err, Contains("/data/motion: given, and /sources/motion makes it too; remove one\n"));
}

TEST_CASE("an estimate is laid on the human of frame 0") {
  Motion motion = read_motion(data("truth/motion.npz"));
  const Vector3<double> pelvis(0.01, -0.3, 0.02);
  const std::vector<BodyPose> truth = motion.poses;
  const auto laid = [&](const Rigid<double>& world, MotionAlign align) {
    return laid_on(transformed(motion, world, pelvis).poses, truth.front(), pelvis, align);
  };
  const auto differs = [&](const std::vector<BodyPose>& poses) {
    double most = 0;
    for (std::size_t t = 0; t < truth.size(); ++t)
      most = std::max({most, largest_turn(poses[t], truth[t]), (poses[t].transl - truth[t].transl).norm()});
    return most;
  };
  const Rigid<double> turned{so3_exp(Vector3<double>(0, 0, 2.5)), {3, -2, 1}};
  const Rigid<double> tilted{so3_exp(Vector3<double>(0.3, -0.2, 2.5)), {3, -2, 1}};
  CHECK(differs(laid(turned, MotionAlign::kHeading)) < 1e-9);
  CHECK(differs(laid(turned, MotionAlign::kRotation)) < 1e-9);
  CHECK(differs(laid(tilted, MotionAlign::kRotation)) < 1e-9);
  CHECK(differs(laid(tilted, MotionAlign::kHeading)) > 0.1);  // the estimator's vertical is kept
  CHECK(differs(laid(turned, MotionAlign::kNone)) > 1);
  for (const MotionAlign align : {MotionAlign::kHeading, MotionAlign::kRotation, MotionAlign::kNone}) {
    CHECK(laid(tilted, align).front().axis_angle == truth.front().axis_angle);
    CHECK(laid(tilted, align).front().transl == truth.front().transl);
  }
  // Heading: the turn about the vertical that leaves the least angle.
  BodyPose first = truth.front();
  first.set_rotation(0, so3_log<double>(so3_exp(Vector3<double>(0.2, 0.1, 0)) * so3_exp(first.rotation_of(0))));
  motion.poses = {truth.front(), truth.front()};
  const auto left = [&](const BodyPose& pose) {
    return so3_log<double>(so3_exp(pose.rotation_of(0)).transpose() * so3_exp(first.rotation_of(0))).norm();
  };
  const BodyPose best = laid_on(transformed(motion, turned, pelvis).poses, first, pelvis, MotionAlign::kHeading)[1];
  for (const double more : {-0.05, 0.05}) {
    BodyPose other = best;
    other.set_rotation(0, so3_log<double>(so3_exp(Vector3<double>(0, 0, more)) * so3_exp(best.rotation_of(0))));
    CHECK(left(best) < left(other));
  }
}

}  // namespace services_test
