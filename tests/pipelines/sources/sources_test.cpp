// Programs outside that make the video and the masks: stand-ins, small shell scripts, that are run for real.
#include "pipelines/sources/sources.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <thread>

#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/image_io.h"
#include "core/lens.h"
#include "optim/metrics.h"
#include "pipelines/sources/lock.h"
#include "tests/support/program.h"
#include "tests/support/running_program.h"
#include "tests/support/tiny_run.h"
#include "tests/support/true_keypoints.h"

namespace sources_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Matches;
using Catch::Matchers::StartsWith;
namespace fs = std::filesystem;

namespace {

/// A folder with two programs and a config that runs the tiny dataset with what they make.
struct Workshop {
  TemporaryFolder here;
  nlohmann::json config;

  Workshop() {
    const std::string data = TinyDataset::folder().string();
    script("film", "echo \"$2\" >> film.txt; test -s \"$1\" || exit 9; cp -r " + data + "/frames \"$3\"");
    script("mask", "echo \"$2\" >> mask.txt; test -d \"$1\" || exit 9; cp -r " + data + "/masks \"$3\"");
    config = {{"extends", tiny_config_file()},
              {"data", {{"frames", ""}, {"masks", ""}}},
              {"stages", {{"camera", {{"iterations", 1}}}, {"interaction", {{"iterations", 1}}}}},
              {"sources",
               {{"prompt", "A person; pours \"water\""},
                {"video", {{"command", {"./film", "{first_frame}", "{prompt}", "{out}"}}, {"output", "frames"}}},
                {"masks", {{"command", {"./mask", "{video}", "{objects}", "{out}"}}}}}}};
    write();
  }

  static void script(const std::string& name, const std::string& text) {
    std::ofstream(name) << "#!/bin/sh\n" << text << "\n";
    fs::permissions(name, fs::perms::owner_all);
  }
  void write() const { std::ofstream("config.json") << config.dump(2); }

  static ProgramResult run(const std::string& out, const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {"run", "config.json", "--threads", "1", "--out", out};
    words.insert(words.end(), more.begin(), more.end());
    return run_hsi4d(words);
  }
  /// The message of a run that is refused before it has a folder.
  static std::string refusal() {
    const ProgramResult result = run("run");
    CHECK(result.status == 2);
    CHECK(result.out.empty());
    CHECK_FALSE(fs::exists("run"));
    std::string message;  // without what was told of the work before
    std::istringstream text(result.err);
    for (std::string line; std::getline(text, line);) {
      if (!line.starts_with("hsi4d: ")) message += line + "\n";
    }
    return message;
  }
};

std::vector<std::string> lines_of(const std::string& file) {
  std::vector<std::string> lines;
  std::istringstream text(fs::exists(file) ? file_text(file) : "");
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

/// The names in generated/, hashes as KEY.
std::vector<std::string> made() {
  std::vector<std::string> names;
  if (!fs::exists("generated")) return names;
  for (const auto& entry : fs::directory_iterator("generated")) {
    std::string name = entry.path().filename().string();
    if (name.find('-') != std::string::npos) name.replace(name.find('-') + 1, 16, "KEY");
    names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

fs::path made_file(const std::string& start, const std::string& end) {
  for (const auto& entry : fs::directory_iterator("generated")) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(start) && name.ends_with(end)) return entry.path();
  }
  return {};
}

using Names = std::vector<std::string>;

/// Waits until something has come; false when that takes more than ten seconds.
template <class F>
bool comes(const F& moment) {
  for (int i = 0; i < 400; ++i) {
    if (moment()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(25));
  }
  return false;
}

const std::string kPlaces = "[\\s\\S]*";  // of folders and hashes, in a message

}  // namespace

TEST_CASE("placeholders are replaced within arguments, other braces are text") {
  const Names command = {"go", "--in={first_frame}", "{prompt}{out}", "{\"steps\": 30}", "{{out}}", "{}", "{ out }",
                         "{"};
  CHECK(filled_in(command, {{"first_frame", "a b.png"}, {"prompt", "{out}"}, {"out", "o"}}) ==
        Names{"go", "--in=a b.png", "{out}o", "{\"steps\": 30}", "{out}", "{}", "{ out }", "{"});
  CHECK(placeholders_in("{a}-{{b}}-{c_1}") == Names{"a", "c_1"});
  CHECK(uses_placeholder(command, "prompt"));
  CHECK_FALSE(uses_placeholder({"go", "{{prompt}}"}, "prompt"));
  CHECK_THROWS_AS(filled_in({"{in}"}, {}), InternalError);
}

TEST_CASE("commands that cannot work are told with their places") {
  Workshop workshop;
  workshop.config["sources"]["prompt"] = "";
  workshop.config["sources"]["video"]["command"] = {"no_such_program", "{prompt}", "{first_fram}"};
  workshop.config["sources"]["masks"]["command"] = {"./mask", "{first_frame}", "{out}"};
  workshop.config["data"]["masks"] = (TinyDataset::folder() / "masks").string();
  workshop.write();
  for (const char* command : {"check", "run"}) {
    const ProgramResult result = run_hsi4d({command, "config.json"});
    INFO(result.err);
    CHECK(result.status == 2);
    std::vector<std::string> told;
    std::istringstream text(result.err);
    std::string line;
    std::getline(text, line);
    CHECK(line == "6 problems in config.json:");
    while (std::getline(text, line)) told.push_back(line.substr(line.find(" /") + 1));
    std::sort(told.begin(), told.end());
    CHECK(told ==
          Names{"/data/masks: given, and /sources/masks makes it too; remove one",
                "/sources/masks/command/1: there is no placeholder {first_frame}; known here: {video}, {objects}, "
                "{first_masks}, {prompt}, {seed}, {out}; {{first_frame}} is that text",
                "/sources/prompt: not given; /sources/video/command has {prompt}",
                "/sources/video/command/0: there is no program \"no_such_program\" that can be executed in PATH",
                "/sources/video/command/2: there is no placeholder {first_fram}; known here: {first_frame}, "
                "{prompt}, {seed}, {out}; did you mean \"first_frame\"?; {{first_fram}} is that text",
                "/sources/video/command: {out} is missing: the program has to be told where to write"});
  }
  CHECK(made().empty());
  CHECK(lines_of("film.txt").empty());
}

TEST_CASE("the shipped templates lack nothing but data and installations") {
  const TemporaryFolder here;
  fs::create_directory_symlink(fs::path(HSI4D_SOURCE_DIR) / "tools", "tools");
  int count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(HSI4D_SOURCE_DIR) / "configs" / "sources")) {
    if (entry.path().extension() != ".json") continue;
    INFO(entry.path());
    ++count;
    const RunConfig config = load_run_config(entry.path(), {}, descriptions_of(loss_terms()));
    CHECK(config.sources.folder == entry.path().parent_path() / "generated");
    for (const auto& [command, known] : {std::pair{config.sources.video.command, video_placeholders()},
                                         {config.sources.masks.command, mask_placeholders()},
                                         {config.sources.motion.command, motion_placeholders()}}) {
      CHECK(command_faults(command, known).empty());
    }
    for (const char* name : {"first_frame", "prompt", "out"})
      CHECK(uses_placeholder(config.sources.video.command, name));
    CHECK_THROWS_WITH(load_run_config(entry.path(), {"sources.video.command=[\"no_such\", \"{out}\"]"},
                                      descriptions_of(loss_terms()), ConfigUse::kStages),
                      Contains("there is no program \"no_such\" that can be executed in PATH"));
  }
  CHECK(count == 6);
}

TEST_CASE("the first frame is what the state of frame 0 looks like") {
  const RunConfig config = tiny_config();
  const Image image = first_frame_image(config),
              seen = read_image((TinyDataset::folder() / "first_frame.png").string());
  CHECK(image.width() == kTinyPixels);
  CHECK(psnr_db(image, seen) > 25);
  const std::vector<Image> masks = first_masks(config);
  REQUIRE(masks.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string name = i == 0 ? "human" : kTinyObject;
    INFO(name);
    const Image mask = read_image((TinyDataset::folder() / "masks" / name / "0000.png").string());
    CHECK(masks[i].channels() == 1);
    CHECK(psnr_db(masks[i], mask) > 22);
    CHECK(psnr_db(masks[i], Image(1, kTinyPixels, kTinyPixels)) < 21);
  }
}

TEST_CASE("a run makes its video and masks by programs, once for what they are made of", "[run]") {
  Workshop workshop;
  const std::string prompt = "A person; pours \"water\"";
  const ProgramResult dry = Workshop::run("run", {"--dry-run"});
  INFO(dry.err);
  CHECK(dry.status == 0);
  CHECK_THAT(
      dry.out,
      Matches("would write run\n  would run ./film, \\{first_frame\\}, \\{prompt\\}, \\{out\\}\n    for " + kPlaces +
              "/generated/video-[0-9a-f]{16}\n  would then run ./mask, \\{video\\}, "
              "\\{objects\\}, \\{out\\}\n  scene of " +
              kPlaces));
  CHECK(run_hsi4d({"check", "config.json"}).status == 0);
  CHECK(made().empty());
  CHECK(lines_of("film.txt").empty());

  const ProgramResult first = Workshop::run("run");
  INFO(first.err);
  REQUIRE(first.status == 0);
  CHECK(lines_of("film.txt") == Names{prompt});
  CHECK(lines_of("mask.txt") == Names{"human," + kTinyObject});
  const Names all = {"masks-KEY", "masks-KEY.json", "video-KEY", "video-KEY.first_frame.png", "video-KEY.json"};
  CHECK(made() == all);
  CHECK(read_image(made_file("video", ".first_frame.png").string()).width() == kTinyPixels);
  CHECK(json_of(made_file("video", ".json"))["prompt"] == prompt);
  execute_tiny(tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1"}), "plain");
  for (const char* name : {"motion.npz", "objects.npz", "cameras.json"})
    CHECK(file_text(fs::path("run") / name) == file_text(fs::path("plain") / name));
  CHECK_THAT(file_text("run/log.txt"), Contains("video: runs ./film, "));

  // Another run, and one that goes on, have the same video.
  CHECK(Workshop::run("run", {"--resume"}).status == 0);
  CHECK_THAT(Workshop::run("dry", {"--dry-run"}).out, StartsWith("would write dry\n  4 frames of 48x48, scene of "));
  for (const char* spelling : {"synthetic.frames=3", "/synthetic/frames=3", R"(synthetic={"frames": 3})"}) {
    CHECK_THAT(run_hsi4d({"run", "run/config.resolved.json", "--out", "dry", "--dry-run", "--set", spelling}).err,
               Contains(std::string("--set ") + spelling + ": nothing reads it"));
  }
  CHECK_THAT(run_hsi4d({"run", "run/config.resolved.json", "--out", "dry", "--dry-run"}).out,
             StartsWith("would write dry\n  4 frames of 48x48, scene of "));
  CHECK(lines_of("film.txt").size() == 1);
  CHECK(lines_of("mask.txt").size() == 1);

  // Another prompt is another video; its masks are those of the same frames. A run does not go on with it.
  CHECK_THAT(Workshop::run("run", {"--resume", "--set", "sources.prompt=sits"}).err, Contains("prompt"));
  CHECK(lines_of("film.txt").size() == 1);
  CHECK(Workshop::run("other", {"--set", "sources.prompt=sits"}).status == 0);
  CHECK(lines_of("film.txt") == Names{prompt, "sits"});
  CHECK(lines_of("mask.txt").size() == 1);
  // What the first frame shows counts too.
  CHECK_THAT(Workshop::run("bright", {"--dry-run", "--set", "background=[1,1,1]"}).out,
             Contains("would run ./film, ") && Contains("would then run ./mask, "));
  // A record that was lost, or an output, is made again.
  fs::remove(made_file("masks", ".json"));
  CHECK(Workshop::run("lost").status == 0);
  CHECK(lines_of("mask.txt").size() == 2);
  CHECK(temporaries_in("generated").empty());
}

TEST_CASE("masks of frame 0 are as the lens of the video shows it") {
  RunConfig config = tiny_config();
  const std::vector<Image> straight = first_masks(config);
  config.data.lens.lens.k1 = -0.25;
  const std::vector<Image> bent = first_masks(config);
  const Camera camera = read_camera(config.data.camera.string());
  REQUIRE(bent.size() == straight.size());
  for (std::size_t i = 0; i < bent.size(); ++i) {
    CAPTURE(i);
    const Image back = straightened(bent[i], camera, config.data.lens.lens).image;
    CHECK(mask_iou(back, straight[i]).value() > 0.85);
    if (i == 0)  // the object is in the middle, where a lens hardly bends
      CHECK(mask_iou(back, straight[i]).value() > mask_iou(bent[i], straight[i]).value() + 0.02);
  }
}

TEST_CASE("hsi4d makes the masks of objects itself where it is told to, once", "[run]") {
  Workshop workshop;
  workshop.config.erase("data");
  workshop.config["sources"] = {{"masks", {{"program", "embedded"}}}};
  workshop.write();
  CHECK_THAT(Workshop::run("dry", {"--dry-run"}).out, Contains("  would follow the objects\n    for "));
  const ProgramResult first = Workshop::run("run");
  INFO(first.err);
  REQUIRE(first.status == 0);
  CHECK(made() == Names{"masks-KEY", "masks-KEY.json"});
  CHECK_THAT(file_text("run/log.txt"), Contains("masks: " + kTinyObject + ": seen in "));
  const fs::path masks = made_file("masks", ".json").replace_extension(), given = TinyDataset::folder() / "masks";
  CHECK(read_image((masks / "human" / "0002.png").string()) == read_image((given / "human" / "0002.png").string()));
  const Image truth = read_image((given / kTinyObject / "0000.png").string());
  CHECK(mask_iou(read_image((masks / kTinyObject / "0000.png").string()), truth).value() > 0.6);
  CHECK(fs::exists(masks / kTinyObject / "0003.png"));

  // What is there is used, by a run that goes on too.
  const auto made_at = fs::last_write_time(masks);
  CHECK(Workshop::run("run", {"--resume"}).status == 0);
  CHECK(Workshop::run("other").status == 0);
  CHECK(file_text("other/objects.npz") == file_text("run/objects.npz"));
  CHECK(fs::last_write_time(masks) == made_at);

  // Another box makes other masks.
  auto& object = workshop.config["data"]["objects"][kTinyObject];
  object["first_box"] = {10, 10, 40, 40};
  workshop.write();
  CHECK_THAT(Workshop::run("dry", {"--dry-run"}).out, Contains("  would follow the objects\n"));
  object["first_clicks"] = {10, 10};
  workshop.write();
  fs::remove_all("run");
  CHECK_THAT(Workshop::refusal(), Contains("first_mask, first_box and first_clicks say the same; give one of them"));
  object.erase("first_box");
  object["first_clicks"] = {100, 10};
  workshop.write();
  CHECK_THAT(Workshop::refusal(), Contains("/data/objects/" + kTinyObject + ": 100,10 is outside of the first frame"));
  object.erase("first_clicks");
  workshop.config["sources"]["masks"]["command"] = {"./mask", "{out}"};
  workshop.write();
  CHECK_THAT(Workshop::refusal(),
             Contains("/sources/masks/command: given, and /sources/masks/program is \"embedded\""));

  // Without the human's masks these are made too.
  workshop.config["sources"]["masks"].erase("command");
  workshop.config["data"]["masks"] = "";
  workshop.write();
  const ProgramResult alone = Workshop::run("alone");
  INFO(alone.err);
  REQUIRE(alone.status == 0);
  CHECK_THAT(file_text("alone/log.txt"), Contains("masks: human: seen in "));
  for (const auto& entry : fs::directory_iterator("generated")) {
    if (!entry.is_directory()) continue;
    const Image mask = read_image((entry.path() / "human" / "0003.png").string()),
                human = read_image((given / "human" / "0003.png").string());
    CHECK(mask_iou(mask, human).value() > 0.5);
  }
}

namespace {

/// A program "find" that stands for the front end: the truth's keypoints and the human's masks.
void script_find() {
  std::ofstream("true_keypoints.json") << true_keypoints(read_clip(tiny_config().data)).dump();
  Workshop::script("find",
                   "echo \"$*\" >> find.txt; mkdir -p \"$3/masks\"; cp true_keypoints.json "
                   "\"$3/keypoints.json\"; cp -r " +
                       TinyDataset::folder().string() + "/masks/human \"$3/masks/\"");
}

/// Mean distance of the joints of later frames from the truth's, metres, once both stand in one place.
double pose_error(const Clip& clip, const Motion& motion) {
  double sum = 0;
  for (std::size_t t = 1; t < clip.truth->size(); ++t) {
    const auto joints = [&clip](const BodyPose& pose) {
      return pose_joints(clip.avatar.parents, clip.avatar.joints, pose);
    };
    const std::vector<double> a = joints(motion.poses[t]), b = joints((*clip.truth)[t].body);
    for (std::size_t j = 0; j < kTruePoints; ++j) {
      Vector3<double> difference;
      for (std::size_t c = 0; c < 3; ++c)
        difference[static_cast<Index>(c)] = (a[3 * j + c] - a[c]) - (b[3 * j + c] - b[c]);
      sum += difference.norm();
    }
  }
  return sum / static_cast<double>(kTruePoints * (clip.truth->size() - 1));
}

}  // namespace

TEST_CASE("hsi4d finds poses itself from keypoints, and the person by the front end, once", "[run]") {
  Workshop workshop;
  script_find();
  workshop.config["data"] = {{"masks", ""}, {"objects", {{kTinyObject, nullptr}}}};
  workshop.config["stages"]["interaction"]["losses"] = {{"center", nullptr}, {"depth", nullptr}};
  workshop.config["stages"]["interaction"]["optimize"] = {{"object_orient", nullptr}, {"object_transl", nullptr}};
  workshop.config["sources"] = {{"motion", {{"program", "embedded"}}}};
  workshop.write();
  // Without a command the front end beside the program is run, which must not install anything.
  const ProgramResult dry = Workshop::run("dry", {"--dry-run"});
  INFO(dry.err);
  CHECK(dry.status == 0);
  CHECK_THAT(dry.out, Contains("/tools/frontend, --no-install, {video}, --out, {out}\n    for ") &&
                          Contains("  would then find the poses of the keypoints\n"));
  workshop.config["sources"]["person"]["command"] = {"./find", "{video}", "--out", "{out}"};
  workshop.write();
  CHECK_THAT(Workshop::run("dry", {"--dry-run"}).out, Contains("  would run ./find, {video}, --out, {out}\n    for "));
  CHECK(made().empty());

  const ProgramResult first = Workshop::run("run");
  INFO(first.err);
  REQUIRE(first.status == 0);
  CHECK(made() == Names{"motion-KEY.npz", "motion-KEY.npz.json", "person-KEY", "person-KEY.json"});
  CHECK(lines_of("find.txt").size() == 1);
  CHECK_THAT(file_text("run/log.txt"), Contains("person: runs ./find, ") && Contains("motion: is found of "));
  CHECK(temporaries_in("generated").empty());

  // The poses are those of the keypoints: nearer to the truth than that nothing moves.
  const Clip clip = read_clip(tiny_config().data);
  const Motion found = read_motion(made_file("motion", ".npz").string());
  REQUIRE(found.poses.size() == clip.truth->size());
  Motion still = found;
  for (BodyPose& pose : still.poses) pose = clip.first.body;
  INFO(pose_error(clip, found) << " m, still " << pose_error(clip, still) << " m");
  CHECK(pose_error(clip, found) < 0.7 * pose_error(clip, still));

  // What is there is used; another run has the same result, and keypoints count by their content.
  CHECK(Workshop::run("run", {"--resume"}).status == 0);
  CHECK(Workshop::run("other").status == 0);
  CHECK(file_text("other/motion.npz") == file_text("run/motion.npz"));
  CHECK(lines_of("find.txt").size() == 1);
  workshop.config["data"]["keypoints"] = fs::absolute("true_keypoints.json").string();
  workshop.config["data"]["masks"] = (TinyDataset::folder() / "masks").string();
  workshop.config["sources"].erase("person");
  workshop.write();
  CHECK_THAT(Workshop::run("dry", {"--dry-run"}).out, !Contains("frontend") && !Contains("find the poses"));
  nlohmann::json moved = json_of("true_keypoints.json");
  for (auto& point : moved["frames"][2]) point[0] = point[0].get<double>() + 1;
  std::ofstream("true_keypoints.json") << moved.dump();
  CHECK_THAT(Workshop::run("dry", {"--dry-run"}).out, Contains("  would find the poses of the keypoints\n"));
}

TEST_CASE("what finds the person gives the human's masks to those who follow objects", "[run]") {
  Workshop workshop;
  script_find();
  workshop.config["data"] = {{"masks", ""}};
  workshop.config["sources"] = {{"masks", {{"program", "embedded"}}},
                                {"person", {{"command", {"./find", "{video}", "--out", "{out}"}}}}};
  workshop.write();
  const ProgramResult result = Workshop::run("run");
  INFO(result.err);
  REQUIRE(result.status == 0);
  CHECK(made() == Names{"masks-KEY", "masks-KEY.json", "person-KEY", "person-KEY.json"});
  const fs::path masks = made_file("masks", ".json").replace_extension(), given = TinyDataset::folder() / "masks";
  CHECK(read_image((masks / "human" / "0002.png").string()) == read_image((given / "human" / "0002.png").string()));
  CHECK(fs::exists(masks / kTinyObject / "0003.png"));
}

TEST_CASE("a person who is not found, or found twice, is refused", "[run]") {
  Workshop workshop;
  script_find();
  workshop.config["data"] = {{"masks", ""}};
  workshop.config["sources"] = {{"masks", {{"program", "embedded"}}}, {"motion", {{"program", "embedded"}}}};
  auto& person = workshop.config["sources"]["person"];
  SECTION("wrong use ends the run with what the program says") {
    Workshop::script("find", "echo 'frontend: nobody is found in any frame' >&2; exit 2");
    person["command"] = {"./find", "{video}", "--out", "{out}"};
    workshop.write();
    CHECK_THAT(Workshop::refusal(),
               Contains("/sources/person: ./find") && Contains("frontend: nobody is found in any frame"));
  }
  SECTION("keypoints of another length") {
    nlohmann::json short_one = json_of("true_keypoints.json");
    short_one["frames"].erase(3);
    std::ofstream("true_keypoints.json") << short_one.dump();
    person["command"] = {"./find", "{video}", "--out", "{out}"};
    workshop.write();
    CHECK_THAT(Workshop::refusal(), Contains("/sources/person: ./find wrote what cannot be used, kept as ") &&
                                        Contains("keypoints.json: holds 3 frames of keypoints, the video has 4"));
  }
  SECTION("settings that say the same") {
    person["command"] = {"./find", "{video}", "{prompt}"};
    workshop.config["data"]["keypoints"] = "true_keypoints.json";
    workshop.config["data"]["motion"] = (TinyDataset::folder() / "initial_motion.npz").string();
    workshop.config["sources"]["motion"]["command"] = {"./find", "{out}"};
    workshop.write();
    const std::string message = Workshop::refusal();
    CHECK_THAT(message, Contains("/data/keypoints: given, and /sources/person makes it too; remove one"));
    CHECK_THAT(message, Contains("/data/motion: given, and /sources/motion makes it too; remove one"));
    CHECK_THAT(message, Contains("/sources/motion/command: given, and /sources/motion/program is \"embedded\""));
    CHECK_THAT(message, Contains("there is no placeholder {prompt}; known here: {video}, {out}"));
  }
}

TEST_CASE("a command with {seed} makes a video a seed", "[run]") {
  Workshop workshop;
  workshop.config["sources"]["video"]["command"] = {"./film", "{first_frame}", "seed {seed}", "{out}"};
  workshop.write();
  for (const auto& [out, seed] : {std::pair{"a", "5"}, {"b", "7"}, {"c", "5"}}) {
    const ProgramResult result = Workshop::run(out, {"--seed", seed});
    INFO(result.err);
    CHECK(result.status == 0);
  }
  CHECK(lines_of("film.txt") == Names{"seed 5", "seed 7"});
  CHECK(lines_of("mask.txt").size() == 1);  // the frames are the same
  const Names all = made();
  CHECK(std::count(all.begin(), all.end(), "video-KEY.json") == 2);
}

TEST_CASE("what was made before is held to what is asked for now", "[run]") {
  Workshop workshop;
  const ProgramResult first = Workshop::run("first");
  INFO(first.err);
  REQUIRE(first.status == 0);
  const std::string video = fs::absolute(made_file("video", ".json").replace_extension()).string();
  SECTION("the number of frames") {
    workshop.config["sources"]["video"]["frames"] = 5;
    workshop.write();
    CHECK(Workshop::refusal() == "/sources/video/frames: asks for 5 frames; " + video +
                                     ", which the same command has made before, has 4; remove that to have it made "
                                     "again\n");
    CHECK_THAT(Workshop::run("run", {"--dry-run"}).err, StartsWith("/sources/video/frames: asks for 5 frames; "));
    CHECK(lines_of("film.txt").size() == 1);
    CHECK(Workshop::run("right", {"--set", "sources.video.frames=4"}).status == 0);
  }
  SECTION("a mask of every frame") {
    const fs::path masks = fs::absolute(made_file("masks", ".json").replace_extension());
    fs::remove(masks / "human" / "0002.png");
    CHECK(Workshop::refusal() ==
          "/sources/masks: " + masks.string() +
              ", made before: human has no mask of 1 of 4 frames, the first 0002.png; where nothing of it is seen a "
              "mask is black; remove that folder to have it made again\n");
    CHECK(lines_of("mask.txt").size() == 1);
  }
}

TEST_CASE("programs and the files that their commands name count by their content", "[run]") {
  Workshop workshop;
  workshop.config["sources"].erase("masks");
  workshop.config["data"]["masks"] = (TinyDataset::folder() / "masks").string();
  auto& command = workshop.config["sources"]["video"]["command"];
  command.push_back("--steps=steps.txt");
  std::ofstream("steps.txt") << "30";
  workshop.write();
  const auto is_made_anew = [] {
    return Workshop::run("dry", {"--dry-run"}).out.find("would run ./film, ") != std::string::npos;
  };
  REQUIRE(Workshop::run("first").status == 0);
  CHECK_FALSE(is_made_anew());
  CHECK_THAT(file_text(made_file("video", ".json")), Contains(" ./film\\n") && Contains(" steps.txt\\n"));
  std::ofstream("steps.txt") << "50";
  CHECK(is_made_anew());
  std::ofstream("steps.txt") << "30";
  CHECK_FALSE(is_made_anew());
  const std::string film = file_text("film");
  std::ofstream("film") << film << "# better";
  CHECK(is_made_anew());

  // A log that is named in the command is taken as the program leaves it: what was paid for is found again.
  Workshop::script(
      "film", "echo \"$2\" | tee -a film.txt >> log.txt; cp -r " + TinyDataset::folder().string() + "/frames \"$3\"");
  command.push_back("log.txt");
  workshop.write();
  std::ofstream("log.txt") << "begins\n";
  const ProgramResult logged = Workshop::run("logged");
  CHECK(logged.status == 0);
  CHECK_THAT(logged.err, Contains("/sources/video/command: ./film, steps.txt, log.txt: what of these the program has "
                                  "changed is taken as it is now; "));
  CHECK_FALSE(is_made_anew());
  CHECK(temporaries_in("generated").empty());
}

TEST_CASE("files of a command are its program by path and whole arguments") {
  const TemporaryFolder here;
  for (const char* const name : {"tool", "a.json", "b=c", "{x}"}) std::ofstream(name) << name;
  fs::create_directory("folder");
  CHECK(files_of_command({"tool", "--in=a.json", "a.json", "b=c", "{x}", "folder", "none", "--a"}) ==
        Names{"a.json", "b=c"});
  CHECK(files_of_command({"./tool", "./tool"}) == Names{"./tool"});
  // A large file counts by its size and its ends.
  {
    std::ofstream large("large", std::ios::binary);
    large.seekp((65 << 20) - 1);
    large << "z";
  }
  const std::string before = command_hashes({"run", "large"});
  const auto change = [](std::streamoff at) {
    std::fstream file("large", std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(at);
    file << "y";
  };
  change((65 << 20) - 1);
  const std::string after = command_hashes({"run", "large"});
  CHECK(after != before);
  change(0);
  CHECK(command_hashes({"run", "large"}) != after);
}

TEST_CASE("waits before a program is run again are doubled up to an hour") {
  ProgramSettings settings;
  CHECK(seconds_before_retry(settings, 1) == 10);
  CHECK(seconds_before_retry(settings, 3) == 40);
  CHECK(seconds_before_retry(settings, 100) == 3600);
  settings.retry_wait_s = 7200;
  CHECK(seconds_before_retry(settings, 5) == 7200);
}

TEST_CASE("masks alone can be made of a video that is there", "[run]") {
  Workshop workshop;
  workshop.config["sources"].erase("video");
  workshop.config["data"]["frames"] = (TinyDataset::folder() / "frames").string();
  workshop.config["sources"]["folder"] = "made/here";
  Workshop::script("mask", "test -s \"$3/human.png\" && test -s \"$3/" + kTinyObject +
                               ".png\" || exit 9; echo >> mask.txt; "
                               "cp -r " +
                               TinyDataset::folder().string() + "/masks \"$4\"");
  workshop.config["sources"]["masks"]["command"] = {"./mask", "{video}", "{objects}", "{first_masks}", "{out}"};
  workshop.write();
  const ProgramResult result = Workshop::run("run");
  INFO(result.err);
  CHECK(result.status == 0);
  CHECK(lines_of("film.txt").empty());
  CHECK(lines_of("mask.txt").size() == 1);
  CHECK_FALSE(fs::exists("generated"));
  CHECK(fs::exists("made/here"));
}

TEST_CASE("programs that fail are told with the end of what they print", "[run]") {
  Workshop workshop;
  const std::string section = "/sources/video: ./film";
  SECTION("an exit status") {
    Workshop::script("film", "echo no credit left >&2; exit 3");
    CHECK(Workshop::refusal() == section + ": ended with status 3:\nno credit left\n");
    CHECK(made().empty());
  }
  SECTION("no output") {
    Workshop::script("film", "echo all went well");
    CHECK_THAT(Workshop::refusal(), Matches(section + ": ended with status 0 and wrote nothing at \\{out\\}, " +
                                            kPlaces + "/video:\nall went well\n"));
    CHECK(made().empty());
  }
  SECTION("time") {
    workshop.config["sources"]["video"]["timeout_s"] = 0.3;
    workshop.write();
    Workshop::script("film", "echo begun; sleep 60");
    CHECK(Workshop::refusal() == section + ": was ended after 0.3 seconds, which is all the time it has:\nbegun\n");
    CHECK(made().empty());
  }
  SECTION("what is no video") {
    workshop.config["sources"]["video"]["output"] = "mp4";
    workshop.write();
    Workshop::script("film", "echo text > \"$3\"");
    CHECK_THAT(Workshop::refusal(),
               Matches(section + " wrote what cannot be used, kept as " + kPlaces +
                       "/video-[0-9a-f]{16}.refused.mp4: " + kPlaces + "is not a video that can be read" + kPlaces));
    CHECK(made() == Names{"video-KEY.refused.mp4"});
  }
  SECTION("size") {
    const std::string data = TinyDataset::folder().string();
    write_image("wide.png", Image(3, 48, 96));
    Workshop::script("film", "cp -r " + data + "/frames \"$3\"; cp wide.png \"$3/0002.png\"");
    CHECK_THAT(
        Workshop::refusal(),
        Contains("frame 2 is 96x48 with 3 channels; the camera's image is 48x48 with 3, and a video is as large, "
                 "or larger and of its shape"));
    CHECK(made() == Names{"video-KEY.refused"});
  }
  SECTION("length") {
    workshop.config["sources"]["video"]["frames"] = 5;
    workshop.write();
    CHECK_THAT(Workshop::refusal(), Contains("has 4 frames; sources.video.frames asks for 5; it printed nothing\n"));
  }
  SECTION("masks of an object") {
    Workshop::script("mask",
                     "cp -r " + TinyDataset::folder().string() + "/masks \"$3\"; rm -r \"$3/" + kTinyObject + "\"");
    CHECK_THAT(Workshop::refusal(), StartsWith("/sources/masks: ./mask wrote what cannot be used") &&
                                        Contains(kTinyObject + ": there is no such folder of masks"));
  }
  SECTION("names of masks") {
    Workshop::script("mask", "cp -r " + TinyDataset::folder().string() +
                                 "/masks \"$3\"; cd \"$3/human\"; "
                                 "for f in *; do mv $f mask_$f; done");
    CHECK_THAT(Workshop::refusal(),
               Contains("human has no mask of any frame; their names are those of the frames, 0000.png to 0003.png"));
  }
  SECTION("a mask of one frame") {
    Workshop::script("mask", "cp -r " + TinyDataset::folder().string() + "/masks \"$3\"; rm \"$3/human/0001.png\"");
    CHECK_THAT(Workshop::refusal(),
               Contains("human has no mask of 1 of 4 frames, the first 0001.png; where nothing of it is seen a mask is "
                        "black"));
    CHECK(Workshop::run("run").status == 2);  // and what was refused before is kept
    CHECK(made() ==
          Names{"masks-KEY.refused", "masks-KEY.refused2", "video-KEY", "video-KEY.first_frame.png", "video-KEY.json"});
  }
  SECTION("sizes of masks") {
    write_image("small.png", Image(1, 24, 24));
    Workshop::script("mask", "cp -r " + TinyDataset::folder().string() +
                                 "/masks \"$3\"; cp small.png "
                                 "\"$3/human/0003.png\"");
    CHECK_THAT(Workshop::refusal(), Contains("the mask of human in frame 3 is 24x24 pixels, the video's frame 48x48"));
  }
  SECTION("a folder in use is refused before anything is made") {
    fs::create_directory("run");
    std::ofstream("run/note.txt") << "mine";
    CHECK(Workshop::run("run").status == 2);
    CHECK(lines_of("film.txt").empty());
  }
}

TEST_CASE("Ctrl-C ends the program that is run, and leaves nothing", "[run]") {
  const Workshop workshop;
  Workshop::script("film", "echo $$ > pid.txt; sleep 60");
  RunningProgram program({"run", "config.json", "--out", "run"});
  const auto is_begun = [] { return fs::exists("pid.txt") && !file_text("pid.txt").empty(); };
  REQUIRE(program.signal_at(SIGINT, is_begun));
  CHECK(program.result() == 130);
  CHECK_THAT(program.text(), Contains("interrupted while ./film made the video; nothing is left of it"));
  CHECK(made().empty());
  CHECK_FALSE(fs::exists("run"));
  CHECK(kill(std::stoi(file_text("pid.txt")), 0) != 0);
}

TEST_CASE("two runs that want the same video make it once", "[run]") {
  const Workshop workshop;
  const std::string data = TinyDataset::folder().string();
  Workshop::script(
      "film", "echo \"$2\" >> film.txt; while ! test -e go; do sleep 0.05; done; cp -r " + data + "/frames \"$3\"");
  RunningProgram first({"run", "config.json", "--threads", "1", "--out", "first"});
  REQUIRE(comes([] { return !lines_of("film.txt").empty(); }));
  RunningProgram second({"run", "config.json", "--threads", "1", "--out", "second"});
  CHECK(comes([&second] { return second.text().find("another process makes it") != std::string::npos; }));
  std::ofstream("go") << "";
  CHECK(comes([&] { return !first.is_running() && !second.is_running(); }));
  CHECK(first.result() == 0);
  CHECK(second.result() == 0);
  CHECK(lines_of("film.txt").size() == 1);
  CHECK(lines_of("mask.txt").size() == 1);
  CHECK(made() == Names{"masks-KEY", "masks-KEY.json", "video-KEY", "video-KEY.first_frame.png", "video-KEY.json"});
}

TEST_CASE("a killed run leaves a work folder that the next one removes", "[run]") {
  const Workshop workshop;
  Workshop::script("film", "echo $$ > pid.txt; exec sleep 60");
  RunningProgram program({"run", "config.json", "--out", "run"});
  const auto is_begun = [] { return fs::exists("pid.txt") && !file_text("pid.txt").empty(); };
  REQUIRE(program.signal_at(SIGKILL, is_begun));
  kill(std::stoi(file_text("pid.txt")), SIGKILL);  // the generator goes on without its caller
  const auto work_folders = [] {
    const Names names = made();
    return std::count_if(names.begin(), names.end(), [](const std::string& name) { return name.ends_with(".tmp"); });
  };
  CHECK(work_folders() == 1);
  fs::create_directories("generated/video-0123456789abcdef.mp4.1.tmp");  // of another prompt, process 1 is alive
  fs::create_directories("generated/mine.1.tmp");
  Workshop::script("film", "cp -r " + TinyDataset::folder().string() + "/frames \"$3\"");
  CHECK(Workshop::run("run").status == 0);
  CHECK(made() ==
        Names{"masks-KEY", "masks-KEY.json", "mine.1.tmp", "video-KEY", "video-KEY.first_frame.png", "video-KEY.json"});
}

TEST_CASE("what is being made elsewhere is not swept, and what has its record alone is not there", "[run]") {
  const Workshop workshop;
  const fs::path output = "generated/video-0123456789abcdef.mp4";
  {
    const SourceLock lock(output, {});
    fs::create_directories(output.string() + ".1.tmp");
    sweep_work_folders("generated");
    CHECK(fs::exists(output.string() + ".1.tmp"));
    CHECK_THROWS_AS(SourceLock(output, [] { return true; }), Interrupted);
  }
  sweep_work_folders("generated");
  CHECK(fs::is_empty("generated"));

  // As a kill leaves it between the record and the video: the video is made. After the video nothing is made again.
  REQUIRE(Workshop::run("run").status == 0);
  fs::remove_all("generated" / made_file("video", ".json").stem());
  CHECK(Workshop::run("again").status == 0);
  CHECK(lines_of("film.txt").size() == 2);
  CHECK(lines_of("mask.txt").size() == 1);
}

}  // namespace sources_test
