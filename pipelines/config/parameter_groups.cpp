#include "pipelines/config/parameter_groups.h"

#include "core/check.h"

namespace hsi4d {
namespace {

constexpr std::array<const char*, 5> kGaussianClasses = {"means", "quats", "log_scales", "opacity_logits", "sh"};

}  // namespace

std::vector<std::string> state_group_names(Draw draw) {
  std::vector<std::string> names = {"camera"};
  if (draw == Draw::kScene) return names;
  names.insert(names.end(),
               {kObjectOrientGroup, kObjectTranslGroup, kObjectJointGroup, kObjectLightGroup, kTranslGroup});
  for (const JointGroup& joints : kJointGroups) names.emplace_back(joints.name);
  names.insert(names.end(), {kColorNetGroup, kFeaturesGroup});
  return names;
}

std::vector<std::string> unknown_group_names(Draw draw) {
  if (draw == Draw::kScene) return {kFocalGroup};
  return {kFocalGroup, kObjectScaleGroup, kSceneScaleGroup, kSceneHeightGroup, kBetasGroup};
}

std::vector<std::string> unknown_groups_of(const StageSettings& stage) {
  std::vector<std::string> names;
  for (const std::string& name : unknown_group_names(stage.draw)) {
    if (find_entry(stage.optimize, name) != nullptr) names.push_back(name);
  }
  return names;
}

std::string state_group_summary(const std::string& name) {
  if (name == "camera") return "Six numbers of the camera, translation and rotation";
  if (name == kObjectOrientGroup) return "Rotations of the objects that move freely";
  if (name == kObjectTranslGroup) return "Places of the objects that move freely";
  if (name == kObjectJointGroup) return "How far objects have turned or slid on their joints";
  if (name == kObjectLightGroup) return "Brightness of the objects: by channel, and by the direction of their surface";
  if (name == "transl") return "Place of the body";
  if (name == kColorNetGroup) return "Weights of the network that colours the human, which all frames share";
  if (name == kFeaturesGroup) return "That network's features of each Gaussian, which all frames share";
  if (name == kFocalGroup) return "Logarithm of the factor of the focal length";
  if (name == kObjectScaleGroup) return "Logarithms of the factors of the objects' sizes";
  if (name == kSceneScaleGroup)
    return "Logarithm of the factor of the scene, with its camera, about the world's origin";
  if (name == kSceneHeightGroup) return "Metres by which the scene, with its camera, rises";
  if (name == kBetasGroup) return "What is added to the betas of the avatar's body, `body`";
  for (const JointGroup& joints : kJointGroups) {
    if (name == joints.name) return joints.summary;
  }
  throw InternalError("there is no group of the state called '" + name + "'");
}

std::vector<std::string> parameter_group_names(Draw draw) {
  std::vector<std::string> names = state_group_names(draw);
  names.emplace_back("background");
  const auto add_classes = [&names](const std::string& part) {
    for (const char* name : kGaussianClasses) names.push_back(part + "_" + name);
  };
  add_classes("scene");
  if (draw == Draw::kScene) return names;
  add_classes("object");
  add_classes("human");
  names.back() = "human_colors";
  return names;
}

std::vector<std::string> sequence_group_names() { return {kTranslGroup, kOrientGroup, kPoseLatents}; }

std::string sequence_group_summary(const std::string& name) {
  if (name == kTranslGroup) return "Places of the body in all frames but the first";
  if (name == kOrientGroup) return "Headings of the body in these frames";
  if (name == kPoseLatents) return "Latents of the pose prior, which stand for the body's joints in these frames";
  throw InternalError("there is no group of the sequence called '" + name + "'");
}

}  // namespace hsi4d
