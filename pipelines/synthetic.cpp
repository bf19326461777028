#include "pipelines/synthetic.h"

#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "body/avatar.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/folder_in_making.h"
#include "core/image_io.h"
#include "core/random.h"
#include "core/rotation.h"
#include "core/text.h"
#include "pipelines/state.h"
#include "pipelines/synthetic_motion.h"
#include "pipelines/synthetic_object.h"
#include "pipelines/synthetic_render.h"
#include "pipelines/synthetic_scene.h"
#include "splat/io_ply.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

constexpr double kDegree = std::numbers::pi / 180;

ConfigValue numbers(const Vector3<double>& v) {
  return ConfigValue::make_array(
      {ConfigValue::make_number(v[0]), ConfigValue::make_number(v[1]), ConfigValue::make_number(v[2])});
}

ConfigValue object_of(std::string_view key, ConfigValue value) {
  ConfigValue object = ConfigValue::make_object();
  object.add(key, std::move(value));
  return object;
}

std::string initial_json(const SyntheticObject& object, const std::vector<Rigid<double>>& poses) {
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
  return to_json(root);
}

ConfigValue data_section(const SyntheticObject& object) {
  ConfigValue data = ConfigValue::make_object();
  const auto add = [&data](std::string_view key, std::string_view file) {
    data.add(key, ConfigValue::make_string(file));
  };
  add("scene", "scene.ply");
  if (object.exists()) {
    const ConfigValue file = ConfigValue::make_string("objects/" + object.name + ".ply");
    data.add("objects", object_of(object.name, object_of("gaussians", file)));
  }
  add("avatar", "avatar.safetensors");
  add("frames", "frames");
  add("masks", "masks");
  add("camera", "camera.json");
  add("initial", "initial.json");
  add("truth", "truth");
  return data;
}

void write_objects(const std::string& path, const std::string& name, const std::vector<Rigid<double>>& poses) {
  std::vector<SceneState> frames(poses.size());
  for (std::size_t t = 0; t < poses.size(); ++t) {
    frames[t].objects = {{so3_log(poses[t].rotation), poses[t].translation}};
  }
  write_object_tracks(path, {name}, frames);
}

/// Three independent standard normals.
Vector3<double> normal_vector(const Random& random, std::uint64_t index) {
  const auto [x, y] = random.normal_pair(2 * index);
  return {x, y, random.normal(2 * index + 1)};
}

}  // namespace

Motion disturbed_motion(const Motion& truth, const SyntheticSettings& settings) {
  const Random random(static_cast<std::uint64_t>(settings.seed), random_stream("synthetic.initial_motion"));
  Motion motion = truth;
  for (std::size_t t = 1; t < motion.poses.size(); ++t) {
    BodyPose& pose = motion.poses[t];
    const std::uint64_t base = t * static_cast<std::uint64_t>(kSmplxJoints + 1);
    const auto turn = [&](Index joint, double degrees) {
      const Vector3<double> noise =
          normal_vector(random, base + static_cast<std::uint64_t>(joint)) * (degrees * kDegree / std::sqrt(3.0));
      const Matrix3<double> rotation = so3_exp(pose.rotation_of(joint)) * so3_exp(noise);
      if (degrees > 0) pose.set_rotation(joint, so3_log(rotation));
    };
    turn(0, settings.root_noise_deg);
    for (Index joint = 1; joint <= 21; ++joint) turn(joint, settings.pose_noise_deg);
    for (Index joint = 25; joint < kSmplxJoints; ++joint)
      turn(joint, settings.pose_noise_deg * settings.hand_noise_share);
    pose.transl += normal_vector(random, base + static_cast<std::uint64_t>(kSmplxJoints)) * settings.root_noise_m;
  }
  return motion;
}

RenderSettings video_render_settings() {
  RenderSettings settings;
  apply_quality(settings, Quality::kAccurate);
  return settings;
}

void write_dataset(const SyntheticSettings& settings, const RenderSettings& render, const fs::path& folder,
                   const Observer& observer, const ConfigValue& more_sections, const BodySettings& body_settings) {
  FolderInMaking out(folder);
  const auto stop_if_asked = [&] {
    if (observer.wants_stop()) throw Interrupted("interrupted while a dataset was made; nothing is left of it");
  };
  const std::uint64_t seed = static_cast<std::uint64_t>(settings.seed);
  const BodyModel body = rest_body(body_settings);
  AvatarSettings avatar_settings;
  avatar_settings.gaussians = settings.avatar_gaussians;
  avatar_settings.seed = seed;
  const Avatar avatar = surface_avatar(body, avatar_settings);
  const SyntheticObject object = synthetic_object(settings);
  const SyntheticClip clip = synthetic_clip(body, object, clip_settings(settings));
  const Gaussians scene = synthetic_scene(settings, clip.plan);

  stop_if_asked();
  write_ply(out.file("scene.ply"), scene);
  write_avatar(out.file("avatar.safetensors"), avatar);
  write_camera(out.file("camera.json"), clip.cameras.front());
  write_motion(out.file("initial_motion.npz"), disturbed_motion(clip.motion, settings));
  write_text_file(out.file("initial.json"), initial_json(object, clip.object));
  write_motion(out.file("truth/motion.npz"), clip.motion);
  write_cameras(out.file("truth/cameras.json"), clip.cameras);
  if (object.exists()) {
    write_ply(out.file(fs::path("objects") / (object.name + ".ply")), object.gaussians);
    write_objects(out.file("truth/objects.npz"), object.name, clip.object);
  }
  write_text_file(out.file("synthetic.json"), synthetic_settings_json(settings, body_settings));
  write_text_file(out.file("config.json"), to_json(merged(object_of("data", data_section(object)), more_sections)));

  const SyntheticRenderer renderer(scene, object.gaussians, avatar, render);
  Progress shown("frames", settings.frames, observer.progress, observer.progress_interval);
  for (std::size_t t = 0; t < clip.cameras.size(); ++t) {
    const std::string name = four_digits(static_cast<std::int64_t>(t)) + ".png";
    const SyntheticFrame frame =
        renderer.frame(clip.motion.poses[t], object.exists() ? clip.object[t] : Rigid<double>(), clip.cameras[t],
                       settings.supersample);
    write_image(out.file(fs::path("frames") / name), frame.color);
    write_image(out.file(fs::path("masks") / "human" / name), frame.human_mask);
    if (object.exists()) write_image(out.file(fs::path("masks") / object.name / name), frame.object_mask);
    shown.step();
    stop_if_asked();
  }
  shown.finish();
  out.commit();
}

}  // namespace hsi4d
