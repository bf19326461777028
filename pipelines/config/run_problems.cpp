#include "pipelines/config/run_problems.h"

#include <algorithm>
#include <array>

#include "core/check.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/config/masks.h"
#include "pipelines/config/parameter_groups.h"

namespace hsi4d {
namespace {

// ---- Stages ----

void add_group_problems(const StageSettings& stage, const std::string& in, std::vector<RunProblem>& found) {
  const std::string where = in + "/optimize";
  const std::vector<std::string> unknowns = unknown_group_names(stage.draw);
  std::vector<std::string> known =
      stage.over == StageScope::kSequence ? sequence_group_names() : state_group_names(stage.draw);
  if (stage.over == StageScope::kFirst) known.insert(known.end(), unknowns.begin(), unknowns.end());
  if (stage.optimize.empty())
    found.push_back({where, "no parameter group is named; known here: " + joined(known), {where}, true});
  for (const auto& [name, group] : stage.optimize) {
    const std::string place = child_pointer(where, name), hint = did_you_mean(name, known);
    const bool is_known = std::find(known.begin(), known.end(), name) != known.end();
    if (!is_known && std::find(unknowns.begin(), unknowns.end(), name) != unknowns.end())
      found.push_back({place,
                       "is one for the whole clip, which a stage over the first frame finds; allowed: \"over\": "
                       "\"first_frame\"",
                       {in + "/over"}});
    else if (!is_known)
      found.push_back({place,
                       "there is no such parameter group" + (hint.empty() ? "; known here: " + joined(known) : hint),
                       {in + "/draw", in + "/over"}});
    if (stage.iterations > 0 && group.from >= stage.iterations)
      found.push_back({child_pointer(place, "from"),
                       std::to_string(group.from) + " is beyond the stage's " + std::to_string(stage.iterations) +
                           " iterations; the group would never move",
                       {in + "/iterations"}});
  }
}

void add_loss_problems(const StageSettings& stage, const std::string& in, std::vector<RunProblem>& found) {
  const std::string where = in + "/losses";
  if (stage.losses.empty()) {
    found.push_back({where, "a stage needs a loss", {where}, true});
    return;
  }
  const bool is_of_sequence = stage.over == StageScope::kSequence;
  if (is_of_sequence || stage.draw == Draw::kScene) {
    const std::span<const LossInput> has = is_of_sequence ? std::span<const LossInput>(kMotionInputs) : kImageInputs;
    const std::string having =
        is_of_sequence ? "a stage with \"over\": \"sequence\"" : "a stage with \"draw\": \"scene\"";
    for (LossFault& fault : losses_without_inputs(stage, has, having))
      found.push_back({in + fault.pointer, std::move(fault.text), {in + "/draw", in + "/over"}});
  }
  std::vector<std::string> names;
  for (const auto& [name, loss] : stage.losses) {
    if (loss.weight != 0) return;
    names.push_back(name);
  }
  found.push_back({where,
                   joined(names) + (names.size() == 1 ? " has" : " have") +
                       " weight 0, which switches a loss off; a stage needs one that is on",
                   {where}});
}

std::string scope_in_words(StageScope scope) {
  if (scope == StageScope::kFirst) return "over the first frame";
  return scope == StageScope::kFrame ? "over frames" : "over the sequence";
}

/// Stages over the first frame, then those over each of the others, then those over the sequence, which others over
/// frames may follow: each begins where those before ended.
void add_order_problems(const ConfigMap<StageSettings>& stages, std::vector<RunProblem>& found) {
  const auto place = [](const std::string& name) { return child_pointer(child_pointer("/stages", name), "over"); };
  const auto is_of_frames = [](const auto& entry) { return entry.second.over == StageScope::kFrame; };
  const bool has_frames = std::any_of(stages.begin(), stages.end(), is_of_frames);
  const std::pair<std::string, StageSettings>* latest = nullptr;  // of those so far
  for (const auto& entry : stages) {
    const auto& [name, stage] = entry;
    const bool goes_again =
        latest != nullptr && stage.over == StageScope::kFrame && latest->second.over == StageScope::kSequence;
    if (latest != nullptr && stage.over < latest->second.over && !goes_again) {
      found.push_back({place(name),
                       "a stage " + scope_in_words(stage.over) + " cannot come after " + json_string(latest->first) +
                           ", which is " + scope_in_words(latest->second.over),
                       {place(name), place(latest->first)}});
      continue;
    }
    const bool is_first = latest == nullptr || (has_frames && latest->second.over == StageScope::kFirst);
    if (is_first && stage.over == StageScope::kSequence)
      found.push_back({place(name), "a stage over the sequence needs one over frames before it", {place(name)}});
    latest = &entry;
  }
  if (!has_frames && !stages.empty() && stages.front().second.over == StageScope::kFirst)
    found.push_back({place(stages.front().first),
                     "a stage over the first frame needs one over frames after it",
                     {place(stages.front().first)}});
}

/// The best start is chosen by images of everything, before the first stage that draws it, in the first pass.
void add_start_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  const auto is_of_frames = [](const auto& entry) { return entry.second.over == StageScope::kFrame; };
  const auto chooses = [](const auto& entry) {
    return entry.second.over == StageScope::kFrame && entry.second.draw == Draw::kAll;
  };
  const auto end = std::find_if(config.stages.begin(), config.stages.end(),
                                [](const auto& entry) { return entry.second.over == StageScope::kSequence; });
  if (std::none_of(config.stages.begin(), end, is_of_frames)) return;
  if (std::any_of(config.stages.begin(), end, chooses)) return;
  for (const auto& [key, from] :
       {std::pair{"pose", config.start.pose}, {"root", config.start.root}, {"objects", config.start.objects}}) {
    if (from == StartFrom::kBest)
      found.push_back({std::string("/start/") + key,
                       "\"best\" is never chosen: it compares images of everything, and every stage over frames has "
                       "\"draw\": \"scene\"",
                       {"/start", "/stages"}});
  }
}

std::vector<RunProblem> loss_faults(RunConfig& config) {
  std::vector<RunProblem> found;
  for (auto& [name, stage] : config.stages) {
    const std::string where = child_pointer("/stages", name);
    for (LossFault& fault : prepare_losses(stage)) {
      const std::string place = where + fault.pointer;
      found.push_back({place, std::move(fault.text), {place}});
    }
  }
  return found;
}

// ---- Inputs ----

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
};

/// @param in  the section, "/data"
void add_input_problems(const DataSettings& data, const std::string& in, const KnownInputs& known,
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
    found.push_back({in,
                     "no inputs are given; a run needs " + joined(keys) +
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

// ---- Chains ----

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
    if (use == ConfigUse::kRun) add_input_problems(clip.data, where + "/data", known_inputs(sources, clip, i), found);
  }
}

// ---- Optimisers ----

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

/// Whether `problem` may be one only because of another, at the pointer `other`.
bool may_follow(const RunProblem& problem, const std::string& other) {
  for (const std::string& need : problem.needs) {
    if (other == need || other.starts_with(need + "/")) return true;
  }
  const std::size_t slash = problem.pointer.rfind('/') + 1;
  return problem.is_absence && other.starts_with(problem.pointer.substr(0, slash)) &&
         !nearest_name(other.substr(slash), {problem.pointer.substr(slash)}).empty();
}

void add(std::vector<RunProblem> more, std::vector<RunProblem>& found) {
  for (RunProblem& problem : more) found.push_back(std::move(problem));
}

void throw_if_any(const std::vector<RunProblem>& found) {
  if (found.empty()) return;
  std::string text;
  for (const RunProblem& problem : found) text += (text.empty() ? "" : "\n") + problem.pointer + ": " + problem.text;
  throw UserError(text);
}

/// What is found of a clip holds for that clip, and for what moves with its scene.
void add_unknown_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  for (const auto& [name, stage] : config.stages) {
    for (const std::string& group : unknown_groups_of(stage)) {
      const std::string place = child_pointer(child_pointer("/stages", name) + "/optimize", group);
      if (!config.chain.empty())
        found.push_back({place,
                         "the clips of a chain share what this group finds; find it in a run of the first clip, and "
                         "give it in `data`",
                         {place, "/chain"}});
      if ((group == kSceneScaleGroup || group == kSceneHeightGroup) && !config.data.surface.empty())
        found.push_back({place,
                         "the mesh of /data/surface does not move with the scene; leave one of the two out",
                         {place, "/data/surface"}});
      const bool moves_places = group == kSceneScaleGroup || group == kSceneHeightGroup || group == kObjectScaleGroup;
      if (moves_places && !config.data.contacts.empty())
        found.push_back({place,
                         "places of /data/contacts do not follow what this group finds; find it in a run without them",
                         {place, "/data/contacts"}});
      for (const auto& [object, settings] : config.data.objects) {
        if (!moves_places || settings.joint.type == JointType::kFree) continue;
        const std::string joint = child_pointer("/data/objects", object) + "/joint";
        found.push_back({place,
                         "the axis of " + joint + " does not follow what this group finds; find it in a run without",
                         {place, joint}});
      }
    }
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

/// What compares with frame 0 as it is given.
void add_given_frame_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  for (const auto& [name, stage] : config.stages) {
    if (stage.over != StageScope::kFirst) continue;
    const std::string given =
        " frame 0 as it is given, which stage " + json_string(name) + " has yet to find; allowed: ";
    if (config.estimate_blur)
      found.push_back({"/render/blur", "\"estimate\" looks at" + given + "a number", {"/render/blur", "/stages"}});
    if (config.data.lens.estimate_k1)
      found.push_back({"/data/lens/k1", "\"estimate\" looks at" + given + "a number", {"/data/lens/k1", "/stages"}});
    const std::size_t unknowns = unknown_groups_of(stage).size();
    if (config.remove_depth_bias && stage.optimize.size() > unknowns) {
      found.push_back(
          {"/remove_depth_bias", "the bias is that of" + given + "false", {"/remove_depth_bias", "/stages"}});
      return;
    }
  }
}

}  // namespace

std::optional<std::size_t> stage_of_sigmas(const RunConfig& config) {
  constexpr std::array<LossInput, 3> kPixels = {LossInput::kImage, LossInput::kHumanOpacity, LossInput::kObjectOpacity};
  for (std::size_t s = config.stages.size(); s-- > 0;) {
    const StageSettings& stage = config.stages[s].second;
    if (stage.over != StageScope::kFrame || stage.draw != Draw::kAll) continue;
    for (const auto& [name, loss] : stage.losses) {
      if (std::any_of(kPixels.begin(), kPixels.end(), [&](LossInput input) { return needs_input(loss, input); }))
        return s;
    }
  }
  return std::nullopt;
}

std::vector<RunProblem> run_problems(const RunConfig& config, ConfigUse use) {
  std::vector<RunProblem> found;
  if (use == ConfigUse::kSettings) return found;
  if (use == ConfigUse::kRun && config.stages.empty())
    found.push_back({"/stages", "a run needs at least one stage", {"/stages"}, true});
  for (const auto& [name, stage] : config.stages) {
    const std::string where = child_pointer("/stages", name);
    add_group_problems(stage, where, found);
    add_loss_problems(stage, where, found);
  }
  add_order_problems(config.stages, found);
  add_start_problems(config, found);
  add_unknown_problems(config, found);
  add_joint_problems(config, found);
  add_lens_problems(config.data, found);
  add_people_problems(config, found);
  add_given_frame_problems(config, found);
  if (config.uncertainty && !config.stages.empty() && !stage_of_sigmas(config))
    found.push_back({"/uncertainty",
                     "no stage over frames moves human and objects and compares images or masks; allowed: false",
                     {"/uncertainty", "/stages"}});
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
    return found;
  }
  add_name_problems(config.data, "/data", found);
  add_source_problems(config, found);
  if (use == ConfigUse::kRun) {
    const SourceSettings& sources = config.sources;
    add_input_problems(config.data, "/data",
                       {.video = !sources.video.command.empty(), .masks = knows_masks(sources, config.data)}, found);
  }
  return found;
}

void add_run_problems(const ConfigValue& tree, RunConfig& config, ConfigUse use, ConfigProblems& problems) {
  std::vector<RunProblem> found = run_problems(config, use);
  if (use != ConfigUse::kSettings) add(loss_faults(config), found);
  const std::vector<std::string> before = problems.pointers();
  std::erase_if(found, [&before](const RunProblem& problem) {
    return std::any_of(before.begin(), before.end(),
                       [&problem](const std::string& other) { return may_follow(problem, other); });
  });
  for (const RunProblem& problem : found) problems.add(origin_at(tree, problem.pointer), problem.pointer, problem.text);
}

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

void prepare_run(RunConfig& config) {
  std::vector<RunProblem> found = run_problems(config, ConfigUse::kRun);
  add(loss_faults(config), found);
  throw_if_any(found);
}

void check_inputs(const DataSettings& data) {
  std::vector<RunProblem> found;
  add_name_problems(data, "/data", found);
  add_input_problems(data, "/data", {}, found);
  throw_if_any(found);
}

}  // namespace hsi4d
