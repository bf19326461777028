// Files of avatars and of motions.
#include <string>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "core/npz.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz {

namespace {

Bytes small_avatar() {
  Avatar a;
  a.means = {0, 1, 2};
  a.quats = {1, 0, 0, 0};
  a.log_scales = {-4, -4, -5};
  a.opacity_logits = {1};
  a.colors = {0.5F, 0.5F, 0.5F};
  a.weights = {1, 2, 2, {0, 1}, {0.75, 0.25}};
  a.parents = {-1, 0};
  a.joints = {0, 0, 0, 0, 1, 0};
  a.joint_names = {"root", "tip"};
  return avatar_file(a).encode();
}

Bytes first_avatar() {
  NpzWriter file;
  file.add_text("format", "hsi4d avatar");
  file.add_scalar<std::int32_t>("version", 1);
  file.add<float>("means", {1, 3}, {0, 1, 2});
  file.add<float>("quats", {1, 4}, {1, 0, 0, 0});
  file.add<float>("log_scales", {1, 3}, {-4, -4, -5});
  file.add<float>("opacity_logits", {1}, {1});
  file.add<float>("colors", {1, 3}, {0.5, 0.5, 0.5});
  file.add<std::int32_t>("weight_indices", {1, 2}, {0, 1});
  file.add<double>("weights", {1, 2}, {0.75, 0.25});
  file.add<std::int32_t>("parents", {2}, {-1, 0});
  file.add<double>("joints", {2, 3}, {0, 0, 0, 0, 1, 0});
  const std::vector<std::string> names = {"root", "tip"};
  file.add_texts("joint_names", names);
  return file.encode();
}

Bytes small_motion(bool whole) {
  NpzWriter file;
  file.add<double>("trans", {1, 3}, {0, 1, 2});
  if (whole) {
    file.add<double>("poses", {1, 72}, std::vector<double>(72, 0.5));
  } else {
    file.add<float>("root_orient", {1, 3}, {0, 1, 2});
    file.add<float>("pose_body", {1, 63}, std::vector<float>(63, 0.25F));
  }
  file.add_scalar("mocap_frame_rate", 30.0);
  return file.encode();
}

}  // namespace

std::vector<Bytes> corpus() { return {small_avatar(), first_avatar(), small_motion(true), small_motion(false)}; }

bool accepts(std::span<const uint8_t> file) {
  const bool avatar = is_read([&] { check_sizes(decode_avatar(file, "fuzz")); });
  const bool motion = is_read([&] { decode_motion(file, "fuzz.npz"); });
  return avatar || motion;
}

}  // namespace hsi4d::fuzz
