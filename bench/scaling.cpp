#include "bench/scaling.h"

#include <algorithm>
#include <ctime>

#include "bench/timing.h"
#include "core/check.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/input/body_files.h"
#include "pipelines/run/reconstruct_stage.h"
#include "pipelines/synthetic/chain.h"
#include "pipelines/synthetic/dataset.h"
#include "pipelines/synthetic/motion.h"
#include "pipelines/synthetic/render.h"

namespace hsi4d {

namespace {

/// A generated clip of two frames in memory: the clip without its video, its second frame, and the state before it.
struct Filmed {
  Clip clip;
  ClipFrame frame;
  SceneState start;  ///< frame 0's, with the camera of frame 1: as the camera stage would have left it
};

Filmed film(const RunConfig& config) {
  SyntheticSettings settings = config.synthetic;
  settings.frames = 2;
  settings.clips = 1;
  const BodyModel body = rest_body(config.body);
  AvatarSettings of_avatar;
  of_avatar.gaussians = settings.avatar_gaussians;
  of_avatar.seed = static_cast<std::uint64_t>(settings.seed);
  const Avatar avatar = surface_avatar(body, of_avatar);
  const SyntheticObject object = synthetic_object(settings);
  const SyntheticClip truth = synthetic_clip(body, object, clip_settings(settings));
  SceneSetup setup = setup_in({synthetic_scene(settings, truth.plan), object, avatar}, truth);

  const RenderSettings render = video_render_settings();
  const SyntheticRenderer renderer(setup.scene, object.gaussians, avatar, render);
  SyntheticFrame seen =
      renderer.frame(truth.motion.poses[1], object.exists() ? truth.object[1] : Rigid<double>(), truth.cameras[1], 1);
  Filmed filmed;
  filmed.frame = {std::move(seen.color), std::move(seen.human_mask), {}};
  if (object.exists()) filmed.frame.object_masks.push_back(std::move(seen.object_mask));
  Clip& clip = filmed.clip;
  clip.scene = std::move(setup.scene);
  clip.objects = std::move(setup.objects);
  clip.avatar = std::move(setup.avatar);
  clip.camera = truth.cameras[0];
  clip.first = {clip.camera.camera_from_world, setup.poses, truth.motion.poses[0]};
  clip.frame_rate = settings.frame_rate;
  filmed.start = clip.first;
  filmed.start.camera_from_world = truth.cameras[1].camera_from_world;
  return filmed;
}

/// Seconds that all threads of the process have computed.
double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// What the iterations of a stage told, in all rounds.
struct Told {
  std::vector<double> seconds, processor, prepare, forward, backward;
  std::vector<double> first;  ///< seconds, a round
  RenderCounters sum;
  double processor_before = 0;

  void hear(const IterationReport& report, const RenderCounters& counters) {
    const double processor_now = processor_seconds();
    if (report.iteration == 0) first.push_back(report.seconds);
    if (report.iteration >= kWarmIterations) {
      const RenderTimes& t = counters.times;
      seconds.push_back(report.seconds);
      processor.push_back(processor_now - processor_before);
      prepare.push_back(t.still_s + t.records_s + t.sort_s + t.bin_s);
      forward.push_back(t.forward_s);
      backward.push_back(t.backward_s + t.reduce_s);
      sum += counters;
      sum.channels = counters.channels;
    }
    processor_before = processor_seconds();
  }
};

double median_ms(const std::vector<double>& seconds) { return 1e3 * median_of(seconds); }

double least_ms(const std::vector<double>& seconds) { return 1e3 * *std::min_element(seconds.begin(), seconds.end()); }

ScalingCost cost_of_of_point(const std::string& name, const StageSettings& stage, const Told& told) {
  const auto mean = [&told](Index sum) { return (sum + std::ssize(told.seconds) / 2) / std::ssize(told.seconds); };
  ScalingCost cost;
  cost.stage = name;
  cost.moves_camera = find_entry(stage.optimize, "camera") != nullptr;
  cost.draws_all = stage.draw == Draw::kAll;
  cost.ms = median_ms(told.seconds);
  cost.min_ms = least_ms(told.seconds);
  cost.processor_ms = median_ms(told.processor);
  cost.first_ms = least_ms(told.first);
  cost.prepare_ms = median_ms(told.prepare);
  cost.forward_ms = median_ms(told.forward);
  cost.backward_ms = median_ms(told.backward);
  cost.channels = told.sum.channels;
  cost.tiles = mean(told.sum.tiles);
  cost.pairs = mean(told.sum.pairs);
  cost.fragments = mean(told.sum.fragments);
  cost.repeats = std::ssize(told.seconds);
  return cost;
}

/// A config with the iterations of one round, in all of which everything moves.
RunConfig config_of_round(RunConfig config, int repeats) {
  for (auto& [name, stage] : config.stages) {
    stage.iterations = kWarmIterations + (repeats + kScalingRounds - 1) / kScalingRounds;
    for (auto& [group, settings] : stage.optimize) {
      settings.from = 0;
      settings.until.reset();
    }
  }
  config.passes = {};  // each stage is measured once
  return config;
}

/// A point in the course of the rounds.
class Measured {
 public:
  Measured(const RunConfig& config, int repeats)
      : config_(config_of_round(config, repeats)), told_(config.stages.size()) {}

  void run_round(const std::vector<LossTerm>& losses) {
    with_threads(config_.threads > 0 ? config_.threads : thread_count(), [&] { run_round_here(losses); });
  }

  ScalingPoint result() const {
    ScalingPoint result = point_;
    for (std::size_t s = 0; s < told_.size(); ++s) {
      const auto& [name, stage] = config_.stages[s];
      if (!told_[s].seconds.empty()) result.stages.push_back(cost_of_of_point(name, stage, told_[s]));
    }
    return result;
  }

 private:
  void run_round_here(const std::vector<LossTerm>& losses) {
    const Filmed filmed = film(config_);
    Image covered(1, filmed.clip.camera.height, filmed.clip.camera.width);
    add_covered(filmed.frame, config_.data, covered);
    for (std::size_t s = 0; s < config_.stages.size(); ++s) {
      const StageSettings& stage = config_.stages[s].second;
      if (stage.over == StageScope::kSequence) continue;
      SceneState state = stage.draw == Draw::kAll ? filmed.start : filmed.clip.first;
      ColorState colors = first_color_state(first_nets(config_, filmed.clip));
      run_frame_stage({config_, filmed.clip, losses, s}, {1, filmed.frame, covered, {&filmed.clip.first, 1}}, state,
                      colors, [this, s](const auto& report, const auto& counters) { told_[s].hear(report, counters); });
    }
    note_size(filmed.clip);
  }

  void note_size(const Clip& clip) {
    point_.threads = thread_count();
    point_.scene_gaussians = clip.scene.count();
    point_.avatar_gaussians = clip.avatar.count();
    point_.pixels = static_cast<Index>(clip.camera.width) * clip.camera.height;
    point_.object_gaussians = 0;
    for (const ClipObject& object : clip.objects) point_.object_gaussians += object.gaussians.count();
    if (point_.peak_memory_bytes == 0) point_.peak_memory_bytes = peak_memory_bytes();
  }

  RunConfig config_;
  ScalingPoint point_;      // but for its stages
  std::vector<Told> told_;  // by config_.stages
};

bool draws_everything(const RunConfig& config) {
  return std::any_of(config.stages.begin(), config.stages.end(),
                     [](const auto& entry) { return entry.second.over != StageScope::kSequence; });
}

}  // namespace

std::vector<ScalingPoint> measure_scaling(const std::vector<RunConfig>& configs, const std::vector<LossTerm>& losses,
                                          int repeats, const std::function<void()>& measured) {
  std::vector<Measured> all;
  for (const RunConfig& config : configs) {
    if (!draws_everything(config)) throw UserError("hsi4d bench scaling: the config has no stage that draws a frame");
    all.emplace_back(config, repeats);
  }
  for (int round = 0; round < kScalingRounds; ++round) {
    for (Measured& one : all) {
      one.run_round(losses);
      if (measured) measured();
    }
  }
  std::vector<ScalingPoint> points;
  for (const Measured& one : all) points.push_back(one.result());
  return points;
}

}  // namespace hsi4d
