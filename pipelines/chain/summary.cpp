#include "pipelines/chain/summary.h"

#include <algorithm>

#include "core/check.h"
#include "core/config_value.h"
#include "core/json_text.h"
#include "pipelines/metrics/sequence_errors.h"

namespace hsi4d {

namespace {

using Kind = ConfigValue::Kind;

/// Counters of a stage: sums over the clips, where errors are means.
bool is_counter(const std::string& name) { return find_metric_facts(name) == nullptr; }

/// Depth is of what is inside: clips count by its share. The name of that, for a depth; else "".
std::string_view share_of_depth(const std::string& name) {
  if (name == "penetration_depth_mm") return "penetration_share";
  return name == "object_penetration_depth_mm" ? "object_penetration_share" : "";
}

/// Numbers of the clips, weighted by their frames.
struct WeightedValues {
  struct Entry {
    std::string name;
    double sum = 0, weight = 0;
  };
  std::vector<Entry> entries;  // in the order of their first appearance

  void add(const MetricValues& values, double frames) {
    for (const auto& [name, value] : values) {
      const double* const share = find_metric(values, share_of_depth(name));
      const double weight = share == nullptr ? frames : frames * *share;
      auto at = std::find_if(entries.begin(), entries.end(),
                             [&name = name](const Entry& entry) { return entry.name == name; });
      if (at == entries.end()) at = entries.insert(at, {name, 0, 0});
      at->sum += is_counter(name) ? value : weight * value;
      at->weight += weight;
    }
  }
  MetricValues result() const {
    MetricValues values;
    for (const Entry& entry : entries)
      values.emplace_back(entry.name,
                          is_counter(entry.name) || entry.weight == 0 ? entry.sum : entry.sum / entry.weight);
    return values;
  }
};

double weight_of(const ClipSummary& clip, bool of_frame_0) {
  return of_frame_0 ? 1 : static_cast<double>(clip.summary.frames - 1);
}

/// Means over the evaluations of all clips.
std::vector<MeanGradientShare> joined_shares(const std::vector<ClipSummary>& clips, std::size_t s) {
  std::vector<MeanGradientShare> joined;
  for (const ClipSummary& clip : clips) {
    for (const MeanGradientShare& share : clip.summary.metrics[s].gradient_shares) {
      const auto is_same = [&share](const MeanGradientShare& other) {
        return other.group == share.group && other.term == share.term;
      };
      const auto at = std::find_if(joined.begin(), joined.end(), is_same);
      if (at == joined.end()) {
        joined.push_back(share);
        continue;
      }
      const auto before = static_cast<double>(at->evaluations), more = static_cast<double>(share.evaluations);
      at->share = (before * at->share + more * share.share) / (before + more);
      at->cosine = (before * at->cosine + more * share.cosine) / (before + more);
      at->evaluations += share.evaluations;
    }
  }
  return joined;
}

StageSummary joined_stage(const std::vector<ClipSummary>& clips, std::size_t s) {
  StageSummary joined = clips.front().summary.metrics[s];
  joined.seconds = 0;
  joined.iterations = 0;
  WeightedValues values;
  for (const ClipSummary& clip : clips) {
    HSI4D_CHECK(s < clip.summary.metrics.size() && clip.summary.metrics[s].stage == joined.stage,
                "the clips of a chain have the same stages");
    const StageSummary& stage = clip.summary.metrics[s];
    joined.seconds += stage.seconds;
    joined.iterations += stage.iterations;
    values.add(stage.values, weight_of(clip, stage.of_frame_0));
  }
  joined.values = values.result();
  joined.gradient_shares = joined_shares(clips, s);
  return joined;
}

/// Sums over the clips, whose config is one.
StartSummary joined_start(const std::vector<ClipSummary>& clips) {
  StartSummary joined;
  for (const ClipSummary& clip : clips) {
    joined.seconds += clip.summary.start.seconds;
    for (const StartCounts& part : clip.summary.start.parts) {
      const auto is_same = [&part](const StartCounts& other) { return other.part == part.part; };
      const auto at = std::find_if(joined.parts.begin(), joined.parts.end(), is_same);
      if (at == joined.parts.end()) {
        joined.parts.push_back(part);
        continue;
      }
      for (std::size_t i = 0; i < part.begun.size(); ++i) at->begun[i].second += part.begun[i].second;
    }
  }
  return joined;
}

/// Errors by frame, counted as frames of the chain.
void append_frames(const std::vector<FrameMetrics>& frames, int begin, std::vector<FrameMetrics>& all) {
  for (const FrameMetrics& frame : frames) all.push_back({begin + frame.frame, frame.values});
}

/// Means over frames take the place of those that were weighted clip by clip.
void take_over(const MetricValues& means, MetricValues& values) {
  for (const auto& [name, mean] : means) {
    if (!share_of_depth(name).empty()) continue;
    const auto at =
        std::find_if(values.begin(), values.end(), [&name = name](const auto& entry) { return entry.first == name; });
    if (at != values.end()) at->second = mean;
  }
}

Baseline joined_baseline(const std::vector<ClipSummary>& clips, std::size_t b) {
  Baseline joined{clips.front().summary.baselines[b].name, {}, {}, clips.front().summary.baselines[b].of_frame_0};
  WeightedValues values;
  for (const ClipSummary& clip : clips) {
    for (const Baseline& baseline : clip.summary.baselines) {
      if (baseline.name != joined.name) continue;
      values.add(baseline.values, weight_of(clip, joined.of_frame_0));
      append_frames(baseline.per_frame, clip.begin, joined.per_frame);
    }
  }
  joined.values = values.result();
  take_over(mean_errors(joined.per_frame), joined.values);
  return joined;
}

void add_values(const MetricValues& values, ConfigValue& object) {
  for (const auto& [name, value] : values) object.add(name, ConfigValue::make_number(value));
}

ConfigValue clip_json(const ClipSummary& clip) {
  ConfigValue object = ConfigValue::make_object();
  object.add("name", ConfigValue::make_string(clip.name));
  object.add("begin", ConfigValue::make_integer(clip.begin));
  object.add("frames", ConfigValue::make_integer(clip.summary.frames));
  object.add("seconds", ConfigValue::make_number(clip.summary.seconds));
  if (clip.summary.metrics.empty()) return object;
  MetricValues errors = clip.summary.metrics.back().values;
  std::erase_if(errors, [](const auto& value) { return is_counter(value.first); });
  add_values(errors, object);
  return object;
}

ConfigValue join_json(const JoinSummary& join) {
  ConfigValue object = ConfigValue::make_object();
  object.add("before", ConfigValue::make_string(join.before));
  object.add("after", ConfigValue::make_string(join.after));
  object.add("frame", ConfigValue::make_integer(join.frame));
  add_values(join.values, object);
  return object;
}

/// The numbers of an object that are no members of their own.
MetricValues numbers_of(const ConfigValue& object, const std::string& pointer) {
  MetricValues values;
  for (const ConfigMember& member : object.members) {
    if (member.value.kind != Kind::kNumber || member.key == "begin" || member.key == "frames" ||
        member.key == "seconds" || member.key == "frame")
      continue;
    values.emplace_back(member.key, number_of(member.value, child_pointer(pointer, member.key)));
  }
  return values;
}

int count_of(const ConfigValue& object, const std::string& pointer, const char* key) {
  const ConfigValue* const member = find_member(object, key);
  if (member == nullptr) fail_at(object, pointer, "there is no " + json_string(key));
  return static_cast<int>(whole_number_of(*member, child_pointer(pointer, key)));
}

/// Calls f(object, pointer) for the objects of a list of the tree.
template <class F>
void for_objects(const ConfigValue& tree, const char* key, const F& f) {
  const std::string place = child_pointer("", key);
  const ConfigValue* const list = find_member(tree, key);
  if (list == nullptr) fail_at(tree, "", "there is no " + json_string(key));
  check_kind(*list, Kind::kArray, place);
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    check_kind(list->items[i], Kind::kObject, child_pointer(place, std::to_string(i)));
    f(list->items[i], child_pointer(place, std::to_string(i)));
  }
}

Table metrics_table(Table table, const std::vector<const MetricValues*>& sources) {
  for (const std::vector<MetricFacts>* const known : {&metric_facts(), &join_metric_facts()}) {
    for (const MetricFacts& facts : *known) table.rows.push_back(metric_row(facts, sources));
  }
  std::erase_if(table.rows, [](const std::vector<Cell>& row) { return row.empty(); });
  return table;
}

}  // namespace

const std::vector<MetricFacts>& join_metric_facts() {
  static const std::vector<MetricFacts> facts = {
      {"jump_mm", "jump of the joints", "mm", "Mean distance of the joints, last state before and first after", 1, -1},
      {"jump_object_cm", "jump of the objects", "cm", "Distance of the objects' centroids, likewise", 2, -1},
      {"jump_object_deg", "turn of the objects", "°", "Angle between the objects' rotations, likewise", 2, -1},
  };
  return facts;
}

RunSummary joined_summary(const std::string& name, const std::vector<ClipSummary>& clips) {
  HSI4D_CHECK(!clips.empty(), "a chain has clips");
  RunSummary all;
  all.name = name;
  all.frames = clips.back().begin + clips.back().summary.frames;
  all.has_truth =
      std::any_of(clips.begin(), clips.end(), [](const ClipSummary& clip) { return clip.summary.has_truth; });
  all.start = joined_start(clips);
  for (const ClipSummary& clip : clips) {
    all.seconds += clip.summary.seconds;
    if (all.surface.empty()) all.surface = clip.summary.surface;
    append_frames(clip.summary.per_frame, clip.begin, all.per_frame);
  }
  for (std::size_t s = 0; s < clips.front().summary.metrics.size(); ++s) all.metrics.push_back(joined_stage(clips, s));
  for (std::size_t b = 0; b < clips.front().summary.baselines.size(); ++b)
    all.baselines.push_back(joined_baseline(clips, b));
  if (!all.metrics.empty()) take_over(mean_errors(all.per_frame), all.metrics.back().values);
  return all;
}

std::string chain_summary_json(const ChainSummary& summary) {
  ConfigValue tree = parse_json_text(summary_json(summary.all), "summary.json");
  ConfigValue clips = ConfigValue::make_array(), joins = ConfigValue::make_array();
  for (const ClipSummary& clip : summary.clips) clips.items.push_back(clip_json(clip));
  for (const JoinSummary& join : summary.joins) joins.items.push_back(join_json(join));
  tree.add("clips", std::move(clips));
  tree.add("joins", std::move(joins));
  return to_json(tree);
}

ChainSummary parse_chain_summary(const std::string& text, const std::string& name) {
  ChainSummary summary;
  summary.all = parse_summary(text, name);
  const ConfigValue tree = parse_json_text(text, name);
  for_objects(tree, "clips", [&](const ConfigValue& object, const std::string& pointer) {
    ClipSummary clip;
    clip.name = string_member(object, "name");
    clip.begin = count_of(object, pointer, "begin");
    clip.summary.name = clip.name;
    clip.summary.frames = count_of(object, pointer, "frames");
    if (const ConfigValue* const seconds = find_member(object, "seconds"))
      clip.summary.seconds = number_of(*seconds, child_pointer(pointer, "seconds"));
    clip.summary.metrics.push_back({"", 0, 0, numbers_of(object, pointer)});
    summary.clips.push_back(std::move(clip));
  });
  for_objects(tree, "joins", [&](const ConfigValue& object, const std::string& pointer) {
    summary.joins.push_back({string_member(object, "before"), string_member(object, "after"),
                             count_of(object, pointer, "frame"), numbers_of(object, pointer)});
  });
  return summary;
}

Table clip_table(const ChainSummary& summary) {
  Table table{
      .title = "Errors", .caption = "Of each clip's last stage, means over its frames after the first", .head = {""}};
  std::vector<const MetricValues*> sources;
  for (const ClipSummary& clip : summary.clips) {
    table.head.emplace_back(clip.name);
    sources.push_back(&clip.summary.metrics.back().values);
  }
  return metrics_table(std::move(table), sources);
}

Table join_table(const ChainSummary& summary) {
  Table table{.title = "Joins",
              .caption =
                  "How far the first state of a clip is from the last one before it, and from the truth: the "
                  "drift up to there",
              .head = {""}};
  std::vector<const MetricValues*> sources;
  for (const JoinSummary& join : summary.joins) {
    table.head.emplace_back(join.before + "-" + join.after);
    sources.push_back(&join.values);
  }
  return metrics_table(std::move(table), sources);
}

}  // namespace hsi4d
