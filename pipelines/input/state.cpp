#include "pipelines/input/state.h"

#include <cmath>
#include <limits>

#include "body/motion_io.h"
#include "core/check.h"
#include "core/npz.h"
#include "optim/metrics.h"

namespace hsi4d {

namespace {

std::vector<double> track(const std::vector<SceneState>& frames, std::size_t object,
                          Vector3<double> ObjectPose::*part) {
  std::vector<double> numbers;
  for (const SceneState& frame : frames) {
    const Vector3<double>& v = frame.objects.at(object).*part;
    numbers.insert(numbers.end(), v.data(), v.data() + 3);
  }
  return numbers;
}

void append(const PlaceSigma& sigma, std::vector<double>& numbers) {
  numbers.push_back(sigma.across);
  numbers.push_back(sigma.along);
}

/// An array [T,3] of the archive; T = -1 takes any.
std::vector<double> read_track(const Npz& npz, const std::string& name, std::int64_t frames) {
  std::vector<double> track = npz.array(name).require_shape({frames, 3}).as<double>();
  for (std::size_t i = 0; i < track.size(); ++i) {
    if (std::isfinite(track[i])) continue;
    throw DataError(npz.array(name).source() + ": row " + std::to_string(i / 3) + " holds a number that is not finite");
  }
  return track;
}

}  // namespace

Rigid<double> rigid_of(const ObjectPose& pose) { return {so3_exp(pose.rotation), pose.translation}; }

std::vector<Rigid<double>> rigids_of(const std::vector<ObjectPose>& poses) {
  std::vector<Rigid<double>> rigids;
  for (const ObjectPose& pose : poses) rigids.push_back(rigid_of(pose));
  return rigids;
}

ObjectPose pose_of(const Rigid<double>& world_from_object) {
  return {so3_log(world_from_object.rotation), world_from_object.translation};
}

ObjectLight light_of(const SceneState& state, std::size_t object) {
  return state.lights.empty() ? ObjectLight{} : state.lights.at(object);
}

PlaceSigmas no_sigmas(std::size_t objects, std::size_t others) {
  constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();
  const std::vector<PlaceSigma> joints(static_cast<std::size_t>(kMetricJoints), {kNotANumber, kNotANumber});
  return {joints, std::vector<PlaceSigma>(objects, {kNotANumber, kNotANumber}), std::vector(others, joints)};
}

namespace {

std::vector<double> light_track(const std::vector<SceneState>& frames, std::size_t object) {
  std::vector<double> numbers;
  for (const SceneState& frame : frames) {
    const ObjectLight light = light_of(frame, object);
    numbers.insert(numbers.end(), light.begin(), light.end());
  }
  return numbers;
}

}  // namespace

void write_object_tracks(const std::string& path, const std::vector<std::string>& names,
                         const std::vector<SceneState>& frames, const std::vector<PlaceSigmas>& sigmas,
                         const std::vector<JointTrack>& joints) {
  NpzWriter writer;
  const auto count = static_cast<std::int64_t>(frames.size());
  for (std::size_t o = 0; o < names.size(); ++o) {
    writer.add<double>(names[o] + "/rotation", {count, 3}, track(frames, o, &ObjectPose::rotation));
    writer.add<double>(names[o] + "/translation", {count, 3}, track(frames, o, &ObjectPose::translation));
    if (!frames.empty() && !frames.back().lights.empty())
      writer.add<double>(names[o] + "/light", {count, 6}, light_track(frames, o));
    if (sigmas.empty()) continue;
    std::vector<double> numbers;
    for (const PlaceSigmas& frame : sigmas) append(frame.objects.at(o), numbers);
    writer.add<double>(names[o] + "/sigma", {count, 2}, numbers);
  }
  for (const JointTrack& joint : joints) writer.add<double>(joint.object + "/joint", {count}, joint.values);
  writer.write(path);
}

std::vector<std::vector<ObjectPose>> read_object_tracks(const std::string& path,
                                                        const std::vector<std::string>& names) {
  const Npz npz = Npz::read(path);
  std::vector<std::vector<ObjectPose>> frames;
  for (std::size_t o = 0; o < names.size(); ++o) {
    const std::int64_t expected = o == 0 ? -1 : static_cast<std::int64_t>(frames.size());
    const std::vector<double> rotation = read_track(npz, names[o] + "/rotation", expected);
    const auto count = static_cast<std::int64_t>(rotation.size() / 3);
    const std::vector<double> translation = read_track(npz, names[o] + "/translation", count);
    frames.resize(static_cast<std::size_t>(count), std::vector<ObjectPose>(names.size()));
    for (std::size_t t = 0; t < frames.size(); ++t) {
      frames[t][o].rotation = Eigen::Map<const Vector3<double>>(rotation.data() + 3 * t);
      frames[t][o].translation = Eigen::Map<const Vector3<double>>(translation.data() + 3 * t);
    }
  }
  return frames;
}

std::vector<double> joint_sigmas_of(const std::vector<PlaceSigmas>& sigmas) {
  std::vector<double> numbers;
  for (const PlaceSigmas& frame : sigmas) {
    for (const PlaceSigma& joint : frame.joints) append(joint, numbers);
  }
  return numbers;
}

std::vector<PlaceSigmas> read_place_sigmas(const std::string& motion, const std::string& objects,
                                           const std::vector<std::string>& names) {
  const std::vector<double> joints = read_joint_sigmas(motion);
  constexpr std::size_t kOfJoints = 2 * static_cast<std::size_t>(kMetricJoints);
  if (joints.size() % kOfJoints != 0)
    throw DataError(motion + ": \"joint_sigma\" is not of " + std::to_string(kMetricJoints) + " joints");
  std::vector<PlaceSigmas> sigmas(joints.size() / kOfJoints, no_sigmas(names.size()));
  for (std::size_t i = 0; i < joints.size(); i += 2)
    sigmas[i / kOfJoints].joints[i % kOfJoints / 2] = {joints[i], joints[i + 1]};
  if (sigmas.empty() || names.empty()) return sigmas;
  const Npz npz = Npz::read(objects);
  for (std::size_t o = 0; o < names.size(); ++o) {
    const NpyArray& array = npz.array(names[o] + "/sigma");
    const std::vector<double> numbers = array.require_shape({static_cast<std::int64_t>(sigmas.size()), 2}).as<double>();
    for (std::size_t t = 0; t < sigmas.size(); ++t) {
      if (numbers[2 * t] < 0 || numbers[2 * t + 1] < 0)
        throw DataError(array.source() + ": row " + std::to_string(t) + " holds a number below 0");
      sigmas[t].objects[o] = {numbers[2 * t], numbers[2 * t + 1]};
    }
  }
  return sigmas;
}

std::vector<BodyPose> bodies_of(const std::vector<SceneState>& frames, std::size_t person) {
  std::vector<BodyPose> bodies;
  for (const SceneState& frame : frames) bodies.push_back(frame.person(person));
  return bodies;
}

std::vector<SceneState> with_person(std::vector<SceneState> frames, std::size_t person) {
  for (SceneState& frame : frames) {
    if (person > 0) frame.body = frame.person(person);
    frame.others.clear();
  }
  return frames;
}

std::vector<Camera> cameras_of(const std::vector<SceneState>& frames, const Camera& camera) {
  std::vector<Camera> cameras(frames.size(), camera);
  for (std::size_t t = 0; t < frames.size(); ++t) cameras[t].camera_from_world = frames[t].camera_from_world;
  return cameras;
}

}  // namespace hsi4d
