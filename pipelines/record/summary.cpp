#include "pipelines/record/summary.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "core/config_value.h"
#include "core/json_text.h"
#include "core/text.h"
#include "pipelines/record/gradient_table.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;

// ---- Writing ----

/// Adds a number to an object; what JSON cannot hold is refused by name (row F12: JSON infinities).
void add_number(ConfigValue& object, const std::string& pointer, const std::string& name, double value) {
  const std::string place = child_pointer(pointer, name);
  HSI4D_CHECK(std::isfinite(value), "summary.json: " + place + ": " + std::to_string(value) + " is not finite");
  HSI4D_CHECK(find_member(object, name) == nullptr, "summary.json: " + place + ": the name occurs twice");
  object.add(name, ConfigValue::make_number(value));
}

void add_values(ConfigValue& object, const std::string& pointer, const MetricValues& values) {
  for (const auto& [name, value] : values) add_number(object, pointer, name, value);
}

ConfigValue stage_json(const StageSummary& stage, const std::string& pointer) {
  ConfigValue object = ConfigValue::make_object();
  object.add("stage", ConfigValue::make_string(stage.stage));
  if (stage.of_frame_0) object.add("frame", ConfigValue::make_integer(0));
  add_number(object, pointer, "seconds", stage.seconds);
  object.add("iterations", ConfigValue::make_integer(stage.iterations));
  add_values(object, pointer, stage.values);
  if (!stage.gradient_shares.empty()) object.add("gradient_shares", mean_shares_json(stage.gradient_shares));
  return object;
}

ConfigValue frames_json(const std::vector<FrameMetrics>& frames, const std::string& pointer) {
  ConfigValue array = ConfigValue::make_array();
  for (size_t i = 0; i < frames.size(); ++i) {
    ConfigValue object = ConfigValue::make_object();
    object.add("frame", ConfigValue::make_integer(frames[i].frame));
    add_values(object, child_pointer(pointer, std::to_string(i)), frames[i].values);
    array.items.push_back(std::move(object));
  }
  return array;
}

ConfigValue start_json(const StartSummary& start) {
  ConfigValue object = ConfigValue::make_object();
  add_number(object, "/start", "seconds", start.seconds);
  for (const StartCounts& part : start.parts) {
    ConfigValue counts = ConfigValue::make_object();
    for (const auto& [name, frames] : part.begun) counts.add(name, ConfigValue::make_integer(frames));
    object.add(part.part, std::move(counts));
  }
  return object;
}

ConfigValue quality_json(const std::vector<QualityGate>& gates) {
  ConfigValue object = ConfigValue::make_object();
  for (const QualityGate& gate : gates) {
    const std::string place = child_pointer("/quality", gate.metric);
    ConfigValue of_gate = ConfigValue::make_object();
    add_number(of_gate, place, "value", gate.value);
    of_gate.add("word", ConfigValue::make_string(word_of(gate)));
    add_number(of_gate, place, "pass", gate.pass);
    add_number(of_gate, place, "check", gate.check);
    object.add(gate.metric, std::move(of_gate));
  }
  return object;
}

ConfigValue values_json(const MetricValues& values, const std::string& pointer) {
  ConfigValue object = ConfigValue::make_object();
  add_values(object, pointer, values);
  return object;
}

ConfigValue people_json(const std::vector<PersonSummary>& people) {
  ConfigValue object = ConfigValue::make_object();
  for (const PersonSummary& person : people) {
    const std::string place = child_pointer("/people", person.name);
    ConfigValue of_person = ConfigValue::make_object();
    of_person.add("start", values_json(person.start, place + "/start"));
    of_person.add("result", values_json(person.result, place + "/result"));
    if (!person.per_frame.empty())
      of_person.add("per_frame", frames_json(person.per_frame, child_pointer(place, "per_frame")));
    object.add(person.name, std::move(of_person));
  }
  return object;
}

// ---- Reading ----

/// Every number of an object but those named in `taken`; null (a gap) and other kinds are passed over.
MetricValues read_values(const ConfigValue& object, const std::string& pointer,
                         std::initializer_list<std::string_view> taken) {
  MetricValues values;
  for (const ConfigMember& member : object.members) {
    if (member.value.kind != Kind::kNumber) continue;
    if (std::find(taken.begin(), taken.end(), member.key) != taken.end()) continue;
    values.emplace_back(member.key, number_of(member.value, child_pointer(pointer, member.key)));
  }
  return values;
}

double read_number(const ConfigValue& object, const std::string& pointer, std::string_view key) {
  const ConfigValue* const member = find_member(object, key);
  return member == nullptr ? 0 : number_of(*member, child_pointer(pointer, key));
}

Index read_count(const ConfigValue& object, const std::string& pointer, std::string_view key) {
  const ConfigValue* const member = find_member(object, key);
  return member == nullptr ? 0 : whole_number_of(*member, child_pointer(pointer, key));
}

StageSummary read_stage(const ConfigValue& value, const std::string& pointer) {
  check_kind(value, Kind::kObject, pointer);
  StageSummary stage;
  stage.stage = string_member(value, "stage");
  if (stage.stage.empty()) fail_at(value, pointer, "there is no \"stage\", the name of the stage");
  stage.seconds = read_number(value, pointer, "seconds");
  stage.iterations = read_count(value, pointer, "iterations");
  stage.of_frame_0 = find_member(value, "frame") != nullptr;
  stage.values = read_values(value, pointer, {"seconds", "iterations", "frame"});
  if (const ConfigValue* const shares = find_member(value, "gradient_shares"))
    stage.gradient_shares = parse_mean_shares(*shares, child_pointer(pointer, "gradient_shares"));
  return stage;
}

std::vector<FrameMetrics> read_frames(const ConfigValue& value, const std::string& pointer) {
  check_kind(value, Kind::kArray, pointer);
  std::vector<FrameMetrics> frames;
  for (size_t i = 0; i < value.items.size(); ++i) {
    const std::string place = child_pointer(pointer, std::to_string(i));
    check_kind(value.items[i], Kind::kObject, place);
    if (find_member(value.items[i], "frame") == nullptr) fail_at(value.items[i], place, "there is no \"frame\"");
    frames.push_back(
        {static_cast<int>(read_count(value.items[i], place, "frame")), read_values(value.items[i], place, {"frame"})});
  }
  return frames;
}

Baseline& baseline_named(std::vector<Baseline>& baselines, const std::string& name) {
  for (Baseline& baseline : baselines) {
    if (baseline.name == name) return baseline;
  }
  return baselines.emplace_back(Baseline{name, {}, {}, false});
}

void read_baselines(const ConfigValue& tree, RunSummary& summary) {
  if (const ConfigValue* const means = find_member(tree, "baselines")) {
    check_kind(*means, Kind::kObject, "/baselines");
    for (const ConfigMember& member : means->members) {
      const std::string place = child_pointer("/baselines", member.key);
      check_kind(member.value, Kind::kObject, place);
      Baseline& baseline = baseline_named(summary.baselines, member.key);
      baseline.of_frame_0 = find_member(member.value, "frame") != nullptr;
      baseline.values = read_values(member.value, place, {"frame"});
    }
  }
  if (const ConfigValue* const frames = find_member(tree, "baselines_per_frame")) {
    check_kind(*frames, Kind::kObject, "/baselines_per_frame");
    for (const ConfigMember& member : frames->members)
      baseline_named(summary.baselines, member.key).per_frame =
          read_frames(member.value, child_pointer("/baselines_per_frame", member.key));
  }
}

StartSummary read_start(const ConfigValue& value) {
  check_kind(value, Kind::kObject, "/start");
  StartSummary start;
  start.seconds = read_number(value, "/start", "seconds");
  for (const ConfigMember& part : value.members) {
    if (part.value.kind != Kind::kObject) continue;
    StartCounts counts{part.key, {}};
    const std::string place = child_pointer("/start", part.key);
    for (const ConfigMember& begun : part.value.members)
      counts.begun.emplace_back(begun.key, whole_number_of(begun.value, child_pointer(place, begun.key)));
    start.parts.push_back(std::move(counts));
  }
  return start;
}

std::vector<PersonSummary> read_people(const ConfigValue& value) {
  check_kind(value, Kind::kObject, "/people");
  std::vector<PersonSummary> people;
  for (const ConfigMember& member : value.members) {
    const std::string place = child_pointer("/people", member.key);
    check_kind(member.value, Kind::kObject, place);
    PersonSummary& person = people.emplace_back(PersonSummary{member.key, {}, {}});
    for (const auto& [key, values] : {std::pair{"start", &person.start}, std::pair{"result", &person.result}}) {
      const ConfigValue* const found = find_member(member.value, key);
      if (found == nullptr) continue;
      check_kind(*found, Kind::kObject, child_pointer(place, key));
      *values = read_values(*found, child_pointer(place, key), {});
    }
    if (const ConfigValue* const frames = find_member(member.value, "per_frame"))
      person.per_frame = read_frames(*frames, child_pointer(place, "per_frame"));
  }
  return people;
}

/// Gates of metrics that are not known are passed over.
std::vector<QualityGate> read_quality(const ConfigValue& value) {
  check_kind(value, Kind::kObject, "/quality");
  std::vector<QualityGate> gates;
  for (const ConfigMember& member : value.members) {
    const std::string place = child_pointer("/quality", member.key);
    check_kind(member.value, Kind::kObject, place);
    if (find_metric_facts(member.key) == nullptr) continue;
    gates.push_back({member.key, read_number(member.value, place, "value"), read_number(member.value, place, "pass"),
                     read_number(member.value, place, "check")});
  }
  return gates;
}

// ---- The table ----

}  // namespace

std::string summary_json(const RunSummary& summary) {
  ConfigValue tree = ConfigValue::make_object();
  tree.add("name", ConfigValue::make_string(summary.name));
  tree.add("frames", ConfigValue::make_integer(summary.frames));
  add_number(tree, "", "seconds", summary.seconds);
  tree.add("truth", ConfigValue::make_boolean(summary.has_truth));
  if (summary.is_on_plate) tree.add("plate", ConfigValue::make_boolean(true));
  if (!summary.surface.empty()) tree.add("surface", ConfigValue::make_string(summary.surface));
  ConfigValue stages = ConfigValue::make_array();
  for (size_t i = 0; i < summary.metrics.size(); ++i)
    stages.items.push_back(stage_json(summary.metrics[i], child_pointer("/metrics", std::to_string(i))));
  tree.add("metrics", std::move(stages));
  if (!summary.start.parts.empty()) tree.add("start", start_json(summary.start));
  if (!summary.found.empty()) {
    ConfigValue found = ConfigValue::make_object();
    for (const auto& [name, value] : summary.found) add_number(found, "/found", name, value);
    tree.add("found", std::move(found));
  }
  if (!summary.quality.empty()) tree.add("quality", quality_json(summary.quality));
  if (!summary.people.empty()) tree.add("people", people_json(summary.people));
  ConfigValue means = ConfigValue::make_object(), by_frame = ConfigValue::make_object();
  for (const Baseline& baseline : summary.baselines) {
    const std::string place = child_pointer("/baselines", baseline.name);
    HSI4D_CHECK(find_member(means, baseline.name) == nullptr, "summary.json: " + place + ": the name occurs twice");
    ConfigValue object = ConfigValue::make_object();
    if (baseline.of_frame_0) object.add("frame", ConfigValue::make_integer(0));
    add_values(object, place, baseline.values);
    means.add(baseline.name, std::move(object));
    if (!baseline.per_frame.empty())
      by_frame.add(baseline.name,
                   frames_json(baseline.per_frame, child_pointer("/baselines_per_frame", baseline.name)));
  }
  tree.add("baselines", std::move(means));
  tree.add("per_frame", frames_json(summary.per_frame, "/per_frame"));
  if (!summary.first_pass.empty())
    tree.add("first_pass_per_frame", frames_json(summary.first_pass, "/first_pass_per_frame"));
  if (!by_frame.members.empty()) tree.add("baselines_per_frame", std::move(by_frame));
  return to_json(tree);
}

RunSummary parse_summary(const std::string& text, const std::string& name) {
  const ConfigValue tree = parse_json_text(text, name);
  check_kind(tree, Kind::kObject, "");
  RunSummary summary;
  summary.name = string_member(tree, "name");
  summary.frames = static_cast<int>(read_count(tree, "", "frames"));
  summary.seconds = read_number(tree, "", "seconds");
  if (const ConfigValue* const truth = find_member(tree, "truth")) {  // version 0.1 does not say
    check_kind(*truth, Kind::kBoolean, "/truth");
    summary.has_truth = truth->boolean;
  }
  if (const ConfigValue* const plate = find_member(tree, "plate")) {
    check_kind(*plate, Kind::kBoolean, "/plate");
    summary.is_on_plate = plate->boolean;
  }
  summary.surface = string_member(tree, "surface");
  if (const ConfigValue* const stages = find_member(tree, "metrics")) {
    check_kind(*stages, Kind::kArray, "/metrics");
    for (size_t i = 0; i < stages->items.size(); ++i)
      summary.metrics.push_back(read_stage(stages->items[i], child_pointer("/metrics", std::to_string(i))));
  }
  if (const ConfigValue* const start = find_member(tree, "start")) summary.start = read_start(*start);
  if (const ConfigValue* const found = find_member(tree, "found")) {
    check_kind(*found, Kind::kObject, "/found");
    for (const ConfigMember& member : found->members)
      summary.found.emplace_back(member.key, read_number(*found, "/found", member.key));
  }
  if (const ConfigValue* const quality = find_member(tree, "quality")) summary.quality = read_quality(*quality);
  if (const ConfigValue* const people = find_member(tree, "people")) summary.people = read_people(*people);
  read_baselines(tree, summary);
  if (const ConfigValue* const frames = find_member(tree, "per_frame"))
    summary.per_frame = read_frames(*frames, "/per_frame");
  if (const ConfigValue* const frames = find_member(tree, "first_pass_per_frame"))
    summary.first_pass = read_frames(*frames, "/first_pass_per_frame");
  return summary;
}

Table error_table(const RunSummary& summary) {
  Table table{.head = {""}, .align = "lr"};
  std::vector<const MetricValues*> sources;
  std::vector<bool> of_frame_0;
  for (const Baseline& baseline : summary.baselines) {
    table.head.emplace_back(baseline.name, "baseline");
    sources.push_back(&baseline.values);
    of_frame_0.push_back(baseline.of_frame_0);
  }
  for (const StageSummary& stage : summary.metrics) {
    table.head.emplace_back(stage.stage);
    sources.push_back(&stage.values);
    of_frame_0.push_back(stage.of_frame_0);
  }
  for (const MetricFacts& facts : metric_facts()) {
    std::vector<Cell> row = metric_row(facts, sources);
    if (row.empty()) continue;
    std::array<std::vector<Cell*>, 2> cells;  // of frame 0 alone, and others
    for (std::size_t i = 0; i < sources.size(); ++i) {
      if (row[i + 1].mark.empty()) row[i + 1].mark = table.head[i + 1].mark;
      cells[of_frame_0[i] ? 0 : 1].push_back(&row[i + 1]);
    }
    for (const auto& compared : cells) mark_best(facts.better, compared);
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table people_table(const RunSummary& summary) {
  Table table{.head = {""}, .align = "lr"};
  std::vector<const MetricValues*> sources;
  for (const PersonSummary& person : summary.people) {
    table.head.emplace_back(person.name + ", start", "baseline");
    table.head.emplace_back(person.name);
    sources.insert(sources.end(), {&person.start, &person.result});
  }
  for (const MetricFacts& facts : metric_facts()) {
    std::vector<Cell> row = metric_row(facts, sources);
    if (row.empty()) continue;
    for (std::size_t i = 1; i + 1 < row.size(); i += 2) mark_best(facts.better, {&row[i], &row[i + 1]});
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string error_text(const RunSummary& summary) {
  const Table table = error_table(summary), people = people_table(summary);
  if (table.rows.empty()) return "no errors were measured\n";
  return table_text(table) + (people.rows.empty() ? "" : "\n" + table_text(people));
}

}  // namespace hsi4d
