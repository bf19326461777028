#include "pipelines/cli/render_command.h"

#include <filesystem>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/rotation.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/pixel_table.h"
#include "pipelines/cli/text.h"
#include "pipelines/draw/posed_avatar.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/state.h"
#include "splat/files/splat_file.h"
#include "splat/files/transform.h"

namespace hsi4d::cli {
namespace {

void check_render_options(const RenderOptions& options) {
  check_ending(options.out, "hsi4d render: --out", {".png", ".exr", ".npz"});
  if (options.motion.empty() != options.avatar.empty())
    throw UserError(std::string("hsi4d render: ") + (options.motion.empty() ? "--avatar" : "--motion") +
                    " is given without " + (options.motion.empty() ? "--motion" : "--avatar") +
                    "; a body needs both, and --frame");
  if (options.shared.scene.empty() && options.objects.empty() && options.avatar.empty())
    throw UserError("hsi4d render: nothing to draw; give --scene, --object, or --avatar with --motion");
  if (!options.color_net.empty() && options.avatar.empty())
    throw UserError("hsi4d render: --color-net is given without --avatar, whose colours it says");
  if (!options.object_poses.empty() && options.objects.empty())
    throw UserError("hsi4d render: --objects is given without --object; it has poses of objects, not their Gaussians");
  if (options.motion.empty() && options.object_poses.empty() && options.frame != 0)
    throw UserError("hsi4d render: --frame is given without --motion and --avatar, or --objects");
}

/// The element of a sequence that --frame asks for.
template <class T>
const T& at_frame(const std::vector<T>& sequence, int frame, const std::string& file) {
  if (frame < 0 || frame >= static_cast<int>(sequence.size()))
    throw UserError("hsi4d render: --frame: " + file + " has no frame " + std::to_string(frame) + "; allowed: 0 to " +
                    std::to_string(sequence.size() - 1));
  return sequence[static_cast<std::size_t>(frame)];
}

PosedGaussians read_body(const RenderOptions& options, const Vector3<double>& center_world) {
  Avatar avatar = read_avatar(options.avatar);
  if (!options.color_net.empty())
    avatar.color_net = read_color_net(options.color_net, avatar.count(), avatar.joint_count());
  const Motion motion = read_motion_for(options.motion, avatar);
  if (motion.first_frame != 0)
    log_warning(options.motion + ": begins with frame " + number_text(motion.first_frame) +
                " of its video; --frame counts its poses, from 0");
  const BodyPose& pose = at_frame(motion.poses, options.frame, options.motion);
  if (pose.joints() != avatar.joint_count())
    throw DataError(options.avatar + ": the avatar has " + std::to_string(avatar.joint_count()) +
                    " joints; the poses of " + options.motion + " have " + std::to_string(pose.joints()));
  return posed_avatar(avatar, pose, &center_world);
}

Vector3<double> centroid_world(const Gaussians& gaussians) {
  Vector3<double> sum = Vector3<double>::Zero();
  for (Index i = 0; i < gaussians.count(); ++i) sum += Vector3<float>(gaussians.means.data() + 3 * i).cast<double>();
  return gaussians.origin_world + sum / static_cast<double>(gaussians.count());
}

/// Where a pose of a run puts an object, which is relative to the centroid of its means.
PosedGaussians placed(const Gaussians& object, const ObjectPose& pose) {
  if (object.count() == 0) return {object, {}};
  Similarity move;
  move.rotation = so3_exp(pose.rotation);
  move.translation = pose.translation - move.rotation * centroid_world(object);
  PosedGaussians posed{transformed(object, move), {}};
  // Parts of one image share an origin, so that the way from it to the object is a transform of the Gaussians.
  const Vector3<double> way = posed.gaussians.origin_world - object.origin_world;
  posed.gaussians.origin_world = object.origin_world;
  for (Index n = 0; n < object.count(); ++n)
    posed.transforms.insert(posed.transforms.end(), {1, 0, 0, way[0], 0, 1, 0, way[1], 0, 0, 1, way[2]});
  return posed;
}

/// What is drawn: parts, one after the other, and the rows of each.
struct Parts {
  std::vector<PosedGaussians> gaussians;
  std::vector<FileRows> rows;

  void add(const std::string& file, PosedGaussians part, std::vector<Index> row_of = {}) {
    const Index begin = rows.empty() ? 0 : rows.back().end;
    rows.push_back({file, begin, begin + part.gaussians.count(), std::move(row_of)});
    gaussians.push_back(std::move(part));
  }
  void add_file(const std::string& path, const RenderSettings& settings) {
    SplatFile file = read_drawn(path, settings);
    add(path, {std::move(file.gaussians), {}}, std::move(file.report.row_of));
  }
};

void add_objects(const RenderOptions& options, const RenderSettings& settings, Parts& parts) {
  std::vector<std::string> names;
  for (const std::string& object : options.objects) {
    parts.add_file(object, settings);
    names.push_back(std::filesystem::path(object).stem().string());
  }
  if (options.object_poses.empty()) return;
  const auto frames = read_object_tracks(options.object_poses, names);
  const std::vector<ObjectPose>& poses = at_frame(frames, options.frame, options.object_poses);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    PosedGaussians& part = parts.gaussians[parts.gaussians.size() - poses.size() + i];
    part = placed(part.gaussians, poses[i]);
  }
}

/// Scene, objects and body, as far as they are given.
Parts read_all(const RenderOptions& options, const SceneView& view) {
  Parts parts;
  if (!options.shared.scene.empty()) parts.add_file(options.shared.scene, view.settings);
  add_objects(options, view.settings, parts);
  if (!options.motion.empty()) parts.add(options.avatar, read_body(options, camera_center_world(view.camera)));
  return parts;
}

void write_npz(const std::string& path, const SceneImage& rendered, Precision precision) {
  NpzWriter npz;
  const std::int64_t height = rendered.height, width = rendered.width;
  add_numbers(npz, precision, "image", {height, width, 3}, rendered.image);
  add_numbers(npz, precision, "alpha", {height, width}, rendered.alpha);
  add_numbers(npz, precision, "depth", {height, width}, rendered.depth);
  npz.write(path);
}

void write_picture(const std::string& path, const SceneImage& rendered) {
  const std::vector<float> values(rendered.image.begin(), rendered.image.end());
  write_image(path, from_interleaved(values, rendered.height, rendered.width, 3));
}

}  // namespace

std::string render_command(const RenderOptions& options) {
  check_render_options(options);
  const SceneView view = view_of(options.shared, "hsi4d render");
  std::vector<PixelPlace> pixels;
  for (const std::string& pixel : options.pixels)
    pixels.push_back(parse_pixel(pixel, view.camera, "hsi4d render: --debug-pixel"));
  std::vector<std::string> inputs = options.objects;
  inputs.insert(inputs.end(), {options.shared.scene, options.shared.camera, options.object_poses, options.motion,
                               options.avatar, options.color_net});
  check_no_input(options.out, "hsi4d render: --out", inputs);
  check_writable(options.out);
  Parts parts = read_all(options, view);
  const PosedGaussians scene =
      parts.gaussians.size() == 1 ? std::move(parts.gaussians.front()) : concatenated(parts.gaussians);
  const Index count = scene.gaussians.count();
  const bool arrays = check_ending(options.out, "hsi4d render: --out", {".png", ".exr", ".npz"}) == ".npz";
  std::string text;
  std::optional<Index> drawn;
  if (arrays || !pixels.empty()) {
    const SceneImage rendered = render_scene(scene, view, pixels);
    if (arrays) {
      write_npz(options.out, rendered, view.precision);
    } else {
      write_picture(options.out, rendered);
    }
    warn_if_nothing_drawn(shows_something(rendered), scene.gaussians, view.settings.alpha_min);
    for (const PixelTrace& trace : rendered.traces) text += pixel_table(trace, rendered, view, parts.rows) + "\n";
    drawn = rendered.drawn;
  } else {
    const ScenePicture picture = render_picture(scene, view);
    write_image(options.out, picture.image);
    warn_if_nothing_drawn(picture.shows_something, scene.gaussians, view.settings.alpha_min);
    drawn = picture.drawn;
  }
  return text + options.out + ": " + std::to_string(view.camera.width) + " x " + std::to_string(view.camera.height) +
         " pixels of " + count_text(count, "Gaussian") +
         (drawn ? ", " + std::to_string(*drawn) + " of them drawn" : "") + "\n";
}

void add_render(CLI::App& app, Program& program) {
  RenderOptions& render = program.options<RenderOptions>();
  CLI::App& command = *app.add_subcommand("render", "Render Gaussians to an image: a scene, objects, a body");
  add_scene(command, render.shared);
  add_several(command, "--object", render.objects, "Gaussians drawn beside the scene, as they lie in their file")
      ->type_name(splat_type_name());
  command
      .add_option("--objects", render.object_poses,
                  "Poses of a run's objects: each --object NAME.ply is drawn where NAME is in --frame")
      ->type_name("O.npz");
  command.add_option("--motion", render.motion, "Motion of a body that is drawn too")->type_name("M.npz");
  command.add_option("--frame", render.frame, "Frame of motion and objects, from 0")
      ->check(whole_number())
      ->type_name("I");
  command.add_option("--avatar", render.avatar, "Gaussians of the body")->type_name("F.safetensors");
  command
      .add_option("--color-net", render.color_net,
                  "What colours the body in place of the avatar's own: a run's color_net.safetensors")
      ->type_name("F.safetensors");
  add_several(command, "--debug-pixel", render.pixels,
              "Print the Gaussians that make the pixel of column X and row Y, front to back, what was skipped, where "
              "it stopped, and the sums")
      ->type_name("X,Y");
  command.add_option("--out", render.out, "Where to: 8-bit PNG, OpenEXR, or arrays image, alpha, depth")
      ->type_name("F.{png,exr,npz}")
      ->required();
  run_when_chosen(command, program,
                  [&] { return run_on_threads(render.shared, [&] { return render_command(render); }); });
}

}  // namespace hsi4d::cli
