#include "pipelines/synthetic/views.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "body/motion_edit.h"
#include "core/angles.h"
#include "core/camera_file.h"
#include "core/file.h"
#include "core/folder_in_making.h"
#include "core/image_io.h"
#include "core/rotation.h"
#include "core/text.h"
#include "pipelines/draw/posed_avatar.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/view_set.h"
#include "pipelines/synthetic/dataset.h"

namespace hsi4d {

namespace {

constexpr double kRateHz = 10;

/// Rotations of joints, degrees about the axes of the rest pose.
using JointAngles = std::map<std::string, Vector3<double>>;

const std::vector<JointAngles>& pose_table() {
  static const std::vector<JointAngles> table = {
      {{"left_shoulder", {0, 0, -45}}, {"right_shoulder", {0, 0, 45}}},
      {{"left_shoulder", {0, -30, -60}},
       {"right_shoulder", {0, 20, 10}},
       {"right_elbow", {0, 70, 0}},
       {"left_elbow", {0, -50, 0}},
       {"left_hip", {-35, 0, 5}},
       {"left_knee", {45, 0, 0}},
       {"head", {5, 25, 0}}},
      {{"left_shoulder", {0, -70, -20}},
       {"right_shoulder", {0, 70, 20}},
       {"spine1", {15, 0, 0}},
       {"spine2", {10, 15, 0}},
       {"right_hip", {-25, 0, -8}},
       {"left_hip", {15, 0, 6}},
       {"left_knee", {20, 0, 0}}},
      {{"left_shoulder", {0, 0, 40}},
       {"right_shoulder", {0, 10, 65}},
       {"right_elbow", {0, 40, 0}},
       {"left_elbow", {0, -30, 0}},
       {"spine2", {0, -20, 5}},
       {"right_hip", {-60, 0, -10}},
       {"right_knee", {70, 0, 0}},
       {"head", {-10, -20, 5}}},
      {{"left_shoulder", {0, -40, -35}},
       {"right_shoulder", {0, 30, 50}},
       {"left_elbow", {0, -80, 0}},
       {"right_elbow", {0, 15, 0}},
       {"left_hip", {-20, 0, 12}},
       {"right_hip", {10, 0, -5}},
       {"right_knee", {30, 0, 0}},
       {"spine1", {8, 10, 0}}},
      {{"left_shoulder", {0, 0, -70}},
       {"right_shoulder", {0, 0, 70}},
       {"left_hip", {-70, 0, 8}},
       {"right_hip", {-70, 0, -8}},
       {"left_knee", {80, 0, 0}},
       {"right_knee", {80, 0, 0}},
       {"spine1", {20, 0, 0}}},
  };
  return table;
}

}  // namespace

std::vector<BodyPose> view_poses(const BodyModel& body, Index count) {
  const Matrix3<double> upright = so3_exp(Vector3<double>(90 * kDegree, 0, 0));  // y up to z up
  double low = 0;
  for (std::size_t i = 1; i < body.vertices.size(); i += 3) low = std::min(low, static_cast<double>(body.vertices[i]));
  const Vector3<double> pelvis(body.joints.data());
  std::vector<BodyPose> poses;
  for (Index k = 0; k < count; ++k) {
    const auto kinds = static_cast<Index>(pose_table().size());
    BodyPose pose = rest_pose(body.joint_count());
    const double turn = 37 * static_cast<double>(k / kinds);  // the table again, turned
    pose.set_rotation(0, so3_log(Matrix3<double>(so3_exp(Vector3<double>(0, 0, turn * kDegree)) * upright)));
    for (const auto& [joint, degrees] : pose_table()[static_cast<std::size_t>(k % kinds)]) {
      pose.set_rotation(smplx_joint(joint), degrees * kDegree);
    }
    pose.transl = Vector3<double>(0, 0, pelvis[1] - low) - pelvis;
    poses.push_back(std::move(pose));
  }
  return poses;
}

std::vector<Camera> ring_of_cameras(Index count, int size_px) {
  constexpr double kDistance = 3.4, kTarget = 0.95, kHigh = 1.3;  // metres
  std::vector<Camera> cameras;
  for (Index k = 0; k < count; ++k) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(count);
    const Vector3<double> eye(kDistance * std::sin(angle), -kDistance * std::cos(angle),
                              kTarget + (k % 2 == 0 ? 0.0 : kHigh));
    Camera camera;
    camera.width = camera.height = size_px;
    camera.fx = camera.fy = 1.45 * size_px;
    camera.cx = camera.cy = 0.5 * size_px;
    camera.camera_from_world = look_at(eye, Vector3<double>(0, 0, kTarget));
    cameras.push_back(camera);
  }
  return cameras;
}

Image picture_with_alpha(const PosedGaussians& posed, const Camera& camera, const RenderSettings& render,
                         Precision precision, int supersample) {
  SceneView view;
  view.camera = resized(camera, camera.width * supersample, camera.height * supersample);
  view.settings = render;
  view.precision = precision;
  const SceneImage large = render_scene(posed, view);
  Image planes(4, large.height, large.width);
  for (int y = 0; y < large.height; ++y) {
    for (int x = 0; x < large.width; ++x) {
      const std::size_t at =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(large.width) + static_cast<std::size_t>(x);
      for (int c = 0; c < 3; ++c)
        planes(c, y, x) = static_cast<float>(large.image[3 * at + static_cast<std::size_t>(c)]);
      planes(3, y, x) = static_cast<float>(large.alpha[at]);
    }
  }
  Image small = resize_area(planes, camera.height, camera.width);
  for (int y = 0; y < small.height(); ++y) {
    for (int x = 0; x < small.width(); ++x) {
      const float alpha = std::clamp(small(3, y, x), 0.0F, 1.0F);
      small(3, y, x) = alpha;
      for (int c = 0; c < 3; ++c) small(c, y, x) = alpha > 0 ? std::clamp(small(c, y, x) / alpha, 0.0F, 1.0F) : 0.0F;
    }
  }
  return small;
}

Image before_black(const Image& picture) {
  Image color = take_channels(picture, 0, 3);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < color.height(); ++y) {
      for (int x = 0; x < color.width(); ++x) color(c, y, x) *= picture(3, y, x);
    }
  }
  return color;
}

void write_views(const SyntheticSettings& settings, const RenderSettings& render, const std::filesystem::path& folder,
                 const Observer& observer, const BodySettings& body_settings) {
  FolderInMaking out(folder);
  const BodyModel body = rest_body(body_settings);
  AvatarSettings avatar_settings;
  avatar_settings.gaussians = settings.avatar_gaussians;
  avatar_settings.seed = static_cast<std::uint64_t>(settings.seed);
  const Avatar avatar = surface_avatar(body, avatar_settings);
  Motion motion{kRateHz, view_poses(body, settings.views_poses)};
  motion.pelvis_rest = pelvis_of(body.joints);
  const std::vector<Camera> cameras = ring_of_cameras(settings.views_cameras, settings.size_px);
  write_avatar(out.file("truth/avatar.safetensors"), avatar);
  write_motion(out.file("motion.npz"), motion);
  write_cameras(out.file("cameras.json"), cameras);
  std::vector<PosedView> views;
  Progress shown("views", settings.views_poses * settings.views_cameras, observer.progress, observer.progress_interval);
  for (Index pose = 0; pose < settings.views_poses; ++pose) {
    for (Index camera = 0; camera < settings.views_cameras; ++camera) {
      if (observer.wants_stop()) throw Interrupted("interrupted while views were made; nothing is left of them");
      const std::string name = "images/" + four_digits(static_cast<std::int64_t>(views.size())) + ".png";
      write_image(out.file(name), picture_with_alpha(posed_avatar(avatar, motion.poses[static_cast<std::size_t>(pose)]),
                                                     cameras[static_cast<std::size_t>(camera)], render,
                                                     Precision::kFloat, settings.supersample));
      views.push_back({name, {}, camera, pose});
      shown.step();
    }
  }
  write_text_file(out.file(kSyntheticFile), synthetic_settings_json(settings, body_settings));
  write_text_file(out.file("views.json"), view_set_json("motion.npz", "cameras.json", views));
  out.commit();
}

}  // namespace hsi4d
