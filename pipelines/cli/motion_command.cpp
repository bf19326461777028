#include "pipelines/cli/motion_command.h"

#include <algorithm>
#include <filesystem>

#include <CLI/CLI.hpp>

#include "body/glb.h"
#include "body/motion_edit.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/log.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/text.h"
#include "pipelines/input/body_files.h"

namespace hsi4d::cli {
namespace {

bool has_shape(const Motion& motion) {
  return std::any_of(motion.betas.begin(), motion.betas.end(), [](double beta) { return beta != 0; });
}

Motion read_any(const MotionOptions& options, bool& is_of_folder) {
  is_of_folder = std::filesystem::is_directory(options.in);
  if (!is_of_folder) {
    Motion motion = read_motion_with_warnings(options.in);
    if (!options.from_rate && !motion.says_frame_rate)
      log_warning(options.in + ": says no frame rate and is taken for " + short_number(motion.frame_rate) +
                  " frames a second; --from-rate gives another");
    motion.frame_rate = options.from_rate.value_or(motion.frame_rate);
    return motion;
  }
  PoseFolder folder =
      read_pose_folder_with_warnings(options.in, options.from_rate.value_or(kPoseFolderRate), options.person);
  return std::move(folder.motion);
}

/// The motion, moved to the body that it is written for.
struct Prepared {
  Motion motion;
  BodyModel body;  ///< of a GLB file, or --body-model; else empty
};

/// For the body of --body-model, in the motion's shape.
Prepared for_model(const MotionOptions& options, const Motion& motion, bool is_of_folder) {
  const SmplxModel model = read_model_for(options.body_model, options.in, motion.betas);
  const auto count = static_cast<std::size_t>(model.betas);
  BodyModel body = rest_body(model, std::span(motion.betas).first(count));
  Motion moved = for_body(motion, body);
  if (is_of_folder) moved = with_hand_means(moved, model);
  return {std::move(moved), std::move(body)};
}

/// For the program's own body (GLB), or for what reads a .npz: a SMPL-X of the motion's shape. Where that is the mean
/// one, it is known where its pelvis stands.
Prepared for_no_model(const MotionOptions& options, const Motion& motion, bool is_of_folder, bool is_glb) {
  if (is_of_folder)
    log_warning(options.in +
                ": hands are relative to the mean hands of the body model, which are not known without --body-model: "
                "they are taken as they are");
  if (!is_glb) {
    const bool is_mean = motion.pelvis_rest && !has_shape(motion);
    return {is_mean ? for_body(motion, kSmplxName, kSmplxPelvis) : motion, {}};
  }
  if (has_shape(motion))
    log_warning(options.in +
                ": its betas are of SMPL-X and do not shape the program's body; --body-model has a body "
                "that they do");
  BodyModel body = procedural_body();
  return {for_body(motion, body), std::move(body)};
}

Motion at_rate(const Motion& motion, double frame_rate) {
  try {
    return resampled(motion, frame_rate);
  } catch (const UserError& error) {
    throw UserError("hsi4d motion: --frame-rate: " + std::string(error.what()));
  }
}

}  // namespace

std::string motion_command(const MotionOptions& options) {
  const bool is_glb = check_ending(options.out, "hsi4d motion: OUT", {".npz", ".glb"}) == ".glb";
  check_rate(options.from_rate, "hsi4d motion: --from-rate");
  check_rate(options.frame_rate, "hsi4d motion: --frame-rate");
  check_no_input(options.out, "hsi4d motion: OUT", {options.in, options.body_model});
  check_writable(options.out);
  bool is_of_folder = false;
  const Motion read = read_any(options, is_of_folder);
  const Prepared prepared = options.body_model.empty() ? for_no_model(options, read, is_of_folder, is_glb)
                                                       : for_model(options, read, is_of_folder);
  Motion motion = prepared.motion;
  if (options.is_y_up) motion = transformed(motion, z_up_from_y_up(), motion.pelvis_rest.value_or(kSmplxPelvis));
  if (options.frame_rate) motion = at_rate(motion, *options.frame_rate);
  if (is_glb) {
    write_glb(options.out, prepared.body, motion);
  } else {
    write_motion(options.out, motion);
  }
  return options.out + ": " + count_text(std::ssize(motion.poses), "frame") + ", " + short_number(motion.frame_rate) +
         " a second" +
         (motion.first_frame > 0 ? ", from frame " + short_number(motion.first_frame) + " of its video" : "") + "\n";
}

void add_motion(CLI::App& app, Program& program) {
  MotionOptions& motion = program.options<MotionOptions>();
  CLI::App& command = *app.add_subcommand("motion", "Change a motion of a body: frame rate, up axis, format");
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
  run_when_chosen(command, program, [&] { return motion_command(motion); });
}

}  // namespace hsi4d::cli
