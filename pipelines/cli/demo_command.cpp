#include "pipelines/cli/demo_command.h"

#include <filesystem>

#include "core/check.h"
#include "core/config_file.h"
#include "pipelines/cli/dataset.h"
#include "pipelines/cli/demo_configs.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/config/run_problems.h"

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
    make_dataset(config, losses, dataset, arguments.threads, arguments.quiet);
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
