// The subcommand `hsi4d report`.
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/file.h"
#include "pipelines/chain/report.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/sweep_text.h"
#include "pipelines/record/folder.h"
#include "pipelines/record/gradient_table.h"
#include "pipelines/report/data.h"
#include "pipelines/report/page.h"
#include "pipelines/scan/scan.h"
#include "pipelines/sweep/selection.h"

namespace hsi4d::cli {

namespace {

std::string report_of_run(const std::string& run) {
  const ReportData data = read_report_data(run);
  const std::string path = RunPaths{run}.report();
  write_text_file(path, report_page(data));
  std::string text = path + "\n";
  if (data.summary)
    text += error_text(*data.summary) + quality_text(data.summary->quality) + gradient_table(*data.summary);
  for (const std::string& note : data.notes) text += "note: " + note + "\n";
  return text;
}

std::string report_of_folder(const std::string& folder) {
  if (is_scan_folder(folder))
    throw UserError(folder +
                    ": is of `hsi4d reconstruct`, which has written its report.html; this command writes those "
                    "of runs and sweeps");
  return is_chain_folder(folder) ? write_chain_report(folder) + "\n" : report_of_run(folder);
}

/// `hsi4d report RUN...`: writes report.html of each run folder; returns its path and table of errors, for each.
/// Throws as write_report.
std::string report_command(const std::vector<std::string>& runs) {
  std::string text;
  const auto add = [&text](const std::string& more) { text += (text.empty() ? "" : "\n") + more; };
  for (const std::string& run : runs) {
    if (is_sweep_folder(run)) {
      add(write_and_show_results({run}));
    } else if (const std::optional<SweepSelection> selection = select_sweep_runs(run)) {
      for (const std::size_t index : selection->runs)
        add(selection->name(index) + ": " + report_of_folder(selection->folder(index).string()));
    } else {
      add(report_of_folder(run));
    }
  }
  return text;
}

}  // namespace

void add_report(CLI::App& app, Program& program) {
  auto& runs = program.options<std::vector<std::string>>();
  CLI::App* report = app.add_subcommand("report", "Write report.html of runs and sweeps, and print their errors");
  report->add_option("RUN", runs, "Folders of runs or sweeps; SWEEP/NAME: runs of a sweep by name")->required();
  run_when_chosen(*report, program, [&] { return report_command(runs); });
}

}  // namespace hsi4d::cli
