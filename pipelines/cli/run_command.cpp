#include "pipelines/cli/run_command.h"

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/config_place.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/text.h"
#include "pipelines/chain/chain.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/run_notes.h"
#include "pipelines/draw/visibility.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/clip.h"
#include "pipelines/record/gradient_table.h"
#include "pipelines/sources/sources.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {

namespace {

namespace fs = std::filesystem;

fs::path run_folder(const std::string& name, int number) {
  return fs::path("runs") / (number == 1 ? name : name + "-" + std::to_string(number));
}

std::string folder_of(const RunArguments& arguments, const RunConfig& config) {
  if (!arguments.out.empty()) return arguments.out;
  const std::string name = config.name.empty() ? arguments.config.stem().string() : config.name;
  if (!is_file_name(name))
    throw UserError("hsi4d run: " + arguments.config.string() + ": the run would be called " + json_string(name) +
                    " after it; allowed: " + kFileNameText);
  if (!arguments.resume) return free_run_folder(name);
  if (fs::exists(run_folder(name, 2)))
    throw UserError("hsi4d run: --resume needs --out: there are several runs called " + name + ", from " +
                    run_folder(name, 1).string() + " on");
  return run_folder(name, 1).string();
}

/// What becomes of a run folder, "would write runs/demo".
/// @param identity  the resolved config as it was asked for
std::string folder_plan(const RunConfig& config, const std::string& identity, const std::vector<LossTerm>& losses,
                        const Clip& clip, const std::string& folder, bool resume) {
  const auto state = look_at_run_folder(folder, identity, resume);
  if (!state) return "would write " + folder + "\n";
  const Index finished = finished_frames(folder, config, clip, losses), all = clip.frames() - 1;
  return "would go on with " + folder + " (" + std::string(run_state_name(*state)) + "): " + std::to_string(finished) +
         " of " + std::to_string(all) + " frames are finished, " + std::to_string(all - finished) +
         (all - finished == 1 ? " is" : " are") + " left\n";
}

std::string stages_text(const RunConfig& config) {
  std::string text;
  bool is_again = false;
  for (const auto& [name, stage] : with_passes(config).stages) {
    text += "  stage " + name + ": " + count_text(stage.iterations, "iteration") +
            (stage.over == StageScope::kFirst   ? " over the first frame\n"
             : stage.over == StageScope::kFrame ? (is_again ? " a frame, again\n" : " a frame\n")
                                                : " over the sequence\n");
    is_again = is_again || stage.over == StageScope::kSequence;
  }
  for (const RunNote& note : run_notes(config)) text += "  note: " + note.text + "\n";
  return text;
}

/// Takes over into `config.data` what programs outside have made already.
/// @return  what they would be run for; empty: nothing is left to make
std::string sources_plan(RunConfig& config) {
  std::string text;
  for (const SourceOutput& output : planned_sources(config)) {
    take_output(output, config.data);
    if (output.is_there) continue;
    const std::string what = !output.command.empty()   ? "run " + joined(output.command)
                             : output.what == "motion" ? "find the poses of the keypoints"
                                                       : "follow the objects";
    text += output.path.empty() ? "  would then " + what + "\n"
                                : "  would " + what + "\n    for " + output.path.string() + "\n";
  }
  return text;
}

/// As plan, of a run whose video or masks are not made yet.
std::string plan_without_clip(const RunConfig& config, const std::string& identity, const std::string& folder,
                              bool resume, const std::string& sources) {
  look_at_run_folder(folder, identity, resume);
  const SceneSetup setup = read_scene_setup(config.data);
  warn_of_antialiasing(setup.antialiased, config.render.antialias);
  return "would write " + folder + "\n" + sources + "  scene of " + count_text(setup.scene.count(), "Gaussian") +
         ", human of " + std::to_string(setup.avatar.count()) + "\n" + stages_text(config);
}

/// What a run would do; reads its inputs and its folder, so that what is wrong with them shows.
std::string plan(const RunConfig& asked, const std::vector<LossTerm>& losses, const std::string& folder, bool resume) {
  RunConfig config = asked;
  const std::string identity = resolved_config(with_passes(config), descriptions_of(losses)),
                    sources = sources_plan(config);
  if (!sources.empty()) return plan_without_clip(config, identity, folder, resume, sources);
  const Clip clip = read_run_clip(config, losses);
  if (config.body.kind == BodyKind::kSmplx) body_model_of(config.body);
  check_run_clip(config, clip);
  std::string text = folder_plan(with_passes(config), identity, losses, clip, folder, resume);
  text += "  " + std::to_string(clip.frames()) + " frames of " + std::to_string(clip.camera.width) + "x" +
          std::to_string(clip.camera.height) + ", scene of " + count_text(clip.scene.count(), "Gaussian") +
          ", human of " + std::to_string(clip.avatar.count()) + "\n";
  for (const ClipObject& object : clip.objects) {
    text += "  object " + object.name + " of " + count_text(object.gaussians.count(), "Gaussian") + "\n";
  }
  for (const ClipPerson& person : clip.others)
    text += "  person " + person.name + " of " + count_text(person.avatar.count(), "Gaussian") + "\n";
  return text + stages_text(config);
}

/// "clip b: 51 frames", or what is to be done for it first.
std::string clip_plan(const RunConfig& chain, std::size_t index, const ClipFacts& clip) {
  const std::string name = "  clip " + clip.name + ": ";
  if (clip.frames > 0) return name + count_text(clip.frames, "frame") + "\n";
  std::string text = name + (index == 0 ? "in its initial state\n"
                                        : "in the state in which " + chain.chain[index - 1].name + " ends\n");
  if (chain.chain[index].select_camera) text += "    would choose its camera\n";
  const RunConfig config = clip_config(chain, index);
  const SourceSettings& sources = config.sources;
  std::vector<std::vector<std::string>> commands = {sources.video.command};
  if (finds_person(sources, config.data.keypoints)) commands.push_back(person_command(sources));
  commands.insert(commands.end(), {sources.masks.command, sources.motion.command});
  for (const std::vector<std::string>& command : commands)
    if (!command.empty()) text += "    would run " + joined(command) + ", unless its output is there\n";
  if (sources.masks.is_embedded()) text += "    would follow the objects, unless their masks are there\n";
  if (sources.motion.is_embedded()) text += "    would find the poses of the keypoints, unless they are there\n";
  return text;
}

/// As plan, of a chain: all its clips.
std::string chain_plan(const RunConfig& config, const std::vector<LossTerm>& losses, const std::string& folder,
                       bool resume) {
  const std::vector<ClipFacts> clips = check_chain(config);
  const auto state = look_at_run_folder(folder, resolved_config(config, descriptions_of(losses)), resume);
  std::string text = "would write " + folder + "\n";
  if (state)
    text = "would go on with " + folder + " (" + std::string(run_state_name(*state)) +
           "): " + std::to_string(finished_clips(config, folder, losses)) + " of " + std::to_string(clips.size()) +
           " clips are finished\n";
  for (std::size_t i = 0; i < clips.size(); ++i) text += clip_plan(config, i, clips[i]);
  return text + stages_text(config);
}

std::string shown(const Table& table) { return table.rows.empty() ? "" : table_text(table) + "\n"; }

ChainSummary run_chain_on_terminal(const RunConfig& config, const std::vector<LossTerm>& losses,
                                   const RunOptions& options) {
  const InterruptWatch watch;
  try {
    return execute_chain(config, losses, options);
  } catch (const Interrupted& stop) {
    throw Interrupted(std::string(stop.what()) + "; the same command with --out " + options.folder +
                      " --resume goes on");
  }
}

}  // namespace

int run_threads(std::optional<int> asked) { return !asked ? 0 : *asked == 0 ? thread_count() : *asked; }

std::string free_run_folder(const std::string& name) {
  int number = 1;
  while (fs::exists(run_folder(name, number))) ++number;
  return run_folder(name, number).string();
}

RunSummary run_on_terminal(const RunConfig& config, const std::vector<LossTerm>& losses, const RunOptions& options,
                           const std::string& out) {
  const InterruptWatch watch;
  try {
    return execute_run(config, losses, options);
  } catch (const Interrupted& stop) {
    throw Interrupted(std::string(stop.what()) + "; the same command with --out " + out + " --resume goes on");
  }
}

std::string result_text(const RunSummary& summary, const std::string& folder) {
  const std::string shares = gradient_table(summary);
  const std::string note =
      summary.has_truth ? "" : "no ground truth: errors of body, objects and camera are not measured\n";
  return error_text(summary) + note + quality_text(summary.quality) + (shares.empty() ? "" : "\n" + shares) + "\n" +
         std::to_string(summary.frames) + " frames in " + duration_text(summary.seconds) +
         "; report: " + (std::filesystem::path(folder) / "report.html").string() + "\n";
}

std::string chain_result_text(const ChainSummary& summary, const std::string& folder) {
  return shown(clip_table(summary)) + shown(join_table(summary)) + result_text(summary.all, folder);
}

std::string run_command(const RunArguments& arguments, const std::vector<LossTerm>& losses) {
  std::vector<std::string> overrides = arguments.overrides;
  if (arguments.seed) overrides.push_back("seed=" + std::to_string(*arguments.seed));
  const ConfigUse use = arguments.print_config ? ConfigUse::kSettings : ConfigUse::kRun;
  const RunConfig config = load_run_config(arguments.config, overrides, descriptions_of(losses), use);
  if (arguments.print_config) return resolved_config(config, descriptions_of(losses));
  for (const std::string& override : arguments.overrides)
    if (config_keys(override.substr(0, override.find('='))).front() == "synthetic")
      log_warning("--set " + override + ": nothing reads it: a run has its data; hsi4d synth makes them");
  RunOptions options;
  options.folder = folder_of(arguments, config);
  options.resume = arguments.resume;
  options.threads = run_threads(arguments.threads);
  options.observer = observer_on_terminal(arguments.quiet);
  if (!config.chain.empty()) {
    if (arguments.dry_run) return chain_plan(config, losses, options.folder, arguments.resume);
    return chain_result_text(run_chain_on_terminal(config, losses, options), options.folder);
  }
  if (arguments.dry_run) return plan(config, losses, options.folder, arguments.resume);
  return result_text(run_on_terminal(config, losses, options, options.folder), options.folder);
}

void add_run(CLI::App& app, Program& program) {
  RunArguments& a = program.options<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Reconstruct a clip as a config says, into a run folder");
  command->add_option("CONFIG", a.config, "The config file")->required();
  add_overrides(*command, a.overrides);
  command->add_option("--out", a.out,
                      "The run folder; default: the first free runs/NAME, runs/NAME-2, ... with the config's name");
  command->add_flag("--resume", a.resume, "Go on with the run in the folder; the result has the same bits");
  add_threads(*command, a.threads);
  command->add_flag("--quiet", a.quiet, "No progress on stderr");
  command->add_option("--seed", a.seed, "Seed, instead of the config's")->check(whole_number())->type_name("N");
  command->add_flag("--dry-run", a.dry_run, "Check config and inputs, tell what would be done, write nothing");
  command->add_flag("--print-config", a.print_config, "Print the config with every default filled in, and stop");
  run_when_chosen(*command, program, [&] { return run_command(a, program.terms); });
}

}  // namespace hsi4d::cli
