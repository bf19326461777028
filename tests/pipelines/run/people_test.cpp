// Runs with two people in one clip: what is found, what is written, and what is refused.
#include <filesystem>

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "core/check.h"
#include "optim/stage_gradcheck.h"
#include "pipelines/run/stage_inputs.h"
#include "tests/support/tiny_run.h"

namespace people_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// The tiny dataset with a friend who waves behind the first person.
struct TwoPeople {
  TemporaryFolder here;
  fs::path path = here.path() / "data";

  TwoPeople() {
    SyntheticSettings settings = TinyDataset::settings();
    settings.size_px = 64;
    settings.camera_distance = 1.5;
    SyntheticPerson person;
    person.motion = SyntheticMotionKind::kWave;
    person.beside = {-0.5, 0.5};
    settings.people.emplace_back("friend", person);
    ConfigProblems problems;
    const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", here.path(), {}, problems);
    problems.throw_if_any();
    write_dataset(settings, video_render_settings(), path, {}, stages);
  }
  RunConfig config(const std::vector<std::string>& overrides = {}) const { return config_in(path, overrides); }
  void change_config(const std::function<void(nlohmann::ordered_json&)>& change) const {
    write_changed(path / "config.json", path / "config.json", change);
  }
};

void move_colors(RunConfig& config) {
  ParameterGroupSettings moved;
  moved.lr = 0.003;
  for (auto& [name, stage] : config.stages) {
    if (name == "interaction") stage.optimize.emplace_back("color_net", moved);
  }
}

/// More iterations, with color nets.
const std::vector<std::string> kStrong = {"stages.interaction.iterations=60", "color_net.use=on",
                                          "color_net.features=4", "color_net.hidden_width=8"};

/// Of a run that is refused.
std::string message_of(const TwoPeople& clip, const std::vector<std::string>& overrides = {}) {
  try {
    execute_tiny(clip.config(overrides), "refused");
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("two people of a generated clip are found, each against its truth", "[run][people]") {
  const TwoPeople clip;
  RunConfig config = clip.config(kStrong);
  move_colors(config);
  const RunSummary summary = execute_tiny(config, "run", 2);
  const double first = last_number(summary, "world_mpjpe_mm"),
               first_start = number_in(summary.baselines.front().values, "world_mpjpe_mm");
  REQUIRE(summary.people.size() == 1);
  const PersonSummary& person = summary.people.front();
  CHECK(person.name == "friend");
  const double other = number_in(person.result, "world_mpjpe_mm"),
               other_start = number_in(person.start, "world_mpjpe_mm");
  WARN("world MPJPE: the first person " << first_start << " mm, then " << first << " mm; the friend " << other_start
                                        << " mm, then " << other << " mm");
  CHECK(first < 0.6 * first_start);
  CHECK(other < 0.6 * other_start);
  CHECK(find_metric(person.result, "camera_translation_cm") == nullptr);
  CHECK(person.per_frame.size() == kTinyFrames - 1);
  CHECK(parse_summary(summary_json(summary), "summary.json").people.front().result == person.result);
  CHECK_THAT(error_text(summary), Contains("friend, start"));
  CHECK_THAT(file_text("run/report.html"), Contains("friend, start"));
  // Each has a motion of its own, and a network.
  const Motion motion = read_motion("run/motion.npz"), of_friend = read_motion("run/motion_of_friend.npz");
  CHECK(of_friend.poses.size() == kTinyFrames);
  CHECK((of_friend.poses[0].transl - motion.poses[0].transl).norm() > 0.3);
  CHECK(fs::exists("run/color_net_of_friend.safetensors"));
  // Whoever moves the first person alone leaves the other one where it was.
  RunConfig without = config;
  without.data.people.clear();
  CHECK(execute_tiny(without, "without").people.empty());
  CHECK_FALSE(fs::exists("without/motion_of_friend.npz"));
}

TEST_CASE("a run with two people has the same bits on any number of threads, and when it is resumed", "[run][people]") {
  const TwoPeople clip;
  clip.change_config([](nlohmann::ordered_json& config) {  // sigmas of both
    config["stages"]["refinement"] = nlohmann::ordered_json::parse(R"({
      "over": "sequence", "iterations": 3, "optimize": {"transl": {"lr": 0.001}},
      "losses": {"fit": {"by_sigma": true}, "smooth": {}}})");
  });
  RunConfig config = clip.config({"stages.interaction.iterations=4", "color_net.use=on", "color_net.features=4",
                                  "color_net.hidden_width=8", "start.objects=best", "remove_depth_bias=true"});
  move_colors(config);
  execute_tiny(config, "one", 1);
  execute_tiny(config, "two", 2);
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "resumed", 1, false, [&] { return ++count == 2 * 12 + 5; }), Interrupted);
  execute_tiny(config, "resumed", 2, true);
  for (const char* other : {"two", "resumed"}) {
    INFO(other);
    CHECK(differences("one", other) == std::vector<std::string>());
    for (const char* file : {"motion_of_friend.npz", "color_net_of_friend.safetensors"})
      CHECK(file_text(fs::path("one") / file) == file_text(fs::path(other) / file));
  }
}

TEST_CASE("gradients of a stage with two people agree with differences", "[run][people][release]") {
  const TwoPeople clip;
  StageChoice choice;
  choice.stage = "interaction";
  const StageInputs inputs(clip.config({"start.root=velocity"}), loss_terms(), choice);
  const StageGradcheck check = check_frame_stage(inputs.task(), inputs.frame_task(), inputs.start, inputs.colors());
  for (const GroupGradcheck& group : check.groups) {
    INFO(group.group << ": " << group.report.text());
    CHECK(group.report.ok());
  }
  CHECK(check.ok());
}

TEST_CASE("people who are named wrongly are refused", "[run][people]") {
  const TwoPeople clip;
  const auto message_with = [&clip](const std::string& name,
                                    const nlohmann::ordered_json& more = nlohmann::ordered_json::object()) {
    clip.change_config([&](nlohmann::ordered_json& config) {
      auto& people = config["data"]["people"];
      nlohmann::ordered_json person = people.begin().value();
      person.update(more);
      people = nlohmann::ordered_json::object();
      people[name] = person;
    });
    return message_of(clip);
  };
  CHECK_THAT(message_with("human"), Contains("/data/people/human: \"human\" is the first person, whom /data names"));
  CHECK_THAT(message_with(kTinyObject), Contains("is the name of an object too, whose masks have that folder"));
  CHECK_THAT(message_with("a/b"), Contains("cannot be a name; allowed: letters, digits, '_' and '-'"));
  CHECK_THAT(message_with("friend", {{"avatar", "nowhere.safetensors"}}),
             Contains("/data/people/friend/avatar") && Contains("nowhere.safetensors"));
  CHECK_THAT(message_with("friend", {{"colour", 1}}), Contains("/data/people/friend/colour"));
  clip.change_config([](nlohmann::ordered_json& config) {
    config["data"]["people"]["friend"].erase("colour");
    config["data"]["people"]["friend"].erase("avatar");
  });
  CHECK_THAT(message_of(clip), Contains("/data/people/friend: the key \"avatar\" is missing"));
}

TEST_CASE("what knows of one person is refused with two, and told", "[run][people]") {
  const TwoPeople clip;
  CHECK_THAT(message_of(clip, {"uncertainty=true"}),
             Contains("/uncertainty: /data/people names more people, and this is told of one person; allowed: false"));
  CHECK_THAT(message_of(clip, {"sources.motion.program=embedded"}),
             Contains("/sources: /data/people names more people, and this knows one person"));
  CHECK_THAT(message_of(clip, {"data.tracks=" + (clip.path / "initial_motion.npz").string()}),
             Contains("/data/tracks: /data/people names more people, and this follows points of one person"));
  clip.change_config([](nlohmann::ordered_json& config) {
    config["stages"]["found"] = nlohmann::ordered_json::parse(
        R"({"over": "first_frame", "headings": 4, "iterations": 1,
            "optimize": {"transl": {"lr": 0.01}, "betas": {"lr": 0.01}}, "losses": {"photometric": {}}})");
  });
  CHECK_THAT(message_of(clip), Contains("this is tried of one person; allowed: 1") &&
                                   Contains("this is of one person; leave the group out"));
}

TEST_CASE("joints of keypoints are told of those of a further person alone too", "[run][people]") {
  const TwoPeople clip;
  const std::vector<std::string> joints = {"data.keypoint_joints=" + (clip.path / "initial.json").string()};
  const std::string without = "/data/keypoint_joints: given without /data/keypoints";
  CHECK_THAT(message_of(clip, joints), Contains(without));
  clip.change_config([&](nlohmann::ordered_json& config) {
    config["data"]["people"]["friend"]["keypoints"] = (clip.path / "initial.json").string();
  });
  CHECK_THAT(message_of(clip, joints), !Contains(without) && Contains("initial.json"));  // which has no keypoints
}

TEST_CASE("files of people that do not fit are named", "[run][people]") {
  const TwoPeople clip;
  const fs::path masks = clip.path / "masks" / "friend";
  fs::rename(masks / "0002.png", masks / "0009.png");  // as many as frames, and not theirs
  CHECK_THAT(message_of(clip), Contains("masks/friend") && Contains("has no mask for 1 of 4 frames"));
  fs::rename(masks / "0009.png", masks / "0002.png");
  fs::rename(masks, clip.path / "masks" / "other");
  CHECK_THAT(message_of(clip), Contains("masks/friend"));
  fs::rename(clip.path / "masks" / "other", masks);
  fs::rename(clip.path / "truth" / "motion_of_friend.npz", clip.path / "elsewhere.npz");
  CHECK_THAT(message_of(clip), Contains("motion_of_friend.npz"));
  fs::rename(clip.path / "elsewhere.npz", clip.path / "truth" / "motion_of_friend.npz");
  const std::string avatar_file = (clip.path / "people" / "friend" / "avatar.safetensors").string();
  Avatar avatar = read_avatar(avatar_file);
  avatar.color_net = new_color_net(avatar.means, avatar.joint_count(), {});
  write_avatar(avatar_file, avatar);
  CHECK_THAT(message_of(clip),
             Contains("/color_net/use: \"auto\": the avatar of human has no color net, unlike that of "
                      "friend; allowed: \"on\""));
  avatar.color_net.reset();
  write_avatar(avatar_file, avatar);
  const fs::path initial = clip.path / "people" / "friend" / "initial.json";
  write_changed(initial, initial, [](nlohmann::ordered_json& state) {
    state["objects"]["vase"] = {{"rotation", {0, 0, 0}}, {"translation", {0, 0, 0}}};
  });
  CHECK_THAT(message_of(clip), Contains("objects belong in data.initial"));
}

}  // namespace people_test
