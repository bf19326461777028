#include "pipelines/input/clip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "body/motion_edit.h"
#include "core/check.h"
#include "core/log.h"
#include "core/mask_image.h"
#include "core/parallel.h"
#include "core/size_text.h"
#include "core/text.h"
#include "optim/solid/mesh_distance.h"
#include "optim/standing_feet.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/contacts.h"
#include "pipelines/input/frame_cameras.h"
#include "pipelines/input/pose_estimate.h"
#include "pipelines/input/straight_keypoints.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

/// The poses of data.motion, laid on frame 0, or else those of the initial state; empty: none.
std::vector<BodyPose> estimate_of(const DataSettings& data, const SetupPerson& setup, const FrameSource& frames) {
  if (data.motion.empty()) return estimated_poses(setup.motion, setup.motion_file, frames);
  const BodyPose& first = setup.motion.poses.front();
  const Avatar& avatar = setup.avatar;
  return laid_on(read_estimate(data.motion, avatar, frames, first, data.motion_align), first, pelvis_of(avatar.joints),
                 data.motion_align);
}

/// A person whose files `data` names.
void take_person(const DataSettings& data, SetupPerson& setup, const FrameSource& frames, ClipPerson& person) {
  person.estimate = estimate_of(data, setup, frames);
  if (!data.keypoints.empty()) person.keypoints = read_keypoints(data, frames);
  person.betas = setup.motion.betas;
  person.gender = setup.motion.gender;
  person.avatar = std::move(setup.avatar);
  std::vector<std::vector<double>> joints;
  for (const BodyPose& pose : person.estimate) joints.push_back(pose_joints(person.avatar, pose));
  if (!joints.empty()) person.foot_range = lower_foot_range(joints);
}

/// As estimate_of, of the objects.
std::vector<std::vector<ObjectPose>> object_estimate_of(const fs::path& file, const Clip& clip) {
  if (file.empty() || clip.objects.empty()) return {};
  std::vector<std::string> names;
  for (const ClipObject& object : clip.objects) names.push_back(object.name);
  return kept_frames(read_object_tracks(file.string(), names), clip.video->frames, file.string(), "frames");
}

/// The rate of the clip: that of its video, if it is known, or else of the motion.
double rate_of(const FrameSource& frames, const SceneSetup& setup) {
  if (frames.frame_rate() > 0) return frames.frame_rate();
  if (!setup.motion.says_frame_rate && setup.motion.poses.size() > 1)
    log_warning(setup.motion_file.string() + ": says no frame rate and is taken for " +
                rounded(setup.motion.frame_rate, 4) + " frames a second");
  return setup.motion.frame_rate;
}

/// The poses of a person.
std::vector<BodyPose> read_true_bodies(const std::string& file, const Avatar& avatar, const FrameSource& frames) {
  const Motion motion = read_motion_for(file, avatar);
  check_begins_with_frame_0(motion, file, "a truth is of all frames from 0 on");
  return kept_frames(motion.poses, frames, file, "poses");
}

std::vector<SceneState> read_truth(const fs::path& folder, const std::vector<std::string>& names, const Clip& clip,
                                   const FrameSource& frames) {
  const auto file = [&folder](const std::string& name) { return (folder / name).string(); };
  const std::vector<BodyPose> bodies = read_true_bodies(file("motion.npz"), clip.avatar, frames);
  const std::vector<Camera> cameras = cameras_of_frames(file("cameras.json"), frames);
  std::vector<std::vector<ObjectPose>> objects(bodies.size());
  if (!names.empty())
    objects = kept_frames(read_object_tracks(file("objects.npz"), names), frames, file("objects.npz"), "frames");
  std::vector<SceneState> truth(bodies.size());
  for (std::size_t t = 0; t < truth.size(); ++t) truth[t] = {cameras[t].camera_from_world, objects[t], bodies[t]};
  for (const ClipPerson& person : clip.others) {
    const std::vector<BodyPose> poses = read_true_bodies(file(motion_file_of(person.name)), person.avatar, frames);
    for (std::size_t t = 0; t < truth.size(); ++t) truth[t].others.push_back(poses[t]);
  }
  return truth;
}

/// Whether there is something to compare with. A dataset may have been handed on without it.
/// @param key, use  the setting, and what is not done without it
bool is_there(const fs::path& path, const char* key, const char* use) {
  if (path.empty() || fs::exists(path)) return !path.empty();
  log_warning(path.string() + ": there is no such file or folder (data." + key + "); " + use);
  return false;
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

/// Files of floats may hold anything.
void check_finite(const Image& image, const std::string& place) {
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      const float* row = image.row(c, y);
      const float* bad = std::find_if(row, row + image.width(), [](float value) { return !std::isfinite(value); });
      if (bad == row + image.width()) continue;
      throw DataError(place + ": the number at row " + std::to_string(y) + ", column " + std::to_string(bad - row) +
                      ", channel " + std::to_string(c) + " is " + (std::isnan(*bad) ? "NaN" : "infinite") +
                      "; frames and masks hold finite numbers");
    }
  }
}

/// Sees each mask of a frame as it is read, before it is reduced, in the order of ClipVideo.
using MaskLook = std::function<void(std::size_t mask, const Image& image)>;

/// A mask that is as large as the frame of the video, in the camera's size; empty where there is none.
Image read_mask(std::size_t m, const ClipVideo& video, const Camera& camera, Index index, const Image& frame,
                const MaskLook& look) {
  const MaskSource& source = video.masks[m];
  const Image mask = source.read(video.frames, index);
  if (mask.width() == 0) return Image(1, camera.height, camera.width);
  check_finite(mask, source.place(video.frames, index));
  if (look) look(m, mask);
  if (mask.height() == frame.height() && mask.width() == frame.width()) return reduced(mask, camera);
  throw DataError(source.place(video.frames, index) + ": is " + size_text(mask) + " pixels, " +
                  (has_size_of(frame, camera) ? "the camera's image " : "the video's frame ") + size_text(frame));
}

/// What a pinhole would have seen.
void straighten(const ClipVideo& video, ClipFrame& frame) {
  const Camera through = resized(video.camera, frame.target.width(), frame.target.height());
  StraightImage straight = straightened(frame.target, through, video.lens);
  frame.target = std::move(straight.image);
  frame.seen = std::move(straight.seen);
  frame.human_mask = straightened(frame.human_mask, through, video.lens).image;
  for (auto* masks : {&frame.object_masks, &frame.other_masks}) {
    for (Image& mask : *masks) mask = straightened(mask, through, video.lens).image;
  }
}

/// As read_frame.
ClipFrame read_looking(const ClipVideo& video, const Camera& camera, Index index, const MaskLook& look) {
  const FrameSource& frames = video.frames;
  const Image read = frames.read(index);
  if (read.channels() < 3 || !fits_camera(read, camera)) {
    throw DataError(frames.place(index) + ": is " + size_text(read) + " with " + std::to_string(read.channels()) +
                    " channels; the camera's image is " + size_text(camera) + " with 3");
  }
  ClipFrame frame;
  const Image colors = take_channels(read, 0, 3);
  check_finite(colors, frames.place(index));
  frame.target = reduced(colors, camera);
  frame.human_mask = read_mask(0, video, camera, index, read, look);
  for (std::size_t m = 1; m < video.masks.size(); ++m) {
    std::vector<Image>& masks = m + video.others < video.masks.size() ? frame.object_masks : frame.other_masks;
    masks.push_back(read_mask(m, video, camera, index, read, look));
  }
  if (!video.lens.is_straight()) straighten(video, frame);
  return frame;
}

/// Tells of masks whose greys look like labels.
/// @param greys  by frame; empty where they do not
void warn_of_labels(const MaskSource& masks, const std::vector<std::vector<int>>& greys) {
  std::vector<Index> alike;
  for (std::size_t t = 0; t < greys.size(); ++t) {
    if (!greys[t].empty()) alike.push_back(static_cast<Index>(t));
  }
  if (alike.empty()) return;
  std::vector<std::string> numbers;
  for (const int grey : greys[static_cast<std::size_t>(alike.front())]) numbers.push_back(std::to_string(grey));
  log_warning(masks.path().string() + ": holds few greys as labels would, " + joined(numbers) + " of 255 in frame " +
              std::to_string(alike.front()) + (alike.size() == 1 ? "" : " (alike: " + frame_ranges(alike) + ")") +
              "; they count as shares of the pixel, and labels are read from images with a palette");
}

/// Names of another kind, or another numbering: as many masks as frames and not theirs, or not one that is a frame's.
/// @param missing  of the frames that the clip keeps
bool are_misnamed(const MaskSource::Count& count, Index missing, const FrameSource& frames) {
  const bool is_none = missing == frames.count() && (count.unused > 0 || !count.others.empty());
  const bool is_as_many = count.all == frames.video_count() || count.all == frames.count();
  return is_none || (missing > 0 && count.unused > 0 && is_as_many);
}

/// A folder of masks that is not there is a wrong name. Single masks may be missing: nothing is seen in that frame.
/// Throws DataError for masks with names that are not those of frames.
MaskSource open_masks(const fs::path& folder, const std::string& name, const FrameSource& frames) {
  const MaskSource masks(folder, name);
  const Index missing = masks.missing(frames);
  const MaskSource::Count count = masks.count(frames);
  if (are_misnamed(count, missing, frames))
    throw DataError(masks.path().string() + ": has no mask for " + std::to_string(missing) + " of " +
                    std::to_string(frames.count()) + " frames, and " + std::to_string(count.unused) + " of its " +
                    std::to_string(count.all) +
                    " masks belong to no frame; allowed: a mask has the name of its frame, the first \"" +
                    masks.file(frames, 0).filename().string() + "\"" +
                    (count.others.empty() ? "" : "; what is no .png is not read: " + few_names(count.others)));
  if (missing > 0)
    log_warning(masks.path().string() + ": has no mask for " + std::to_string(missing) + " of " +
                std::to_string(frames.count()) + " frames; these count as empty");
  const std::string other_times = masks.other_times(frames);
  if (!other_times.empty()) log_warning(other_times);
  if (count.unused > 0)
    log_warning(masks.path().string() + ": holds " + std::to_string(count.all) + " masks, the video has " +
                std::to_string(frames.video_count()) + " frames; " + std::to_string(count.unused) +
                " of the masks belong to no frame and are not used");
  if (!count.others.empty())
    log_warning(masks.path().string() + ": what is no .png is not read: " + few_names(count.others));
  return masks;
}

float largest_value(const Image& mask) {
  float largest = 0;
  for (int y = 0; y < mask.height(); ++y) {
    const float* row = mask.row(0, y);
    largest = std::max(largest, *std::max_element(row, row + mask.width()));
  }
  return largest;
}

/// What is told of masks that reach no threshold but hold something as small as numbers of labels; else empty.
std::string label_text(float largest) {
  constexpr float kMostLabels = 16.0F / 255;
  if (largest <= 0 || largest > kMostLabels) return "";
  return " (the largest value is " + rounded(255 * static_cast<double>(largest), 3) +
         " of 255: labels are read from images with a palette, grey is the share of the pixel)";
}

/// What hidden masks do to the losses, as the end of a message.
std::string off_text(const std::vector<std::string>& losses) {
  std::vector<std::string> quoted;
  for (const std::string& name : losses) quoted.push_back("\"" + name + "\"");
  if (quoted.empty()) return "";
  return (quoted.size() == 1 ? "; the loss " : "; the losses ") + joined(quoted) +
         (quoted.size() == 1 ? " is" : " are") + " off for it there";
}

void check_lens(const Lens& lens, const Camera& camera) {
  if (!covers_picture(lens, camera))
    throw UserError("/data/lens: such a lens turns back before an edge of the picture (" + size_text(camera) +
                    ", focal length " + number_text(camera.fx) +
                    " px); allowed: those that show the middles of all edges");
}

}  // namespace

ClipVideo open_video(const DataSettings& data, const std::vector<std::string>& objects) {
  ClipVideo video{{data.frames, {data.video_rate, data.frame_rate}}, {}};
  video.masks.push_back(open_masks(data.masks, kHumanMasks, video.frames));
  for (const std::string& name : objects) video.masks.push_back(open_masks(data.masks, name, video.frames));
  for (const auto& [name, person] : data.people) video.masks.push_back(open_masks(data.masks, name, video.frames));
  video.others = data.people.size();
  return video;
}

Clip read_clip(const DataSettings& data) {
  check_inputs(data);
  return make_clip(data, read_scene_setup(data));
}

Clip make_clip(const DataSettings& data, SceneSetup setup) {
  Clip clip;
  std::vector<std::string> names;
  for (const ClipObject& object : setup.objects) names.push_back(object.name);
  const auto video = std::make_shared<const ClipVideo>(open_video(data, names));
  clip.frame_files = video->frames.names();
  clip.camera = first_camera(data.camera, video->frames);
  clip.scene = std::move(setup.scene);
  clip.objects = std::move(setup.objects);
  clip.antialiased = std::move(setup.antialiased);
  clip.first.camera_from_world = clip.camera.camera_from_world;
  clip.first.objects = setup.poses;
  clip.video = video;
  take_person(data, setup, video->frames, clip);
  clip.object_estimate = object_estimate_of(setup.object_tracks, clip);
  for (std::size_t p = 0; p < data.people.size(); ++p) {
    const auto& [name, person] = data.people[p];
    clip.others.emplace_back().name = name;
    take_person(data_of_person(data, person), setup.others.at(p), video->frames, clip.others.back());
    clip.first.others.push_back(setup.others[p].motion.poses.front());
  }
  if (!data.tracks.empty()) clip.tracks = read_point_tracks(data, video->frames);
  if (!data.depth_maps.empty()) clip.depth_maps = find_depth_maps(data, video->frames);
  if (!data.contacts.empty()) clip.contacts = read_contacts(data.contacts.string(), {names, clip.frames()});
  check_lens(data.lens.lens, clip.camera);
  if (!data.lens.estimate_k1) set_lens(data.lens.lens, clip);
  clip.first.body = setup.motion.poses.front();
  clip.frame_rate = rate_of(video->frames, setup);
  if (is_there(data.surface, "surface", "penetration is not measured")) {
    clip.surface = read_mesh_distance(data.surface.string(), kMeasuredThickness);
    clip.surface_file = data.surface.filename().string();
  }
  if (is_there(data.truth, "truth", "the result is not compared with the truth"))
    clip.truth = read_truth(data.truth, names, clip, video->frames);
  clip.files = {{"/data/scene", data.scene},
                {"/data/avatar", data.avatar},
                {"/data/camera", data.camera},
                {"/data/initial", data.initial},
                {"/data/initial: /motion", setup.motion_file}};
  if (!data.motion.empty()) clip.files.push_back({"/data/motion", data.motion});
  if (!data.tracks.empty()) clip.files.push_back({"/data/tracks", data.tracks});
  if (!data.contacts.empty()) clip.files.push_back({"/data/contacts", data.contacts});
  if (!data.keypoint_joints.empty()) clip.files.push_back({"/data/keypoint_joints", data.keypoint_joints});
  for (const fs::path& file : keypoint_files(data.keypoints))
    clip.files.push_back({"/data/keypoints: " + file.filename().string(), file});
  if (!setup.object_tracks.empty()) clip.files.push_back({"/data/initial: /object_tracks", setup.object_tracks});
  for (const auto& [name, object] : data.objects)
    clip.files.push_back({"/data/objects/" + name + "/gaussians", object.gaussians});
  for (std::size_t p = 0; p < data.people.size(); ++p) {
    const auto& [name, person] = data.people[p];
    const std::string in = "/data/people/" + name;
    clip.files.insert(clip.files.end(), {{in + "/avatar", person.avatar},
                                         {in + "/initial", person.initial},
                                         {in + "/initial: /motion", setup.others[p].motion_file}});
    if (!person.motion.empty()) clip.files.push_back({in + "/motion", person.motion});
    for (const fs::path& file : keypoint_files(person.keypoints))
      clip.files.push_back({in + "/keypoints: " + file.filename().string(), file});
  }
  if (!video->frames.file().empty()) clip.files.push_back({"/data/frames", video->frames.file()});
  for (const MaskSource& masks : video->masks) {
    if (masks.is_video()) clip.files.push_back({"masks/" + masks.path().filename().string(), masks.path()});
  }
  return clip;
}

void set_lens(const Lens& lens, Clip& clip) {
  if (lens.is_straight()) return;
  ClipVideo video = *clip.video;
  HSI4D_CHECK(video.lens.is_straight(), "a clip is filmed through one lens");
  video.lens = lens;
  video.camera = clip.camera;
  clip.video = std::make_shared<const ClipVideo>(std::move(video));
  for (std::size_t p = 0; p < clip.people(); ++p) {
    if (clip.person(p).keypoints) straighten(lens, clip.camera, *clip.person(p).keypoints);
  }
}

bool fits_camera(const Image& frame, const Camera& camera) {
  return has_size_of(frame, camera) || is_enlarged(frame, camera);
}

void check_frames(const DataSettings& data, const Clip& clip, const LossesOverMasks& losses) {
  if (clip.depth_maps) check_depth_maps(*clip.depth_maps, clip.camera);
  std::vector<std::vector<float>> largest(static_cast<std::size_t>(clip.frames()));  // [frame][mask]
  std::vector<std::vector<std::vector<int>>> greys(clip.video->masks.size(),
                                                   std::vector<std::vector<int>>(largest.size()));  // [mask][frame]
  const auto look = [&](Index begin, Index end) {
    for (Index index = begin; index < end; ++index) {
      const auto t = static_cast<std::size_t>(index);
      std::vector<float>& of_frame = largest[t];
      const ClipFrame frame = read_looking(*clip.video, clip.camera, index,
                                           [&](std::size_t m, const Image& mask) { greys[m][t] = label_greys(mask); });
      of_frame.push_back(largest_value(frame.human_mask));
      for (const auto* masks : {&frame.object_masks, &frame.other_masks}) {
        for (const Image& mask : *masks) of_frame.push_back(largest_value(mask));
      }
    }
  };
  const bool has_videos =
      !clip.video->frames.file().empty() ||
      std::any_of(clip.video->masks.begin(), clip.video->masks.end(), [](const MaskSource& m) { return m.is_video(); });
  if (!has_videos) {
    parallel_for(clip.frames(), 1, look);
  } else {
    look(0, clip.frames());  // videos are decoded in order
  }
  for (std::size_t m = 0; m < greys.size(); ++m) warn_of_labels(clip.video->masks[m], greys[m]);
  const auto warn_if_hidden = [&](std::size_t mask, const std::string& name, const std::string& what,
                                  const std::vector<std::string>& off) {
    std::vector<Index> hidden;
    float most = 0;
    for (std::size_t t = 1; t < largest.size(); ++t) {  // frame 0 is given
      if (static_cast<double>(largest[t][mask]) >= data.mask_threshold) continue;
      hidden.push_back(static_cast<Index>(t));
      most = std::max(most, largest[t][mask]);
    }
    if (hidden.empty()) return;
    log_warning((data.masks / name).string() + ": " + what + " is hidden in " +
                (hidden.size() == 1 ? "frame " : "frames ") + frame_ranges(hidden) +
                ": no pixel reaches data.mask_threshold" + label_text(most) + off_text(off));
  };
  warn_if_hidden(0, kHumanMasks, "the human", losses.human);
  for (std::size_t o = 0; o < clip.objects.size(); ++o)
    warn_if_hidden(1 + o, clip.objects[o].name, "the object", losses.objects);
  for (std::size_t p = 0; p < clip.others.size(); ++p)
    warn_if_hidden(1 + clip.objects.size() + p, clip.others[p].name, "the person", losses.human);
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
  if (!clip.depth_maps) return files;
  for (const auto& [kind, paths] : {std::pair{"depth_maps/", &clip.depth_maps->files},
                                    std::pair{"depth_confidence/", &clip.depth_maps->confidences}}) {
    if (paths->empty()) continue;
    const fs::path& file = (*paths)[static_cast<std::size_t>(index)];
    if (!file.empty()) files.push_back({kind + file.filename().string(), file});
  }
  return files;
}

ClipFrame read_frame(const Clip& clip, Index index) {
  ClipFrame frame = read_frame(*clip.video, clip.camera, index);
  if (clip.depth_maps) frame.depth_map = read_depth_map(*clip.depth_maps, clip.camera, index);
  return frame;
}

ClipFrame read_frame(const ClipVideo& video, const Camera& size, Index index) {
  return read_looking(video, size, index, {});
}

}  // namespace hsi4d
