// Bodies, avatars, motions, and the states of a scene, with their files.
#include <optional>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/npz.h"
#include "pipelines/draw/posed_avatar.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/state.h"
#include "python/arrays.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

namespace fs = std::filesystem;

// --- poses -----------------------------------------------------------------------------------------------------------

BodyPose pose_of(py::handle transl, py::handle rotations) {
  BodyPose pose;
  pose.transl = vector_of(transl, "transl");
  pose.axis_angle = numbers_of<double>(rotations, {-1, 3}, "rotations", "[J,3]").values;
  return pose;
}

py::array_t<double> rotations_of(const BodyPose& pose) { return array_of(pose.axis_angle, {pose.joints(), 3}); }

/// Throws UserError where a pose is of another number of joints.
void check_joints(const BodyPose& pose, Index joints, const char* whose) {
  if (pose.joints() != joints)
    throw UserError("pose: it has " + std::to_string(pose.joints()) + " joints; the " + whose + " has " +
                    std::to_string(joints));
}

// --- motions ---------------------------------------------------------------------------------------------------------

Motion motion_of_arrays(py::handle transl, py::handle rotations, double frame_rate, const std::vector<double>& betas,
                        const std::string& gender, const py::object& pelvis_rest) {
  const Numbers<double> places = numbers_of<double>(transl, {-1, 3}, "transl", "[T,3]");
  const py::ssize_t frames = places.shape[0], joints = static_cast<py::ssize_t>(kSmplxJoints);
  const Numbers<double> turns =
      numbers_of<double>(rotations, {frames, joints, 3}, "rotations",
                         "[" + std::to_string(frames) + ",55,3], as transl has " + std::to_string(frames) + " rows");
  if (frames == 0) throw UserError("transl: an array [0,3]; allowed: one frame or more");
  if (!(frame_rate >= kSlowestMotion && frame_rate <= kFastestMotion))
    throw UserError("frame_rate: " + std::to_string(frame_rate) + "; allowed: 0.01 to 100000 frames a second");
  Motion motion;
  motion.frame_rate = frame_rate;
  motion.betas = betas;
  motion.gender = gender;
  if (!pelvis_rest.is_none()) motion.pelvis_rest = vector_of(pelvis_rest, "pelvis_rest");
  for (py::ssize_t t = 0; t < frames; ++t) {
    BodyPose& pose = motion.poses.emplace_back();
    pose.transl = Vector3<double>(places.values.data() + 3 * t);
    const auto begin = turns.values.begin() + 3 * joints * t;
    pose.axis_angle.assign(begin, begin + 3 * joints);
  }
  return motion;
}

py::array_t<double> places_of(const Motion& motion) {
  std::vector<double> numbers;
  for (const BodyPose& pose : motion.poses) numbers.insert(numbers.end(), pose.transl.data(), pose.transl.data() + 3);
  return array_of(std::move(numbers), {std::ssize(motion.poses), 3});
}

py::array_t<double> turns_of(const Motion& motion) {
  std::vector<double> numbers;
  for (const BodyPose& pose : motion.poses)
    numbers.insert(numbers.end(), pose.axis_angle.begin(), pose.axis_angle.end());
  return array_of(std::move(numbers), {std::ssize(motion.poses), kSmplxJoints, 3});
}

/// [T,J,2]; None where the file has none.
py::object joint_sigma_in(const fs::path& path) {
  std::vector<double> numbers;
  py::ssize_t frames = 0;
  {
    const Released released;
    numbers = read_joint_sigmas(path.string());
    if (!numbers.empty()) frames = std::ssize(read_motion(path.string()).poses);
  }
  if (numbers.empty()) return py::none();
  const py::ssize_t joints = std::ssize(numbers) / (2 * frames);
  return array_of(std::move(numbers), {frames, joints, 2});
}

void write_motion_with(const fs::path& path, const Motion& motion, const py::object& joint_sigma) {
  std::vector<double> numbers;
  if (!joint_sigma.is_none()) {
    const py::ssize_t frames = std::ssize(motion.poses);
    numbers = numbers_of<double>(
                  joint_sigma, {frames, -1, 2}, "joint_sigma",
                  "[" + std::to_string(frames) + ",J,2], as the motion has " + std::to_string(frames) + " frames")
                  .values;
    for (const double number : numbers)
      if (number < 0) throw UserError("joint_sigma: " + std::to_string(number) + "; allowed: 0 or more, inf, nan");
  }
  const Released released;
  write_motion(path.string(), motion, numbers);
}

/// Place of an item counted as Python does; IndexError beyond the ends, by which loops end.
std::size_t place_of(py::ssize_t index, std::size_t size) {
  const auto count = static_cast<py::ssize_t>(size);
  if (index < -count || index >= count) throw py::index_error("frame " + std::to_string(index));
  return static_cast<std::size_t>(index < 0 ? index + count : index);
}

// --- bodies ----------------------------------------------------------------------------------------------------------

BodyModel read_body(const fs::path& path, const std::vector<double>& betas) {
  SmplxFileOptions options;
  options.betas = std::ssize(betas);
  options.expressions = 0;
  options.correctives = false;
  const SmplxModel model = read_smplx(path.string(), options);
  warn_of_repairs(model);
  return rest_body(model, betas);
}

py::tuple posed_body(const BodyModel& body, const BodyPose& pose) {
  check_joints(pose, body.joint_count(), "body");
  std::vector<double> joints, vertices;
  {
    const Released released;
    joints = pose_joints(body, pose);
    vertices = pose_vertices(body, pose);
  }
  return py::make_tuple(array_of(std::move(joints), {body.joint_count(), 3}),
                        array_of(std::move(vertices), {body.vertex_count(), 3}));
}

// --- avatars ---------------------------------------------------------------------------------------------------------

PosedGaussians pose_avatar(const Avatar& avatar, const BodyPose& pose, const py::object& camera) {
  check_joints(pose, avatar.joint_count(), "avatar");
  std::optional<Vector3<double>> center;
  if (!camera.is_none()) center = camera_center_world(camera.cast<const Camera&>());
  const bool looks = avatar.color_net && avatar.color_net->view_direction;
  if (looks && !center)
    throw UserError("camera: None; allowed: the camera, as the avatar's colours follow the direction of view");
  const Released released;
  return posed_avatar(avatar, pose, center ? &*center : nullptr);
}

py::array_t<double> joints_of(const Avatar& avatar, const BodyPose& pose) {
  check_joints(pose, avatar.joint_count(), "avatar");
  return array_of(pose_joints(avatar, pose), {avatar.joint_count(), 3});
}

template <class Type>
void add_avatar_array(py::class_<Avatar>& type, const char* name, Type member, py::ssize_t width, const char* text) {
  type.def_property_readonly(
      name,
      [member, width](const py::object& self) {
        Avatar& avatar = self.cast<Avatar&>();
        return view_of(avatar.*member, width > 1 ? Sizes{avatar.count(), width} : Sizes{avatar.count()}, self);
      },
      text);
}

// --- states ----------------------------------------------------------------------------------------------------------

SceneState state_of(py::handle camera_from_world, const BodyPose& body, const py::sequence& objects,
                    const std::vector<BodyPose>& others, const std::vector<ObjectLight>& lights) {
  if (!lights.empty() && lights.size() != objects.size())
    throw UserError("lights: " + std::to_string(lights.size()) +
                    "; allowed: none, or one an object, of which there are " + std::to_string(objects.size()));
  SceneState state;
  state.lights = lights;
  state.camera_from_world = rigid_of(camera_from_world, "camera_from_world");
  state.body = body;
  state.others = others;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const py::object pose = objects[i];
    const std::string name = "objects[" + std::to_string(i) + "]";
    const bool is_pair = py::isinstance<py::sequence>(pose) && py::len(pose) == 2;
    if (!is_pair) throw UserError(name + ": allowed: a pair of rotation [3] and translation [3]");
    state.objects.push_back(
        {vector_of(pose[py::int_(0)], name + " rotation"), vector_of(pose[py::int_(1)], name + " translation")});
  }
  return state;
}

py::list object_pairs(const SceneState& state) {
  py::list pairs;
  for (const ObjectPose& pose : state.objects)
    pairs.append(py::make_tuple(array_of(pose.rotation), array_of(pose.translation)));
  return pairs;
}

// --- tracks of objects -----------------------------------------------------------------------------------------------

void write_tracks(const fs::path& path, const py::dict& tracks) {
  std::vector<std::string> names;
  std::vector<SceneState> frames;
  for (const auto& [key, pair] : tracks) {
    const std::string name = py::str(key);
    if (!py::isinstance<py::sequence>(pair) || py::len(pair) != 2)
      throw UserError(name + ": allowed: a pair of rotations [T,3] and translations [T,3]");
    const py::object rotations_given = pair[py::int_(0)], translations_given = pair[py::int_(1)];
    const py::ssize_t wanted = names.empty() ? -1 : std::ssize(frames);
    const std::string text = names.empty() ? "[T,3]" : "[" + std::to_string(wanted) + ",3], as those before it";
    const Numbers<double> rotations = numbers_of<double>(rotations_given, {wanted, 3}, name + " rotations", text);
    const Numbers<double> translations =
        numbers_of<double>(translations_given, {rotations.shape[0], 3}, name + " translations", text);
    frames.resize(static_cast<std::size_t>(rotations.shape[0]));
    for (std::size_t t = 0; t < frames.size(); ++t)
      frames[t].objects.push_back(
          {Vector3<double>(rotations.values.data() + 3 * t), Vector3<double>(translations.values.data() + 3 * t)});
    names.push_back(name);
  }
  const Released released;
  write_object_tracks(path.string(), names, frames);
}

void add_poses(py::module_& module) {
  py::class_<BodyPose>(module, "BodyPose",
                       "The pose of a body: transl [3] metres, added last, and rotations [J,3], axis-angle vectors in\n"
                       "radians relative to the parent joint. J = 55 in the order of SMPL-X.")
      .def(py::init(&pose_of), py::arg("transl"), py::arg("rotations"))
      .def_property_readonly(
          "transl", [](const BodyPose& pose) { return array_of(pose.transl); }, "[3] metres, world. A copy.")
      .def_property_readonly("rotations", &rotations_of, "[J,3] radians. A copy.");
  module.def(
      "rest_pose",
      [](Index joints) {
        if (joints < 1) throw UserError("joints: " + std::to_string(joints) + "; allowed: 1 or more");
        return rest_pose(joints);
      },
      py::arg("joints") = kSmplxJoints, "The rest pose of a body of so many joints, at its origin.");
  py::class_<SceneState>(module, "State", "All that moves, in one frame: camera, objects and bodies.")
      .def(py::init(&state_of), py::arg("camera_from_world"), py::arg("body"), py::arg("objects") = py::tuple(),
           py::arg("others") = std::vector<BodyPose>(), py::arg("lights") = std::vector<ObjectLight>())
      .def_property_readonly(
          "camera_from_world", [](const SceneState& state) { return array_of(state.camera_from_world); },
          "[4,4] metres. A copy.")
      .def_property_readonly("objects", &object_pairs,
                             "Pairs of rotation [3], axis-angle, and translation [3], metres, in the clip's order.")
      .def_property_readonly(
          "body", [](const SceneState& state) { return state.body; }, "The body's pose.")
      .def_property_readonly(
          "others", [](const SceneState& state) { return state.others; },
          "Poses of the people beside the first one, in the clip's order.")
      .def_property_readonly(
          "lights", [](const SceneState& state) { return state.lights; },
          "Light on each object, six numbers (docs/running.md), in the clip's order; empty: none. A copy.");
}

void add_motions(py::module_& module) {
  py::class_<Motion>(module, "Motion", "Poses of a body of 55 joints, one a frame.")
      .def(py::init(&motion_of_arrays), py::arg("transl"), py::arg("rotations"), py::arg("frame_rate") = 10.0,
           py::arg("betas") = std::vector<double>(), py::arg("gender") = "neutral", py::arg("pelvis_rest") = py::none())
      .def_readonly("frame_rate", &Motion::frame_rate, "Frames a second.")
      .def_readonly("gender", &Motion::gender, "Of the body model.")
      .def_readonly("betas", &Motion::betas, "Numbers of the body's shape; empty: not known.")
      .def_property_readonly(
          "pelvis_rest",
          [](const Motion& motion) -> py::object {
            return motion.pelvis_rest ? py::object(array_of(*motion.pelvis_rest)) : py::none();
          },
          "[3] where the pelvis stands in the rest pose, metres; None: not known.")
      .def_property_readonly("transl", &places_of, "[T,3] metres, world. A copy.")
      .def_property_readonly("rotations", &turns_of, "[T,55,3] radians. A copy.")
      .def("__len__", [](const Motion& motion) { return motion.poses.size(); })
      .def("__getitem__",
           [](const Motion& motion, py::ssize_t frame) { return motion.poses[place_of(frame, motion.poses.size())]; });
  module.def(
      "read_motion", [](const fs::path& path) { return read_motion_with_warnings(path.string()); }, py::arg("path"),
      WhileReleased(), "A motion (.npz) with the names of AMASS, SMPL-X and other programs (docs/formats.md).");
  module.def(
      "write_motion", &write_motion_with, py::arg("path"), py::arg("motion"), py::arg("joint_sigma") = py::none(),
      "Writes a motion (.npz); reading gives the same bits. joint_sigma: as read_joint_sigma gives it, to be kept.");
  module.def("read_joint_sigma", &joint_sigma_in, py::arg("path"),
             "How sure a motion (.npz) is of the places of its first J joints: [T,J,2] metres, one standard deviation\n"
             "across the view and along it, inf: nothing tells the place, nan: of a frame that was given. None: the\n"
             "file does not say it.");
  module.def("read_object_tracks", &read_tracks, py::arg("path"),
             "objects.npz: a dict of names and pairs of rotations [T,3], axis-angle, and translations [T,3], metres.");
  module.def("write_object_tracks", &write_tracks, py::arg("path"), py::arg("tracks"),
             "Writes what read_object_tracks gives.");
}

void add_body_models(py::module_& module) {
  py::class_<BodyModel>(
      module, "Body",
      "A body in its rest pose, a T: y up, x to its left, z forward, metres. The arrays are views that\n"
      "keep it alive and cannot be written.")
      .def_readonly("name", &BodyModel::name, "\"smplx\" or \"procedural\".")
      .def_readonly("joint_names", &BodyModel::joint_names, "J names.")
      .def_property_readonly(
          "vertices",
          [](const py::object& self) {
            const BodyModel& body = self.cast<const BodyModel&>();
            return view_of(body.vertices, {body.vertex_count(), 3}, self);
          },
          "[V,3] float32, metres.")
      .def_property_readonly(
          "faces",
          [](const py::object& self) {
            const BodyModel& body = self.cast<const BodyModel&>();
            return view_of(body.faces, {body.face_count(), 3}, self);
          },
          "[F,3] int32, vertices, counter-clockwise from outside.")
      .def_property_readonly(
          "parents",
          [](const py::object& self) {
            const BodyModel& body = self.cast<const BodyModel&>();
            return view_of(body.parents, {body.joint_count()}, self);
          },
          "[J] int32, -1 for joint 0.")
      .def_property_readonly(
          "joints",
          [](const py::object& self) {
            const BodyModel& body = self.cast<const BodyModel&>();
            return view_of(body.joints, {body.joint_count(), 3}, self);
          },
          "[J,3] float64, metres.")
      .def("pose", &posed_body, py::arg("pose"),
           "(joints [J,3], vertices [V,3]) in a pose, metres, world: linear blend skinning in double.");
  module.def("procedural_body", &procedural_body, WhileReleased(), "The program's own body.");
  module.def("read_body", &read_body, py::arg("path"), py::arg("betas") = std::vector<double>(), WhileReleased(),
             "A body model of SMPL-X (.npz) in the shape that the betas say; none: its template.");
}

void add_avatars(py::module_& module) {
  py::class_<Avatar> type(
      module, "Avatar",
      "N Gaussians in the rest pose of a skeleton. The arrays are views: what is written to them is\n"
      "the avatar's, and they keep it alive.");
  add_avatar_array(type, "means", &Avatar::means, 3, "[N,3] float32, metres.");
  add_avatar_array(type, "quats", &Avatar::quats, 4, "[N,4] float32, wxyz.");
  add_avatar_array(type, "log_scales", &Avatar::log_scales, 3, "[N,3] float32, natural logarithm of metres.");
  add_avatar_array(type, "opacity_logits", &Avatar::opacity_logits, 1, "[N] float32.");
  add_avatar_array(type, "colors", &Avatar::colors, 3, "[N,3] float32, RGB.");
  type.def_readonly("body", &Avatar::body, "The body that it was made on; empty: not known.")
      .def_readonly("joint_names", &Avatar::joint_names, "J names.")
      .def_property_readonly(
          "joints",
          [](const py::object& self) {
            const Avatar& avatar = self.cast<const Avatar&>();
            return view_of(avatar.joints, {avatar.joint_count(), 3}, self);
          },
          "[J,3] float64, metres, rest pose. It cannot be written.")
      .def_property_readonly(
          "has_color_net", [](const Avatar& avatar) { return avatar.color_net.has_value(); },
          "Whether its colours follow the pose.")
      .def("__len__", &Avatar::count)
      .def("pose", &pose_avatar, py::arg("pose"), py::arg("camera") = py::none(),
           "Its Gaussians in a pose, to be rendered. camera: where colours follow the direction of view, as those of\n"
           "some color nets do.")
      .def("pose_joints", &joints_of, py::arg("pose"), "[J,3] its joints in a pose, metres, world.");
  module.def(
      "read_avatar", [](const fs::path& path) { return read_avatar(path.string()); }, py::arg("path"), WhileReleased(),
      "An avatar's file (docs/avatar.md).");
  module.def(
      "write_avatar", [](const fs::path& path, const Avatar& avatar) { write_avatar(path.string(), avatar); },
      py::arg("path"), py::arg("avatar"), WhileReleased(), "Writes an avatar's file.");
  module.def(
      "make_avatar",
      [](const BodyModel& body, Index gaussians, std::uint64_t seed) {
        AvatarSettings settings;
        settings.gaussians = gaussians;
        settings.seed = seed;
        return surface_avatar(body, settings);
      },
      py::arg("body"), py::arg("gaussians") = AvatarSettings().gaussians, py::arg("seed") = 0, WhileReleased(),
      "Coloured Gaussians on a body's surface.");
}

}  // namespace

std::vector<std::string> track_names(const fs::path& path) {
  constexpr std::string_view kEnding = "/rotation";
  std::vector<std::string> names;
  const Npz file = Npz::read(path.string());
  for (const std::string& name : file.names()) {
    if (name.ends_with(kEnding)) names.push_back(name.substr(0, name.size() - kEnding.size()));
  }
  return names;
}

py::dict read_tracks(const fs::path& path) {
  std::vector<std::string> names;
  std::vector<std::vector<ObjectPose>> frames;
  {
    const Released released;
    names = track_names(path);
    frames = read_object_tracks(path.string(), names);
  }
  py::dict tracks;
  for (std::size_t o = 0; o < names.size(); ++o) {
    std::vector<double> rotations, translations;
    for (const std::vector<ObjectPose>& poses : frames) {
      rotations.insert(rotations.end(), poses[o].rotation.data(), poses[o].rotation.data() + 3);
      translations.insert(translations.end(), poses[o].translation.data(), poses[o].translation.data() + 3);
    }
    const py::ssize_t count = std::ssize(frames);
    tracks[py::str(names[o])] =
        py::make_tuple(array_of(std::move(rotations), {count, 3}), array_of(std::move(translations), {count, 3}));
  }
  return tracks;
}

void add_bodies(py::module_& module) {
  add_poses(module);
  add_motions(module);
  add_body_models(module);
  add_avatars(module);
}

}  // namespace hsi4d::python
