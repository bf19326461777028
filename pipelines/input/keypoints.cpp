#include "pipelines/input/keypoints.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string_view>

#include "body/body_model.h"
#include "body/pose_layout.h"
#include "core/check.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/found_keypoints.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;
using Kind = ConfigValue::Kind;

constexpr std::string_view kFormat = "hsi4d keypoints";
constexpr std::string_view kOpenPoseEnding = "_keypoints.json";
constexpr std::int64_t kMostFrames = 1000000;
constexpr double kWeightSlack = 1e-6;  // by which weights may miss a sum of 1

// ---- Sets of points ----

/// A set that detectors have: a word a point, the joint that it stands for; "-": none; "a+b": the middle of two.
struct KeypointSet {
  std::string_view name, joints;
  bool has_hands = false;  ///< then the points of the left hand follow, and those of the right one
};

/// Of a hand, the joint without its side: wrist, thumb, and fingers, from the palm to the tip. The body has the wrist.
/// [MediaPipe]
constexpr std::string_view kHandJointWords =
    "- thumb1 thumb2 thumb3 - index1 index2 index3 - middle1 middle2 middle3 - ring1 ring2 ring3 - "
    "pinky1 pinky2 pinky3 -";

/// Nose, three points an eye, ears, mouth; then left and right in turn; heels and toes.  [MediaPipe]
constexpr std::string_view kBlazePoseJoints =
    "- - left_eye_smplhf - - right_eye_smplhf - - - - - left_shoulder right_shoulder left_elbow right_elbow left_wrist "
    "right_wrist left_pinky1 right_pinky1 left_index1 right_index1 left_thumb2 right_thumb2 left_hip right_hip "
    "left_knee right_knee left_ankle right_ankle - - - -";

constexpr std::array kKeypointSets = {
    // nose, eyes, ears, then from the shoulders down  [COCO]
    KeypointSet{"coco17",
                "- left_eye_smplhf right_eye_smplhf - - left_shoulder right_shoulder left_elbow right_elbow "
                "left_wrist right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"},
    // nose, neck, the arms, the middle of the hips, the legs, eyes, ears, toes and heels  [OpenPose]
    KeypointSet{"body25",
                "- left_shoulder+right_shoulder right_shoulder right_elbow right_wrist left_shoulder left_elbow "
                "left_wrist left_hip+right_hip right_hip right_knee right_ankle left_hip left_knee left_ankle "
                "right_eye_smplhf left_eye_smplhf - - - - - - - -"},
    KeypointSet{"blazepose33", kBlazePoseJoints}, KeypointSet{"blazepose33_hands", kBlazePoseJoints, true},
    KeypointSet{"smplx55", ""},  // the joints themselves
};

KeypointJoints joints_named(const std::string& word) {
  if (word == "-") return {};
  const std::size_t plus = word.find('+');
  if (plus == std::string::npos) return {{smplx_joint(word), 1.0}};
  return {{smplx_joint(word.substr(0, plus)), 0.5}, {smplx_joint(word.substr(plus + 1)), 0.5}};
}

std::vector<KeypointJoints> joints_of(const KeypointSet& set) {
  std::vector<KeypointJoints> joints;
  if (set.joints.empty()) {
    for (int joint = 0; joint < kSmplxJoints; ++joint) joints.push_back({{joint, 1.0}});
  }
  const auto add = [&joints](std::string_view words, const std::string& side) {
    std::istringstream stream{std::string(words)};
    for (std::string word; stream >> word;) joints.push_back(joints_named(word == "-" ? word : side + word));
  };
  add(set.joints, "");
  for (const char* side : {"left_", "right_"}) {
    if (set.has_hands) add(kHandJointWords, side);
  }
  return joints;
}

std::string set_names() {
  std::vector<std::string> names;
  for (const KeypointSet& set : kKeypointSets) names.push_back("\"" + std::string(set.name) + "\"");
  return joined(names);
}

/// The set with that many points. Throws DataError at `value` where there is none.
std::vector<KeypointJoints> joints_by_count(std::size_t count, const ConfigValue& value, const std::string& pointer) {
  for (const KeypointSet& set : kKeypointSets) {
    std::vector<KeypointJoints> joints = joints_of(set);
    if (joints.size() == count) return joints;
  }
  fail_at(value, pointer,
          "has " + std::to_string(count) +
              " points; known sets have 17 (COCO), 25 (OpenPose), 33 (BlazePose), 55 "
              "(SMPL-X) and 75 (BlazePose with hands); data.keypoint_joints says what those of another stand for");
}

int joint_at(const ConfigValue& value, const std::string& pointer) {
  check_kind(value, Kind::kString, pointer);
  const std::vector<std::string>& names = smplx_joint_names();
  const auto at = std::find(names.begin(), names.end(), value.text);
  if (at == names.end())
    fail_at(value, pointer, "there is no joint " + json_string(value.text) + did_you_mean(value.text, names));
  return static_cast<int>(at - names.begin());
}

/// A name, {"NAME": weight, ...}, or null.
KeypointJoints joints_at(const ConfigValue& value, const std::string& pointer) {
  if (value.kind == Kind::kNull) return {};
  if (value.kind != Kind::kObject) return {{joint_at(value, pointer), 1.0}};
  KeypointJoints joints;
  double sum = 0;
  for (const ConfigMember& member : value.members) {
    const std::string place = child_pointer(pointer, member.key);
    ConfigValue name = ConfigValue::make_string(member.key);
    name.origin = member.value.origin;
    joints.emplace_back(joint_at(name, place), number_of(member.value, place));
    if (!(joints.back().second > 0)) fail_at(member.value, place, "a weight is above 0");
    sum += joints.back().second;
  }
  if (std::abs(sum - 1) > kWeightSlack)
    fail_at(value, pointer, "the weights sum to " + number_text(sum) + ", not to 1");
  return joints;
}

std::vector<KeypointJoints> joints_in_list(const ConfigValue& list, const std::string& pointer) {
  std::vector<KeypointJoints> joints;
  for (std::size_t i = 0; i < list.items.size(); ++i)
    joints.push_back(joints_at(list.items[i], child_pointer(pointer, std::to_string(i))));
  const auto has_joint = [](const KeypointJoints& point) { return !point.empty(); };
  if (std::none_of(joints.begin(), joints.end(), has_joint)) fail_at(list, pointer, "names no joint");
  return joints;
}

// ---- One person ----

std::array<double, 3> checked_point(const std::array<double, 3>& point, const ConfigValue& value,
                                    const std::string& pointer) {
  if (point[2] < 0 || point[2] > 1)
    fail_at(value, pointer, "the confidence " + number_text(point[2]) + " is out of range; allowed: 0 to 1");
  return point;
}

/// [x, y, c, x, y, c, ...]
FoundPerson person_in_row(const ConfigValue& list, const std::string& pointer) {
  check_kind(list, Kind::kArray, pointer);
  if (list.items.size() % 3 != 0)
    fail_at(list, pointer,
            "has " + std::to_string(list.items.size()) + " numbers; x, y and a confidence a point are needed");
  FoundPerson person;
  for (std::size_t i = 0; i + 2 < list.items.size(); i += 3) {
    std::array<double, 3> point{};
    for (std::size_t k = 0; k < 3; ++k)
      point[k] = number_of(list.items[i + k], child_pointer(pointer, std::to_string(i + k)));
    person.push_back(checked_point(point, list.items[i + 2], child_pointer(pointer, std::to_string(i + 2))));
  }
  return person;
}

/// [[x, y, c], ...]
FoundPerson person_in_rows(const ConfigValue& list, const std::string& pointer) {
  check_kind(list, Kind::kArray, pointer);
  FoundPerson person;
  for (std::size_t i = 0; i < list.items.size(); ++i) {
    const std::string place = child_pointer(pointer, std::to_string(i));
    const FoundPerson point = person_in_row(list.items[i], place);
    if (point.size() != 1) fail_at(list.items[i], place, "is no point [x, y, confidence]");
    person.push_back(point.front());
  }
  return person;
}

/// Gives the set of points, where it is not known yet, and looks whether the person has as many.
void check_count(const FoundPerson& person, std::vector<KeypointJoints>& joints, const ConfigValue& value,
                 const std::string& pointer) {
  if (joints.empty()) joints = joints_by_count(person.size(), value, pointer);
  if (person.size() != joints.size())
    fail_at(value, pointer,
            "has " + std::to_string(person.size()) + " points; " + std::to_string(joints.size()) + " are needed");
}

/// [x, y, z]
std::array<double, 3> place_at(const ConfigValue& value, const std::string& pointer) {
  check_kind(value, Kind::kArray, pointer);
  if (value.items.size() != 3) fail_at(value, pointer, "is no place [x, y, z]");
  std::array<double, 3> place{};
  for (std::size_t i = 0; i < 3; ++i) place[i] = number_of(value.items[i], child_pointer(pointer, std::to_string(i)));
  return place;
}

// ---- The formats ----

std::vector<KeypointJoints> own_joints(const ConfigValue& tree) {
  const ConfigValue* const joints = find_member(tree, "joints");
  if (joints == nullptr) fail_at(tree, "", "there is no \"joints\"; allowed: " + set_names() + ", or a list of joints");
  if (joints->kind == Kind::kArray) return joints_in_list(*joints, "/joints");
  check_kind(*joints, Kind::kString, "/joints");
  for (const KeypointSet& set : kKeypointSets) {
    if (set.name == joints->text) return joints_of(set);
  }
  fail_at(*joints, "/joints",
          json_string(joints->text) + " is not known; allowed: " + set_names() + ", or a list of joints");
}

std::array<double, 2> own_size(const ConfigValue& tree) {
  const ConfigValue* const size = find_member(tree, "size");
  if (size == nullptr) return {0, 0};
  check_kind(*size, Kind::kArray, "/size");
  std::array<double, 2> pixels{};
  if (size->items.size() != 2) fail_at(*size, "/size", "is not [width, height]");
  for (std::size_t i = 0; i < 2; ++i) {
    pixels[i] = number_of(size->items[i], "/size/" + std::to_string(i));
    if (!(pixels[i] >= 1))
      fail_at(size->items[i], "/size/" + std::to_string(i),
              size->items[i].text + " is out of range; allowed: at least 1");
  }
  return pixels;
}

/// [[[x, y, z], ...], ...]: as many frames as of points, each with as many places as it has points, or none.
std::vector<FoundPerson> own_landmarks(const ConfigValue& tree, const FoundKeypoints& found) {
  const ConfigValue* const landmarks = find_member(tree, "landmarks");
  if (landmarks == nullptr) return {};
  check_kind(*landmarks, Kind::kArray, "/landmarks");
  if (landmarks->items.size() != found.frames.size())
    fail_at(*landmarks, "/landmarks",
            "has " + std::to_string(landmarks->items.size()) + " frames; /frames has " +
                std::to_string(found.frames.size()));
  std::vector<FoundPerson> all;
  for (std::size_t t = 0; t < landmarks->items.size(); ++t) {
    const std::string pointer = "/landmarks/" + std::to_string(t);
    const ConfigValue& frame = landmarks->items[t];
    check_kind(frame, Kind::kArray, pointer);
    if (!frame.items.empty() && frame.items.size() != found.joints.size())
      fail_at(frame, pointer,
              "has " + std::to_string(frame.items.size()) + " points; " + std::to_string(found.joints.size()) +
                  " or none are needed");
    FoundPerson& places = all.emplace_back();
    for (std::size_t k = 0; k < frame.items.size(); ++k)
      places.push_back(place_at(frame.items[k], child_pointer(pointer, std::to_string(k))));
  }
  return all;
}

/// [0.93, ...]: as many as frames.
std::vector<double> own_scores(const ConfigValue& tree, std::size_t frames) {
  const ConfigValue* const list = find_member(tree, "scores");
  if (list == nullptr) return {};
  check_kind(*list, Kind::kArray, "/scores");
  if (list->items.size() != frames)
    fail_at(*list, "/scores",
            "has " + std::to_string(list->items.size()) + " numbers; /frames has " + std::to_string(frames));
  std::vector<double> scores;
  for (std::size_t t = 0; t < frames; ++t) {
    const std::string pointer = "/scores/" + std::to_string(t);
    scores.push_back(number_of(list->items[t], pointer));
    if (!(scores.back() >= 0 && scores.back() <= 1))
      fail_at(list->items[t], pointer, list->items[t].text + " is out of range; allowed: 0 to 1");
  }
  return scores;
}

FoundKeypoints read_own(const ConfigValue& tree, const std::vector<KeypointJoints>& joints) {
  const ConfigValue* const version = find_member(tree, "version");
  if (version != nullptr && number_of(*version, "/version") != 1)
    fail_at(*version, "/version", version->text + " is not known; allowed: 1");
  FoundKeypoints found;
  found.joints = joints.empty() ? own_joints(tree) : joints;
  found.size = own_size(tree);
  const ConfigValue* const frames = find_member(tree, "frames");
  if (frames == nullptr) fail_at(tree, "", "there is no \"frames\"");
  check_kind(*frames, Kind::kArray, "/frames");
  for (std::size_t t = 0; t < frames->items.size(); ++t) {
    const std::string pointer = "/frames/" + std::to_string(t);
    const FoundPerson person = person_in_rows(frames->items[t], pointer);
    found.frames.emplace_back();
    if (person.empty()) continue;
    check_count(person, found.joints, frames->items[t], pointer);
    found.frames.back().push_back(person);
  }
  found.landmarks = own_landmarks(tree, found);
  found.scores = own_scores(tree, found.frames.size());
  return found;
}

/// By image_id, a frame's number from 0.
FoundKeypoints read_coco(const ConfigValue& list, const std::vector<KeypointJoints>& joints) {
  FoundKeypoints found;
  found.joints = joints;
  found.lacks_empty_frames = true;
  for (std::size_t i = 0; i < list.items.size(); ++i) {
    const ConfigValue& entry = list.items[i];
    const std::string pointer = "/" + std::to_string(i);
    check_kind(entry, Kind::kObject, pointer);
    const ConfigValue *const id = find_member(entry, "image_id"), *const points = find_member(entry, "keypoints");
    if (id == nullptr || points == nullptr)
      fail_at(entry, pointer, "lacks image_id or keypoints; it is no result of COCO");
    const std::int64_t number = whole_number_of(*id, pointer + "/image_id");
    if (number >= kMostFrames)
      fail_at(*id, pointer + "/image_id",
              id->text + " is no frame's number; allowed: 0 to " + std::to_string(kMostFrames - 1));
    const FoundPerson person = person_in_row(*points, pointer + "/keypoints");
    check_count(person, found.joints, *points, pointer + "/keypoints");
    if (found.frames.size() <= static_cast<std::size_t>(number))
      found.frames.resize(static_cast<std::size_t>(number) + 1);
    found.frames[static_cast<std::size_t>(number)].push_back(person);
  }
  return found;
}

/// Adds a frame of OpenPose.
void add_openpose(const std::string& text, const std::string& name, FoundKeypoints& found) {
  const ConfigValue tree = parse_json_text(text, name);
  check_kind(tree, Kind::kObject, "");
  const ConfigValue* const people = find_member(tree, "people");
  if (people == nullptr) fail_at(tree, "", "there is no \"people\"; it is no file of OpenPose");
  check_kind(*people, Kind::kArray, "/people");
  std::vector<FoundPerson>& persons = found.frames.emplace_back();
  for (std::size_t i = 0; i < people->items.size(); ++i) {
    const std::string pointer = "/people/" + std::to_string(i);
    check_kind(people->items[i], Kind::kObject, pointer);
    const ConfigValue* const points = find_member(people->items[i], "pose_keypoints_2d");
    if (points == nullptr) fail_at(people->items[i], pointer, "there is no \"pose_keypoints_2d\"");
    const FoundPerson person = person_in_row(*points, pointer + "/pose_keypoints_2d");
    if (person.empty()) continue;
    check_count(person, found.joints, *points, pointer + "/pose_keypoints_2d");
    persons.push_back(person);
  }
}

FoundKeypoints read_openpose(const fs::path& folder, const std::vector<KeypointJoints>& joints) {
  const std::vector<fs::path> files = keypoint_files(folder);
  if (files.empty())
    throw UserError(folder.string() + ": holds no NAME" + std::string(kOpenPoseEnding) + ", as OpenPose writes them");
  FoundKeypoints found;
  found.joints = joints;
  for (const fs::path& file : files) add_openpose(read_text_file(file.string()), file.string(), found);
  return found;
}

// ---- One person of them ----

double confidence_of(const FoundPerson& person) {
  double sum = 0;
  for (const auto& point : person) sum += point[2];
  return sum;
}

/// Mean distance of the points that both have; infinite where there is none.
double distance_of(const FoundPerson& a, const FoundPerson& b) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i][2] == 0 || b[i][2] == 0) continue;
    sum += std::hypot(a[i][0] - b[i][0], a[i][1] - b[i][1]);
    ++count;
  }
  return count == 0 ? std::numeric_limits<double>::infinity() : sum / count;
}

/// The person that is followed, by frame; null: nobody.
std::vector<const FoundPerson*> followed(const FoundKeypoints& found, const std::string& file) {
  std::vector<const FoundPerson*> persons;
  const FoundPerson* last = nullptr;
  Index crowded = 0;
  for (const std::vector<FoundPerson>& all : found.frames) {
    std::vector<const FoundPerson*> frame;
    for (const FoundPerson& person : all) {
      if (confidence_of(person) > 0) frame.push_back(&person);
    }
    const auto is_better = [&last](const FoundPerson* a, const FoundPerson* b) {
      return last == nullptr ? confidence_of(*a) > confidence_of(*b) : distance_of(*a, *last) < distance_of(*b, *last);
    };
    const auto best = std::min_element(frame.begin(), frame.end(), is_better);
    persons.push_back(best == frame.end() ? nullptr : *best);
    if (best != frame.end()) last = *best;
    crowded += frame.size() > 1 ? 1 : 0;
  }
  if (last == nullptr) throw DataError(file + ": shows nobody in any frame");
  if (crowded > 0)
    log_warning(file + ": shows several persons in " + std::to_string(crowded) + " of " +
                std::to_string(found.frames.size()) +
                " frames; the one whom the detector is surest of at first is followed, then whoever is nearest");
  return persons;
}

void tell_empty_frames(const Keypoints& keypoints, const std::string& file) {
  std::vector<Index> empty;
  for (std::size_t t = 0; t < keypoints.frames.size(); ++t) {
    const std::vector<Keypoint>& points = keypoints.frames[t];
    if (std::none_of(points.begin(), points.end(), [](const Keypoint& point) { return point.confidence > 0; }))
      empty.push_back(static_cast<Index>(t));
  }
  if (empty.empty()) return;
  log_warning(file + ": shows nobody in " + std::to_string(empty.size()) + " of " +
              std::to_string(keypoints.frames.size()) + " frames (" + frame_ranges(empty) +
              "); losses of keypoints are off there");
}

/// Frames of somebody who is found doubtfully.
void tell_doubtful_frames(const Keypoints& keypoints, const std::vector<const FoundPerson*>& persons,
                          const std::string& file) {
  std::vector<Index> doubtful;
  for (std::size_t t = 0; t < keypoints.scores.size(); ++t) {
    if (persons[t] != nullptr && keypoints.scores[t] < kDoubtfulScore) doubtful.push_back(static_cast<Index>(t));
  }
  if (doubtful.empty()) return;
  log_warning(file + ": the person is found doubtfully in " + std::to_string(doubtful.size()) + " of " +
              std::to_string(keypoints.frames.size()) + " frames (" + frame_ranges(doubtful) + "), scores below " +
              number_text(kDoubtfulScore));
}

}  // namespace

FoundKeypoints read_found_keypoints(const fs::path& path, const std::vector<KeypointJoints>& joints) {
  if (fs::is_directory(path)) return read_openpose(path, joints);
  return parse_keypoints(read_text_file(path.string()), path.string(), joints);
}

bool Keypoints::has_landmarks() const {
  const auto has_some = [](const std::vector<Keypoint>& frame) {
    return std::any_of(frame.begin(), frame.end(), [](const Keypoint& point) { return point.landmark.has_value(); });
  };
  return std::any_of(frames.begin(), frames.end(), has_some);
}

std::vector<Bone> bones_of(const std::vector<KeypointJoints>& joints) {
  std::vector<int> points(kSmplxJoints, -1);  // by joint
  for (std::size_t k = 0; k < joints.size(); ++k) {
    if (joints[k].size() == 1) points[static_cast<std::size_t>(joints[k].front().first)] = static_cast<int>(k);
  }
  const auto point_of = [&points](const char* name) { return points[static_cast<std::size_t>(smplx_joint(name))]; };
  std::vector<Bone> bones;
  for (int joint = 1; joint < kBodyJoints; ++joint) {
    const int point = points[static_cast<std::size_t>(joint)];
    int above = smplx_parents()[static_cast<std::size_t>(joint)];
    while (above >= 0 && points[static_cast<std::size_t>(above)] < 0)
      above = smplx_parents()[static_cast<std::size_t>(above)];
    if (point >= 0 && above >= 0) bones.push_back({{point, 1.0}, {points[static_cast<std::size_t>(above)], -1.0}});
  }
  const int left_hip = point_of("left_hip"), right_hip = point_of("right_hip"),
            left_shoulder = point_of("left_shoulder"), right_shoulder = point_of("right_shoulder");
  const bool has_hips = left_hip >= 0 && right_hip >= 0, has_shoulders = left_shoulder >= 0 && right_shoulder >= 0;
  if (has_hips) bones.push_back({{left_hip, 1.0}, {right_hip, -1.0}});
  if (has_shoulders) bones.push_back({{left_shoulder, 1.0}, {right_shoulder, -1.0}});
  if (has_hips && has_shoulders)
    bones.push_back({{left_shoulder, 0.5}, {right_shoulder, 0.5}, {left_hip, -0.5}, {right_hip, -0.5}});
  return bones;
}

FoundKeypoints parse_keypoints(const std::string& text, const std::string& name,
                               const std::vector<KeypointJoints>& joints) {
  const ConfigValue tree = parse_json_text(text, name);
  if (tree.kind == Kind::kArray) return read_coco(tree, joints);
  check_kind(tree, Kind::kObject, "");
  if (string_member(tree, "format") != kFormat)
    fail_at(tree, "", "is neither a list of COCO's results nor {\"format\": \"" + std::string(kFormat) + "\", ...}");
  return read_own(tree, joints);
}

std::vector<KeypointJoints> parse_keypoint_joints(const std::string& text, const std::string& name) {
  const ConfigValue tree = parse_json_text(text, name);
  check_kind(tree, Kind::kArray, "");
  return joints_in_list(tree, "");
}

std::vector<fs::path> keypoint_files(const fs::path& keypoints) {
  if (keypoints.empty()) return {};
  if (!fs::is_directory(keypoints)) return {keypoints};
  std::vector<fs::path> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(keypoints, error)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(kOpenPoseEnding) && !is_hidden(name)) files.push_back(entry.path());
  }
  if (error) throw UserError(keypoints.string() + ": cannot be read: " + error.message());
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    const std::string name = file.filename().string(), first = files.front().filename().string();
    if (name.size() != first.size())
      throw DataError(keypoints.string() + ": the names " + first + " and " + name +
                      " have different lengths; files are taken in the order of their names, so fill numbers up with "
                      "zeros");
  }
  return files;
}

Keypoints read_keypoints(const DataSettings& data, const FrameSource& frames) {
  const std::string file = data.keypoints.string();
  const std::vector<KeypointJoints> given =
      data.keypoint_joints.empty()
          ? std::vector<KeypointJoints>()
          : parse_keypoint_joints(read_text_file(data.keypoint_joints.string()), data.keypoint_joints.string());
  FoundKeypoints found = read_found_keypoints(data.keypoints, given);
  if (found.lacks_empty_frames && std::ssize(found.frames) < frames.video_count())
    found.frames.resize(static_cast<std::size_t>(frames.video_count()));
  const Image first = frames.read(0);
  const double width = first.width(), height = first.height();
  if (found.size[0] == 0) found.size = {width, height};
  if (std::abs(found.size[0] / width / (found.size[1] / height) - 1) > 1 / std::min(width, height))
    throw DataError(file + ": is of pictures of " + number_text(found.size[0]) + "x" + number_text(found.size[1]) +
                    " pixels, the video's frames are of " + number_text(width) + "x" + number_text(height) +
                    "; allowed: pictures of their shape");
  const std::vector<const FoundPerson*> persons =
      kept_frames(followed(found, file), frames, file, "frames of keypoints");
  const std::vector<FoundPerson> landmarks =
      found.landmarks.empty() ? found.landmarks : kept_frames(found.landmarks, frames, file, "frames of landmarks");
  Keypoints keypoints;
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < found.joints.size(); ++i) {
    if (!found.joints[i].empty()) used.push_back(i);
  }
  for (const std::size_t i : used) keypoints.joints.push_back(found.joints[i]);
  for (std::size_t t = 0; t < persons.size(); ++t) {
    const FoundPerson* const person = persons[t];
    std::vector<Keypoint>& points = keypoints.frames.emplace_back(used.size());
    for (std::size_t k = 0; person != nullptr && k < used.size(); ++k) {
      const auto& [x, y, confidence] = (*person)[used[k]];
      points[k] = {x / found.size[0], y / found.size[1], confidence};
      if (landmarks.empty() || landmarks[t].empty()) continue;
      points[k].landmark = Vector3<double>(landmarks[t][used[k]].data());
    }
  }
  if (!found.scores.empty()) keypoints.scores = kept_frames(found.scores, frames, file, "scores of keypoints");
  tell_empty_frames(keypoints, file);
  tell_doubtful_frames(keypoints, persons, file);
  return keypoints;
}

}  // namespace hsi4d
