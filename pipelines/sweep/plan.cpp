#include "pipelines/sweep/plan.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <set>

#include "core/check.h"
#include "core/config_file.h"
#include "core/config_place.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/text.h"
#include "optim/checkpoint.h"
#include "pipelines/config/chain_settings.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/config/source_settings.h"
#include "pipelines/config/synthetic_settings.h"

namespace hsi4d {
namespace {

namespace fs = std::filesystem;
using Kind = ConfigValue::Kind;

/// Sections of a clip's config that say what is reconstructed, not how.
constexpr std::array kClipSections = {"instance", "data", "chain", "sources", "body", "synthetic"};
/// Settings of section `data` that say how.
constexpr std::array kMaskSettings = {"mask_threshold", "mask_margin_px"};

/// A combination before its config is made.
struct Combination {
  SweepRun run;
  const SweepBlock* block = nullptr;
  const SweepClip* clip = nullptr;
  std::vector<const std::vector<SweepSetting>*> layers;    ///< in the order in which they are laid over the base
  std::vector<const std::vector<SweepSetting>*> searched;  ///< of them, those that a clip's come before
  std::optional<std::int64_t> seed;
};

// ---- Combinations ----

void remember_values(const std::vector<SweepSetting>& point, SweepRun& run) {
  for (const SweepSetting& setting : point)
    run.values.emplace_back(sweep_key(setting.key), sweep_value_text(setting.value));
}

/// All combinations of what there is with each of `count` choices, which `take` puts into a copy.
template <class Take>
std::vector<Combination> crossed(const std::vector<Combination>& all, std::size_t count, const Take& take) {
  if (count == 0) return all;
  std::vector<Combination> more;
  for (const Combination& one : all) {
    for (std::size_t i = 0; i < count; ++i) {
      more.push_back(one);
      take(more.back(), i);
    }
  }
  return more;
}

std::vector<Combination> combinations_of(const SweepBlock& block) {
  Combination first;
  first.run.block = block.name;
  first.block = &block;
  first.layers = {&block.set};
  std::vector<Combination> all = {first};
  for (const SweepAxis& axis : block.searched) {  // the slowest, so that a search that ends early has whole points
    const bool is_rungs = axis.keys == block.search->rungs.keys;
    all = crossed(all, axis.points.size(), [&](Combination& c, std::size_t i) {
      remember_values(axis.points[i], c.run);
      c.searched.push_back(&axis.points[i]);
      if (is_rungs) c.run.rung = i;
    });
  }
  all = crossed(all, block.clips.size(), [&](Combination& c, std::size_t i) {
    c.clip = &block.clips[i];
    c.run.clip = c.clip->name;
    c.layers.push_back(&c.clip->set);
  });
  for (Combination& c : all) c.layers.insert(c.layers.end(), c.searched.begin(), c.searched.end());
  all = crossed(all, block.ablations.size(), [&](Combination& c, std::size_t i) {
    c.run.ablation = block.ablations[i].name;  // its settings are laid after those of the grid
  });
  for (const auto* axes : {&block.grid, &block.zip}) {
    for (const SweepAxis& axis : *axes) {
      all = crossed(all, axis.points.size(), [&](Combination& c, std::size_t i) {
        remember_values(axis.points[i], c.run);
        c.layers.push_back(&axis.points[i]);
      });
    }
  }
  for (Combination& c : all) {
    for (const SweepVariant& ablation : block.ablations) {
      if (ablation.name == c.run.ablation) c.layers.push_back(&ablation.set);
    }
  }
  return crossed(all, block.seeds.size(), [&](Combination& c, std::size_t i) {
    c.run.seed = block.seeds[i].name;
    c.seed = block.seeds[i].seed;
    c.layers.push_back(&block.seeds[i].set);
  });
}

// ---- Rules ----

/// What a run has on an axis, as sweep_name_text and sweep_value_text write it.
std::string value_on_axis(const SweepRun& run, const std::string& axis) {
  if (axis == "block") return run.block;
  if (axis == "clip") return run.clip;
  if (axis == "ablation") return run.ablation;
  if (axis == "seed") return run.seed;
  for (const auto& [key, value] : run.values) {
    if (key == sweep_key(axis)) return value;
  }
  return "";
}

bool is_named_axis(const std::string& key) {
  return key == "block" || key == "clip" || key == "ablation" || key == "seed";
}

bool matches(const SweepRun& run, const SweepSetting& wanted) {
  const auto text = [&](const ConfigValue& value) {
    return is_named_axis(wanted.key) ? sweep_name_text(value) : sweep_value_text(value);
  };
  const std::string has = value_on_axis(run, wanted.key);
  return text(wanted.value) == has ||
         std::any_of(wanted.value.items.begin(), wanted.value.items.end(),
                     [&](const ConfigValue& one) { return wanted.value.kind == Kind::kArray && text(one) == has; });
}

bool matches(const SweepRun& run, const SweepRule& rule) {
  return std::all_of(rule.values.begin(), rule.values.end(),
                     [&run](const SweepSetting& wanted) { return matches(run, wanted); });
}

/// Rules in use: each must have been good for something.
class Rules {
 public:
  bool keeps(const Combination& combination) {
    bool has_only = false, is_chosen = false, is_skipped = false;
    for (const SweepRule& rule : combination.block->rules) {
      const bool applies = std::all_of(rule.values.begin(), rule.values.end(), [&](const SweepSetting& wanted) {
        return has_sweep_axis(*combination.block, wanted.key);
      });
      if (!applies) continue;
      const bool is_match = matches(combination.run, rule);
      if (is_match) used_.insert(rule.pointer);
      (rule.is_skip ? is_skipped : is_chosen) |= is_match;
      has_only |= !rule.is_skip;
    }
    return !is_skipped && (is_chosen || !has_only);
  }

  void tell_unused(const SweepFile& sweep, ConfigProblems& problems) {
    for (const SweepBlock& block : sweep.blocks) {
      for (const SweepRule& rule : block.rules) {
        if (used_.insert(rule.pointer).second) problems.add(rule.origin, rule.pointer, "no run has these values");
      }
    }
  }

 private:
  std::set<std::string> used_;
};

std::vector<Combination> combinations_of(const SweepFile& sweep) {
  std::vector<Combination> all;
  ConfigProblems problems;
  Rules rules;
  std::vector<std::size_t> empty;
  for (std::size_t i = 0; i < sweep.blocks.size(); ++i) {
    const std::size_t before = all.size();
    for (Combination& combination : combinations_of(sweep.blocks[i])) {
      if (rules.keeps(combination)) all.push_back(std::move(combination));
    }
    if (all.size() == before) empty.push_back(i);
  }
  rules.tell_unused(sweep, problems);
  if (problems.empty()) {
    for (const std::size_t i : empty) {
      const SweepRule& rule = sweep.blocks[i].rules.back();
      problems.add(rule.origin, rule.pointer,
                   "no run is left" + (sweep.blocks.size() > 1 ? " of block " + std::to_string(i) : ""));
    }
  }
  problems.throw_if_any();
  return all;
}

// ---- Configs ----

bool has_any(const ConfigValue& object, std::initializer_list<const char*> keys) {
  return std::any_of(keys.begin(), keys.end(), [&](const char* key) {
    const ConfigValue* const value = find_member(object, key);
    return value != nullptr && (value->kind != Kind::kString || !value->text.empty());
  });
}

/// Whether the dataset is to be made: there is a section for that, and no data.
bool is_generated(const ConfigValue& tree) {
  if (find_member(tree, "synthetic") == nullptr) return false;
  const ConfigValue *const data = find_member(tree, "data"), *const chain = find_member(tree, "chain");
  return (data == nullptr || !has_any(*data, {"scene", "avatar", "frames", "masks", "camera", "initial"})) &&
         (chain == nullptr || chain->items.empty()) && find_member(tree, "sources") == nullptr;
}

/// The base with what a clip's config says of data.
ConfigValue with_clip(ConfigValue base, const ConfigValue& clip) {
  ConfigValue masks = ConfigValue::make_object();
  if (const ConfigValue* const data = find_member(base, "data")) {
    for (const ConfigMember& member : data->members) {
      if (std::find(kMaskSettings.begin(), kMaskSettings.end(), member.key) != kMaskSettings.end())
        masks.members.push_back(member);
    }
  }
  for (const char* const section : kClipSections) {
    std::erase_if(base.members, [&](const ConfigMember& member) { return member.key == section; });
    for (const ConfigMember& member : clip.members) {
      if (member.key == section) base.members.push_back(member);
    }
  }
  if (masks.members.empty()) return base;
  ConfigValue over = ConfigValue::make_object();
  over.add("data", std::move(masks));
  return merged(std::move(base), std::move(over));
}

/// Settings as text, for comparisons.
std::string settings_text(const std::vector<SweepSetting>& settings) {
  std::string text;
  for (const SweepSetting& setting : settings)
    text += sweep_key(setting.key) + " " + sweep_value_text(setting.value) + "\n";
  return text;
}

/// What a combination is made of beside its clip, its seed and the values that it is told by.
std::string recipe_of(const Combination& c) {
  std::string text = c.block->base.string() + "\n" + settings_text(c.block->set);
  for (const SweepVariant& ablation : c.block->ablations) {
    if (ablation.name == c.run.ablation) text += settings_text(ablation.set);
  }
  return text;
}

/// What two configs have in common that give the same result.
ConfigValue identity_of(ConfigValue tree, bool is_made) {
  const bool selects = selects_camera(tree);
  std::erase_if(tree.members, [&](const ConfigMember& member) {
    return member.key == "name" || member.key == "threads" || member.key == "log" ||
           (member.key == "camera_selection" && !selects) || (member.key == "synthetic" && !is_made);
  });
  return tree;
}

std::string identity_text(const std::string& config, const std::string& name, bool is_made) {
  return to_json(identity_of(parse_json_text(config, name), is_made));
}

PlannedSearch planned(const SweepSearch& search, const std::string& block) {
  PlannedSearch plan{block, search.metric, {}, {}, search.factor};
  for (const SweepRange& range : search.over) plan.over.push_back({sweep_key(range.key), range.is_log});
  for (const std::string& key : search.rungs.keys) plan.rung_keys.push_back(sweep_key(key));
  return plan;
}

class Planner {
 public:
  Planner(const SweepFile& sweep, const std::vector<LossDescription>& losses) : sweep_(sweep), losses_(losses) {}

  SweepPlan plan() {
    SweepPlan plan{sweep_.name, {}, {}, sweep_.threads, sweep_.memory_mb, sweep_.slurm, sweep_.hours};
    plan.memory_retries = sweep_.memory_retries;
    for (const SweepBlock& block : sweep_.blocks) {
      if (block.search) plan.searches.push_back(planned(*block.search, block.name));
    }
    std::vector<Combination> all = combinations_of(sweep_);
    for (Combination& combination : all) {
      try {
        complete(combination);
      } catch (const UserError& problem) {
        note(problem.what(), plan.runs.size());
      }
      plan.runs.push_back(combination.run);
    }
    throw_if_any(plan);
    warn_of_unread();
    refuse_mixed_blocks(all, plan);
    plan.compare = reference(plan);
    return plan;
  }

 private:
  const ConfigValue& tree_of(const fs::path& file) {
    const auto known = trees_.find(file);
    if (known != trees_.end()) return known->second;
    ConfigProblems problems;
    ConfigValue tree = load_config(file, {}, problems);
    require_kind(tree, ConfigKind::kRun, file);
    problems.throw_if_any();
    return trees_.emplace(file, std::move(tree)).first->second;
  }

  /// Whether the instance that the config is about has its data in place.
  bool has_own_data(const ConfigValue& tree) const {
    ConfigProblems ignored;  // told when the whole is read
    return has_data(read_run_config(tree, losses_, ignored, ConfigUse::kSettings).instance);
  }

  /// Makes the config of a combination, and its names.
  void complete(Combination& c) {
    ConfigValue tree = tree_of(c.block->base);
    if (c.clip != nullptr) tree = with_clip(std::move(tree), tree_of(c.clip->config));
    ConfigProblems problems;
    for (const auto* layer : c.layers) {
      for (const SweepSetting& setting : *layer)
        lay_into_config(tree, setting.key, setting.value, setting.origin, problems);
    }
    const bool is_made = is_generated(tree) && !has_own_data(tree);
    if (!is_made) note_unread(c);
    if (c.seed) {
      const ConfigValue seed = ConfigValue::make_integer(*c.seed);
      lay_into_config(tree, "seed", seed, {}, problems);
      if (is_made) lay_into_config(tree, "synthetic.seed", seed, {}, problems);
    }
    RunConfig config = read_run_config(tree, losses_, problems, is_made ? ConfigUse::kStages : ConfigUse::kRun);
    if (is_made) check_generated(c.block->base, config);
    config.name = sweep_.name + ": " + sweep_label(c.run);
    c.run.config = resolved_config(config, losses_);
    const std::string identity = identity_text(c.run.config, "config", is_made);
    c.run.id = text_hash(identity);
    const auto [same, is_new] = identities_.emplace(c.run.id, identity);
    HSI4D_CHECK(same->second == identity, "two configs have the hash " + c.run.id);
    if (is_made) c.run.dataset = text_hash(synthetic_settings_json(config.synthetic, config.body));
  }

  static void check_generated(const fs::path& base, const RunConfig& config) {
    const std::string name = base.generic_string();
    if (config.synthetic.kind != SyntheticKind::kClip)
      throw UserError(name +
                      ": /synthetic/kind: a run needs a clip; views are for hsi4d avatar fit, photos for hsi4d "
                      "reconstruct");
    if (config.stages.empty()) throw UserError(name + ": /stages: a run needs at least one stage");
  }

  /// What a sweep sets of a dataset that is there, and not made.
  void note_unread(const Combination& c) {
    for (const auto* layer : c.layers) {
      for (const SweepSetting& setting : *layer)
        if (config_keys(setting.key).front() == "synthetic") ++unread_[sweep_key(setting.key)];
    }
  }

  void warn_of_unread() const {
    for (const auto& [key, runs] : unread_)
      log_warning(sweep_.name + ": nothing reads " + key + " in " + std::to_string(runs) +
                  (runs == 1 ? " run" : " runs") + ", whose config names its data");
  }

  void note(const std::string& problem, std::size_t run) {
    for (auto& [text, runs] : problems_) {
      if (text == problem) return runs.push_back(run);
    }
    problems_.push_back({problem, {run}});
  }

  void throw_if_any(const SweepPlan& plan) const {
    std::string text;
    for (const auto& [problem, runs] : problems_) {
      const auto has_more = [&problem = problem](const auto& other) {  // another message has this one in it
        return other.first != problem && other.first.find(problem) != std::string::npos;
      };
      if (std::any_of(problems_.begin(), problems_.end(), has_more)) continue;
      text += (text.empty() ? "" : "\n") + problem;
      if (runs.size() == plan.runs.size()) continue;
      const std::string first = std::to_string(runs.front()) + " (" + sweep_label(plan.runs[runs.front()]) + ")";
      text += runs.size() == 1 ? "\n  in run " + first
                               : "\n  in " + std::to_string(runs.size()) + " of " + std::to_string(plan.runs.size()) +
                                     " runs, the first of them " + first;
    }
    if (!text.empty()) throw UserError(text);
  }

  /// Runs of blocks without names that are called the same are one row of the results: they must be made in one way.
  void refuse_mixed_blocks(const std::vector<Combination>& all, const SweepPlan& plan) const {
    std::map<std::string, std::pair<const Combination*, std::string>> rows, runs;
    for (std::size_t i = 0; i < all.size(); ++i) {
      SweepRun row = plan.runs[i];
      const std::string label = sweep_label(row);
      row.clip.clear();
      row.seed.clear();
      const auto first = runs.emplace(whole_label(plan.runs[i]), std::pair(&all[i], plan.runs[i].id)).first;
      const auto of_row = rows.emplace(whole_label(row), std::pair(&all[i], recipe_of(all[i]))).first;
      const bool is_same = first->second.second == plan.runs[i].id && of_row->second.second == recipe_of(all[i]);
      if (is_same) continue;
      const SweepBlock& other =
          first->second.second != plan.runs[i].id ? *first->second.first->block : *of_row->second.first->block;
      ConfigProblems problems;
      problems.add(all[i].block->origin, all[i].block->pointer,
                   "run " + std::to_string(i) + " (" + label + ") would be taken for one of " + other.pointer +
                       ", which has other settings; give the blocks a \"name\"");
      problems.throw_if_any();
    }
  }

  /// As sweep_label, with all values in full.
  static std::string whole_label(const SweepRun& run) {
    std::string text = run.block + "\n" + run.clip + "\n" + run.ablation + "\n" + run.seed;
    for (const auto& [key, value] : run.values) text += "\n" + key + " " + value;
    return text;
  }

  /// What the others are compared with.
  std::vector<std::pair<std::string, std::string>> reference(const SweepPlan& plan) const {
    std::vector<std::pair<std::string, std::string>> compare;
    for (const SweepSetting& setting : sweep_.compare) {
      compare.emplace_back(
          is_named_axis(setting.key) ? setting.key : sweep_key(setting.key),
          is_named_axis(setting.key) ? sweep_name_text(setting.value) : sweep_value_text(setting.value));
      const auto has_it = [&](const SweepRun& run) {
        return value_on_axis(run, compare.back().first) == compare.back().second;
      };
      if (std::none_of(plan.runs.begin(), plan.runs.end(), has_it)) {
        ConfigProblems problems;
        problems.add(setting.origin, child_pointer("/compare", setting.key),
                     "no run has " + shown(setting.value) + " there");
        problems.throw_if_any();
      }
    }
    if (!compare.empty()) {
      refuse_no_pair(plan, compare);
      return compare;
    }
    for (const SweepBlock& block : sweep_.blocks) {
      for (const SweepVariant& ablation : block.ablations) {
        const auto has_it = [&](const SweepRun& run) { return run.ablation == ablation.name; };
        if (ablation.set.empty() && std::any_of(plan.runs.begin(), plan.runs.end(), has_it))
          return {{"ablation", ablation.name}};
      }
    }
    const SweepRun& first = plan.runs.front();
    if (search_of(plan, first) != nullptr) return compare;  // no point of a search is what others are measured by
    if (!first.ablation.empty()) compare.emplace_back("ablation", first.ablation);
    compare.insert(compare.end(), first.values.begin(), first.values.end());
    return compare;
  }

  /// Each of the values is some run's; one must have them all.
  void refuse_no_pair(const SweepPlan& plan, const std::vector<std::pair<std::string, std::string>>& compare) const {
    const auto has_all = [&compare](const SweepRun& run) {
      return std::all_of(compare.begin(), compare.end(),
                         [&run](const auto& wanted) { return value_on_axis(run, wanted.first) == wanted.second; });
    };
    if (std::any_of(plan.runs.begin(), plan.runs.end(), has_all)) return;
    ConfigProblems problems;
    problems.add(sweep_.compare.front().origin, "/compare", "no run has all of these values");
    problems.throw_if_any();
  }

  const SweepFile& sweep_;
  const std::vector<LossDescription>& losses_;
  std::map<fs::path, ConfigValue> trees_;
  std::map<std::string, std::string> identities_;
  std::map<std::string, std::int64_t> unread_;                              // runs, by key
  std::vector<std::pair<std::string, std::vector<std::size_t>>> problems_;  // text, runs
};

// ---- Names ----

/// The last `count` parts of a key.
std::string last_parts(const std::string& key, std::size_t count) {
  std::size_t at = key.size();
  while (count-- > 0 && at != std::string::npos && at > 0) at = key.rfind('.', at - 1);
  return at == std::string::npos ? key : key.substr(at + 1);
}

}  // namespace

const PlannedSearch* search_of(const SweepPlan& plan, const SweepRun& run) {
  const auto is_its = [&run](const PlannedSearch& search) { return search.block == run.block; };
  const auto found = std::find_if(plan.searches.begin(), plan.searches.end(), is_its);
  return found == plan.searches.end() ? nullptr : &*found;
}

std::string short_sweep_key(const std::string& key) { return last_parts(key, 1); }

std::string plain_sweep_value(const std::string& json) {
  constexpr std::size_t kMost = 40;
  std::string text = json;
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  if (text.size() > kMost) text = "…" + text.substr(text.size() - kMost);
  return is_plain_text(text) ? text : with_escapes(text);
}

std::vector<std::string> short_sweep_keys(const std::vector<std::string>& keys, std::size_t least) {
  std::vector<std::string> names;
  for (const std::string& key : keys) {
    std::size_t count = least;
    const auto is_like = [&](const std::string& other) {
      return other != key && last_parts(other, count) == last_parts(key, count);
    };
    while (last_parts(key, count) != key && std::any_of(keys.begin(), keys.end(), is_like)) ++count;
    names.push_back(last_parts(key, count));
  }
  return names;
}

std::vector<SweepLabelPart> sweep_label_parts(const SweepRun& run) {
  std::vector<SweepLabelPart> parts;
  for (const auto& [axis, name] :
       {std::pair<const char*, std::string>{"block", run.block}, {"clip", run.clip}, {"ablation", run.ablation}}) {
    if (!name.empty()) parts.push_back({axis, name});
  }
  std::vector<std::string> keys;
  for (const auto& [key, value] : run.values) keys.push_back(key);
  const std::vector<std::string> names = short_sweep_keys(keys);
  for (std::size_t i = 0; i < keys.size(); ++i)
    parts.push_back({keys[i], names[i] + " " + plain_sweep_value(run.values[i].second)});
  if (!run.seed.empty()) parts.push_back({"seed", "seed " + run.seed});
  return parts;
}

std::string sweep_label(const SweepRun& run) {
  std::vector<std::string> texts;
  for (SweepLabelPart& part : sweep_label_parts(run)) texts.push_back(std::move(part.text));
  return texts.empty() ? "the only run" : joined(texts);
}

SweepRun without_repetition(SweepRun run) {
  run.clip.clear();
  run.seed.clear();
  return run;
}

SweepPlan plan_sweep(const fs::path& file, const std::vector<LossDescription>& losses) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, {}, problems);
  require_kind(tree, ConfigKind::kSweep, file);
  const SweepFile sweep = read_sweep_file(tree, file, problems);
  return Planner(sweep, losses).plan();
}

std::string sweep_run_id(const std::string& text, const std::string& name, bool is_made) {
  return text_hash(identity_text(text, name, is_made));
}

std::vector<std::size_t> distinct_runs(const SweepPlan& plan) {
  std::set<std::string> seen;
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    if (seen.insert(plan.runs[i].id).second) all.push_back(i);
  }
  return all;
}

}  // namespace hsi4d
