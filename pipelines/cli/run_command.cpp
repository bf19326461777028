#include "pipelines/cli/run_command.h"

#include "core/progress.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/clip.h"
#include "pipelines/run.h"

namespace hsi4d::cli {

namespace {

std::string folder_of(const RunArguments& arguments, const RunConfig& config) {
  if (!arguments.out.empty()) return arguments.out;
  return (std::filesystem::path("runs") / (config.name.empty() ? arguments.config.stem().string() : config.name))
      .string();
}

/// What a run would do; reads its inputs, so that what is wrong with them shows.
std::string plan(const RunConfig& config, const std::string& folder) {
  check_run(config);
  const Clip clip = read_clip(config.data);
  check_frames(config.data, clip, has_loss(config, "center"));
  std::string text = "would write " + folder + "\n";
  text += "  " + std::to_string(clip.frames()) + " frames of " + std::to_string(clip.camera.width) + "x" +
          std::to_string(clip.camera.height) + ", scene of " + std::to_string(clip.scene.count()) +
          " Gaussians, human of " + std::to_string(clip.avatar.count()) + "\n";
  for (const ClipObject& object : clip.objects) {
    text += "  object " + object.name + " of " + std::to_string(object.gaussians.count()) + " Gaussians\n";
  }
  for (const auto& [name, stage] : config.stages) {
    text += "  stage " + name + ": " + std::to_string(stage.iterations) + " iterations a frame\n";
  }
  return text;
}

}  // namespace

RunSummary run_on_terminal(const RunConfig& config, const std::vector<LossTerm>& losses, const std::string& folder,
                           bool resume, int threads, bool quiet) {
  const InterruptWatch watch;
  RunOptions options;
  options.folder = folder;
  options.resume = resume;
  options.threads = threads;
  options.observer = observer_on_terminal(quiet);
  return carry_out(config, losses, options);
}

std::string result_text(const RunSummary& summary, const std::string& folder) {
  return error_table(summary) + "\n" + std::to_string(summary.frames) + " frames in " + duration_text(summary.seconds) +
         "; report: " + (std::filesystem::path(folder) / "report.html").string() + "\n";
}

std::string run_command(const RunArguments& arguments, const std::vector<LossTerm>& losses) {
  std::vector<std::string> overrides = arguments.overrides;
  if (arguments.seed) overrides.push_back("seed=" + std::to_string(*arguments.seed));
  const RunConfig config = load_run_config(arguments.config, overrides, descriptions_of(losses));
  if (arguments.print_config) return resolved_config(config, descriptions_of(losses));
  const std::string folder = folder_of(arguments, config);
  if (arguments.dry_run) return plan(config, folder);
  const RunSummary summary = run_on_terminal(config, losses, folder, arguments.resume, arguments.threads);
  return result_text(summary, folder);
}

}  // namespace hsi4d::cli
