#include "pipelines/cli/report_command.h"

#include <optional>

#include "core/file.h"
#include "pipelines/chain/report.h"
#include "pipelines/cli/sweep_text.h"
#include "pipelines/record/folder.h"
#include "pipelines/record/gradient_table.h"
#include "pipelines/report/data.h"
#include "pipelines/report/page.h"
#include "pipelines/sweep/selection.h"

namespace hsi4d::cli {

namespace {

std::string report_of_run(const std::string& run) {
  const ReportData data = read_report_data(run);
  const std::string path = RunPaths{run}.report();
  write_text_file(path, report_page(data));
  std::string text = path + "\n";
  if (data.summary) text += error_text(*data.summary) + gradient_table(*data.summary);
  for (const std::string& note : data.notes) text += "note: " + note + "\n";
  return text;
}

std::string report_of_folder(const std::string& folder) {
  return is_chain_folder(folder) ? write_chain_report(folder) + "\n" : report_of_run(folder);
}

}  // namespace

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

}  // namespace hsi4d::cli
