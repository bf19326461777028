#include "pipelines/cli/avatar_fit_command.h"

#include "core/check.h"
#include "core/parallel.h"
#include "core/text.h"
#include "pipelines/avatar_fit.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/terminal.h"

namespace hsi4d::cli {

namespace {

std::string line_of(const char* what, const ViewScore& score) {
  return "  " + std::string(what) + ": " + std::to_string(score.views) + " views, PSNR " + rounded(score.psnr_db, 2) +
         " dB, of the human alone " + rounded(score.psnr_foreground_db, 2) + " dB\n";
}

}  // namespace

std::string avatar_fit_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                               const std::filesystem::path& out, bool quiet, const std::vector<LossTerm>& terms) {
  const AvatarFitSettings settings = load_avatar_fit(config, overrides, descriptions_of(terms));
  const ViewSet set = read_view_set(settings.views);
  const InterruptWatch watch;
  AvatarFitResult result;
  with_threads(settings.threads > 0 ? settings.threads : thread_count(),
               [&] { result = fit_avatar(settings, first_avatar(settings), set, terms, observer_on_terminal(quiet)); });
  write_avatar(out.string(), result.avatar);
  std::string text = out.generic_string() + ": " + std::to_string(result.avatar.count()) + " Gaussians, " +
                     std::to_string(result.stage.iterations) + " iterations, loss " + rounded(result.stage.loss, 5) +
                     ", " + rounded(result.stage.seconds, 1) + " s\n" + line_of("learnt", result.learnt);
  if (result.held.views > 0) text += line_of("held back", result.held);
  return text;
}

}  // namespace hsi4d::cli
