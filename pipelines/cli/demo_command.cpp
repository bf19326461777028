// `hsi4d demo`: the method on a generated scene with ground truth.
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/config_file.h"
#include "optim/loss_term.h"
#include "pipelines/cli/dataset.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/config/shipped_configs.h"

namespace hsi4d::cli {

namespace {

struct DemoArguments {
  bool quick = false;
  std::string out;  ///< empty: the first of runs/NAME, runs/NAME-2, … that is free
  std::vector<std::string> overrides;
  bool quiet = false;
  bool resume = false;
  std::optional<int> threads;  ///< 0: one a core; none: what the config says
};

namespace fs = std::filesystem;

RunConfig demo_config(const DemoArguments& arguments, const std::vector<LossTerm>& losses) {
  ConfigProblems problems;
  const std::string name = arguments.quick ? "demo_quick.json" : "demo.json";
  const std::map<std::string, std::string> texts = shipped_config_texts();
  const ConfigValue tree =
      load_config_text(texts.at(name), name, fs::current_path(), arguments.overrides, problems, texts);
  return read_run_config(tree, descriptions_of(losses), problems, ConfigUse::kStages);
}

/// Makes the dataset in OUT/dataset and reconstructs it into OUT/run. Returns the table of errors and where the report
/// is.
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

}  // namespace

void add_demo(CLI::App& app, Program& program) {
  DemoArguments& a = program.options<DemoArguments>();
  CLI::App* command = app.add_subcommand("demo", "The method on a generated scene with ground truth");
  command->add_flag("--quick", a.quick, "256x256 pixels and 8 frames: less than a minute");
  command->add_option("--out", a.out, "Folder of dataset and run; default: the first free runs/demo, runs/demo-2, ...");
  add_overrides(*command, a.overrides);
  command->add_flag("--quiet", a.quiet, "No progress on stderr");
  command->add_flag("--resume", a.resume, "Go on with the demo in --out; the result has the same bits");
  add_threads(*command, a.threads);
  run_when_chosen(*command, program, [&] { return demo_command(a, program.terms); });
}

}  // namespace hsi4d::cli
