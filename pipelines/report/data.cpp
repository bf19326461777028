#include "pipelines/report/data.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "body/body_model.h"
#include "core/check.h"
#include "core/config_value.h"
#include "core/json_text.h"
#include "core/npz.h"
#include "core/progress.h"
#include "pipelines/draw/plate_mark.h"
#include "pipelines/input/state.h"
#include "pipelines/metrics/sigma_metrics.h"
#include "pipelines/record/folder.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;
using Kind = ConfigValue::Kind;

bool is_file(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

/// A value for people: strings without quotes, everything else as JSON.
std::string plain_text(const ConfigValue& value) { return value.kind == Kind::kString ? value.text : shown(value); }

// ---- status.json and config.resolved.json ----

void add_fact(ReportData& data, const ConfigValue& tree, std::string_view key, const std::string& label) {
  const ConfigValue* const member = find_member(tree, key);
  if (member == nullptr || member->kind == Kind::kNull) return;
  const bool known =
      std::any_of(data.facts.begin(), data.facts.end(), [&label](const auto& fact) { return fact.first == label; });
  if (known) return;
  std::string text = plain_text(*member);
  if (key == "threads" && text == "0") text = "one a core";
  data.facts.emplace_back(label, std::move(text));
}

ConfigValue read_object(const std::string& path, const std::string& text) {
  ConfigValue tree = parse_json_text(text, path);
  check_kind(tree, Kind::kObject, "");
  return tree;
}

void read_status(const RunPaths& paths, ReportData& data) {
  data.state = "unknown";
  if (!is_file(paths.status())) {
    data.notes.emplace_back("status.json is missing: nobody knows how the run ended.");
    return;
  }
  const ConfigValue tree = read_object(paths.status(), read_text_file(paths.status()));
  const std::string state = string_member(tree, "state");
  if (!state.empty()) data.state = state;
  data.message = string_member(tree, "message");
  data.is_orphaned = state == run_state_name(RunState::kRunning) && !is_run_locked(paths.folder.string());
  for (const auto& [key, label] : {std::pair("version", "version"),
                                   {"git", "commit"},
                                   {"host", "host"},
                                   {"seed", "seed"},
                                   {"threads", "threads"},
                                   {"precision", "precision"},
                                   {"started", "started"},
                                   {"resumed", "resumed"},
                                   {"updated", "last update"}})
    add_fact(data, tree, key, label);
}

void read_config_file(const RunPaths& paths, ReportData& data) {
  if (!is_file(paths.config())) {
    data.notes.emplace_back("config.resolved.json is missing: the settings of the run are not known.");
    return;
  }
  data.config = read_text_file(paths.config());
  const ConfigValue tree = read_object(paths.config(), data.config);
  const std::string name = string_member(tree, "name");
  if (!name.empty()) data.name = name;
  for (const char* const key : {"seed", "threads", "precision"}) add_fact(data, tree, key, key);
  if (const ConfigValue* const render = find_member(tree, "render")) {
    add_fact(data, *render, "quality", "quality");
    add_fact(data, *render, "compatibility", "compatibility");
  }
}

void read_summary_file(const RunPaths& paths, ReportData& data) {
  if (!is_file(paths.summary())) {
    data.notes.emplace_back("summary.json is missing: the run has not come to its end, so no errors are told.");
    return;
  }
  data.summary = parse_summary(read_text_file(paths.summary()), paths.summary());
  if (error_table(*data.summary).rows.empty())
    data.notes.emplace_back("summary.json has no errors: the run had no ground truth to compare with.");
  else if (!data.summary->has_truth)
    data.notes.emplace_back("The run had no ground truth: errors of body, objects and camera are not measured.");
  if (data.summary->baselines.empty())
    data.notes.emplace_back("summary.json has no baselines: the result is shown without its start.");
  if (!data.summary->name.empty()) data.name = data.summary->name;
  if (data.summary->is_on_plate) data.facts.emplace_back("scene", kPlateText);
  data.facts.emplace_back("frames", std::to_string(data.summary->frames));
  data.facts.emplace_back("time", duration_text(data.summary->seconds));
}

// ---- metrics.jsonl ----

struct MetricsLine {
  std::string stage;
  std::optional<int> frame;
  double iteration = 0, seconds = 0;
  std::optional<double> loss;  // null where the step was rolled back
  bool rolled_back = false;
};

MetricsLine parse_line(const std::string& text, const std::string& file, int line) {
  const ConfigValue tree = parse_json_text(text, file, line);
  check_kind(tree, Kind::kObject, "");
  const auto member = [&tree](std::string_view key) {
    const ConfigValue* const found = find_member(tree, key);
    if (found == nullptr) fail_at(tree, "", "there is no " + json_string(key));
    return *found;
  };
  MetricsLine read;
  const ConfigValue stage = member("stage");
  check_kind(stage, Kind::kString, "/stage");
  read.stage = stage.text;
  if (const ConfigValue* const frame = find_member(tree, "frame"))
    read.frame = static_cast<int>(whole_number_of(*frame, "/frame"));
  read.iteration = static_cast<double>(whole_number_of(member("iteration"), "/iteration"));
  const ConfigValue loss = member("loss");
  if (loss.kind != Kind::kNull) read.loss = number_of(loss, "/loss");
  if (const ConfigValue* const seconds = find_member(tree, "seconds")) read.seconds = number_of(*seconds, "/seconds");
  const ConfigValue* const rolled_back = find_member(tree, "rolled_back");
  read.rolled_back = rolled_back != nullptr && rolled_back->kind == Kind::kBoolean && rolled_back->boolean;
  return read;
}

void add_line(std::vector<StageCurves>& stages, const MetricsLine& line) {
  auto at = std::find_if(stages.begin(), stages.end(), [&](const StageCurves& s) { return s.stage == line.stage; });
  if (at == stages.end()) at = stages.insert(stages.end(), StageCurves{line.stage, 0, 0, 0, {}});
  at->seconds += line.seconds;
  ++at->iterations;
  if (line.rolled_back) ++at->rolled_back;
  if (at->curves.empty() || at->curves.back().frame != line.frame) at->curves.push_back({line.frame, {}});
  if (line.loss) at->curves.back().points.emplace_back(line.iteration, *line.loss);
}

void read_metrics_file(const RunPaths& paths, ReportData& data) {
  if (!is_file(paths.metrics())) {
    data.notes.emplace_back("metrics.jsonl is missing: there are no loss curves.");
    return;
  }
  const std::string text = read_text_file(paths.metrics());
  size_t begin = 0;
  for (int number = 1; begin < text.size(); ++number) {
    const size_t end = text.find('\n', begin);
    if (end == std::string::npos) {
      data.notes.emplace_back("The last line of metrics.jsonl was cut short and is left out.");
      break;
    }
    const std::string line = text.substr(begin, end - begin);
    try {
      add_line(data.stages, parse_line(line, paths.metrics(), 1));
    } catch (const DataError&) {
      parse_line(line, paths.metrics(), number);  // the same fault, told with the line of the file
      throw;
    }
    begin = end + 1;
  }
  if (data.stages.empty()) data.notes.emplace_back("metrics.jsonl has no lines yet: there are no loss curves.");
  for (const StageCurves& stage : data.stages) {
    if (stage.rolled_back > 0)
      data.notes.push_back("Stage " + stage.stage + ": " + std::to_string(stage.rolled_back) + " of " +
                           std::to_string(stage.iterations) +
                           " steps were rolled back because a number in them was not finite.");
  }
}

void read_view_file(const RunPaths& paths, ReportData& data) {
  if (!is_file(paths.view3d())) {
    data.notes.emplace_back("view3d.safetensors is missing: there is no 3D view.");
    return;
  }
  data.view3d = read_view3d(paths.view3d());
}

// ---- motion.npz and objects.npz: how sure places are ----

/// The objects of objects.npz that have sigmas.
std::vector<std::string> objects_with_sigmas(const std::string& path) {
  constexpr std::string_view kEnding = "/sigma";
  std::vector<std::string> names;
  if (!is_file(path)) return names;
  const Npz file = Npz::read(path);
  for (const std::string& name : file.names())
    if (name.ends_with(kEnding)) names.push_back(name.substr(0, name.size() - kEnding.size()));
  return names;
}

/// @param sigma_in  of one frame
template <class F>
PlaceRow place_row(const std::string& name, bool is_object, const std::vector<PlaceSigmas>& frames, F sigma_in) {
  PlaceRow row{name, is_object};
  for (const PlaceSigmas& frame : frames) {
    const PlaceSigma& sigma = sigma_in(frame);
    if (std::isnan(sigma.along)) continue;
    const bool is_sure = sigma.across < kUnsure && sigma.along < kUnsure;
    ++(is_sure ? row.sure : row.unsure);
    row.across += is_sure ? sigma.across : 0;
    row.along += is_sure ? sigma.along : 0;
  }
  const double count = std::max<double>(1, static_cast<double>(row.sure));
  row.across /= count;
  row.along /= count;
  return row;
}

void read_sigmas(const RunPaths& paths, ReportData& data) {
  if (!is_file(paths.motion())) return;
  const std::vector<std::string> objects = objects_with_sigmas(paths.objects());
  const std::vector<PlaceSigmas> frames = read_place_sigmas(paths.motion(), paths.objects(), objects);
  if (frames.empty()) return;
  const auto add = [&](const std::string& name, bool is_object, auto sigma_in) {
    const PlaceRow row = place_row(name, is_object, frames, sigma_in);
    if (row.sure + row.unsure > 0) data.places.push_back(row);
  };
  for (std::size_t o = 0; o < objects.size(); ++o)
    add(objects[o], true, [o](const PlaceSigmas& frame) { return frame.objects[o]; });
  for (std::size_t j = 0; j < frames[0].joints.size(); ++j)
    add(smplx_joint_names()[j], false, [j](const PlaceSigmas& frame) { return frame.joints[j]; });
}

fs::path whole_path(const fs::path& folder) {
  const fs::path whole = fs::absolute(folder).lexically_normal();
  return whole.has_filename() ? whole : whole.parent_path();
}

std::string folder_name(const fs::path& folder) { return whole_path(folder).filename().string(); }

/// Folder and what it is in, "first/run": a demo's run says little by itself.
std::string folder_text(const fs::path& folder) {
  const fs::path whole = whole_path(folder);
  return (whole.parent_path().filename() / whole.filename()).generic_string();
}

}  // namespace

ReportData read_report_data(const std::string& run_folder) {
  const RunPaths paths{run_folder};
  std::error_code error;
  if (!fs::exists(run_folder, error)) throw UserError(run_folder + ": there is no such run folder");
  if (!fs::is_directory(run_folder, error)) throw UserError(run_folder + ": is not a folder; give the folder of a run");
  const std::array members = {paths.status(), paths.config(), paths.summary(), paths.metrics()};
  const fs::path inner = paths.folder / "run";  // of hsi4d demo
  if (std::none_of(members.begin(), members.end(), is_file) && is_file(RunPaths{inner}.status()))
    throw UserError(run_folder + ": holds no run; did you mean " + inner.generic_string() + "?");
  if (std::none_of(members.begin(), members.end(), is_file))
    throw UserError(run_folder +
                    ": holds no run: there is neither status.json nor config.resolved.json, summary.json "
                    "or metrics.jsonl in it");
  ReportData data;
  data.name = folder_name(run_folder);
  data.facts.emplace_back("folder", folder_text(run_folder));
  read_status(paths, data);
  read_config_file(paths, data);
  read_summary_file(paths, data);
  read_metrics_file(paths, data);
  data.frames = read_frame_images(paths.frames(), data.notes);
  read_view_file(paths, data);
  read_sigmas(paths, data);
  return data;
}

}  // namespace hsi4d
