#include "pipelines/cli/dataset.h"

#include "core/check.h"
#include "core/file.h"
#include "core/parallel.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/synthetic/dataset.h"

namespace hsi4d::cli {

namespace {

namespace fs = std::filesystem;

/// Makes a folder, which goes again where nothing has been put into it.
class FolderThatFills {
 public:
  explicit FolderThatFills(const fs::path& folder) : folder_(folder) {
    std::error_code error;
    is_new_ = fs::create_directories(folder_, error);
    if (error) throw UserError(folder_.string() + ": the folder cannot be made: " + error.message());
  }
  ~FolderThatFills() {
    std::error_code error;
    if (is_new_ && fs::is_empty(folder_, error) && !error) fs::remove(folder_, error);
  }
  FolderThatFills(const FolderThatFills&) = delete;
  FolderThatFills& operator=(const FolderThatFills&) = delete;

 private:
  fs::path folder_;
  bool is_new_ = false;
};

}  // namespace

void make_dataset(const RunConfig& config, const std::vector<LossTerm>& losses, const fs::path& folder,
                  std::optional<int> threads, bool quiet) {
  const FolderThatFills above(folder.has_parent_path() ? folder.parent_path() : fs::path("."));
  const InterruptWatch watch;
  const int asked = run_threads(threads), chosen = asked > 0 ? asked : config.threads;
  with_threads(chosen > 0 ? chosen : thread_count(), [&] {
    write_dataset(config.synthetic, video_render_settings(), folder, observer_on_terminal(quiet),
                  dataset_sections(config, descriptions_of(losses)), config.body);
  });
}

void check_dataset(const RunConfig& config, const fs::path& folder) {
  const std::string file = (folder / kSyntheticFile).string();
  if (read_text_file(file) == synthetic_settings_json(config.synthetic, config.body)) return;
  throw UserError(file + ": the dataset was made with other settings than these; make a new one in another folder");
}

void name_inputs(const fs::path& folder, DataSettings& data) {
  DataSettings named = dataset_inputs(folder);
  named.mask_threshold = data.mask_threshold;
  named.mask_margin_px = data.mask_margin_px;
  data = std::move(named);
}

}  // namespace hsi4d::cli
