#include "pipelines/cli/demo_command.h"

#include <filesystem>

#include "core/check.h"
#include "core/config_file.h"
#include "core/file.h"
#include "core/parallel.h"
#include "pipelines/cli/demo_configs.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/run_problems.h"
#include "pipelines/synthetic.h"

namespace hsi4d::cli {

namespace {

namespace fs = std::filesystem;

RunConfig demo_config(const DemoArguments& arguments, const std::vector<LossTerm>& losses) {
  ConfigProblems problems;
  const std::string name = arguments.quick ? "demo_quick.json" : "demo.json";
  const std::map<std::string, std::string> texts = demo_config_texts();
  const ConfigValue tree =
      load_config_text(texts.at(name), name, fs::current_path(), arguments.overrides, problems, texts);
  return read_run_config(tree, descriptions_of(losses), problems, ConfigUse::kStages);
}

void make_dataset(const RunConfig& config, const std::vector<LossTerm>& losses, const DemoArguments& arguments,
                  const fs::path& dataset) {
  const InterruptWatch watch;
  const int asked = run_threads(arguments.threads), threads = asked > 0 ? asked : config.threads;
  with_threads(threads > 0 ? threads : thread_count(), [&] {
    write_dataset(config.synthetic, video_render_settings(), dataset, observer_on_terminal(arguments.quiet),
                  dataset_sections(config, descriptions_of(losses)), config.body);
  });
}

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

/// The dataset that is gone on with must be the one that the config asks for.
void check_dataset(const RunConfig& config, const fs::path& dataset) {
  const std::string file = (dataset / "synthetic.json").string();
  if (read_text_file(file) == synthetic_settings_json(config.synthetic, config.body)) return;
  throw UserError(file + ": the dataset was made with other settings than these; make a new one in another folder");
}

/// Names the files of a dataset and keeps the other settings.
void name_inputs(const fs::path& dataset, DataSettings& data) {
  DataSettings named = dataset_inputs(dataset);
  named.mask_threshold = data.mask_threshold;
  named.mask_margin_px = data.mask_margin_px;
  data = std::move(named);
}

}  // namespace

std::string demo_command(const DemoArguments& arguments, const std::vector<LossTerm>& losses) {
  if (arguments.resume && arguments.out.empty()) throw UserError("hsi4d demo: --resume needs --out, to know with what");
  RunConfig config = demo_config(arguments, losses);
  if (config.synthetic.clips > 1)
    throw UserError("/synthetic/clips: hsi4d demo makes one clip; hsi4d synth makes chains, for hsi4d run");
  const fs::path folder = arguments.out.empty() ? free_run_folder(config.name) : arguments.out;
  const fs::path dataset = folder / "dataset";
  name_inputs(dataset, config.data);
  prepare_run(config);  // before a dataset is made for nothing
  if (!arguments.resume || !fs::exists(dataset)) {
    if (fs::exists(dataset)) {
      throw UserError(folder.string() +
                      ": holds a demo already; --resume goes on with it, another --out makes a new one");
    }
    const FolderThatFills guard(folder);
    make_dataset(config, losses, arguments, dataset);
  } else {
    check_dataset(config, dataset);
  }
  name_inputs(dataset, config.data);  // now that its objects and truth are there
  RunOptions options;
  options.folder = (folder / "run").string();
  options.resume = arguments.resume;
  options.threads = run_threads(arguments.threads);
  options.observer = observer_on_terminal(arguments.quiet);
  return result_text(run_on_terminal(config, losses, options, folder.string()), options.folder);
}

}  // namespace hsi4d::cli
