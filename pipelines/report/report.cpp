#include "pipelines/report/report.h"

#include "core/file.h"
#include "pipelines/record/folder.h"
#include "pipelines/report/data.h"
#include "pipelines/report/page.h"

namespace hsi4d {

std::string report_html(const std::string& run_folder) { return report_page(read_report_data(run_folder)); }

std::string write_report(const std::string& run_folder) {
  const std::string page = report_html(run_folder);
  const std::string path = RunPaths{run_folder}.report();
  write_text_file(path, page);
  return path;
}

}  // namespace hsi4d
