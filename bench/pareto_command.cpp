// `hsi4d bench pareto`: run time against error, setting by setting, and what an error comes to in a reconstruction.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "bench/list.h"
#include "bench/pareto_tracking.h"
#include "core/check.h"
#include "core/file.h"
#include "core/progress.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/cli/terminal.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {

namespace {

struct BenchParetoOptions : BenchConfigOptions {
  std::vector<std::string> scenes;       ///< by name; empty: all, or none where there are files
  std::vector<std::string> scene_files;  ///< files of Gaussians and folders of such files, a scene each
  std::vector<std::string> knobs;        ///< empty: all
  int threads = 1;
  int repeats = 9;
  int seeds = 5;                                    ///< of the reconstructions; 0: these are left out
  std::filesystem::path out = "runs/bench/pareto";  ///< folder of their datasets
  std::string csv, front;                           ///< files; empty: none
};

constexpr const char* kTrackedLike = "avatar_in_scene";  // what is reconstructed looks like it
constexpr double kMostTrackedTime = 4;                   // of the default's: settings beyond are not reconstructed with

std::vector<ParetoScene> chosen_scenes(const BenchParetoOptions& options) {
  std::vector<ParetoScene> scenes;
  const bool wants_all = options.scenes.empty() && options.scene_files.empty();
  for (const std::string& name : wants_all ? pareto_scene_names() : options.scenes)
    scenes.push_back(pareto_scene(name));
  for (ParetoScene& scene : pareto_scenes_of(options.scene_files)) scenes.push_back(std::move(scene));
  return scenes;
}

std::vector<ParetoSetting> chosen_settings(const std::vector<std::string>& knobs) {
  const std::vector<std::string> known = pareto_knobs();
  for (const std::string& knob : knobs) {
    if (std::find(known.begin(), known.end(), knob) == known.end())
      throw UserError("hsi4d bench pareto: no knob \"" + knob + "\"; known: " + joined(known) +
                      did_you_mean(knob, known));
  }
  std::vector<ParetoSetting> chosen;
  for (const ParetoSetting& setting : pareto_settings()) {
    const bool is_default = chosen.empty();  // which comes first, and all is told beside it
    if (is_default || knobs.empty() || std::find(knobs.begin(), knobs.end(), setting.knob) != knobs.end())
      chosen.push_back(setting);
  }
  return chosen;
}

/// The presets, and what is on a front of the scene that is most like what is reconstructed, as far as it does not take
/// too long. The default comes first.
std::vector<ParetoSetting> tracked_settings(const std::vector<ParetoRow>& rows,
                                            const std::vector<ParetoSetting>& measured) {
  const auto is_like = [](const ParetoRow& row) { return row.scene == kTrackedLike; };
  const bool has_like = std::any_of(rows.begin(), rows.end(), is_like);
  const std::vector<ParetoPoint> points = pareto_points(rows, has_like ? kTrackedLike : "");
  std::vector<std::string> names, slow;
  for (const ParetoPoint& point : points)
    if (point.time_ratio > kMostTrackedTime) slow.push_back(point.name());
  const auto has = [](const std::vector<std::string>& all, const std::string& name) {
    return std::find(all.begin(), all.end(), name) != all.end();
  };
  for (double ParetoPoint::*error : {&ParetoPoint::image_rms, &ParetoPoint::gradient})
    for (const std::size_t i : pareto_front(points, error)) names.push_back(points[i].name());
  std::vector<ParetoSetting> tracked;
  for (const ParetoSetting& setting : measured)
    if ((setting.knob == "quality" || has(names, setting.name())) && !has(slow, setting.name()))
      tracked.push_back(setting);
  return tracked;
}

/// Reconstructs while the terminal is told.
std::vector<TrackedPoint> track(const Tracking& tracking, const std::vector<LossTerm>& losses,
                                const Observer& observer) {
  Progress shown("runs", tracking_run_count(tracking), observer.progress, observer.progress_interval);
  std::vector<TrackedPoint> points = measure_tracking(tracking, losses, [&shown] { shown.step(); });
  shown.finish();
  return points;
}

/// Throws UserError for a file or a folder that could not be written at the end, before anything is measured.
void check_outputs(const BenchParetoOptions& options) {
  for (const std::string& path : {options.json, options.csv, options.plot, options.front})
    if (!path.empty()) const AtomicFile unfinished(path);
  if (options.seeds > 0) check_tracking_folder(options.out);
}

void write_outputs(const BenchParetoOptions& options, const std::vector<ParetoRow>& rows,
                   const std::vector<TrackedPoint>& tracked) {
  if (!options.json.empty()) write_text_file(options.json, pareto_json(rows) + tracking_json(tracked));
  if (!options.csv.empty()) write_text_file(options.csv, pareto_csv(rows, tracked));
  if (!options.plot.empty()) write_text_file(options.plot, pareto_svg(rows, tracked));
  if (!options.front.empty()) write_text_file(options.front, pareto_front_svg(rows));
}

/// Measures, and reconstructs with the presets and with what is on the front of avatar_in_scene, but for what takes
/// more than four times as long as the default. Names and the config are looked at before anything is measured. Returns
/// tables.
std::string bench_pareto_command(const BenchParetoOptions& options, const std::vector<LossTerm>& losses) {
  const ParetoBench bench{chosen_scenes(options), chosen_settings(options.knobs), options.repeats, options.threads};
  Tracking tracking;
  if (options.seeds > 0)
    tracking = {load_run_config(options.config, options.overrides, descriptions_of(losses), ConfigUse::kStages),
                {},
                options.seeds,
                options.out};
  check_outputs(options);
  const Observer observer = observer_on_terminal(false);
  Progress shown("settings", pareto_row_count(bench), observer.progress, observer.progress_interval);
  const std::vector<ParetoRow> rows = measure_pareto(bench, [&shown](const ParetoRow&) { shown.step(); });
  shown.finish();
  write_outputs(options, rows, {});  // what is there is not lost if reconstructions fail
  std::vector<TrackedPoint> tracked;
  if (options.seeds > 0) {
    tracking.settings = tracked_settings(rows, bench.settings);
    tracked = track(tracking, losses, observer);
    write_outputs(options, rows, tracked);
  }
  const std::string fronts = pareto_front_table(rows);
  return pareto_table(rows) + (fronts.empty() ? "" : "\n" + fronts) +
         (tracked.empty() ? "" : "\n" + tracking_table(tracked));
}

void add_pareto(CLI::App& command, Program& program) {
  BenchParetoOptions& pareto = program.options<BenchParetoOptions>();
  add_workload(command, pareto.scenes, "of the scenes that are made up");
  command
      .add_option("--scene", pareto.scene_files,
                  "Gaussians of a file to measure too, or of all files in a folder, instead of all that are "
                  "made up unless --workload names some; " +
                      splat_formats_text())
      ->type_name(splat_type_name() + "|DIR");
  command.add_option("--knob", pareto.knobs, "Only these and the default; default: all");
  add_thread_count(command, pareto.threads, "1");
  add_repeats(command, pareto.repeats);
  command.add_option("--seeds", pareto.seeds, "Reconstructions of each setting; default: 5; 0 leaves these out")
      ->check(CLI::Range(0, 100));
  add_config(command, pareto, "The config of the reconstructions", "configs/bench/pareto_tracking.json");
  command
      .add_option("--out", pareto.out,
                  "Folder that is made for datasets and reconstructions and removed again; default: runs/bench/pareto")
      ->type_name("DIR");
  command.add_option("--csv", pareto.csv, "File for the measurements, a line each")->type_name("F.csv");
  command.add_option("--front", pareto.front, "File for a picture of what settings are chosen by, two panels")
      ->type_name("F.svg");
  run_when_chosen(command, program, [&] { return bench_pareto_command(pareto, program.terms); });
}

}  // namespace

BenchTopic pareto_topic() {
  return {
      .name = "pareto",
      .summary = "Measure run time against error, setting by setting, and what an error comes to in a reconstruction",
      .add = add_pareto};
}

}  // namespace hsi4d::cli
