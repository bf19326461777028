#include "pipelines/config/run_problems.h"

#include <algorithm>
#include <array>

#include "core/check.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/config/input_problems.h"
#include "pipelines/config/parameter_groups.h"

namespace hsi4d {
namespace {

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

bool moves_all_by_pixels(const StageSettings& stage) {
  constexpr std::array<LossInput, 3> kPixels = {LossInput::kImage, LossInput::kHumanOpacity, LossInput::kObjectOpacity};
  return stage.draw == Draw::kAll && std::any_of(stage.losses.begin(), stage.losses.end(), [&](const auto& entry) {
           return std::any_of(kPixels.begin(), kPixels.end(),
                              [&](LossInput input) { return needs_input(entry.second, input); });
         });
}

}  // namespace

bool weighs_by_sigma(const StageSettings& stage) {
  return std::any_of(stage.losses.begin(), stage.losses.end(),
                     [](const auto& loss) { return needs_input(loss.second, LossInput::kSigmas); });
}

std::vector<std::size_t> stages_of_sigmas(const RunConfig& config) {
  std::vector<std::size_t> all;
  bool is_pass_told = false;  // by a stage that follows
  for (std::size_t s = config.stages.size(); s-- > 0;) {
    const StageSettings& stage = config.stages[s].second;
    if (stage.over == StageScope::kSequence) is_pass_told = false;
    if (is_pass_told || stage.over != StageScope::kFrame || !moves_all_by_pixels(stage)) continue;
    all.insert(all.begin(), s);
    is_pass_told = true;
  }
  return all;
}

namespace {

/// Settings that ask how sure places are where no stage tells it.
void add_sigma_problems(const RunConfig& config, std::vector<RunProblem>& found) {
  const std::vector<std::size_t> telling = stages_of_sigmas(config);
  const auto refuse = [&found](const std::string& setting, const char* what) {
    found.push_back({setting, std::string(what) + "; allowed: false", {setting, "/stages"}});
  };
  if (config.uncertainty && !config.stages.empty() && telling.empty())
    refuse("/uncertainty", "no stage over frames moves human and objects and compares images or masks");
  for (std::size_t s = 0; s < config.stages.size(); ++s) {
    const auto& [name, stage] = config.stages[s];
    for (const auto& [term, loss] : stage.losses) {
      if (!needs_input(loss, LossInput::kSigmas)) continue;
      const std::string setting = child_pointer(child_pointer("/stages", name) + "/losses", term) + "/by_sigma";
      if (stage.over != StageScope::kSequence) {
        refuse(setting, "a stage over the sequence alone knows how sure places are");
      } else if (telling.empty() || telling.front() > s) {
        refuse(setting, "no stage over frames before it moves human and objects and compares images or masks");
      }
    }
  }
}

}  // namespace

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
  add_given_frame_problems(config, found);
  add_sigma_problems(config, found);
  if (config.passes.count > 1 && !are_passes_idle(config) && config.stages.back().second.over != StageScope::kSequence)
    found.push_back({"/passes/count",
                     "the last stage is over frames, and would be of one pass with those that follow; allowed: 1",
                     {"/passes/count", "/stages"}});
  const std::vector<std::string> taken = stages_in_the_way(config);
  if (!taken.empty())
    found.push_back({"/passes/count",
                     "further passes need the names of the stages " + joined(taken) +
                         "; allowed: 1, or other names of these stages",
                     {"/passes/count", "/stages"}});
  add_input_problems(config, use, found);
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

void prepare_run(RunConfig& config) {
  std::vector<RunProblem> found = run_problems(config, ConfigUse::kRun);
  add(loss_faults(config), found);
  throw_if_any(found);
}

void check_inputs(const DataSettings& data) {
  std::vector<RunProblem> found;
  add_given_input_problems(data, found);
  throw_if_any(found);
}

}  // namespace hsi4d
