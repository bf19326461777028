#include "pipelines/sweep/selection.h"

#include <algorithm>

#include "core/check.h"
#include "core/config_value.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;

/// A sweep's folder and the name behind it.
struct SweepPlace {
  std::string folder, name;
};

std::optional<SweepPlace> place_of(const std::string& path) {
  if (is_sweep_folder(path)) return SweepPlace{path, ""};
  std::error_code error;
  if (fs::exists(path, error)) return std::nullopt;
  for (std::size_t slash = path.rfind('/'); slash != std::string::npos && slash > 0; slash = path.rfind('/', slash - 1))
    if (is_sweep_folder(path.substr(0, slash))) return SweepPlace{path.substr(0, slash), path.substr(slash + 1)};
  return std::nullopt;
}

std::vector<std::string> parts_of(const std::string& name) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= name.size();) {
    const std::size_t end = std::min(name.find(',', begin), name.size());
    const std::size_t first = name.find_first_not_of(' ', begin), last = name.find_last_not_of(' ', end - 1);
    if (first < end) parts.push_back(name.substr(first, last + 1 - first));
    begin = end + 1;
  }
  return parts;
}

/// The value of a run on an axis that it has.
const std::string& value_of(const SweepRun& run, const std::string& axis) {
  if (axis == "block") return run.block;
  if (axis == "clip") return run.clip;
  if (axis == "ablation") return run.ablation;
  if (axis == "seed") return run.seed;
  const auto is_it = [&axis](const auto& entry) { return entry.first == axis; };
  return std::find_if(run.values.begin(), run.values.end(), is_it)->second;
}

/// Whether a part of a run's name was written: as it is shown, or as AXIS=VALUE.
bool is_written(const SweepRun& run, const SweepLabelPart& own, const std::string& part) {
  if (own.text == part) return true;
  const std::size_t equals = part.find('=');
  if (equals == std::string::npos) return false;
  const std::string axis = part.substr(0, equals), value = part.substr(equals + 1);
  if (axis != own.axis && axis != short_sweep_key(own.axis)) return false;
  const std::string& has = value_of(run, own.axis);
  return has == value || has == json_string(value);
}

/// Whether a run has a part of a name. @param axes  receives those that it is of
bool has_part(const SweepRun& run, const std::string& part, std::set<std::string>& axes) {
  bool has = false;
  for (const SweepLabelPart& own : sweep_label_parts(run)) {
    if (!is_written(run, own, part)) continue;
    axes.insert(own.axis);
    has = true;
  }
  return has;
}

[[noreturn]] void refuse_part(const SweepPlace& place, const SweepPlan& plan, const std::string& part) {
  constexpr std::size_t kMost = 30;  // of names that are told
  std::vector<std::string> known;
  for (const SweepRun& run : plan.runs) {
    for (const SweepLabelPart& own : sweep_label_parts(run)) {
      if (std::find(known.begin(), known.end(), own.text) == known.end()) known.push_back(own.text);
    }
  }
  const std::string hint = did_you_mean(part, known);
  const bool is_cut = known.size() > kMost;
  known.resize(std::min(known.size(), kMost));
  throw UserError(place.folder + "/" + place.name + ": is not there, and the sweep in " + place.folder +
                  " has no run with " + json_string(part) + "; known: " + joined(known) + (is_cut ? ", ..." : "") +
                  hint);
}

/// The runs whose name, or whose row's name, is the whole of what was written.
std::vector<std::size_t> runs_called(const std::string& name, SweepSelection& selection) {
  std::vector<std::size_t> runs;
  for (const bool is_row : {false, true}) {
    for (std::size_t i = 0; i < selection.plan.runs.size(); ++i) {
      const SweepRun run = is_row ? without_repetition(selection.plan.runs[i]) : selection.plan.runs[i];
      if (sweep_label(run) != name) continue;
      runs.push_back(i);
      for (const SweepLabelPart& part : sweep_label_parts(run)) selection.axes.insert(part.axis);
    }
    if (!runs.empty()) break;
  }
  return runs;
}

std::vector<std::size_t> runs_with_parts(const SweepPlace& place, SweepSelection& selection) {
  const std::vector<std::string> parts = parts_of(place.name);
  const std::vector<SweepRun>& all = selection.plan.runs;
  for (const std::string& part : parts) {
    const bool is_known = std::any_of(all.begin(), all.end(), [&part](const SweepRun& run) {
      std::set<std::string> axes;
      return has_part(run, part, axes);
    });
    if (!is_known) refuse_part(place, selection.plan, part);
  }
  std::vector<std::size_t> runs;
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::set<std::string> axes;
    if (!std::all_of(parts.begin(), parts.end(), [&](const std::string& part) { return has_part(all[i], part, axes); }))
      continue;
    runs.push_back(i);
    selection.axes.merge(axes);
  }
  if (runs.empty())
    throw UserError(place.folder + "/" + place.name + ": the sweep in " + place.folder +
                    " has runs with each of these, and none with all of them");
  return runs;
}

std::vector<std::size_t> named_runs(const SweepPlace& place, SweepSelection& selection) {
  std::vector<std::size_t> runs;
  if (parts_of(place.name).empty()) {
    for (std::size_t i = 0; i < selection.plan.runs.size(); ++i) runs.push_back(i);
    return runs;
  }
  runs = runs_called(place.name, selection);
  return runs.empty() ? runs_with_parts(place, selection) : runs;
}

}  // namespace

std::optional<SweepSelection> select_sweep_runs(const std::string& path) {
  const std::optional<SweepPlace> place = place_of(path);
  if (!place) return std::nullopt;
  SweepSelection selection{path, {place->folder}, read_sweep_plan({place->folder}), {}, {}, 0, {}};
  selection.named = named_runs(*place, selection);
  std::set<std::string> seen;
  for (const std::size_t run : selection.named) {
    const std::string& id = selection.plan.runs[run].id;
    if (!seen.insert(id).second) continue;
    if (sweep_run_state(selection.paths, id) == SweepRunState::kDone) {
      selection.runs.push_back(run);
    } else {
      ++selection.not_done;
    }
  }
  if (selection.runs.empty())
    throw UserError(path + ": none of " + std::to_string(selection.not_done) +
                    (selection.not_done == 1 ? " run" : " runs") + " is done; hsi4d report " + place->folder +
                    " tells how they stand");
  return selection;
}

std::string name_without_axes(const SweepRun& run, const std::set<std::string>& axes) {
  std::vector<std::string> texts;
  for (SweepLabelPart& part : sweep_label_parts(run)) {
    if (!axes.contains(part.axis)) texts.push_back(std::move(part.text));
  }
  return joined(texts);
}

}  // namespace hsi4d
