#include "pipelines/config/run_notes.h"

#include <algorithm>

#include "core/text.h"
#include "pipelines/config/parameter_groups.h"

namespace hsi4d {
namespace {

/// Settings of a kind of optimiser that the stage does not have. They are no mistakes: a config that extends another
/// one changes the kind alone, and the rest stands there.
std::vector<RunNote> optimizer_notes(const RunConfig& config) {
  std::vector<RunNote> notes;
  for (const auto& [name, stage] : config.stages) {
    const std::vector<std::string> idle = idle_settings(stage.optimizer);
    if (!idle.empty())
      notes.push_back(
          {LogLevel::kWarning, "stages." + name + ".optimizer: " + joined(idle) + (idle.size() == 1 ? " does" : " do") +
                                   " nothing with kind " +
                                   std::string(choice_name<OptimizerKind>(kOptimizerKinds, stage.optimizer.kind))});
  }
  return notes;
}

/// What is said of objects in frame 0 counts where their masks are made here.
void add_hint_notes(const RunConfig& config, std::vector<RunNote>& notes) {
  if (config.sources.masks.is_embedded()) return;
  for (const auto& [name, object] : config.data.objects) {
    if (!has_hint(object)) continue;
    notes.push_back({LogLevel::kWarning, "data.objects." + name +
                                             ": first_mask, first_box and first_clicks do nothing unless "
                                             "sources.masks.program is \"embedded\""});
  }
}

/// Shipped configs serve clips without objects too: that is no reason to warn.
void add_object_notes(const RunConfig& config, std::vector<RunNote>& notes) {
  if (!config.data.objects.empty()) return;
  std::vector<std::string> off;
  for (const auto& [name, stage] : config.stages) {
    for (const auto& [term, settings] : stage.losses) {
      if (is_of_objects(settings) && std::find(off.begin(), off.end(), term) == off.end()) off.push_back(term);
    }
  }
  if (!off.empty())
    notes.push_back({LogLevel::kInfo, "there are no objects: losses of objects are off (" + joined(off) + ")"});
}

/// Headings that nothing tells apart.
void add_keypoint_notes(const RunConfig& config, std::vector<RunNote>& notes) {
  if (!config.data.keypoints.empty() || finds_person(config.sources, {}) || !config.chain.empty()) return;
  for (const auto& [name, stage] : config.stages) {
    const LossSettings* const loss = find_entry(stage.losses, "keypoints_2d");
    if (stage.headings > 1 && loss != nullptr && loss->weight > 0)
      notes.push_back({LogLevel::kWarning, "stages." + name +
                                               ": without data.keypoints its loss keypoints_2d is off, "
                                               "and its headings are compared by the others alone"});
  }
}

/// Objects on joints that stay where they are.
void add_joint_notes(const RunConfig& config, std::vector<RunNote>& notes) {
  const bool is_moved = std::any_of(config.stages.begin(), config.stages.end(), [](const auto& stage) {
    const ParameterGroupSettings* const group = find_entry(stage.second.optimize, kObjectJointGroup);
    return group != nullptr && group->lr > 0 && stage.second.over != StageScope::kFirst;
  });
  for (const auto& [name, object] : config.data.objects) {
    if (object.joint.type == JointType::kFree || is_moved) continue;
    notes.push_back({LogLevel::kWarning, "data.objects." + name +
                                             ": is on a joint along which it does not move: no stage moves the group " +
                                             kObjectJointGroup});
  }
}

/// Stages over the sequence that no prior holds. Shipped configs are meant so: it disturbs on a terminal.
void add_prior_notes(const RunConfig& config, std::vector<RunNote>& notes) {
  for (const auto& [name, stage] : config.stages) {
    const ParameterGroupSettings* const latents = find_entry(stage.optimize, kPoseLatents);
    const auto holds = [&stage](const char* loss) {
      const LossSettings* const found = find_entry(stage.losses, loss);
      return found != nullptr && found->weight > 0;
    };
    if (latents == nullptr || latents->lr == 0 || !stage.pose_weights.empty()) continue;
    if (holds("pose_prior") || holds("joint_limits")) continue;
    notes.push_back({LogLevel::kDebug, "stages." + name + ": without pose_weights its " + kPoseLatents +
                                           " stand for poses one to one, and no prior holds the body"});
  }
}

/// Losses without their files, and files without a loss that reads them.
void add_file_notes(const RunConfig& config, std::vector<RunNote>& notes) {
  if (!config.chain.empty()) return;
  const auto warn = [&notes](const std::string& text) { notes.push_back({LogLevel::kWarning, text}); };
  const auto look = [&](const char* loss, LossInput input, const char* key, const std::filesystem::path& file) {
    bool is_read = false;
    for (const auto& [name, stage] : config.stages) {
      for (const auto& [term, settings] : stage.losses) {
        if (!needs_input(settings, input)) continue;
        is_read = true;
        if (file.empty()) warn("stages." + name + ": without " + key + " its loss " + term + " is off");
      }
    }
    if (!file.empty() && !is_read)
      warn(std::string(key) + " does nothing: no stage has the loss " + loss + ", with a weight above 0");
  };
  look("depth_map", LossInput::kDepthMap, "data.depth_maps", config.data.depth_maps);
  look("tracks", LossInput::kTracks, "data.tracks", config.data.tracks);
  look("annotated_contact", LossInput::kContacts, "data.contacts", config.data.contacts);
}

}  // namespace

bool is_of_objects(const LossSettings& loss) {
  return !needs_input(loss, LossInput::kHumanOpacity) &&
         (needs_input(loss, LossInput::kObjectDepth) || needs_input(loss, LossInput::kObjectOpacity) ||
          needs_input(loss, LossInput::kObjectMotion));
}

std::vector<RunNote> run_notes(const RunConfig& config) {
  std::vector<RunNote> notes = optimizer_notes(config);
  add_object_notes(config, notes);
  add_keypoint_notes(config, notes);
  add_joint_notes(config, notes);
  add_prior_notes(config, notes);
  add_file_notes(config, notes);
  add_hint_notes(config, notes);
  if (config.log.images_every > 0 && !config.log.tensorboard)
    notes.push_back({LogLevel::kWarning, "log.images_every does nothing without log.tensorboard"});
  if (are_passes_idle(config))
    notes.push_back({LogLevel::kWarning, "passes.count does nothing: no stage over the sequence lies between passes"});
  const auto inform = [&notes](const char* text) { notes.push_back({LogLevel::kInfo, text}); };
  const RenderSkips& render = config.skip.render;
  if (!render.static_tiles && render.static_layer) inform("skip.static_tiles=false switches skip.static_layer off too");
  if (render.static_tiles && !config.skip.tape.frozen_inputs) {
    inform("skip.frozen_inputs=false switches skip.static_tiles and skip.static_layer off too");
  } else if (render.static_tiles && !config.skip.tape.unchanged_inputs) {
    inform("skip.unchanged_inputs=false has made anew in every iteration what skip.static_tiles keeps");
  }
  if (config.approx.hold_colors) inform("approx.hold_colors is on: colours do not follow every change of the view");
  if (config.approx.longest_side_px > 0) {
    notes.push_back({LogLevel::kInfo, "approx.longest_side_px is on: images, cameras.json and PSNR are of at most " +
                                          std::to_string(config.approx.longest_side_px) + " pixels"});
  }
  if (config.approx.seen_within_deg > 0)
    inform("approx.seen_within_deg is on: Gaussians that are behind a human's or an object's own surface are left out");
  return notes;
}

}  // namespace hsi4d
