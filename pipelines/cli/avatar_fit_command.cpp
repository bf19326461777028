#include "pipelines/cli/avatar_fit_command.h"

#include <CLI/CLI.hpp>

#include "body/avatar_shape.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/parallel.h"
#include "pipelines/avatar/fit.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/run_views.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/config/shipped_configs.h"

namespace hsi4d::cli {

namespace {

constexpr const char* kOut = "hsi4d avatar fit: --out";
constexpr const char* kFromRun = "avatar/from_run.json";

/// Throws UserError when the avatar would replace something that is read, or cannot be written.
void check_fitted_out(const std::string& out, const AvatarFitSettings& settings, const ViewSet& set) {
  std::vector<std::string> inputs = {settings.file.string(), settings.avatar.string(), settings.body.path.string()};
  for (const std::filesystem::path& file : set.files()) inputs.push_back(file.string());
  check_no_input(out, kOut, inputs);
  check_writable(out);
}

/// With the shape of the body that it was made on, where that is known.
void write_fitted(const std::string& out, const Avatar& avatar, const AvatarFitSettings& settings) {
  SafetensorsWriter file = avatar_file(avatar);
  const std::optional<AvatarShape> shape = settings.avatar.empty() ? AvatarShape{avatar.body, settings.body.shape}
                                                                   : read_avatar_shape(settings.avatar.string());
  if (shape) add_avatar_shape(*shape, file);
  file.write(out);
}

std::string line_of(const char* what, const ViewScore& score) {
  std::string line =
      "  " + std::string(what) + ": " + count_text(score.views, "view") + ", PSNR " + rounded(score.psnr_db, 4) + " dB";
  if (score.psnr_foreground_db) line += ", of the human alone " + rounded(*score.psnr_foreground_db, 4) + " dB";
  if (score.silhouette_iou) line += ", silhouette IoU " + rounded(*score.silhouette_iou, 3);
  return line + "\n";
}

/// What is fitted, to what.
struct Fit {
  AvatarFitSettings settings;
  ViewSet set;
};

Fit fit_of_views(const AvatarFitOptions& o, const std::vector<LossTerm>& terms) {
  if (o.config.empty())
    throw UserError(
        "hsi4d avatar fit: neither a config nor --run; allowed: a config that names views, as configs/avatar/fit.json "
        "does with --set views=DIR/views.json, or --run DIR");
  const AvatarFitSettings settings = load_avatar_fit(o.config, o.overrides, descriptions_of(terms));
  return {settings, read_view_set(settings.views)};
}

/// Avatar and render settings are the run's where the config does not say others.
Fit fit_of_run(const AvatarFitOptions& o, const std::vector<LossTerm>& terms) {
  const std::vector<LossDescription> losses = descriptions_of(terms);
  const std::filesystem::path file = o.config.empty() ? kFromRun : o.config;
  ConfigProblems problems;
  ConfigValue tree = o.config.empty() ? load_config_text(shipped_config_texts().at(kFromRun), kFromRun,
                                                         std::filesystem::current_path(), o.overrides, problems)
                                      : load_config(file, o.overrides, problems);
  require_kind(tree, ConfigKind::kAvatarFit, file);
  RunViews views = run_views(o.run, losses);
  tree = merged(std::move(views.settings), std::move(tree));
  const AvatarFitSettings settings = read_avatar_fit(tree, file, losses, problems, false);
  if (!settings.views.empty())
    throw UserError(file.string() + ": /views: " + settings.views.string() +
                    "; with --run the views are the run's frames; leave one of them out");
  return {settings, std::move(views.set)};
}

}  // namespace

std::string avatar_fit_command(const AvatarFitOptions& o, const std::vector<LossTerm>& terms) {
  check_ending(o.out, kOut, {".safetensors"});
  const Fit fit = o.run.empty() ? fit_of_views(o, terms) : fit_of_run(o, terms);
  const AvatarFitSettings& settings = fit.settings;
  check_fitted_out(o.out, settings, fit.set);
  const InterruptWatch watch;
  AvatarFitResult result;
  with_threads(settings.threads > 0 ? settings.threads : thread_count(), [&] {
    result = fit_avatar(settings, first_avatar(settings), fit.set, terms, observer_on_terminal(o.quiet));
  });
  write_fitted(o.out, result.avatar, settings);
  std::string text =
      std::filesystem::path(o.out).generic_string() + ": " + count_text(result.avatar.count(), "Gaussian") + ", " +
      count_text(result.stage.iterations, "iteration") + ", loss " + rounded(result.stage.loss, 5) + ", " +
      rounded(result.stage.seconds, 4) + " s\n" + line_of("before", result.before) + line_of("learnt", result.learnt);
  if (result.held.views > 0) text += line_of("held back", result.held);
  return text;
}

void add_avatar_fit(CLI::App& avatar, Program& program) {
  AvatarFitOptions& a = program.options<AvatarFitOptions>();
  CLI::App& fit = *avatar.add_subcommand("fit", "Learn the look of an avatar from pictures of known poses, or a run");
  fit.add_option(
      "CONFIG", a.config,
      "What is learnt from and how: configs/avatar/fit.json; default with --run: configs/avatar/from_run.json");
  fit.add_option("--run", a.run, "A run that is done: its frames, poses, cameras and avatar are learnt from")
      ->type_name("DIR");
  fit.add_option("--out", a.out, "The avatar's file")->type_name("F.safetensors")->required();
  add_overrides(fit, a.overrides);
  fit.add_flag("--quiet", a.quiet, "No progress on stderr");
  run_when_chosen(fit, program, [&] { return avatar_fit_command(a, program.terms); });
}

}  // namespace hsi4d::cli
