#include "pipelines/cli/evaluate_command.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "body/motion_edit.h"
#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/log.h"
#include "core/text.h"
#include "pipelines/body_files.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/text.h"
#include "pipelines/contact_metrics.h"
#include "pipelines/json_text.h"
#include "pipelines/run_folder.h"
#include "pipelines/scene_setup.h"
#include "pipelines/tracks.h"

namespace hsi4d::cli {
namespace {

/// What one input came to.
struct Evaluation {
  std::string name, truth;
  Index frames = 0;
  double frame_rate = 0;
  MetricValues values;
  std::vector<FrameMetrics> per_frame;
};

/// A metric over the inputs that have it.
struct Spread {
  const MetricFacts* facts;
  double mean = 0, deviation = 0;  ///< the sample's standard deviation
  std::size_t count = 0;
};

/// One path, or of a chain that of each clip.
std::vector<std::string> truths_of(const EvaluateOptions& options, const std::string& input) {
  if (!options.truth.empty()) return {options.truth};
  if (!is_run_folder(input))
    throw UserError("hsi4d evaluate: " + input +
                    ": --truth says what it is compared with: a dataset of hsi4d synth, or a motion");
  std::vector<std::string> truths = truths_of_run(input);
  if (truths.empty())
    throw UserError("hsi4d evaluate: " + input +
                    ": the run's config names no truth that is there (of a chain: of each clip); --truth says what it "
                    "is compared with");
  return truths;
}

/// The skeleton of an avatar; the motions are moved to stand on it.
RestSkeleton put_on_avatar(const std::string& file, Track& track) {
  const Avatar avatar = read_avatar(file);
  track.motion = for_body(track.motion, avatar);
  return {avatar.parents, avatar.joints};
}

/// The skeleton of a body model in the motion's own shape.
RestSkeleton put_on_model(const std::string& file, Track& track) {
  const SmplxModel model = read_model_for(file, track.name, track.motion.betas);
  const BodyModel body = rest_body(model, std::span(track.motion.betas).first(static_cast<std::size_t>(model.betas)));
  track.motion = for_body(track.motion, body);
  return {body.parents, body.joints};
}

RestSkeleton put_on_body(const EvaluateOptions& options, const std::string& avatar, Track& track) {
  return options.body_model.empty() ? put_on_avatar(avatar, track) : put_on_model(options.body_model, track);
}

/// The avatar of whose body the joints are, where no model is named.
std::string avatar_for(const EvaluateOptions& options, const std::string& input, const std::string& truth) {
  if (!options.body_model.empty() || !options.avatar.empty()) return options.avatar;
  for (const std::string& path : {input, truth}) {
    const std::string avatar = avatar_of_track(path);
    if (!avatar.empty()) return avatar;
  }
  throw UserError("hsi4d evaluate: " + input + ", " + truth +
                  ": neither says of what body it is, and errors are those of its joints; --body-model M.npz or "
                  "--avatar F.safetensors says it");
}

/// What needs no truth, by frame: sliding of the feet, and contact of the hands where avatar and objects are known.
/// @param avatar  of whose body the poses are; empty: a body model's
std::vector<MetricValues> contact_of(const std::string& input, const std::string& avatar, const Track& estimate,
                                     const AlignedTracks& tracks) {
  std::vector<std::vector<double>> joints;
  for (const FrameState& state : tracks.estimate) joints.push_back(state.joints);
  std::vector<MetricValues> by_frame = sliding_by_frame(joints, tracks.frame_rate);
  const std::vector<std::string> files = object_files_of_track(input, estimate);
  if (avatar.empty() || files.empty()) return by_frame;
  std::vector<Gaussians> gaussians;
  for (const std::string& file : files) gaussians.push_back(read_object(file));
  std::vector<const Gaussians*> objects;
  for (const Gaussians& object : gaussians) objects.push_back(&object);
  const std::vector<MetricValues> contact = contact_by_frame(read_avatar(avatar), objects, tracks.states);
  for (std::size_t t = 0; t < contact.size(); ++t)
    by_frame[t].insert(by_frame[t].end(), contact[t].begin(), contact[t].end());
  return by_frame;
}

Evaluation evaluated(const EvaluateOptions& options, const std::string& input) {
  check_holds_track(input, "run");
  if (!options.truth.empty()) check_holds_track(options.truth, "dataset");
  const std::vector<std::string> truths = truths_of(options, input);
  Track estimate = read_track(input, {options.from_rate, options.person}), truth = read_joined_tracks(truths);
  const std::string avatar = avatar_for(options, input, truths.front());
  const RestSkeleton estimate_body = put_on_body(options, avatar, estimate),
                     truth_body = put_on_body(options, avatar, truth);
  const AlignedTracks tracks = aligned(estimate, estimate_body, truth, truth_body);
  Evaluation result{input, joined(truths), std::ssize(tracks.truth), tracks.frame_rate, {}, {}};
  result.values = sequence_summary(tracks.estimate, tracks.truth, tracks.frame_rate);
  result.per_frame = sequence_errors(tracks.estimate, tracks.truth);
  const std::vector<MetricValues> contact =
      contact_of(input, options.body_model.empty() ? avatar : "", estimate, tracks);
  const MetricValues means = mean_after_first(contact);
  result.values.insert(result.values.end(), means.begin(), means.end());
  for (FrameMetrics& frame : result.per_frame) {
    const MetricValues& more = contact[static_cast<std::size_t>(frame.frame)];
    frame.values.insert(frame.values.end(), more.begin(), more.end());
  }
  for (const auto& [name, value] : result.values) {
    if (!std::isfinite(value)) throw DataError(input + ": " + name + " is not a finite number");
  }
  return result;
}

void remove_member(ConfigValue& object, std::string_view key) {
  std::erase_if(object.members, [key](const ConfigMember& member) { return member.key == key; });
}

/// The config of a run without what may differ between repetitions: its name, its seeds, its threads.
std::optional<std::string> config_without_seed(const std::string& run) {
  const std::string file = RunPaths{run}.config();
  if (!is_run_folder(run) || !std::filesystem::exists(file)) return std::nullopt;
  ConfigValue tree = parse_json_text(read_text_file(file), file);
  for (const char* const key : {"name", "seed", "threads"}) remove_member(tree, key);
  for (ConfigMember& member : tree.members) {
    if (member.key == "synthetic") remove_member(member.value, "seed");
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

std::string table_of(const std::vector<Evaluation>& results, const std::vector<Spread>& spreads, bool has_mean) {
  std::vector<std::vector<std::string>> rows(1, {""});
  for (const Evaluation& result : results) rows[0].push_back(result.name);
  if (has_mean) rows[0].emplace_back("mean ± std");
  for (const Spread& spread : spreads) {
    const MetricFacts& facts = *spread.facts;
    const std::string unit = facts.unit.empty() ? "" : " [" + std::string(facts.unit) + "]";
    std::vector<std::string> row = {std::string(facts.label) + unit};
    for (const Evaluation& result : results) {
      const double* const value = find_metric(result.values, facts.name);
      row.push_back(value == nullptr ? "-" : fixed_number(*value, facts.decimals));
    }
    if (has_mean) {
      row.push_back(fixed_number(spread.mean, facts.decimals) +
                    (spread.count > 1 ? " ± " + fixed_number(spread.deviation, facts.decimals) : ""));
    }
    rows.push_back(std::move(row));
  }
  return table(rows);
}

std::string frames_text(const std::vector<Evaluation>& results) {
  std::string text;
  for (const Evaluation& result : results)
    text += result.name + ": frames 1 to " + std::to_string(result.frames - 1) + " at " +
            short_number(result.frame_rate) + " a second, against " + result.truth + "\n";
  return text;
}

void add_numbers(ConfigValue& object, const MetricValues& values) {
  for (const auto& [name, value] : values) object.add(name, ConfigValue::make_number(value));
}

ConfigValue object_of(const MetricValues& values) {
  ConfigValue object = ConfigValue::make_object();
  add_numbers(object, values);
  return object;
}

ConfigValue json_of(const Evaluation& result) {
  ConfigValue object = ConfigValue::make_object();
  object.add("name", ConfigValue::make_string(result.name));
  object.add("truth", ConfigValue::make_string(result.truth));
  object.add("frames", ConfigValue::make_integer(result.frames));
  object.add("frame_rate", ConfigValue::make_number(result.frame_rate));
  add_numbers(object, result.values);
  ConfigValue frames = ConfigValue::make_array();
  for (const FrameMetrics& frame : result.per_frame) {
    ConfigValue values = ConfigValue::make_object();
    values.add("frame", ConfigValue::make_integer(frame.frame));
    add_numbers(values, frame.values);
    frames.items.push_back(std::move(values));
  }
  object.add("per_frame", std::move(frames));
  return object;
}

std::string json_text(const std::vector<Evaluation>& results, const std::vector<Spread>& spreads, bool has_mean) {
  ConfigValue root = ConfigValue::make_object(), all = ConfigValue::make_array();
  for (const Evaluation& result : results) all.items.push_back(json_of(result));
  root.add("results", std::move(all));
  if (!has_mean) return to_json(root);
  MetricValues means, deviations;
  for (const Spread& spread : spreads) {
    means.emplace_back(spread.facts->name, spread.mean);
    if (spread.count > 1) deviations.emplace_back(spread.facts->name, spread.deviation);
  }
  root.add("mean", object_of(means));
  root.add("std", object_of(deviations));
  return to_json(root);
}

}  // namespace

std::string evaluate_command(const EvaluateOptions& options) {
  if (!options.body_model.empty() && !options.avatar.empty())
    throw UserError("hsi4d evaluate: --body-model and --avatar both say of what body the joints are; give one");
  check_rate(options.from_rate, "hsi4d evaluate: --from-rate");
  if (!options.json.empty()) {
    check_no_input(options.json, "hsi4d evaluate: --json", {options.truth, options.body_model, options.avatar});
    check_no_input(options.json, "hsi4d evaluate: --json", options.inputs);
    check_writable(options.json);
  }
  std::vector<Evaluation> results;
  for (const std::string& input : options.inputs) results.push_back(evaluated(options, input));
  const std::vector<Spread> spreads = spreads_of(results);
  const bool is_alike = are_repetitions(options.inputs);
  if (!options.json.empty()) write_text_file(options.json, json_text(results, spreads, is_alike));
  return table_of(results, spreads, is_alike && results.size() > 1) + "\n" + frames_text(results);
}

}  // namespace hsi4d::cli
