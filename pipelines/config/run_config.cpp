#include "pipelines/config/run_config.h"

#include <algorithm>
#include <set>

#include "core/config_file.h"
#include "core/json_text.h"
#include "core/text.h"
#include "optim/loss_term.h"
#include "pipelines/config/config_fields.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/config/removed_keys.h"
#include "pipelines/config/run_problems.h"

namespace hsi4d {
namespace {

constexpr int kMostThreads = 1024;

constexpr const char* kSourcesFolder = "generated";  // beside a config

/// Takes from section `sources` what its outputs do not depend on.
void without_places(ConfigValue& sources) {
  std::erase_if(sources.members, [](const ConfigMember& member) { return member.key == "folder"; });
  for (ConfigMember& member : sources.members) {
    const std::vector<std::string>& trying = settings_of_trying();
    std::erase_if(member.value.members, [&trying](const ConfigMember& setting) {
      return std::find(trying.begin(), trying.end(), setting.key) != trying.end();
    });
  }
}

}  // namespace

SkipSettings no_skips() {
  return {{.static_tiles = false,
           .static_layer = false,
           .zero_cotangent = false,
           .unchanged_pixels = false,
           .unseen_gaussians = false},
          {.frozen_inputs = false, .unchanged_inputs = false, .unread_pixels = false}};
}

void describe(ConfigFields& f, CameraSettings& s) {
  f.choice("increment", s.increment, kCameraIncrements,
           "Frame of a camera step: about its centre, the world, or its own axes about the point at the scene's median "
           "depth");
}

void describe(ConfigFields& f, SkipSettings& s) {
  describe(f, s.render);
  f.boolean("frozen_inputs", s.tape.frozen_inputs, "Compute no gradient of what does not move");
  f.boolean("unchanged_inputs", s.tape.unchanged_inputs, "Do not recompute what depends on nothing that has moved");
  f.boolean("unread_pixels", s.tape.unread_pixels,
            "Do not render pixels where the only loss that reads them has no weight");
}

void describe(ConfigFields& f, ApproxSettings& s) {
  f.boolean("hold_colors", s.hold_colors,
            "Harmonics keep the colours of the stage's first iteration, the color net those of its last step");
  f.integer("longest_side_px", s.longest_side_px, {.min = 0, .max = kLongestSide},
            "Larger images, frames and masks are reduced to this longest side; 0: the camera's size");
  f.number(
      "seen_within_deg", s.seen_within_deg, {.min = 0, .max = 90},
      "Leave out Gaussians that their own human or object hides from the camera and from this far around it; 0: none");
}

void describe(ConfigFields& f, RunConfig& s, const std::vector<LossDescription>& losses) {
  f.string("name", s.name, "Name of the run; its default folder is named after it");
  f.rule({"name"}, [&s] {
    return s.name.empty() || is_file_name(s.name)
               ? ""
               : json_string(s.name) + " cannot be the name of a folder; allowed: " + kFileNameText;
  });
  f.integer("seed", s.seed, {.min = 0, .max = kLargestSeed},
            "Seed of a new color net, and {seed} in commands of sources; generated datasets have synthetic.seed");
  f.integer("threads", s.threads, {.min = 0, .max = kMostThreads},
            "Threads; 0: one a core. Results do not depend on it");
  f.choice("precision", s.precision, kRunPrecisions, "Number type of the computation");
  f.choice("rotations", s.rotations, kRotationParameters,
           "How rotations are optimised: two columns of the matrix, or axis times angle");
  f.numbers("background", s.background, {.min = 0, .max = 1}, "Colour behind everything");
  f.boolean("remove_depth_bias", s.remove_depth_bias,
            "Fit frame 0 too, and move human and objects of all others by what that does to their given distance");
  f.boolean(
      "uncertainty", s.uncertainty,
      "Also tell how sure the places of joints and objects are in each frame, from the curvature of its last stage "
      "with an image");
  f.object("camera", s.camera, "How cameras are optimised");
  f.object("camera_selection", s.camera_selection,
           "How `hsi4d select-camera`, and `select_camera` of a clip of a chain, choose the camera of frame 0");
  f.object("start", s.start, "Where the stages of a frame begin");
  f.object("instance", s.instance, "The instance of a benchmark that the config is about");
  f.object("data", s.data, "The files that the run reads");
  f.object("sources", s.sources, "Programs outside that make the video, the masks and the estimated motion of `data`");
  f.list("chain", s.chain, "Clips that follow one another, each from the last state of the one before");
  f.object("body", s.body,
           "The body model of which `hsi4d synth` and `hsi4d demo` make an avatar, and whose hands `contact` draws");
  f.object("color_net", s.color_net, "How the human's colours follow its pose");
  f.object("synthetic", s.synthetic, "The dataset that `hsi4d synth` and `hsi4d demo` make");
  f.object("render", s.render, "How Gaussians become pixels", [&s](ConfigFields& inner, RenderSettings& render) {
    describe(inner, render);
    inner.or_word("blur", "estimate", s.estimate_blur);
  });
  f.object("skip", s.skip, "What is not computed because the result does not need it; for measuring what that saves");
  f.object("approx", s.approx, "What may be computed nearly, and faster");
  f.object("log", s.log, "What is noted for other programs; results do not depend on it");
  f.object("passes", s.passes, "How often the stages go through the frames");
  f.map("stages", s.stages,
        "The stages of the run by name, in the order in which they run; those over the first frame run first",
        [losses](ConfigFields& inner, StageSettings& stage) { describe(inner, stage, losses); });
}

RunConfig read_run_config(const ConfigValue& tree, const std::vector<LossDescription>& losses, ConfigProblems& problems,
                          ConfigUse use) {
  RunConfig config;
  ConfigFields fields;
  describe(fields, config, losses);
  read_config(without_removed_keys(tree, problems), fields, problems);
  // They run first wherever they are written: a file that extends another one can only append stages.
  std::stable_partition(config.stages.begin(), config.stages.end(),
                        [](const auto& entry) { return entry.second.over == StageScope::kFirst; });
  take_instance_data(config.instance, config.data);
  if (problems.empty()) lay_over_data(tree, config.chain, problems);
  add_run_problems(tree, config, use, problems);
  problems.throw_if_any();
  return config;
}

RunConfig load_run_config(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                          const std::vector<LossDescription>& losses, ConfigUse use) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, overrides, problems);
  require_kind(tree, ConfigKind::kRun, file);
  RunConfig config = read_run_config(tree, losses, problems, use);
  if (has_sources(config.sources) && config.sources.folder.empty())
    config.sources.folder = std::filesystem::absolute(file).parent_path().lexically_normal() / kSourcesFolder;
  return config;
}

std::string resolved_config(const RunConfig& config, const std::vector<LossDescription>& losses) {
  return with_fields(config, losses, [](const ConfigFields& fields) { return to_json(write_config(fields)); });
}

LossesOverMasks losses_over_masks(const RunConfig& config) {
  std::set<std::string> human, objects;
  for (const auto& [stage_name, stage] : config.stages) {
    if (stage.draw != Draw::kAll) continue;
    for (const auto& [name, loss] : stage.losses) {
      if (needs_input(loss, LossInput::kHumanOpacity)) human.insert(name);
      if (needs_input(loss, LossInput::kObjectOpacity)) objects.insert(name);
    }
  }
  return {{human.begin(), human.end()}, {objects.begin(), objects.end()}};
}

namespace {

/// Leaves of the objects of `data` the joints, of those that hang on one.
void leave_joints(ConfigValue& objects) {
  for (ConfigMember& object : objects.members)
    std::erase_if(object.value.members, [](const ConfigMember& setting) {
      return setting.key != "joint" || string_member(setting.value, "type") == kJointTypes.front().name;
    });
  std::erase_if(objects.members, [](const ConfigMember& object) { return object.value.members.empty(); });
}

/// Leaves of the section `data` what is no file.
void drop_files(ConfigValue& data) {
  for (ConfigMember& setting : data.members) {
    if (setting.key == "objects") leave_joints(setting.value);
  }
  std::erase_if(data.members, [](const ConfigMember& setting) {
    const bool has_joints = setting.key == "objects" && !setting.value.members.empty();
    return !has_joints && !setting.key.starts_with("mask_") && !setting.key.ends_with("_rate");
  });
}

}  // namespace

ConfigValue without_data(ConfigValue tree) {
  const bool selects = selects_camera(tree);
  std::erase_if(tree.members, [selects](const ConfigMember& member) {
    return member.key == "synthetic" || member.key == "instance" || member.key == "threads" || member.key == "log" ||
           (member.key == "camera_selection" && !selects) || (member.key == "chain" && member.value.items.empty());
  });
  for (ConfigMember& member : tree.members) {
    std::vector<ConfigMember>& own = member.value.members;
    if (member.key == "sources") without_places(member.value);
    if (member.key == "body") std::erase_if(own, [](const ConfigMember& setting) { return setting.key == "path"; });
    if (member.key == "data") drop_files(member.value);
    for (ConfigValue& clip : member.value.items) {
      for (ConfigMember& of_clip : clip.members) {
        if (member.key == "chain" && of_clip.key == "data") drop_files(of_clip.value);
      }
    }
  }
  return tree;
}

ConfigValue sections_beside_data(const RunConfig& config, const std::vector<LossDescription>& losses) {
  return without_data(with_fields(config, losses, write_config));
}

ConfigValue dataset_sections(const RunConfig& config, const std::vector<LossDescription>& losses) {
  ConfigValue tree = sections_beside_data(config, losses);
  std::erase_if(tree.members, [](const ConfigMember& member) { return member.key == "chain"; });
  if (config.body.path.empty()) return tree;
  for (ConfigMember& member : tree.members) {
    if (member.key == "body")
      member.value.add("path", ConfigValue::make_string(std::filesystem::absolute(config.body.path).string()));
  }
  return tree;
}

std::vector<ConfigPath> stage_files(const RunConfig& config, const std::vector<LossDescription>& losses) {
  std::vector<ConfigPath> files =
      with_fields(config, losses, [](const ConfigFields& fields) { return list_paths(fields); });
  std::erase_if(files, [](const ConfigPath& file) {
    return !file.pointer.starts_with("/stages/") || !std::filesystem::is_regular_file(file.path);
  });
  return files;
}

std::string run_config_schema(const std::vector<LossDescription>& losses) {
  return with_fields(RunConfig{}, losses,
                     [](const ConfigFields& fields) { return to_json(config_schema(fields, "hsi4d run config")); });
}

std::vector<ConfigSetting> run_config_settings(const std::vector<LossDescription>& losses) {
  return with_fields(RunConfig{}, losses, [](const ConfigFields& fields) { return list_settings(fields); });
}

}  // namespace hsi4d
