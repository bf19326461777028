// Chains whose videos, masks and cameras are made as they go: each clip's first frame shows how the clip before ended.
#include <algorithm>
#include <fstream>

#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/image_io.h"
#include "pipelines/chain/chain.h"
#include "pipelines/draw/camera_selection.h"
#include "pipelines/sources/sources.h"
#include "tests/support/program.h"
#include "tests/support/tiny_chain.h"

namespace made_chain_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

namespace {

using Names = std::vector<std::string>;

void script(const std::string& name, const std::string& text) {
  std::ofstream(name) << "#!/bin/sh\n" << text << "\n";
  fs::permissions(name, fs::perms::owner_all);
}

std::string text_of(const std::string& file) { return fs::exists(file) ? file_text(file) : ""; }

/// Changes the config of the tiny chain: programs give the frames and masks of the clip that the prompt names, and note
/// for which clips they were run.
void make_all(Json& c) {
  for (auto& clip : c["chain"]) {
    clip["data"].erase("frames");
    clip["data"].erase("masks");
    clip["prompt"] = clip["name"];
  }
  c["stages"]["camera"]["iterations"] = 3;
  c["stages"]["interaction"]["iterations"] = 3;
  c["sources"] = {{"folder", fs::absolute("generated").string()},
                  {"video", {{"command", {"./film", "{first_frame}", "{prompt}", "{out}"}}, {"output", "frames"}}},
                  {"masks", {{"command", {"./mask", "{video}", "{prompt}", "{out}"}}}}};
}

/// A folder with the programs. Where a file of the name "fail-film" or "fail-mask" is, they fail for the clip that it
/// names.
struct Workshop {
  TemporaryFolder here;

  Workshop() {
    const std::string clips = (TinyChain::folder() / "clips").string();
    for (const auto& [name, part] : {std::pair{"film", "frames"}, {"mask", "masks"}}) {
      const std::string file = name;
      script(file, "test -e \"$1\" || exit 9; if [ \"$(cat fail-" + file +
                       " 2> /dev/null)\" = \"$2\" ]; then exit 3; fi\n" + "echo \"$2\" >> " + file + ".txt; cp -r " +
                       clips + "/$2/" + part + " \"$3\"");
    }
  }
  static RunConfig config() { return changed_config(make_all); }
  /// A program estimates poses too, and the camera of a clip is chosen. Where a file of the name "hang-poses" or
  /// "fail-poses" is, the program hangs or fails for the clip that it names.
  static RunConfig estimating(std::size_t chosen) {
    script("poses",
           "echo \"$1\" >> poses.txt; if [ \"$(cat hang-poses 2> /dev/null)\" = \"$1\" ]; then sleep 60; fi\n"
           "if [ \"$(cat fail-poses 2> /dev/null)\" = \"$1\" ]; then exit 3; fi\n" +
               std::string("cp ") + (TinyChain::folder() / "clips").string() + "/$1/truth/motion.npz \"$2\"");
    return changed_config([chosen](Json& c) {
      make_all(c);
      c["chain"][chosen]["select_camera"] = true;
      c["camera_selection"]["radii_m"] = {2};
      c["sources"]["motion"]["command"] = {"./poses", "{prompt}", "{out}"};
    });
  }
  /// Programs that film the first frame standing still.
  static RunConfig standing_still() {
    script("film", "mkdir \"$3\"; for i in 0000 0001 0002; do cp \"$1\" \"$3/$i.png\"; done");
    script("mask",
           "for name in human watering_can; do mkdir -p \"$3/$name\"; for i in 0000 0001 0002; do "
           "cp \"$2/$name.png\" \"$3/$name/$i.png\"; done; done");
    return changed_config([](Json& c) {
      make_all(c);
      c["sources"]["masks"]["command"] = {"./mask", "{video}", "{first_masks}", "{out}"};
      c["chain"][1]["select_camera"] = true;
      c["camera_selection"]["radii_m"] = {2};
      c["chain"][1]["data"].erase("truth");
    });
  }
};

/// Runs the chain, which a program fails for a clip, and takes the cause away again.
void check_failure(const RunConfig& config, const std::string& program, const std::string& clip, bool is_resumed) {
  INFO(program << " fails for " << clip);
  const std::string fails = "fail-" + program;
  std::ofstream(fails) << clip;
  CHECK_THROWS_WITH(
      execute_tiny_chain(config, "run", 1, is_resumed),
      Contains(std::string("clip ") + clip[4] + " of 2, " + clip + ": /sources/") && Contains("ended with status 3"));
  CHECK(json_of("run/status.json")["state"] == "failed");
  CHECK(finished_clips(config, "run", loss_terms()) == (clip == "clip1" ? 0 : 1));
  fs::remove(fails);
}

double largest_difference(const Image& a, const Image& b) {
  REQUIRE(a.data().size() == b.data().size());
  double largest = 0;
  for (std::size_t i = 0; i < a.data().size(); ++i)
    largest = std::max(largest, std::abs(static_cast<double>(a.data()[i]) - static_cast<double>(b.data()[i])));
  return largest;
}

}  // namespace

TEST_CASE("a chain whose programs give what another names has its result", "[run][chain]") {
  const Workshop workshop;
  execute_tiny_chain(Workshop::config(), "made");
  execute_tiny_chain(chain_config({"stages.camera.iterations=3", "stages.interaction.iterations=3"}), "given");
  for (const char* name : {"motion.npz", "objects.npz", "cameras.json"})
    CHECK(file_text(fs::path("made") / name) == file_text(fs::path("given") / name));
  CHECK(json_of("made/summary.json")["joins"] == json_of("given/summary.json")["joins"]);  // the drift by truth too
  CHECK(text_of("film.txt") == "clip1\nclip2\n");
  CHECK(text_of("mask.txt") == "clip1\nclip2\n");
  const nlohmann::json of_clip = json_of("made/clips/clip2/config.resolved.json");
  CHECK(of_clip["sources"]["prompt"] == "clip2");  // a run of its own, with its own programs
  CHECK(of_clip["sources"]["video"]["command"][0] == "./film");
}

TEST_CASE("a chain with programs goes on from wherever it was stopped", "[run][chain][full]") {
  const Workshop workshop;
  const RunConfig config = Workshop::config();
  execute_tiny_chain(config, "run");
  fs::rename("run", "whole");
  fs::rename("generated", "generated-whole");
  for (const auto& [program, clip] : {std::pair{"film", "clip1"}, {"film", "clip2"}, {"mask", "clip2"}}) {
    INFO(program << " fails for " << clip);
    for (const char* notes : {"film.txt", "mask.txt"}) fs::remove(notes);
    check_failure(config, program, clip, false);
    execute_tiny_chain(config, "run", 2, true);
    check_same_chains("run", "whole");
    CHECK(text_of("film.txt") == "clip1\nclip2\n");  // each was made once
    CHECK(text_of("mask.txt") == "clip1\nclip2\n");
    fs::remove_all("run");
    fs::remove_all("generated");
  }
  int asked = 0;
  CHECK_THROWS_AS(execute_tiny_chain(config, "run", 1, false,
                                     [&] { return fs::exists("run/clips/clip2/status.json") && ++asked == 8; }),
                  Interrupted);
  CHECK(finished_clips(config, "run", loss_terms()) == 1);
  execute_tiny_chain(config, "run", 1, true);
  check_same_chains("run", "whole");
  CHECK(text_of("film.txt") == "clip1\nclip2\nclip1\nclip2\n");
  execute_tiny_chain(config, "run", 1, true);  // all is done: nothing is run
  check_same_chains("run", "whole");
  CHECK(text_of("film.txt") == "clip1\nclip2\nclip1\nclip2\n");
  CHECK(text_of("mask.txt") == "clip1\nclip2\nclip1\nclip2\n");

  // What a clip that is done was made of is not made again: that may cost something.
  fs::remove_all("generated");
  const std::string told = ", of which the clip that is done was made, is not there";
  CHECK_THROWS_WITH(finished_clips(config, "run", loss_terms()), Contains(told));
  CHECK_THROWS_WITH(execute_tiny_chain(config, "run", 1, true),
                    Contains("clip 1 of 2, clip1: /sources/video: ") && Contains(told));
  CHECK(text_of("film.txt") == "clip1\nclip2\nclip1\nclip2\n");
}

TEST_CASE("a later clip is filmed from the state in which the one before ended, by a camera chosen there",
          "[run][chain]") {
  const Workshop workshop;
  const RunConfig config = Workshop::standing_still();
  execute_tiny_chain(config, "run");
  RunConfig second = clip_config(config, 1);
  second.data.initial = fs::absolute("run/starts/clip2.json");
  const SceneSetup setup = read_scene_setup(second.data);
  const Camera given = read_camera(config.chain[1].data.camera.string()),
               chosen = read_camera("run/starts/clip2.camera.json");
  const Camera best = select_camera(setup, config.camera_selection, config.render, given).camera;
  CHECK(chosen.camera_from_world.rotation == best.camera_from_world.rotation);
  CHECK(chosen.camera_from_world.translation == best.camera_from_world.translation);
  CHECK(chosen.width == given.width);
  CHECK(chosen.fx == given.fx);
  CHECK(read_cameras("run/clips/clip2/cameras.json").front().camera_from_world.rotation ==
        chosen.camera_from_world.rotation);

  // What the program was given shows the end of the first clip through that camera; nothing moved after it.
  second.data.camera = fs::absolute("run/starts/clip2.camera.json");
  const Image wanted = first_frame_image(second);
  double nearest = 1;
  for (const auto& file : fs::directory_iterator("generated")) {
    if (!file.path().string().ends_with(".first_frame.png")) continue;
    nearest = std::min(nearest, largest_difference(read_image(file.path().string()), wanted));
  }
  CHECK(nearest <= 0.5 / 255 + 1e-6);
  const Motion motion = read_motion("run/motion.npz");
  REQUIRE(motion.poses.size() == 2 * (kClipFrames - 1) + 1);
  const Motion first = read_motion("run/clips/clip1/motion.npz");
  CHECK(motion.poses[kClipFrames - 1].transl == first.poses.back().transl);
  CHECK((motion.poses.back().transl - first.poses.back().transl).norm() < 0.05);
  fs::rename("run", "whole");
  int asked = 0;
  CHECK_THROWS_AS(execute_tiny_chain(config, "run", 2, false,
                                     [&] { return fs::exists("run/clips/clip2/status.json") && ++asked == 8; }),
                  Interrupted);
  const std::string camera = file_text("run/starts/clip2.camera.json");
  execute_tiny_chain(config, "run", 2, true);
  check_same_chains("run", "whole");
  CHECK(file_text("run/starts/clip2.camera.json") == camera);

  // What chooses a camera decides the result.
  RunConfig other = config;
  other.camera_selection.radii_m = {1.5};
  CHECK_THROWS_WITH(execute_tiny_chain(other, "run", 2, true), Contains("camera_selection"));
}

TEST_CASE("the first clip's camera can be chosen too, and programs estimate the motion of each clip", "[run][chain]") {
  const Workshop workshop;
  const RunConfig config = Workshop::estimating(0);
  execute_tiny_chain(config, "run");
  CHECK(fs::exists("run/starts/clip1.camera.json"));
  CHECK_FALSE(fs::exists("run/starts/clip2.camera.json"));
  CHECK(json_of("run/status.json")["state"] == "done");
  int motions = 0;
  for (const auto& file : fs::directory_iterator("generated")) motions += file.path().extension() == ".npz" ? 1 : 0;
  CHECK(motions == 2);
}

TEST_CASE("a chain goes on after a stop while a camera is chosen, and after one in the estimator", "[run][chain]") {
  const Workshop workshop;
  const RunConfig config = Workshop::estimating(1);
  execute_tiny_chain(config, "run");
  fs::rename("run", "whole");
  fs::rename("generated", "generated-whole");
  for (const char* notes : {"film.txt", "mask.txt", "poses.txt"}) fs::remove(notes);

  CHECK_THROWS_MATCHES(execute_tiny_chain(config, "run", 1, false, [] { return fs::exists("run/starts/clip2.json"); }),
                       Interrupted,
                       Message("clip 2 of 2, clip2: interrupted while cameras were tried; nothing is written"));
  CHECK(json_of("run/status.json")["state"] == "interrupted");
  CHECK_FALSE(fs::exists("run/starts/clip2.camera.json"));
  CHECK(finished_clips(config, "run", loss_terms()) == 1);
  CHECK(text_of("film.txt") == "clip1\n");

  std::ofstream("hang-poses") << "clip2";
  CHECK_THROWS_MATCHES(
      execute_tiny_chain(config, "run", 1, true, [] { return text_of("poses.txt") == "clip1\nclip2\n"; }), Interrupted,
      Message("clip 2 of 2, clip2: interrupted while ./poses made the motion; nothing is left of it"));
  CHECK(json_of("run/status.json")["state"] == "interrupted");
  CHECK(fs::exists("run/starts/clip2.camera.json"));
  CHECK_FALSE(fs::exists("run/clips/clip2"));
  CHECK(finished_clips(config, "run", loss_terms()) == 1);

  fs::remove("hang-poses");
  execute_tiny_chain(config, "run", 1, true);
  check_same_chains("run", "whole");
  CHECK(text_of("film.txt") == "clip1\nclip2\n");  // what was there is not made again
  CHECK(text_of("mask.txt") == "clip1\nclip2\n");
  CHECK(text_of("poses.txt") == "clip1\nclip2\nclip2\n");
}

TEST_CASE("a chain goes on after any of its programs has failed for any clip", "[run][chain]") {
  const Workshop workshop;
  const RunConfig config = Workshop::estimating(1);
  execute_tiny_chain(config, "run");
  fs::rename("run", "whole");
  fs::rename("generated", "generated-whole");
  for (const char* notes : {"film.txt", "mask.txt", "poses.txt"}) fs::remove(notes);
  bool is_begun = false;
  for (const char* clip : {"clip1", "clip2"}) {
    for (const char* program : {"film", "mask", "poses"}) {
      check_failure(config, program, clip, is_begun);
      is_begun = true;
    }
  }
  execute_tiny_chain(config, "run", 1, true);
  check_same_chains("run", "whole");
  CHECK(text_of("film.txt") == "clip1\nclip2\n");  // each was made once
  CHECK(text_of("mask.txt") == "clip1\nclip2\n");
  CHECK(text_of("poses.txt") == "clip1\nclip1\nclip2\nclip2\n");  // and asked for once more where it failed
}

TEST_CASE("an input that a clip of a chain names is not made", "[run][chain]") {
  const Workshop workshop;
  const RunConfig config = changed_config([](Json& c) {
    const Json frames = c["chain"][0]["data"]["frames"], masks = c["chain"][0]["data"]["masks"];
    make_all(c);
    c["chain"][0]["data"]["frames"] = frames;
    c["chain"][0]["data"]["masks"] = masks;
  });
  execute_tiny_chain(config, "run");
  CHECK(text_of("film.txt") == "clip2\n");
  CHECK(text_of("mask.txt") == "clip2\n");
  CHECK(json_of("run/clips/clip1/config.resolved.json")["sources"]["video"]["command"].empty());
}

TEST_CASE("the plan of a chain tells what is yet to be made", "[chain]") {
  const Workshop workshop;
  changed_config([](Json& c) {
    make_all(c);
    c["chain"][1]["select_camera"] = true;
  });
  const ProgramResult plan =
      run_hsi4d({"run", (TinyChain::folder() / "changed.json").string(), "--out", "run", "--dry-run"});
  INFO(plan.err);
  CHECK(plan.status == 0);
  CHECK_THAT(plan.out, Contains("  clip clip1: in its initial state\n"
                                "    would run ./film, {first_frame}, {prompt}, {out}, unless its output is there\n"
                                "    would run ./mask, {video}, {prompt}, {out}, unless its output is there\n"
                                "  clip clip2: in the state in which clip1 ends\n"
                                "    would choose its camera\n"));
  CHECK_FALSE(fs::exists("run"));
  CHECK_FALSE(fs::exists("generated"));
}

TEST_CASE("what is wrong with a chain of programs is told with its place", "[chain]") {
  const Workshop workshop;
  const auto fault_of = [](auto change) {
    try {
      check_chain(changed_config([&change](Json& c) {
        make_all(c);
        change(c);
      }));
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string("no fault");
  };
  CHECK(fault_of([](Json&) {}) == "no fault");
  CHECK_THAT(fault_of([](Json& c) { c["chain"][1].erase("prompt"); }),
             Contains("/chain/1/prompt: not given; /sources/video/command has {prompt}"));
  CHECK(fault_of([](Json& c) {
          c["chain"][1].erase("prompt");
          c["sources"]["prompt"] = "clip2";
        }) == "no fault");
  CHECK_THAT(fault_of([](Json& c) {
               c["chain"][1]["data"]["frames"] = "clips/clip2/frames";
               c["chain"][1]["select_camera"] = true;
             }),
             Contains("/chain/1/select_camera: the clip's video is given, and was filmed by a camera of its own"));
  CHECK_THAT(fault_of([](Json& c) {
               c["sources"]["video"]["command"] = {"./film", "{prompt}", "{out}"};
             }),
             Contains("/sources/video/command: {first_frame} is missing"));
  CHECK_THAT(fault_of([](Json& c) { c["data"]["frames"] = "clips/clip1/frames"; }),
             Contains("/sources/video: makes nothing: every clip of the chain has data/frames; remove one"));
  CHECK_THAT(fault_of([](Json& c) {
               c["sources"]["video"]["command"] = {"./film", "{first_fram}", "{out}"};
             }),
             Contains("/sources/video/command/1: there is no placeholder {first_fram}"));
  CHECK_THAT(fault_of([](Json& c) { c["sources"].erase("masks"); }),
             Contains("/chain/1/data/masks: not given; a run needs masks of the human and the objects"));
  CHECK_THAT(fault_of([](Json& c) { c["chain"][1]["data"].erase("camera"); }),
             Contains("/chain/1/data/camera: not given; a run needs the camera of frame 0"));
  CHECK(fault_of([](Json& c) {
          c["chain"][1]["data"].erase("camera");
          c["chain"][1]["select_camera"] = true;
        }) == "no fault");
}

}  // namespace made_chain_test
