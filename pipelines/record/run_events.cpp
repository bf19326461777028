#include "pipelines/record/run_events.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <limits>

#include "core/check.h"
#include "core/file.h"
#include "core/host.h"
#include "core/json_text.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;
using Kind = ConfigValue::Kind;

constexpr std::array kShownKinds = {"target", "render", "difference"};

// ---- Files ----

/// A name in which TensorBoard looks for events; a later file is later in the alphabet.
std::string events_name() {
  return "events.out.tfevents." + std::to_string(std::time(nullptr)) + "." + host_name() + ".hsi4d";
}

bool is_events_name(const std::string& name) {
  return name.starts_with("events.out.tfevents.") && name.ends_with(".hsi4d");
}

std::vector<fs::path> events_files(const RunPaths& paths) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator it(paths.tensorboard(), error), end; !error && it != end; it.increment(error)) {
    if (is_events_name(it->path().filename().string())) files.push_back(it->path());
  }
  return files;
}

void remove_events_file(const fs::path& file) {
  std::error_code error;
  fs::remove(file, error);
  if (error) throw UserError(file.string() + ": cannot be removed: " + error.message());
}

/// The seconds since 1970 of what utc_now_text gave.
double utc_seconds(const std::string& text, const RunPaths& paths) {
  std::tm parts{};
  const char* const end = ::strptime(text.c_str(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  if (end == nullptr || *end != '\0')
    throw DataError(paths.status() + ": /started: " + json_string(text) + " is no time like \"2024-05-01T12:00:00Z\"");
  return static_cast<double>(::timegm(&parts));
}

// ---- Lines of metrics.jsonl ----

/// A number, or null where a step was not taken.
double number_or_gap(const ConfigValue& value, const std::string& pointer) {
  if (value.kind == Kind::kNull) return std::numeric_limits<double>::quiet_NaN();
  return number_of(value, pointer);
}

const ConfigValue& member_of(const ConfigValue& line, std::string_view key) {
  const ConfigValue* const member = find_member(line, key);
  if (member == nullptr) fail_at(line, "", "there is no " + json_string(key));
  return *member;
}

/// What events show of a line, which must outlive it.
IterationRecord record_of_line(const ConfigValue& line) {
  check_kind(line, Kind::kObject, "");
  IterationRecord record;
  if (const ConfigValue* const frame = find_member(line, "frame"))
    record.frame = static_cast<int>(whole_number_of(*frame, "/frame"));
  const ConfigValue& stage = member_of(line, "stage");
  check_kind(stage, Kind::kString, "/stage");
  record.stage = stage.text;
  record.loss = number_or_gap(member_of(line, "loss"), "/loss");
  const ConfigValue& losses = member_of(line, "losses");
  check_kind(losses, Kind::kObject, "/losses");
  for (const ConfigMember& term : losses.members)
    record.losses.emplace_back(term.key, number_or_gap(term.value, child_pointer("/losses", term.key)));
  record.seconds = number_of(member_of(line, "seconds"), "/seconds");
  return record;
}

/// A line of which record_of_line can be made.
ConfigValue checked_line(const std::string& text, const std::string& file, int number) {
  const auto read = [&](int at) {
    ConfigValue line = parse_json_text(text, file, at);
    record_of_line(line);
    return line;
  };
  try {
    return read(1);
  } catch (const DataError&) {
    return read(number);  // the same fault, told with the line of the file
  }
}

bool has_gap(const IterationRecord& record) {
  return !std::isfinite(record.loss) || std::any_of(record.losses.begin(), record.losses.end(),
                                                    [](const auto& term) { return !std::isfinite(term.second); });
}

MetricValues with_tags(const std::string& before, const MetricValues& values) {
  MetricValues tagged;
  for (const auto& [name, value] : values) tagged.emplace_back(before + name, value);
  return tagged;
}

}  // namespace

RunEvents::RunEvents(const RunFolder& folder, ShownImages images, Index first, Index end)
    : paths_(folder.paths()), images_(images), started_(utc_seconds(folder.started(), paths_)) {
  const fs::path tensorboard = paths_.tensorboard(), file = tensorboard / events_name();
  std::error_code error;
  fs::create_directories(tensorboard, error);
  if (error) throw UserError(tensorboard.string() + ": the folder cannot be made: " + error.message());
  const std::vector<fs::path> before = events_files(paths_);
  if (fs::exists(file)) remove_events_file(file);  // of a run that was stopped within this second
  file_ = std::make_unique<AppendedFile>(file.string());
  file_->append(event_record(version_event(started_)));
  const ConfigValue& axes = folder.identity().sweep_axes;
  if (!axes.members.empty()) file_->append(event_record(hparams_event(started_, axes)));
  add_kept_lines(first, end);
  for (const fs::path& old : before) {
    if (old != file) remove_events_file(old);  // last, so that there is no moment without events
  }
}

RunEvents::~RunEvents() = default;

void RunEvents::add_kept_lines(Index first, Index end) {
  const std::string text = read_text_file(paths_.metrics());
  Index frame = first;
  std::optional<int> again;  // the frame at hand of a later pass
  bool is_later = false;     // than the first pass, after which there is a stage over the sequence
  std::size_t begin = 0;
  for (int number = 1; begin < text.size(); ++number) {
    const std::size_t line_end = std::min(text.find('\n', begin), text.size());
    const ConfigValue line = checked_line(text.substr(begin, line_end - begin), paths_.metrics(), number);
    const IterationRecord record = record_of_line(line);
    is_later = is_later || !record.frame;
    while (frame < (is_later ? end : Index{*record.frame})) end_frame(frame++);
    if (again && record.frame != again) end_frame(*again);
    again = is_later ? record.frame : std::nullopt;
    add(record);
    begin = line_end + 1;
  }
  while (frame < end) end_frame(frame++);
  if (again) end_frame(*again);
}

EventTime RunEvents::at(std::int64_t step) const { return {started_ + seconds_, step}; }

void RunEvents::add(const IterationRecord& record) {
  const std::int64_t step = lines_++;
  seconds_ += record.seconds;
  if (has_gap(record)) return;
  const std::string stage(record.stage);
  MetricValues scalars = {{"loss/" + stage, record.loss}};
  for (const auto& [name, value] : record.losses) scalars.emplace_back("loss_" + stage + "/" + name, value);
  file_->append(event_record(scalars_event(at(step), scalars)));
  if (!record.frame) return;
  const auto known = std::find_if(frame_losses_.begin(), frame_losses_.end(),
                                  [&stage](const auto& entry) { return entry.first == stage; });
  if (known != frame_losses_.end()) {
    known->second = record.loss;
  } else {
    frame_losses_.emplace_back(stage, record.loss);
  }
}

void RunEvents::end_frame(Index frame) {
  if (!frame_losses_.empty())
    file_->append(event_record(scalars_event(at(frame), with_tags("frame_loss/", frame_losses_))));
  frame_losses_.clear();
  if (frame == 0 || !images_.are_drawn_again) add_images(frame);
}

void RunEvents::add_images(Index frame) {
  if (images_.every == 0 || frame % images_.every != 0) return;
  for (const std::string kind : kShownKinds) {
    const Bytes png = read_file(paths_.frame_image(static_cast<int>(frame), kind));
    file_->append(event_record(image_event(at(frame), "images/" + kind, png)));
  }
}

void RunEvents::add_result(const RunSummary& summary) {
  for (const FrameMetrics& frame : summary.per_frame)
    file_->append(event_record(scalars_event(at(frame.frame), with_tags("result/", frame.values))));
  if (summary.metrics.empty()) return;
  const std::vector<std::pair<std::string, double>> means = with_tags("mean/", summary.metrics.back().values);
  if (!means.empty()) file_->append(event_record(scalars_event(at(summary.frames - 1), means)));
}

void remove_run_events(const RunPaths& paths) {
  for (const fs::path& file : events_files(paths)) remove_events_file(file);
  std::error_code error;
  fs::remove(paths.tensorboard(), error);  // unless something else is in it
}

}  // namespace hsi4d
