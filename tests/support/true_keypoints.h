// What a perfect detector would find in a generated clip.
#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "body/kinematics.h"
#include "body/motion_io.h"
#include "pipelines/input/clip.h"

namespace hsi4d::test {

inline constexpr Index kTruePoints = 22;  // the first joints of SMPL-X

/// Where a camera sees the first joints of a body, (x, y) each, pixels.
inline std::vector<double> seen_joints(const Clip& clip, const Rigid<double>& camera_from_world, const BodyPose& pose) {
  const std::vector<double> joints = pose_joints(clip.avatar.parents, clip.avatar.joints, pose);
  std::vector<double> places;
  for (Index j = 0; j < kTruePoints; ++j) {
    const Vector3<double> p =
        camera_from_world.rotation * Vector3<double>(joints.data() + 3 * j) + camera_from_world.translation;
    places.push_back(clip.camera.fx * p[0] / p[2] + clip.camera.cx);
    places.push_back(clip.camera.fy * p[1] / p[2] + clip.camera.cy);
  }
  return places;
}

/// What a perfect detector would find, of all frames.
inline nlohmann::json true_keypoints(const Clip& clip) {
  nlohmann::json joints = nlohmann::json::array(), frames = nlohmann::json::array();
  for (Index j = 0; j < kTruePoints; ++j) joints.push_back(smplx_joint_names()[static_cast<std::size_t>(j)]);
  for (const SceneState& state : *clip.truth) {
    const std::vector<double> places = seen_joints(clip, state.camera_from_world, state.body);
    nlohmann::json frame = nlohmann::json::array();
    for (std::size_t j = 0; j < kTruePoints; ++j) frame.push_back({places[2 * j], places[2 * j + 1], 1});
    frames.push_back(frame);
  }
  return {{"format", "hsi4d keypoints"}, {"version", 1}, {"joints", joints}, {"frames", frames}};
}

}  // namespace hsi4d::test
