// Chains of clips: each begins with the last state of the one before.
#include "pipelines/chain/chain.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/log.h"
#include "pipelines/chain/report.h"
#include "pipelines/input/state.h"
#include "tests/support/program.h"
#include "tests/support/tiny_chain.h"

namespace chain_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;
namespace fs = std::filesystem;

namespace {

constexpr int kAllFrames = kClips * (kClipFrames - 1) + 1;

template <class F>
std::string fault_of(F&& change) {
  try {
    check_chain(changed_config(change));
  } catch (const UserError& error) {
    return error.what();
  } catch (const DataError& error) {
    return error.what();
  }
  return "no fault";
}

const Motion motion_in(const fs::path& run) { return read_motion((run / "motion.npz").string()); }

bool same(const BodyPose& a, const BodyPose& b) { return a.transl == b.transl && a.axis_angle == b.axis_angle; }

}  // namespace

TEST_CASE("a chain of clips is one motion, and each of its clips a whole run", "[run][chain]") {
  const TemporaryFolder here;
  const RunConfig config = chain_config({"log.preview=true"});
  REQUIRE(config.chain.size() == kClips);
  CHECK(config.chain[1].data.scene == config.chain[0].data.scene);
  const ChainSummary summary = execute_tiny_chain(config, "run");

  for (const char* name : {"config.resolved.json", "status.json", "log.txt", "summary.json", "motion.npz",
                           "motion_30fps.npz", "objects.npz", "cameras.json", "body.glb", "preview.mp4", "report.html",
                           "clips/clip1/report.html", "clips/clip2/report.html", "starts/clip2.json"})
    CHECK(fs::exists(fs::path("run") / name));
  for (const char* name : {"metrics.jsonl", "frames", "checkpoint", "starts/clip1.json"})
    CHECK_FALSE(fs::exists(fs::path("run") / name));
  CHECK(temporaries_in("run").empty());
  CHECK(json_of("run/status.json")["state"] == "done");
  CHECK(json_of("run/clips/clip2/config.resolved.json")["name"] == "tiny: clip 2 of 2, clip2");

  const Motion all = motion_in("run"), first = motion_in("run/clips/clip1"), second = motion_in("run/clips/clip2");
  REQUIRE(all.poses.size() == kAllFrames);
  CHECK(same(second.poses.front(), first.poses.back()));  // bit for bit
  for (std::size_t t = 0; t < kAllFrames; ++t) {
    INFO("frame " << t);
    CHECK(same(all.poses[t], t < kClipFrames ? first.poses[t] : second.poses[t - kClipFrames + 1]));
  }
  const auto objects = read_object_tracks("run/objects.npz", {kTinyObject}),
             objects1 = read_object_tracks("run/clips/clip1/objects.npz", {kTinyObject}),
             objects2 = read_object_tracks("run/clips/clip2/objects.npz", {kTinyObject});
  REQUIRE(objects.size() == kAllFrames);
  CHECK(objects2.front()[0].translation == objects1.back()[0].translation);
  CHECK(objects2.front()[0].rotation == objects1.back()[0].rotation);
  CHECK(objects.back()[0].translation == objects2.back()[0].translation);

  // Each clip has its own camera: the one that it was given.
  const std::vector<Camera> cameras = read_cameras("run/cameras.json");
  REQUIRE(cameras.size() == kAllFrames);
  const Camera given = read_camera((TinyChain::folder() / "clips/clip2/camera.json").string());
  CHECK(read_cameras("run/clips/clip2/cameras.json").front().camera_from_world.rotation ==
        given.camera_from_world.rotation);
  const Matrix3<double> turn =
      cameras[kClipFrames].camera_from_world.rotation * cameras[kClipFrames - 1].camera_from_world.rotation.transpose();
  CHECK(std::acos((turn.trace() - 1) / 2) > 0.3);

  const nlohmann::json written = json_of("run/summary.json");
  CHECK(written["frames"] == kAllFrames);
  REQUIRE(written["clips"].size() == kClips);
  REQUIRE(written["joins"].size() == kClips - 1);
  CHECK(written["clips"][1]["name"] == "clip2");
  CHECK(written["clips"][1]["begin"] == kClipFrames - 1);
  CHECK(written["truth"] == true);
  CHECK(written["surface"] == json_of("run/clips/clip1/summary.json")["surface"]);
  CHECK(written["metrics"].size() == 2);
  CHECK(written["metrics"][1]["iterations"] == 2 * 10 * (kClipFrames - 1));
  REQUIRE(written["per_frame"].size() == kAllFrames - 1);
  double sum = 0;
  for (int t = 1; t < kAllFrames; ++t) {
    const nlohmann::json& frame = written["per_frame"][static_cast<std::size_t>(t - 1)];
    CHECK(frame["frame"] == t);
    sum += frame["world_mpjpe_mm"].get<double>();
  }
  CHECK(written["metrics"][1]["world_mpjpe_mm"].get<double>() == Approx(sum / (kAllFrames - 1)).epsilon(1e-12));
  const nlohmann::json& join = written["joins"][0];
  CHECK(join["frame"] == kClipFrames - 1);
  CHECK(join["jump_mm"] == 0);
  CHECK(join["jump_object_cm"] == 0);
  // The drift is the error of the last frame before, as the clips' truths agree there.
  CHECK(join["world_mpjpe_mm"].get<double>() ==
        Approx(written["per_frame"][kClipFrames - 2]["world_mpjpe_mm"].get<double>()).epsilon(1e-9));
  CHECK(join["world_mpjpe_mm"].get<double>() > 0);
  CHECK_FALSE(join.contains("camera_translation_cm"));
  CHECK(chain_summary_json(parse_chain_summary(file_text("run/summary.json"), "summary.json")) ==
        file_text("run/summary.json"));
  CHECK(chain_summary_json(summary) == file_text("run/summary.json"));
  CHECK_THAT(file_text("run/report.html"), Contains("href=\"clips/clip2/report.html\"") && Contains("clip1-clip2"));
  CHECK(is_chain_folder("run"));
  CHECK_FALSE(is_chain_folder("run/clips/clip2"));
}

TEST_CASE("a chain that was stopped anywhere and resumed has the bits of one that never was", "[run][chain][release]") {
  const TemporaryFolder here;
  const RunConfig config = chain_config({"stages.camera.iterations=3", "stages.interaction.iterations=3"});
  execute_tiny_chain(config, "run");
  fs::rename("run", "whole");  // the clips' configs name the folder
  for (const auto& [last, message] :
       {std::pair{13, "clip 1 of 2, clip1: interrupted after the last frame; frames 1 to 2 are finished and kept"},
        {19, "clip 2 of 2, clip2: interrupted in frame 1; no frame was finished"},
        {26, "clip 2 of 2, clip2: interrupted in frame 2; frame 1 is finished and kept"}}) {
    INFO("stopped at " << last);
    int count = 0;
    CHECK_THROWS_MATCHES(execute_tiny_chain(config, "run", 1, false, [&] { return ++count == last; }), Interrupted,
                         Message(message));
    CHECK(json_of("run/status.json")["state"] == "interrupted");
    CHECK(finished_clips(config, "run", loss_terms()) == (last < 19 ? 0 : 1));
    execute_tiny_chain(config, "run", 2, true);
    check_same_chains("run", "whole");
    fs::remove_all("run");
  }
}

TEST_CASE("a chain whose clips have two passes is resumed behind its first clip", "[run][chain]") {
  const TemporaryFolder here;
  const RunConfig config = changed_config([](auto& chain) {
    chain["passes"] = {{"count", 2}};
    for (const char* stage : {"camera", "interaction"}) chain["stages"][stage]["iterations"] = 2;
    chain["stages"]["refinement"] = nlohmann::ordered_json::parse(R"({
      "over": "sequence", "iterations": 2, "optimize": {"transl": {"lr": 0.001}}, "losses": {"fit": {}, "smooth": {}}})");
  });
  execute_tiny_chain(config, "run");
  fs::rename("run", "whole");
  int count = 0;
  CHECK_THROWS_AS(execute_tiny_chain(config, "run", 1, false,
                                     [&] { return fs::exists("run/clips/clip2/log.txt") && ++count == 5; }),
                  Interrupted);
  CHECK(finished_clips(config, "run", loss_terms()) == 1);
  execute_tiny_chain(config, "run", 2, true);
  check_same_chains("run", "whole");
}

TEST_CASE("a chain does not go on with a clip that is done of other frames", "[run][chain]") {
  const TemporaryFolder here;
  fs::copy(TinyChain::folder(), "data", fs::copy_options::recursive);
  const RunConfig config =
      load_run_config("data/config.json", {"stages.camera.iterations=1", "stages.interaction.iterations=1"},
                      descriptions_of(loss_terms()), ConfigUse::kRun);
  int count = 0;
  CHECK_THROWS_AS(execute_tiny_chain(config, "run", 1, false, [&] { return ++count == 12; }), Interrupted);
  CHECK(finished_clips(config, "run", loss_terms()) == 1);
  fs::copy_file("data/clips/clip1/frames/0001.png", "data/clips/clip1/frames/0002.png",
                fs::copy_options::overwrite_existing);
  const std::string message =
      "clip 1 of 2, clip1: " + fs::absolute("data/clips/clip1/frames/0002.png").string() +
      ": is not what the run began with (frames/0002.png)\nrun/clips/clip1/checkpoint/progress.npz: goes on with the "
      "inputs as they were; without it the run begins anew";
  CHECK_THROWS_MATCHES(finished_clips(config, "run", loss_terms()), DataError, Message(message));
  CHECK_THROWS_MATCHES(execute_tiny_chain(config, "run", 1, true), DataError, Message(message));
  fs::remove("run/clips/clip1/checkpoint/progress.npz");
  CHECK(finished_clips(config, "run", loss_terms()) == 0);
  execute_tiny_chain(config, "run", 1, true);
  CHECK(file_text("run/clips/clip1/frames/0002_target.png") == file_text("run/clips/clip1/frames/0001_target.png"));
}

TEST_CASE("warnings of a chain's inputs are told once, and are in the log of their clip", "[run][chain]") {
  const TemporaryFolder here;
  fs::copy(TinyChain::folder(), "data", fs::copy_options::recursive);
  fs::remove("data/clips/clip2/masks/human/0001.png");
  std::vector<std::string> told;
  const LogSink sink = log_to([&told](LogLevel level, std::string_view text) {
    if (level == LogLevel::kWarning) told.emplace_back(text);
  });
  execute_tiny_chain(
      load_run_config("data/config.json", {"stages.camera.iterations=1", "stages.interaction.iterations=1"},
                      descriptions_of(loss_terms()), ConfigUse::kRun),
      "run");
  const auto of_mask = [](const std::string& text) {
    return text.find("has no mask for 1 of 3 frames") != std::string::npos;
  };
  REQUIRE(std::count_if(told.begin(), told.end(), of_mask) == 1);
  CHECK(std::set<std::string>(told.begin(), told.end()).size() == told.size());
  CHECK_THAT(file_text("run/clips/clip2/log.txt"), Contains(*std::find_if(told.begin(), told.end(), of_mask)));
}

TEST_CASE("evaluate knows the truth of a whole chain", "[run][chain]") {
  const TemporaryFolder here;
  execute_tiny_chain(chain_config({"stages.camera.iterations=1", "stages.interaction.iterations=2"}), "run");
  const ProgramResult result = run_hsi4d({"evaluate", "run", "--json", "e.json"});
  INFO(result.err);
  REQUIRE(result.status == 0);
  const nlohmann::json errors = json_of("e.json")["results"][0], summary = json_of("run/summary.json");
  CHECK(errors["frames"] == kAllFrames);
  for (const char* name : {"mpjpe_mm", "world_mpjpe_mm", "object_translation_cm", "camera_translation_cm"}) {
    INFO(name);
    REQUIRE(errors.contains(name));
    CHECK(errors[name].get<double>() == Approx(summary["metrics"].back()[name].get<double>()).epsilon(1e-9));
  }
}

TEST_CASE("starts that were chosen are counted over all clips", "[chain]") {
  std::vector<ClipSummary> clips(3);
  for (ClipSummary& clip : clips) clip.summary.frames = 2;
  clips[0].summary.start = {0.5, {{"objects", {{"previous", 1}, {"estimate", 0}, {"velocity", 2}}}}};
  clips[2].summary.start = {0.25, {{"objects", {{"previous", 3}, {"estimate", 1}, {"velocity", 0}}}}};
  const StartSummary all = joined_summary("all", clips).start;
  CHECK(all.seconds == 0.75);
  REQUIRE(all.parts.size() == 1);
  CHECK(all.parts[0].begun ==
        std::vector<std::pair<std::string, Index>>{{"previous", 4}, {"estimate", 1}, {"velocity", 2}});
}

TEST_CASE("shares of the gradient are means over the evaluations of all clips", "[chain]") {
  std::vector<ClipSummary> clips(2);
  for (ClipSummary& clip : clips) clip.summary.frames = 3;
  clips[1].begin = 2;
  for (ClipSummary& clip : clips) clip.summary.metrics.push_back({"a", 1, 10, {}});
  clips[0].summary.metrics[0].gradient_shares = {{"transl", "mask", 0.5, -1, 1}};
  clips[1].summary.metrics[0].gradient_shares = {{"transl", "mask", 0.9, 1, 3}, {"transl", "depth", 0.25, 0.5, 2}};
  clips[1].summary.has_truth = false;
  const RunSummary all = joined_summary("all", clips);
  const std::vector<MeanGradientShare>& shares = all.metrics[0].gradient_shares;
  REQUIRE(shares.size() == 2);
  CHECK(shares[0].share == Approx(0.8));
  CHECK(shares[0].cosine == Approx(0.5));
  CHECK(shares[0].evaluations == 4);
  CHECK(shares[1].share == 0.25);
  CHECK(all.has_truth);
}

TEST_CASE("clips count by their frames and depths by what is inside too", "[chain]") {
  std::vector<ClipSummary> clips(3);
  for (std::size_t i = 0; i < clips.size(); ++i) {
    RunSummary& clip = clips[i].summary;
    clip.frames = i == 2 ? 3 : 2;
    clips[i].begin = static_cast<int>(i);
    const double share = i == 1 ? 0 : 0.1, depth = i == 1 ? 0 : 10 * static_cast<double>(i + 1);
    const MetricValues values = {{"penetration_share", share}, {"penetration_depth_mm", depth}};
    clip.metrics.push_back({"a", 1, 10, values});
    for (int t = 1; t < clip.frames; ++t) clip.per_frame.push_back({t, values});
  }
  const MetricValues joined = joined_summary("all", clips).metrics[0].values;
  CHECK(number_in(joined, "penetration_share") == Approx(0.3 / 4));
  CHECK(number_in(joined, "penetration_depth_mm") == Approx((1 * 10 + 2 * 30) / 3.0));
  clips.erase(clips.begin());
  clips.pop_back();
  CHECK(number_in(joined_summary("all", clips).metrics[0].values, "penetration_depth_mm") == 0);  // none is inside
}

TEST_CASE("a later clip needs no state of its own", "[run][chain]") {
  const TemporaryFolder here;
  const RunConfig config = changed_config([](nlohmann::ordered_json& content) {
    content["chain"][1]["data"].erase("initial");
    content["chain"][1]["data"].erase("truth");
    content["stages"]["interaction"]["iterations"] = 2;
  });
  CHECK(config.chain[1].data.initial.empty());
  execute_tiny_chain(config, "run");
  CHECK(read_motion("run/starts/clip2.npz").poses.size() == 1);
  CHECK(same(motion_in("run/clips/clip2").poses.front(), motion_in("run/clips/clip1").poses.back()));
  const nlohmann::json written = json_of("run/summary.json");
  CHECK_FALSE(written["joins"][0].contains("world_mpjpe_mm"));  // without truth there is no drift to tell
  CHECK(written["joins"][0]["jump_mm"] == 0);
  CHECK(written["clips"][0].contains("world_mpjpe_mm"));
  CHECK_FALSE(written["clips"][1].contains("world_mpjpe_mm"));
}

TEST_CASE("a resolved config of a chain is the same chain", "[chain]") {
  const TemporaryFolder here;
  const std::string text = resolved_config(chain_config(), descriptions_of(loss_terms()));
  here.write("again.json", text);
  CHECK(resolved_config(load_run_config("again.json", {}, descriptions_of(loss_terms()), ConfigUse::kRun),
                        descriptions_of(loss_terms())) == text);
}

TEST_CASE("what is wrong with a chain shows before anything is written", "[chain]") {
  using Json = nlohmann::ordered_json;
  const fs::path data = TinyChain::folder();
  const std::string file = (data / "changed.json").string();
  CHECK_THAT(fault_of([](Json& c) { c["chain"][1]["name"] = "clip1"; }),
             Contains("/chain/1/name: \"clip1\" is the name of another clip too"));
  CHECK_THAT(fault_of([](Json& c) { c["chain"][1]["name"] = "../clip"; }),
             Contains("/chain/1/name: \"../clip\" is no name of a folder; allowed: letters, digits, _ and -"));
  CHECK_THAT(fault_of([](Json& c) {
               c["chain"][1]["data"]["objects"]["cup"] = {{"gaussians", "scene.ply"}};
             }),
             Contains("/chain/1/data/objects: the clip has the objects watering_can, cup, the first one watering_can; "
                      "the clips of a chain have the same, in one order"));
  CHECK_THAT(fault_of([](Json& c) { c["chain"][1]["data"].erase("frames"); }),
             Contains("/chain/1/data/frames: not given; a run needs the frames of a video"));
  CHECK_THAT(fault_of([](Json& c) { c["chain"][0]["data"].erase("initial"); }),
             Contains("/chain/0/data/initial: not given; a run needs the state of frame 0"));
  CHECK_THAT(
      fault_of([](Json& c) { c["chain"][1]["data"]["video_rate"] = 25; }),
      Contains("/chain/1/data/frame_rate: the clip \"clip2\" has 25 frames a second, \"clip1\" has 10; the clips "
               "of a chain have one frame rate"));
  CHECK_THAT(fault_of([](Json& c) { c["chain"][1]["data"]["scen"] = "a"; }),
             Contains("/chain/1/data/scen: unknown key; did you mean \"scene\"?"));
  Avatar other = read_avatar((data / "avatar.safetensors").string());
  other.joints[7] += 0.01;
  write_avatar((data / "other.safetensors").string(), other);
  CHECK(fault_of([](Json& c) { c["chain"][1]["data"]["avatar"] = "other.safetensors"; }) ==
        "/chain/1/data/avatar: " + (data / "other.safetensors").string() + ": the human's joints are not those of " +
            (data / "avatar.safetensors").string() + "; the clips of a chain have one body");
}

TEST_CASE("the program runs, checks and reports chains", "[run][chain]") {
  const TemporaryFolder here;
  const std::vector<std::string> few = {
      "--set", "stages.camera.iterations=1", "--set", "stages.interaction.iterations=1", "--threads", "1"};
  const auto with = [&few](std::vector<std::string> words) {
    words.insert(words.end(), few.begin(), few.end());
    return run_hsi4d(words);
  };
  CHECK_THAT(run_hsi4d({"check", chain_file()}).out, Contains("  chain of 2 clips (clip1, clip2)\n"));
  const ProgramResult plan = with({"run", chain_file(), "--out", "run", "--dry-run"});
  CHECK(plan.status == 0);
  CHECK_THAT(plan.out, Contains("would write run\n") && Contains("  clip clip2: 3 frames\n"));
  CHECK_FALSE(fs::exists("run"));
  const ProgramResult done = with({"run", chain_file(), "--out", "run"});
  INFO(done.err);
  REQUIRE(done.status == 0);
  CHECK_THAT(done.out, Contains("clip1-clip2") && Contains("jump of the joints [mm]") && Contains("5 frames in ") &&
                           Contains("; report: run/report.html\n"));
  CHECK_THAT(with({"run", chain_file(), "--out", "run", "--dry-run", "--resume"}).out,
             Contains("would go on with run (done): 2 of 2 clips are finished\n"));
  CHECK_THAT(with({"run", chain_file(), "--out", "run"}).err, Contains("run: holds a run that is done"));
  const std::string page = file_text("run/report.html");
  fs::remove("run/report.html");
  CHECK(run_hsi4d({"report", "run"}).out == "run/report.html\n");
  CHECK(file_text("run/report.html") == page);
  const ProgramResult demo = run_hsi4d({"demo", "--quick", "--out", "demo", "--set", "synthetic.clips=2"});
  CHECK(demo.status == 2);
  CHECK(demo.err == "/synthetic/clips: hsi4d demo makes one clip; hsi4d synth makes chains, for hsi4d run\n");
}

TEST_CASE("clips of a generated chain overlap by a frame of one motion", "[chain]") {
  const fs::path data = TinyChain::folder();
  const auto truth = [&](const char* clip) { return data / "clips" / clip / "truth"; };
  const Motion first = motion_in(truth("clip1")), second = motion_in(truth("clip2"));
  REQUIRE(first.poses.size() == kClipFrames);
  REQUIRE(second.poses.size() == kClipFrames);
  CHECK(same(first.poses.back(), second.poses.front()));
  CHECK_FALSE(same(first.poses.back(), second.poses[1]));
  // The first clip alone is the dataset without a chain.
  const TemporaryFolder here;
  SyntheticSettings settings = TinyDataset::settings();
  settings.frames = kClipFrames;
  write_dataset(settings, video_render_settings(), "one");
  for (const char* name : {"frames/0002.png", "masks/human/0001.png", "camera.json", "initial.json",
                           "initial_motion.npz", "truth/motion.npz", "truth/cameras.json"})
    CHECK(file_text(fs::path("one") / name) == file_text(data / "clips/clip1" / name));
  CHECK(file_text("one/scene.ply") == file_text(data / "scene.ply"));
}

}  // namespace chain_test
