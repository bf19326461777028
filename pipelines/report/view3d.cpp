#include "pipelines/report/view3d.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numeric>
#include <system_error>

#include "body/motion_edit.h"
#include "core/check.h"
#include "core/quaternion.h"
#include "core/rotation.h"
#include "core/text.h"
#include "pipelines/report/view3d_splats.h"

namespace hsi4d {

namespace {

constexpr double kLeastRadius = 30;         // metres around the human that are shown, however near the camera is
constexpr double kRadiusOverDistance = 10;  // or this many times the farthest camera's distance

void add_numbers(const auto& numbers, std::vector<float>& all) {
  for (Index i = 0; i < numbers.size(); ++i) all.push_back(static_cast<float>(numbers[i]));
}

// ---- Gaussians ----

/// Where the human is, and how far around it is worth showing.
SplatSelection selection_of(const Clip& clip, const std::vector<SceneState>& states) {
  SplatSelection selection{.count = kMostSceneSplats};
  const Vector3<double> rest = pelvis_of(clip.avatar.joints);
  for (const SceneState& state : states) selection.center_world += (rest + state.body.transl) / std::ssize(states);
  selection.radius = kLeastRadius;
  for (const SceneState& state : states) {
    const Rigid<double>& camera = state.camera_from_world;
    const Vector3<double> eye = -(camera.rotation.transpose() * camera.translation);
    selection.radius = std::max(selection.radius, kRadiusOverDistance * (eye - selection.center_world).norm());
  }
  return selection;
}

void add_splats(const Clip& clip, const std::vector<SceneState>& states, SafetensorsWriter& file) {
  QuantisedSplats splats;
  add_part(clip.scene, selection_of(clip, states), splats);
  const auto objects = static_cast<Index>(clip.objects.size());
  for (const ClipObject& object : clip.objects)
    add_part(object.gaussians, {.count = kMostObjectSplats / objects, .radius = kLeastRadius}, splats);
  const auto parts = std::ssize(splats.counts), count = std::ssize(splats.colors) / 4;
  file.add("splats/counts", {parts}, splats.counts);
  file.add("splats/boxes", {parts, 2, 3}, splats.boxes);
  file.add("splats/positions", {count, 3}, splats.positions);
  file.add("splats/log_scales", {count, 3}, splats.log_scales);
  file.add("splats/log_scale_range", {2}, std::vector<float>{kLeastLogScale, kLargestLogScale});
  file.add("splats/rotations", {count, 4}, splats.rotations);
  file.add("splats/colors", {count, 4}, splats.colors);
}

// ---- Motion ----

void add_rigid(const Matrix3<double>& rotation, const Vector3<double>& translation, std::vector<float>& poses) {
  add_numbers(quaternion_normalized(quaternion_from_matrix(rotation)), poses);
  add_numbers(translation, poses);
}

void add_objects_and_cameras(const Clip& clip, const std::vector<SceneState>& states, SafetensorsWriter& file) {
  std::vector<float> objects, cameras;
  for (const SceneState& state : states) {
    for (const ObjectPose& pose : state.objects) add_rigid(so3_exp(pose.rotation), pose.translation, objects);
    add_rigid(state.camera_from_world.rotation, state.camera_from_world.translation, cameras);
  }
  const auto frames = std::ssize(states);
  file.add("objects/poses", {frames, std::ssize(clip.objects), 7}, objects);
  file.add("cameras/poses", {frames, 7}, cameras);
  std::vector<float> intrinsics;
  const Camera& camera = clip.camera;
  for (const double number : {static_cast<double>(camera.width), static_cast<double>(camera.height), camera.fx,
                              camera.fy, camera.cx, camera.cy})
    intrinsics.push_back(static_cast<float>(number));
  file.add("cameras/intrinsics", {6}, intrinsics);
}

/// Rotations in the world, of the joints' own relative to their parents.
std::vector<Vector4<double>> world_rotations(const std::vector<int>& parents, const BodyPose& pose) {
  std::vector<Vector4<double>> rotations;
  for (std::size_t j = 0; j < parents.size(); ++j) {
    const Matrix3<double> own = so3_exp(pose.rotation_of(static_cast<Index>(j)));
    const Vector4<double> q = quaternion_normalized(quaternion_from_matrix(own));
    rotations.push_back(parents[j] < 0 ? q : quaternion_product(rotations[static_cast<std::size_t>(parents[j])], q));
  }
  return rotations;
}

void add_body_motion(const std::string& name, const std::vector<int>& parents, const std::vector<BodyPose>& poses,
                     SafetensorsWriter& file) {
  std::vector<std::int16_t> rotations;
  std::vector<float> translations;
  for (const BodyPose& pose : poses) {
    for (const Vector4<double>& q : world_rotations(parents, pose)) {
      for (Index i = 0; i < 4; ++i) rotations.push_back(static_cast<std::int16_t>(std::lround(32767 * q[i])));
    }
    add_numbers(pose.transl, translations);
  }
  file.add(name + "/rotations", {std::ssize(poses), std::ssize(parents), 4}, rotations);
  file.add(name + "/translations", {std::ssize(poses), 3}, translations);
}

void add_joints(const std::string& name, const std::vector<double>& joints, SafetensorsWriter& file) {
  file.add(name + "/joints", {std::ssize(joints) / 3, 3}, std::vector<float>(joints.begin(), joints.end()));
}

void add_skeleton(const std::vector<double>& joints, const std::vector<int>& parents, SafetensorsWriter& file) {
  add_joints("skeleton", joints, file);
  file.add("skeleton/parents", {std::ssize(parents)}, std::vector<std::int32_t>(parents.begin(), parents.end()));
}

// ---- Mesh ----

void add_faces(const BodyModel& body, SafetensorsWriter& file) {
  if (body.vertex_count() > 65536) {
    file.add("mesh/faces", {body.face_count(), 3}, std::vector<std::uint32_t>(body.faces.begin(), body.faces.end()));
  } else {
    file.add("mesh/faces", {body.face_count(), 3}, std::vector<std::uint16_t>(body.faces.begin(), body.faces.end()));
  }
}

/// The four largest weights of a vertex in 255ths that sum to 255: what rounding leaves goes to the largest.
void add_weights(const SparseWeights& weights, Index vertex, std::vector<std::uint8_t>& joints,
                 std::vector<std::uint8_t>& shares) {
  std::vector<std::size_t> places(static_cast<std::size_t>(weights.per_vertex));
  std::iota(places.begin(), places.end(), static_cast<std::size_t>(vertex * weights.per_vertex));
  std::stable_sort(places.begin(), places.end(),
                   [&](std::size_t a, std::size_t b) { return weights.weights[a] > weights.weights[b]; });
  places.resize(std::min<std::size_t>(places.size(), 4));
  double sum = 0;
  for (const std::size_t at : places) sum += weights.weights[at];
  std::array<int, 4> share{}, joint{};
  int left = 255;
  for (std::size_t k = 0; k < places.size(); ++k) {
    joint[k] = weights.indices[places[k]];
    share[k] = static_cast<int>(std::floor(255 * weights.weights[places[k]] / sum));
    left -= share[k];
  }
  share[0] += left;
  for (std::size_t k = 0; k < 4; ++k) {
    joints.push_back(static_cast<std::uint8_t>(joint[k]));
    shares.push_back(static_cast<std::uint8_t>(share[k]));
  }
}

void add_mesh(const BodyModel& body, SafetensorsWriter& file) {
  HSI4D_CHECK(body.joint_count() <= 256, "a viewer's mesh has joints of 8 bits");
  std::array<float, 6> box{};
  for (std::size_t a = 0; a < 3; ++a) {
    box[a] = box[3 + a] = body.vertices[a];
    for (std::size_t i = a; i < body.vertices.size(); i += 3) {
      box[a] = std::min(box[a], body.vertices[i]);
      box[3 + a] = std::max(box[3 + a], body.vertices[i]);
    }
  }
  std::vector<std::uint16_t> positions;
  for (std::size_t i = 0; i < body.vertices.size(); ++i) {
    const float low = box[i % 3], size = box[3 + i % 3] - low;
    positions.push_back(
        static_cast<std::uint16_t>(std::lround(65535 * (size > 0 ? (body.vertices[i] - low) / size : 0))));
  }
  std::vector<std::uint8_t> joints, weights;
  for (Index v = 0; v < body.vertex_count(); ++v) add_weights(body.weights, v, joints, weights);
  file.add("mesh/box", {2, 3}, std::vector<float>(box.begin(), box.end()));
  file.add("mesh/positions", {body.vertex_count(), 3}, positions);
  add_faces(body, file);
  file.add("mesh/joints", {body.vertex_count(), 4}, joints);
  file.add("mesh/weights", {body.vertex_count(), 4}, weights);
}

double number_in(const std::string& text, const std::string& path) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value > 0) || !std::isfinite(value))
    throw DataError(path + ": frame_rate is \"" + text + "\", not a positive number");
  return value;
}

}  // namespace

SafetensorsWriter view3d_file(const Clip& clip, const std::vector<SceneState>& states, const BodyModel* body) {
  SafetensorsWriter file(kView3dFormat, kView3dVersion);
  std::vector<std::string> names;
  for (const ClipObject& object : clip.objects) names.push_back(object.name);
  file.set_texts("objects", names);
  file.set_text("frame_rate", rounded(clip.frame_rate, 6));
  add_splats(clip, states, file);
  add_objects_and_cameras(clip, states, file);
  add_skeleton(body != nullptr ? body->joints : clip.avatar.joints, clip.avatar.parents, file);
  add_body_motion("body", clip.avatar.parents, bodies_of(states), file);
  for (std::size_t p = 1; p < clip.people(); ++p) {
    const std::string name = "others/" + std::to_string(p);
    add_joints(name, clip.person(p).avatar.joints, file);
    add_body_motion(name, clip.person(p).avatar.parents, bodies_of(states, p), file);
  }
  if (clip.truth) add_body_motion("truth", clip.avatar.parents, bodies_of(*clip.truth), file);
  if (body != nullptr) add_mesh(*body, file);
  return file;
}

View3d read_view3d(const std::string& path) {
  View3d view;
  view.file = read_file(path);
  const Safetensors arrays = Safetensors::decode(view.file, path);
  arrays.require_format(kView3dFormat, kView3dVersion);
  view.frames = arrays.array("body/translations").require_shape({-1, 3}).size() / 3;
  view.frame_rate = number_in(arrays.text("frame_rate"), path);
  view.has_truth = arrays.has("truth/translations");
  return view;
}

}  // namespace hsi4d
