// `hsi4d evaluate`: errors of runs and motions against the truth, and what of them needs none.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/text.h"
#include "pipelines/cli/evaluate_tables.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/evaluate/baseline_export.h"
#include "pipelines/evaluate/evaluation.h"
#include "pipelines/record/folder.h"
#include "pipelines/record/published.h"
#include "pipelines/synthetic/dataset.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {
namespace {

struct EvaluateOptions {
  std::vector<std::string> inputs;           ///< folders of runs, runs of sweeps, motions (.npz), folders of SMPLer-X
  EvaluationSettings settings;               ///< --truth, --data, --body-model, ...
  std::vector<std::string> object_surfaces;  ///< --object-surface NAME=F
  std::string align = "none";                ///< --align none|heading|rotation
  std::string up;                            ///< --up y|z; empty: to be found
  std::string protocol;                      ///< --protocol NAME; empty: none
  std::string foot_points;                   ///< --foot-points A,B,C,D; empty: those of the body
  std::optional<int> aligned_frames;         ///< --align-frames N
  std::vector<std::string> clips;            ///< --clip F.npz, one for each input; none: RUN/clip.npz where it is there
  std::string json;                          ///< --json F; empty: none
  std::string export_folder;                 ///< --export DIR; empty: none
};

void remove_member(ConfigValue& object, std::string_view key) {
  std::erase_if(object.members, [key](const ConfigMember& member) { return member.key == key; });
}

void remove_prefix(ConfigValue& value, const std::string& prefix) {
  if (value.kind == ConfigValue::Kind::kString && value.text.starts_with(prefix)) value.text.erase(0, prefix.size());
  for (ConfigMember& member : value.members) remove_prefix(member.value, prefix);
  for (ConfigValue& item : value.items) remove_prefix(item, prefix);
}

/// Names the files of a generated dataset as they are called in its folder: which clip they are of the settings
/// `synthetic` say, and every seed of a sweep has a folder of its own.
void forget_generated_folder(ConfigValue& data) {
  for (const ConfigMember& member : data.members) {
    if (member.key != "camera" || member.value.kind != ConfigValue::Kind::kString) continue;
    const std::filesystem::path folder = std::filesystem::path(member.value.text).parent_path();
    if (std::filesystem::exists(folder / kSyntheticFile)) return remove_prefix(data, folder.string() + "/");
  }
}

/// The config of a run without what may differ between repetitions: its name, its seeds, its threads, its log.
std::optional<std::string> config_without_seed(const std::string& run) {
  const std::string file = RunPaths{run}.config();
  if (!is_run_folder(run) || !std::filesystem::exists(file)) return std::nullopt;
  ConfigValue tree = parse_json_text(read_text_file(file), file);
  for (const char* const key : {"name", "seed", "threads", "log"}) remove_member(tree, key);
  for (ConfigMember& member : tree.members) {
    if (member.key == "synthetic") remove_member(member.value, "seed");
    if (member.key == "data") forget_generated_folder(member.value);
  }
  return to_json(tree);
}

/// Whether a mean over the inputs says something: there is one, or they are runs of the same config.
bool are_repetitions(const std::vector<std::string>& inputs) {
  if (inputs.size() < 2) return true;
  const std::optional<std::string> first = config_without_seed(inputs.front());
  return first && std::all_of(inputs.begin() + 1, inputs.end(),
                              [&first](const std::string& input) { return config_without_seed(input) == first; });
}

std::vector<Spread> spreads_of(const std::vector<Evaluation>& results) {
  std::vector<Spread> spreads;
  for (const MetricFacts& facts : metric_facts()) {
    std::vector<double> values;
    for (const Evaluation& result : results) {
      if (const double* const value = find_metric(result.values, facts.name)) values.push_back(*value);
    }
    if (values.empty()) continue;
    Spread spread{&facts, 0, 0, values.size()};
    for (const double value : values) spread.mean += value / static_cast<double>(values.size());
    double squares = 0;
    for (const double value : values) squares += (value - spread.mean) * (value - spread.mean);
    if (values.size() > 1) spread.deviation = std::sqrt(squares / static_cast<double>(values.size() - 1));
    spreads.push_back(spread);
  }
  return spreads;
}

void add_metrics(ConfigValue& object, const MetricValues& values) {
  for (const auto& [name, value] : values) object.add(name, ConfigValue::make_number(value));
}

ConfigValue object_of(const MetricValues& values) {
  ConfigValue object = ConfigValue::make_object();
  add_metrics(object, values);
  return object;
}

ConfigValue json_of(const Evaluation& result) {
  ConfigValue object = ConfigValue::make_object();
  object.add("name", ConfigValue::make_string(result.name));
  if (!result.truth.empty()) object.add("truth", ConfigValue::make_string(result.truth));
  if (!result.surface.empty()) object.add("surface", ConfigValue::make_string(result.surface));
  if (!result.protocol.empty()) object.add("protocol", ConfigValue::make_string(result.protocol));
  object.add("clip", ConfigValue::make_string(result.has_objects ? "dynamic" : "static"));
  object.add("frames", ConfigValue::make_integer(result.frames));
  object.add("frame_rate", ConfigValue::make_number(result.frame_rate));
  add_metrics(object, result.values);
  ConfigValue frames = ConfigValue::make_array();
  for (const FrameMetrics& frame : result.per_frame) {
    ConfigValue values = ConfigValue::make_object();
    values.add("frame", ConfigValue::make_integer(frame.frame));
    add_metrics(values, frame.values);
    frames.items.push_back(std::move(values));
  }
  object.add("per_frame", std::move(frames));
  return object;
}

ConfigValue published_json() {
  ConfigValue array = ConfigValue::make_array();
  for (const PublishedFigure& figure : published_figures()) {
    ConfigValue object = ConfigValue::make_object();
    object.add("label", ConfigValue::make_string(figure.label));
    object.add("clips", ConfigValue::make_string(figure.is_dynamic ? "dynamic" : "static"));
    if (!figure.metric.empty()) object.add("metric", ConfigValue::make_string(figure.metric));
    ConfigValue methods = ConfigValue::make_object();
    methods.add("ZeroHSI", ConfigValue::make_number(figure.value));
    for (const OtherFigure& other : figure.others) methods.add(other.method, ConfigValue::make_number(other.value));
    object.add("published", std::move(methods));
    array.items.push_back(std::move(object));
  }
  return array;
}

std::string json_text(const std::vector<Evaluation>& results, const std::vector<Spread>& spreads, bool has_mean,
                      const std::vector<Diversity>& diversity, const EvaluateInputs& inputs) {
  ConfigValue root = ConfigValue::make_object(), all = ConfigValue::make_array();
  for (const Evaluation& result : results) all.items.push_back(json_of(result));
  root.add("results", std::move(all));
  if (has_mean) {
    MetricValues means, deviations;
    for (const Spread& spread : spreads) {
      means.emplace_back(spread.facts->name, spread.mean);
      if (spread.count > 1) deviations.emplace_back(spread.facts->name, spread.deviation);
    }
    for (const auto& [facts, value] : diversity) means.emplace_back(facts->name, value);
    root.add("mean", object_of(means));
    root.add("std", object_of(deviations));
  }
  if (!inputs.sweeps.empty()) root.add("sweeps", sweeps_json(inputs, results));
  ConfigValue published = ConfigValue::make_object();
  published.add("source", ConfigValue::make_string(kPublishedSource));
  published.add("figures", published_json());
  root.add("published", std::move(published));
  return to_json(root);
}

// ---- Options ----

std::optional<UpAxis> parse_up(const std::string& text) {
  if (text.empty()) return std::nullopt;
  if (text == "y") return UpAxis::kY;
  if (text == "z") return UpAxis::kZ;
  throw UserError("hsi4d evaluate: --up: \"" + text + "\" is not known; allowed: y, z");
}

MotionAlign parse_align(const std::string& text) {
  std::vector<std::string> known;
  for (const auto& choice : kMotionAligns) {
    if (choice.name == text) return choice.value;
    known.emplace_back(choice.name);
  }
  throw UserError("hsi4d evaluate: --align: \"" + text + "\" is not known; allowed: " + joined(known));
}

Protocol parse_protocol(const std::string& text) {
  if (text.empty()) return Protocol::kNone;
  std::vector<std::string> known;
  for (const auto& choice : kProtocols) {
    if (choice.name == text) return choice.value;
    known.emplace_back(choice.name);
  }
  throw UserError("hsi4d evaluate: --protocol: \"" + text + "\" is not known; allowed: " + joined(known));
}

/// Four whole numbers.
std::vector<Index> parse_foot_points(const std::string& text) {
  std::vector<Index> points;
  if (text.empty()) return points;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at < end) {
    Index point = 0;
    const auto [after, error] = std::from_chars(at, end, point);
    if (error != std::errc() || point < 0 || (after != end && *after != ',')) break;
    points.push_back(point);
    at = after == end ? end : after + 1;
  }
  if (at != end || text.back() == ',' || points.size() != 4)
    throw UserError(
        "hsi4d evaluate: --foot-points: \"" + text +
        "\"; allowed: four numbers of points, left toe, left heel, right toe, right heel: 5770,8846,8463,8635");
  return points;
}

/// What options of protocols say. Throws UserError for one that nothing reads.
void take_protocol(const EvaluateOptions& options, EvaluationSettings& settings) {
  settings.protocol = parse_protocol(options.protocol);
  settings.foot_points = parse_foot_points(options.foot_points);
  if (!settings.foot_points.empty() && !is_of_world(settings.protocol))
    throw UserError("hsi4d evaluate: --foot-points: only --protocol emdb2 and rich measure feet by points");
  if (options.aligned_frames && !is_of_objects(settings.protocol))
    throw UserError(
        "hsi4d evaluate: --align-frames: only --protocol behave and intercap lay frames on the truth by it");
  if (options.aligned_frames && *options.aligned_frames < 1)
    throw UserError("hsi4d evaluate: --align-frames: 0 is out of range; allowed: 1 or more");
  settings.aligned_frames = options.aligned_frames.value_or(static_cast<int>(kAlignedFrames));
  if (!settings.truth_body_model.empty() && settings.body_model.empty())
    throw UserError("hsi4d evaluate: --truth-body-model is given without --body-model, the body of the other motions");
}

std::vector<std::pair<std::string, std::string>> parse_object_surfaces(const std::vector<std::string>& texts) {
  std::vector<std::pair<std::string, std::string>> surfaces;
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
      throw UserError("hsi4d evaluate: --object-surface: \"" + text + "\"; allowed: NAME=FILE");
    surfaces.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  return surfaces;
}

EvaluationSettings settings_of(const EvaluateOptions& options) {
  EvaluationSettings settings = options.settings;
  settings.up = parse_up(options.up);
  settings.align = parse_align(options.align);
  settings.object_surfaces = parse_object_surfaces(options.object_surfaces);
  take_protocol(options, settings);
  if (!settings.body_model.empty() && !settings.avatar.empty())
    throw UserError("hsi4d evaluate: --body-model and --avatar both say of what body the joints are; give one");
  if (!settings.surface.empty() + !settings.occupancy.empty() + !settings.scene.empty() > 1)
    throw UserError("hsi4d evaluate: --surface, --occupancy and --scene each say what is solid; give one");
  check_rate(settings.from_rate, "hsi4d evaluate: --from-rate");
  check_rate(settings.frame_rate, "hsi4d evaluate: --frame-rate");
  if (!options.clips.empty() && options.clips.size() != options.inputs.size())
    throw UserError("hsi4d evaluate: --clip: " + count_text(std::ssize(options.clips), "file") + " for " +
                    count_text(std::ssize(options.inputs), "input") + "; allowed: one for each, in their order");
  return settings;
}

/// The embeddings of an input: what is given, or clip.npz in a run's folder.
std::string clip_of(const EvaluateOptions& options, std::size_t index) {
  if (!options.clips.empty()) return options.clips[index];
  const std::filesystem::path file = std::filesystem::path(options.inputs[index]) / "clip.npz";
  return is_run_folder(options.inputs[index]) && std::filesystem::exists(file) ? file.string() : "";
}

/// Refuses to write exports over what somebody has made: into an input, or a folder of something else.
void check_export(const EvaluateOptions& options) {
  namespace fs = std::filesystem;
  if (options.export_folder.empty()) return;
  const auto whole = [](const std::string& path) { return fs::weakly_canonical(path).string() + "/"; };
  const std::string folder = whole(options.export_folder);
  std::vector<std::string> given = options.inputs;
  given.insert(given.end(), {options.settings.truth, options.settings.data});
  for (const std::string& input : given) {
    if (!input.empty() && fs::is_directory(input) && folder.starts_with(whole(input)))
      throw UserError("hsi4d evaluate: --export: " + options.export_folder + " is in " + input +
                      ", which is read; choose another folder");
  }
  for (const char* const name : {"status.json", "summary.json", "initial.json", "config.json"}) {
    if (fs::exists(fs::path(options.export_folder) / name))
      throw UserError("hsi4d evaluate: --export: " + options.export_folder + " holds something else, with a " + name +
                      "; choose another folder");
  }
}

void check_outputs(const EvaluateOptions& options) {
  check_export(options);
  if (options.json.empty()) return;
  const EvaluationSettings& s = options.settings;
  check_no_input(
      options.json, "hsi4d evaluate: --json",
      {s.truth, s.data, s.body_model, s.truth_body_model, s.avatar, s.surface, s.occupancy, s.scene, s.objects});
  check_no_input(options.json, "hsi4d evaluate: --json", options.inputs);
  check_no_input(options.json, "hsi4d evaluate: --json", options.clips);
  check_writable(options.json);
}

/// What was exported, a line an input.
std::string exported(const EvaluateOptions& options, const EvaluationSettings& settings) {
  std::string text;
  if (options.export_folder.empty()) return text;
  const std::filesystem::path folder = options.export_folder;
  for (std::size_t i = 0; i < options.inputs.size(); ++i) {
    const std::filesystem::path own = options.inputs.size() == 1 ? folder : folder / std::to_string(i);
    text += export_for_baselines(settings, options.inputs[i], own.string()) + "\n";
  }
  return text;
}

std::vector<const Evaluation*> pointers_to(const std::vector<Evaluation>& results) {
  std::vector<const Evaluation*> pointers;
  for (const Evaluation& result : results) pointers.push_back(&result);
  return pointers;
}

/// A table with a row for each metric of summary.json that can be measured, and a column for each input; for several
/// repetitions their mean, standard deviation and diversity too. Runs of a sweep that differ in more than seeds have a
/// row each, and the tables of the sweep's report. Then what was taken for the truth, the scene and the world of each,
/// and the paper's figures beside ours. Writes the JSON file, and what other methods start from.
///
/// Throws UserError or DataError with one message for whatever is wrong with options and files.
std::string evaluate_command(const EvaluateOptions& given) {
  const EvaluateInputs inputs = evaluate_inputs(given.inputs);
  EvaluateOptions options = given;
  options.inputs = inputs.paths;
  const EvaluationSettings settings = settings_of(options);
  check_outputs(options);
  std::vector<Evaluation> results;
  for (std::size_t i = 0; i < options.inputs.size(); ++i) {
    results.push_back(evaluate(settings, options.inputs[i], clip_of(options, i)));
    results.back().name = inputs.names[i];
  }
  const std::vector<Spread> spreads = spreads_of(results);
  const bool is_alike = are_repetitions(options.inputs);
  const std::vector<Diversity> diversity = is_alike ? diversity_of(pointers_to(results)) : std::vector<Diversity>();
  if (!options.json.empty()) write_text_file(options.json, json_text(results, spreads, is_alike, diversity, inputs));
  const std::string published = published_text(results, inputs) + exported(options, settings);
  if (inputs.sweeps.empty() || is_alike)
    return table_of(results, spreads, is_alike && results.size() > 1, diversity) + "\n" + frames_text(results) +
           published;
  return table_of_runs(results, spreads) + sweeps_text(inputs, results, stdout_columns()) +
         notes_of_runs(results, inputs) + published;
}

/// What is solid, and where objects are.
void add_evaluate_scene(CLI::App& command, EvaluateOptions& o) {
  EvaluationSettings& s = o.settings;
  command.add_option("--surface", s.surface, "A mesh of what is solid (.obj, .ply, .glb)")->type_name("F");
  command.add_option("--occupancy", s.occupancy, "A grid of voxels instead, free or occupied")->type_name("F.npz");
  command.add_option("--scene", s.scene, "Gaussians instead, of what they show")->type_name(splat_type_name());
  command
      .add_option("--objects", s.objects, "Poses of objects in the scene beside a motion, z up, as a run's objects.npz")
      ->type_name("F.npz");
  command
      .add_option("--object-surface", o.object_surfaces,
                  "A mesh of an object, instead of what its Gaussians show; may be given several times")
      ->type_name("NAME=F")
      ->allow_extra_args(false);
}

/// Public benchmarks.
void add_evaluate_protocol(CLI::App& command, EvaluateOptions& o) {
  command
      .add_option("--protocol", o.protocol,
                  "Measure as on a public benchmark too: emdb2 or rich (WA-MPJPE-100, W-MPJPE-100, RTE, jitter, foot "
                  "sliding), behave or intercap (chamfer distances and accelerations of human and objects)")
      ->type_name("NAME");
  command
      .add_option("--truth-body-model", o.settings.truth_body_model,
                  "A SMPL-X file of the truth's body, where it is another than --body-model: a gender's")
      ->type_name("M.npz");
  command
      .add_option(
          "--foot-points", o.foot_points,
          "By which points of the body feet slide in emdb2 and rich, left toe, left heel, right toe, right heel; "
          "without, big toes and heels")
      ->type_name("A,B,C,D");
  command
      .add_option("--align-frames", o.aligned_frames,
                  "How many frames behave and intercap lay on the truth together, 300 without; 1: each by itself")
      ->check(whole_number())
      ->type_name("N");
}

}  // namespace

void add_evaluate(CLI::App& app, Program& program) {
  EvaluateOptions& o = program.options<EvaluateOptions>();
  EvaluationSettings& s = o.settings;
  CLI::App* command =
      app.add_subcommand("evaluate", "Errors of runs and motions against the truth, and what of them needs none");
  command
      ->add_option(
          "RUN", o.inputs,
          "Folders of runs, motions by AMASS's or SMPL-X's names (.npz), folders of SMPLer-X's files; of a sweep "
          "its folder, for all runs that are done, or SWEEP/NAME, for those of that name: "
          "runs/ablations/whole")
      ->required();
  command
      ->add_option("--truth", s.truth,
                   "What they are compared with: a dataset of hsi4d synth, a run, a motion; for runs what their config "
                   "names, without")
      ->type_name("PATH");
  command->add_option("--data", s.data, "A dataset or run in whose scene the motions are, with its objects and avatar")
      ->type_name("PATH");
  command
      ->add_option("--body-model", s.body_model,
                   "A SMPL-X file: joints are those of this body, each motion's in its own shape")
      ->type_name("M.npz");
  command
      ->add_option("--avatar", s.avatar,
                   "Joints are those of this avatar; without either, of the avatar of the run or dataset")
      ->type_name("F.safetensors");
  add_evaluate_scene(*command, o);
  add_evaluate_protocol(*command, o);
  command
      ->add_option("--from-rate", s.from_rate,
                   "Frames a second of the motions, instead of what they say; of a truth that does not say it too")
      ->type_name("HZ");
  command->add_option("--frame-rate", s.frame_rate, "Frames a second to measure at, instead of the slower ones")
      ->type_name("HZ");
  command
      ->add_option(
          "--up", o.up,
          "Which axis of motions is up, y or z, instead of what is found; of a truth by other names than AMASS's "
          "too")
      ->type_name("AXIS");
  command
      ->add_option("--align", o.align,
                   "How a motion is laid on frame 0 of the truth or the data: none, heading or rotation")
      ->type_name("HOW");
  command->add_option("--person", s.person, "Which person of a folder, from 0")->check(whole_number())->type_name("N");
  command
      ->add_option("--clip", o.clips,
                   "Embeddings by CLIP, a file for each RUN; without, clip.npz in a run's folder where it is there")
      ->type_name("F.npz")
      ->allow_extra_args(false);
  command->add_option("--json", o.json, "Write all numbers into a file, those of each frame too")->type_name("F");
  command
      ->add_option("--export", o.export_folder,
                   "Write trajectories and initial states there, for TRUMANS, LINGO and CHOIS to start from")
      ->type_name("DIR");
  run_when_chosen(*command, program, [&] { return evaluate_command(o); });
}

}  // namespace hsi4d::cli
