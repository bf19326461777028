#include "pipelines/cli/instances.h"

#include <algorithm>

#include "pipelines/config/run_config.h"

namespace hsi4d::cli {

namespace fs = std::filesystem;

fs::path instance_folder() {
  std::error_code error;
  const fs::path here = "configs/anyinteraction";
  if (fs::is_directory(here, error)) return here;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const fs::path installed = program.parent_path().parent_path() / "share/hsi4d" / here;
  return !error && fs::is_directory(installed, error) ? installed : fs::path();
}

std::vector<std::vector<std::string>> instance_rows(const fs::path& folder,
                                                    const std::vector<LossDescription>& losses) {
  std::vector<fs::path> files;
  std::error_code error;  // no such folder: no instances
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error))
    if (entry.path().extension() == ".json" && !is_hidden(entry.path().string())) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<std::vector<std::string>> rows;
  for (const fs::path& file : files) {
    const InstanceSettings instance = load_run_config(file, {}, losses).instance;
    if (instance.prompt.empty()) continue;
    rows.push_back({file.stem().string(), instance.prompt, instance.object,
                    has_data(instance) ? instance.folder.lexically_normal().generic_string() : "stand-in"});
  }
  return rows;
}

}  // namespace hsi4d::cli
