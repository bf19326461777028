#include "pipelines/input/scene_setup.h"

#include <array>

#include "core/check.h"
#include "core/config_file.h"
#include "core/text.h"
#include "pipelines/input/body_files.h"
#include "splat/files/splat_file.h"

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
  fs::path object_tracks;
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
  f.path("object_tracks", s.object_tracks, {.must_exist = true},
         "Estimated poses of the objects in all frames (.npz, as a run's objects.npz); empty: none");
}

InitialSettings read_initial(const fs::path& file) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, {}, problems);
  return read_settings<InitialSettings>(tree, problems);
}

/// The Gaussians of a file, and what it says of them, which is told in the log.
SplatFile read_gaussians(const fs::path& file) {
  SplatFile read = read_splats_with_warnings(file.string());
  if (read.gaussians.count() == 0) throw DataError(file.string() + ": holds no Gaussians that can be used");
  return read;
}

Gaussians take_gaussians(SplatFile read, const fs::path& file, std::vector<std::string>& antialiased) {
  if (read.report.antialiased) antialiased.push_back(file.string());
  return std::move(read.gaussians);
}

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

/// The joint of the object that is read after those of `setup`.
std::optional<ObjectJoint> joint_of(const JointSettings& settings, const ObjectPose& pose, const SceneSetup& setup) {
  if (settings.type == JointType::kFree) return {};
  std::optional<Index> parent;
  for (std::size_t o = 0; o < setup.objects.size(); ++o) {
    if (setup.objects[o].name == settings.parent) parent = static_cast<Index>(o);
  }
  ObjectJoint joint = object_joint(settings, parent);
  joint.rest = compose(inverse(world_from_parent(joint, setup.poses)), rigid_of(pose));
  return joint;
}

/// A person whose motion `initial` names.
SetupPerson read_person(const InitialSettings& initial, Avatar avatar) {
  SetupPerson person{std::move(avatar), {}, initial.motion};
  person.motion = read_motion_for(initial.motion.string(), person.avatar);
  if (person.motion.poses.empty()) throw DataError(initial.motion.string() + ": holds no frames");
  check_begins_with_frame_0(person.motion, initial.motion.string(),
                            "the exact state of frame 0 is needed (an estimate belongs in data.motion)");
  return person;
}

Avatar read_clip_avatar(const DataSettings& data) {
  Avatar avatar = read_avatar(data.avatar.string());
  if (avatar.parents.size() != static_cast<std::size_t>(kSmplxJoints)) {
    throw DataError(data.avatar.string() + ": has " + std::to_string(avatar.parents.size()) +
                    " joints; a run needs the " + std::to_string(kSmplxJoints) + " of SMPL-X");
  }
  return avatar;
}

/// One of data.people.
SetupPerson read_other(const DataSettings& data) {
  const InitialSettings initial = read_initial(data.initial);
  if (!initial.objects.empty() || !initial.object_tracks.empty())
    throw DataError(data.initial.string() + ": is of a person beside the first one; objects belong in data.initial");
  return read_person(initial, read_clip_avatar(data));
}

}  // namespace

Gaussians read_object(const fs::path& file) { return centred(read_gaussians(file).gaussians); }

fs::path initial_motion_file(const DataSettings& data) { return read_initial(data.initial).motion; }

SceneSetup read_scene_setup(const DataSettings& data) {
  SceneSetup setup;
  setup.scene = take_gaussians(read_gaussians(data.scene), data.scene, setup.antialiased);
  Avatar avatar = read_clip_avatar(data);
  const InitialSettings initial = read_initial(data.initial);
  for (const auto& [name, object] : data.objects) {
    const ObjectPose pose = initial_pose(initial, name, data.initial);
    const std::optional<ObjectJoint> joint = joint_of(object.joint, pose, setup);
    SplatFile read = read_gaussians(object.gaussians);
    setup.objects.push_back(
        {name, centred(take_gaussians(std::move(read), object.gaussians, setup.antialiased)), joint});
    setup.poses.push_back(pose);
  }
  setup.object_tracks = initial.object_tracks;
  static_cast<SetupPerson&>(setup) = read_person(initial, std::move(avatar));
  for (const auto& [name, person] : data.people) setup.others.push_back(read_other(data_of_person(data, person)));
  return setup;
}

}  // namespace hsi4d
