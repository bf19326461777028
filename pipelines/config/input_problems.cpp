#include "pipelines/config/input_problems.h"

#include <algorithm>
#include <array>

#include "core/text.h"
#include "pipelines/config/masks.h"
#include "pipelines/config/parameter_groups.h"

namespace hsi4d {
namespace {

/// @param in  the section, "/data"
void add_name_problems(const DataSettings& data, const std::string& in, std::vector<RunProblem>& found) {
  for (const auto& [name, object] : data.objects) {
    if (name.empty())
      found.push_back({in + "/objects", "an object's name is empty; it names the folder of its masks", {}});
    if (name == kHumanMasks)
      found.push_back({child_pointer(in + "/objects", name),
                       json_string(name) + " is the folder of the human's masks; use another name",
                       {}});
  }
}

/// People beside the first one are named as folders of masks and files of results are.
void add_people_name_problems(const DataSettings& data, std::vector<RunProblem>& found) {
  for (const auto& [name, person] : data.people) {
    const std::string place = child_pointer("/data/people", name);
    if (name == kHumanMasks)
      found.push_back({place, json_string(name) + " is the first person, whom /data names; use another name", {}});
    if (find_entry(data.objects, name) != nullptr)
      found.push_back({place, json_string(name) + " is the name of an object too, whose masks have that folder", {}});
  }
}

/// What knows of one person alone.
void add_people_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  const std::string people = "/data/people";
  for (std::size_t i = 0; i < config.chain.size(); ++i) {
    const std::string of_clip = "/chain/" + std::to_string(i) + people;
    if (!config.chain[i].data.people.empty())
      found.push_back({of_clip, "a chain knows one person; run its clips one by one", {of_clip, people, "/chain"}});
  }
  if (config.data.people.empty()) return;
  const auto refuse = [&](const std::string& place, const std::string& text) {
    found.push_back({place, "/data/people names more people, and this " + text, {place, people}});
  };
  add_people_name_problems(config.data, found);
  if (config.uncertainty) refuse("/uncertainty", "is told of one person; allowed: false");
  if (!config.data.tracks.empty()) refuse("/data/tracks", "follows points of one person; leave it out");
  if (has_sources(config.sources)) refuse("/sources", "knows one person; give what its programs would make in /data");
  for (const auto& [name, stage] : config.stages) {
    const std::string place = child_pointer("/stages", name);
    if (find_entry(stage.optimize, kBetasGroup) != nullptr)
      refuse(child_pointer(place + "/optimize", kBetasGroup), "is of one person; leave the group out");
    if (stage.headings > 1) refuse(place + "/headings", "is tried of one person; allowed: 1");
  }
}

/// Of the run, or of all clips of a chain, which may have one list of joints in common.
void add_keypoint_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  const auto has_keypoints = [](const ChainClip& clip) { return !clip.data.keypoints.empty(); };
  const auto has_other = [](const auto& person) { return !person.second.keypoints.empty(); };
  if (config.data.keypoint_joints.empty() || !config.data.keypoints.empty() || finds_person(config.sources, {}) ||
      std::any_of(config.data.people.begin(), config.data.people.end(), has_other) ||
      std::any_of(config.chain.begin(), config.chain.end(), has_keypoints))
    return;
  found.push_back({"/data/keypoint_joints", "given without /data/keypoints, whose points it tells of", {"/data"}});
}

/// A program of `sources`, and the input that it makes.
struct Maker {
  const char* name;
  const std::vector<std::string>& command;
  const std::vector<std::string>& placeholders;
  std::filesystem::path DataSettings::*input;
  const char* key;

  std::string section() const { return std::string("/sources/") + name; }
};

std::array<Maker, 4> makers_in(const SourceSettings& sources) {
  return {Maker{"video", sources.video.command, video_placeholders(), &DataSettings::frames, "frames"},
          Maker{"person", sources.person.command, person_placeholders(), &DataSettings::keypoints, "keypoints"},
          Maker{"masks", sources.masks.command, mask_placeholders(), &DataSettings::masks, "masks"},
          Maker{"motion", sources.motion.command, motion_placeholders(), &DataSettings::motion, "motion"}};
}

void add_command_problems(const SourceSettings& sources, std::vector<RunProblem>& found) {
  for (const Maker& maker : makers_in(sources)) {
    for (CommandFault& fault : command_faults(maker.command, maker.placeholders))
      found.push_back({maker.section() + fault.pointer, std::move(fault.text), {maker.section() + "/command"}});
  }
  const auto add_double = [&found](const OwnSourceSettings& source, const std::string& name) {
    const std::string section = "/sources/" + name;
    if (source.is_embedded() && !source.command.empty())
      found.push_back({section + "/command",
                       "given, and " + section + "/program is \"embedded\", which does the same; remove one",
                       {section}});
  };
  add_double(sources.person, "person");
  add_double(sources.masks, "masks");
  add_double(sources.motion, "motion");
}

/// Nobody finds the person.
void add_front_end_problem(const SourceSettings& sources, std::vector<RunProblem>& found) {
  if (!person_command(sources).empty()) return;
  std::vector<std::string> places;
  for (const std::filesystem::path& file : front_end_places()) places.push_back(file.string());
  found.push_back({sources.person.is_embedded() ? "/sources/person/program" : "/sources/motion/program",
                   "\"embedded\" without data.keypoints needs tools/frontend, which finds the person, and it is not "
                   "there: " +
                       joined(places) +
                       ". Name it: \"person\": {\"command\": [\"PATH/tools/frontend\", \"{video}\", \"--out\", "
                       "\"{out}\"]}",
                   {"/sources"}});
}

/// @param pointer  of the prompt
void add_prompt_problems(const SourceSettings& sources, const std::string& pointer, std::vector<RunProblem>& found) {
  if (!sources.prompt.empty()) return;
  for (const Maker& maker : makers_in(sources)) {
    if (uses_placeholder(maker.command, "prompt"))
      found.push_back({pointer, "not given; " + maker.section() + "/command has {prompt}", {"/sources"}, true});
  }
}

/// What is wrong with the programs that make video, masks and motion.
void add_source_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  add_command_problems(config.sources, found);
  for (const Maker& maker : makers_in(config.sources)) {
    const std::string key = std::string("/data/") + maker.key;
    if (!maker.command.empty() && !(config.data.*maker.input).empty())
      found.push_back({key, "given, and " + maker.section() + " makes it too; remove one", {key, maker.section()}});
  }
  add_prompt_problems(config.sources, "/sources/prompt", found);
  if (config.sources.motion.is_embedded() && !config.data.motion.empty())
    found.push_back(
        {"/data/motion", "given, and /sources/motion makes it too; remove one", {"/data/motion", "/sources/motion"}});
  if (config.sources.person.is_embedded() && !config.data.keypoints.empty())
    found.push_back({"/data/keypoints",
                     "given, and /sources/person makes it too; remove one",
                     {"/data/keypoints", "/sources/person"}});
  if (finds_person(config.sources, config.data.keypoints)) add_front_end_problem(config.sources, found);
  if (config.sources.masks.is_embedded() && config.data.objects.empty() && !config.data.masks.empty())
    found.push_back({"/sources/masks/program",
                     "\"embedded\" makes nothing: data.masks has the human's masks, and there are no objects",
                     {"/sources/masks/program", "/data/objects", "/data/masks"}});
}

/// What of the inputs need not be given.
struct KnownInputs {
  bool video = false, masks = false;  ///< a program outside makes them
  bool camera = false;                ///< it is chosen
  bool state = false;                 ///< frame 0 is that in which another clip ended
  std::filesystem::path folder = {};  ///< of an instance, where it is none; empty: there is one
};

/// @param in  the section, "/data"
void add_missing_problems(const DataSettings& data, const std::string& in, const KnownInputs& known,
                          std::vector<RunProblem>& found) {
  struct Input {
    const std::filesystem::path& path;
    const char* key;
    const char* what;
    bool is_known = false;
  };
  const std::array inputs = {Input{data.scene, "scene", "a scene"},
                             Input{data.avatar, "avatar", "an avatar"},
                             Input{data.frames, "frames", "the frames of a video", known.video},
                             Input{data.masks, "masks", "masks of the human and the objects", known.masks},
                             Input{data.camera, "camera", "the camera of frame 0", known.camera},
                             Input{data.initial, "initial", "the state of frame 0", known.state}};
  const auto is_missing = [](const Input& input) { return input.path.empty() && !input.is_known; };
  if (std::all_of(inputs.begin(), inputs.end(), is_missing)) {
    std::vector<std::string> keys;
    for (const Input& input : inputs) keys.emplace_back(input.key);
    const std::string looked =
        known.folder.empty() ? "" : ", and /instance/folder is no folder (" + known.folder.string() + ")";
    found.push_back({in,
                     "no inputs are given" + looked + "; a run needs " + joined(keys) +
                         ". `hsi4d synth` makes a dataset with a config beside it to run; `hsi4d demo` makes one and "
                         "runs it",
                     {in},
                     true});
    return;
  }
  for (const Input& input : inputs) {
    const std::string place = in + "/" + input.key;
    if (is_missing(input)) found.push_back({place, std::string("not given; a run needs ") + input.what, {place}, true});
  }
}

bool is_folder_name(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

std::string object_names(const DataSettings& data) {
  std::vector<std::string> names;
  for (const auto& [name, object] : data.objects) names.push_back(name);
  return names.empty() ? "none" : joined(names);
}

/// Whether masks need not be given: a program makes them, or finds the human where there is nothing else.
bool knows_masks(const SourceSettings& sources, const DataSettings& data) {
  return makes_masks(sources) || (data.objects.empty() && finds_person(sources, data.keypoints));
}

KnownInputs known_inputs(const SourceSettings& sources, const ChainClip& clip, std::size_t index) {
  return {.video = !sources.video.command.empty(),
          .masks = knows_masks(sources, clip.data),
          .camera = clip.select_camera,
          .state = index > 0};
}

/// A program whose output every clip names makes nothing.
void add_idle_source_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  for (const Maker& maker : makers_in(config.sources)) {
    const auto names_it = [&maker](const ChainClip& clip) { return !(clip.data.*maker.input).empty(); };
    if (!maker.command.empty() && std::all_of(config.chain.begin(), config.chain.end(), names_it))
      found.push_back({maker.section(),
                       "makes nothing: every clip of the chain has data/" + std::string(maker.key) + "; remove one",
                       {maker.section(), "/chain", "/data"}});
  }
}

/// What is wrong with how a clip comes to its video.
void add_made_clip_problems(const SourceSettings& sources, const ChainClip& clip, const std::string& in,
                            std::vector<RunProblem>& found) {
  add_prompt_problems(sources, in + "/prompt", found);
  if (clip.select_camera && sources.video.command.empty())
    found.push_back({in + "/select_camera",
                     "the clip's video is given, and was filmed by a camera of its own; a camera is chosen for a video "
                     "that /sources/video makes",
                     {in, "/sources"}});
}

/// A clip begins where the one before ended, which its video's program must see.
void add_first_frame_problem(const SourceSettings& sources, std::vector<RunProblem>& found) {
  const std::string place = "/sources/video/command";
  if (!sources.video.command.empty() && !uses_placeholder(sources.video.command, "first_frame"))
    found.push_back({place, "{first_frame} is missing: clips of a chain begin where the ones before ended", {place}});
}

void add_chain_problems(const RunConfig& config, ConfigUse use, std::vector<RunProblem>& found) {
  const std::vector<ChainClip>& chain = config.chain;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const ChainClip& clip = chain[i];
    const std::string where = child_pointer("/chain", std::to_string(i));
    if (!is_folder_name(clip.name))
      found.push_back(
          {where + "/name", json_string(clip.name) + " is no name of a folder; allowed: letters, digits, _ and -", {}});
    for (std::size_t k = 0; k < i; ++k) {
      if (chain[k].name == clip.name)
        found.push_back({where + "/name", json_string(clip.name) + " is the name of another clip too", {}});
    }
    if (object_names(clip.data) != object_names(chain.front().data))
      found.push_back({where + "/data/objects",
                       "the clip has the objects " + object_names(clip.data) + ", the first one " +
                           object_names(chain.front().data) + "; the clips of a chain have the same, in one order",
                       {}});
    add_name_problems(clip.data, where + "/data", found);
    const SourceSettings sources = sources_of(config.sources, clip);
    add_made_clip_problems(sources, clip, where, found);
    if (use == ConfigUse::kRun) add_missing_problems(clip.data, where + "/data", known_inputs(sources, clip, i), found);
  }
}

/// A joint counts from frame 0 of its clip.
void add_joint_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  if (config.chain.empty()) return;
  const auto look = [&found](const DataSettings& data, const std::string& pointer) {
    for (const auto& [name, object] : data.objects) {
      if (object.joint.type == JointType::kFree) continue;
      const std::string place = child_pointer(pointer + "/objects", name) + "/joint";
      found.push_back(
          {place, "objects of a chain move freely; leave the joint out, or run its clips alone", {place, "/chain"}});
    }
  };
  look(config.data, "/data");
  for (std::size_t i = 0; i < config.chain.size(); ++i)
    look(config.chain[i].data, "/chain/" + std::to_string(i) + "/data");
}

/// What is given in pictures that the lens has bent.
void add_lens_problems(const DataSettings& data, std::vector<RunProblem>& found) {
  if (data.lens.lens.is_straight() && !data.lens.estimate_k1) return;
  for (const auto& [key, path] : {std::pair{"/data/depth_maps", data.depth_maps}, {"/data/tracks", data.tracks}}) {
    if (!path.empty())
      found.push_back({key,
                       "is not straightened with a lens that bends (/data/lens); give frames and these straightened",
                       {key, "/data/lens"}});
  }
}

}  // namespace

void add_input_problems(const RunConfig& config, ConfigUse use, std::vector<RunProblem>& found) {
  add_joint_problems(config, found);
  add_lens_problems(config.data, found);
  add_people_problems(config, found);
  add_keypoint_problems(config, found);
  if (!config.chain.empty()) {
    add_command_problems(config.sources, found);
    add_first_frame_problem(config.sources, found);
    add_idle_source_problems(config, found);
    if (std::any_of(config.chain.begin(), config.chain.end(), [&config](const ChainClip& clip) {
          return finds_person(sources_of(config.sources, clip), clip.data.keypoints);
        }))
      add_front_end_problem(config.sources, found);
    add_chain_problems(config, use, found);
    return;
  }
  add_name_problems(config.data, "/data", found);
  add_source_problems(config, found);
  if (use == ConfigUse::kRun) {
    const SourceSettings& sources = config.sources;
    add_missing_problems(config.data, "/data",
                         {.video = !sources.video.command.empty(),
                          .masks = knows_masks(sources, config.data),
                          .folder = has_data(config.instance) ? "" : config.instance.folder},
                         found);
  }
}

void add_given_input_problems(const DataSettings& data, std::vector<RunProblem>& found) {
  add_name_problems(data, "/data", found);
  add_missing_problems(data, "/data", {}, found);
}

}  // namespace hsi4d
