#include "pipelines/cli/report_command.h"

#include "core/file.h"
#include "pipelines/chain_report.h"
#include "pipelines/gradient_table.h"
#include "pipelines/report_data.h"
#include "pipelines/report_page.h"
#include "pipelines/run_folder.h"
#include "pipelines/sweep_report.h"

namespace hsi4d::cli {

std::string report_command(const std::vector<std::string>& runs) {
  std::string text;
  for (const std::string& run : runs) {
    if (is_sweep_folder(run)) {
      text += (text.empty() ? "" : "\n") + write_sweep_results({run});
      continue;
    }
    if (is_chain_folder(run)) {
      text += (text.empty() ? "" : "\n") + write_chain_report(run) + "\n";
      continue;
    }
    const ReportData data = read_report_data(run);
    const std::string path = RunPaths{run}.report();
    write_text_file(path, report_page(data));
    text += (text.empty() ? "" : "\n") + path + "\n";
    if (data.summary) text += error_table(*data.summary) + gradient_table(*data.summary);
    for (const std::string& note : data.notes) text += "note: " + note + "\n";
  }
  return text;
}

}  // namespace hsi4d::cli
