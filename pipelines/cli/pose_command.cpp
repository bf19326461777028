#include "pipelines/cli/pose_command.h"

#include <CLI/CLI.hpp>

#include "body/smplx_sequence.h"
#include "core/check.h"
#include "core/log.h"
#include "core/npz.h"
#include "core/suggest.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/text.h"
#include "pipelines/input/body_files.h"

namespace hsi4d::cli {
namespace {

/// The place of `word` in `known`. Throws UserError that names the option.
std::size_t choice_of(const std::string& word, const std::vector<std::string>& known, const std::string& option) {
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (known[i] == word) return i;
  }
  throw UserError("hsi4d pose: " + option + ": \"" + word + "\" is not known; allowed: " + joined(known) +
                  did_you_mean(word, known));
}

/// The model with as many betas and expressions as the parameters have, which lose those that it has not.
SmplxModel model_for(const std::string& path, SmplxSequence& sequence) {
  const SmplxModel bare = read_smplx(path, {.betas = 0, .expressions = 0, .correctives = false});
  const auto cut = [&](const char* name, SmplxTrack& track, Index there) {
    warn_of_excess(sequence.source, name, track.numbers, track.width, bare, there);
    track = first_numbers(track, there);
  };
  cut("betas", sequence.betas, bare.betas_in_file);
  cut("expression", sequence.expression, bare.expressions_in_file);
  return read_smplx(path, {.betas = sequence.betas.width, .expressions = sequence.expression.width});
}

template <class S>
void write_frames(const PoseOptions& options, const SmplxModel& model, const SmplxSequence& sequence,
                  SmplxHands hands) {
  const SmplxFrames<S> posed = pose_frames<S>(model, sequence, hands, options.flat_hand_mean);
  NpzWriter npz;
  npz.add<S>("vertices", {sequence.frames, model.vertex_count(), 3}, posed.vertices);
  npz.add<S>("joints", {sequence.frames, model.joint_count(), 3}, posed.joints);
  npz.write(options.out);
}

}  // namespace

std::string pose_command(const PoseOptions& options) {
  check_ending(options.out, "hsi4d pose: --out", {".npz"});
  const bool is_double = choice_of(options.precision, {"float", "double"}, "--precision") == 1;
  constexpr SmplxHands kHands[] = {SmplxHands::kByWidth, SmplxHands::kFull, SmplxHands::kPca};
  const SmplxHands hands = kHands[choice_of(options.hands, {"auto", "full", "pca"}, "--hands")];
  check_no_input(options.out, "hsi4d pose: --out", {options.body_model, options.params});
  check_writable(options.out);
  SmplxSequence sequence = read_smplx_sequence(options.params);
  if (!sequence.passed_over.empty())
    log_warning(options.params + ": passed over, no parameters: " + joined(sequence.passed_over));
  const SmplxModel model = model_for(options.body_model, sequence);
  warn_of_repairs(model);
  if (is_double) {
    write_frames<double>(options, model, sequence, hands);
  } else {
    write_frames<float>(options, model, sequence, hands);
  }
  return options.out + ": " + count_text(sequence.frames, "frame") + " of " + std::to_string(model.vertex_count()) +
         " vertices and " + std::to_string(model.joint_count()) + " joints\n";
}

void add_pose(CLI::App& app, Program& program) {
  PoseOptions& pose = program.options<PoseOptions>();
  CLI::App& command = *app.add_subcommand("pose", "Pose an SMPL-X body: vertices and joints of every frame");
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
  run_when_chosen(command, program, [&] { return pose_command(pose); });
}

}  // namespace hsi4d::cli
