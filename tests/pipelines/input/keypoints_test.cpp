// Files of 2D keypoints: every format, persons, sizes, and what is refused.
#include "pipelines/input/keypoints.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "body/body_model.h"
#include "body/pose_layout.h"
#include "core/check.h"
#include "core/image_io.h"
#include "core/log.h"
#include "tests/support/temporary_folder.h"

namespace keypoints_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Json = nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr int kFrames = 3, kWidth = 40, kHeight = 20;

/// A folder with a video of black frames.
struct Workshop {
  TemporaryFolder here;

  Workshop() {
    fs::create_directory("frames");
    for (int t = 0; t < kFrames; ++t) write_image("frames/000" + std::to_string(t) + ".png", Image(3, kHeight, kWidth));
  }
  static Keypoints read(const std::string& path, const std::string& joints = "") {
    DataSettings data;
    data.frames = "frames";
    data.keypoints = path;
    data.keypoint_joints = joints;
    return read_keypoints(data, FrameSource("frames", {}));
  }
  static std::string fault(const std::string& path, const std::string& joints = "") {
    try {
      read(path, joints);
    } catch (const UserError& error) {
      return error.what();
    } catch (const DataError& error) {
      return error.what();
    }
    return "no fault";
  }
};

void write(const std::string& file, const Json& content) { std::ofstream(file) << content.dump(); }

Json own(const Json& joints, const Json& frames) {
  return {{"format", "hsi4d keypoints"}, {"version", 1}, {"joints", joints}, {"frames", frames}};
}

/// A person of `count` points in a row, point i at (x + i, y).
Json row_of(int count, double x, double y, double confidence = 1) {
  Json row = Json::array();
  for (int i = 0; i < count; ++i)
    for (const double number : {x + i, y, confidence}) row.push_back(number);
  return row;
}

}  // namespace

TEST_CASE("keypoints of the project's own format are shares of the image, and those of no joint are left out") {
  const Workshop workshop;
  Json content = own({"pelvis", nullptr, {{"left_hip", 0.5}, {"right_hip", 0.5}}},
                     {{{10, 5, 0.5}, {1, 1, 1}, {20, 10, 1}}, Json::array(), {{40, 20, 0}, {0, 0, 0}, {60, -5, 0.25}}});
  write("k.json", content);
  Keypoints found = Workshop::read("k.json");
  REQUIRE(found.joints.size() == 2);
  CHECK(found.joints[0] == KeypointJoints{{0, 1.0}});
  CHECK(found.joints[1] == KeypointJoints{{smplx_joint("left_hip"), 0.5}, {smplx_joint("right_hip"), 0.5}});
  REQUIRE(found.frames.size() == kFrames);
  CHECK(found.frames[0][0].x == 0.25);
  CHECK(found.frames[0][0].y == 0.25);
  CHECK(found.frames[0][0].confidence == 0.5);
  CHECK(found.frames[0][1].x == 0.5);
  CHECK(found.frames[1][0].confidence == 0);  // nobody
  CHECK(found.frames[2][1].x == 1.5);         // beyond the image
  CHECK(found.frames[2][1].y == -0.25);
  content["size"] = {80, 40};
  write("k.json", content);
  CHECK(Workshop::read("k.json").frames[0][0].x == 0.125);
}

TEST_CASE("frames of which the detector is unsure are told by their numbers", "[scores]") {
  const Workshop workshop;
  const Json joints = {"pelvis"};
  Json content = own(joints, {{{1, 2, 0.9}}, {{3, 4, 0.9}}, Json::array()});
  write("plain.json", content);
  CHECK(Workshop::read("plain.json").scores.empty());
  content["scores"] = {0.25, 0.5, 0};
  write("scored.json", content);
  std::string warning;
  const LogSink sink =
      log_to([&warning](LogLevel, std::string_view message) { warning += std::string(message) + "\n"; });
  CHECK(Workshop::read("scored.json").scores == std::vector<double>{0.25, 0.5, 0});
  CHECK_THAT(warning, Contains("scored.json: the person is found doubtfully in 1 of 3 frames (0), scores below 0.5\n"));
  const auto fault = [&](const Json& scores) {
    content["scores"] = scores;
    write("wrong.json", content);
    return Workshop::fault("wrong.json");
  };
  CHECK_THAT(fault({1, 1}), Contains("/scores: has 2 numbers; /frames has 3"));
  CHECK_THAT(fault({1, 1.5, 1}), Contains("/scores/1: 1.5 is out of range; allowed: 0 to 1"));
  CHECK_THAT(fault({1, "one", 1}), Contains("/scores/1"));
  CHECK_THAT(fault(0.5), Contains("/scores"));
}

TEST_CASE("landmarks are in the same file, a place a point or none a frame") {
  const Workshop workshop;
  Json content = own({"pelvis", nullptr, "head"}, {{{1, 1, 1}, {2, 2, 1}, {3, 3, 1}}, Json::array(), Json::array()});
  write("plain.json", content);
  CHECK_FALSE(Workshop::read("plain.json").has_landmarks());
  content["landmarks"] = {{{0, 0, 0}, {9, 9, 9}, {0.1, -0.6, 0.2}}, Json::array(), Json::array()};
  write("k.json", content);
  const Keypoints keypoints = Workshop::read("k.json");
  REQUIRE(keypoints.has_landmarks());
  REQUIRE(keypoints.frames[0].size() == 2);
  CHECK(*keypoints.frames[0][1].landmark == Vector3<double>(0.1, -0.6, 0.2));
  CHECK_FALSE(keypoints.frames[1][0].landmark);

  const auto fault = [&](const Json& landmarks) {
    content["landmarks"] = landmarks;
    write("bad.json", content);
    return Workshop::fault("bad.json");
  };
  CHECK_THAT(fault(Json::array()), Contains("/landmarks: has 0 frames; /frames has 3"));
  CHECK_THAT(fault({{{0, 0, 0}}, Json::array(), Json::array()}), Contains("/landmarks/0: has 1 points; 3 or none"));
  CHECK_THAT(fault({{{0, 0, 0}, {0, 0}, {0, 0, 0}}, Json::array(), Json::array()}),
             Contains("/landmarks/0/1: is no place [x, y, z]"));
  CHECK_THAT(fault("here"), Contains("/landmarks"));
}

TEST_CASE("bones lie between points that stand for one joint") {
  const auto bones = [](const std::vector<std::string>& names) {
    std::vector<KeypointJoints> joints;
    for (const std::string& name : names) joints.push_back({{smplx_joint(name), 1.0}});
    return bones_of(joints);
  };
  CHECK(bones({"left_wrist", "left_shoulder"}) == std::vector<Bone>{{{0, 1.0}, {1, -1.0}}});  // over the elbow
  CHECK(bones({"left_knee", "right_knee"}).empty());
  CHECK(bones({"left_wrist", "left_index1"}).empty());  // fingers do not count
  CHECK(bones({"left_hip", "right_hip", "left_shoulder", "right_shoulder"}).size() == 3);
  std::vector<std::string> all(smplx_joint_names().begin(), smplx_joint_names().begin() + 22);
  CHECK(bones(all).size() == 21 + 3);
  CHECK(bones_of({{{1, 0.5}, {2, 0.5}}, {{4, 1.0}}}).empty());
}

TEST_CASE("COCO's results are of the frames that they name, and those of nobody need not be there") {
  const Workshop workshop;
  write("coco.json", Json::array({{{"image_id", 1}, {"keypoints", row_of(17, 4, 6, 0.75)}}}));
  const Keypoints found = Workshop::read("coco.json");
  CHECK(found.joints.size() == 14);  // without nose and ears
  CHECK(found.joints[2] == KeypointJoints{{smplx_joint("left_shoulder"), 1.0}});
  CHECK(found.joints.back() == KeypointJoints{{smplx_joint("right_ankle"), 1.0}});
  REQUIRE(found.frames.size() == kFrames);
  CHECK(found.frames[0][0].confidence == 0);
  CHECK(found.frames[1].back().x == 20.0 / kWidth);
  CHECK(found.frames[1].back().y == 6.0 / kHeight);
  CHECK(found.frames[1].back().confidence == 0.75);
  CHECK(found.frames[2][0].confidence == 0);
}

TEST_CASE("OpenPose's folder has a file a frame") {
  const Workshop workshop;
  fs::create_directory("pose");
  for (int t = 0; t < kFrames; ++t) {
    Json people = Json::array();
    if (t != 1) people.push_back({{"pose_keypoints_2d", row_of(25, t, 3)}});
    write("pose/clip_00000000000" + std::to_string(t) + "_keypoints.json", {{"version", 1.3}, {"people", people}});
  }
  std::ofstream("pose/note.txt") << "mine";
  std::string told;
  const LogSink sink = log_to([&told](LogLevel, std::string_view text) { told += text; });
  const Keypoints found = Workshop::read("pose");
  CHECK_THAT(told, Contains("pose: shows nobody in 1 of 3 frames (1); losses of keypoints are off there"));
  CHECK(found.joints.size() == 16);
  CHECK(found.joints[0] == KeypointJoints{{smplx_joint("left_shoulder"), 0.5}, {smplx_joint("right_shoulder"), 0.5}});
  CHECK(found.frames[0][0].x == 1.0 / kWidth);  // the neck is the second point
  CHECK(found.frames[1][0].confidence == 0);
  CHECK(found.frames[2][0].x == 3.0 / kWidth);
  CHECK(keypoint_files("pose").size() == kFrames);
  std::ofstream("pose/._clip_000000000000_keypoints.json") << "of another system";
  CHECK(keypoint_files("pose").size() == kFrames);
  fs::rename("pose/clip_000000000002_keypoints.json", "pose/clip_10_keypoints.json");
  CHECK_THAT(Workshop::fault("pose"), Contains("have different lengths; files are taken in the order of their names"));
  fs::remove("pose/clip_10_keypoints.json");
  CHECK(Workshop::fault("pose") == "pose: holds 2 frames of keypoints, the video has 3 frames; allowed: that many");
}

TEST_CASE("every known set has a joint for its limbs, left on the left") {
  const Workshop workshop;
  for (const auto& [name, count] :
       {std::pair{"coco17", 17}, {"body25", 25}, {"blazepose33", 33}, {"blazepose33_hands", 75}, {"smplx55", 55}}) {
    INFO(name);
    Json frame = Json::array();
    for (int i = 0; i < count; ++i) frame.push_back({i, 0, 1});
    write("k.json", own(name, {frame, frame, frame}));
    const Keypoints found = Workshop::read("k.json");
    for (const char* joint : {"left_shoulder", "right_shoulder", "left_wrist", "right_wrist", "left_hip", "right_knee",
                              "left_ankle", "left_eye_smplhf"}) {
      INFO(joint);
      const KeypointJoints wanted = {{smplx_joint(joint), 1.0}};
      CHECK(std::count(found.joints.begin(), found.joints.end(), wanted) == 1);
    }
  }
}

TEST_CASE("BlazePose with hands has the joints of each finger behind those of the body") {
  const Workshop workshop;
  Json frame = Json::array();
  for (int i = 0; i < 75; ++i) frame.push_back({i, 0, 1});
  write("k.json", own("blazepose33_hands", {frame, frame, frame}));
  const Keypoints found = Workshop::read("k.json");
  const auto point_of = [&found](const char* joint, int nth) {  // of those of the joint
    const KeypointJoints wanted = {{smplx_joint(joint), 1.0}};
    for (std::size_t k = 0; k < found.joints.size(); ++k) {
      if (found.joints[k] == wanted && nth-- == 0) return static_cast<int>(std::lround(found.frames[0][k].x * kWidth));
    }
    return -1;
  };
  CHECK(point_of("left_thumb1", 0) == 33 + 1);
  CHECK(point_of("left_index3", 0) == 33 + 7);
  CHECK(point_of("left_middle1", 0) == 33 + 9);
  CHECK(point_of("left_ring2", 0) == 33 + 14);
  CHECK(point_of("right_thumb3", 0) == 54 + 3);
  CHECK(point_of("right_pinky3", 0) == 54 + 19);
  CHECK(point_of("right_pinky1", 0) == 18);  // BlazePose's own
  CHECK(point_of("right_pinky1", 1) == 54 + 17);
  CHECK(point_of("left_wrist", 0) == 15);
  CHECK(point_of("left_wrist", 1) == -1);  // the hand's counts no second time
  for (int joint = smplx_joint("left_index1"); joint < kSmplxJoints; ++joint)
    CHECK(point_of(smplx_joint_names()[static_cast<std::size_t>(joint)].c_str(), 0) >= 0);
}

TEST_CASE("of several persons the surest one is followed, which is told") {
  const Workshop workshop;
  const auto entry = [](int frame, double x, double confidence) {
    return Json{{"image_id", frame}, {"keypoints", row_of(17, x, 0, confidence)}};
  };
  write("coco.json", Json::array({entry(0, 1, 0.5), entry(0, 20, 0.9), entry(1, 2, 1), entry(1, 18, 0.2),
                                  entry(2, 17, 0.3), entry(2, 3, 0)}));  // the last is nobody
  std::string told;
  const LogSink sink = log_to([&told](LogLevel, std::string_view text) { told += text; });
  const Keypoints found = Workshop::read("coco.json");
  CHECK(found.frames[0][0].x == 21.0 / kWidth);  // the first kept point is the second of the row
  CHECK(found.frames[1][0].x == 19.0 / kWidth);
  CHECK(found.frames[2][0].x == 18.0 / kWidth);
  CHECK_THAT(told, Contains("coco.json: shows several persons in 2 of 3 frames"));
}

TEST_CASE("a file says what the points of another detector stand for") {
  const Workshop workshop;
  write("coco.json", Json::array({{{"image_id", 0}, {"keypoints", row_of(3, 0, 0)}}}));
  CHECK_THAT(Workshop::fault("coco.json"), Contains("/0/keypoints: has 3 points; known sets have 17 (COCO)"));
  write("joints.json", Json::array({"head", nullptr, {{"neck", 0.25}, {"head", 0.75}}}));
  const Keypoints found = Workshop::read("coco.json", "joints.json");
  REQUIRE(found.joints.size() == 2);
  CHECK(found.joints[1] == KeypointJoints{{smplx_joint("head"), 0.75}, {smplx_joint("neck"), 0.25}});
  CHECK(found.frames[0][1].x == 2.0 / kWidth);
  write("joints.json", Json::array({"head", "nek", "neck"}));
  CHECK_THAT(Workshop::fault("coco.json", "joints.json"),
             Contains("/1: there is no joint \"nek\"; did you mean \"neck\"?"));
  write("joints.json", Json::array({{{"neck", 0.5}}, nullptr, nullptr}));
  CHECK_THAT(Workshop::fault("coco.json", "joints.json"), Contains("/0: the weights sum to 0.5, not to 1"));
  write("joints.json", Json::array({{{"neck", -1}, {"head", 2}}, nullptr, nullptr}));
  CHECK_THAT(Workshop::fault("coco.json", "joints.json"), Contains("/0/neck: a weight is above 0"));
  write("joints.json", Json::array({nullptr, nullptr, nullptr}));
  CHECK_THAT(Workshop::fault("coco.json", "joints.json"), Contains("names no joint"));
  write("joints.json", Json::array({"head", "neck"}));
  CHECK_THAT(Workshop::fault("coco.json", "joints.json"), Contains("/0/keypoints: has 3 points; 2 are needed"));
}

TEST_CASE("what is no file of keypoints is refused with its place") {
  const Workshop workshop;
  const auto fault_of = [](const Json& content) {
    write("k.json", content);
    return Workshop::fault("k.json");
  };
  const Json frame = {{1, 2, 1}};
  CHECK_THAT(fault_of({{"frames", Json::array()}}), Contains("is neither a list of COCO's results nor"));
  CHECK_THAT(fault_of(own("coco18", {frame, frame, frame})),
             Contains("/joints: \"coco18\" is not known; allowed: \"coco17\""));
  CHECK_THAT(fault_of(own({"pelvis"}, {frame, frame})),
             Contains("holds 2 frames of keypoints, the video has 3 frames"));
  CHECK_THAT(fault_of(own({"pelvis"}, {frame, {{1, 2}}, frame})), Contains("/frames/1/0: has 2 numbers"));
  CHECK_THAT(fault_of(own({"pelvis"}, {frame, {{1, 2, 1.5}}, frame})),
             Contains("/frames/1/0/2: the confidence 1.5 is out of range; allowed: 0 to 1"));
  CHECK_THAT(fault_of(own({"pelvis"}, {frame, {{1, 2, 1}, {1, 2, 1}}, frame})),
             Contains("/frames/1: has 2 points; 1 are needed"));
  CHECK_THAT(fault_of(own({"pelvis"}, {Json::array(), Json::array(), Json::array()})),
             Contains("shows nobody in any frame"));
  CHECK_THAT(fault_of(Json::array({{{"image_id", -1}, {"keypoints", row_of(17, 0, 0)}}})),
             Contains("/0/image_id: -1 is not a whole number"));
  CHECK_THAT(fault_of(Json::array({{{"image_id", 7}, {"keypoints", row_of(17, 0, 0)}}})),
             Contains("holds 8 frames of keypoints, the video has 3 frames"));
  CHECK_THAT(fault_of(Json::array({{{"image_id", 2000000}, {"keypoints", row_of(17, 0, 0)}}})),
             Contains("/0/image_id: 2000000 is no frame's number"));
  CHECK_THAT(fault_of(Json::array({{{"keypoints", row_of(17, 0, 0)}}})), Contains("/0: lacks image_id or keypoints"));
  CHECK_THAT(fault_of(own(Json::array({nullptr}), {frame, frame, frame})), Contains("/joints: names no joint"));
  CHECK_THAT(fault_of(own(Json::array(), {frame, frame, frame})), Contains("/joints: names no joint"));
  Json turned = own({"pelvis"}, {frame, frame, frame});
  turned["size"] = {kHeight, kWidth};
  CHECK_THAT(fault_of(turned), Contains("is of pictures of 20x40 pixels, the video's frames are of 40x20"));
  Json sized = own({"pelvis"}, {frame, frame, frame});
  sized["size"] = {0, 4};
  CHECK_THAT(fault_of(sized), Contains("/size/0: 0 is out of range; allowed: at least 1"));
  sized["size"] = {4};
  CHECK_THAT(fault_of(sized), Contains("/size: is not [width, height]"));
  fs::create_directory("empty");
  CHECK(Workshop::fault("empty") == "empty: holds no NAME_keypoints.json, as OpenPose writes them");
}

}  // namespace keypoints_test
