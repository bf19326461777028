#include "pipelines/cli/demo_command.h"

#include <filesystem>

#include "core/check.h"
#include "core/config_file.h"
#include "pipelines/cli/demo_configs.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/reconstruct.h"
#include "pipelines/synthetic.h"

namespace hsi4d::cli {

namespace {

namespace fs = std::filesystem;

RunConfig demo_config(const DemoArguments& arguments, const std::vector<LossTerm>& losses) {
  ConfigProblems problems;
  const std::string name = arguments.quick ? "demo_quick.json" : "demo.json";
  const ConfigValue tree = load_config_text(std::string(demo_config_text(arguments.quick)), name, fs::current_path(),
                                            arguments.overrides, problems);
  return read_run_config(tree, descriptions_of(losses), problems);
}

/// OUT, or the first of runs/NAME, runs/NAME-2, … that is not there.
fs::path demo_folder(const DemoArguments& arguments, const std::string& name) {
  if (!arguments.out.empty()) return arguments.out;
  const fs::path first = fs::path("runs") / name;
  fs::path folder = first;
  for (int i = 2; fs::exists(folder); ++i) folder = first.string() + "-" + std::to_string(i);
  return folder;
}

}  // namespace

std::string demo_command(const DemoArguments& arguments, const std::vector<LossTerm>& losses) {
  if (arguments.resume && arguments.out.empty()) throw UserError("hsi4d demo: --resume needs --out, to know with what");
  RunConfig config = demo_config(arguments, losses);
  const fs::path folder = demo_folder(arguments, config.name);
  const fs::path dataset = folder / "dataset";
  config.data = dataset_inputs(dataset);
  check_run(config);  // before a dataset is made for nothing
  if (!arguments.resume || !fs::exists(dataset)) {
    if (fs::exists(dataset)) {
      throw UserError(folder.string() +
                      ": holds a demo already; --resume goes on with it, another --out makes a new one");
    }
    fs::create_directories(folder);
    write_dataset(config.synthetic, video_render_settings(), dataset,
                  arguments.quiet ? ProgressSink{} : progress_on_stderr(),
                  sections_beside_data(config, descriptions_of(losses)));
  }
  config.data = dataset_inputs(dataset);  // now that its objects and truth are there
  const std::string run = (folder / "run").string();
  const RunSummary summary = run_on_terminal(config, losses, run, arguments.resume, arguments.threads, arguments.quiet);
  return result_text(summary, run);
}

}  // namespace hsi4d::cli
