// The state of frame 0, initial.json, and the list of an avatar's pictures, views.json, with what they name.
#include "body/procedural_body.h"
#include "core/config_file.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "pipelines/input/scene_setup.h"
#include "pipelines/input/view_set.h"
#include "splat/files/splat_file.h"
#include "tests/fuzz/scratch.h"
#include "tests/fuzz/splat_scene.h"

namespace hsi4d::fuzz::scene_setup_fuzz {

namespace {

constexpr std::string_view kInitial =
    R"({"motion": "motion.npz", "object_tracks": "",
 "objects": {"ball": {"rotation": [0, 1, 2], "translation": [3, 4, 5]}}})";

constexpr std::string_view kViews =
    R"({"format": "hsi4d views", "version": 1, "motion": "motion.npz", "cameras": "cameras.json",
 "views": [{"image": "a.png", "mask": "a.png", "camera": 0, "frame": 0}, {"image": "a.png", "camera": 0, "frame": 0}]})";

constexpr std::string_view kCameras =
    R"({"width": 3, "height": 2, "fx": 1, "fy": 1, "cx": 1, "cy": 0.5,
 "world_to_camera": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]})";

Bytes motion() {
  NpzWriter file;
  file.add<double>("trans", {1, 3}, {0, 1, 2});
  file.add<float>("poses", {1, 165}, std::vector<float>(165, 0.5F));
  return file.encode();
}

Bytes avatar() {
  AvatarSettings settings;
  settings.gaussians = 4;
  return avatar_file(surface_avatar(procedural_body(), settings)).encode();
}

Scratch& scratch() {
  static Scratch made({{"initial.json", bytes_of(kInitial)}, {"views.json", bytes_of(kViews)}});
  static const bool is_filled = [] {
    write_file(made / "motion.npz", motion());
    write_file(made / "avatar.safetensors", avatar());
    write_file(made / "scene.splat", encode_splats("a.splat", two_gaussians(0)).bytes);
    write_file(made / "cameras.json", bytes_of(kCameras));
    write_file(made / "a.png", encode_image("a.png", Image(3, 2, 3)));
    return true;
  }();
  HSI4D_CHECK(is_filled, "the files beside");
  return made;
}

void read_setup() {
  DataSettings data;
  data.scene = scratch() / "scene.splat";
  data.avatar = scratch() / "avatar.safetensors";
  data.initial = scratch() / "initial.json";
  data.objects.emplace_back("ball", ObjectSettings{scratch() / "scene.splat"});
  read_scene_setup(data);
}

void read_views() {
  const ViewSet set = read_view_set(scratch() / "views.json");
  for (const PosedView& view : set.views) view_image(set, view, Vector3<double>::Zero());
}

}  // namespace

std::vector<Bytes> corpus() { return scratch().corpus(); }

bool accepts(std::span<const uint8_t> file) {
  scratch().try_file(file);
  const bool is_initial = file.empty() || file[0] % 2 == 0;
  return is_read([&] { is_initial ? read_setup() : read_views(); });
}

const Target target("scene_setup", corpus, accepts);

}  // namespace hsi4d::fuzz::scene_setup_fuzz
