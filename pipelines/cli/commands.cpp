#include "pipelines/cli/commands.h"

#include <algorithm>
#include <span>

#include "core/check.h"
#include "core/config_file.h"
#include "core/suggest.h"
#include "pipelines/avatar/fit.h"
#include "pipelines/cli/instances.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/config/run_config.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/config/synthetic_places.h"
#include "pipelines/graph/frame_graph.h"
#include "pipelines/graph/sequence_graph.h"
#include "pipelines/sweep/plan.h"
#include "pipelines/synthetic/motion.h"

namespace hsi4d::cli {
namespace {

template <class T>
std::string names_of_choices(const ConfigMap<T>& map) {
  std::vector<std::string> names;
  for (const auto& [name, value] : map) names.push_back(name);
  return names.empty() ? "" : " (" + joined(names) + ")";
}

/// Loss terms by name, with what is off.
std::string names_of_choices(const ConfigMap<LossSettings>& losses) {
  std::vector<std::string> names;
  for (const auto& [name, loss] : losses) names.push_back(name + (loss.weight == 0 ? " off by weight 0" : ""));
  return names.empty() ? "" : " (" + joined(names) + ")";
}

std::string stage_summary(const std::string& name, const StageSettings& stage) {
  return "  stage " + name + ": " + count_text(stage.iterations, "iteration") + ", " +
         count_text(std::ssize(stage.optimize), "parameter group") + names_of_choices(stage.optimize) + ", " +
         count_text(std::ssize(stage.losses), "loss") + names_of_choices(stage.losses) + "\n";
}

std::string summary(const std::filesystem::path& file, const RunConfig& config) {
  const RenderSettings& render = config.render;
  std::string text = file.generic_string() + ": OK\n";
  text += "  seed " + std::to_string(config.seed) + ", ";
  text += config.threads == 0 ? "one thread a core\n" : count_text(config.threads, "thread") + "\n";
  text += "  render: quality " + std::string(choice_name<Quality>(kQualities, render.quality));
  if (render.compatibility != Compatibility::kNone)
    text += ", as " + std::string(choice_name<Compatibility>(kCompatibilities, render.compatibility));
  text += "\n";
  if (!config.chain.empty()) {
    std::vector<std::string> names;
    for (const ChainClip& clip : config.chain) names.push_back(clip.name);
    text += "  chain of " + count_text(std::ssize(names), "clip") + " (" + joined(names) + ")\n";
  }
  for (const auto& [name, stage] : config.stages) text += stage_summary(name, stage);
  if (config.stages.empty()) text += "  no stages\n";
  for (const RunNote& note : run_notes(config)) text += "  note: " + note.text + "\n";
  return text;
}

std::string fit_summary(const std::filesystem::path& file, const AvatarFitSettings& fit) {
  std::string text = file.generic_string() + ": OK, a config of `hsi4d avatar fit`\n";
  text +=
      "  views: " + (fit.views.empty() ? "not given; --set views=DIR/views.json" : fit.views.generic_string()) + "\n";
  text += "  starts from " +
          (fit.avatar.empty() ? count_text(fit.gaussians, "Gaussian") + " on the body" : fit.avatar.generic_string()) +
          "\n";
  return text + stage_summary("avatar fit", fit.stage);
}

std::string list_losses(const std::vector<LossDescription>& losses) {
  Table table;
  for (const LossDescription& loss : losses) table.rows.push_back({loss.name, loss.summary});
  return table_text(table);
}

std::string settings_table(const std::vector<ConfigSetting>& settings) {
  Table table{.head = {"SETTING", "DEFAULT", "ALLOWED", "MEANING"}};
  for (const ConfigSetting& setting : settings)
    table.rows.push_back({setting.pointer, setting.initial, setting.allowed, setting.summary});
  return table_text(table);
}

/// What a stage may move, by what it is over and what it draws.
std::string list_stages() {
  Table table{.head = {"OVER", "DRAW", "GROUP", "MOVES"}};
  for (const char* over : {"first_frame", "frame"}) {
    for (const ConfigChoice<Draw>& draw : kDraws) {
      for (const std::string& group : state_group_names(draw.value))
        table.rows.push_back({over, draw.name, group, state_group_summary(group)});
    }
  }
  for (const std::string& group : sequence_group_names())
    table.rows.push_back({"sequence", "", group, sequence_group_summary(group)});
  return table_text(table);
}

/// What synthetic.scene, synthetic.motion and synthetic.object can be, and the instances of the benchmark.
std::string list_scenes(const std::vector<LossDescription>& losses) {
  Table table{.head = {"SYNTHETIC", "", "WHAT", "PLACES, OBJECTS"}};
  for (const auto& kind : kSyntheticSceneKinds)
    table.rows.push_back({"scene", kind.name, scene_summary(kind.value), place_names_of(kind.value)});
  for (const auto& kind : kSyntheticMotionKinds)
    table.rows.push_back({"motion", kind.name, motion_summary(kind.value), object_names_of(kind.value)});
  for (const auto& kind : kSyntheticObjectKinds)
    table.rows.push_back({"object", kind.name, object_summary(kind.value), ""});
  const std::vector<std::vector<std::string>> instances = instance_rows(instance_folder(), losses);
  if (instances.empty()) return table_text(table);
  Table found{.head = {"INSTANCE", "PROMPT", "OBJECT", "DATA"}};
  for (const auto& row : instances) found.rows.emplace_back(row.begin(), row.end());
  return table_text(table) + "\n" + table_text(found);
}

/// A sweep has no settings of its own to override, and many configs.
std::string check_sweep(const std::filesystem::path& file, const std::vector<std::string>& overrides, bool print_config,
                        const std::vector<LossDescription>& losses) {
  const std::string name = file.generic_string();
  if (!overrides.empty() || print_config)
    throw UserError(name + ": is a sweep, which --set and --print-config are not for; hsi4d sweep " + name +
                    " --dry-run prints its runs");
  const SweepPlan plan = plan_sweep(file, losses);
  return name + ": OK, a sweep of " + count_text(std::ssize(distinct_runs(plan)), "run") + "\n";
}

}  // namespace

std::string check_command(const std::filesystem::path& config, const std::vector<std::string>& overrides,
                          bool print_config, const std::vector<LossDescription>& losses) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(config, overrides, problems);
  if (config_kind(tree) == ConfigKind::kSweep) return check_sweep(config, overrides, print_config, losses);
  if (config_kind(tree) == ConfigKind::kAvatarFit) {
    const AvatarFitSettings fit = read_avatar_fit(tree, config, losses, problems, false);
    return print_config ? resolved_avatar_fit(fit, losses) : fit_summary(config, fit);
  }
  const RunConfig run = read_run_config(tree, losses, problems, ConfigUse::kStages);
  return print_config ? resolved_config(run, losses) : summary(config, run);
}

std::vector<std::string> schema_kinds() { return {"run", "avatar_fit", "sweep"}; }

std::string schema_command(const std::string& kind, const std::vector<LossDescription>& losses) {
  if (kind == "run") return run_config_schema(losses);
  if (kind == "avatar_fit") return avatar_fit_schema(losses);
  if (kind == "sweep") return sweep_schema();
  throw UserError("hsi4d schema: there are no configs of \"" + kind + "\"; known: " + joined(schema_kinds()) +
                  did_you_mean(kind, schema_kinds()));
}

std::vector<std::string> list_topics() { return {"losses", "stages", "scenes", "settings", "avatar_fit"}; }

std::string list_command(const std::string& topic, const std::vector<LossDescription>& losses) {
  if (topic == "losses") return list_losses(losses);
  if (topic == "stages") return list_stages();
  if (topic == "scenes") return list_scenes(losses);
  if (topic == "settings") return settings_table(run_config_settings(losses));
  if (topic == "avatar_fit") return settings_table(avatar_fit_settings(losses));
  throw UserError("hsi4d list: there is nothing called \"" + topic + "\" to list; known: " + joined(list_topics()) +
                  did_you_mean(topic, list_topics()));
}

}  // namespace hsi4d::cli
