#include <array>
#include <cmath>

#include "core/config_file.h"
#include "pipelines/avatar/fit.h"
#include "pipelines/config/config_fields.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/config/removed_keys.h"

namespace hsi4d {

namespace {

constexpr int kMostThreads = 1024;

/// The value itself, or the first one in it, that a --set has written; null: there is none.
const ConfigValue* set_on_command_line(const ConfigValue& value) {
  if (value.origin.source != nullptr && value.origin.source->is_command_line) return &value;
  for (const ConfigMember& member : value.members) {
    const ConfigValue* const found = set_on_command_line(member.value);
    if (found != nullptr) return found;
  }
  return nullptr;
}

std::string fault_of_numbers(const std::vector<double>& numbers) {
  for (const double x : numbers) {
    if (x != std::floor(x)) return "whole numbers, counted from 0";
  }
  return "";
}

constexpr const char* kNoViews =
    "not given; a fit needs the views.json of pictures in known poses. "
    "`hsi4d synth configs/avatar/views.json --out DIR` makes some; then --set views=DIR/views.json";

/// What the command line says of a new avatar where none is made.
void add_unused(const ConfigValue& tree, const AvatarFitSettings& settings, ConfigProblems& problems) {
  if (settings.avatar.empty()) return;
  for (const char* key : {"gaussians", "body"}) {
    const ConfigValue* const value = find_member(tree, key);
    const ConfigValue* const said = value == nullptr ? nullptr : set_on_command_line(*value);
    if (said == nullptr) continue;
    problems.add(said->origin, child_pointer("", key),
                 "is of a new avatar; this fit goes on from " + settings.avatar.string() + ", /avatar, as it is");
  }
}

/// Settings of a stage that a fit does not have, and groups that would never move.
void add_stage_faults(const ConfigValue& tree, const StageSettings& stage, ConfigProblems& problems) {
  const auto add = [&](const std::string& key, const std::string& text) {
    const std::string pointer = "/stage" + key;
    problems.add(origin_at(tree, pointer), pointer, text);
  };
  if (stage.over != StageScope::kFrame) add("/over", "a fit of an avatar sees one view at a time");
  if (stage.draw != Draw::kAll) add("/draw", "a fit of an avatar draws the avatar alone");
  if (stage.weight != PixelWeight::kAll) add("/weight", "all pixels of a view count");
  for (const auto& [name, group] : stage.optimize) {
    if (stage.iterations > 0 && group.from >= stage.iterations)
      add(child_pointer("/optimize", name) + "/from", std::to_string(group.from) + " is beyond the stage's " +
                                                          std::to_string(stage.iterations) +
                                                          " iterations; the group would never move");
  }
}

void add_loss_faults(const ConfigValue& tree, StageSettings& stage, ConfigProblems& problems) {
  constexpr std::array<LossInput, 3> kInputs = {LossInput::kImage, LossInput::kHumanOpacity, LossInput::kLook};
  std::vector<LossFault> faults = losses_without_inputs(stage, kInputs, "a fit of an avatar");
  for (LossFault& fault : prepare_losses(stage)) faults.push_back(std::move(fault));
  for (const LossFault& fault : faults) {
    const std::string pointer = "/stage" + fault.pointer;
    problems.add(origin_at(tree, pointer), pointer, fault.text);
  }
}

}  // namespace

std::vector<std::string> avatar_fit_groups() {
  return {"colors", "opacity_logits", "log_scales", "quats", "means", "offsets", "color_net", "avatar_features"};
}

void describe(ConfigFields& f, AvatarFitSettings& s, const std::vector<LossDescription>& losses) {
  f.path("views", s.views, {.must_exist = true}, "views.json of the pictures; a fit needs one");
  f.path("avatar", s.avatar, {.must_exist = true}, "The avatar to go on from; without: new Gaussians on the body");
  f.integer("seed", s.seed, {.min = 0}, "Seed of a new avatar, of a new color net and of the order of the views");
  f.integer("threads", s.threads, {.min = 0, .max = kMostThreads},
            "Threads; 0: one a core. Results do not depend on it");
  f.integer("gaussians", s.gaussians, {.min = 100, .max = 2000000}, "Gaussians of a new avatar");
  f.numbers("background", s.background, {.min = 0, .max = 1}, "Colour behind the human");
  f.integer("mask_inset_px", s.mask_inset_px, {.min = 0, .max = 100},
            "Pixels this near to one that is not the human's do not count for the colours");
  f.numbers("held_cameras", s.held_cameras, {.min = 0}, "Cameras whose views are not learnt from, but measured");
  f.numbers("held_frames", s.held_frames, {.min = 0}, "Frames whose views are not learnt from, but measured");
  f.object("body", s.body, "The body of a new avatar");
  f.object("color_net", s.color_net, "How colours follow the pose");
  f.object("render", s.render, "How Gaussians become pixels");
  f.object("stage", s.stage, "What moves, and which losses count",
           [losses](ConfigFields& inner, StageSettings& stage) { describe(inner, stage, losses); });
  f.rule({"held_cameras"}, [&s] { return fault_of_numbers(s.held_cameras); });
  f.rule({"held_frames"}, [&s] { return fault_of_numbers(s.held_frames); });
}

AvatarFitSettings load_avatar_fit(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                  const std::vector<LossDescription>& losses) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, overrides, problems);
  require_kind(tree, ConfigKind::kAvatarFit, file);
  return read_avatar_fit(tree, file, losses, problems);
}

AvatarFitSettings read_avatar_fit(const ConfigValue& tree, const std::filesystem::path& file,
                                  const std::vector<LossDescription>& losses, ConfigProblems& problems,
                                  bool asks_views) {
  AvatarFitSettings settings;
  settings.file = file;
  ConfigFields fields;
  describe(fields, settings, losses);
  read_config(without_removed_keys(tree, problems), fields, problems);
  add_unused(tree, settings, problems);
  if (asks_views && problems.empty() && settings.views.empty()) problems.add(tree.origin, "/views", kNoViews);
  if (problems.empty()) {
    add_stage_faults(tree, settings.stage, problems);
    add_loss_faults(tree, settings.stage, problems);
  }
  problems.throw_if_any();
  check_groups(settings.stage, avatar_fit_groups(), file.string() + ": /stage/optimize");
  return settings;
}

std::string resolved_avatar_fit(const AvatarFitSettings& settings, const std::vector<LossDescription>& losses) {
  return with_fields(settings, losses, [](const ConfigFields& fields) { return to_json(write_config(fields)); });
}

std::string avatar_fit_schema(const std::vector<LossDescription>& losses) {
  return with_fields(AvatarFitSettings{}, losses, [](const ConfigFields& fields) {
    return to_json(config_schema(fields, "hsi4d avatar fit config"));
  });
}

std::vector<ConfigSetting> avatar_fit_settings(const std::vector<LossDescription>& losses) {
  return with_fields(AvatarFitSettings{}, losses, [](const ConfigFields& fields) { return list_settings(fields); });
}

}  // namespace hsi4d
