#include "pipelines/watch/watched.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <fcntl.h>
#include <filesystem>
#include <optional>
#include <sys/stat.h>
#include <unistd.h>

#include "core/check.h"
#include "core/json_text.h"
#include "pipelines/chain/chain.h"
#include "pipelines/chain/report.h"
#include "pipelines/record/folder.h"
#include "pipelines/sweep/folder.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;
using Kind = ConfigValue::Kind;

constexpr int kDepth = 3;                     // of folders in which runs are looked for
constexpr std::size_t kChunk = 1 << 20;       // bytes of metrics.jsonl in an answer
constexpr std::int64_t kLogStart = 64 << 10;  // where the log tells how many frames there are

ConfigValue text_value(std::string_view text) { return ConfigValue::make_string(text); }
ConfigValue whole(std::int64_t number) { return ConfigValue::make_integer(number); }

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

/// What a folder is called, also "." and "runs/".
std::string name_of(const fs::path& folder) {
  return (fs::weakly_canonical(folder) / "").parent_path().filename().string();
}

// ---- The runs of a folder ----

/// The names of a chain's clips; empty for any other run.
std::vector<std::string> clips_of(const std::string& folder) {
  std::vector<std::string> names;
  try {
    if (!is_chain_folder(folder)) return names;
    const std::string file = RunPaths{folder}.config();
    const ConfigValue config = parse_json_text(read_text_file(file), file);
    for (const ConfigValue& clip : find_member(config, "chain")->items) names.push_back(string_member(clip, "name"));
  } catch (const DataError&) {  // damaged: it stands in the list as one run
    names.clear();
  }
  return names;
}

/// Collects runs below one folder.
struct Collector {
  fs::path top;
  std::vector<WatchedRun> runs = {};

  void add(const fs::path& folder, const std::string& name, bool is_of_sweep) {
    const std::string id = folder == top ? "" : folder.lexically_relative(top).generic_string();
    const std::string fallback = id.empty() ? name_of(folder) : id;
    runs.push_back({id, name.empty() ? fallback : name, folder.string(), is_of_sweep});
  }
  /// A run, or the clips of a chain.
  void add_run(const fs::path& folder, const std::string& name, bool is_of_sweep) {
    const std::vector<std::string> clips = clips_of(folder.string());
    if (clips.empty()) add(folder, name, is_of_sweep);
    for (const std::string& clip : clips)
      add(ChainPaths{folder}.clip(clip), name.empty() ? clip : name + ", " + clip, false);
  }
  void add_sweep(const fs::path& folder, const std::string& name) {
    const SweepPaths paths{folder};
    const SweepPlan plan = read_sweep_plan(paths);
    for (const std::size_t index : distinct_runs(plan)) {
      const SweepRun& run = plan.runs[index];
      add_run(paths.run(run.id), (name.empty() ? "" : name + ": ") + sweep_label(run), true);
    }
  }
  void look(const fs::path& folder, const std::string& name, int depth) {
    const RunPaths run{folder};
    if (is_sweep_folder(folder.string())) return add_sweep(folder, name);
    if (is_there(run.config()) || is_there(run.metrics())) return add_run(folder, name, false);
    if (depth == 0) return;
    std::vector<fs::path> below;
    std::error_code error;
    for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
      std::error_code unreadable;
      if (!is_hidden(it->path().string()) && it->is_directory(unreadable)) below.push_back(it->path());
    }
    std::sort(below.begin(), below.end());
    for (const fs::path& each : below) look(each, each.lexically_relative(top).generic_string(), depth - 1);
  }
};

// ---- How a run stands ----

/// A JSON object in a file; nothing where there is none, or it is damaged.
std::optional<ConfigValue> object_in(const std::string& file) {
  try {
    if (!is_there(file)) return std::nullopt;
    ConfigValue tree = parse_json_text(read_text_file(file), file);
    if (tree.kind == Kind::kObject) return tree;
  } catch (const UserError&) {  // it was there a moment ago
  } catch (const DataError&) {
  }
  return std::nullopt;
}

struct Standing {
  std::string state, message, started;
};

Standing standing_of(const WatchedRun& run) {
  const RunPaths paths{run.folder};
  Standing standing{is_there(paths.status()) ? "unknown" : "new", "", ""};
  if (const auto status = object_in(paths.status()))
    standing = {string_member(*status, "state"), string_member(*status, "message"), string_member(*status, "started")};
  if (!run.is_of_sweep) return standing;
  const fs::path folder = run.folder;  // SWEEP/runs/ID
  const SweepPaths sweep{folder.parent_path().parent_path()};
  const std::vector<SweepAttempt> attempts = read_attempts(sweep, folder.filename().string());
  if (!attempts.empty() && attempts.back().event == "failed")
    return {"failed", attempts.back().message, standing.started};
  if (standing.state == "new" && !attempts.empty()) standing.state = "started";
  return standing;
}

/// How many frames the log says the clip has, without frame 0, which is given; nothing before it does.
/// ("...run 'NAME': 16 frames of 512x512 pixels...")
std::optional<int> frames_told(const RunPaths& paths) {
  if (!is_there(paths.log())) return std::nullopt;
  const Bytes bytes = read_file_start(paths.log(), kLogStart);
  const std::string text(bytes.begin(), bytes.end());
  const std::size_t end = text.find(" frames of ");
  const std::size_t begin = end == std::string::npos ? end : text.rfind(' ', end - 1);
  int frames = 0;
  if (begin == std::string::npos || std::from_chars(&text[begin + 1], &text[end], frames).ptr != &text[end])
    return std::nullopt;
  return frames - 1;
}

struct FinishedFrame {
  int frame;
  std::int64_t written;  // milliseconds of the file system's clock: other when it is drawn again
};

std::int64_t milliseconds(fs::file_time_type time) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
}

std::vector<FinishedFrame> finished_frames(const RunPaths& paths) {
  std::vector<FinishedFrame> frames;
  std::error_code error;
  for (fs::directory_iterator it(paths.frames(), error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    int frame = 0;
    const char* const behind = std::from_chars(name.data(), name.data() + name.size(), frame).ptr;
    std::error_code gone;
    const fs::file_time_type time = it->last_write_time(gone);
    if (std::string_view(behind) == "_render.png" && !gone && is_there(paths.frame_image(frame, "target")))
      frames.push_back({frame, milliseconds(time)});
  }
  std::sort(frames.begin(), frames.end(), [](const auto& a, const auto& b) { return a.frame < b.frame; });
  return frames;
}

/// How many frames are finished; frame 0 is given.
std::int64_t count_finished(const RunPaths& paths) {
  const std::vector<FinishedFrame> frames = finished_frames(paths);
  return std::count_if(frames.begin(), frames.end(), [](const FinishedFrame& frame) { return frame.frame > 0; });
}

/// Seconds since the run wrote; nothing where it has not begun.
std::optional<double> age_of(const RunPaths& paths) {
  std::optional<fs::file_time_type> last;
  for (const std::string& file : {paths.metrics(), paths.status(), paths.log()}) {
    std::error_code error;
    const fs::file_time_type time = fs::last_write_time(file, error);
    if (!error && (!last || time > *last)) last = time;
  }
  if (!last) return std::nullopt;
  return std::max(0.0, std::chrono::duration<double>(fs::file_time_type::clock::now() - *last).count());
}

MetricValues results_of(const RunPaths& paths) {
  MetricValues values;
  try {
    if (!is_there(paths.summary())) return values;
    const RunSummary summary = parse_summary(read_text_file(paths.summary()), paths.summary());
    if (summary.metrics.empty()) return values;
    for (const auto& [name, value] : summary.metrics.back().values) {
      if (find_metric_facts(name) != nullptr) values.emplace_back(name, value);
    }
  } catch (const UserError&) {
  } catch (const DataError&) {  // of another kind: the state tells enough
  }
  return values;
}

void add_stages(ConfigValue& json, const RunPaths& paths) {
  ConfigValue list = ConfigValue::make_array();
  const auto config = object_in(paths.config());
  const ConfigValue* const stages = config ? find_member(*config, "stages") : nullptr;
  for (const ConfigMember& stage : stages == nullptr ? std::vector<ConfigMember>{} : stages->members) {
    if (stage.value.kind != Kind::kObject) continue;
    const ConfigValue* const iterations = find_member(stage.value, "iterations");
    ConfigValue entry = ConfigValue::make_object();
    entry.add("name", text_value(stage.key));
    if (iterations != nullptr && iterations->kind == Kind::kNumber) entry.add("iterations", *iterations);
    list.items.push_back(std::move(entry));
  }
  json.add("stages", std::move(list));
}

// ---- metrics.jsonl ----

/// A file that is open for reading; -1 where it is not there.
struct OpenFile {
  explicit OpenFile(const std::string& path) : descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (descriptor >= 0 && ::fstat(descriptor, &facts) != 0) facts = {};
  }
  ~OpenFile() {
    if (descriptor >= 0) ::close(descriptor);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  std::string read(std::int64_t from, std::size_t count) const {
    std::string text(count, '\0');
    const ssize_t got = ::pread(descriptor, text.data(), count, from);
    text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    return text;
  }

  int descriptor;
  struct stat facts = {};
};

ConfigValue number_or_null(const ConfigValue* member, std::string_view key) {
  if (member == nullptr || member->kind == Kind::kNull) return ConfigValue::make_null();
  return ConfigValue::make_number(number_of(*member, key));
}

/// Throws DataError for a line that is none of a run.
ConfigValue row_of(const std::string& line) {
  const ConfigValue record = parse_json_text(line, "metrics.jsonl");
  check_kind(record, Kind::kObject, "");
  const std::string stage = string_member(record, "stage");
  const ConfigValue* const iteration = find_member(record, "iteration");
  if (stage.empty() || iteration == nullptr) fail_at(record, "", "there is no \"stage\" or \"iteration\"");
  ConfigValue terms = ConfigValue::make_object();
  if (const ConfigValue* const losses = find_member(record, "losses")) {
    for (const ConfigMember& term : losses->members) terms.add(term.key, number_or_null(&term.value, term.key));
  }
  return ConfigValue::make_array({number_or_null(find_member(record, "frame"), "frame"), text_value(stage),
                                  whole(whole_number_of(*iteration, "iteration")),
                                  number_or_null(find_member(record, "loss"), "loss"),
                                  number_or_null(find_member(record, "seconds"), "seconds"), std::move(terms)});
}

struct Rows {
  ConfigValue rows = ConfigValue::make_array();
  std::int64_t skipped = 0;
};

Rows rows_of(const std::string& lines) {
  Rows rows;
  for (std::size_t begin = 0, end = 0; begin < lines.size(); begin = end + 1) {
    end = std::min(lines.find('\n', begin), lines.size());
    try {
      rows.rows.items.push_back(row_of(lines.substr(begin, end - begin)));
    } catch (const DataError&) {
      ++rows.skipped;
    }
  }
  return rows;
}

/// The lines that end in the text; all of it where it is as long as an answer can be and no line ends.
std::string whole_lines(const std::string& text) {
  const std::size_t end = text.rfind('\n');
  if (end != std::string::npos) return text.substr(0, end + 1);
  return text.size() == kChunk ? text : "";
}

}  // namespace

std::vector<WatchedRun> watched_runs(const std::string& path) {
  Collector collector{fs::path(path)};
  collector.look(collector.top, "", kDepth);
  return std::move(collector.runs);
}

void check_watched(const std::string& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) throw UserError(path + ": there is no such folder");
  if (!fs::is_empty(path, error) && watched_runs(path).empty())
    throw UserError(path + ": holds no run, sweep or chain" + (error ? ": " + error.message() : ""));
}

std::string watched_runs_json(const std::string& path) {
  ConfigValue json = ConfigValue::make_object(), runs = ConfigValue::make_array(), metrics = ConfigValue::make_array();
  std::vector<const MetricFacts*> known;
  for (const WatchedRun& run : watched_runs(path)) {
    const RunPaths paths{run.folder};
    const Standing standing = standing_of(run);
    ConfigValue entry = ConfigValue::make_object(), values = ConfigValue::make_object();
    entry.add("id", text_value(run.id));
    entry.add("name", text_value(run.name));
    entry.add("state", text_value(standing.state));
    if (!standing.message.empty()) entry.add("message", text_value(standing.message));
    entry.add("frames", whole(count_finished(paths)));
    if (const auto total = frames_told(paths)) entry.add("total", whole(*total));
    for (const auto& [name, value] : results_of(paths)) {
      values.add(name, ConfigValue::make_number(value));
      known.push_back(find_metric_facts(name));
    }
    entry.add("values", std::move(values));
    runs.items.push_back(std::move(entry));
  }
  for (const MetricFacts& facts : metric_facts()) {
    if (std::find(known.begin(), known.end(), &facts) == known.end()) continue;
    ConfigValue metric = ConfigValue::make_object();
    metric.add("name", text_value(facts.name));
    metric.add("label", text_value(metric_heading(facts)));
    metric.add("decimals", whole(facts.decimals));
    metric.add("better", ConfigValue::make_number(static_cast<double>(facts.better)));
    metrics.items.push_back(std::move(metric));
  }
  json.add("title", text_value(name_of(path)));
  json.add("metrics", std::move(metrics));
  json.add("runs", std::move(runs));
  return to_json_line(json);
}

std::string watched_run_json(const WatchedRun& run) {
  const RunPaths paths{run.folder};
  const Standing standing = standing_of(run);
  ConfigValue json = ConfigValue::make_object(), frames = ConfigValue::make_array(),
              results = ConfigValue::make_array();
  json.add("id", text_value(run.id));
  json.add("name", text_value(run.name));
  json.add("state", text_value(standing.state));
  if (!standing.message.empty()) json.add("message", text_value(standing.message));
  if (!standing.started.empty()) json.add("started", text_value(standing.started));
  if (const auto age = age_of(paths)) json.add("age", ConfigValue::make_number(*age));
  if (const auto total = frames_told(paths)) json.add("total", whole(*total));
  add_stages(json, paths);
  for (const FinishedFrame& frame : finished_frames(paths))
    frames.items.push_back(ConfigValue::make_array({whole(frame.frame), whole(frame.written)}));
  json.add("frames", std::move(frames));
  for (const auto& [name, value] : results_of(paths)) {
    const MetricFacts& facts = *find_metric_facts(name);
    results.items.push_back(ConfigValue::make_array(
        {text_value(shown_metric(facts)), ConfigValue::make_number(value), whole(facts.decimals)}));
  }
  json.add("results", std::move(results));
  return to_json_line(json);
}

std::string watched_metrics_json(const WatchedRun& run, const MetricsPlace& place) {
  const OpenFile file(RunPaths{run.folder}.metrics());
  const std::string name = file.descriptor < 0 ? "" : std::to_string(file.facts.st_ino);
  const bool goes_on = place.from == 0 || (name == place.file && place.from <= file.facts.st_size);
  const std::int64_t from = goes_on ? place.from : 0;
  const std::string lines = whole_lines(file.read(from, kChunk));
  Rows rows = rows_of(lines);
  ConfigValue json = ConfigValue::make_object();
  json.add("file", text_value(name));
  json.add("restarted", ConfigValue::make_boolean(!goes_on));
  json.add("next", whole(from + std::ssize(lines)));
  json.add("size", whole(file.facts.st_size));
  json.add("skipped", whole(rows.skipped));
  json.add("rows", std::move(rows.rows));
  return to_json_line(json);
}

Bytes watched_image(const WatchedRun& run, int frame, const std::string& kind) {
  HSI4D_CHECK(kind == "target" || kind == "render", "no such kind of image: " + kind);
  return read_file(RunPaths{run.folder}.frame_image(frame, kind));
}

}  // namespace hsi4d
