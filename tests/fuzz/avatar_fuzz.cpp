// Files of avatars, in both formats, and of color nets.
#include "body/avatar.h"
#include "body/avatar_shape.h"
#include "core/npz.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::avatar_fuzz {

namespace {

Avatar small_avatar() {
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
  return a;
}

Bytes avatar_with_shape() {
  Avatar a = small_avatar();
  a.body = "smplx";
  SafetensorsWriter file = avatar_file(a);
  add_avatar_shape({a.body, {0.5, -1}, "female"}, file);
  return file.encode();
}

Bytes avatar_with_net() {
  Avatar a = small_avatar();
  a.color_net = new_color_net(a.means, a.joint_count(), {2, 3, 1, true, 0});
  return avatar_file(a).encode();
}

/// The format of the first version.
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

}  // namespace

std::vector<Bytes> corpus() {
  return {avatar_file(small_avatar()).encode(), avatar_with_net(), avatar_with_shape(), first_avatar(),
          list_of(first_avatar())};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const auto bytes = archive_of(file);
    check_sizes(decode_avatar(bytes, "fuzz"));
    if (looks_like_safetensors(bytes)) avatar_shape_of(Safetensors::decode(bytes, "fuzz"));
  });
}

const Target target("avatar", corpus, accepts);

}  // namespace hsi4d::fuzz::avatar_fuzz
