#include "pipelines/synthetic/dataset.h"

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "body/avatar.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/folder_in_making.h"
#include "core/image_io.h"
#include "core/process.h"
#include "core/rotation.h"
#include "core/text.h"
#include "core/video.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/state.h"
#include "pipelines/synthetic/chain.h"
#include "pipelines/synthetic/faults.h"
#include "pipelines/synthetic/light.h"
#include "pipelines/synthetic/motion.h"
#include "pipelines/synthetic/object.h"
#include "pipelines/synthetic/render.h"
#include "pipelines/synthetic/scene.h"
#include "pipelines/synthetic/variation.h"
#include "splat/files/io_ply.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

ConfigValue numbers(const Vector3<double>& v) {
  return ConfigValue::make_array(
      {ConfigValue::make_number(v[0]), ConfigValue::make_number(v[1]), ConfigValue::make_number(v[2])});
}

ConfigValue object_config_of(std::string_view key, ConfigValue value) {
  ConfigValue object = ConfigValue::make_object();
  object.add(key, std::move(value));
  return object;
}

constexpr const char* kObjectTracks = "initial_objects.npz";
constexpr const char* kSurfaceFile = "truth/surface.ply";

std::string initial_json(const SyntheticObject& object, const std::vector<Rigid<double>>& poses, bool has_tracks) {
  ConfigValue root = ConfigValue::make_object();
  root.add("motion", ConfigValue::make_string("initial_motion.npz"));
  ConfigValue objects = ConfigValue::make_object();
  if (object.exists()) {
    ConfigValue state = ConfigValue::make_object();
    state.add("rotation", numbers(so3_log(poses.front().rotation)));
    state.add("translation", numbers(poses.front().translation));
    objects.add(object.name, std::move(state));
  }
  root.add("objects", std::move(objects));
  if (has_tracks) root.add("object_tracks", ConfigValue::make_string(kObjectTracks));
  return to_json(root);
}

void add_file(ConfigValue& data, std::string_view key, const fs::path& file) {
  data.add(key, ConfigValue::make_string(file.generic_string()));
}

/// The joint of an object that turns about an upright axis, as a config names it.
/// @param first  where it is in frame 0
ConfigValue hinge_of(const SyntheticObject& object, const Rigid<double>& first) {
  ConfigValue joint = object_config_of("type", ConfigValue::make_string("hinge"));
  joint.add("axis", numbers(Vector3<double>::UnitZ()));
  joint.add("origin", numbers(transform_point(first, *object.hinge)));
  return joint;
}

/// Where the files of a person beside the first one are in the dataset.
fs::path folder_of_person(const std::string& name) { return fs::path("people") / name; }

ConfigValue people_data(const ConfigMap<SyntheticPerson>& people) {
  ConfigValue all = ConfigValue::make_object();
  for (const auto& [name, person] : people) {
    ConfigValue data = ConfigValue::make_object();
    add_file(data, "avatar", folder_of_person(name) / "avatar.safetensors");
    add_file(data, "initial", folder_of_person(name) / "initial.json");
    all.add(name, std::move(data));
  }
  return all;
}

/// Files that all clips share.
/// @param first  where the object is in frame 0
ConfigValue shared_data(const SyntheticObject& object, const std::optional<Rigid<double>>& first,
                        const SyntheticSettings& settings, bool has_surface) {
  ConfigValue data = ConfigValue::make_object();
  add_file(data, "scene", "scene.ply");
  if (object.exists()) {
    const ConfigValue file = ConfigValue::make_string("objects/" + object.name + ".ply");
    ConfigValue of_object = object_config_of("gaussians", file);
    if (object.hinge && first) of_object.add("joint", hinge_of(object, *first));
    data.add("objects", object_config_of(object.name, std::move(of_object)));
  }
  add_file(data, "avatar", "avatar.safetensors");
  if (!settings.people.empty()) data.add("people", people_data(settings.people));
  if (has_surface) add_file(data, "surface", kSurfaceFile);
  return data;
}

/// Files of a clip in its folder.
ConfigValue clip_data(const fs::path& folder, SyntheticVideo video) {
  ConfigValue data = ConfigValue::make_object();
  add_file(data, "frames", folder / (video == SyntheticVideo::kPng ? "frames" : kDatasetVideo));
  add_file(data, "masks", folder / "masks");
  add_file(data, "camera", folder / "camera.json");
  add_file(data, "initial", folder / "initial.json");
  add_file(data, "truth", folder / "truth");
  return data;
}

/// Where the files of a clip are in the dataset.
fs::path folder_of(Index clip, Index clips) { return clips == 1 ? fs::path() : fs::path("clips") / clip_name(clip); }

/// The sections that name the dataset's files.
/// @param first  where the object is in frame 0
ConfigValue data_sections(const SyntheticObject& object, const std::optional<Rigid<double>>& first,
                          const SyntheticSettings& settings, bool has_surface) {
  const bool is_chain = settings.clips > 1;  // whose objects move freely
  ConfigValue shared = shared_data(object, is_chain ? std::nullopt : first, settings, has_surface);
  if (settings.clips == 1) return object_config_of("data", merged(std::move(shared), clip_data({}, settings.video)));
  ConfigValue sections = object_config_of("data", std::move(shared)), chain = ConfigValue::make_array();
  for (Index k = 0; k < settings.clips; ++k) {
    ConfigValue clip = object_config_of("name", ConfigValue::make_string(clip_name(k)));
    clip.add("data", clip_data(folder_of(k, settings.clips), settings.video));
    chain.items.push_back(std::move(clip));
  }
  sections.add("chain", std::move(chain));
  return sections;
}

std::optional<Rigid<double>> first_of(const std::vector<Rigid<double>>& poses) {
  return poses.empty() ? std::nullopt : std::optional(poses.front());
}

void write_objects(const std::string& path, const std::string& name, const std::vector<Rigid<double>>& poses) {
  std::vector<SceneState> frames(poses.size());
  for (std::size_t t = 0; t < poses.size(); ++t) {
    frames[t].objects = {{so3_log(poses[t].rotation), poses[t].translation}};
  }
  write_object_tracks(path, {name}, frames);
}

void check_ffmpeg(const SyntheticSettings& settings) {
  if (settings.video == SyntheticVideo::kPng || !find_program("ffmpeg").empty()) return;
  throw UserError(
      "ffmpeg: is not in PATH, and writes the video of a dataset; install it, or keep the frames as PNG files with "
      "synthetic.video=png");
}

/// The settings by which a person beside the first one is made.
SyntheticSettings settings_of(const SyntheticPerson& person, const SyntheticSettings& settings) {
  SyntheticSettings own = settings;
  own.seed += person.seed;
  own.variation = 1;  // in clothes of its own
  return own;
}

Avatar made_avatar(const BodyModel& body, const SyntheticSettings& settings) {
  AvatarSettings avatar_settings;
  avatar_settings.gaussians = settings.avatar_gaussians;
  avatar_settings.seed = static_cast<std::uint64_t>(settings.seed);
  return in_other_clothes(surface_avatar(body, avatar_settings), settings);
}

/// The frames of the video one after the other, with what is done to them that the reconstruction does not know of.
class Film {
 public:
  Film(const SyntheticSettings& settings, const RenderSettings& render, const BodyModel& body,
       const std::vector<Avatar>& tracked, const Gaussians& scene, const SyntheticObject& object)
      : settings_(settings),
        render_(render),
        body_(body),
        scene_(scene),
        object_(object),
        occluders_(object_occluders(object.gaussians)),
        revealed_(settings.faults.revealed, static_cast<std::uint64_t>(settings.seed)) {
    for (std::size_t p = 0; p < tracked.size(); ++p)
      avatars_.push_back(
          filmed_avatar(body, tracked[p], p == 0 ? settings : settings_of(settings.people[p - 1].second, settings)));
  }

  /// Frames are asked for in order.
  SyntheticFrame frame(const SyntheticClip& clip, std::size_t t) {
    const Rigid<double> place = object_.exists() ? clip.object[t] : Rigid<double>();
    const Camera& camera = clip.cameras[t];
    const double part = clip.cameras.size() > 1 ? double(t) / double(clip.cameras.size() - 1) : 0;
    const auto pose_of = [&](std::size_t p) -> const BodyPose& {
      return (p == 0 ? clip.motion : clip.others.at(p - 1)).poses[t];
    };
    std::vector<Avatar> avatars;
    std::vector<Occluder> occluders;
    const auto add_occluders = [&occluders](const std::vector<Occluder>& more) {
      occluders.insert(occluders.end(), more.begin(), more.end());
    };
    for (std::size_t p = 0; p < avatars_.size(); ++p) {
      Avatar avatar = with_faded_hands(avatars_[p], settings_.faults.hands_fade * hands_gone(part));
      if (settings_.faults.appearance > 0) avatar = with_changed_colors(avatar, part * settings_.faults.appearance);
      avatars.push_back(shaded_avatar(avatar, pose_of(p), settings_.light.shading));
      if (settings_.light.shadow > 0) add_occluders(body_occluders(body_, pose_of(p)));
      if (settings_.light.shadow > 0 && p == 0) add_occluders(moved(occluders_, place));
    }
    std::vector<DrawnPerson> others;
    for (std::size_t p = 1; p < avatars.size(); ++p) others.push_back({avatars[p], pose_of(p)});
    const Gaussians scene = shadowed_scene(scene_, occluders, camera_center_world(camera), settings_.light.shadow);
    const Gaussians object = shaded_object(object_, place, settings_.light.shading);
    const SyntheticRenderer renderer(scene, object, avatars.front(), render_);
    SyntheticFrame frame = renderer.frame(pose_of(0), place, camera, settings_.supersample, others);
    revealed_.apply(frame);
    return frame;
  }

 private:
  const SyntheticSettings& settings_;
  const RenderSettings& render_;
  const BodyModel& body_;
  const Gaussians& scene_;
  const SyntheticObject& object_;
  std::vector<Avatar> avatars_;  // by person
  std::vector<Occluder> occluders_;
  RevealedContent revealed_;
};

void stop_if_asked(const Observer& observer) {
  if (observer.wants_stop()) throw Interrupted("interrupted while a dataset was made; nothing is left of it");
}

/// A clip's part of a dataset.
struct ClipFiles {
  const FolderInMaking& out;
  fs::path folder;

  std::string file(const fs::path& name) const { return out.file(folder / name); }
};

/// Where the frames of the video go, as settings.video says.
class FrameFiles {
 public:
  FrameFiles(const SyntheticSettings& settings, const ClipFiles& files) : files_(files) {
    if (settings.video == SyntheticVideo::kPng) return;
    VideoFormat format{.frame_rate = settings.frame_rate, .quality = settings.video_quality};
    if (settings.video == SyntheticVideo::kMp4) format.color = VideoColor::kEachPixel;
    video_.emplace(files.file(kDatasetVideo), settings.size_px, settings.size_px, format);
  }

  /// @param name  "0003.png"
  void add(const std::string& name, const Image& frame) {
    if (video_) return video_->add(frame);
    write_image(files_.file(fs::path("frames") / name), frame);
  }

  void commit() {
    if (video_) video_->commit();
  }

 private:
  const ClipFiles& files_;
  std::optional<VideoWriter> video_;
};

/// Camera, initial state and truth.
void write_states(const ClipFiles& files, const SyntheticClip& clip, const SyntheticObject& object,
                  const SyntheticSettings& settings) {
  write_camera(files.file("camera.json"), clip.cameras.front());
  write_motion(files.file("initial_motion.npz"), disturbed_motion(clip.motion, settings));
  const bool has_tracks = object.exists() && (settings.object_noise_deg > 0 || settings.object_noise_m > 0);
  write_text_file(files.file("initial.json"), initial_json(object, clip.object, has_tracks));
  write_motion(files.file("truth/motion.npz"), clip.motion);
  write_cameras(files.file("truth/cameras.json"), clip.cameras);
  for (std::size_t p = 0; p < clip.others.size(); ++p) {
    const auto& [name, person] = settings.people[p];
    const fs::path folder = folder_of_person(name);
    const Motion& motion = clip.others[p];
    write_motion(files.file(folder / "initial_motion.npz"), disturbed_motion(motion, settings_of(person, settings)));
    write_text_file(files.file(folder / "initial.json"), initial_json({}, {}, false));
    write_motion(files.file(fs::path("truth") / motion_file_of(name)), motion);
  }
  if (!object.exists()) return;
  write_objects(files.file("truth/objects.npz"), object.name, clip.object);
  if (has_tracks) write_objects(files.file(kObjectTracks), object.name, disturbed_object(clip.object, settings));
}

/// Frames and masks. @param after_frame  called after each
void write_frames(const ClipFiles& files, const SyntheticClip& clip, const SyntheticObject& object,
                  const SyntheticSettings& settings, Film& film, const std::function<void()>& after_frame) {
  const auto seed = static_cast<std::uint64_t>(settings.seed);
  FrameFiles frames(settings, files);
  for (std::size_t t = 0; t < clip.cameras.size(); ++t) {
    const std::string name = four_digits(static_cast<std::int64_t>(t)) + ".png";
    const SyntheticFrame frame = film.frame(clip, t);
    const auto write_mask = [&](const std::string& of, const Image& mask) {
      write_image(files.file(fs::path("masks") / of / name),
                  disturbed_mask(mask, settings.masks, seed, of, static_cast<Index>(t)));
    };
    if (t == 0) write_image(files.file("first_frame.png"), frame.color);
    frames.add(name, frame.color);
    write_mask(kHumanMasks, frame.human_mask);
    if (object.exists()) write_mask(object.name, frame.object_mask);
    for (std::size_t p = 0; p < frame.other_masks.size(); ++p)
      write_mask(settings.people[p].first, frame.other_masks[p]);
    after_frame();
  }
  frames.commit();
}

}  // namespace

RenderSettings video_render_settings() {
  RenderSettings settings;
  apply_quality(settings, Quality::kAccurate);
  return settings;
}

void write_dataset(const SyntheticSettings& settings, const RenderSettings& render, const fs::path& folder,
                   const Observer& observer, const ConfigValue& more_sections, const BodySettings& body_settings) {
  check_ffmpeg(settings);
  FolderInMaking out(folder);
  const BodyModel body = rest_body(body_settings);
  std::vector<Avatar> avatars = {made_avatar(body, settings)};
  const SyntheticObject object = synthetic_object(settings);
  const ClipSettings whole_settings = clip_settings(settings);
  SyntheticClip whole = synthetic_clip(body, object, whole_settings);
  for (const auto& [name, person] : settings.people) {
    avatars.push_back(made_avatar(body, settings_of(person, settings)));
    whole.others.push_back(motion_beside(body, person, whole, whole_settings));
  }
  const Gaussians scene = synthetic_scene(settings, whole.plan);
  stop_if_asked(observer);
  write_ply(out.file("scene.ply"), scene);
  write_avatar(out.file("avatar.safetensors"), avatars.front());
  for (std::size_t p = 1; p < avatars.size(); ++p)
    write_avatar(out.file(folder_of_person(settings.people[p - 1].first) / "avatar.safetensors"), avatars[p]);
  if (object.exists()) write_ply(out.file(fs::path("objects") / (object.name + ".ply")), object.gaussians);
  write_text_file(out.file(kSyntheticFile), synthetic_settings_json(settings, body_settings));
  const TriangleMesh solids = synthetic_solids(settings, whole.plan);
  if (!solids.faces.empty()) write_mesh(out.file(kSurfaceFile), solids);
  const ConfigValue data = data_sections(object, first_of(whole.object), settings, !solids.faces.empty());
  write_text_file(out.file("config.json"), to_json(merged(data, more_sections)));

  const std::vector<SyntheticClip> clips =
      cut_into_clips(whole, whole_settings, settings.clips, {scene, object, avatars.front()});
  Progress shown("frames", settings.frames * settings.clips, observer.progress, observer.progress_interval);
  for (Index k = 0; k < settings.clips; ++k) {
    const auto& clip = clips[static_cast<std::size_t>(k)];
    SyntheticSettings noise = settings;  // another in each clip
    noise.seed += k;
    const ClipFiles files{out, folder_of(k, settings.clips)};
    write_states(files, clip, object, noise);
    Film film(settings, render, body, avatars, scene, object);
    write_frames(files, clip, object, noise, film, [&] {
      shown.step();
      stop_if_asked(observer);
    });
  }
  shown.finish();
  out.commit();
}

}  // namespace hsi4d
