#include "pipelines/cli/avatar_fit_command.h"

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "pipelines/avatar/fit.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"

namespace hsi4d::cli {

namespace {

struct AvatarFitArguments {
  std::string config;
  std::vector<std::string> overrides;
  std::string out;
  bool quiet = false;
};

constexpr const char* kOut = "hsi4d avatar fit: --out";

/// Throws UserError when the avatar would replace something that is read, or cannot be written.
void check_fitted_out(const std::string& out, const AvatarFitSettings& settings, const ViewSet& set) {
  std::vector<std::string> inputs = {settings.file.string(), settings.avatar.string(), settings.body.path.string()};
  for (const std::filesystem::path& file : set.files()) inputs.push_back(file.string());
  check_no_input(out, kOut, inputs);
  check_writable(out);
}

std::string line_of(const char* what, const ViewScore& score) {
  std::string line =
      "  " + std::string(what) + ": " + count_text(score.views, "view") + ", PSNR " + rounded(score.psnr_db, 4) + " dB";
  if (score.psnr_foreground_db) line += ", of the human alone " + rounded(*score.psnr_foreground_db, 4) + " dB";
  return line + "\n";
}

}  // namespace

std::string avatar_fit_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                               const std::filesystem::path& out, bool quiet, const std::vector<LossTerm>& terms) {
  check_ending(out.string(), kOut, {".safetensors"});
  const AvatarFitSettings settings = load_avatar_fit(config, overrides, descriptions_of(terms));
  const ViewSet set = read_view_set(settings.views);
  check_fitted_out(out.string(), settings, set);
  const InterruptWatch watch;
  AvatarFitResult result;
  with_threads(settings.threads > 0 ? settings.threads : thread_count(),
               [&] { result = fit_avatar(settings, first_avatar(settings), set, terms, observer_on_terminal(quiet)); });
  write_avatar(out.string(), result.avatar);
  std::string text = out.generic_string() + ": " + count_text(result.avatar.count(), "Gaussian") + ", " +
                     count_text(result.stage.iterations, "iteration") + ", loss " + rounded(result.stage.loss, 5) +
                     ", " + rounded(result.stage.seconds, 4) + " s\n" + line_of("learnt", result.learnt);
  if (result.held.views > 0) text += line_of("held back", result.held);
  return text;
}

void add_avatar_fit(CLI::App& avatar, Program& program) {
  AvatarFitArguments& a = program.options<AvatarFitArguments>();
  CLI::App& fit = *avatar.add_subcommand("fit", "Learn the look of an avatar from pictures of known poses");
  fit.add_option("CONFIG", a.config, "What is learnt from and how: configs/avatar/fit.json")->required();
  fit.add_option("--out", a.out, "The avatar's file")->type_name("F.safetensors")->required();
  add_overrides(fit, a.overrides);
  fit.add_flag("--quiet", a.quiet, "No progress on stderr");
  run_when_chosen(fit, program,
                  [&] { return avatar_fit_command(a.config, a.overrides, a.out, a.quiet, program.terms); });
}

}  // namespace hsi4d::cli
