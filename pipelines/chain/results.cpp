#include "pipelines/chain/results.h"

#include <optional>
#include <span>

#include "body/kinematics.h"
#include "body/motion_edit.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "core/video.h"
#include "optim/metrics.h"
#include "pipelines/input/body_files.h"
#include "pipelines/metrics/sequence_errors.h"
#include "pipelines/record/results.h"
#include "pipelines/run/summarize.h"

namespace hsi4d {

namespace {

/// All frames of the chain: of later clips without frame 0. Nothing where a clip has none.
template <class T, class Get>
std::vector<T> joined(const std::vector<ClipResult>& clips, const Get& get) {
  std::vector<T> all;
  for (const ClipResult& clip : clips) {
    const std::vector<T>& own = get(clip);
    if (own.empty()) return {};
    all.insert(all.end(), own.begin() + (all.empty() ? 0 : 1), own.end());
  }
  return all;
}

Motion joined_motion(const ChainResult& result) {
  Motion motion = result.clips.front().motion;
  motion.poses = joined<BodyPose>(
      result.clips, [](const ClipResult& clip) -> auto& { return clip.motion.poses; });
  return motion;
}

/// Errors of body and objects; the camera of each clip is its own.
MetricValues errors_without_camera(const Avatar& avatar, const SceneState& state, const SceneState& other) {
  MetricValues errors = frame_errors(placed(avatar, state), placed(avatar, other));
  std::erase_if(errors, [](const auto& value) { return value.first.starts_with("camera_"); });
  return errors;
}

/// How far a clip begins from where the one before ended.
MetricValues jump_between(const Avatar& avatar, const SceneState& before, const SceneState& after) {
  const MetricValues differences = errors_without_camera(avatar, after, before);
  MetricValues jump;
  for (const auto& [name, as] : {std::pair{"world_mpjpe_mm", "jump_mm"},
                                 {"object_translation_cm", "jump_object_cm"},
                                 {"object_rotation_deg", "jump_object_deg"}}) {
    if (const double* const value = find_metric(differences, name)) jump.emplace_back(as, *value);
  }
  return jump;
}

std::vector<JoinSummary> joins_of(const ChainResult& result) {
  std::vector<JoinSummary> joins;
  int frame = 0;
  for (std::size_t i = 1; i < result.clips.size(); ++i) {
    const ClipFacts& facts = result.facts[i];
    const SceneState &before = result.clips[i - 1].states.back(), &after = result.clips[i].states.front();
    frame += static_cast<int>(result.clips[i - 1].states.size()) - 1;
    JoinSummary join{result.facts[i - 1].name, facts.name, frame, jump_between(facts.avatar, before, after)};
    if (facts.true_first) {
      const MetricValues drift = errors_without_camera(facts.avatar, after, *facts.true_first);
      join.values.insert(join.values.end(), drift.begin(), drift.end());
    }
    joins.push_back(std::move(join));
  }
  return joins;
}

/// Jitter is of the whole motion, as if it were of one clip.
void set_jitter(const Avatar& avatar, const Motion& motion, MetricValues& values) {
  std::vector<std::vector<double>> joints;
  for (const BodyPose& pose : motion.poses) joints.push_back(pose_joints(avatar, pose));
  const std::optional<double> trembling =
      jitter(std::vector<std::span<const double>>(joints.begin(), joints.end()), motion.frame_rate);
  for (auto& [name, value] : values) {
    if (name == "jitter" && trembling) value = *trembling;
  }
}

ChainSummary summary_of(const RunConfig& config, const ChainResult& result, const Motion& motion) {
  ChainSummary summary;
  int begin = 0;
  for (std::size_t i = 0; i < result.clips.size(); ++i) {
    summary.clips.push_back({result.facts[i].name, begin, result.clips[i].summary});
    begin += static_cast<int>(result.clips[i].states.size()) - 1;
  }
  summary.all = joined_summary(config.name, summary.clips);
  set_jitter(result.facts.front().avatar, motion, summary.all.metrics.back().values);
  summary.all.quality = quality_of(summary.all.metrics.back().values, motion.frame_rate);
  summary.joins = joins_of(result);
  return summary;
}

/// The clips' previews one after the other. They are of one size where the clips' images are.
void join_previews(const RunPaths& paths, const ChainResult& result, double frame_rate) {
  const ChainPaths clips{paths.folder};
  try {
    std::optional<VideoWriter> video;
    for (const ClipFacts& clip : result.facts) {
      VideoReader preview(RunPaths{clips.clip(clip.name)}.preview());
      for (Index t = video ? 1 : 0; t < preview.frames(); ++t) {
        const Image frame = preview.read(t);
        if (!video)
          video.emplace(paths.preview(), frame.width(), frame.height(), VideoFormat{.frame_rate = frame_rate});
        video->add(frame);
      }
    }
    video->commit();
  } catch (const DataError& error) {
    log_warning("preview.mp4 is not written: " + std::string(error.what()));
  } catch (const UserError& error) {
    log_warning("preview.mp4 is not written: " + std::string(error.what()));
  }
}

bool have_one_size(const std::vector<ClipResult>& clips) {
  const Camera& first = clips.front().cameras.front();
  for (const ClipResult& clip : clips) {
    if (clip.cameras.front().width != first.width || clip.cameras.front().height != first.height) return false;
  }
  return true;
}

}  // namespace

ClipResult read_clip_result(const std::string& clip, const std::string& folder,
                            const std::vector<std::string>& objects) {
  const RunPaths paths{folder};
  ClipResult result;
  result.summary = parse_summary(read_text_file(paths.summary()), paths.summary());
  result.motion = read_motion(paths.motion());
  result.cameras = read_cameras(paths.cameras());
  std::vector<std::vector<ObjectPose>> tracks(result.motion.poses.size());
  if (!objects.empty()) tracks = read_object_tracks(paths.objects(), objects);
  result.sigmas = read_place_sigmas(paths.motion(), paths.objects(), objects);
  if (result.cameras.size() != result.motion.poses.size() || tracks.size() != result.motion.poses.size())
    throw DataError(folder + ": the result of the clip \"" + clip + "\" has " +
                    std::to_string(result.motion.poses.size()) + " poses, " + std::to_string(result.cameras.size()) +
                    " cameras and " + std::to_string(tracks.size()) + " frames of objects");
  for (std::size_t t = 0; t < tracks.size(); ++t)
    result.states.push_back({result.cameras[t].camera_from_world, tracks[t], result.motion.poses[t]});
  return result;
}

ChainSummary write_chain_results(const RunPaths& paths, const RunConfig& config, const ChainResult& result) {
  const Motion motion = joined_motion(result);
  const auto sigmas = joined<PlaceSigmas>(
      result.clips, [](const ClipResult& clip) -> auto& { return clip.sigmas; });
  write_motion(paths.motion(), motion, joint_sigmas_of(sigmas));
  write_motion(paths.motion_at_30(), resampled(motion, kExportedRate));
  const auto states = joined<SceneState>(
      result.clips, [](const ClipResult& clip) -> auto& { return clip.states; });
  if (!result.objects.empty()) write_object_tracks(paths.objects(), result.objects, states, sigmas);
  write_cameras(paths.cameras(), joined<Camera>(
                                     result.clips, [](const ClipResult& clip) -> auto& { return clip.cameras; }));
  ChainSummary summary = summary_of(config, result, motion);
  write_text_file(paths.summary(), chain_summary_json(summary));
  write_body(paths, body_of_avatar(config.body, config.chain.front().data.avatar.string()), result.facts.front().avatar,
             motion);
  if (!config.log.preview) return summary;
  if (have_one_size(result.clips)) {
    join_previews(paths, result, motion.frame_rate);
  } else {
    log_info("preview.mp4 is not written: the clips' images are of different sizes");
  }
  return summary;
}

}  // namespace hsi4d
