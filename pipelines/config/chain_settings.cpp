#include "pipelines/config/chain_settings.h"

#include <algorithm>
#include <array>

namespace hsi4d {

namespace {

/// Inputs that a later clip does not take over.
constexpr std::array<const char*, 7> kOfOneClip = {"initial",          "keypoints", "tracks", "depth_maps",
                                                   "depth_confidence", "contacts",  "truth"};

ConfigValue data_of(const ConfigValue& object) {
  const ConfigValue* const data = find_member(object, "data");
  return data == nullptr ? ConfigValue::make_object() : *data;
}

/// The clip's data, laid over those of the config.
ConfigValue whole_data(const ConfigValue& shared, const ConfigValue& clip, bool is_first) {
  ConfigValue below = shared;
  std::erase_if(below.members, [is_first](const ConfigMember& member) {
    return !is_first && std::find(kOfOneClip.begin(), kOfOneClip.end(), member.key) != kOfOneClip.end();
  });
  return merged(std::move(below), data_of(clip));
}

}  // namespace

void describe(ConfigFields& f, ChainClip& s) {
  f.string("name", s.name, "Name of the clip and of its run folder").required();
  f.string("prompt", s.prompt, "What happens in its video: {prompt}; empty: sources.prompt");
  f.boolean(
      "select_camera", s.select_camera,
      "Choose its camera in its first state, as camera_selection says; size and focal lengths: data.camera, if given");
  f.object("data", s.data, "Its inputs, laid over those of the config");
}

void lay_over_data(const ConfigValue& tree, std::vector<ChainClip>& chain, ConfigProblems& problems) {
  const ConfigValue* const clips = find_member(tree, "chain");
  if (clips == nullptr) return;
  const ConfigValue shared = data_of(tree);
  for (std::size_t i = 0; i < chain.size(); ++i) {
    DataSettings data;
    ConfigFields fields;
    describe(fields, data);
    const std::string pointer = child_pointer(child_pointer("/chain", std::to_string(i)), "data");
    read_config(whole_data(shared, clips->items[i], i == 0), fields, problems, pointer);
    chain[i].data = std::move(data);
  }
}

bool selects_camera(const ConfigValue& tree) {
  const ConfigValue* const clips = find_member(tree, "chain");
  return clips != nullptr && std::any_of(clips->items.begin(), clips->items.end(), [](const ConfigValue& clip) {
           const ConfigValue* const selects = find_member(clip, "select_camera");
           return selects != nullptr && selects->boolean;
         });
}

SourceSettings sources_of(const SourceSettings& shared, const ChainClip& clip) {
  SourceSettings sources = shared;
  if (!clip.prompt.empty()) sources.prompt = clip.prompt;
  const auto leave_out = [](const std::filesystem::path& given, ProgramSettings& program) {
    if (!given.empty()) program.command.clear();
  };
  leave_out(clip.data.frames, sources.video);
  leave_out(clip.data.masks, sources.masks);
  leave_out(clip.data.keypoints, sources.person);
  leave_out(clip.data.motion, sources.motion);
  if (!clip.data.keypoints.empty()) sources.person.program = SourceProgram::kCommand;
  if (!clip.data.motion.empty()) sources.motion.program = SourceProgram::kCommand;
  return sources;
}

}  // namespace hsi4d
