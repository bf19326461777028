#include "pipelines/synthetic/dataset.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/kinematics.h"
#include "body/procedural_body.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "core/parallel.h"
#include "core/rotation.h"
#include "optim/metrics.h"
#include "pipelines/config/synthetic_places.h"
#include "pipelines/input/clip.h"
#include "pipelines/synthetic/motion.h"
#include "splat/files/io_ply.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace dataset_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

SyntheticSettings small_settings() {
  SyntheticSettings settings;
  settings.frames = 3;
  settings.size_px = 48;
  settings.video = SyntheticVideo::kPng;
  settings.scene_gaussians = 1500;
  settings.avatar_gaussians = 600;
  settings.object_gaussians = 200;
  return settings;
}

const std::vector<std::string>& dataset_files() {
  static const std::vector<std::string> files = {
      "avatar.safetensors",
      "camera.json",
      "config.json",
      "first_frame.png",
      "frames/0000.png",
      "frames/0001.png",
      "frames/0002.png",
      "initial.json",
      "initial_motion.npz",
      "masks/human/0000.png",
      "masks/human/0001.png",
      "masks/human/0002.png",
      "masks/watering_can/0000.png",
      "masks/watering_can/0001.png",
      "masks/watering_can/0002.png",
      "objects/watering_can.ply",
      "scene.ply",
      "synthetic.json",
      "truth/cameras.json",
      "truth/motion.npz",
      "truth/objects.npz",
      "truth/surface.ply",
  };
  return files;
}

/// Every file under a folder with its bytes.
std::map<std::string, std::string> content_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files[fs::relative(entry.path(), folder).generic_string()] = file_text(entry.path());
  return files;
}

std::vector<std::string> names_in(const std::map<std::string, std::string>& files) {
  std::vector<std::string> names;
  for (const auto& [name, bytes] : files) names.push_back(name);
  return names;
}

Vector3<double> row(const std::vector<double>& values, std::size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

double mean_of(const Image& image) {
  double sum = 0;
  for (int c = 0; c < image.channels(); ++c)
    for (int y = 0; y < image.height(); ++y)
      for (int x = 0; x < image.width(); ++x) sum += double(image(c, y, x));
  return sum / (double(image.channels()) * image.height() * image.width());
}

/// Makes a small dataset of each file in a folder of shipped configs. @return  their names
std::vector<std::string> made_of_configs(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(fs::path(HSI4D_SOURCE_DIR) / "configs" / folder)) {
    if (!entry.is_regular_file()) continue;
    const std::string name = entry.path().stem().string();
    INFO(name);
    const ProgramResult made =
        run_hsi4d({"synth", entry.path().string(), "--out", name, "--set", "synthetic.frames=3", "--set",
                   "synthetic.size_px=48", "--set", "synthetic.scene_gaussians=1500", "--set",
                   "synthetic.avatar_gaussians=400", "--set", "synthetic.object_gaussians=100"});
    CHECK(made.status == 0);
    CHECK(made.out ==
          name + (name == "chain" ? ": 3 clips of" : ":") + " 3 frames of 48 x 48 pixels with masks and truth\n");
    names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

bool same_camera(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.camera_from_world.rotation == b.camera_from_world.rotation &&
         a.camera_from_world.translation == b.camera_from_world.translation;
}

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const UserError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("a synthetic dataset is complete, readable and true to itself") {
  const TemporaryFolder folder;
  std::int64_t last_done = 0;
  write_dataset(small_settings(), {}, "data",
                {.progress = [&](const ProgressState& state) { last_done = state.done; }});
  CHECK(last_done == 3);
  CHECK(names_in(content_of("data")) == dataset_files());
  CHECK(std::distance(fs::directory_iterator("."), fs::directory_iterator()) == 1);  // no temporary is left

  const Gaussians room = read_ply("data/scene.ply").gaussians;
  CHECK(room.count() <= 1500);
  CHECK(room.count() > 1000);
  const SplatFile object = read_ply("data/objects/watering_can.ply");
  CHECK(object.report.rejected == 0);
  Vector3<double> sum = Vector3<double>::Zero();
  for (std::size_t i = 0; i < object.gaussians.means.size(); ++i)
    sum[Eigen::Index(i % 3)] += double(object.gaussians.means[i]);
  CHECK(sum.norm() / double(object.gaussians.count()) < 1e-7);
  CHECK(read_avatar("data/avatar.safetensors").count() == 600);

  const Motion truth = read_motion("data/truth/motion.npz"), initial = read_motion("data/initial_motion.npz");
  const std::vector<Camera> cameras = read_cameras("data/truth/cameras.json");
  const Npz objects = Npz::read("data/truth/objects.npz");
  const auto rotation = objects.array("watering_can/rotation").require_shape({3, 3}).as<double>();
  const auto translation = objects.array("watering_can/translation").require_shape({3, 3}).as<double>();
  REQUIRE(truth.poses.size() == 3);
  REQUIRE(initial.poses.size() == 3);
  REQUIRE(cameras.size() == 3);
  CHECK(truth.frame_rate == 10);

  SECTION("frame 0 is exact, later frames are disturbed") {
    CHECK(initial.poses[0].axis_angle == truth.poses[0].axis_angle);
    CHECK(initial.poses[0].transl == truth.poses[0].transl);
    CHECK(same_camera(read_camera("data/camera.json"), cameras[0]));
    ConfigProblems problems;
    const ConfigValue state = load_config("data/initial.json", {}, problems);
    problems.throw_if_any();
    CHECK(find_member(state, "motion")->text == "initial_motion.npz");
    const ConfigValue* can = find_member(*find_member(state, "objects"), "watering_can");
    for (std::size_t i = 0; i < 3; ++i) {
      CHECK(std::stod(find_member(*can, "rotation")->items[i].text) == rotation[i]);
      CHECK(std::stod(find_member(*can, "translation")->items[i].text) == translation[i]);
    }
    for (std::size_t t = 1; t < 3; ++t) {
      CHECK(initial.poses[t].axis_angle != truth.poses[t].axis_angle);
      CHECK((initial.poses[t].transl - truth.poses[t].transl).norm() > 0);
      for (Index joint : {22, 23, 24}) CHECK(initial.poses[t].rotation_of(joint) == truth.poses[t].rotation_of(joint));
    }
  }
  SECTION("the object is fixed to the right wrist") {
    const BodyModel body = procedural_body();
    const int wrist = smplx_joint("right_wrist");
    std::vector<Rigid<double>> wrist_from_object;
    for (std::size_t t = 0; t < 3; ++t) {
      const Rigid<double> pose{so3_exp(row(rotation, t)), row(translation, t)};
      wrist_from_object.push_back(compose(inverse(joint_frame(body, truth.poses[t], wrist)), pose));
    }
    for (std::size_t t = 1; t < 3; ++t) {
      CHECK((wrist_from_object[t].translation - wrist_from_object[0].translation).norm() < 1e-12);
      CHECK((wrist_from_object[t].rotation - wrist_from_object[0].rotation).norm() < 1e-12);
      CHECK((row(translation, t) - row(translation, 0)).norm() > 0.005);
    }
  }
  SECTION("frames are bright, masks are where things are") {
    for (const char* name : {"0000.png", "0001.png", "0002.png"}) {
      const Image frame = read_image(std::string("data/frames/") + name);
      const Image human = read_image(std::string("data/masks/human/") + name);
      const Image can = read_image(std::string("data/masks/watering_can/") + name);
      CHECK(frame.channels() == 3);
      CHECK(frame.width() == 48);
      CHECK(human.channels() == 1);
      CHECK(mean_of(frame) > 0.25);
      CHECK(mean_of(human) > 0.05);
      CHECK(mean_of(human) < 0.3);
      CHECK(mean_of(can) > 0.003);
      CHECK(mean_of(can) < 0.05);
      float most = 0;  // a pixel shows the one or the other
      for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 48; ++x) most = std::max(most, human(0, y, x) + can(0, y, x));
      CHECK(most <= 1 + 1.5F / 255);
    }
    const Camera camera = cameras[0];  // the middle of the can's mask is where the can is
    const Image can = read_image("data/masks/watering_can/0000.png");
    Vector2<double> center(0, 0);
    double weight = 0;
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 48; ++x) {
        center += double(can(0, y, x)) * Vector2<double>(x + 0.5, y + 0.5);
        weight += double(can(0, y, x));
      }
    const Vector2<double> there = project_point(camera, transform_point(camera.camera_from_world, row(translation, 0)));
    CHECK((center / weight - there).norm() < 2);
  }
  SECTION("config.json names the files") {
    ConfigProblems problems;
    const ConfigValue config = load_config("data/config.json", {}, problems);
    problems.throw_if_any();
    const ConfigValue& data = *find_member(config, "data");
    for (const char* key : {"scene", "avatar", "frames", "masks", "camera", "initial", "truth"}) {
      INFO(key);
      CHECK(fs::exists(fs::path("data") / find_member(data, key)->text));
    }
    const ConfigValue* can = find_member(*find_member(data, "objects"), "watering_can");
    CHECK(find_member(*can, "gaussians")->text == "objects/watering_can.ply");
  }
}

TEST_CASE("a synthetic dataset is a function of its settings", "[parallel]") {
  const TemporaryFolder folder;
  SyntheticSettings settings = small_settings();
  with_threads(1, [&] { write_dataset(settings, {}, "one"); });
  with_threads(3, [&] { write_dataset(settings, {}, "three"); });
  settings.seed = 1;
  write_dataset(settings, {}, "other");
  const auto one = content_of("one"), three = content_of("three"), other = content_of("other");
  for (const std::string& name : dataset_files()) {
    INFO(name);
    CHECK(one.at(name) == three.at(name));
  }
  for (const char* name : {"scene.ply", "initial_motion.npz", "frames/0001.png"}) {
    INFO(name);
    CHECK(one.at(name) != other.at(name));
  }
}

TEST_CASE("a dataset never lands in a folder that holds something") {
  const TemporaryFolder folder;
  folder.write("full/note.txt", "mine");
  const std::string place = (fs::canonical(".") / "full").string();
  CHECK(message_of([&] { write_dataset(small_settings(), {}, "full"); }) ==
        place + ": the folder is not empty; name a new or empty one");
  CHECK(message_of([&] { write_dataset(small_settings(), {}, "full/note.txt"); }) ==
        place + "/note.txt: there is something that is not a folder; name a new or empty folder");
  CHECK(names_in(content_of(".")) == std::vector<std::string>{"full/note.txt"});
  fs::create_directory("empty");
  SyntheticSettings settings = small_settings();
  settings.frames = 1;
  write_dataset(settings, {}, "empty/");
  CHECK(fs::exists("empty/frames/0000.png"));

  struct Stop {};
  const auto stop = [](const ProgressState&) { throw Stop(); };
  CHECK_THROWS_AS(write_dataset(settings, {}, "stopped", {.progress = stop}), Stop);
  CHECK_FALSE(fs::exists("stopped"));
  for (const auto& entry : fs::directory_iterator(".")) CHECK(entry.path().extension() != ".tmp");
}

TEST_CASE("every scene with motion and object makes a dataset") {
  const TemporaryFolder folder;
  SyntheticSettings settings = small_settings();
  settings.frames = 2;
  std::size_t scene = 0;
  for (const auto& motion : kSyntheticMotionKinds) {
    settings.motion = motion.value;
    settings.object = objects_of(motion.value).back();
    do settings.scene = kSyntheticSceneKinds[scene++ % kSyntheticSceneKinds.size()].value;
    while (!place_problem(settings.scene, settings.motion, "").empty());
    INFO(motion.name);
    write_dataset(settings, {}, motion.name);
    const fs::path made = motion.name;
    CHECK(mean_of(read_image((made / "frames/0001.png").string())) > 0.2);
    const double human = mean_of(read_image((made / "masks/human/0001.png").string()));
    CHECK(human > (settings.motion == SyntheticMotionKind::kSlide ? 0.01 : 0.02));  // which lies, seen from its feet
    CHECK(human < 0.35);
    const bool has_object = settings.object != SyntheticObjectKind::kNone;
    CHECK(fs::exists(made / "objects") == has_object);
    CHECK(fs::exists(made / "truth/objects.npz") == has_object);
    CHECK_FALSE(fs::exists(made / "initial_objects.npz"));
  }
}

TEST_CASE("people beside the first one have files of their own, and leave those of all else as they were") {
  const TemporaryFolder folder;
  SyntheticSettings settings = small_settings();
  write_dataset(settings, video_render_settings(), folder.path() / "one");
  SyntheticPerson person;
  person.motion = SyntheticMotionKind::kWave;
  person.beside = {-0.4, 0.8};
  person.turn_deg = 30;
  settings.people.emplace_back("friend", person);
  write_dataset(settings, video_render_settings(), folder.path() / "two");
  const std::map<std::string, std::string> one = content_of(folder.path() / "one"),
                                           two = content_of(folder.path() / "two");
  for (const char* file : {"avatar.safetensors", "initial.json", "initial_motion.npz", "scene.ply", "camera.json",
                           "truth/motion.npz", "truth/objects.npz", "truth/cameras.json"})
    CHECK(one.at(file) == two.at(file));
  CHECK(one.at("first_frame.png") != two.at("first_frame.png"));
  CHECK(one.at("synthetic.json").find("people") == std::string::npos);
  CHECK(two.at("config.json").find("people/friend/avatar.safetensors") != std::string::npos);
  CHECK(two.size() == one.size() + 7);  // avatar, initial state and motion, truth, a mask a frame

  const fs::path made = folder.path() / "two";
  const DataSettings data = dataset_inputs(made);
  REQUIRE(data.people.size() == 1);
  CHECK(data.people[0].first == "friend");
  const Clip clip = read_clip(data);
  REQUIRE(clip.others.size() == 1);
  CHECK(clip.others[0].avatar.colors != clip.avatar.colors);
  CHECK(clip.first.others[0].transl == (*clip.truth)[0].others[0].transl);
  CHECK(clip.others[0].estimate[1].transl != (*clip.truth)[1].others[0].transl);
  const Vector3<double> apart = clip.first.others[0].transl - clip.first.body.transl;
  CHECK(apart.head<2>().norm() == Approx(std::hypot(0.4, 0.8)).margin(0.3));
  const ClipFrame frame = read_frame(clip, 0);
  double both = 0, other = 0;
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 48; ++x) {
      other += static_cast<double>(frame.other_masks.at(0)(0, y, x));
      both = std::max(both, static_cast<double>(frame.human_mask(0, y, x) + frame.other_masks[0](0, y, x)));
    }
  }
  CHECK(other > 20);       // pixels
  CHECK(both < 1 + 0.02);  // each pixel shows one of them
}

TEST_CASE("people whom synth cannot make are refused") {
  const TemporaryFolder here;
  const auto refused = [&here](const std::string& people, const std::string& more) {
    here.write("config.json", R"({"synthetic": {"people": )" + people + more + "}}");
    const ProgramResult result = run_hsi4d({"synth", "config.json", "--out", "data"});
    CHECK(result.status == 2);
    return result.err;
  };
  CHECK(
      refused(R"({"friend": {"motion": "pour"}})", "").find("needs an object or a place; allowed: walk, wave, lean") !=
      std::string::npos);
  CHECK(refused(R"({"human": {}})", "").find("the first person's or the object's masks; use another name") !=
        std::string::npos);
  CHECK(refused(R"({"friend": {}})", R"(, "clips": 2)").find("the clips of a chain show one person") !=
        std::string::npos);
  CHECK(refused(R"({"friend": {"heading": 1}})", "").find("/synthetic/people/friend/heading") != std::string::npos);
}

TEST_CASE("every shipped config of synth makes its dataset") {
  const TemporaryFolder folder;
  CHECK(made_of_configs("synthetic") == std::vector<std::string>{"alone", "chain", "disturbed", "faults", "full_size",
                                                                 "gate", "hidden", "put_down", "table", "two_people",
                                                                 "walk"});
}

TEST_CASE("every shipped clip of the accuracy table makes its dataset", "[release]") {
  const TemporaryFolder folder;
  CHECK(made_of_configs("synthetic/clips") ==
        std::vector<std::string>{"bedroom_push_chair", "bedroom_sit_chair", "garden_walk_can", "kitchen_pour_can",
                                 "living_room_lift_guitar", "living_room_walk_vase", "terrace_walk_box",
                                 "terrace_wave_guitar"});
}

TEST_CASE("a dataset with all noise and faults is a function of its settings", "[parallel]") {
  const TemporaryFolder folder;
  SyntheticSettings settings = small_settings();
  settings.motion = SyntheticMotionKind::kWalk;
  settings.light = {0.8, 0.9};
  settings.avatar_difference = 1;
  settings.masks = {-1, 2, 0.3};
  settings.faults = {0.8, 1, 0.5};
  settings.object_noise_deg = 10;
  settings.object_noise_m = 0.05;
  settings.pose_bias_deg = 3;
  with_threads(1, [&] { write_dataset(settings, {}, "one"); });
  with_threads(3, [&] { write_dataset(settings, {}, "three"); });
  const auto one = content_of("one"), three = content_of("three");
  CHECK(one == three);
  CHECK(one.contains("initial_objects.npz"));
  const Npz noisy = Npz::read("one/initial_objects.npz"), truth = Npz::read("one/truth/objects.npz");
  const auto of = [](const Npz& file) {
    return file.array("watering_can/translation").require_shape({3, 3}).as<double>();
  };
  CHECK((row(of(noisy), 0) - row(of(truth), 0)).norm() == 0);
  CHECK((row(of(noisy), 1) - row(of(truth), 1)).norm() > 0.005);
  settings.faults = {};
  settings.light = {};
  write_dataset(settings, {}, "plain");
  const auto plain = content_of("plain");
  for (const char* name : {"frames/0001.png", "frames/0002.png"}) CHECK(one.at(name) != plain.at(name));
  for (const char* name : {"truth/motion.npz", "scene.ply", "avatar.safetensors"})
    CHECK(one.at(name) == plain.at(name));
}

TEST_CASE("hsi4d synth makes a dataset, and refuses a folder in use") {
  const TemporaryFolder folder;
  folder.write("config.json", R"({"synthetic": {"frames": 2, "size_px": 32, "scene_gaussians": 1000,
    "avatar_gaussians": 300, "object_gaussians": 100}})");
  const ProgramResult made = run_hsi4d({"synth", "config.json", "--out", "data"});
  CHECK(made.err.find("rror") == std::string::npos);
  CHECK(made.out == "data: 2 frames of 32 x 32 pixels with masks and truth\n");
  REQUIRE(made.status == 0);
  CHECK(fs::exists("data/first_frame.png"));
  CHECK(fs::exists("data/video.mp4"));
  const ProgramResult again = run_hsi4d({"synth", "config.json", "--out", "data"});
  CHECK(again.status == 2);
  CHECK(again.out.empty());
  CHECK(again.err == (fs::canonical("data")).string() + ": the folder is not empty; name a new or empty one\n");
  const ProgramResult wrong = run_hsi4d({"synth", "config.json", "--out", "new", "--set", "synthetic.frames=1"});
  CHECK(wrong.status == 2);
  CHECK(wrong.err.find("/synthetic/frames") != std::string::npos);
  CHECK_FALSE(fs::exists("new"));
  const ProgramResult senseless = run_hsi4d({"synth", "config.json", "--out", "new", "--set", "synthetic.motion=push"});
  CHECK(senseless.status == 2);
  CHECK(senseless.err.find("the motion push makes no sense with the object watering_can; it goes with office_chair") !=
        std::string::npos);
}

TEST_CASE("the video of a dataset is one file that shows what was rendered", "[parallel]") {
  const TemporaryFolder folder;
  SyntheticSettings settings = small_settings();
  settings.size_px = 96;
  settings.frame_rate = 12.5;
  write_dataset(settings, {}, "png");
  struct Kind {
    SyntheticVideo video;
    double least_db;
  };
  for (const Kind& kind : {Kind{SyntheticVideo::kMp4, 44}, Kind{SyntheticVideo::kMp4Shared, 38}}) {
    INFO(choice_name<SyntheticVideo>(kSyntheticVideos, kind.video));
    settings.video = kind.video;
    with_threads(1, [&] { write_dataset(settings, {}, "one"); });
    with_threads(2, [&] { write_dataset(settings, {}, "two"); });
    const auto one = content_of("one"), png = content_of("png");
    CHECK(one == content_of("two"));
    CHECK_FALSE(one.contains("frames/0000.png"));
    CHECK(one.at("first_frame.png") == png.at("frames/0000.png"));
    for (const auto& [name, bytes] : png) {
      if (name.starts_with("frames/") || name == "config.json" || name == "synthetic.json") continue;
      INFO(name);
      CHECK(one.at(name) == bytes);  // masks and all else are as exact as with PNG frames
    }
    const DataSettings data = dataset_inputs("one");
    CHECK(data.frames == fs::absolute("one/video.mp4"));
    ConfigProblems problems;
    CHECK(find_member(*find_member(load_config("one/config.json", {}, problems), "data"), "frames")->text ==
          "video.mp4");
    const Clip clip = read_clip(data);
    CHECK(clip.frames() == 3);
    CHECK(clip.frame_rate == 12.5);
    for (Index t = 0; t < 3; ++t) {
      const std::string name = "png/frames/" + clip.frame_files[static_cast<std::size_t>(t)];
      CHECK(psnr_db(read_frame(clip, t).target, read_image(name)) > kind.least_db);
    }
    fs::remove_all("one"), fs::remove_all("two");
  }
}

TEST_CASE("a video that cannot be written is refused before anything is made") {
  const TemporaryFolder folder;
  SyntheticSettings settings = small_settings();
  settings.video = SyntheticVideo::kMp4;
  const std::string path = std::getenv("PATH");
  setenv("PATH", folder.path().c_str(), 1);  // nothing is in it
  const std::string told = message_of([&] { write_dataset(settings, {}, "data"); });
  settings.video = SyntheticVideo::kPng;
  const std::string without = message_of([&] { write_dataset(settings, {}, "png"); });
  setenv("PATH", path.c_str(), 1);
  CHECK(told ==
        "ffmpeg: is not in PATH, and writes the video of a dataset; install it, or keep the frames as PNG files with "
        "synthetic.video=png");
  CHECK_FALSE(fs::exists("data"));
  CHECK(without == "no error");
  CHECK(fs::exists("png/frames/0002.png"));

  folder.write("config.json", R"({"synthetic": {"size_px": 33, "video": "mp4_420"}})");
  const ProgramResult odd = run_hsi4d({"synth", "config.json", "--out", "odd"});
  CHECK(odd.status == 2);
  CHECK(odd.err ==
        "config.json:1: /synthetic/video: mp4_420 has blocks of 2x2 pixels, which size_px 33 cannot be divided into; "
        "take an even size, or mp4\n");
}

TEST_CASE("a demo whose dataset cannot be made leaves no folder") {
  const TemporaryFolder here;
  here.write("bad.ply", "no Gaussians");
  const ProgramResult failed =
      run_hsi4d({"demo", "--quick", "--quiet", "--out", "demos/a", "--set", "synthetic.scene_file=bad.ply"});
  CHECK(failed.status == 2);
  CHECK(failed.err.find("bad.ply") != std::string::npos);
  CHECK_FALSE(fs::exists("demos/a"));
}

}  // namespace dataset_test
