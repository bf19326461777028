#include "pipelines/run/keypoint_motion.h"

#include <algorithm>

#include "core/check.h"
#include "core/config_file.h"
#include "core/parallel.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/config/shipped_configs.h"
#include "pipelines/record/folder.h"
#include "pipelines/run/reconstruct.h"
#include "pipelines/run/run.h"
#include "pipelines/sources/record.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr const char* kShippedStages = "from_video.json";
constexpr const char* kFirstPoseStage = "fit_first_pose";
constexpr const char* kPoseStage = "pose";
constexpr const char* kBonesLoss = "bone_directions";
constexpr const char* kKeypointLoss = "keypoints_2d";
constexpr int kSide = 512;  // longest side of the images, pixels, that the weights of the stages are for

RunConfig shipped_config(const std::vector<LossDescription>& losses) {
  const std::map<std::string, std::string> texts = shipped_config_texts();
  ConfigProblems problems;
  const ConfigValue tree =
      load_config_text(texts.at(kShippedStages), kShippedStages, fs::current_path(), {}, problems, texts);
  return read_run_config(tree, losses, problems, ConfigUse::kStages);
}

/// Distances of keypoints are in pixels: in a smaller image each counts for more. Bones count where there are
/// landmarks.
void fit_losses(const Clip& clip, RunConfig& config) {
  const double share = static_cast<double>(kSide) / std::max(clip.camera.width, clip.camera.height);
  for (auto& [name, stage] : config.stages) {
    if (!clip.keypoints->has_landmarks())
      std::erase_if(stage.losses, [](const auto& loss) { return loss.first == kBonesLoss; });
    for (auto& [term, loss] : stage.losses) {
      if (term == kKeypointLoss) loss.weight *= share * share;
    }
  }
}

/// What the poses are found in is a run of its own, of which the motion is kept.
void write_motion(const RunConfig& asked, const std::vector<LossTerm>& losses, const fs::path& folder,
                  const fs::path& out, const Observer& observer) {
  RunConfig config = keypoint_motion_config(asked, descriptions_of(losses));
  prepare_run(config);
  Clip clip = read_run_clip(config, losses);
  fit_losses(clip, config);
  RunIdentity identity;
  identity.config = resolved_config(config, descriptions_of(losses));
  identity.threads = thread_count();
  RunFolder run(folder.string(), identity, false);
  reconstruct(config, clip, losses, run, observer);
  fs::rename(run.paths().motion(), out);
}

}  // namespace

RunConfig keypoint_motion_config(const RunConfig& run, const std::vector<LossDescription>& losses) {
  const RunConfig shipped = shipped_config(losses);
  const bool finds_first = finds_first_frame(run);
  RunConfig config = run;
  config.sources = {};
  config.chain = {};
  config.stages = {};
  for (const auto& [name, stage] : shipped.stages)
    if (name == kPoseStage || (name == kFirstPoseStage && finds_first)) config.stages.emplace_back(name, stage);
  HSI4D_CHECK(config.stages.size() == (finds_first ? 2 : 1),
              std::string(kShippedStages) + " lacks a stage of keypoints");
  config.start = {};
  config.start.pose = StartFrom::kPrevious;  // of the keypoints alone, whatever the initial state says of later frames
  config.start.root = shipped.start.root;
  config.color_net = {};
  config.remove_depth_bias = config.estimate_blur = false;
  config.log = {.preview = false};
  int& side = config.approx.longest_side_px;
  side = side > 0 ? std::min(side, kSide) : kSide;
  DataSettings& data = config.data;
  for (fs::path* const unused : {&data.motion, &data.tracks, &data.depth_maps, &data.depth_confidence, &data.contacts,
                                 &data.truth, &data.surface})
    unused->clear();
  data.lens.estimate_k1 = false;
  return config;
}

MotionMaker motion_maker(const std::vector<LossTerm>& losses, const Observer& observer) {
  return [&losses, &observer](const RunConfig& config, const fs::path& folder, const fs::path& out) {
    write_motion(config, losses, folder, out, observer);
  };
}

}  // namespace hsi4d
