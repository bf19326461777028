#include <algorithm>
#include <limits>

#include "core/check.h"
#include "core/json_text.h"
#include "pipelines/metrics/metric_facts.h"
#include "pipelines/sweep/plan.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;

constexpr std::int64_t kPlanVersion = 1;

ConfigValue words_json(const std::vector<std::pair<std::string, std::string>>& words) {
  ConfigValue object = ConfigValue::make_object();
  for (const auto& [key, value] : words) object.add(key, ConfigValue::make_string(value));
  return object;
}

/// {KEY: text, ...}; none where there is no such member.
/// @param in  the object's place
std::vector<std::pair<std::string, std::string>> words_of(const ConfigValue& object, const char* key,
                                                          const std::string& in) {
  std::vector<std::pair<std::string, std::string>> words;
  const std::string pointer = child_pointer(in, key);
  if (const ConfigValue* const member = find_member(object, key)) {
    check_kind(*member, Kind::kObject, pointer);
    for (const ConfigMember& word : member->members) {
      check_kind(word.value, Kind::kString, child_pointer(pointer, word.key));
      words.emplace_back(word.key, word.value.text);
    }
  }
  return words;
}

ConfigValue slurm_json(const SweepSlurm& slurm) {
  ConfigValue object = ConfigValue::make_object();
  object.add("time", ConfigValue::make_string(slurm.time));
  object.add("memory_mb", ConfigValue::make_integer(slurm.memory_mb));
  object.add("at_once", ConfigValue::make_integer(slurm.at_once));
  object.add("partition", ConfigValue::make_string(slurm.partition));
  object.add("grace_s", ConfigValue::make_integer(slurm.grace_s));
  ConfigValue options = ConfigValue::make_array();
  for (const std::string& option : slurm.options) options.items.push_back(ConfigValue::make_string(option));
  object.add("options", std::move(options));
  return object;
}

/// A member that must be there.
const ConfigValue& member_of(const ConfigValue& object, const char* key, const std::string& in, Kind kind) {
  const ConfigValue* const member = find_member(object, key);
  if (member == nullptr) fail_at(object, in, std::string("there is no \"") + key + "\"");
  check_kind(*member, kind, child_pointer(in, key));
  return *member;
}

int integer_of(const ConfigValue& object, const char* key, const std::string& in) {
  constexpr int kMost = std::numeric_limits<int>::max();
  const ConfigValue& member = member_of(object, key, in, Kind::kNumber);
  const std::int64_t number = whole_number_of(member, child_pointer(in, key));
  if (number > kMost)
    fail_at(member, child_pointer(in, key), shown(member) + " is too large; allowed: 0 to " + std::to_string(kMost));
  return static_cast<int>(number);
}

SweepSlurm slurm_of(const ConfigValue& tree) {
  const ConfigValue& object = member_of(tree, "slurm", "", Kind::kObject);
  SweepSlurm slurm;
  slurm.time = string_member(object, "time");
  slurm.memory_mb = integer_of(object, "memory_mb", "/slurm");
  slurm.at_once = integer_of(object, "at_once", "/slurm");
  slurm.partition = string_member(object, "partition");
  slurm.grace_s = integer_of(object, "grace_s", "/slurm");
  for (const ConfigValue& option : member_of(object, "options", "/slurm", Kind::kArray).items) {
    check_kind(option, Kind::kString, "/slurm/options");
    slurm.options.push_back(option.text);
  }
  return slurm;
}

ConfigValue search_json(const PlannedSearch& search) {
  ConfigValue object = ConfigValue::make_object();
  if (!search.block.empty()) object.add("block", ConfigValue::make_string(search.block));
  object.add("metric", ConfigValue::make_string(search.metric));
  ConfigValue over = ConfigValue::make_object();
  for (const auto& [key, is_log] : search.over) over.add(key, ConfigValue::make_string(is_log ? "log" : "linear"));
  object.add("over", std::move(over));
  if (search.rung_keys.empty()) return object;
  ConfigValue rungs = ConfigValue::make_array();
  for (const std::string& key : search.rung_keys) rungs.items.push_back(ConfigValue::make_string(key));
  object.add("rungs", std::move(rungs));
  object.add("factor", ConfigValue::make_integer(search.factor));
  return object;
}

PlannedSearch search_of_json(const ConfigValue& object, const std::string& in) {
  check_kind(object, Kind::kObject, in);
  PlannedSearch search;
  search.block = string_member(object, "block");
  search.metric = member_of(object, "metric", in, Kind::kString).text;
  if (find_metric_facts(search.metric) == nullptr)
    fail_at(object, child_pointer(in, "metric"), json_string(search.metric) + " is no metric");
  for (const auto& [key, scale] : words_of(object, "over", in)) search.over.push_back({key, scale == "log"});
  if (find_member(object, "rungs") == nullptr) return search;
  for (const ConfigValue& key : member_of(object, "rungs", in, Kind::kArray).items) {
    check_kind(key, Kind::kString, child_pointer(in, "rungs"));
    search.rung_keys.push_back(key.text);
  }
  search.factor = integer_of(object, "factor", in);
  if (search.factor < 2) fail_at(object, child_pointer(in, "factor"), "is below 2");
  return search;
}

/// A number that is not negative, 0 where there is none.
double hours_of(const ConfigValue& tree) {
  const ConfigValue* const member = find_member(tree, "hours");
  if (member == nullptr) return 0;
  const double hours = number_of(*member, "/hours");
  if (hours < 0) fail_at(*member, "/hours", shown(*member) + " is below 0");
  return hours;
}

bool is_id(const std::string& text) {
  return text.size() == 16 &&
         std::all_of(text.begin(), text.end(), [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
}

SweepRun run_of(const ConfigValue& object, const std::string& in) {
  check_kind(object, Kind::kObject, in);
  SweepRun run;
  run.id = member_of(object, "id", in, Kind::kString).text;
  if (!is_id(run.id)) fail_at(object, in + "/id", json_string(run.id) + " is not the name of a run");
  run.block = string_member(object, "block");
  run.clip = string_member(object, "clip");
  run.ablation = string_member(object, "ablation");
  run.seed = string_member(object, "seed");
  if (find_member(object, "rung") != nullptr) run.rung = static_cast<std::size_t>(integer_of(object, "rung", in));
  run.values = words_of(object, "values", in);
  run.dataset = string_member(object, "dataset");
  if (!run.dataset.empty() && !is_id(run.dataset))
    fail_at(object, in + "/dataset", json_string(run.dataset) + " is not the name of a dataset");
  return run;
}

}  // namespace

bool is_sweep_plan(const ConfigValue& tree) { return find_member(tree, "sweep_plan") != nullptr; }

std::string sweep_plan_json(const SweepPlan& plan) {
  ConfigValue tree = ConfigValue::make_object();
  tree.add("sweep_plan", ConfigValue::make_integer(kPlanVersion));
  tree.add("name", ConfigValue::make_string(plan.name));
  tree.add("threads", ConfigValue::make_integer(plan.threads));
  tree.add("memory_mb", ConfigValue::make_number(plan.memory_mb));
  if (plan.hours > 0) tree.add("hours", ConfigValue::make_number(plan.hours));
  if (plan.memory_retries > 0) tree.add("memory_retries", ConfigValue::make_integer(plan.memory_retries));
  tree.add("slurm", slurm_json(plan.slurm));
  tree.add("compare", words_json(plan.compare));
  ConfigValue searches = ConfigValue::make_array();
  for (const PlannedSearch& search : plan.searches) searches.items.push_back(search_json(search));
  if (!searches.items.empty()) tree.add("searches", std::move(searches));
  ConfigValue runs = ConfigValue::make_array();
  for (const SweepRun& run : plan.runs) {
    ConfigValue one = ConfigValue::make_object();
    one.add("index", ConfigValue::make_integer(std::ssize(runs.items)));
    one.add("id", ConfigValue::make_string(run.id));
    const std::pair<const char*, const std::string&> names[] = {
        {"block", run.block}, {"clip", run.clip}, {"ablation", run.ablation}, {"seed", run.seed}};
    for (const auto& [key, name] : names) {
      if (!name.empty()) one.add(key, ConfigValue::make_string(name));
    }
    if (run.rung > 0) one.add("rung", ConfigValue::make_integer(static_cast<std::int64_t>(run.rung)));
    if (!run.values.empty()) one.add("values", words_json(run.values));
    if (!run.dataset.empty()) one.add("dataset", ConfigValue::make_string(run.dataset));
    runs.items.push_back(std::move(one));
  }
  tree.add("runs", std::move(runs));
  return to_json(tree);
}

SweepPlan parse_sweep_plan(const std::string& text, const std::string& name) {
  const ConfigValue tree = parse_json_text(text, name);
  check_kind(tree, Kind::kObject, "");
  if (whole_number_of(member_of(tree, "sweep_plan", "", Kind::kNumber), "/sweep_plan") != kPlanVersion)
    fail_at(tree, "/sweep_plan", "the plan was written by another version of hsi4d; allowed: 1");
  SweepPlan plan;
  plan.name = member_of(tree, "name", "", Kind::kString).text;
  plan.threads = integer_of(tree, "threads", "");
  const ConfigValue& memory = member_of(tree, "memory_mb", "", Kind::kNumber);
  plan.memory_mb = number_of(memory, "/memory_mb");
  if (plan.memory_mb < 0) fail_at(memory, "/memory_mb", shown(memory) + " is below 0");
  plan.hours = hours_of(tree);
  if (find_member(tree, "memory_retries") != nullptr) {
    plan.memory_retries = integer_of(tree, "memory_retries", "");
    if (plan.memory_retries > kMostMemoryRetries)
      fail_at(tree, "/memory_retries", "is above " + std::to_string(kMostMemoryRetries));
  }
  plan.slurm = slurm_of(tree);
  plan.compare = words_of(tree, "compare", "");
  if (find_member(tree, "searches") != nullptr) {
    for (const ConfigValue& search : member_of(tree, "searches", "", Kind::kArray).items)
      plan.searches.push_back(search_of_json(search, "/searches"));
  }
  const ConfigValue& runs = member_of(tree, "runs", "", Kind::kArray);
  for (std::size_t i = 0; i < runs.items.size(); ++i)
    plan.runs.push_back(run_of(runs.items[i], child_pointer("/runs", std::to_string(i))));
  if (plan.runs.empty()) fail_at(tree, "/runs", "there are no runs");
  return plan;
}

}  // namespace hsi4d
