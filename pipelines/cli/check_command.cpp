#include "pipelines/cli/check_command.h"

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/config_file.h"
#include "pipelines/avatar/fit.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/config/run_config.h"
#include "pipelines/config/run_notes.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/scan/settings.h"
#include "pipelines/sweep/plan.h"

namespace hsi4d::cli {
namespace {

struct CheckArguments {
  std::string config;
  std::vector<std::string> overrides;
  bool print_config = false;
};

template <class T>
std::string names_of_choices(const ConfigMap<T>& map) {
  std::vector<std::string> names;
  for (const auto& [name, value] : map) names.push_back(name);
  return names.empty() ? "" : " (" + joined(names) + ")";
}

/// Loss terms by name, with what is off.
std::string names_of_choices(const ConfigMap<LossSettings>& losses) {
  std::vector<std::string> names;
  for (const auto& [name, loss] : losses) names.push_back(name + (loss.weight == 0 ? " off by weight 0" : ""));
  return names.empty() ? "" : " (" + joined(names) + ")";
}

std::string stage_summary(const std::string& name, const StageSettings& stage) {
  return "  stage " + name + ": " + count_text(stage.iterations, "iteration") + ", " +
         count_text(std::ssize(stage.optimize), "parameter group") + names_of_choices(stage.optimize) + ", " +
         count_text(std::ssize(stage.losses), "loss") + names_of_choices(stage.losses) + "\n";
}

std::string summary(const std::filesystem::path& file, const RunConfig& config) {
  const RenderSettings& render = config.render;
  std::string text = file.generic_string() + ": OK\n";
  text += "  seed " + std::to_string(config.seed) + ", ";
  text += config.threads == 0 ? "one thread a core\n" : count_text(config.threads, "thread") + "\n";
  text += "  render: quality " + std::string(choice_name<Quality>(kQualities, render.quality));
  if (render.compatibility != Compatibility::kNone)
    text += ", as " + std::string(choice_name<Compatibility>(kCompatibilities, render.compatibility));
  text += "\n";
  if (!config.chain.empty()) {
    std::vector<std::string> names;
    for (const ChainClip& clip : config.chain) names.push_back(clip.name);
    text += "  chain of " + count_text(std::ssize(names), "clip") + " (" + joined(names) + ")\n";
  }
  for (const auto& [name, stage] : with_passes(config).stages) text += stage_summary(name, stage);
  if (config.stages.empty()) text += "  no stages\n";
  text += "  the config alone is checked; `hsi4d run " + file.generic_string() + " --dry-run` reads its inputs\n";
  for (const RunProblem& problem : run_problems(config, ConfigUse::kRun))
    text += "  note: no run yet: " + problem.pointer + ": " + problem.text + "\n";
  for (const RunNote& note : run_notes(config)) text += "  note: " + note.text + "\n";
  return text;
}

std::string fit_summary(const std::filesystem::path& file, const AvatarFitSettings& fit) {
  std::string text = file.generic_string() + ": OK, a config of `hsi4d avatar fit`\n";
  text +=
      "  views: " + (fit.views.empty() ? "not given; --set views=DIR/views.json" : fit.views.generic_string()) + "\n";
  text += "  starts from " +
          (fit.avatar.empty() ? count_text(fit.gaussians, "Gaussian") + " on the body" : fit.avatar.generic_string()) +
          "\n";
  return text + stage_summary("avatar fit", fit.stage);
}

std::string scan_summary(const std::filesystem::path& file, const ScanSettings& scan) {
  std::string text = file.generic_string() + ": OK, a config of `hsi4d reconstruct`\n";
  text += "  pictures: " +
          (scan.photos.path.empty() ? "not given; --set photos.path=DIR" : scan.photos.path.generic_string()) + "\n";
  text += "  at most " + count_text(scan.density.most, "Gaussian") + "\n";
  return text + stage_summary("reconstruct", scan.stage);
}

/// A sweep has no settings of its own to override, and many configs.
std::string check_sweep(const std::filesystem::path& file, const std::vector<std::string>& overrides, bool print_config,
                        const std::vector<LossDescription>& losses) {
  const std::string name = file.generic_string();
  if (!overrides.empty() || print_config)
    throw UserError(name + ": is a sweep, which --set and --print-config are not for; hsi4d sweep " + name +
                    " --dry-run prints its runs");
  const SweepPlan plan = plan_sweep(file, losses);
  return name + ": OK, a sweep of " + count_text(std::ssize(distinct_runs(plan)), "run") + "\n";
}

}  // namespace

std::string check_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                          bool print_config, const std::vector<LossDescription>& losses) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(config, overrides, problems);
  if (config_kind(tree) == ConfigKind::kSweep) return check_sweep(config, overrides, print_config, losses);
  if (config_kind(tree) == ConfigKind::kAvatarFit) {
    const AvatarFitSettings fit = read_avatar_fit(tree, config, losses, problems, false);
    return print_config ? resolved_avatar_fit(fit, losses) : fit_summary(config, fit);
  }
  if (config_kind(tree) == ConfigKind::kScan) {
    const ScanSettings scan = read_scan(tree, config, losses, problems, false);
    return print_config ? resolved_scan(scan, losses) : scan_summary(config, scan);
  }
  const RunConfig run = read_run_config(tree, losses, problems, ConfigUse::kStages);
  return print_config ? resolved_config(run, losses) : summary(config, run);
}

void add_check(CLI::App& app, Program& program) {
  CheckArguments& a = program.options<CheckArguments>();
  CLI::App* check = app.add_subcommand("check", "Check a config and everything that it extends; tells all problems");
  check->add_option("CONFIG", a.config, "The config file")->required();
  add_overrides(*check, a.overrides);
  check->add_flag("--print-config", a.print_config, "Print the config with every default filled in");
  run_when_chosen(*check, program,
                  [&] { return check_command(a.config, a.overrides, a.print_config, descriptions_of(program.terms)); });
}

}  // namespace hsi4d::cli
