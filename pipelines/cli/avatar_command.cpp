#include "pipelines/cli/avatar_command.h"

#include <algorithm>
#include <cmath>

#include <CLI/CLI.hpp>

#include "body/avatar_shape.h"
#include "body/motion_edit.h"
#include "body/pose_layout.h"
#include "body/procedural_body.h"
#include "body/smplx_file.h"
#include "core/check.h"
#include "core/log.h"
#include "core/text.h"
#include "pipelines/avatar/import.h"
#include "pipelines/cli/avatar_fit_command.h"
#include "pipelines/cli/info_command.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/body_settings.h"
#include "pipelines/draw/posed_avatar.h"
#include "pipelines/input/body_files.h"
#include "splat/files/info.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {
namespace {

std::vector<double> betas_of(const AvatarOptions& o, const std::string& command) {
  if (o.betas.empty()) return {};
  const std::vector<double> betas = parse_numbers(o.betas, 0, command + "--betas", "apart by commas, as in 0.5,-1");
  for (const double beta : betas) {
    if (std::abs(beta) <= kLargestBeta) continue;
    throw UserError(command + "--betas: " + number_text(beta) + " is out of range; allowed: " + kBetasText);
  }
  return betas;
}

BodyModel body_of(const AvatarOptions& o, const std::vector<double>& betas, const std::string& command) {
  if (o.body_model.empty()) {
    if (std::ssize(betas) > kProceduralBetas) {
      throw UserError(command + "--betas: " + std::to_string(betas.size()) + " numbers; the program's body has " +
                      std::to_string(kProceduralBetas));
    }
    if (const std::string fault = procedural_shape_fault(betas); !fault.empty())
      throw UserError(command + "--betas: " + fault);
    return betas.empty() ? procedural_body() : rest_body(procedural_smplx(std::ssize(betas)), betas);
  }
  const SmplxModel model =
      read_smplx(o.body_model, {.betas = std::ssize(betas), .expressions = 0, .correctives = false});
  warn_of_repairs(model);
  return rest_body(model, betas);
}

void check_out(const AvatarOptions& o, const std::string& command) {
  check_ending(o.out, command + "--out", {".safetensors"});
  check_no_input(o.out, command + "--out", {o.in, o.body_model});
  check_writable(o.out);
  if (!is_gender(o.gender))
    throw UserError(command + "--gender: " + with_escapes(o.gender) + " is not known; allowed: " + kGendersText);
}

void write_shaped(const AvatarOptions& o, const Avatar& avatar, const std::vector<double>& betas) {
  SafetensorsWriter file = avatar_file(avatar);
  add_avatar_shape({avatar.body, betas, o.gender}, file);
  file.write(o.out);
}

/// To the micrometre.
std::string millimetres(double metres) { return short_number(std::round(1e6 * metres) / 1e3) + " mm"; }

std::string percent(Index count, Index all) {
  return short_number(100 * static_cast<double>(count) / static_cast<double>(std::max<Index>(all, 1))) + " %";
}

/// Places of each Gaussian that are used, and how many joints move none.
std::string weights_text(const Avatar& avatar) {
  const Index k = avatar.weights.per_vertex, n = avatar.count();
  std::vector<Index> by_count(static_cast<std::size_t>(k) + 1, 0);
  std::vector<char> moves(static_cast<std::size_t>(avatar.joint_count()), 0);
  for (Index i = 0; i < n; ++i) {
    std::size_t used = 0;
    for (Index at = i * k; at < (i + 1) * k; ++at) {
      if (avatar.weights.weights[static_cast<std::size_t>(at)] == 0) continue;
      ++used;
      moves[static_cast<std::size_t>(avatar.weights.indices[static_cast<std::size_t>(at)])] = 1;
    }
    ++by_count[used];
  }
  std::string text = "up to " + std::to_string(k) + " a Gaussian (";
  for (std::size_t used = 1; used < by_count.size(); ++used)
    text += (used > 1 ? ", " : "") + std::to_string(used) + ": " + percent(by_count[used], n);
  text += ")";
  const auto idle = std::count(moves.begin(), moves.end(), 0);
  return text + "; joints that move none: " + std::to_string(idle);
}

std::string colors_text(const std::optional<ColorNet>& net) {
  if (!net) return "the avatar's own, without a color net";
  std::string widths = std::to_string(net->layers.front().inputs);
  for (const ColorNet::Layer& layer : net->layers) widths += "-" + std::to_string(layer.outputs);
  return "a color net of " + count_text(std::ssize(net->layers), "layer") + " (" + widths +
         "): " + count_text(net->features_per_row, "feature") + " a Gaussian, pose of " +
         count_text(std::ssize(net->code_joints), "joint") + ", " + (net->view_direction ? "with" : "without") +
         " the direction of view";
}

/// What body it is for: motions are put on it accordingly.
std::string body_text(const Avatar& avatar) {
  const Vector3<double> pelvis = pelvis_of(avatar.joints);
  const std::string name = avatar.body == kProceduralName ? "the program's own (procedural)"
                           : avatar.body == kSmplxName    ? "a SMPL-X model, in its person's shape"
                           : avatar.body.empty()          ? "not said; taken for a SMPL-X model in its person's shape"
                                                          : with_escapes(avatar.body);
  return name + "; its pelvis rests at (" + short_number(pelvis[0]) + ", " + short_number(pelvis[1]) + ", " +
         short_number(pelvis[2]) + ") m";
}

std::string person_text(const AvatarShape& shape) {
  std::vector<std::string> numbers;
  for (const double beta : shape.betas) numbers.push_back(short_number(beta));
  return (numbers.empty() ? "the mean one" : "betas " + joined(numbers)) + "; " + shape.gender;
}

std::string skeleton_text(const Avatar& avatar) {
  return count_text(avatar.joint_count(), "joint") +
         (avatar.joint_names == smplx_joint_names() && avatar.parents == smplx_parents() ? " of SMPL-X" : "");
}

}  // namespace

std::string avatar_make_command(const AvatarOptions& o) {
  const std::string command = "hsi4d avatar make: ";
  check_out(o, command);
  const std::vector<double> betas = betas_of(o, command);
  const Avatar avatar = surface_avatar(body_of(o, betas, command), o.settings);
  write_shaped(o, avatar, betas);
  return o.out + ": " + count_text(avatar.count(), "Gaussian") + ", " + skeleton_text(avatar) + "\n";
}

std::string avatar_import_command(const AvatarOptions& o) {
  const std::string command = "hsi4d avatar import: ";
  check_out(o, command);
  const std::vector<double> betas = betas_of(o, command);
  const BodyModel body = body_of(o, betas, command);
  const SplatFile file = read_splats_with_warnings(o.in);
  if (file.report.antialiased)
    log_warning(o.in +
                ": its Gaussians were trained with antialiasing, which an avatar's file cannot say; "
                "render.antialias=true draws them as they were trained");
  const AvatarImport import = import_avatar(file.gaussians, body, o.in);
  write_shaped(o, import.avatar, betas);
  if (import.far > 0)
    log_warning(o.in + ": " + std::to_string(import.far) + " of " + count_text(import.avatar.count(), "Gaussian") +
                " are more than " + short_number(kFarFromBody) + " m from the body, and follow its nearest part");
  if (import.covered < kWellCovered)
    log_warning(o.in + ": only " + short_number(std::round(100 * import.covered)) +
                " % of the body has Gaussians near it: is it in the rest pose, with the arms to the sides?");
  if (import.lost_views)
    log_warning(o.in +
                ": colours vary with the direction of view; an avatar's do not, and keep their part of degree 0");
  return o.out + ": " + count_text(import.avatar.count(), "Gaussian") + ", " + skeleton_text(import.avatar) +
         "; from the surface " + millimetres(import.mean_distance) + " on average, " +
         millimetres(import.largest_distance) + " at most\n";
}

std::string avatar_info_command(const std::string& path) {
  const Avatar avatar = read_avatar(path);
  const GaussianStatistics s = statistics_of(rest_gaussians(avatar));
  std::string text = path + ": avatar of " + count_text(s.count, "Gaussian") + ", " + skeleton_text(avatar) + "\n";
  if (s.count == 0) return text + "  notice   the file holds no Gaussians\n";
  text += "  body     " + body_text(avatar) + "\n";
  if (const std::optional<AvatarShape> shape = read_avatar_shape(path))
    text += "  shape    " + person_text(*shape) + "\n";
  text += "  weights  " + weights_text(avatar) + "\n  colors   " + colors_text(avatar.color_net) + "\n";
  return text + statistics_text(s);
}

void add_avatar(CLI::App& app, Program& program) {
  AvatarOptions& o = program.options<AvatarOptions>();
  CLI::App& command = *app.add_subcommand("avatar", "Make, import, fit the Gaussians of a body, or list what they are");
  command.require_subcommand(1);
  const auto add_body = [&o](CLI::App& sub) {
    sub.add_option("--betas", o.betas, "Shape of the body model: the first betas; the mean shape without")
        ->type_name("B,B,...");
    sub.add_option("--gender", o.gender, "Of the body model, for the file: " + std::string(kGendersText))
        ->capture_default_str()
        ->type_name("WORD");
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
  run_when_chosen(make, program, [&o] { return avatar_make_command(o); });

  CLI::App& bind = *command.add_subcommand("import", "Bind the Gaussians of a file to a body model");
  bind.add_option("PLY", o.in,
                  "Gaussians in the rest pose of the body model, in its frame: " + joined(splat_endings(), " or "))
      ->required();
  bind.add_option("--body-model", o.body_model, "A SMPL-X file; without, the body that comes with the program")
      ->type_name("M.npz");
  add_body(bind);
  run_when_chosen(bind, program, [&o] { return avatar_import_command(o); });

  add_avatar_fit(command, program);

  auto& file = program.options<std::string>();
  CLI::App& info = *command.add_subcommand("info", "Tell what is in an avatar's file");
  info.add_option("FILE", file, "An avatar")->required();
  run_when_chosen(info, program, [&file] { return avatar_info_command(file); });
}

}  // namespace hsi4d::cli
