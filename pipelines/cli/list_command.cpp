#include "pipelines/cli/list_command.h"

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/suggest.h"
#include "pipelines/avatar/fit.h"
#include "pipelines/cli/instances.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/run_config.h"
#include "pipelines/config/synthetic_places.h"
#include "pipelines/graph/frame_graph.h"
#include "pipelines/graph/sequence_graph.h"
#include "pipelines/scan/settings.h"
#include "pipelines/synthetic/motion.h"

namespace hsi4d::cli {
namespace {

/// What `hsi4d list` can list.
std::vector<std::string> list_topics() {
  return {"losses", "stages", "scenes", "settings", "avatar_fit", "reconstruct"};
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
  for (const ConfigChoice<Draw>& draw : kDraws) {
    for (const std::string& group : unknown_group_names(draw.value))
      table.rows.push_back({"first_frame", draw.name, group, state_group_summary(group)});
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

}  // namespace

std::string list_command(const std::string& topic, const std::vector<LossDescription>& losses) {
  if (topic == "losses") return list_losses(losses);
  if (topic == "stages") return list_stages();
  if (topic == "scenes") return list_scenes(losses);
  if (topic == "settings") return settings_table(run_config_settings(losses));
  if (topic == "avatar_fit") return settings_table(avatar_fit_settings(losses));
  if (topic == "reconstruct") return settings_table(scan_settings(losses));
  throw UserError("hsi4d list: there is nothing called \"" + topic + "\" to list; known: " + joined(list_topics()) +
                  did_you_mean(topic, list_topics()));
}

void add_list(CLI::App& app, Program& program) {
  auto& topic = program.options<std::string>();
  CLI::App* list = app.add_subcommand("list", "List what configs can name");
  list->add_option("TOPIC", topic, joined(list_topics()))->required();
  run_when_chosen(*list, program, [&] { return list_command(topic, descriptions_of(program.terms)); });
}

}  // namespace hsi4d::cli
