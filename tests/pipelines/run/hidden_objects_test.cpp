#include "pipelines/run/hidden_objects.h"

#include <limits>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "core/rigid.h"
#include "core/rotation.h"
#include "pipelines/run/hidden_path.h"
#include "tests/support/tiny_run.h"

namespace hidden_objects_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr Index kChest = 9, kLeftWrist = 20, kRightWrist = 21;
constexpr double kThreshold = 0.5;
const std::vector<std::string> kNone;

Clip tiny_clip() { return read_run_clip(tiny_config(), loss_terms()); }

Vector3<double> joint_of(const Clip& clip, const SceneState& state, Index joint) {
  return Vector3<double>(pose_joints(clip.avatar, state.body).data() + 3 * joint);
}

Rigid<double> pose_in(const SceneState& state) {
  return {so3_exp(state.objects[0].rotation), state.objects[0].translation};
}

/// Turns and moves the body, about the world's axes, and bends its elbows.
SceneState moved(const SceneState& state, double turn, const Vector3<double>& step) {
  SceneState next = state;
  const Matrix3<double> rotation = so3_exp(Vector3<double>(0, 0, turn));
  next.body.set_rotation(0, so3_log(Matrix3<double>(rotation * so3_exp(state.body.rotation_of(0)))));
  next.body.transl += step;
  for (const Index elbow : {Index{18}, Index{19}})
    next.body.set_rotation(elbow, Vector3<double>(0.1 + turn, -0.2, 0.3));
  return next;
}

/// The clip's first state with the object's centroid in a wrist.
SceneState held_by(const Clip& clip, Index wrist) {
  SceneState state = clip.first;
  state.objects[0].translation = joint_of(clip, state, wrist);
  return state;
}

/// States of a walk in which the object goes with what carries it.
std::vector<SceneState> walk(const Clip& clip, const Carrier& carrier, const SceneState& first) {
  std::vector<SceneState> states = {first};
  for (int t = 1; t < 4; ++t) {
    SceneState next = moved(states.back(), 0.3, {0.1, -0.05, 0.01});
    next.objects[0] = carried_pose(clip, carrier, 0, states.back(), next);
    states.push_back(next);
  }
  return states;
}

std::vector<const SceneState*> pointers(const std::vector<SceneState>& states) {
  std::vector<const SceneState*> all;
  for (const SceneState& state : states) all.push_back(&state);
  return all;
}

/// Runs that were stopped after so many iterations and go on have the bits of `run`.
void check_stopped_after(const RunConfig& config, const std::vector<int>& iterations) {
  for (const int last : iterations) {
    int count = 0;
    const std::string run = "stopped" + std::to_string(last);
    CHECK_THROWS_AS(execute_tiny(config, run, 1, false, [&] { return ++count == last; }), Interrupted);
    execute_tiny(config, run, 2, true);
    CHECK(differences("run", run) == kNone);
  }
}

}  // namespace

TEST_CASE("what a joint carries keeps its distances from the joints that hang on it") {
  const Clip clip = tiny_clip();
  for (const Index wrist : {kLeftWrist, kRightWrist}) {
    const std::vector<SceneState> states = walk(clip, {wrist}, held_by(clip, wrist));
    const Index thumb = wrist == kLeftWrist ? 37 : 52, index_finger = wrist == kLeftWrist ? 25 : 40;
    const auto distances = [&](const SceneState& state) {
      std::vector<double> all;
      for (const Index joint : {wrist, thumb, index_finger}) {
        for (const Vector3<double>& corner : {Vector3<double>(0, 0, 0), Vector3<double>(0.1, 0.2, -0.1)})
          all.push_back((transform_point(pose_in(state), corner) - joint_of(clip, state, joint)).norm());
      }
      return all;
    };
    for (const SceneState& state : states) {
      const std::vector<double> first = distances(states.front()), now = distances(state);
      for (std::size_t i = 0; i < first.size(); ++i) CHECK(now[i] == Approx(first[i]).margin(1e-12));
    }
    CHECK((states.back().objects[0].translation - states.front().objects[0].translation).norm() > 0.05);
  }
}

TEST_CASE("what stays before the chest while hands move goes with the chest") {
  const Clip clip = tiny_clip();
  const std::vector<SceneState> states = walk(clip, {kChest}, held_by(clip, kRightWrist));
  CHECK(carrier_of(clip, 0, {&states[3], &states[2], &states[1], &states[0]}) == Carrier{kChest});
  CHECK(carrier_of(clip, 0, {&states.front()}) == Carrier{kChest});  // touched, and nothing speaks against it
  CHECK(carrier_text(clip, {kChest}) == "stays with the chest");
  Clip two = clip;
  two.others.emplace_back().name = "friend";
  CHECK(carrier_text(two, {kChest, 1}) == "stays with the chest of friend");
}

TEST_CASE("what stands while hands move, or is far from them, goes with the world") {
  const Clip clip = tiny_clip();
  const std::vector<SceneState> touched = walk(clip, {}, held_by(clip, kRightWrist));
  CHECK(carrier_of(clip, 0, pointers(touched)) == Carrier{});
  SceneState far = clip.first;
  far.objects[0].translation += Vector3<double>(0, 0, 3);
  CHECK(carrier_of(clip, 0, pointers(walk(clip, {kRightWrist}, far))) == Carrier{});
  CHECK(carried_pose(clip, {}, 0, touched[0], touched[3]).translation == touched[0].objects[0].translation);
  CHECK(carrier_text(clip, {}) == "stays where it was");
}

TEST_CASE("between two frames an object turns and moves evenly as its carrier sees it") {
  const Clip clip = tiny_clip();
  for (const Carrier& carrier : {Carrier{}, Carrier{kRightWrist}, Carrier{kChest}}) {
    std::vector<SceneState> states = walk(clip, carrier, held_by(clip, kRightWrist));
    // In the last frame it is 3 cm and 0.3 radians from where its carrier took it.
    const SceneState carried = states[3];
    ObjectPose& last = states[3].objects[0];
    last.translation += Vector3<double>(0.03, 0, 0);
    last.rotation = so3_log(Matrix3<double>(so3_exp(Vector3<double>(0, 0.3, 0)) * so3_exp(last.rotation)));
    const ObjectPose end = last;
    for (std::size_t t : {1, 2}) states[t].objects[0] = {};
    lay_between(clip, carrier, 0, 0, 3, states);
    CHECK(states[3].objects[0].translation == end.translation);
    for (std::size_t t : {1, 2}) {
      SceneState expected = states[t];
      expected.objects[0] = carried_pose(clip, carrier, 0, states[0], states[t]);
      const double share = static_cast<double>(t) / 3;
      CHECK((states[t].objects[0].translation - expected.objects[0].translation).norm() ==
            Approx(share * (end.translation - carried.objects[0].translation).norm()).margin(1e-12));
      CHECK(so3_log(Matrix3<double>(pose_in(expected).rotation.transpose() * pose_in(states[t]).rotation)).norm() ==
            Approx(share * 0.3).margin(1e-9));
    }
  }
}

TEST_CASE("what goes with a hand and stays upright turns with the person alone") {
  const Clip clip = tiny_clip();
  const Carrier hand{kRightWrist, 0, true};
  const std::vector<SceneState> states = walk(clip, hand, held_by(clip, kRightWrist));
  for (const SceneState& state : states)
    CHECK((state.objects[0].translation - joint_of(clip, state, kRightWrist)).norm() < 1e-12);
  const Rigid<double> first = pose_in(states.front()), last = pose_in(states.back());
  const Matrix3<double> turn = so3_exp(Vector3<double>(0, 0, 0.9));  // three steps of walk
  CHECK((last.rotation - turn * first.rotation).norm() < 1e-9);
  CHECK(carrier_text(clip, hand) == "stays with the right hand");
  CHECK(carrier_text(clip, {kLeftWrist, 0, true}) == "stays with the left hand");
}

TEST_CASE("what frames say is not with the chest goes with the hand that images know, as far as they allow") {
  const Clip clip = tiny_clip();
  std::vector<SceneState> states = walk(clip, {kRightWrist, 0, true}, held_by(clip, kRightWrist));
  while (states.size() < 10) states.push_back(moved(states.back(), 0.1, {0.02, 0.01, 0}));
  for (std::size_t t = 3; t < 7; ++t) states[t].body.set_rotation(19, Vector3<double>(0, 1.2, 0));  // the right elbow
  for (std::size_t t = 3; t < 8; ++t) states[t].body.transl[2] -= t == 3 || t == 7 ? 3 : 1.5;       // lowest in 3 and 7
  const HiddenGap gap{0, 1, 8};
  states[8].objects[0] = carried_pose(clip, {kRightWrist, 0, true}, 0, states[1], states[8]);
  states[8].objects[0].translation += Vector3<double>(0.02, 0, 0);
  std::vector<PlaceSigmas> sigmas(states.size(), no_sigmas(1));
  for (PlaceSigmas& of_frame : sigmas) {
    of_frame.joints[kLeftWrist].across = 0.02;
    of_frame.joints[kRightWrist].across = 0.01;
  }
  const auto distance = [&](std::size_t t) {
    return (states[t].objects[0].translation - joint_of(clip, states[t], kRightWrist)).norm();
  };
  const auto is_far = [&](double most) {
    return [&, most](std::size_t t, const SceneState& state) {
      return (state.objects[0].translation - joint_of(clip, states[t], kRightWrist)).norm() > most;
    };
  };
  const Carrier chest{kChest};
  const std::vector<SceneState> start = states;

  CHECK(lay_gap(
            clip, chest, gap, [](auto...) { return false; }, sigmas, states) == "");
  const std::vector<SceneState> with_chest = states;
  CHECK(distance(4) > 0.05);
  states = start;
  CHECK(lay_gap(clip, chest, gap, is_far(0.03), {}, states) == "");  // no sigmas tell which hand
  for (std::size_t t = 0; t < states.size(); ++t) {
    CHECK(states[t].objects[0].translation == with_chest[t].objects[0].translation);
    CHECK(states[t].objects[0].rotation == with_chest[t].objects[0].rotation);
  }

  CHECK(lay_gap(clip, chest, gap, is_far(0.03), sigmas, states) ==
        "frames 2 to 7: more of watering_can would show than does; it stays with the right hand");
  for (std::size_t t = 2; t < 8; ++t) {
    CAPTURE(t);
    CHECK(distance(t) <= 0.02 + 1e-9);  // evenly from no distance to two centimetres
    CHECK(distance(t) >= distance(t - 1) - 1e-9);
  }

  // In frame 5 it may not be there either: it is put down where the hand is lowest before that, and taken after it.
  const auto but_middle = [&](std::size_t t, const SceneState& state) { return t == 5 || is_far(0.03)(t, state); };
  CHECK_THAT(lay_gap(clip, chest, gap, but_middle, sigmas, states),
             Contains("it stays with the right hand, is put down in frame 3 and taken in frame 7"));
  CHECK(distance(2) == Approx(0).margin(1e-9));
  CHECK(distance(3) == Approx(0).margin(1e-9));
  CHECK(distance(7) == Approx(0.02).margin(1e-9));
  const Vector3<double> put = states[3].objects[0].translation, taken = states[7].objects[0].translation;
  for (const std::size_t t : {4, 5, 6}) {
    const double share = (static_cast<double>(t) - 3) / 4;
    CHECK((states[t].objects[0].translation - (1 - share) * put - share * taken).norm() < 1e-9);
  }
  // What meets in the middle is carried.
  const auto meeting = [&](std::size_t t, const SceneState& state) { return is_far(0.01)(t, state) != (t >= 5); };
  CHECK_THAT(lay_gap(clip, chest, gap, meeting, sigmas, states),
             Contains("it stays with the right hand") && !Contains("put"));

  // Nothing is known of a hand, or it gets nowhere: the chest.
  const auto nowhere = [&](std::size_t t, const SceneState&) { return t == 2 || t == 7; };
  CHECK_THAT(lay_gap(clip, chest, gap, nowhere, sigmas, states), Contains("it stays with the chest all the same"));
  for (std::size_t t = 2; t < 8; ++t) CHECK(states[t].objects[0].translation == with_chest[t].objects[0].translation);
  for (PlaceSigmas& of_frame : sigmas) of_frame.joints[kLeftWrist].across = 0.001;  // which does not touch it
  CHECK_THAT(lay_gap(clip, chest, gap, is_far(0.03), sigmas, states), Contains("it stays with the right hand"));
  sigmas[4].joints[kRightWrist].across = std::numeric_limits<double>::quiet_NaN();
  CHECK_THAT(lay_gap(clip, chest, gap, is_far(0.03), sigmas, states), Contains("it stays with the chest all the same"));
}

TEST_CASE("the share of an object that is seen is that of its mask") {
  const Clip clip = tiny_clip();
  ClipFrame frame = read_frame(clip, 0);
  const double whole = seen_shares(clip, frame, kThreshold, clip.first).at(0);
  CHECK(whole > 0.3);
  Image& mask = frame.object_masks[0];
  const Image full = mask;
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) mask(0, y, x) = (x + y) % 2 == 0 ? full(0, y, x) : 0;
  }
  CHECK(seen_shares(clip, frame, kThreshold, clip.first).at(0) == Approx(whole / 2).epsilon(0.15));
  mask = Image(1, mask.height(), mask.width());
  CHECK(seen_shares(clip, frame, kThreshold, clip.first).at(0) == 0);
  frame.object_masks[0] = {};
  CHECK(seen_shares(clip, frame, kThreshold, clip.first).at(0) == 1);
}

TEST_CASE("an object that is seen again is found where the image shows it") {
  const RunConfig config = tiny_config();
  const Clip clip = tiny_clip();
  const ClipFrame frame = read_frame(clip, 0);
  ColorState colors = first_color_state({});
  SceneState wrong = clip.first;
  wrong.objects[0].translation += Vector3<double>(0.5, 0, 0.3);
  FoundObject found = find_object(config, clip, 0, frame, wrong, clip.first, colors);
  CHECK(found.from == "where it was");
  CHECK(found.pose.translation == clip.first.objects[0].translation);
  SceneState aside = clip.first;  // across the view: its mask leads back
  const Rigid<double> world_from_camera = inverse(clip.first.camera_from_world);
  aside.objects[0].translation += world_from_camera.rotation * Vector3<double>(0.3, 0.1, 0);
  found = find_object(config, clip, 0, frame, aside, aside, colors);
  CHECK_THAT(found.from, Contains("at its mask"));
  CHECK((found.pose.translation - clip.first.objects[0].translation).norm() < 0.1);
  ClipFrame unmasked = frame;
  unmasked.object_masks[0] = Image(1, kTinyPixels, kTinyPixels);
  CHECK(find_object(config, clip, 0, unmasked, wrong, clip.first, colors).from == "where it was");
}

TEST_CASE("what is drawn of an object behind everything is nothing of it") {
  RunConfig config = tiny_config();
  config.start.objects = StartFrom::kBest;
  const Clip clip = tiny_clip();
  const ColorState colors = first_color_state({});
  const StatePicture shown = picture_of_state(config, clip, clip.first, colors);
  CHECK(drawn_share(clip, shown, 0, clip.first) > 0.3);
  CHECK(object_iou(shown, read_frame(clip, 0), 0).value() > 0.5);
  SceneState behind = clip.first;  // the camera
  const Rigid<double> world_from_camera = inverse(clip.first.camera_from_world);
  behind.objects[0].translation = transform_point(world_from_camera, Vector3<double>(0, 0, -1));
  const StatePicture hidden = picture_of_state(config, clip, behind, colors);
  CHECK(is_shown_at(config, clip, 0, read_frame(clip, 0), clip.first, colors));
  CHECK_FALSE(is_shown_at(config, clip, 0, read_frame(clip, 0), behind, colors));
  CHECK(drawn_share(clip, hidden, 0, behind) == 0);
  CHECK(object_iou(hidden, read_frame(clip, 0), 0) == 0);
  ClipFrame frame = read_frame(clip, 0);
  frame.object_masks[0] = Image(1, kTinyPixels, kTinyPixels);
  CHECK_FALSE(object_iou(shown, frame, 0));
}

TEST_CASE("a run keeps what is hidden with its carrier, and has the same bits after an interruption", "[run]") {
  const TemporaryFolder here;
  SyntheticSettings settings = TinyDataset::settings();
  settings.motion = SyntheticMotionKind::kWalk;
  settings.object = SyntheticObjectKind::kVase;
  settings.frames = 24;
  settings.frame_rate = 5;  // from frame 12 to 19 the vase is behind the body, or nearly
  settings.size_px = 96;
  ConfigProblems problems;
  const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", here.path(), {}, problems);
  write_dataset(settings, video_render_settings(), "data", {}, stages);
  here.write("hidden.json", R"({
    "extends": "data/config.json",
    "start": {"objects": "best", "root": "estimate"},
    "stages": {
      "interaction": {
        "iterations": 30,
        "optimize": {"object_light": {"lr": 0.02}},
        "losses": {
          "depth": null,
          "center": {"weight": 1e-5, "by_share": true, "moves": "object"},
          "mask": {"weight": 1, "human": false},
          "object_smooth": {"weight": 1, "free": 2}
        }
      }
    }})");
  const RunConfig config = load_run_config("hidden.json", {}, descriptions_of(loss_terms()));
  execute_tiny(config, "run");
  const std::string log = file_text("run/log.txt");
  CHECK_THAT(log, Contains("frame 15: vase is hidden, and stays with the chest"));
  CHECK_THAT(log, Contains(": vase is seen again, "));
  const nlohmann::json summary = json_of("run/summary.json");
  CHECK(summary["per_frame"][14]["object_seen_share"].get<double>() < kHiddenBelow);
  CHECK(summary["per_frame"][0]["object_seen_share"].get<double>() > 0.3);
  CHECK(summary["quality"].contains("object_iou"));
  // While nobody sees it, it keeps its light, and goes with the person.
  const std::vector<double> light = Npz::read("run/objects.npz").array("vase/light").as<double>();
  CHECK(std::equal(light.begin() + 6 * 15, light.begin() + 6 * 16, light.begin() + 6 * 16));
  CHECK_FALSE(std::equal(light.begin() + 6 * 5, light.begin() + 6 * 6, light.begin() + 6 * 6));
  const double of_hidden = summary["per_frame"][14]["object_translation_cm"], way = [&] {
    const auto truth = read_object_tracks("data/truth/objects.npz", {"vase"});
    return 100 * (truth[15][0].translation - truth[11][0].translation).norm();
  }();
  CAPTURE(of_hidden, way);
  CHECK(of_hidden < way / 2);
  constexpr int kEach = kPerFrame + 20;
  check_stopped_after(config, {14 * kEach + 12, 21 * kEach + 3});
}

TEST_CASE("a run finds on the table what was put down behind a screen, with the same bits after an interruption",
          "[run]") {
  const TemporaryFolder here;
  SyntheticSettings settings = TinyDataset::settings();
  settings.scene = SyntheticSceneKind::kTerrace;
  settings.motion = SyntheticMotionKind::kPutDown;
  settings.object = SyntheticObjectKind::kVase;
  settings.frames = 31;
  settings.frame_rate = 5;
  settings.size_px = 96;
  ConfigProblems problems;
  const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", here.path(), {}, problems);
  write_dataset(settings, video_render_settings(), "data", {}, stages);
  here.write("put.json", R"({
    "extends": "data/config.json",
    "start": {"objects": "best", "root": "estimate"},
    "stages": {
      "interaction": {
        "iterations": 30,
        "losses": {
          "depth": null,
          "center": {"weight": 1e-5, "by_share": true, "moves": "object"},
          "mask": {"weight": 1, "human": false},
          "object_smooth": {"weight": 1, "free": 2}
        }
      },
      "refinement": {
        "over": "sequence", "iterations": 20, "optimize": {"transl": {"lr": 0.002}},
        "losses": {"fit": {"by_sigma": true}, "smooth": {"weight": 0.05}}
      }
    }})");
  const RunConfig config = load_run_config("put.json", {}, descriptions_of(loss_terms()));
  execute_tiny(config, "run");
  const std::string log = file_text("run/log.txt");
  CAPTURE(log.substr(log.size() > 1500 ? log.size() - 1500 : 0));
  CHECK_THAT(log, Contains("more of vase would show than does; it stays with the "));
  CHECK(log.find("more of vase") != log.rfind("more of vase"));  // after the last frame, and after the refinement
  constexpr int kEach = kPerFrame + 20;
  check_stopped_after(config, {29 * kEach + 12, 30 * kEach + 10});  // in the last frame but one, and in the refinement
}

TEST_CASE("where masks are missing, what is drawn tells that an object is not hidden", "[run]") {
  const TemporaryFolder here;
  const CopiedDataset copy;
  write_image((copy.path / "masks" / kTinyObject / "0002.png").string(), Image(1, kTinyPixels, kTinyPixels));
  execute_tiny(config_in(copy.path, {"start.objects=best"}), "run");
  CHECK_THAT(file_text("run/log.txt"), !Contains("is hidden, and "));
  CHECK_FALSE(json_of("run/summary.json")["per_frame"][1].contains("object_iou"));
}

TEST_CASE("objects that the first pass lost are found by a later one", "[run][passes]") {
  const TemporaryFolder here;
  nlohmann::ordered_json content = nlohmann::ordered_json::parse(R"({
    "start": {"objects": "best"},
    "stages": {
      "interaction": {"optimize": {"object_transl": {"lr": 0.2, "lr_final_share": 1}}},
      "refinement": {
        "over": "sequence", "iterations": 2, "optimize": {"transl": {"lr": 0.0001}}, "losses": {"fit": {}}
      },
      "again": {"iterations": 5, "optimize": {"object_transl": {"lr": 0.002}}, "losses": {"photometric": {}}}
    }})");
  content["extends"] = tiny_config_file();
  here.write("lost.json", content.dump());
  const RunConfig config = load_run_config("lost.json", {}, descriptions_of(loss_terms()));
  const RunSummary summary = execute_tiny(config, "run");
  CHECK_THAT(file_text("run/log.txt"), Contains(", pass 2: watering_can is looked for, by frame "));
  const double lost = number_in(summary.metrics[1].values, "object_translation_cm"),
               found = number_in(summary.metrics[3].values, "object_translation_cm");
  CAPTURE(lost, found);
  CHECK(lost > 10);
  CHECK(found < lost / 2);
}

TEST_CASE("frames in which objects are lost are told", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config({"start.objects=best", "stages.interaction.optimize.object_transl.lr=0.5"}), "run");
  CHECK_THAT(
      file_text("run/log.txt"),
      Contains("the object \"watering_can\" is lost: what is drawn has less than a fifth in common with its mask"));
}

}  // namespace hidden_objects_test
