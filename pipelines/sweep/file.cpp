#include "pipelines/sweep/file.h"

#include <algorithm>
#include <charconv>
#include <limits>
#include <set>

#include "core/config.h"
#include "core/config_place.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;
using Strings = std::vector<std::string>;

const Strings kBlockKeys = {"name", "base", "set", "clips", "seeds", "ablations", "grid", "zip", "skip", "only"};
const Strings kFileKeys = {"name", "base", "set",    "clips",   "seeds",   "ablations", "grid", "zip",
                           "skip", "only", "blocks", "compare", "threads", "memory_mb", "slurm"};

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
    read_config(with_members(tree, {"threads", "memory_mb", "slurm"}), fields, problems_);
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
      if (sweep_key(setting.key) == "seed") {
        add(setting.origin, place, "seeds are an axis of their own: write \"seeds\": [0, 1] beside the grid");
        continue;
      }
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
    if (const ConfigValue* const own = member("skip")) read_rules(*own, at("skip"), true, block.rules);
    if (const ConfigValue* const own = member("only")) read_rules(*own, at("only"), false, block.rules);
    return block;
  }

  void read_blocks(const ConfigValue& tree, const SweepBlock& whole, SweepFile& sweep) {
    const ConfigValue* const blocks = find_member(tree, "blocks");
    if (blocks == nullptr) {
      sweep.blocks.push_back(whole);
      sweep.blocks.back().name.clear();
      refuse_too_many(tree.origin, "", sweep_combinations(whole));
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
      const std::string& name = sweep.blocks.back().name;
      if (!name.empty() && !names.insert(name).second)
        add(find_member(own, "name")->origin, place + "/name", json_string(name) + " is the name of another block too");
      runs += sweep_combinations(sweep.blocks.back());
      if (refuse_too_many(own.origin, place, runs)) return;  // each block has seeds and axes of its own in memory
    }
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
};

}  // namespace

void describe(ConfigFields& f, SweepFile& s) {
  f.integer("threads", s.threads, {.min = 0, .max = 1024}, "Threads of a run; 0: the cores are shared out");
  f.number("memory_mb", s.memory_mb, {.min = 0}, "What a run takes at most, MB; 0: not known");
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
