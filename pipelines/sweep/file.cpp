#include "pipelines/sweep/file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "core/config.h"
#include "core/config_place.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/metrics/metric_facts.h"
#include "pipelines/sweep/search.h"
#include "pipelines/sweep/sobol.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;
using Strings = std::vector<std::string>;

const Strings kBlockKeys = {"name", "base", "set",    "clips", "seeds", "ablations",
                            "grid", "zip",  "search", "skip",  "only"};
const Strings kFileKeys = {"name",    "base",    "set",   "clips",     "seeds",          "ablations",
                           "grid",    "zip",     "skip",  "only",      "search",         "blocks",
                           "compare", "threads", "hours", "memory_mb", "memory_retries", "slurm"};

constexpr ConfigChoice<SweepSampling> kSamplings[] = {{SweepSampling::kSobol, "sobol"},
                                                      {SweepSampling::kRandom, "random"}};
constexpr ConfigChoice<bool> kScales[] = {{false, "linear"}, {true, "log"}};
constexpr double kMostNumber = 1e15, kLeastLog = 1e-15;  // of ranges; whole numbers up to the first are exact

void describe(ConfigFields& f, SweepRange& r) {
  f.number("from", r.from, {.min = -kMostNumber, .max = kMostNumber}, "The least value").required();
  f.number("to", r.to, {.min = -kMostNumber, .max = kMostNumber}, "The largest value").required();
  f.choice("scale", r.is_log, kScales, "Of equal differences as many values, or of equal ratios");
  f.boolean("integer", r.is_integer, "Whole numbers alone, both ends among them");
  f.rule({"to", "from"}, [&r]() -> std::string {
    return r.from < r.to ? "" : number_text(r.to) + " is not above \"from\", " + number_text(r.from);
  });
  f.rule({"from", "scale", "integer"}, [&r]() -> std::string {
    const double least = r.is_integer ? 1 : kLeastLog;
    return !r.is_log || r.from >= least
               ? ""
               : number_text(r.from) + " has no place on a logarithmic scale; allowed: " + number_text(least) +
                     " or more";
  });
  f.rule({"integer", "from", "to"}, [&r]() -> std::string {
    const bool is_whole = std::floor(r.from) == r.from && std::floor(r.to) == r.to;
    return !r.is_integer || is_whole ? "" : "\"from\" and \"to\" of whole numbers are whole numbers";
  });
}

void describe(ConfigFields& f, SweepSearch& s) {
  f.string("metric", s.metric, "What is searched for, by its name in summary.json: the best of it").required();
  f.choice("method", s.method, kSamplings, "How points are chosen: evenly, or independently of each other");
  f.integer("seed", s.seed, {.min = 0}, "Of the points");
  f.integer("runs", s.runs, {.min = 1, .max = kMostSweepRuns}, "The most runs, of all points, clips and seeds together")
      .required();
}

void describe(ConfigFields& f, SweepSlurm& s) {
  f.string("time", s.time, "Time of a run, as sbatch takes it: 02:00:00; empty: the partition's");
  f.integer("memory_mb", s.memory_mb, {.min = 0}, "Memory of a run; 0: memory_mb of the sweep, or the partition's");
  f.integer("at_once", s.at_once, {.min = 0}, "The most runs at once; 0: as many as there is room for");
  f.string("partition", s.partition, "Where it runs; empty: the default partition");
  f.integer("grace_s", s.grace_s, {.min = 1, .max = 65535},
            "So many seconds before the end of its time a run saves its state, and is put into the queue again");
  f.strings("options", s.options, "More options of sbatch");
}

/// Why an option of sbatch would undo what a sweep asks of Slurm; null: it does not.
const char* reason_against(const std::string& option) {
  const auto is = [&option](const std::string& name) { return option == name || option.starts_with(name + "="); };
  if (is("--time") || option.starts_with("-t")) return "/slurm/time says it, with which /slurm/grace_s is compared";
  if (is("--time-min")) return "Slurm may then give less than /slurm/time, with which /slurm/grace_s is compared";
  if (is("--signal")) return "/slurm/grace_s says when a run is told that its time ends";
  if (is("--array") || option.starts_with("-a")) return "which runs an array has the sweep says";
  if (is("--no-requeue")) return "a run whose time ends puts itself into the queue again";
  return nullptr;
}

constexpr std::int64_t kEarlyWarning = 60;  // seconds: so much earlier than asked for Slurm may send its warning

/// Seconds of a time as sbatch takes it: MINUTES, MINUTES:SECONDS, HOURS:MINUTES:SECONDS, DAYS-HOURS and so on; 0 for
/// what is none of these, or none at all. Slurm gives whole minutes.
std::int64_t slurm_seconds(const std::string& time) {
  constexpr std::int64_t kMinute = 60, kHour = 3600, kDay = 86400;
  const std::size_t dash = time.find('-');
  const bool has_days = dash != std::string::npos;
  std::vector<std::int64_t> numbers;
  std::string part;
  for (const char c : time + ":") {
    if (c >= '0' && c <= '9') {
      part += c;
      continue;
    }
    if (part.empty() || part.size() > 9 || (c != ':' && c != '-')) return 0;
    numbers.push_back(std::stoll(part));
    part.clear();
  }
  const std::vector<std::int64_t> units = has_days              ? std::vector{kDay, kHour, kMinute, std::int64_t{1}}
                                          : numbers.size() == 3 ? std::vector{kHour, kMinute, std::int64_t{1}}
                                                                : std::vector{kMinute, std::int64_t{1}};
  std::int64_t seconds = 0;
  for (std::size_t i = 0; i < std::min(numbers.size(), units.size()); ++i) seconds += numbers[i] * units[i];
  return (seconds + kMinute - 1) / kMinute * kMinute;
}

bool is_name(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

/// An object with some of the members of another one.
ConfigValue with_members(const ConfigValue& tree, const Strings& keys) {
  ConfigValue part = ConfigValue::make_object();
  part.origin = tree.origin;
  for (const ConfigMember& member : tree.members) {
    if (std::find(keys.begin(), keys.end(), member.key) != keys.end()) part.members.push_back(member);
  }
  return part;
}

class Reader {
 public:
  explicit Reader(ConfigProblems& problems) : problems_(problems) {}

  SweepFile read(const ConfigValue& tree, const std::filesystem::path& file) {
    SweepFile sweep;
    refuse_unknown(tree, kFileKeys, "");
    const SweepBlock whole = read_block(tree, "", SweepBlock{});
    sweep.name = whole.name.empty() ? file.stem().string() : whole.name;
    if (!is_file_name(sweep.name))
      add(tree.origin, "/name",
          json_string(sweep.name) + ", after the file, cannot be the name of a folder; allowed: " + kFileNameText);
    ConfigFields fields;
    describe(fields, sweep);
    read_config(with_members(tree, {"threads", "hours", "memory_mb", "memory_retries", "slurm"}), fields, problems_);
    check_slurm(tree, sweep.slurm);
    if (const ConfigValue* const compare = find_member(tree, "compare")) sweep.compare = settings(*compare, "/compare");
    read_blocks(tree, whole, sweep);
    check_sweep_axes(sweep, problems_);
    refuse_missing_base(tree, sweep);
    return sweep;
  }

 private:
  void add(const ConfigOrigin& origin, const std::string& pointer, const std::string& text) {
    problems_.add(origin, pointer, text);
  }

  bool expect(const ConfigValue& value, Kind kind, const std::string& pointer, const char* wanted) {
    if (value.kind == kind) return true;
    add(value.origin, pointer,
        (value.kind == Kind::kNull ? std::string("null is not ")
                                   : shown(value) + " is " + kind_name(value) + ", not ") +
            wanted);
    return false;
  }

  void refuse_unknown(const ConfigValue& tree, const Strings& known, const std::string& in) {
    for (const ConfigMember& member : tree.members) {
      if (std::find(known.begin(), known.end(), member.key) != known.end()) continue;
      const std::string hint = did_you_mean(member.key, known);
      add(member.key_origin, child_pointer(in, member.key),
          "unknown key" + (hint.empty() ? "; known here: " + joined(known) : hint));
    }
  }

  bool has_name(const ConfigOrigin& origin, const std::string& name, const std::string& pointer) {
    if (is_name(name)) return true;
    add(origin, pointer, json_string(name) + " cannot be a name; allowed: letters, digits, '_' and '-'");
    return false;
  }

  /// {KEY: value, ...}
  std::vector<SweepSetting> settings(const ConfigValue& tree, const std::string& in) {
    std::vector<SweepSetting> all;
    if (!expect(tree, Kind::kObject, in, "an object of settings, {KEY: value}")) return all;
    for (const ConfigMember& member : tree.members) {
      if (config_keys(member.key).empty()) {
        add(member.key_origin, child_pointer(in, member.key),
            json_string(member.key) + " is no key of a setting; write stages.camera.iterations");
      } else {
        all.push_back({member.key, member.value, member.key_origin});
      }
    }
    refuse_twice(all, in);
    return all;
  }

  /// Keys that are spelt differently and mean one place.
  void refuse_twice(const std::vector<SweepSetting>& all, const std::string& in) {
    std::set<std::string> seen;
    for (const SweepSetting& setting : all) {
      if (!seen.insert(sweep_key(setting.key)).second)
        add(setting.origin, child_pointer(in, setting.key), "the same setting is named twice here");
    }
  }

  /// An axis that is there and empty: a mistake, unless it says that what the file has is not meant for a block.
  bool is_empty(const ConfigValue& tree, const std::string& in, bool has_inherited) {
    if (!tree.members.empty() || !tree.items.empty()) return false;
    if (!has_inherited) add(tree.origin, in, "is empty; name something, or leave it out");
    return true;
  }

  std::vector<SweepVariant> ablations(const ConfigValue& tree, const std::string& in, bool has_inherited) {
    std::vector<SweepVariant> all;
    if (!expect(tree, Kind::kObject, in, "an object of ablations, {NAME: {KEY: value}}")) return all;
    if (is_empty(tree, in, has_inherited)) return all;
    for (const ConfigMember& member : tree.members) {
      const std::string place = child_pointer(in, member.key);
      if (has_name(member.key_origin, member.key, place)) all.push_back({member.key, settings(member.value, place)});
    }
    return all;
  }

  std::optional<std::int64_t> seed_number(const ConfigValue& value, const std::string& pointer, std::int64_t least,
                                          std::int64_t most) {
    std::int64_t number = -1;
    const char* const end = value.text.data() + value.text.size();
    const bool is_whole = value.kind == Kind::kNumber && std::from_chars(value.text.data(), end, number).ptr == end &&
                          number >= least && number <= most;
    if (is_whole) return number;
    add(value.origin, pointer,
        shown(value) + " is not a seed; allowed: " + std::to_string(least) +
            (most == std::numeric_limits<std::int64_t>::max() ? " or more" : " to " + std::to_string(most)));
    return std::nullopt;
  }

  std::vector<SweepVariant> seeds(const ConfigValue& tree, const std::string& in) {
    std::vector<SweepVariant> all;
    if (tree.kind == Kind::kObject) return ablations(tree, in, false);
    if (tree.kind == Kind::kNumber) {
      const auto count = seed_number(tree, in, 1, kMostSweepRuns);
      for (std::int64_t i = 0; count && i < *count; ++i) all.push_back({std::to_string(i), {}, i});
      return all;
    }
    if (!expect(tree, Kind::kArray, in, "a number of seeds, a list of them, or {NAME: {KEY: value}}")) return all;
    if (is_empty(tree, in, false)) return all;
    std::set<std::int64_t> seen;
    for (std::size_t i = 0; i < tree.items.size(); ++i) {
      const std::string place = child_pointer(in, std::to_string(i));
      const auto seed = seed_number(tree.items[i], place, 0, std::numeric_limits<std::int64_t>::max());
      if (!seed) continue;
      const std::string name = std::to_string(*seed);
      if (!seen.insert(*seed).second) add(tree.items[i].origin, place, name + " is in the list twice");
      all.push_back({name, {}, seed});
    }
    return all;
  }

  /// A clip's config, which must be there.
  bool read_clip_file(const ConfigValue& value, const std::string& pointer, SweepClip& clip) {
    const std::size_t before = problems_.size();
    ConfigFields fields;
    fields.path("config", clip.config, {.must_exist = true, .may_be_empty = false}, "").required();
    ConfigValue holder = ConfigValue::make_object();
    holder.add("config", value);
    clip.origin = value.origin;
    const std::size_t slash = pointer.rfind("/config");
    ConfigProblems own;  // told at the place of the value
    read_config(holder, fields, own);
    if (own.empty()) return true;
    const bool is_member = slash != std::string::npos && slash + 7 == pointer.size();
    read_config(holder, fields, problems_, is_member ? pointer.substr(0, slash) : pointer);
    return problems_.size() == before;
  }

  std::vector<SweepClip> clips(const ConfigValue& tree, const std::string& in, bool has_inherited) {
    std::vector<SweepClip> all;
    if (tree.kind != Kind::kArray && !expect(tree, Kind::kObject, in, "a list of configs, or {NAME: config}"))
      return all;
    if (is_empty(tree, in, has_inherited)) return all;
    for (std::size_t i = 0; i < tree.items.size(); ++i) {
      const std::string place = child_pointer(in, std::to_string(i));
      SweepClip clip;
      if (!read_clip_file(tree.items[i], place, clip)) continue;
      clip.name = clip.config.stem().string();
      if (!has_name(clip.origin, clip.name, place)) continue;
      if (std::any_of(all.begin(), all.end(), [&](const SweepClip& other) { return other.name == clip.name; }))
        add(clip.origin, place, json_string(clip.name) + " is the name of two clips; name them: {NAME: config}");
      all.push_back(std::move(clip));
    }
    for (const ConfigMember& member : tree.members) {
      const std::string place = child_pointer(in, member.key);
      if (has_name(member.key_origin, member.key, place)) read_clip(member, place, all);
    }
    return all;
  }

  void read_clip(const ConfigMember& member, const std::string& place, std::vector<SweepClip>& all) {
    SweepClip clip;
    clip.name = member.key;
    const ConfigValue* file = &member.value;
    std::string file_place = place;
    if (member.value.kind == Kind::kObject) {
      refuse_unknown(member.value, {"config", "set"}, place);
      file = find_member(member.value, "config");
      if (file == nullptr) return add(member.value.origin, place, "names no \"config\"");
      file_place = child_pointer(place, "config");
      if (const ConfigValue* const set = find_member(member.value, "set"))
        clip.set = settings(*set, child_pointer(place, "set"));
    }
    if (read_clip_file(*file, file_place, clip)) all.push_back(std::move(clip));
  }

  bool refuse_seed(const SweepSetting& setting, const std::string& in) {
    if (sweep_key(setting.key) != "seed") return false;
    add(setting.origin, child_pointer(in, setting.key),
        "seeds are an axis of their own: write \"seeds\": [0, 1] beside the grid");
    return true;
  }

  /// {KEY: [values], ...}, an axis a key.
  std::vector<SweepAxis> axes(const ConfigValue& tree, const std::string& in) {
    std::vector<SweepAxis> all;
    for (const SweepSetting& setting : settings(tree, in)) {
      const std::string place = child_pointer(in, setting.key);
      if (!expect(setting.value, Kind::kArray, place, "a list of values")) continue;
      if (setting.value.items.empty()) {
        add(setting.value.origin, place, "has no values; give some, or leave it out");
        continue;
      }
      if (refuse_seed(setting, in)) continue;
      SweepAxis axis{{setting.key}, {}};
      for (const ConfigValue& value : setting.value.items) axis.points.push_back({{setting.key, value, value.origin}});
      all.push_back(std::move(axis));
    }
    return all;
  }

  void refuse_equal_points(const SweepAxis& axis, const std::string& in) {
    std::set<std::string> seen;
    for (const std::vector<SweepSetting>& point : axis.points) {
      std::string text;
      for (const SweepSetting& setting : point) text += sweep_value_text(setting.value) + "\n";
      if (seen.insert(text).second) continue;
      add(point.front().origin, child_pointer(in, point.front().key),
          point.size() == 1 ? shown(point.front().value) + " is in the list twice"
                            : "the same values are in the lists twice");
    }
  }

  std::vector<SweepAxis> grid(const ConfigValue& tree, const std::string& in, bool has_inherited) {
    if (!expect(tree, Kind::kObject, in, "an object, {KEY: [values]}") || is_empty(tree, in, has_inherited)) return {};
    std::vector<SweepAxis> all = axes(tree, in);
    for (const SweepAxis& axis : all) refuse_equal_points(axis, in);
    return all;
  }

  std::vector<SweepAxis> zips(const ConfigValue& tree, const std::string& in, bool has_inherited) {
    if (tree.kind != Kind::kArray && !expect(tree, Kind::kObject, in, "an object, {KEY: [values]}, or a list of them"))
      return {};
    if (is_empty(tree, in, has_inherited)) return {};
    std::vector<SweepAxis> all;
    if (tree.kind == Kind::kObject) add_zip(tree, in, all);
    for (std::size_t i = 0; i < tree.items.size(); ++i)
      add_zip(tree.items[i], child_pointer(in, std::to_string(i)), all);
    return all;
  }

  void add_zip(const ConfigValue& tree, const std::string& in, std::vector<SweepAxis>& all) {
    if (!expect(tree, Kind::kObject, in, "an object, {KEY: [values]}") || is_empty(tree, in, false)) return;
    const std::vector<SweepAxis> lists = axes(tree, in);
    if (lists.size() != tree.members.size()) return;  // told
    SweepAxis axis;
    axis.points.resize(lists.front().points.size());
    for (const SweepAxis& list : lists) {
      if (list.points.size() != axis.points.size())
        return add(tree.origin, in, "lists that are zipped have one length, and these have " + lengths(lists));
      axis.keys.push_back(list.keys.front());
      for (std::size_t i = 0; i < list.points.size(); ++i) axis.points[i].push_back(list.points[i].front());
    }
    refuse_equal_points(axis, in);
    all.push_back(std::move(axis));
  }

  static std::string lengths(const std::vector<SweepAxis>& lists) {
    Strings told;
    for (const SweepAxis& list : lists)
      told.push_back(std::to_string(list.points.size()) + " (" + list.keys.front() + ")");
    return joined(told);
  }

  void read_rules(const ConfigValue& tree, const std::string& in, bool is_skip, std::vector<SweepRule>& rules) {
    if (!expect(tree, Kind::kArray, in, "a list, [{KEY: value}]") || is_empty(tree, in, false)) return;
    for (std::size_t i = 0; i < tree.items.size(); ++i) {
      const std::string place = child_pointer(in, std::to_string(i));
      if (!expect(tree.items[i], Kind::kObject, place, "an object, {KEY: value}") ||
          is_empty(tree.items[i], place, false))
        continue;
      rules.push_back({settings(tree.items[i], place), is_skip, place, tree.items[i].origin});
    }
  }

  // ---- Search ----

  /// {"from": 0.001, "to": 0.1, ...}, or a list of choices.
  std::optional<SweepRange> range(const SweepSetting& setting, const std::string& in) {
    SweepRange range{setting.key, setting.origin, {}};
    if (setting.value.kind == Kind::kArray) {
      SweepAxis choices{{setting.key}, {}};
      for (const ConfigValue& value : setting.value.items)
        choices.points.push_back({{setting.key, value, value.origin}});
      refuse_equal_points(choices, in);
      if (setting.value.items.size() < 2)
        add(setting.value.origin, child_pointer(in, setting.key), "a choice is of two values or more");
      range.choices = setting.value.items;
      return range;
    }
    const std::string place = child_pointer(in, setting.key);
    if (!expect(setting.value, Kind::kObject, place, "a list of choices, or a range, {\"from\": 0.001, \"to\": 0.1}"))
      return std::nullopt;
    ConfigFields fields;
    describe(fields, range);
    read_config(setting.value, fields, problems_, place);
    return range;
  }

  void read_halving(const ConfigValue& tree, const std::string& in, SweepSearch& search) {
    if (!expect(tree, Kind::kObject, in, "an object, {\"rungs\": {KEY: [values]}}")) return;
    refuse_unknown(tree, {"rungs", "factor"}, in);
    ConfigFields fields;
    fields.integer("factor", search.factor, {.min = 2, .max = 1000}, "Of so many points of a rung the best goes on");
    read_config(with_members(tree, {"factor"}), fields, problems_, in);
    const ConfigValue* const rungs = find_member(tree, "rungs");
    if (rungs == nullptr) return add(tree.origin, in, "names no \"rungs\": {KEY: [values]}, the cheapest first");
    const std::string place = child_pointer(in, "rungs");
    std::vector<SweepAxis> zipped;
    add_zip(*rungs, place, zipped);
    if (zipped.empty()) return;  // told
    search.rungs = std::move(zipped.front());
    if (search.rungs.points.size() < 2)
      add(rungs->origin, place, "there is one rung; give each key two values or more");
  }

  std::optional<SweepSearch> search(const ConfigValue& tree, const std::string& in, bool has_inherited) {
    if (!expect(tree, Kind::kObject, in, "an object, {\"over\": {KEY: range}, ...}") ||
        is_empty(tree, in, has_inherited))
      return std::nullopt;
    const std::size_t before = problems_.size();
    SweepSearch search;
    search.pointer = in;
    search.origin = tree.origin;
    refuse_unknown(tree, {"metric", "method", "seed", "runs", "over", "halving"}, in);
    ConfigFields fields;
    describe(fields, search);
    read_config(with_members(tree, {"metric", "method", "seed", "runs"}), fields, problems_, in);
    if (const ConfigValue* const metric = find_member(tree, "metric"))
      check_metric(*metric, child_pointer(in, "metric"));
    const ConfigValue* const over = find_member(tree, "over");
    const std::string place = child_pointer(in, "over");
    if (over == nullptr) add(tree.origin, in, "names nothing to search \"over\": {KEY: range}");
    const bool has_over = over != nullptr && expect(*over, Kind::kObject, place, "an object, {KEY: range}") &&
                          !is_empty(*over, place, false);
    for (const SweepSetting& setting : has_over ? settings(*over, place) : std::vector<SweepSetting>()) {
      if (refuse_seed(setting, place)) continue;
      if (const auto read = range(setting, place)) search.over.push_back(*read);
    }
    if (search.method == SweepSampling::kSobol && search.over.size() > kMostSobolDimensions)
      add(over->origin, place,
          std::to_string(search.over.size()) + " settings are more than the " + std::to_string(kMostSobolDimensions) +
              " that Sobol's points are known for; \"method\": \"random\" takes any number");
    if (const ConfigValue* const halving = find_member(tree, "halving"))
      read_halving(*halving, child_pointer(in, "halving"), search);
    if (problems_.size() > before) return std::nullopt;
    return search;
  }

  /// A metric that has a better side.
  void check_metric(const ConfigValue& value, const std::string& pointer) {
    if (value.kind != Kind::kString) return;  // told
    const MetricFacts* const facts = find_metric_facts(value.text);
    if (facts != nullptr && facts->better != 0) return;
    Strings known;
    for (const MetricFacts& metric : metric_facts()) {
      if (metric.better != 0) known.emplace_back(metric.name);
    }
    const std::string hint = did_you_mean(value.text, known);
    add(value.origin, pointer,
        facts != nullptr
            ? json_string(value.text) + " is neither better large nor small; allowed: " + joined(known)
            : json_string(value.text) + " is no metric" + (hint.empty() ? "; known: " + joined(known) : hint));
  }

  /// The axes that the search of a whole block comes to.
  void add_searched_axes(SweepBlock& block) {
    if (!block.search) return;
    const SweepSearch& search = *block.search;
    const std::int64_t per_point = sweep_combinations(block), points = points_within(search, per_point);
    const auto tell = [&](const std::string& text) {
      if (told_.insert(text + search.pointer).second) add(search.origin, search.pointer, text);
    };
    const std::string within = std::to_string(search.runs) + " runs (\"runs\")";
    if (points == 0)
      return tell(within + " are too few: each point is " + std::to_string(per_point) +
                  " runs, of clips, seeds and the other axes");
    std::int64_t least = 2;
    for (std::size_t i = 1; i < search.rungs.points.size() && least <= kMostSweepRuns; ++i)
      least = i == 1 ? search.factor : least * search.factor;
    if (points < least)
      return tell(within + " are " + std::to_string(points) + (points == 1 ? " point" : " points") + " of " +
                  std::to_string(per_point) + (per_point == 1 ? " run" : " runs") +
                  "; allowed: " + std::to_string(least) + " points or more" +
                  (search.rungs.points.empty() ? "" : ", of which halving leaves one in the last rung"));
    const std::optional<std::int64_t> all = points_of_space(search.over);
    if (all && *all < points)
      return tell("there are " + std::to_string(*all) + " different points, and " + within + " are " +
                  std::to_string(points) + "; a grid has them all");
    std::optional<SweepAxis> axis = search_points(search, points);
    if (!axis)
      return tell(std::to_string(points) + " different points were not found, some are too unlikely; ask for fewer");
    if (!search.rungs.points.empty()) block.searched.push_back(search.rungs);
    block.searched.push_back(std::move(*axis));
  }

  /// Results of a search are told by the name of its block.
  void refuse_nameless_searches(const SweepFile& sweep) {
    if (sweep.blocks.size() < 2) return;
    for (const SweepBlock& block : sweep.blocks) {
      if (block.search && block.name.empty())
        add(block.origin, block.pointer, "has a search beside other blocks; give it a \"name\"");
    }
  }

  /// @param above  what the file says for all blocks; empty for the file itself
  SweepBlock read_block(const ConfigValue& tree, const std::string& in, const SweepBlock& above) {
    SweepBlock block = above;
    block.name.clear();
    block.pointer = in;
    block.origin = tree.origin;
    const auto member = [&tree](const char* key) { return find_member(tree, key); };
    const auto at = [&in](const char* key) { return child_pointer(in, key); };
    if (const ConfigValue* const name = member("name"); name != nullptr &&
                                                        expect(*name, Kind::kString, at("name"), "a string") &&
                                                        has_name(name->origin, name->text, at("name")))
      block.name = name->text;
    ConfigFields fields;
    fields.path("base", block.base, {.must_exist = true, .may_be_empty = false}, "The config that all runs begin with");
    read_config(with_members(tree, {"base"}), fields, problems_, in);
    if (const ConfigValue* const set = member("set")) {
      const std::vector<SweepSetting> own = settings(*set, at("set"));
      block.set.insert(block.set.end(), own.begin(), own.end());
    }
    if (const ConfigValue* const own = member("clips")) block.clips = clips(*own, at("clips"), !above.clips.empty());
    if (const ConfigValue* const own = member("seeds")) block.seeds = seeds(*own, at("seeds"));
    if (const ConfigValue* const own = member("ablations"))
      block.ablations = ablations(*own, at("ablations"), !above.ablations.empty());
    if (const ConfigValue* const own = member("grid")) block.grid = grid(*own, at("grid"), !above.grid.empty());
    if (const ConfigValue* const own = member("zip")) block.zip = zips(*own, at("zip"), !above.zip.empty());
    if (const ConfigValue* const own = member("search"))
      block.search = search(*own, at("search"), above.search.has_value());
    if (const ConfigValue* const own = member("skip")) read_rules(*own, at("skip"), true, block.rules);
    if (const ConfigValue* const own = member("only")) read_rules(*own, at("only"), false, block.rules);
    return block;
  }

  void read_blocks(const ConfigValue& tree, const SweepBlock& whole, SweepFile& sweep) {
    const ConfigValue* const blocks = find_member(tree, "blocks");
    if (blocks == nullptr) {
      sweep.blocks.push_back(whole);
      sweep.blocks.back().name.clear();
      add_searched_axes(sweep.blocks.back());
      refuse_too_many(tree.origin, "", sweep_combinations(sweep.blocks.back()));
      return;
    }
    if (!expect(*blocks, Kind::kArray, "/blocks", "a list of blocks, [{...}]") || is_empty(*blocks, "/blocks", false))
      return;
    std::set<std::string> names;
    std::int64_t runs = 0;
    for (std::size_t i = 0; i < blocks->items.size(); ++i) {
      const std::string place = child_pointer("/blocks", std::to_string(i));
      const ConfigValue& own = blocks->items[i];
      if (!expect(own, Kind::kObject, place, "an object")) continue;
      refuse_unknown(own, kBlockKeys, place);
      sweep.blocks.push_back(read_block(own, place, whole));
      add_searched_axes(sweep.blocks.back());
      const std::string& name = sweep.blocks.back().name;
      if (!name.empty() && !names.insert(name).second)
        add(find_member(own, "name")->origin, place + "/name", json_string(name) + " is the name of another block too");
      runs += sweep_combinations(sweep.blocks.back());
      if (refuse_too_many(own.origin, place, runs)) return;  // each block has seeds and axes of its own in memory
    }
    refuse_nameless_searches(sweep);
  }

  bool refuse_too_many(const ConfigOrigin& origin, const std::string& pointer, std::int64_t runs) {
    if (runs <= kMostSweepRuns) return false;
    add(origin, pointer, "the axes make more than " + std::to_string(kMostSweepRuns) + " runs, which is the most");
    return true;
  }

  void check_slurm(const ConfigValue& tree, const SweepSlurm& slurm) {
    const auto at = [&tree](const std::string& pointer) { return origin_at(tree, pointer); };
    const std::int64_t seconds = slurm_seconds(slurm.time), most = seconds - kEarlyWarning - 1;
    if (seconds > 0 && slurm.grace_s > most)
      add(at("/slurm/grace_s"), "/slurm/grace_s",
          std::to_string(slurm.grace_s) +
              " s before the end of its time, or up to a minute earlier, Slurm tells a run " +
              "to save its state; of " + std::to_string(seconds) + " s (/slurm/time) none may be left to work in; " +
              (most > 0 ? "allowed: 1 to " + std::to_string(most) + ", or " : "give it ") + "a time of more than " +
              std::to_string(slurm.grace_s + kEarlyWarning) + " s");
    for (std::size_t i = 0; i < slurm.options.size(); ++i) {
      const std::string place = "/slurm/options/" + std::to_string(i);
      if (!slurm.options[i].starts_with("-"))
        add(at(place), place,
            json_string(slurm.options[i]) +
                " is no option of sbatch, which begin with '-'; a value belongs to its "
                "option: --account=hsi");
      const char* const reason = reason_against(slurm.options[i]);
      if (reason != nullptr) add(at(place), place, json_string(slurm.options[i]) + " is not for here: " + reason);
    }
  }

  void refuse_missing_base(const ConfigValue& tree, const SweepFile& sweep) {
    if (!problems_.empty()) return;
    for (const SweepBlock& block : sweep.blocks) {
      if (block.base.empty())
        return add(tree.origin, "/base", "not given; a sweep needs the config that its runs begin with");
    }
  }

  ConfigProblems& problems_;
  std::set<std::string> told_;  // of searches that several blocks have taken over
};

}  // namespace

void describe(ConfigFields& f, SweepFile& s) {
  f.integer("threads", s.threads, {.min = 0, .max = 1024}, "Threads of a run; 0: the cores are shared out");
  f.number("hours", s.hours, {.min = 0}, "What all runs may take, added up: then none is started; 0: no limit");
  f.number("memory_mb", s.memory_mb, {.min = 0}, "What a run takes at most, MB; 0: not known");
  f.integer("memory_retries", s.memory_retries, {.min = 0, .max = kMostMemoryRetries},
            "So often a run that is killed for memory is computed again, each time with twice as much");
  f.object("slurm", s.slurm, "How Slurm starts the runs",
           [](ConfigFields& fields, SweepSlurm& slurm) { describe(fields, slurm); });
}

SweepFile read_sweep_file(const ConfigValue& tree, const std::filesystem::path& file, ConfigProblems& problems) {
  SweepFile sweep = Reader(problems).read(tree, file);
  problems.throw_if_any();
  return sweep;
}

std::string sweep_key(const std::string& key) {
  std::string text;
  for (const std::string& part : config_keys(key)) text += (text.empty() ? "" : ".") + part;
  return text;
}

std::string sweep_value_text(const ConfigValue& value) {
  ConfigValue plain = value;
  const auto shorten = [](ConfigValue& node, const auto& self) -> void {
    double number = 0;
    const char* const end = node.text.data() + node.text.size();
    if (node.kind == Kind::kNumber && std::from_chars(node.text.data(), end, number).ptr == end)
      node.text = number_text(number);
    for (ConfigValue& item : node.items) self(item, self);
    for (ConfigMember& member : node.members) self(member.value, self);
  };
  shorten(plain, shorten);
  return to_json_line(plain);
}

std::string sweep_name_text(const ConfigValue& value) {
  return value.kind == Kind::kString ? value.text : sweep_value_text(value);
}

}  // namespace hsi4d
