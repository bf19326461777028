#include "pipelines/input/state.h"

#include <cmath>

#include "core/check.h"
#include "core/npz.h"

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

void write_object_tracks(const std::string& path, const std::vector<std::string>& names,
                         const std::vector<SceneState>& frames) {
  NpzWriter writer;
  const auto count = static_cast<std::int64_t>(frames.size());
  for (std::size_t o = 0; o < names.size(); ++o) {
    writer.add<double>(names[o] + "/rotation", {count, 3}, track(frames, o, &ObjectPose::rotation));
    writer.add<double>(names[o] + "/translation", {count, 3}, track(frames, o, &ObjectPose::translation));
  }
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

std::vector<BodyPose> bodies_of(const std::vector<SceneState>& frames) {
  std::vector<BodyPose> bodies;
  for (const SceneState& frame : frames) bodies.push_back(frame.body);
  return bodies;
}

std::vector<Camera> cameras_of(const std::vector<SceneState>& frames, const Camera& camera) {
  std::vector<Camera> cameras(frames.size(), camera);
  for (std::size_t t = 0; t < frames.size(); ++t) cameras[t].camera_from_world = frames[t].camera_from_world;
  return cameras;
}

}  // namespace hsi4d
