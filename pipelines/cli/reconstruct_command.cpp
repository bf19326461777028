// `hsi4d reconstruct`: Gaussians of a scene or an object from pictures whose cameras are known.
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/formatted.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/text.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/scan/scan.h"

namespace hsi4d::cli {

namespace {

struct ReconstructArguments {
  std::string config;
  std::vector<std::string> overrides;
  std::string out;
  std::optional<int> threads;
  bool resume = false;
  bool quiet = false;
};

std::string line_of(const char* what, const ScanScore& score) {
  if (score.pictures == 0) return "";
  return "  " + std::string(what) + ": " + count_text(score.pictures, "picture") + ", PSNR " +
         fixed_number(score.psnr_db, 2) + " dB, SSIM " + fixed_number(score.ssim, 4) + "\n";
}

/// Makes Gaussians in a new folder, or goes on with what is in it. Returns what the command prints.
/// Throws as load_scan and run_scan.
std::string reconstruct_command(const ReconstructArguments& a, const std::vector<LossTerm>& losses) {
  const ScanSettings settings = load_scan(a.config, a.overrides, descriptions_of(losses));
  const int threads = a.threads.value_or(settings.threads);
  const InterruptWatch watch;
  ScanSummary summary;
  with_threads(threads > 0 ? threads : thread_count(),
               [&] { summary = run_scan(settings, a.out, a.resume, losses, observer_on_terminal(a.quiet)); });
  return scan_result(settings, a.out).generic_string() + ": " + count_text(summary.gaussians, "Gaussian") + ", " +
         count_text(summary.iterations, "iteration") + " in " + duration_text(summary.seconds) + "\n" +
         line_of("learnt from", summary.learnt) + line_of("held back", summary.held) + "  " +
         (std::filesystem::path(a.out) / "report.html").generic_string() + "\n";
}

}  // namespace

void add_reconstruct(CLI::App& app, Program& program) {
  ReconstructArguments& a = program.options<ReconstructArguments>();
  CLI::App* command = app.add_subcommand(
      "reconstruct", "Make Gaussians of a scene or an object from pictures with cameras, or from a mesh");
  command->add_option("CONFIG", a.config, "The config; configs/reconstruct/ has some")->required();
  command->add_option("--out", a.out, "Where to: a new or empty folder")->type_name("DIR")->required();
  command->add_flag("--resume", a.resume, "Go on with what was begun in --out, to the same bits");
  add_overrides(*command, a.overrides);
  add_threads(*command, a.threads);
  command->add_flag("--quiet", a.quiet, "No progress on stderr");
  run_when_chosen(*command, program, [&] { return reconstruct_command(a, program.terms); });
}

}  // namespace hsi4d::cli
