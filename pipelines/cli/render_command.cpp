#include "pipelines/cli/render_command.h"

#include <algorithm>

#include "body/motion_io.h"
#include "core/check.h"
#include "core/image_io.h"
#include "pipelines/posed_avatar.h"

namespace hsi4d::cli {
namespace {

void check_options(const RenderOptions& options) {
  check_ending(options.out, "hsi4d render: --out", {".png", ".exr", ".npz"});
  if (options.motion.empty() != options.avatar.empty())
    throw UserError(std::string("hsi4d render: ") + (options.motion.empty() ? "--avatar" : "--motion") +
                    " is given without " + (options.motion.empty() ? "--motion" : "--avatar") +
                    "; a body needs both, and --frame");
  if (options.motion.empty() && options.frame != 0)
    throw UserError("hsi4d render: --frame is given without --motion and --avatar");
}

PosedGaussians read_body(const RenderOptions& options) {
  const Motion motion = read_motion(options.motion);
  const auto frames = static_cast<int>(motion.poses.size());
  if (options.frame < 0 || options.frame >= frames)
    throw UserError("hsi4d render: --frame: " + options.motion + " has no frame " + std::to_string(options.frame) +
                    "; allowed: 0 to " + std::to_string(frames - 1));
  const Avatar avatar = read_avatar(options.avatar);
  const BodyPose& pose = motion.poses[static_cast<std::size_t>(options.frame)];
  if (pose.joints() != avatar.joint_count())
    throw DataError(options.avatar + ": the avatar has " + std::to_string(avatar.joint_count()) +
                    " joints; the poses of " + options.motion + " have " + std::to_string(pose.joints()));
  return posed_avatar(avatar, pose);
}

/// Scene, objects and body, one after the other.
PosedGaussians read_all(const RenderOptions& options) {
  std::vector<PosedGaussians> parts;
  parts.push_back({read_scene(options.shared.scene).gaussians, {}});
  for (const std::string& object : options.objects) parts.push_back({read_scene(object).gaussians, {}});
  if (!options.motion.empty()) parts.push_back(read_body(options));
  return parts.size() == 1 ? std::move(parts.front()) : concatenated(parts);
}

void write_npz(const std::string& path, const SceneImage& rendered, Precision precision) {
  NpzWriter npz;
  const std::int64_t height = rendered.height, width = rendered.width;
  add_numbers(npz, precision, "image", {height, width, 3}, rendered.image);
  add_numbers(npz, precision, "alpha", {height, width}, rendered.alpha);
  add_numbers(npz, precision, "depth", {height, width}, rendered.depth);
  npz.write(path);
}

}  // namespace

std::string render_command(const RenderOptions& options) {
  check_options(options);
  const SceneView view = view_of(options.shared, "hsi4d render");
  check_writable(options.out);
  const PosedGaussians scene = read_all(options);
  const SceneImage rendered = render_scene(scene, view);
  if (check_ending(options.out, "hsi4d render: --out", {".png", ".exr", ".npz"}) == ".npz") {
    write_npz(options.out, rendered, view.precision);
  } else {
    const std::vector<float> values(rendered.image.begin(), rendered.image.end());
    write_image(options.out, from_interleaved(values, rendered.height, rendered.width, 3));
  }
  return options.out + ": " + std::to_string(rendered.width) + " x " + std::to_string(rendered.height) + " pixels of " +
         std::to_string(scene.gaussians.count()) + " Gaussians\n";
}

}  // namespace hsi4d::cli
