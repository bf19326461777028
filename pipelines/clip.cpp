#include "pipelines/clip.h"

#include <algorithm>
#include <array>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/text.h"
#include "pipelines/body_files.h"
#include "pipelines/run_problems.h"
#include "splat/splat_file.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

/// initial.json: the state of frame 0, and estimated poses of all frames.
struct InitialPose {
  std::array<double, 3> rotation{}, translation{};
};

struct InitialSettings {
  fs::path motion;
  ConfigMap<InitialPose> objects;
};

void describe(ConfigFields& f, InitialPose& s) {
  f.numbers("rotation", s.rotation, {}, "Axis-angle, radians").required();
  f.numbers("translation", s.translation, {}, "Position of the object's centroid, metres").required();
}

void describe(ConfigFields& f, InitialSettings& s) {
  f.path("motion", s.motion, {.must_exist = true, .may_be_empty = false},
         "Poses (.npz): frame 0 exact, the others estimates; one frame alone: no estimates")
      .required();
  f.map("objects", s.objects, "Poses of the objects at frame 0, by name");
}

InitialSettings read_initial(const fs::path& file) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, {}, problems);
  return read_settings<InitialSettings>(tree, problems);
}

/// Refuses 8.png, 9.png, 10.png: in the order of their names 10 comes first.
void check_numbering(const std::vector<std::string>& names, const fs::path& folder) {
  const auto is_number = [](const std::string& name) {
    const std::string stem = fs::path(name).stem().string();
    return !stem.empty() && std::all_of(stem.begin(), stem.end(), [](char c) { return c >= '0' && c <= '9'; });
  };
  if (!std::all_of(names.begin(), names.end(), is_number)) return;
  for (const std::string& name : names) {
    if (name.size() == names.front().size()) continue;
    throw DataError(
        folder.string() + ": \"" + names.front() + "\" and \"" + name +
        "\" have different numbers of digits; frames are taken in the order of their names, so fill up with zeros");
  }
}

/// Logs, checkpoints and reports hold the names.
void check_characters(const std::vector<std::string>& names, const fs::path& folder) {
  for (const std::string& name : names) {
    if (is_plain_text(name)) continue;
    throw UserError(folder.string() + ": the name \"" + with_escapes(name) +
                    "\" is not UTF-8 text without control characters; rename the frame, and its masks with it");
  }
}

std::vector<std::string> png_names(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".png") names.push_back(entry.path().filename().string());
  }
  if (error) throw UserError(folder.string() + ": cannot be listed as a folder of frames: " + error.message());
  std::sort(names.begin(), names.end());
  check_characters(names, folder);
  check_numbering(names, folder);
  if (names.size() < 2) {
    throw UserError(folder.string() + ": holds " + std::to_string(names.size()) +
                    " .png files; a clip needs at least 2 frames");
  }
  return names;
}

/// The Gaussians of a file; what its reader rejected or held is told in the log.
Gaussians read_gaussians(const fs::path& file) {
  SplatFile read = read_splats(file.string());
  const std::string remarks = summary_text(read.report);
  if (!remarks.empty()) log_warning(file.string() + ": " + remarks);
  if (read.gaussians.count() == 0) throw DataError(file.string() + ": holds no Gaussians that can be used");
  return std::move(read.gaussians);
}

/// Means relative to their centroid, whatever the file's were.
Gaussians centred(Gaussians gaussians) {
  const Index count = gaussians.count();
  for (Index c = 0; c < 3; ++c) {
    double sum = 0;
    for (Index i = 0; i < count; ++i) sum += static_cast<double>(gaussians.means[static_cast<std::size_t>(3 * i + c)]);
    const double mean = sum / static_cast<double>(count);
    for (Index i = 0; i < count; ++i) {
      float& x = gaussians.means[static_cast<std::size_t>(3 * i + c)];
      x = static_cast<float>(static_cast<double>(x) - mean);
    }
  }
  gaussians.origin_world.setZero();
  return gaussians;
}

ObjectPose initial_pose(const InitialSettings& initial, const std::string& name, const fs::path& file) {
  const InitialPose* pose = find_entry(initial.objects, name);
  if (pose == nullptr) throw DataError(file.string() + ": /objects: there is no pose of the object \"" + name + "\"");
  return {Vector3<double>(pose->rotation.data()), Vector3<double>(pose->translation.data())};
}

/// Estimated poses: those of the motion file when it has more than frame 0.
std::vector<BodyPose> estimate_of(const Motion& motion, const fs::path& file, Index frames) {
  const auto count = static_cast<Index>(motion.poses.size());
  if (count == 0) throw DataError(file.string() + ": holds no frames");
  if (count == 1) return {};
  if (count != frames) {
    throw DataError(file.string() + ": holds " + std::to_string(count) + " poses, the video has " +
                    std::to_string(frames) + " frames; allowed: that many, or frame 0 alone");
  }
  return motion.poses;
}

std::vector<SceneState> read_truth(const fs::path& folder, const std::vector<std::string>& names, const Avatar& avatar,
                                   Index frames) {
  const auto expect = [&](std::size_t count, const char* file) {
    if (static_cast<Index>(count) == frames) return;
    throw DataError((folder / file).string() + ": has " + std::to_string(count) + " frames, the video " +
                    std::to_string(frames));
  };
  std::vector<SceneState> truth(static_cast<std::size_t>(frames));
  const Motion motion = read_motion_for((folder / "motion.npz").string(), avatar);
  expect(motion.poses.size(), "motion.npz");
  const std::vector<Camera> cameras = read_cameras((folder / "cameras.json").string());
  expect(cameras.size(), "cameras.json");
  std::vector<std::vector<ObjectPose>> objects(truth.size());
  if (!names.empty()) {
    objects = read_object_tracks((folder / "objects.npz").string(), names);
    expect(objects.size(), "objects.npz");
  }
  for (std::size_t t = 0; t < truth.size(); ++t) {
    truth[t] = {cameras[t].camera_from_world, objects[t], motion.poses[t]};
  }
  return truth;
}

Image read_mask(const fs::path& file, const Clip& clip) {
  if (!fs::exists(file)) return Image(1, clip.camera.height, clip.camera.width);
  Image mask = read_image(file.string());
  if (mask.height() != clip.camera.height || mask.width() != clip.camera.width) {
    throw DataError(file.string() + ": is " + std::to_string(mask.width()) + "x" + std::to_string(mask.height()) +
                    " pixels, the camera's image " + std::to_string(clip.camera.width) + "x" +
                    std::to_string(clip.camera.height));
  }
  return take_channels(mask, 0, 1);
}

/// A folder of masks that is not there is a wrong name. Single masks may be missing: nothing is seen in that frame.
void check_masks(const fs::path& folder, const std::vector<std::string>& frames) {
  if (!fs::is_directory(folder)) throw DataError(folder.string() + ": there is no such folder of masks");
  const auto missing =
      std::count_if(frames.begin(), frames.end(), [&](const std::string& name) { return !fs::exists(folder / name); });
  if (missing == 0) return;
  log_warning(folder.string() + ": has no mask for " + std::to_string(missing) + " of " +
              std::to_string(frames.size()) + " frames; these count as empty");
}

/// False for a mask that nowhere reaches the threshold.
bool shows_something(const Image& mask, double threshold) {
  for (int y = 0; y < mask.height(); ++y) {
    const float* row = mask.row(0, y);
    if (std::any_of(row, row + mask.width(), [&](float m) { return static_cast<double>(m) >= threshold; })) return true;
  }
  return false;
}

}  // namespace

Clip read_clip(const DataSettings& data) {
  check_inputs(data);
  Clip clip;
  clip.frame_files = png_names(data.frames);
  clip.scene = read_gaussians(data.scene);
  clip.avatar = read_avatar(data.avatar.string());
  if (clip.avatar.parents.size() != static_cast<std::size_t>(kSmplxJoints)) {
    throw DataError(data.avatar.string() + ": has " + std::to_string(clip.avatar.parents.size()) +
                    " joints; a run needs the " + std::to_string(kSmplxJoints) + " of SMPL-X");
  }
  clip.camera = read_camera(data.camera.string());
  const InitialSettings initial = read_initial(data.initial);
  clip.first.camera_from_world = clip.camera.camera_from_world;
  std::vector<std::string> names;
  for (const auto& [name, object] : data.objects) {
    const Gaussians read = read_gaussians(object.gaussians);
    clip.objects.push_back({name, centred(read)});
    clip.first.objects.push_back(initial_pose(initial, name, data.initial));
    names.push_back(name);
    check_masks(data.masks / name, clip.frame_files);
  }
  check_masks(data.masks / kHumanMasks, clip.frame_files);
  const Motion motion = read_motion_for(initial.motion.string(), clip.avatar);
  if (!motion.says_frame_rate && motion.poses.size() > 1)
    log_warning(initial.motion.string() + ": says no frame rate and is taken for " + rounded(motion.frame_rate, 4) +
                " frames a second");
  clip.estimate = estimate_of(motion, initial.motion, clip.frames());
  clip.first.body = motion.poses.front();
  clip.frame_rate = motion.frame_rate;
  if (!data.truth.empty()) clip.truth = read_truth(data.truth, names, clip.avatar, clip.frames());
  clip.files = {{"/data/scene", data.scene},
                {"/data/avatar", data.avatar},
                {"/data/camera", data.camera},
                {"/data/initial", data.initial},
                {"/data/initial: /motion", initial.motion}};
  for (const auto& [name, object] : data.objects)
    clip.files.push_back({"/data/objects/" + name + "/gaussians", object.gaussians});
  return clip;
}

void check_frames(const DataSettings& data, const Clip& clip, bool has_center) {
  std::vector<std::vector<bool>> is_seen(static_cast<std::size_t>(clip.frames()));  // [frame][object]
  parallel_for(clip.frames(), 1, [&](Index begin, Index end) {
    for (Index index = begin; index < end; ++index) {
      for (const Image& mask : read_frame(data, clip, index).object_masks) {
        is_seen[static_cast<std::size_t>(index)].push_back(shows_something(mask, data.mask_threshold));
      }
    }
  });
  for (std::size_t o = 0; o < clip.objects.size(); ++o) {
    std::vector<Index> hidden;
    for (std::size_t t = 1; t < is_seen.size(); ++t) {  // frame 0 is given
      if (!is_seen[t][o]) hidden.push_back(static_cast<Index>(t));
    }
    if (hidden.empty()) continue;
    log_warning((data.masks / clip.objects[o].name).string() + ": the object is hidden in " +
                (hidden.size() == 1 ? "frame " : "frames ") + frame_ranges(hidden) +
                ": no pixel reaches data.mask_threshold" +
                (has_center ? "; the loss \"center\" is off for it there" : ""));
  }
}

std::string frame_ranges(const std::vector<Index>& frames) {
  std::vector<std::string> ranges;
  for (std::size_t begin = 0; begin < frames.size();) {
    std::size_t last = begin;
    while (last + 1 < frames.size() && frames[last + 1] == frames[last] + 1) ++last;
    ranges.push_back(std::to_string(frames[begin]) + (last == begin ? "" : "-" + std::to_string(frames[last])));
    begin = last + 1;
  }
  return joined(ranges);
}

std::vector<ClipFile> frame_files(const DataSettings& data, const Clip& clip, Index index) {
  const std::string& name = clip.frame_files.at(static_cast<std::size_t>(index));
  std::vector<ClipFile> files = {{"frames/" + name, data.frames / name}};
  const auto add_mask = [&](const std::string& folder) {
    files.push_back({"masks/" + folder + "/" + name, data.masks / folder / name});
  };
  add_mask(kHumanMasks);
  for (const ClipObject& object : clip.objects) add_mask(object.name);
  return files;
}

ClipFrame read_frame(const DataSettings& data, const Clip& clip, Index index) {
  const std::string& name = clip.frame_files.at(static_cast<std::size_t>(index));
  const fs::path file = data.frames / name;
  ClipFrame frame;
  frame.target = read_image(file.string());
  if (frame.target.channels() < 3 || frame.target.height() != clip.camera.height ||
      frame.target.width() != clip.camera.width) {
    throw DataError(file.string() + ": is " + std::to_string(frame.target.width()) + "x" +
                    std::to_string(frame.target.height()) + " with " + std::to_string(frame.target.channels()) +
                    " channels; the camera's image is " + std::to_string(clip.camera.width) + "x" +
                    std::to_string(clip.camera.height) + " with 3");
  }
  frame.target = take_channels(frame.target, 0, 3);
  frame.human_mask = read_mask(data.masks / kHumanMasks / name, clip);
  for (const ClipObject& object : clip.objects) {
    frame.object_masks.push_back(read_mask(data.masks / object.name / name, clip));
  }
  return frame;
}

}  // namespace hsi4d
