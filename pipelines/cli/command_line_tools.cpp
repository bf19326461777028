// Commands on files: of Gaussians, bodies, motions, avatars.
#include <CLI/CLI.hpp>

#include "core/text.h"
#include "pipelines/cli/command_line.h"
#include "pipelines/cli/options.h"

namespace hsi4d::cli {

void CommandLine::add_info() {
  CLI::App* info = app->add_subcommand("info", "Tell what is in a file: Gaussians, arrays, cameras, an image");
  info->add_option("FILE", file,
                   "A .ply, .splat, .spz, .npz, .npy, .safetensors, .json, .png, .jpg, .jpeg or .exr file")
      ->required();
  info->add_flag("--json", json, "Print one JSON object; for Gaussians");
  info->callback([this] { run = [this] { return info_command(file, json); }; });
}

void CommandLine::add_avatar(const std::vector<LossTerm>& terms) {
  AvatarOptions& o = avatar;
  CLI::App& command = *app->add_subcommand("avatar", "Make, import, learn or describe the Gaussians of a body");
  command.require_subcommand(1);
  const auto add_body = [&o](CLI::App& sub) {
    sub.add_option("--betas", o.betas, "Shape of the body model: the first betas; the mean shape without")
        ->type_name("B,B,...");
    sub.add_option("--out", o.out, "The avatar's file")->type_name("F.safetensors")->required();
  };

  CLI::App& make = *command.add_subcommand("make", "Dress a body in Gaussians, spread evenly over its surface");
  make.add_option("--body-model", o.body_model, "A SMPL-X file; without, the body that comes with the program")
      ->type_name("M.npz");
  make.add_option("--gaussians", o.settings.gaussians, "How many; 20,000 to 300,000 are useful")
      ->capture_default_str()
      ->type_name("N");
  make.add_option("--detail", o.settings.detail, "How much denser head, hands and feet are: 0 not at all, to 1")
      ->capture_default_str()
      ->type_name("X");
  make.add_option("--cover", o.settings.cover, "Size along the surface over the distance of neighbours")
      ->capture_default_str()
      ->type_name("X");
  make.add_option("--texture", o.settings.texture, "Contrast of the patterns, 0 to 1")
      ->capture_default_str()
      ->type_name("X");
  make.add_option("--seed", o.settings.seed, "Seed of the places")
      ->capture_default_str()
      ->check(whole_number())
      ->type_name("N");
  add_body(make);
  make.callback([this] { run = [this] { return avatar_make_command(avatar); }; });

  CLI::App& bind = *command.add_subcommand("import", "Bind the Gaussians of a file to a body model");
  bind.add_option("PLY", o.in, "Gaussians in the rest pose of the body model, in its frame: .ply, .splat or .spz")
      ->required();
  bind.add_option("--body-model", o.body_model, "A SMPL-X file; without, the body that comes with the program")
      ->type_name("M.npz");
  add_body(bind);
  bind.callback([this] { run = [this] { return avatar_import_command(avatar); }; });

  CLI::App& fit = *command.add_subcommand("fit", "Learn the look of an avatar from pictures of known poses");
  fit.add_option("CONFIG", config, "What is learnt from and how: configs/avatar/fit.json")->required();
  fit.add_option("--out", o.out, "The avatar's file")->type_name("F.safetensors")->required();
  add_overrides(fit, overrides);
  fit.add_flag("--quiet", quiet, "No progress on stderr");
  fit.callback([this, &terms] {
    run = [this, &terms] { return avatar_fit_command(config, overrides, avatar.out, quiet, terms); };
  });

  CLI::App& info = *command.add_subcommand("info", "Tell what is in an avatar's file");
  info.add_option("FILE", file, "An avatar")->required();
  info.callback([this] { run = [this] { return avatar_info_command(file); }; });
}

void CommandLine::add_convert() {
  ConvertOptions& o = convert;
  CLI::App& command = *app->add_subcommand("convert", "Convert Gaussians between formats: .ply, .splat, .spz");
  command.add_option("IN", o.in, "Gaussians: .ply (INRIA's or compressed), .splat or .spz")->required();
  command.add_option("OUT", o.out, "Where to; the ending says how: .ply, .compressed.ply, .splat or .spz")->required();
  command.add_option("--scale", o.scale, "Multiply lengths, about the origin, first")->type_name("S");
  command.add_option("--rotate", o.rotate, "Turn about the origin, harmonics too: axis times angle in degrees")
      ->type_name("x,y,z");
  command.add_option("--translate", o.translate, "Move, last; metres")->type_name("x,y,z");
  command.add_option("--matrix", o.matrix, "Instead of the three: a 4x4 matrix row by row, 16 numbers apart by commas")
      ->type_name("M");
  command.add_option("--crop", o.crop, "Keep the Gaussians whose means are in this box of IN's coordinates")
      ->type_name("x0,y0,z0,x1,y1,z1");
  command.add_option("--min-opacity", o.min_opacity, "Leave out fainter Gaussians")->type_name("O");
  command.add_option("--sh-degree", o.sh_degree, "Degree of the harmonics, 0 to 3")->type_name("N");
  command.add_option("--spz-version", o.spz_version, "Version of .spz to write: 2, 3 or 4; 3 without")->type_name("N");
  command.add_option("--spz-sh-bits", o.spz_sh_bits, "Bits of harmonics in .spz, degree 1 and above; 8,8 without")
      ->type_name("A,B");
  command.callback([this] { run = [this] { return convert_command(convert); }; });
}

void CommandLine::add_render() {
  CLI::App& command = *app->add_subcommand("render", "Render Gaussians to an image: a scene, objects, a body");
  add_scene(command, render.shared);
  add_several(command, "--object", render.objects, "Gaussians drawn beside the scene, as they lie in their file")
      ->type_name("F.{ply,splat,spz}");
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
  command.callback([this] { run = [this] { return render_command(render); }; });
}

void CommandLine::add_gradients() {
  CLI::App& command = *app->add_subcommand("gradients", "Differentiate the difference of a render from an image");
  add_scene(command, gradients.shared)->required();
  command.add_option("--target", gradients.target, "The image to compare with")
      ->type_name("F.{exr,png,npz}")
      ->required();
  command.add_option("--out", gradients.out, "Where loss and gradients go")->type_name("F.npz")->required();
  command.footer(
      "Gradients are by the file's own numbers, its rows in order. They are 0 for what does not move the image: "
      "rows\n"
      "that the reader leaves out (a number that is not finite, a zero quaternion); log-scales and opacity logits\n"
      "that it holds at -20 or 20; coefficients above render.sh_degree; what the camera does not see.\n"
      "A pixel where alpha is held at render.alpha_cap adds nothing through that alpha, unless\n"
      "render.cap_gradient is pass (render.compatibility=inria makes it so).");
  command.callback([this] { run = [this] { return gradients_command(gradients); }; });
}

void CommandLine::add_pose() {
  CLI::App& command = *app->add_subcommand("pose", "Pose an SMPL-X body: vertices and joints of every frame");
  command.add_option("--body-model", pose.body_model, "The body, a SMPL-X file")->type_name("M.npz")->required();
  command
      .add_option("--params", pose.params,
                  "Its parameters by their names in smplx, [T,n] or [n]; what is not there is zero")
      ->type_name("P.npz")
      ->required();
  command.add_option("--out", pose.out, "Where vertices [T,V,3] and joints [T,J,3] go")->type_name("F.npz")->required();
  command.add_option("--precision", pose.precision, "float or double")->type_name("WORD");
  command
      .add_option("--hands", pose.hands,
                  "What the numbers of a hand are: full, 15 rotations; pca, coefficients of the model's components; "
                  "auto, rotations if there are 45 and else coefficients")
      ->type_name("WORD");
  command.add_flag("--flat-hand-mean", pose.flat_hand_mean,
                   "Hands are flat where their numbers are 0, not in the model's mean pose");
  command.footer(
      "Names: betas, expression, global_orient, body_pose, jaw_pose, leye_pose, reye_pose, left_hand_pose,\n"
      "right_hand_pose, transl. Rotations are axis-angle vectors in radians, lengths metres.");
  command.callback([this] { run = [this] { return pose_command(pose); }; });
}

void CommandLine::add_motion() {
  CLI::App& command = *app->add_subcommand("motion", "Change a motion of a body: frame rate, up axis, format");
  command.add_option("IN", motion.in, "A motion by AMASS's or SMPL-X's names (.npz), or a folder of SMPLer-X's files")
      ->required();
  command.add_option("OUT", motion.out, "A motion (.npz), or the body in motion (.glb)")->required();
  command
      .add_option("--from-rate", motion.from_rate,
                  "Frames a second of IN, instead of what it says; of a folder 30 without")
      ->type_name("HZ");
  command.add_option("--frame-rate", motion.frame_rate, "Frames a second of OUT")->type_name("HZ");
  command.add_flag("--y-up", motion.is_y_up, "IN's world has y up: turn it, about the pelvis");
  command
      .add_option("--body-model", motion.body_model,
                  "The body, a SMPL-X file: where its pelvis is, its mean hands (to which SMPLer-X's add), and what a "
                  "GLB shows; without, the mean SMPL-X pelvis, and the program's own body")
      ->type_name("M.npz");
  command.add_option("--person", motion.person, "Which person of a folder, from 0")
      ->check(whole_number(std::numeric_limits<int>::max()))
      ->type_name("N");
  command.callback([this] { run = [this] { return motion_command(motion); }; });
}

CLI::Option* CommandLine::add_scene(CLI::App& command, SceneOptions& options) {
  CLI::Option* const scene = command.add_option("--scene", options.scene, "Gaussians")->type_name("F.{ply,splat,spz}");
  command.add_option("--camera", options.camera, "A camera, or nerfstudio's transforms.json")
      ->type_name("C.json")
      ->required();
  command.add_option("--camera-frame", options.camera_frame, "Which camera of a file with several, from 0")
      ->check(whole_number())
      ->type_name("I");
  command.add_option("--background", options.background, "Colour behind everything; black without")->type_name("r,g,b");
  command.add_option("--precision", options.precision, "float, double, or reference: brute force in double")
      ->type_name("WORD");
  add_several(command, "--set", options.settings, "Change a setting of the renderer: render.blur=0.1")
      ->type_name("render.KEY=VALUE");
  return scene;
}

}  // namespace hsi4d::cli
