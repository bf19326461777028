#include "body/avatar.h"

#include "body/file_contents.h"
#include "core/finite_numbers.h"
#include "core/gather.h"
#include "core/npz.h"

namespace hsi4d {

namespace {

constexpr const char* kAvatarFormat = "hsi4d avatar";

// Files are Safetensors or, of version 1, Npz.

void check_first_format(const Npz& file) {
  refuse_other_contents(file, {"an avatar"});
  if (!file.has("format")) throw DataError(file.source() + ": there is no array 'format'; this is no avatar");
  const std::string format = file.array("format").text();
  if (format != kAvatarFormat)
    throw DataError(file.source() + ": the format is '" + format + "'; allowed: '" + kAvatarFormat + "'");
  const auto version = file.array("version").scalar<int64_t>();
  if (version == 1) return;
  throw DataError(file.source() + ": the format's version is " + std::to_string(version) +
                  "; allowed in a .npz file: 1");
}

std::vector<std::string> joint_names_of(const Safetensors& file, Index joints) {
  std::vector<std::string> names = file.texts("joint_names");
  if (static_cast<Index>(names.size()) == joints) return names;
  throw DataError(file.source() + ": metadata 'joint_names' has " + std::to_string(names.size()) + " names; " +
                  std::to_string(joints) + " are needed, one a joint");
}

std::vector<std::string> joint_names_of(const Npz& file, Index joints) {
  return file.array("joint_names").require_shape({joints}).strings();
}

void check_quaternions(const NpyArray& array, const std::vector<float>& quats) {
  for (std::size_t i = 0; i < quats.size(); i += 4) {
    if (quats[i] != 0 || quats[i + 1] != 0 || quats[i + 2] != 0 || quats[i + 3] != 0) continue;
    throw DataError(array.source() + ": row " + std::to_string(i / 4) + " is zero, which is no rotation");
  }
}

template <class File>
void read_skeleton(const File& file, Avatar& avatar) {
  const NpyArray& parents = file.array("parents");
  avatar.parents = parents.require_shape({-1}).as<std::int32_t>();
  const std::string fault = tree_fault(avatar.parents);
  if (!fault.empty()) throw DataError(parents.source() + ": " + fault);
  avatar.joints = finite_numbers<double>(file.array("joints"), {avatar.joint_count(), 3});
  avatar.joint_names = joint_names_of(file, avatar.joint_count());
}

template <class File>
void read_weights(const File& file, Index count, Avatar& avatar) {
  const NpyArray& indices = file.array("weight_indices");
  const int64_t per_gaussian = indices.require_shape({count, -1}).shape()[1];
  if (per_gaussian < 1 || per_gaussian > kMaxWeightsPerVertex) {
    throw DataError(indices.source() + ": has shape " + shape_text(indices.shape()) +
                    "; allowed: 1 to 8 weights a Gaussian");
  }
  const NpyArray& weights = file.array("weights");
  avatar.weights = normalized_weights({count, avatar.joint_count(), per_gaussian, indices.as<std::int32_t>(),
                                       weights.require_shape({count, per_gaussian}).as<double>()},
                                      weights.source());
}

template <class File>
Avatar avatar_in(const File& file) {
  Avatar avatar;
  avatar.means = finite_numbers<float>(file.array("means"), {-1, 3});
  const int64_t count = file.array("means").shape()[0];
  avatar.quats = finite_numbers<float>(file.array("quats"), {count, 4});
  check_quaternions(file.array("quats"), avatar.quats);
  avatar.log_scales = finite_numbers<float>(file.array("log_scales"), {count, 3});
  avatar.opacity_logits = finite_numbers<float>(file.array("opacity_logits"), {count});
  avatar.colors = finite_numbers<float>(file.array("colors"), {count, 3});
  read_skeleton(file, avatar);
  read_weights(file, count, avatar);
  return avatar;
}

}  // namespace

PosedJoints pose_skeleton(const Avatar& avatar, const BodyPose& pose) {
  return pose_skeleton(avatar.parents, avatar.joints, pose);
}

std::vector<double> pose_joints(const Avatar& avatar, const BodyPose& pose) {
  return pose_joints(avatar.parents, avatar.joints, pose);
}

void check_sizes(const Avatar& avatar) {
  const std::size_t n = avatar.opacity_logits.size(), j = avatar.parents.size();
  HSI4D_CHECK_EQ(avatar.means.size(), 3 * n);
  HSI4D_CHECK_EQ(avatar.quats.size(), 4 * n);
  HSI4D_CHECK_EQ(avatar.log_scales.size(), 3 * n);
  HSI4D_CHECK_EQ(avatar.colors.size(), 3 * n);
  HSI4D_CHECK_EQ(avatar.weights.vertices, avatar.count());
  HSI4D_CHECK_EQ(avatar.weights.joints, avatar.joint_count());
  HSI4D_CHECK_EQ(static_cast<Index>(avatar.weights.indices.size()), avatar.count() * avatar.weights.per_vertex);
  HSI4D_CHECK_EQ(static_cast<Index>(avatar.weights.weights.size()), avatar.count() * avatar.weights.per_vertex);
  HSI4D_CHECK_EQ(avatar.joints.size(), 3 * j);
  HSI4D_CHECK_EQ(avatar.joint_names.size(), j);
  const std::string fault = tree_fault(avatar.parents);
  HSI4D_CHECK(fault.empty(), fault);
  if (!avatar.color_net) return;
  check_sizes(*avatar.color_net);
  HSI4D_CHECK_EQ(avatar.color_net->rows, avatar.count());
}

Avatar selected(const Avatar& avatar, std::span<const Index> rows) {
  check_sizes(avatar);
  Avatar out = avatar;
  out.means = gathered(avatar.means, rows, 3);
  out.quats = gathered(avatar.quats, rows, 4);
  out.log_scales = gathered(avatar.log_scales, rows, 3);
  out.opacity_logits = gathered(avatar.opacity_logits, rows, 1);
  out.colors = gathered(avatar.colors, rows, 3);
  out.weights.vertices = std::ssize(rows);
  out.weights.indices = gathered(avatar.weights.indices, rows, avatar.weights.per_vertex);
  out.weights.weights = gathered(avatar.weights.weights, rows, avatar.weights.per_vertex);
  if (avatar.color_net) out.color_net = selected(*avatar.color_net, rows);
  return out;
}

Avatar avatar_of(const Safetensors& file) {
  file.require_format(kAvatarFormat, kAvatarVersion);
  Avatar avatar = avatar_in(file);
  if (file.metadata().contains("body")) avatar.body = file.text("body");
  avatar.color_net = color_net_of(file, avatar.count(), avatar.joint_count());
  return avatar;
}

Avatar decode_avatar(std::span<const std::uint8_t> file, const std::string& name) {
  const bool is_archive = file.size() > 1 && file[0] == 'P' && file[1] == 'K' && !looks_like_safetensors(file);
  if (!is_archive) return avatar_of(Safetensors::decode(file, name));
  const Npz archive = Npz::decode(file, name);
  check_first_format(archive);
  return avatar_in(archive);
}

Avatar read_avatar(const std::string& path) { return decode_avatar(read_file(path), path); }

SafetensorsWriter avatar_file(const Avatar& avatar) {
  check_sizes(avatar);
  SafetensorsWriter file(kAvatarFormat, kAvatarVersion);
  const int64_t n = avatar.count(), k = avatar.weights.per_vertex, j = avatar.joint_count();
  file.add<float>("means", {n, 3}, avatar.means);
  file.add<float>("quats", {n, 4}, avatar.quats);
  file.add<float>("log_scales", {n, 3}, avatar.log_scales);
  file.add<float>("opacity_logits", {n}, avatar.opacity_logits);
  file.add<float>("colors", {n, 3}, avatar.colors);
  file.add<std::int32_t>("weight_indices", {n, k}, avatar.weights.indices);
  file.add<double>("weights", {n, k}, avatar.weights.weights);
  file.add<std::int32_t>("parents", {j}, avatar.parents);
  file.add<double>("joints", {j, 3}, avatar.joints);
  file.set_texts("joint_names", avatar.joint_names);
  if (!avatar.body.empty()) file.set_text("body", avatar.body);
  if (avatar.color_net) add_color_net(*avatar.color_net, file);
  return file;
}

void write_avatar(const std::string& path, const Avatar& avatar) { avatar_file(avatar).write(path); }

}  // namespace hsi4d
