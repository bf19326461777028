#include "pipelines/evaluate/tracks.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "body/kinematics.h"
#include "body/motion_edit.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "core/text.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/evaluate/behave_sequence.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/scene_setup.h"
#include "pipelines/record/folder.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr double kSameMoment = 1e-6;  // frames
constexpr const char* kGoodFrames = "good_frames_mask";

// ---- Files ----

void check_count(const std::string& file, std::size_t count, const char* what, const Track& track) {
  if (static_cast<Index>(count) == track.frames()) return;
  throw DataError(file + ": holds " + std::to_string(count) + " " + what + ", the motion beside it has " +
                  std::to_string(track.frames()) + " frames");
}

void take_objects(const std::string& file, const std::string& unnamed, Track& track) {
  ForeignObjects found = read_motion_objects(file, unnamed);
  track.objects = std::move(found.names);
  track.object_poses = std::move(found.poses);
  track.objects_are_of_origins = found.are_of_origins;
  if (!track.objects.empty()) check_count(file, track.object_poses.size(), "frames of objects", track);
}

/// motion.npz, and objects.npz and cameras.json where they are there.
Track read_track_folder(const fs::path& folder, const std::string& name) {
  const auto file = [&folder](const char* member) { return (folder / member).string(); };
  Track track;
  track.name = name;
  track.motion = read_motion_with_warnings(file("motion.npz"));
  if (fs::exists(file("objects.npz"))) take_objects(file("objects.npz"), TrackOptions{}.object_name, track);
  if (fs::exists(file("cameras.json"))) {
    for (const PictureCamera& one : read_picture_cameras(file("cameras.json"))) {
      if (!one.picture.empty())
        throw DataError(file("cameras.json") +
                        ": names pictures (file_path), and the frames of a motion have no names; " +
                        "needed: {\"format\": \"hsi4d cameras\", ...}, a camera a frame in order");
      track.camera_from_world.push_back(one.camera.camera_from_world);
    }
    check_count(file("cameras.json"), track.camera_from_world.size(), "cameras", track);
  }
  return track;
}

Track read_pose_track(const std::string& path, const TrackOptions& options) {
  PoseFolder folder =
      read_pose_folder_with_warnings(path, options.frame_rate.value_or(kPoseFolderRate), options.person);
  Track track;
  track.name = path;
  track.motion = std::move(folder.motion);
  return track;
}

/// Which frames are good ones, where a motion's file says it; else empty.
std::vector<bool> read_good_frames(const std::string& path, Index frames) {
  const Npz file = Npz::read(path);
  if (!file.has(kGoodFrames)) return {};
  const NpyArray& array = file.array(kGoodFrames);
  std::vector<bool> good;
  for (const double number : array.require_shape({frames}).as<double>()) {
    if (number != 0 && number != 1)
      throw DataError(array.source() + ": frame " + std::to_string(good.size()) + " is " + number_text(number) +
                      "; allowed: 0 and 1");
    good.push_back(number == 1);
  }
  return good;
}

/// A motion (.npz), with its objects.
Track read_motion_track(const std::string& path, const TrackOptions& options) {
  Track track;
  track.name = path;
  track.motion = read_motion_with_warnings(path);
  track.good_frames = read_good_frames(path, track.frames());
  if (options.frame_rate && !(options.fills_in && track.motion.says_frame_rate)) {
    track.motion.frame_rate = *options.frame_rate;
    track.motion.says_frame_rate = true;
  }
  track.objects_stay = !options.objects.empty();
  take_objects(track.objects_stay ? options.objects : path, options.object_name, track);
  if (track.objects_stay && track.objects.empty()) throw DataError(options.objects + ": holds no poses of objects");
  const UpFinding finding = find_up(path, track.motion, {options.up, options.fills_in, options.upright});
  track.world = finding.words;
  track.up = finding.up;
  return track;
}

/// A path in section `data` of the config of a run, or of each clip of a chain; empty where it is not given.
std::vector<fs::path> data_paths(const std::string& run, std::string_view key) {
  const std::string file = RunPaths{run}.config();
  if (!fs::exists(file)) return {};
  const ConfigValue tree = parse_json_text(read_text_file(file), file);
  std::vector<fs::path> paths;
  const auto add_of = [&](const ConfigValue& holder) {
    const ConfigValue* const data = find_member(holder, "data");
    const std::string path = data == nullptr ? "" : string_member(*data, key);
    paths.push_back(path.empty() ? fs::path() : fs::path(path_beside(file, path)));
  };
  const ConfigValue* const chain = find_member(tree, "chain");
  if (chain == nullptr || chain->items.empty()) {
    add_of(tree);
  } else {
    for (const ConfigValue& clip : chain->items) add_of(clip);
  }
  return paths;
}

/// A path in section `data` that all clips of a run have; empty where they do not, or it is not there.
fs::path common_data_path(const std::string& run, std::string_view key) {
  const std::vector<fs::path> paths = data_paths(run, key);
  const bool is_common = !paths.empty() && std::all_of(paths.begin(), paths.end(), [&paths](const fs::path& path) {
    return path == paths.front();
  });
  return is_common && fs::exists(paths.front()) ? paths.front() : fs::path();
}

/// Puts a track behind another whose last frame is its first.
void append_track(const Track& more, Track& track) {
  if (more.objects != track.objects || more.camera_from_world.empty() != track.camera_from_world.empty() ||
      more.good_frames.empty() != track.good_frames.empty() || more.motion.frame_rate != track.motion.frame_rate ||
      more.up != track.up)
    throw DataError(more.name + ": has other objects, cameras, good frames or another frame rate than " + track.name);
  const auto append = [](const auto& from, auto& to) {
    if (!from.empty()) to.insert(to.end(), from.begin() + 1, from.end());
  };
  append(more.motion.poses, track.motion.poses);
  append(more.object_poses, track.object_poses);
  append(more.camera_from_world, track.camera_from_world);
  append(more.good_frames, track.good_frames);
}

/// The file of an object's Gaussians in the config of a run; empty where it names none.
fs::path object_path(const std::string& run, const std::string& name) {
  const std::string file = RunPaths{run}.config();
  if (!fs::exists(file)) return {};
  const ConfigValue tree = parse_json_text(read_text_file(file), file);
  const ConfigValue* const chain = find_member(tree, "chain");
  const ConfigValue* place = chain == nullptr || chain->items.empty() ? &tree : &chain->items.front();
  for (const std::string_view key : {std::string_view("data"), std::string_view("objects"), std::string_view(name)}) {
    place = find_member(*place, key);
    if (place == nullptr) return {};
  }
  const std::string path = string_member(*place, "gaussians");
  return path.empty() ? fs::path() : fs::path(path_beside(file, path));
}

/// The folders that may be the dataset of a path: "data", and that of "data/truth".
std::vector<fs::path> dataset_folders(const fs::path& path) {
  const fs::path above = path.parent_path();
  return {path, above.empty() ? fs::path(".") : above};
}

// ---- Time ----

/// Between two of `count` values, at `place` frames.
/// @param value    of a frame
/// @param between  as interpolated
template <class Value, class Between>
auto at_place(Index count, double place, Value value, Between between) {
  HSI4D_CHECK(place > -kSameMoment, "frame " + number_text(place) + " of a motion");
  const double nearest = std::round(place), last = static_cast<double>(count - 1);
  if (std::fabs(place - nearest) < kSameMoment || place >= last)
    return value(static_cast<std::size_t>(std::clamp(nearest, 0.0, last)));
  const double before = std::floor(place);
  const auto index = static_cast<std::size_t>(before);
  return between(value(index), value(index + 1), place - before);
}

/// The camera's centre moves on a line.
Rigid<double> between_cameras(const Rigid<double>& a, const Rigid<double>& b, double u) {
  return inverse(between_poses(inverse(a), inverse(b), u));
}

FrameState state_at(const Track& track, const RestSkeleton& body, const std::vector<std::size_t>& objects,
                    double place) {
  FrameState state;
  const BodyPose pose = at_place(
      track.frames(), place, [&track](std::size_t t) { return track.motion.poses[t]; }, interpolated);
  if (pose.axis_angle.size() != body.joints.size())
    throw DataError(track.name + ": its poses have " + std::to_string(pose.axis_angle.size() / 3) +
                    " joints, the body " + std::to_string(body.joints.size() / 3));
  state.joints = pose_joints(body.parents, body.joints, pose);
  for (const std::size_t object : objects) {
    const auto pose_of = [&track, object](std::size_t t) {
      const ObjectPose& at = track.object_poses[t][object];
      return Rigid<double>{so3_exp(at.rotation), at.translation};
    };
    state.world_from_object.push_back(at_place(track.frames(), place, pose_of, between_poses));
  }
  if (!track.camera_from_world.empty())
    state.camera_from_world = at_place(
        track.frames(), place, [&track](std::size_t t) { return track.camera_from_world[t]; }, between_cameras);
  return state;
}

/// All objects of a track.
std::vector<ObjectPose> objects_at(const Track& track, double place) {
  std::vector<ObjectPose> objects;
  for (std::size_t o = 0; o < track.objects.size() && !track.object_poses.empty(); ++o) {
    const auto pose_of = [&track, o](std::size_t t) {
      const ObjectPose& at = track.object_poses[t][o];
      return Rigid<double>{so3_exp(at.rotation), at.translation};
    };
    const Rigid<double> pose = at_place(track.frames(), place, pose_of, between_poses);
    objects.push_back({so3_log(pose.rotation), pose.translation});
  }
  return objects;
}

/// Whether the frames about a place are good ones.
bool is_good_at(const Track& track, double place) {
  if (track.good_frames.empty()) return true;
  return at_place(
      track.frames(), place, [&track](std::size_t t) -> bool { return track.good_frames[t]; },
      [](bool a, bool b, double) { return a && b; });
}

/// Body and all objects of a track, as far as they are known.
SceneState all_at(const Track& track, double place) {
  SceneState state;
  state.body = at_place(
      track.frames(), place, [&track](std::size_t t) { return track.motion.poses[t]; }, interpolated);
  state.objects = objects_at(track, place);
  return state;
}

/// Where `track` has the objects of `wanted`, where both have objects.
std::vector<std::size_t> places_of(const Track& track, const Track& wanted) {
  std::vector<std::size_t> places;
  if (track.object_poses.empty() || wanted.object_poses.empty()) return places;
  for (const std::string& name : wanted.objects) {
    const auto at = std::find(track.objects.begin(), track.objects.end(), name);
    if (at == track.objects.end())
      throw DataError(track.name + ": there is no object \"" + name + "\", which " + wanted.name + " has; there is " +
                      joined(track.objects));
    places.push_back(static_cast<std::size_t>(at - track.objects.begin()));
  }
  return places;
}

/// The rate to compare at: that of the slower track, or a slower one.
double compared_rate(double slower, std::optional<double> wanted, const std::string& name) {
  if (!wanted) return slower;
  if (*wanted > slower)
    throw UserError("--frame-rate: " + number_text(*wanted) + " is above the " + number_text(slower) +
                    " frames a second of " + name + ", and what is between frames is not known; allowed: up to " +
                    number_text(slower));
  return *wanted;
}

/// Moments at a rate from 0 to `end` seconds.
Index count_of_moments(double end, double rate) { return static_cast<Index>(std::floor(end * rate + kSameMoment)) + 1; }

/// A path of the dataset that a path is in; empty where there is none.
template <class F>
std::string dataset_path(const std::string& path, const F& of) {
  if (!fs::is_directory(path)) return "";
  for (const fs::path& folder : dataset_folders(path)) {
    const fs::path found = of(dataset_inputs(folder));
    if (!found.empty() && fs::exists(found)) return found.string();
  }
  return "";
}

}  // namespace

bool is_run_folder(const std::string& path) { return fs::exists(RunPaths{path}.status()); }

void check_holds_track(const std::string& path, const std::string& member) {
  std::error_code error;
  if (!fs::exists(path, error)) throw UserError(path + ": there is no such file or folder");
  if (!fs::is_directory(path, error) || is_run_folder(path)) return;
  const fs::path folder = path;
  if (fs::exists(folder / "truth", error) || fs::exists(folder / "initial.json", error)) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".npz" && !is_hidden(entry.path().string())) return;
  }
  const fs::path inner = folder / member;
  const bool is_meant = member == "run" ? is_run_folder(inner.string()) : fs::exists(inner / "truth", error);
  throw UserError(path + ": holds no run, dataset or motion" +
                  (is_meant ? "; did you mean " + inner.generic_string() + "?" : ""));
}

Track read_track(const std::string& path, const TrackOptions& options) {
  if (!fs::exists(path)) throw UserError(path + ": there is no such file or folder");
  if (fs::is_directory(path)) {
    const fs::path folder = path;
    if (is_run_folder(path) && !fs::exists(folder / "motion.npz"))
      throw UserError(path + ": the run has no motion.npz; it has not come to its end");
    if (fs::exists(folder / "motion.npz")) return read_track_folder(folder, path);
    if (fs::exists(folder / "truth" / "motion.npz")) return read_track_folder(folder / "truth", path);
    if (fs::exists(folder / "initial.json"))
      throw UserError(path + ": is a dataset without truth/motion.npz, which errors are measured against");
    if (is_behave_sequence(path)) return read_behave_sequence(path, options.object_name);
    return read_pose_track(path, options);
  }
  if (!path.ends_with(".npz")) throw UserError(path + ": is neither a folder of a run or dataset nor a motion (.npz)");
  return read_motion_track(path, options);
}

std::string avatar_of_track(const std::string& path) {
  if (is_run_folder(path)) {
    const std::vector<fs::path> avatars = data_paths(path, "avatar");
    return !avatars.empty() && fs::exists(avatars.front()) ? avatars.front().string() : "";
  }
  for (const fs::path& folder : dataset_folders(path)) {
    const fs::path avatar = dataset_inputs(folder).avatar;
    if (fs::is_directory(path) && fs::exists(avatar)) return avatar.string();
  }
  return "";
}

std::vector<std::string> truths_of_run(const std::string& path) {
  std::vector<std::string> truths;
  for (const fs::path& truth : data_paths(path, "truth")) {
    if (truth.empty() || !fs::exists(truth)) return {};
    truths.push_back(truth.string());
  }
  return truths;
}

Track read_joined_tracks(const std::vector<std::string>& paths, const TrackOptions& options) {
  HSI4D_CHECK(!paths.empty(), "there is no track to join");
  Track track = read_track(paths.front(), options);
  for (std::size_t i = 1; i < paths.size(); ++i) append_track(read_track(paths[i], options), track);
  return track;
}

void move_world(const Rigid<double>& to_from, Track& track) {
  HSI4D_CHECK(track.motion.pelvis_rest.has_value(), track.name + ": is on no body");
  track.motion = transformed(track.motion, to_from, *track.motion.pelvis_rest);
  for (Rigid<double>& camera : track.camera_from_world) camera = compose(camera, inverse(to_from));
  if (track.objects_stay) return;
  for (std::vector<ObjectPose>& poses : track.object_poses) {
    for (ObjectPose& pose : poses)
      pose = {so3_log(Matrix3<double>(to_from.rotation * so3_exp(pose.rotation))),
              transform_point(to_from, pose.translation)};
  }
}

void turn_z_up(Track& track) {
  if (track.up == UpAxis::kZ) return;
  move_world(z_up_from_y_up(), track);
  track.up = UpAxis::kZ;
}

std::string object_file_of_track(const std::string& path, const std::string& object) {
  const auto existing = [](const fs::path& file) { return fs::exists(file) ? file.string() : ""; };
  if (is_run_folder(path)) return existing(object_path(path, object));
  if (!fs::is_directory(path)) return "";
  for (const fs::path& folder : dataset_folders(path)) {
    const DataSettings data = dataset_inputs(folder);
    if (const ObjectSettings* const found = find_entry(data.objects, object)) return existing(found->gaussians);
  }
  return "";
}

std::vector<std::string> object_names_of_track(const std::string& path) {
  std::vector<std::string> names;
  if (!is_run_folder(path)) {
    if (!fs::is_directory(path)) return names;
    for (const fs::path& folder : dataset_folders(path)) {
      for (const auto& [name, object] : dataset_inputs(folder).objects) names.push_back(name);
      if (!names.empty()) break;
    }
    return names;
  }
  const std::string file = RunPaths{path}.config();
  if (!fs::exists(file)) return names;
  const ConfigValue tree = parse_json_text(read_text_file(file), file);
  const ConfigValue* const chain = find_member(tree, "chain");
  const ConfigValue& clip = chain == nullptr || chain->items.empty() ? tree : chain->items.front();
  const ConfigValue* const data = find_member(clip, "data");
  const ConfigValue* const objects = data == nullptr ? nullptr : find_member(*data, "objects");
  if (objects == nullptr) return names;
  for (const ConfigMember& member : objects->members) names.push_back(member.key);
  return names;
}

std::string surface_of_track(const std::string& path) {
  if (is_run_folder(path)) return common_data_path(path, "surface").string();
  return dataset_path(path, [](const DataSettings& data) { return data.surface; });
}

std::string scene_of_track(const std::string& path) {
  if (is_run_folder(path)) return common_data_path(path, "scene").string();
  return dataset_path(path, [](const DataSettings& data) { return data.scene; });
}

std::string initial_of_track(const std::string& path) {
  DataSettings data;
  if (is_run_folder(path)) {
    const std::vector<fs::path> paths = data_paths(path, "initial");
    if (!paths.empty()) data.initial = paths.front();
  } else {
    data.initial = dataset_path(path, [](const DataSettings& inputs) { return inputs.initial; });
  }
  return !data.initial.empty() && fs::exists(data.initial) ? initial_motion_file(data).string() : "";
}

Rigid<double> between_poses(const Rigid<double>& a, const Rigid<double>& b, double u) {
  return {a.rotation * so3_exp(Vector3<double>(u * so3_log(Matrix3<double>(a.rotation.transpose() * b.rotation)))),
          (1 - u) * a.translation + u * b.translation};
}

BodyPose body_at(const Track& track, double seconds) {
  return at_place(
      track.frames(), seconds * track.motion.frame_rate - track.motion.first_frame,
      [&track](std::size_t t) { return track.motion.poses[t]; }, interpolated);
}

std::vector<SceneState> object_states(const Track& track, double frame_rate, Index count) {
  std::vector<SceneState> states;
  if (track.object_poses.empty()) return states;
  for (Index k = 0; k < count; ++k) {
    SceneState state;
    state.objects = objects_at(track, static_cast<double>(k) / frame_rate * track.motion.frame_rate);
    states.push_back(std::move(state));
  }
  return states;
}

AlignedTracks by_itself(const Track& track, const RestSkeleton& body, std::optional<double> frame_rate) {
  if (!track.motion.says_frame_rate) throw UserError(track.name + ": says no frame rate; --from-rate says it");
  AlignedTracks tracks;
  tracks.frame_rate = compared_rate(track.motion.frame_rate, frame_rate, track.name);
  const Index count =
      count_of_moments(static_cast<double>(track.frames() - 1) / track.motion.frame_rate, tracks.frame_rate);
  if (count < 2)
    throw UserError(track.name + ": has " + std::to_string(track.frames()) +
                    " frames; what is measured is of the frames after the first");
  std::vector<std::size_t> objects(track.object_poses.empty() ? 0 : track.objects.size());
  std::iota(objects.begin(), objects.end(), std::size_t{0});
  for (Index k = 0; k < count; ++k) {
    const double place = static_cast<double>(k) / tracks.frame_rate * track.motion.frame_rate;
    tracks.estimate.push_back(state_at(track, body, objects, place));
    tracks.states.push_back(all_at(track, place));
  }
  return tracks;
}

double rate_beside(const Track& track, const Track& other) {
  if (track.motion.says_frame_rate) return track.motion.frame_rate;
  if (track.frames() == other.frames() && other.motion.says_frame_rate) return other.motion.frame_rate;
  throw UserError(track.name + ": says no frame rate, and has " + std::to_string(track.frames()) + " frames where " +
                  other.name + " has " + std::to_string(other.frames()) + "; --from-rate says it");
}

AlignedTracks aligned(const Track& estimate, const RestSkeleton& estimate_body, const Track& truth,
                      const RestSkeleton& truth_body, std::optional<double> frame_rate) {
  const double estimate_rate = rate_beside(estimate, truth), truth_rate = rate_beside(truth, estimate);
  const std::vector<std::size_t> objects = places_of(estimate, truth);
  std::vector<std::size_t> true_objects(objects.size());
  std::iota(true_objects.begin(), true_objects.end(), std::size_t{0});
  AlignedTracks tracks;
  tracks.frame_rate =
      compared_rate(std::min(estimate_rate, truth_rate), frame_rate, estimate.name + " or " + truth.name);
  const double estimate_first = estimate.motion.first_frame, truth_first = truth.motion.first_frame;
  const double begin = std::max(estimate_first / estimate_rate, truth_first / truth_rate),
               end = std::min((estimate_first + static_cast<double>(estimate.frames() - 1)) / estimate_rate,
                              (truth_first + static_cast<double>(truth.frames() - 1)) / truth_rate);
  const Index count = count_of_moments(end, tracks.frame_rate);
  tracks.first = static_cast<Index>(std::ceil(begin * tracks.frame_rate - kSameMoment));
  if (count - tracks.first < 2)
    throw UserError(estimate.name + ": has " + std::to_string(estimate.frames()) + " frames and " + truth.name + " " +
                    std::to_string(truth.frames()) + "; errors are those of the frames after the first that both have");
  for (Index k = tracks.first; k < count; ++k) {
    const double seconds = static_cast<double>(k) / tracks.frame_rate;
    const double place = seconds * estimate_rate - estimate_first, true_place = seconds * truth_rate - truth_first;
    tracks.estimate.push_back(state_at(estimate, estimate_body, objects, place));
    tracks.states.push_back(all_at(estimate, place));
    tracks.truth.push_back(state_at(truth, truth_body, true_objects, true_place));
    tracks.true_states.push_back(all_at(truth, true_place));
    tracks.good.push_back(is_good_at(truth, true_place));
  }
  return tracks;
}

}  // namespace hsi4d
