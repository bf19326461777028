#include "pipelines/cli/motion_command.h"

#include <cmath>
#include <filesystem>

#include "body/glb.h"
#include "body/motion_edit.h"
#include "body/procedural_body.h"
#include "core/check.h"
#include "core/log.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/text.h"

namespace hsi4d::cli {
namespace {

constexpr double kFolderRate = 30;

void check_rate(const std::optional<double>& rate, const std::string& option) {
  if (!rate || (*rate > 0 && std::isfinite(*rate))) return;
  throw UserError("hsi4d motion: " + option + ": " + number_text(*rate) + " is out of range; allowed: above 0");
}

/// The body of a model file in the motion's shape, as far as the file has directions for it.
SmplxModel model_for(const std::string& path, const std::vector<double>& betas) {
  const SmplxModel bare = read_smplx(path, {.betas = 0, .expressions = 0, .correctives = false});
  const Index count = std::min<Index>(bare.betas_in_file, static_cast<Index>(betas.size()));
  return count == 0 ? bare : read_smplx(path, {.betas = count, .expressions = 0, .correctives = false});
}

Motion read_any(const MotionOptions& options, bool& is_of_folder) {
  is_of_folder = std::filesystem::is_directory(options.in);
  if (!is_of_folder) {
    Motion motion = read_motion(options.in);
    motion.frame_rate = options.from_rate.value_or(motion.frame_rate);
    return motion;
  }
  PoseFolder folder = read_pose_folder(options.in, options.from_rate.value_or(kFolderRate), options.person);
  if (folder.filled > 0)
    log_warning(options.in + ": frames without a file, interpolated: " + std::to_string(folder.filled));
  return std::move(folder.motion);
}

}  // namespace

std::string motion_command(const MotionOptions& options) {
  const bool is_glb = check_ending(options.out, "hsi4d motion: OUT", {".npz", ".glb"}) == ".glb";
  check_rate(options.from_rate, "--from-rate");
  check_rate(options.frame_rate, "--frame-rate");
  check_no_input(options.out, "hsi4d motion: OUT", {options.in, options.body_model});
  check_writable(options.out);
  bool is_of_folder = false;
  Motion motion = read_any(options, is_of_folder);
  BodyModel body;
  Vector3<double> pelvis = kSmplxPelvis;
  if (!options.body_model.empty()) {
    const SmplxModel model = model_for(options.body_model, motion.betas);
    body = rest_body(model, std::span(motion.betas).first(static_cast<std::size_t>(model.betas)));
    pelvis = {body.joints[0], body.joints[1], body.joints[2]};
    if (is_of_folder) motion = with_hand_means(motion, model);
  } else if (is_glb) {
    body = procedural_body();
  }
  if (options.is_y_up) motion = transformed(motion, z_up_from_y_up(), pelvis);
  if (options.frame_rate) motion = resampled(motion, *options.frame_rate);
  if (is_glb) {
    write_glb(options.out, body, motion);
  } else {
    write_motion(options.out, motion);
  }
  return options.out + ": " + count_text(std::ssize(motion.poses), "frame") + ", " + short_number(motion.frame_rate) +
         " a second\n";
}

}  // namespace hsi4d::cli
