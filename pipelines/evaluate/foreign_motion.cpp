#include "pipelines/evaluate/foreign_motion.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/config_value.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "core/text.h"

namespace hsi4d {
namespace {

constexpr double kLargestShear = 1e-3;  // of R Rᵀ − I

/// The mean over frames of where the body's own up points.
Vector3<double> mean_upright(const Motion& motion) {
  Vector3<double> sum = Vector3<double>::Zero();
  for (const BodyPose& pose : motion.poses)
    sum += so3_exp(Vector3<double>(pose.axis_angle.data())) * Vector3<double>(0, 1, 0);
  return sum / static_cast<double>(motion.poses.size());
}

const NpyArray* first_rows_of(const Npz& file, std::initializer_list<const char*> names) {
  for (const char* const name : names) {
    if (file.has(name)) return &file.array(name);
  }
  return nullptr;
}

void require_finite(const NpyArray& array, const std::vector<double>& numbers, std::size_t width) {
  const auto bad = std::find_if(numbers.begin(), numbers.end(), [](double x) { return !std::isfinite(x); });
  if (bad != numbers.end())
    throw DataError(array.source() + ": frame " +
                    std::to_string(static_cast<std::size_t>(bad - numbers.begin()) / width) +
                    " has a number that is not finite");
}

std::vector<double> numbers_of(const NpyArray& array, const std::vector<std::vector<std::int64_t>>& allowed,
                               std::size_t width) {
  if (std::find(allowed.begin(), allowed.end(), array.shape()) == allowed.end())
    throw DataError(array.source() + ": has shape " + shape_text(array.shape()) + "; " + shape_text(allowed.front()) +
                    " is needed");
  std::vector<double> numbers = array.as<double>();
  require_finite(array, numbers, width);
  return numbers;
}

Vector3<double> rotation_vector(const NpyArray& array, const double* rows, std::size_t frame) {
  Matrix3<double> rotation;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) rotation(r, c) = rows[3 * r + c];
  }
  const double shear = (rotation * rotation.transpose() - Matrix3<double>::Identity()).cwiseAbs().maxCoeff();
  const Vector3<double> x = rotation.row(0), y = rotation.row(1), z = rotation.row(2);
  if (!(shear <= kLargestShear) || dot(cross(x, y), z) < 0)
    throw DataError(array.source() + ": frame " + std::to_string(frame) + " is no rotation");
  return so3_log(rotation);
}

/// One object, as CHOIS has it.
std::vector<std::vector<ObjectPose>> read_unnamed(const NpyArray& rotations, const NpyArray& places) {
  const std::int64_t frames = rotations.shape().empty() ? 0 : rotations.shape()[0];
  const std::vector<double> matrices = numbers_of(rotations, {{frames, 3, 3}}, 9);
  const std::vector<double> centres = numbers_of(places, {{frames, 3}, {frames, 3, 1}}, 3);
  std::vector<std::vector<ObjectPose>> poses;
  for (std::size_t t = 0; t < static_cast<std::size_t>(frames); ++t)
    poses.push_back(
        {{rotation_vector(rotations, matrices.data() + 9 * t, t), Vector3<double>(centres.data() + 3 * t)}});
  return poses;
}

/// Files are called by objects' names.
void check_object_name(const std::string& name, const std::string& path) {
  if (!is_file_name(name))
    throw DataError(path + ": has an object called " + json_string(name) + "; allowed: " + kFileNameText);
}

/// The root's rotation in frame 0.
Matrix3<double> first_root(const Motion& motion) {
  return so3_exp(Vector3<double>(motion.poses.front().axis_angle.data()));
}

[[noreturn]] void refuse_camera_frame(const std::string& path, const char* by) {
  throw DataError(path + ": y points down, by " + by +
                  ", as in a camera's frame; a motion in the world is needed (--up z or y says that it is one)");
}

/// By what is up in the frame of the root; nothing where no axis is near to it.
std::optional<UpFinding> up_as_known(const std::string& path, const Motion& motion, const Vector3<double>& upright) {
  const Matrix3<double> root = first_root(motion);
  const double z = dot(Vector3<double>(root.row(2)), upright), y = dot(Vector3<double>(root.row(1)), upright);
  if (std::max(z, std::fabs(y)) < kUprightShare) return std::nullopt;
  if (-y > z && -y > y) refuse_camera_frame(path, "how the body is in frame 0");
  if (y > z) return UpFinding{UpAxis::kY, "y is up, as the body is in frame 0: turned (--up z if it is not)"};
  return UpFinding{UpAxis::kZ, "z is up, as the body is in frame 0"};
}

UpFinding up_by_posture(const std::string& path, const Motion& motion) {
  const Vector3<double> up = mean_upright(motion);
  const double least = kUprightShare * up.norm();
  if (up[1] >= least && up.norm() > 0) return {UpAxis::kY, "y is up, by the posture: turned (--up z if it is not)"};
  if (up[2] >= least && up.norm() > 0) return {UpAxis::kZ, "z is up, by the posture"};
  if (up[1] <= -least && up.norm() > 0) refuse_camera_frame(path, "the posture");
  return {UpAxis::kZ, "z is taken for up: the posture does not tell (--up y if y is)"};
}

/// z, as AMASS has it, unless the body of frame 0 is known to be otherwise. Others use its names for other worlds.
UpFinding up_of_amass(const Motion& motion, const std::optional<UpFinding>& known) {
  if (known) return known->up == UpAxis::kZ ? UpFinding{} : *known;
  const Vector3<double> up = mean_upright(motion);
  if (!(std::fabs(up[1]) >= kUprightShare * up.norm() && up.norm() > 0)) return {};
  return {UpAxis::kZ, std::string("z is taken for up, as in files by AMASS's names, but the body stands along ") +
                          (up[1] < 0 ? "-y, as in a camera's frame" : "y") + " (--up says which)"};
}

}  // namespace

UpFinding find_up(const std::string& path, const Motion& motion, const UpHints& hints) {
  const Npz file = Npz::read(path);
  const bool is_of_amass = file.has("mocap_frame_rate") || file.has("mocap_framerate");
  if (hints.wanted && !(hints.fills_in && is_of_amass))
    return {*hints.wanted, *hints.wanted == UpAxis::kY ? "y is up, as --up says: turned" : ""};
  const std::optional<UpFinding> known = hints.upright ? up_as_known(path, motion, *hints.upright) : std::nullopt;
  if (is_of_amass) return up_of_amass(motion, known);
  return known ? *known : up_by_posture(path, motion);
}

ForeignObjects read_motion_objects(const std::string& path, const std::string& unnamed) {
  const std::string ending = "/rotation";
  const Npz file = Npz::read(path);
  ForeignObjects objects;
  for (const std::string& name : file.names()) {
    if (name.ends_with(ending)) objects.names.push_back(name.substr(0, name.size() - ending.size()));
  }
  for (const std::string& name : objects.names) check_object_name(name, path);
  if (!objects.names.empty()) {
    objects.poses = read_object_tracks(path, objects.names);
    return objects;
  }
  const NpyArray* const rotations = first_rows_of(file, {"obj_rot_mat", "obj_rot"});
  const NpyArray* const centres = first_rows_of(file, {"obj_com_pos", "window_obj_com_pos"});
  const NpyArray* const places = centres == nullptr ? first_rows_of(file, {"obj_trans"}) : centres;
  if (rotations == nullptr && places == nullptr) return objects;
  if (rotations == nullptr || places == nullptr)
    throw DataError((rotations == nullptr ? places : rotations)->source() + ": is there without '" +
                    (rotations == nullptr ? "obj_rot_mat" : "obj_com_pos") + "'");
  objects.are_of_origins = centres == nullptr;
  objects.names = {unnamed};
  objects.poses = read_unnamed(*rotations, *places);
  return objects;
}

}  // namespace hsi4d
