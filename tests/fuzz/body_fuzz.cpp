// Files of avatars, motions, SMPL-X parameters and VPoser weights.
#include <string>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "body/smplx_sequence.h"
#include "body/vposer.h"
#include "core/npz.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz {

namespace {

Bytes small_avatar(bool with_net) {
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
  if (with_net) a.color_net = new_color_net(a.means, a.joint_count(), {2, 3, 1, true, 0});
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

Bytes small_parameters() {
  NpzWriter file;
  file.add<float>("body_pose", {21, 3}, std::vector<float>(63, 0.5F));
  file.add<float>("left_hand_pose", {2, 6}, std::vector<float>(12, 0.5F));
  file.add<double>("betas", {10}, std::vector<double>(10, 1));
  return file.encode();
}

/// One neuron, one latent.
Bytes small_vposer() {
  NpzWriter file;
  const auto add = [&](const std::string& name, std::int64_t rows, std::int64_t columns) {
    const std::vector<float> numbers(static_cast<std::size_t>(rows * columns), 0.5F);
    file.add<float>(name + ".weight", {rows, columns}, numbers);
    file.add<float>(name + ".bias", {rows}, std::vector<float>(static_cast<std::size_t>(rows), 0.25F));
  };
  add("encoder_net.2", 1, 63);
  add("encoder_net.6", 1, 1);
  add("encoder_net.7", 1, 1);
  add("encoder_net.8.mu", 1, 1);
  add("decoder_net.0", 1, 1);
  add("decoder_net.3", 1, 1);
  add("decoder_net.5", 126, 1);
  for (const auto& [name, count] : {std::pair{"encoder_net.1.", 63}, std::pair{"encoder_net.4.", 1}}) {
    for (const char* part : {"weight", "bias", "running_mean", "running_var"}) {
      file.add<float>(std::string(name) + part, {count}, std::vector<float>(static_cast<std::size_t>(count), 0.5F));
    }
  }
  return file.encode();
}

}  // namespace

std::vector<Bytes> corpus() {
  return {small_avatar(false), small_avatar(true), first_avatar(), small_motion(true),
          small_motion(false), small_parameters(), small_vposer()};
}

bool accepts(std::span<const uint8_t> file) {
  const bool avatar = is_read([&] { check_sizes(decode_avatar(file, "fuzz")); });
  const bool motion = is_read([&] { decode_motion(file, "fuzz.npz"); });
  const bool parameters = is_read([&] { decode_smplx_sequence(file, "fuzz.npz"); });
  const bool network = is_read([&] { decode_vposer(file, "fuzz.npz"); });
  return avatar || motion || parameters || network;
}

}  // namespace hsi4d::fuzz
