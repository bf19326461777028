#include "pipelines/record/folder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/check.h"
#include "core/config_value.h"
#include "core/disk.h"
#include "core/file.h"
#include "core/file_lock.h"
#include "core/host.h"
#include "core/json_text.h"
#include "core/text.h"
#include "core/version.h"
#include "pipelines/config/run_config.h"
#include "pipelines/record/appended_file.h"
#include "pipelines/record/gradient_table.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;
using Kind = ConfigValue::Kind;

constexpr std::array kStates = {RunState::kRunning, RunState::kDone, RunState::kFailed, RunState::kInterrupted};
constexpr size_t kMostDifferences = 8;  // told of a config that differs

std::string busy_message(const std::string& folder) {
  return folder + ": another process is writing this run; wait for it, or choose another folder";
}

// ---- What is in a folder ----

/// What a run leaves behind that was killed before it wrote its config: of no worth, and no reason to refuse a folder.
bool is_trace(const std::string& name) { return name == ".lock" || name.ends_with(".tmp"); }

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    names.push_back(it->path().filename().string());
  if (error) throw UserError(folder.string() + ": cannot be read: " + error.message());
  std::sort(names.begin(), names.end());
  return names;
}

/// The state that status.json tells; running where there is none or it cannot be read, as after a kill.
RunState found_state(const std::string& text) {
  try {
    const std::string name = string_member(parse_json_text(text, "status.json"), "state");
    for (const RunState state : kStates) {
      if (run_state_name(state) == name) return state;
    }
  } catch (const DataError&) {  // damaged: the config decides whether the run can go on
  }
  return RunState::kRunning;
}

std::string found_member(const std::string& text, std::string_view key) {
  try {
    return string_member(parse_json_text(text, "status.json"), key);
  } catch (const DataError&) {
    return "";
  }
}

std::string text_if_there(const std::string& path) { return fs::exists(path) ? read_text_file(path) : ""; }

// ---- Configs that differ ----

std::string keys_of(const ConfigValue& object) {
  std::vector<std::string> keys;
  for (const ConfigMember& member : object.members) keys.push_back(member.key);
  return joined(keys);
}

/// Whether the keys that both have come in one order in both. That of stages is the order in which they run, that of
/// losses and groups the one in which sums are taken.
bool have_one_order(const ConfigValue& a, const ConfigValue& b) {
  const auto common = [](const ConfigValue& object, const ConfigValue& other) {
    std::vector<std::string_view> keys;
    for (const ConfigMember& member : object.members) {
      if (find_member(other, member.key) != nullptr) keys.push_back(member.key);
    }
    return keys;
  };
  return common(a, b) == common(b, a);
}

/// Appends "POINTER: A in the folder, B now" for everything that differs.
void find_differences(const ConfigValue& before, const ConfigValue& now, const std::string& pointer,
                      std::vector<std::string>& out) {
  if (before.kind == Kind::kObject && now.kind == Kind::kObject) {
    for (const ConfigMember& member : before.members) {
      const ConfigValue* const other = find_member(now, member.key);
      const std::string place = child_pointer(pointer, member.key);
      if (other != nullptr) {
        find_differences(member.value, *other, place, out);
      } else {
        out.push_back(place + ": " + shown(member.value) + " in the folder, absent now");
      }
    }
    for (const ConfigMember& member : now.members) {
      if (find_member(before, member.key) == nullptr)
        out.push_back(child_pointer(pointer, member.key) + ": absent in the folder, " + shown(member.value) + " now");
    }
    if (!pointer.empty() && !have_one_order(before, now)) {
      out.push_back(pointer + ": in the order " + keys_of(before) + " in the folder, " + keys_of(now) + " now");
    }
  } else if (to_json_line(before) != to_json_line(now)) {
    out.push_back((pointer.empty() ? "/" : pointer) + ": " + shown(before) + " in the folder, " + shown(now) + " now");
  }
}

/// What differs, a line each and each with a line break before it; empty where a run can be resumed.
std::string describe_differences(const std::string& before, const std::string& now) {
  std::vector<std::string> differences;
  try {
    find_differences(without_data(parse_json_text(before, "config.resolved.json")),
                     without_data(parse_json_text(now, "config")), "", differences);
    if (differences.empty()) return "";
  } catch (const DataError&) {  // by hand, perhaps; there is nothing to compare setting by setting
    if (before == now) return "";
  }
  std::string text;
  for (size_t i = 0; i < std::min(differences.size(), kMostDifferences); ++i) text += "\n  " + differences[i];
  if (differences.size() > kMostDifferences)
    text += "\n  and " + std::to_string(differences.size() - kMostDifferences) + " more";
  return text.empty() ? " (in its text only)" : text;
}

// ---- Lines of metrics.jsonl ----

/// A number that must be finite, or null where the step was rolled back (row F12: JSON infinities).
ConfigValue record_number(double value, const std::string& pointer, bool rolled_back) {
  if (!std::isfinite(value) && rolled_back) return ConfigValue::make_null();
  HSI4D_CHECK(std::isfinite(value), "metrics.jsonl: " + pointer + ": " + std::to_string(value) + " is not finite");
  return ConfigValue::make_number(value);
}

/// A condition that is infinite is null.
ConfigValue matrix_json(const MatrixStep& step) {
  ConfigValue object = ConfigValue::make_object();
  if (step.gain_ratio) object.add("gain_ratio", record_number(*step.gain_ratio, "/matrix/gain_ratio", true));
  object.add("damping", record_number(step.damping, "/matrix/damping", false));
  object.add("condition", record_number(step.condition, "/matrix/condition", true));
  if (step.refused) object.add("refused", ConfigValue::make_boolean(true));
  return object;
}

std::string metrics_line(const IterationRecord& record) {
  ConfigValue line = ConfigValue::make_object();
  if (record.frame) line.add("frame", ConfigValue::make_integer(*record.frame));
  line.add("stage", ConfigValue::make_string(record.stage));
  line.add("iteration", ConfigValue::make_integer(record.iteration));
  line.add("loss", record_number(record.loss, "/loss", record.rolled_back));
  ConfigValue losses = ConfigValue::make_object();
  for (const auto& [name, value] : record.losses)
    losses.add(name, record_number(value, child_pointer("/losses", name), record.rolled_back));
  line.add("losses", std::move(losses));
  if (!record.gradient_shares.empty()) line.add("gradient_shares", gradient_shares_json(record.gradient_shares));
  if (record.matrix) line.add("matrix", matrix_json(*record.matrix));
  for (const auto& [name, value] : record.counters)
    line.add(name, record_number(value, child_pointer("", name), false));
  line.add("seconds", record_number(record.seconds, "/seconds", false));
  if (record.rolled_back) line.add("rolled_back", ConfigValue::make_boolean(true));
  return to_json_line(line) + "\n";
}

/// What a line of metrics.jsonl is of; no frame: of all at once.
struct LineOrigin {
  std::string stage;
  std::optional<int> frame;
};

LineOrigin origin_of_line(const std::string& text, const std::string& file, int line) {
  const auto read = [&](int at) -> LineOrigin {
    const ConfigValue record = parse_json_text(text, file, at);
    check_kind(record, Kind::kObject, "");
    const ConfigValue* const stage = find_member(record, "stage");
    if (stage == nullptr) fail_at(record, "", "there is no \"stage\"");
    check_kind(*stage, Kind::kString, "/stage");
    const ConfigValue* const frame = find_member(record, "frame");
    if (frame == nullptr) return {stage->text, std::nullopt};
    return {stage->text, static_cast<int>(whole_number_of(*frame, "/frame"))};
  };
  try {
    return read(1);
  } catch (const DataError&) {
    return read(line);  // the same fault, told with the line of the file
  }
}

/// The complete lines that are kept.
template <class F>
std::string kept_lines(const std::string& text, const F& is_kept, const std::string& file) {
  std::string kept;
  size_t begin = 0;
  for (int line = 1; begin < text.size(); ++line) {
    const size_t end = text.find('\n', begin);
    if (end == std::string::npos) break;  // cut short by a kill
    const LineOrigin origin = origin_of_line(text.substr(begin, end - begin), file, line);
    if (is_kept(origin.stage, origin.frame)) kept.append(text, begin, end + 1 - begin);
    begin = end + 1;
  }
  return kept;
}

}  // namespace

std::string_view run_state_name(RunState state) {
  switch (state) {
    case RunState::kRunning:
      return "running";
    case RunState::kDone:
      return "done";
    case RunState::kFailed:
      return "failed";
    case RunState::kInterrupted:
      return "interrupted";
  }
  return "";
}

std::string RunPaths::frame_color_net(int frame) const {
  return (folder / "checkpoint" / ("color_net_" + four_digits(frame) + ".safetensors")).string();
}

std::string RunPaths::frame_image(int frame, std::string_view kind) const {
  return (folder / "frames" / (four_digits(frame) + "_" + std::string(kind) + ".png")).string();
}

/// The lock on a run folder.
struct RunFolder::Lock {
  explicit Lock(const RunPaths& paths) : lock(opened(paths)) {
    const std::string folder = paths.folder.string();
    const FileLock::State state = lock.take();
    if (state == FileLock::State::kBusy) throw UserError(busy_message(folder));
    if (state == FileLock::State::kNoLocks)
      log_warning(folder +
                  ": this file system has no locks: two runs that write this folder would not notice each other");
  }

  static FileLock opened(const RunPaths& paths) {
    try {
      return FileLock(paths.lock());
    } catch (const UserError& error) {  // of the folder, which the user knows
      throw UserError(paths.folder.string() + std::string(error.what()).substr(paths.lock().size()));
    }
  }

  FileLock lock;
};

namespace {

/// What a folder holds, as far as a new run is concerned.
struct Found {
  bool is_run = false;  ///< it has a resolved config
  std::string config, status;
};

/// Looks at a folder; refuses what is neither a run nor empty.
Found look_at_folder(const RunPaths& paths) {
  std::error_code error;
  const fs::file_status status = fs::status(paths.folder, error);
  if (!fs::exists(status)) return {};
  const std::string name = paths.folder.string();
  if (!fs::is_directory(status)) throw UserError(name + ": is a file; a run needs a folder");
  if (fs::exists(paths.config())) return {true, read_text_file(paths.config()), text_if_there(paths.status())};
  for (const std::string& member : names_in(paths.folder)) {
    if (!is_trace(member))
      throw UserError(name + ": is not empty and holds no run (\"" + member + "\" is in it); choose another folder");
  }
  return {};
}

void check_resumable(const RunPaths& paths, const Found& found, const std::string& config, bool resume) {
  if (!found.is_run) return;
  const std::string name = paths.folder.string();
  if (!resume) {
    const RunState state = found_state(found.status);
    const std::string way =
        state == RunState::kDone ? "done" : "not finished (" + std::string(run_state_name(state)) + ")";
    throw UserError(name + ": holds a run that is " + way +
                    "; choose another folder, remove this one, or go on with it by --resume");
  }
  const std::string differences = describe_differences(found.config, config);
  if (!differences.empty())
    throw UserError(paths.config() + ": the run cannot be resumed, its config is another one:" + differences);
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw UserError(folder.string() + ": the folder cannot be made: " + error.message());
}

/// Removes what writers left half done that were killed; only under the lock.
void remove_all_temporaries(const RunPaths& paths) {
  for (const std::string& folder : {paths.folder.string(), paths.frames(), paths.checkpoint()})
    remove_temporary_files(folder);  // a chain has frames in its clips alone
}

}  // namespace

std::optional<RunState> look_at_run_folder(const std::string& path, const std::string& config, bool resume) {
  const RunPaths paths{fs::path(path)};
  const Found found = look_at_folder(paths);
  check_resumable(paths, found, config, resume);
  if (is_run_locked(path)) throw UserError(busy_message(path));
  return found.is_run ? std::optional(found_state(found.status)) : std::nullopt;
}

RunFolder::RunFolder(const std::string& path, RunIdentity identity, bool resume)
    : paths_{fs::path(path)}, identity_(std::move(identity)) {
  check_resumable(paths_, look_at_folder(paths_), identity_.config, resume);  // before anything is written
  make_folder(paths_.folder);
  lock_ = std::make_unique<Lock>(paths_);
  const Found found = look_at_folder(paths_);  // as it is now that nobody else writes
  check_resumable(paths_, found, identity_.config, resume);
  started_ = utc_now_text();
  if (found.is_run) {
    resumed_from_ = found_state(found.status);
    resumed_ = started_;
    const std::string before = found_member(found.status, "started");
    if (!before.empty()) started_ = before;
  } else {
    write_text_file(paths_.config(), identity_.config);  // first: it makes the folder one of a run, should we be killed
  }
  if (!identity_.is_chain) {
    for (const std::string& folder : {paths_.frames(), paths_.checkpoint()}) make_folder(folder);
    metrics_ = std::make_unique<AppendedFile>(paths_.metrics());
  }
  remove_all_temporaries(paths_);
  log_.emplace(log_to_file(paths_.log()));
  write_status();
}

RunFolder::~RunFolder() = default;

void RunFolder::set_state(RunState state, std::string_view message) {
  state_ = state;
  message_ = message;
  // So that after a power cut no run is taken for done whose files are not whole.
  if (state == RunState::kDone) sync_to_disk(paths_.folder.string());
  write_status();
  // An encoder that outlived a run that was killed may have made its file after we came.
  if (state != RunState::kRunning) remove_all_temporaries(paths_);
}

void RunFolder::take_over_config() {
  if (read_text_file(paths_.config()) != identity_.config) write_text_file(paths_.config(), identity_.config);
}

void RunFolder::write_status() {
  ConfigValue status = ConfigValue::make_object();
  const auto add_text = [&status](std::string_view key, std::string_view value) {
    status.add(key, ConfigValue::make_string(value));
  };
  add_text("state", run_state_name(state_));
  if (!message_.empty()) add_text("message", message_);
  add_text("version", version());
  add_text("git", git_commit());
  add_text("host", host_name());
  status.add("seed", ConfigValue::make_integer(identity_.seed));
  status.add("threads", ConfigValue::make_integer(identity_.threads));
  add_text("precision", identity_.precision);
  add_text("started", started_);
  if (!resumed_.empty()) add_text("resumed", resumed_);
  add_text("updated", utc_now_text());
  write_text_file(paths_.status(), to_json(status));
}

void RunFolder::append_metrics(const IterationRecord& record) {
  HSI4D_CHECK(metrics_ != nullptr, "a chain has no metrics of its own");
  metrics_->append(metrics_line(record));
}

void RunFolder::keep_metrics(const std::function<bool(const std::string&, std::optional<int>)>& is_kept) {
  const std::string text = read_text_file(paths_.metrics());
  const std::string kept = kept_lines(text, is_kept, paths_.metrics());
  if (kept.size() == text.size()) return;
  metrics_.reset();
  write_text_file(paths_.metrics(), kept);
  metrics_ = std::make_unique<AppendedFile>(paths_.metrics());
}

void RunFolder::write_summary(const RunSummary& summary) { write_text_file(paths_.summary(), summary_json(summary)); }

bool is_run_locked(const std::string& path) { return is_file_locked(RunPaths{path}.lock()); }

}  // namespace hsi4d
