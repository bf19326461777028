#include "pipelines/clip.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "body/motion_edit.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/text.h"
#include "pipelines/body_files.h"
#include "pipelines/run_problems.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

/// The motion at the clip's rate, where that is told.
Motion motion_of_clip(Motion motion, double frame_rate) {
  if (frame_rate == 0 || motion.poses.size() < 2 || motion.frame_rate == frame_rate) return motion;
  return resampled(motion, frame_rate);
}

/// Estimated poses: those of the motion file when it has more than frame 0.
std::vector<BodyPose> estimate_of(const Motion& motion, const fs::path& file, Index frames) {
  const auto count = static_cast<Index>(motion.poses.size());
  if (count == 1) return {};
  if (count != frames) {
    throw DataError(file.string() + ": holds " + std::to_string(count) + " poses, the video has " +
                    std::to_string(frames) + " frames; allowed: that many, or frame 0 alone");
  }
  return motion.poses;
}

/// As estimate_of, of the objects.
std::vector<std::vector<ObjectPose>> object_estimate_of(const fs::path& file, const Clip& clip) {
  if (file.empty() || clip.objects.empty()) return {};
  std::vector<std::string> names;
  for (const ClipObject& object : clip.objects) names.push_back(object.name);
  std::vector<std::vector<ObjectPose>> tracks = read_object_tracks(file.string(), names);
  if (std::ssize(tracks) == clip.frames()) return tracks;
  throw DataError(file.string() + ": holds " + std::to_string(tracks.size()) + " frames, the video has " +
                  std::to_string(clip.frames()));
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

std::string size_text(const Image& image) {
  return std::to_string(image.width()) + "x" + std::to_string(image.height());
}

std::string size_text(const Camera& camera) {
  return std::to_string(camera.width) + "x" + std::to_string(camera.height);
}

bool has_size_of(const Image& image, const Camera& camera) {
  return image.height() == camera.height && image.width() == camera.width;
}

/// Whether an image becomes one of the camera by taking means of its pixels: larger, and of the same shape but for
/// the rounding of sizes.
bool is_enlarged(const Image& image, const Camera& camera) {
  if (image.width() < camera.width || image.height() < camera.height) return false;
  const double across = static_cast<double>(image.width()) / camera.width,
               down = static_cast<double>(image.height()) / camera.height;
  return std::fabs(across / down - 1) < 1.0 / std::min(camera.width, camera.height);
}

/// The image of the camera's size.
Image reduced(const Image& image, const Camera& camera) {
  return has_size_of(image, camera) ? image : resize_area(image, camera.height, camera.width);
}

/// A mask that is as large as the frame of the video, in the camera's size; empty where there is none.
Image read_mask(const MaskSource& source, const Clip& clip, Index index, const Image& frame) {
  const Image mask = source.read(clip.video->frames, index);
  if (mask.width() == 0) return Image(1, clip.camera.height, clip.camera.width);
  if (mask.height() == frame.height() && mask.width() == frame.width()) return reduced(mask, clip.camera);
  throw DataError(source.place(clip.video->frames, index) + ": is " + size_text(mask) + " pixels, " +
                  (has_size_of(frame, clip.camera) ? "the camera's image " : "the video's frame ") + size_text(frame));
}

/// A folder of masks that is not there is a wrong name. Single masks may be missing: nothing is seen in that frame.
MaskSource open_masks(const fs::path& folder, const std::string& name, const FrameSource& frames) {
  const MaskSource masks(folder, name);
  const Index missing = masks.missing(frames);
  if (missing > 0)
    log_warning(masks.path().string() + ": has no mask for " + std::to_string(missing) + " of " +
                std::to_string(frames.count()) + " frames; these count as empty");
  return masks;
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
  auto video = std::make_shared<ClipVideo>(ClipVideo{{data.frames, {data.video_rate, data.frame_rate}}, {}});
  clip.frame_files = video->frames.names();
  clip.camera = read_camera(data.camera.string());
  SceneSetup setup = read_scene_setup(data);
  clip.scene = std::move(setup.scene);
  clip.avatar = std::move(setup.avatar);
  clip.objects = std::move(setup.objects);
  clip.first.camera_from_world = clip.camera.camera_from_world;
  clip.first.objects = setup.poses;
  std::vector<std::string> names;
  for (const ClipObject& object : clip.objects) names.push_back(object.name);
  video->masks.push_back(open_masks(data.masks, kHumanMasks, video->frames));
  for (const std::string& name : names) video->masks.push_back(open_masks(data.masks, name, video->frames));
  clip.video = video;
  const Motion motion = motion_of_clip(std::move(setup.motion), data.frame_rate);
  if (!motion.says_frame_rate && motion.poses.size() > 1 && data.frame_rate == 0)
    log_warning(setup.motion_file.string() + ": says no frame rate and is taken for " + rounded(motion.frame_rate, 4) +
                " frames a second");
  clip.estimate = estimate_of(motion, setup.motion_file, clip.frames());
  clip.object_estimate = object_estimate_of(setup.object_tracks, clip);
  clip.first.body = motion.poses.front();
  clip.frame_rate = motion.frame_rate;
  if (!data.truth.empty()) clip.truth = read_truth(data.truth, names, clip.avatar, clip.frames());
  clip.files = {{"/data/scene", data.scene},
                {"/data/avatar", data.avatar},
                {"/data/camera", data.camera},
                {"/data/initial", data.initial},
                {"/data/initial: /motion", setup.motion_file}};
  if (!setup.object_tracks.empty()) clip.files.push_back({"/data/initial: /object_tracks", setup.object_tracks});
  for (const auto& [name, object] : data.objects)
    clip.files.push_back({"/data/objects/" + name + "/gaussians", object.gaussians});
  if (!video->frames.file().empty()) clip.files.push_back({"/data/frames", video->frames.file()});
  for (const MaskSource& masks : video->masks) {
    if (masks.is_video()) clip.files.push_back({"masks/" + masks.path().filename().string(), masks.path()});
  }
  return clip;
}

void check_frames(const DataSettings& data, const Clip& clip, bool has_center) {
  std::vector<std::vector<bool>> is_seen(static_cast<std::size_t>(clip.frames()));  // [frame][object]
  const auto look = [&](Index begin, Index end) {
    for (Index index = begin; index < end; ++index) {
      for (const Image& mask : read_frame(clip, index).object_masks) {
        is_seen[static_cast<std::size_t>(index)].push_back(shows_something(mask, data.mask_threshold));
      }
    }
  };
  if (clip.video->frames.file().empty()) {
    parallel_for(clip.frames(), 1, look);
  } else {
    look(0, clip.frames());  // videos are decoded in order
  }
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
  const FrameSource& frames = clip.video->frames;
  std::vector<ClipFile> files;
  if (frames.file().empty()) files.push_back({"frames/" + name, data.frames / name});
  for (const MaskSource& masks : clip.video->masks) {
    if (!masks.is_video())
      files.push_back({"masks/" + masks.path().filename().string() + "/" + name, masks.file(frames, index)});
  }
  return files;
}

ClipFrame read_frame(const Clip& clip, Index index) {
  const FrameSource& frames = clip.video->frames;
  const Image read = frames.read(index);
  if (read.channels() < 3 || !(has_size_of(read, clip.camera) || is_enlarged(read, clip.camera))) {
    throw DataError(frames.place(index) + ": is " + size_text(read) + " with " + std::to_string(read.channels()) +
                    " channels; the camera's image is " + size_text(clip.camera) + " with 3");
  }
  ClipFrame frame;
  frame.target = take_channels(reduced(read, clip.camera), 0, 3);
  frame.human_mask = read_mask(clip.video->masks.front(), clip, index, read);
  for (std::size_t m = 1; m < clip.video->masks.size(); ++m)
    frame.object_masks.push_back(read_mask(clip.video->masks[m], clip, index, read));
  return frame;
}

}  // namespace hsi4d
