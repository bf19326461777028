#include <algorithm>
#include <set>

#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/sweep/file.h"

namespace hsi4d {
namespace {

using Strings = std::vector<std::string>;

/// Axes that are not settings, as rules name them.
const Strings kNamedAxes = {"block", "clip", "ablation", "seed"};

/// What axes say of each other, and rules of axes.
class AxisChecks {
 public:
  AxisChecks(const SweepFile& sweep, ConfigProblems& problems) : sweep_(sweep), problems_(problems) {}

  void run() {
    for (const SweepBlock& block : sweep_.blocks) refuse_shared_keys(block);
    check_rules();
    check_compare();
  }

 private:
  /// A problem once, also where several blocks have taken it over.
  void add(const ConfigOrigin& origin, const std::string& pointer, const std::string& text) {
    if (told_.insert(std::to_string(origin.offset) + pointer + text).second) problems_.add(origin, pointer, text);
  }

  /// A setting that two axes name, or of which one names a part: one of them would not count.
  void refuse_shared_keys(const SweepBlock& block) {
    named_.clear();
    for (const auto* axes : {&block.grid, &block.zip, &block.searched}) {
      for (std::size_t i = 0; i < axes->size(); ++i) {
        const std::string who = axes == &block.grid ? "grid"
                                : axes == &block.searched
                                    ? "search"
                                    : "zip" + (block.zip.size() > 1 ? " " + std::to_string(i) : "");
        for (const SweepSetting& setting : (*axes)[i].points.front()) name_key(setting, who, i);
      }
    }
    for (const auto* variants : {&block.ablations, &block.seeds}) {
      const std::string who = variants == &block.ablations ? "ablations" : "seeds";
      for (const SweepVariant& variant : *variants) {
        for (const SweepSetting& setting : variant.set) name_key(setting, who, 0);
        if (!variant.seed) continue;
        name_key({"seed", {}, {}}, who, 0);
        name_key({"synthetic.seed", {}, {}}, who, 0);
      }
    }
  }

  /// @param axis  which one of the grid: each is one of its own
  void name_key(const SweepSetting& setting, const std::string& who, std::size_t axis) {
    const std::string key = sweep_key(setting.key);
    for (const Named& other : named_) {
      const bool is_own = other.who == who && other.axis == axis;
      if (is_own && other.key == key) return;  // of another seed or ablation: 100,000 seeds name one key
      if (is_own || !(is_within(key, other.key) || is_within(other.key, key))) continue;
      // Seeds that are numbers have no place of their own.
      const ConfigOrigin& origin = setting.origin.source == nullptr ? other.origin : setting.origin;
      if (other.key == key)
        return add(origin, "", key + " is set by " + other.who + " and by " + who + "; one of them would not count");
      return add(origin, "",
                 other.key + " is set by " + other.who + " and " + key + " by " + who +
                     "; one is a part of the other, and would not count");
    }
    named_.push_back({key, who, axis, setting.origin});
  }

  /// "stages.camera.iterations" is within "stages.camera", and within itself.
  static bool is_within(const std::string& key, const std::string& whole) {
    return key.starts_with(whole) && (key.size() == whole.size() || key[whole.size()] == '.');
  }

  // ---- What rules and `compare` are about ----

  Strings axis_names() const {
    Strings names;
    const auto add_name = [&names](const std::string& name) {
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    };
    for (const SweepBlock& block : sweep_.blocks) {
      for (const std::string& name : kNamedAxes) {
        if (has_sweep_axis(block, name)) add_name(name);
      }
      for (const SweepAxis* const axis : setting_axes(block)) {
        for (const std::string& key : axis->keys) add_name(sweep_key(key));
      }
    }
    return names;
  }

  void refuse_no_axis(const SweepSetting& setting, const std::string& in) {
    const auto is_of = [&](const SweepBlock& block) { return has_sweep_axis(block, setting.key); };
    if (std::any_of(sweep_.blocks.begin(), sweep_.blocks.end(), is_of)) return;
    const Strings known = axis_names();
    const std::string hint = did_you_mean(setting.key, known);
    add(setting.origin, child_pointer(in, setting.key),
        "is no axis of this sweep" + (hint.empty() ? "; known: " + (known.empty() ? "none" : joined(known)) : hint));
  }

  void check_rules() {
    std::set<std::string> seen;
    for (const SweepBlock& block : sweep_.blocks) {
      for (const SweepRule& rule : block.rules) {
        if (!seen.insert(rule.pointer).second) continue;
        for (const SweepSetting& setting : rule.values) refuse_no_axis(setting, rule.pointer);
      }
    }
  }

  void check_compare() {
    for (const SweepSetting& setting : sweep_.compare) {
      if (setting.key == "seed" || setting.key == "clip") {
        add(setting.origin, "/compare/" + setting.key,
            "runs are compared with those of the same clip and seed; name an ablation or a setting");
      } else {
        refuse_no_axis(setting, "/compare");
      }
    }
  }

  /// A key that an axis names.
  struct Named {
    std::string key, who;
    std::size_t axis;
    ConfigOrigin origin;
  };

  const SweepFile& sweep_;
  ConfigProblems& problems_;
  std::set<std::string> told_;
  std::vector<Named> named_;  // of a block
};

}  // namespace

std::vector<const SweepAxis*> setting_axes(const SweepBlock& block) {
  std::vector<const SweepAxis*> all;
  for (const auto* axes : {&block.searched, &block.grid, &block.zip}) {
    for (const SweepAxis& axis : *axes) all.push_back(&axis);
  }
  return all;
}

void check_sweep_axes(const SweepFile& sweep, ConfigProblems& problems) { AxisChecks(sweep, problems).run(); }

std::int64_t sweep_combinations(const SweepBlock& block) {
  std::int64_t count = 1;
  const auto cross = [&count](std::size_t choices) {
    if (choices > 0) count = std::min(count * static_cast<std::int64_t>(choices), kMostSweepRuns + 1);
  };
  for (const std::size_t choices : {block.clips.size(), block.ablations.size(), block.seeds.size()}) cross(choices);
  for (const SweepAxis* const axis : setting_axes(block)) cross(axis->points.size());
  return count;
}

bool has_sweep_axis(const SweepBlock& block, const std::string& key) {
  if (key == "block") return !block.name.empty();
  if (key == "clip") return !block.clips.empty();
  if (key == "ablation") return !block.ablations.empty();
  if (key == "seed") return !block.seeds.empty();
  for (const SweepAxis* const axis : setting_axes(block)) {
    for (const std::string& own : axis->keys) {
      if (sweep_key(own) == sweep_key(key)) return true;
    }
  }
  return false;
}

}  // namespace hsi4d
