#include "pipelines/study/pairs.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/evaluate/prompt.h"
#include "pipelines/record/folder.h"
#include "pipelines/sweep/selection.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;
using Runs = std::map<std::string, fs::path>;

bool has_preview(const fs::path& folder) { return fs::is_regular_file(RunPaths{folder}.preview()); }

/// The folders in a folder by name, links last: what two names lead to is then known by its own.
std::vector<fs::path> folders_in(const fs::path& folder) {
  std::vector<fs::path> folders;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_directory(error)) folders.push_back(entry.path());
  }
  const auto place = [](const fs::path& path) { return std::pair(fs::is_symlink(path), path); };
  std::sort(folders.begin(), folders.end(), [&](const fs::path& x, const fs::path& y) { return place(x) < place(y); });
  return folders;
}

/// @param seen  folders that were looked into, without links; none is a second time
void collect(const fs::path& folder, const std::string& name, std::set<fs::path>& seen, Runs& runs) {
  if (!seen.insert(fs::canonical(folder)).second) return;
  if (has_preview(folder)) {
    runs[name] = folder;
    return;
  }
  for (const fs::path& inner : folders_in(folder))
    collect(inner, (name.empty() ? "" : name + "/") + inner.filename().string(), seen, runs);
}

/// The runs of a sweep that can be shown, by their names without these axes.
Runs runs_of_sweep(const SweepSelection& selection, const std::set<std::string>& axes,
                   std::vector<std::string>& notes) {
  Runs runs;
  std::map<std::string, std::string> whole_names;
  std::size_t silent = 0;
  for (const std::size_t run : selection.runs) {
    const fs::path folder = selection.folder(run);
    if (!has_preview(folder)) {
      ++silent;
      continue;
    }
    const std::string name = name_without_axes(selection.plan.runs[run], axes), whole = selection.name(run);
    if (!runs.emplace(name, folder).second)
      throw UserError(selection.text + ": " + json_string(whole_names[name]) + " and " + json_string(whole) +
                      " would both be compared with one run of the other side; name more of what the runs have");
    whole_names[name] = whole;
  }
  if (runs.empty())
    throw UserError(selection.text +
                    ": no run has a preview.mp4, which is made where ffmpeg is installed and log.preview is on");
  const auto tell = [&](std::size_t count, const char* why) {
    if (count > 0)
      notes.push_back(selection.text + ": " + std::to_string(count) + (count == 1 ? " run is" : " runs are") +
                      " left out, " + why);
  };
  tell(selection.not_done, "not done yet");
  tell(silent, "without a preview.mp4");
  return runs;
}

/// By names relative to the folder; "" where it is a run itself.
Runs runs_in(const std::string& folder) {
  if (!fs::is_directory(folder)) throw UserError(folder + ": there is no such folder");
  Runs runs;
  std::set<fs::path> seen;
  collect(folder, "", seen, runs);
  if (runs.empty())
    throw UserError(folder +
                    ": holds no run with a preview.mp4, in it or in its folders; a run that has come to its "
                    "end has one where ffmpeg is installed and log.preview is on");
  return runs;
}

std::string text_of_both(const StudyRuns& pair) {
  const std::string a = run_prompt(pair.a), b = run_prompt(pair.b);
  if (!a.empty() && !b.empty() && a != b)
    throw UserError(pair.a.string() + ", " + pair.b.string() + ": were made of different texts, " + json_string(a) +
                    " and " + json_string(b) + "; --texts says what both are to be compared with");
  return a.empty() ? b : a;
}

void take_texts(const std::string& file, std::vector<StudyRuns>& pairs) {
  const ConfigValue root = parse_json_text(read_text_file(file), file);
  check_kind(root, ConfigValue::Kind::kObject, "");
  std::vector<std::string> names;
  for (const StudyRuns& pair : pairs) names.push_back(pair.name);
  for (const ConfigMember& member : root.members) {
    const std::string pointer = child_pointer("", member.key);
    check_kind(member.value, ConfigValue::Kind::kString, pointer);
    const auto at = std::find(names.begin(), names.end(), member.key);
    if (at == names.end())
      fail_at(member.value, pointer,
              "there is no such pair" + did_you_mean(member.key, names) + "; there are " + joined(names));
    pairs[static_cast<std::size_t>(at - names.begin())].text = member.value.text;
  }
}

/// Those of `runs` that `others` has not, told.
void tell_unmatched(const std::string& folder, const Runs& runs, const std::string& other, const Runs& others,
                    std::vector<std::string>& notes) {
  std::vector<std::string> names;
  for (const auto& [name, run] : runs) {
    if (!others.contains(name)) names.push_back(name);
  }
  if (!names.empty()) notes.push_back(other + " lacks what " + folder + " has, which is left out: " + joined(names));
}

/// What A and B hold. Runs of sweeps go by their names without what either side has named: "seed 1" both of A's
/// "whole, seed 1" and of B's "no_color_net, seed 1".
std::pair<Runs, Runs> runs_of_both(const std::string& a, const std::string& b, std::vector<std::string>& notes) {
  const std::optional<SweepSelection> first = select_sweep_runs(a), second = select_sweep_runs(b);
  std::set<std::string> axes;
  for (const std::optional<SweepSelection>* const selection : {&first, &second}) {
    if (*selection) axes.insert((*selection)->axes.begin(), (*selection)->axes.end());
  }
  return {first ? runs_of_sweep(*first, axes, notes) : runs_in(a),
          second ? runs_of_sweep(*second, axes, notes) : runs_in(b)};
}

std::vector<StudyRuns> matched(const std::string& a, const std::string& b, std::vector<std::string>& notes) {
  const auto [first, second] = runs_of_both(a, b, notes);
  const bool is_run = first.contains(""), is_other_run = second.contains("");
  if (is_run != is_other_run)
    throw UserError((is_run ? a : b) + " is one run, " + (is_run ? b : a) +
                    " a folder of runs; a study compares two runs, or runs of the same names in two folders");
  std::vector<StudyRuns> pairs;
  for (const auto& [name, run] : first) {
    const auto other = second.find(name);
    if (other != second.end()) pairs.push_back({is_run ? "pair" : name, run, other->second, ""});
  }
  if (pairs.empty())
    throw UserError(a + ", " + b + ": no run is in both by the same name; the first has " + first.begin()->first +
                    (first.size() > 1 ? ", ..." : "") + ", the second " + second.begin()->first +
                    (second.size() > 1 ? ", ..." : ""));
  tell_unmatched(a, first, b, second, notes);
  tell_unmatched(b, second, a, first, notes);
  return pairs;
}

}  // namespace

std::vector<StudyRuns> study_runs(const std::string& a, const std::string& b, const std::string& texts,
                                  std::vector<std::string>& notes) {
  std::vector<StudyRuns> pairs = matched(a, b, notes);
  for (const StudyRuns& pair : pairs) {
    if (fs::equivalent(pair.a, pair.b))
      throw UserError(pair.a.string() + ", " + pair.b.string() + ": are the same run; there is nothing to choose");
  }
  if (!texts.empty()) take_texts(texts, pairs);
  std::vector<std::string> silent;
  for (StudyRuns& pair : pairs) {
    if (pair.text.empty()) pair.text = text_of_both(pair);
    if (pair.text.empty()) silent.push_back(pair.name);
  }
  if (!silent.empty())
    notes.push_back("no text is known of " + joined(silent) +
                    ": agreement with it is not asked; sources.prompt of a run's config says it, or --texts");
  return pairs;
}

}  // namespace hsi4d
