#include "pipelines/chain/chain.h"

#include <exception>

#include "body/motion_edit.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/version.h"
#include "optim/metrics.h"
#include "pipelines/chain/report.h"
#include "pipelines/chain/results.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/draw/camera_selection.h"
#include "pipelines/draw/visibility.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/frame_cameras.h"
#include "pipelines/report/report.h"
#include "pipelines/run/frame_start.h"
#include "pipelines/run/keypoint_motion.h"
#include "pipelines/sources/sources.h"
#include "splat/files/splat_file.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

/// "clip 2 of 3, b".
std::string clip_in_words(const RunConfig& chain, std::size_t index) {
  return "clip " + std::to_string(index + 1) + " of " + std::to_string(chain.chain.size()) + ", " +
         chain.chain[index].name;
}

/// The scene that a clip begins in. One without a state of its own is read with the first clip's, and no estimates.
SceneSetup setup_of(const RunConfig& chain, const DataSettings& data) {
  if (!data.initial.empty()) return read_scene_setup(data);
  DataSettings with_state = data;
  with_state.initial = chain.chain.front().data.initial;
  SceneSetup setup = read_scene_setup(with_state);
  setup.motion.poses.resize(1);
  setup.object_tracks.clear();
  return setup;
}

/// Whether nothing of a clip's video, masks, motion and camera waits for the clips before it.
bool has_all_inputs(const RunConfig& chain, std::size_t index) {
  const ChainClip& clip = chain.chain[index];
  return !clip.select_camera && !has_sources(sources_of(chain.sources, clip));
}

/// What the scene tells that a clip begins in.
ClipFacts facts_of_setup(const std::string& name, const SceneSetup& setup) {
  ClipFacts facts;
  facts.name = name;
  facts.motion = setup.motion;
  facts.object_tracks = setup.object_tracks;
  facts.avatar = setup.avatar;
  return facts;
}

/// What all inputs of a clip tell.
/// @param data  with all that programs make
ClipFacts facts_of_inputs(const RunConfig& chain, std::size_t index, const DataSettings& data) {
  SceneSetup setup = setup_of(chain, data);
  ClipFacts facts = facts_of_setup(chain.chain[index].name, setup);
  Clip clip = make_clip(data, std::move(setup));
  warn_of_antialiasing(clip.antialiased, chain.render.antialias);
  set_image_size(clip, chain);
  check_start(chain.start, clip);
  if (index == 0) check_first_view(clip, data.camera.string());
  check_frames(data, clip, losses_over_masks(chain));
  facts.frames = clip.frames();
  facts.frame_rate = clip.frame_rate;
  if (clip.truth) facts.true_first = clip.truth->front();
  return facts;
}

ClipFacts check_clip(const RunConfig& chain, std::size_t index) {
  const ChainClip& clip = chain.chain[index];
  if (has_all_inputs(chain, index)) return facts_of_inputs(chain, index, clip.data);
  if (!clip.data.camera.empty()) clip.select_camera ? camera_for_size(clip.data.camera) : only_camera(clip.data.camera);
  const SceneSetup setup = setup_of(chain, clip.data);
  warn_of_antialiasing(setup.antialiased, chain.render.antialias);
  return facts_of_setup(clip.name, setup);
}

/// The human's joints, and where it is known the frame rate, are those of the first clip.
void check_alike(const std::vector<ClipFacts>& clips, const RunConfig& config) {
  const ClipFacts& first = clips.front();
  for (std::size_t i = 1; i < clips.size(); ++i) {
    const std::string place = "/chain/" + std::to_string(i) + "/data/";
    if (clips[i].avatar.joints != first.avatar.joints)
      throw UserError(place + "avatar: " + config.chain[i].data.avatar.string() +
                      ": the human's joints are not those of " + config.chain[0].data.avatar.string() +
                      "; the clips of a chain have one body");
    if (clips[i].frames > 0 && first.frames > 0 && clips[i].frame_rate != first.frame_rate)
      throw UserError(place + "frame_rate: the clip \"" + clips[i].name + "\" has " +
                      to_json_line(ConfigValue::make_number(clips[i].frame_rate)) + " frames a second, \"" +
                      first.name + "\" has " + to_json_line(ConfigValue::make_number(first.frame_rate)) +
                      "; the clips of a chain have one frame rate");
  }
}

ConfigValue numbers(const Vector3<double>& v) {
  return ConfigValue::make_array(
      {ConfigValue::make_number(v[0]), ConfigValue::make_number(v[1]), ConfigValue::make_number(v[2])});
}

/// Writes the state that a clip begins with: body and objects as given, its other frames as it has them itself.
void write_start(const ChainPaths& paths, const ClipFacts& clip, const std::vector<std::string>& objects,
                 const SceneState& state) {
  Motion motion = clip.motion;
  motion.poses.front() = state.body;
  motion.pelvis_rest = pelvis_of(clip.avatar.joints);
  ConfigValue root = ConfigValue::make_object(), poses = ConfigValue::make_object();
  root.add("motion", ConfigValue::make_string(clip.name + ".npz"));
  for (std::size_t o = 0; o < objects.size(); ++o) {
    ConfigValue pose = ConfigValue::make_object();
    pose.add("rotation", numbers(state.objects[o].rotation));
    pose.add("translation", numbers(state.objects[o].translation));
    poses.add(objects[o], std::move(pose));
  }
  root.add("objects", std::move(poses));
  if (!clip.object_tracks.empty())
    root.add("object_tracks", ConfigValue::make_string(fs::absolute(clip.object_tracks).string()));
  fs::create_directories(fs::path(paths.start(clip.name)).parent_path());
  write_motion(paths.start_motion(clip.name), motion);
  write_text_file(paths.start(clip.name), to_json(root));
}

/// Chooses the camera of a clip in its first state.
/// @param pointer  the clip's, for messages
void write_chosen_camera(const RunConfig& clip, const std::string& pointer, const std::string& file,
                         const Observer& observer) {
  try {
    const CameraChoice choice = select_camera(read_scene_setup(clip.data), clip.camera_selection, clip.render,
                                              intrinsics_of(clip.data.camera), observer);
    fs::create_directories(fs::path(file).parent_path());
    write_camera(file, choice.camera);
    log_info("camera: " + file + ", chosen of " + std::to_string(choice.candidates.size()) + ", sees " +
             std::to_string(choice.candidates.front().visible) + " of " + std::to_string(kMetricJoints) + " joints");
  } catch (const UserError& error) {
    throw UserError(pointer + "/select_camera: " + error.what());
  }
}

/// The config of a clip, which begins with the state that the one before left.
RunConfig started_config(const RunConfig& chain, std::size_t index, const ChainPaths& paths) {
  RunConfig clip = clip_config(chain, index);
  if (index > 0) clip.data.initial = fs::absolute(paths.start(chain.chain[index].name));
  if (chain.chain[index].select_camera) clip.data.camera = fs::absolute(paths.camera(chain.chain[index].name));
  return clip;
}

bool says_done(const RunConfig& clip, const std::string& folder, const std::vector<LossTerm>& losses) {
  const std::string identity = resolved_config(with_passes(clip), descriptions_of(losses));
  return look_at_run_folder(folder, identity, true) == RunState::kDone;
}

/// The inputs of a clip that is done, with what programs made for it. Throws DataError for what is not there any more:
/// to make it anew may cost something, and would not give the same.
DataSettings made_inputs(const RunConfig& clip) {
  DataSettings data = clip.data;
  for (const SourceOutput& output : planned_sources(clip)) {
    if (!output.is_there)
      throw DataError("/sources/" + output.what + ": " + (output.path.empty() ? "its output" : output.path.string()) +
                      ", of which the clip that is done was made, is not there, or its first frame is another by now; "
                      "without the clip's folder it is made anew");
    take_output(output, data);
  }
  return data;
}

/// Whether a clip is done, with the inputs that it has now.
/// Throws DataError naming an input that has changed since.
bool is_done(const RunConfig& clip, const std::string& folder, const std::vector<LossTerm>& losses) {
  if (!says_done(clip, folder, losses)) return false;
  RunConfig prepared = clip;
  prepare_run(prepared);
  prepared = with_passes(prepared);
  prepared.data = made_inputs(prepared);
  const Clip inputs = read_run_clip(prepared, losses);
  return finished_frames(folder, prepared, inputs, losses) + 1 == inputs.frames();  // not without a checkpoint
}

/// Calls `work`; what it throws of the clip begins with the clip's number and name.
template <class F>
auto with_clip_named(const RunConfig& chain, std::size_t index, const F& work) {
  try {
    return work();
  } catch (const Interrupted& stop) {
    throw Interrupted(clip_in_words(chain, index) + ": " + stop.what());
  } catch (const UserError& mistake) {
    throw UserError(clip_in_words(chain, index) + ": " + mistake.what());
  } catch (const DataError& damage) {
    throw DataError(clip_in_words(chain, index) + ": " + damage.what());
  }
}

/// One after the other, and each from where the one before ended.
class Chain {
 public:
  Chain(const RunConfig& config, const std::vector<LossTerm>& losses, const RunOptions& options,
        std::vector<ClipFacts> clips)
      : config_(config),
        losses_(losses),
        options_(options),
        clips_(std::move(clips)),
        paths_{fs::path(options.folder)} {
    for (const auto& [name, object] : config.chain.front().data.objects) objects_.push_back(name);
  }

  ChainSummary run(const RunFolder& folder) {
    std::vector<ClipResult> results;
    for (std::size_t i = 0; i < clips_.size(); ++i) {
      if (i > 0) write_start(paths_, clips_[i], objects_, results.back().states.back());
      with_clip_named(config_, i, [&] {
        if (!has_all_inputs(config_, i)) make_inputs(i);
        run_clip(i, folder);
      });
      results.push_back(read_clip_result(clips_[i].name, paths_.clip(clips_[i].name), objects_));
    }
    return write_chain_results(folder.paths(), config_, {clips_, results, objects_});
  }

 private:
  /// Chooses the camera and runs programs where the clip needs it, and completes what is known of the clip. One that
  /// has begun keeps its camera, one that is done all that was made for it.
  void make_inputs(std::size_t i) {
    RunConfig clip = started_config(config_, i, paths_);
    const std::string folder = paths_.clip(clips_[i].name), camera = paths_.camera(clips_[i].name);
    const bool has_begun = options_.resume && fs::exists(folder);
    if (config_.chain[i].select_camera && !(has_begun && fs::exists(camera))) {
      RunConfig before = clip;
      before.data.camera = config_.chain[i].data.camera;
      on_threads(
          [&] { write_chosen_camera(before, child_pointer("/chain", std::to_string(i)), camera, options_.observer); });
    }
    if (has_begun && says_done(clip, folder, losses_)) {
      clip.data = made_inputs(clip);
    } else {
      on_threads([&] { clip.data = make_sources(clip, motion_maker(losses_, options_.observer), options_.observer); });
    }
    clips_[i] = facts_of_inputs(config_, i, clip.data);
    check_alike(clips_, config_);
  }

  void on_threads(FunctionRef<void()> work) const {
    const int threads = options_.threads > 0 ? options_.threads : config_.threads;
    with_threads(threads > 0 ? threads : thread_count(), work);
  }

  void run_clip(std::size_t i, const RunFolder& folder) const {
    const RunConfig clip = started_config(config_, i, paths_);
    RunOptions options = options_;
    options.folder = paths_.clip(clips_[i].name);
    if (options.resume && is_done(clip, options.folder, losses_)) {
      if (!fs::exists(RunPaths{options.folder}.report())) write_report(options.folder);  // killed before that
      return;
    }
    folder.note("begins " + clip_in_words(config_, i));
    execute_run(clip, losses_, options);
  }

  const RunConfig& config_;
  const std::vector<LossTerm>& losses_;
  const RunOptions& options_;
  std::vector<ClipFacts> clips_;  // of those that programs make all is known once they begin
  ChainPaths paths_;
  std::vector<std::string> objects_;
};

RunIdentity identity_of(const RunConfig& config, const std::vector<LossTerm>& losses, int asked) {
  RunIdentity identity;
  identity.config = resolved_config(config, descriptions_of(losses));
  identity.seed = config.seed;
  const int threads = asked > 0 ? asked : config.threads;
  identity.threads = threads > 0 ? threads : thread_count();
  identity.precision = choice_name<RunPrecision>(kRunPrecisions, config.precision);
  identity.is_chain = true;
  return identity;
}

}  // namespace

RunConfig clip_config(const RunConfig& chain, std::size_t index) {
  RunConfig clip = chain;
  clip.chain.clear();
  clip.name = (chain.name.empty() ? "" : chain.name + ": ") + clip_in_words(chain, index);
  clip.data = chain.chain.at(index).data;
  clip.sources = sources_of(chain.sources, chain.chain[index]);
  return clip;
}

std::vector<ClipFacts> check_chain(const RunConfig& config) {
  RunConfig prepared = config;
  prepare_run(prepared);
  if (config.body.kind == BodyKind::kSmplx) body_model_of(config.body);
  std::vector<ClipFacts> clips;
  for (std::size_t i = 0; i < config.chain.size(); ++i) clips.push_back(check_clip(config, i));
  check_alike(clips, config);
  return clips;
}

std::size_t finished_clips(const RunConfig& config, const std::string& folder, const std::vector<LossTerm>& losses) {
  const ChainPaths paths{fs::path(folder)};
  std::size_t done = 0;
  const auto next_is_done = [&] {
    return with_clip_named(config, done, [&] {
      const std::string folder_of_clip = paths.clip(config.chain[done].name);
      return fs::exists(folder_of_clip) && is_done(started_config(config, done, paths), folder_of_clip, losses);
    });
  };
  while (done < config.chain.size() && next_is_done()) ++done;
  return done;
}

ChainSummary execute_chain(const RunConfig& config, const std::vector<LossTerm>& losses, const RunOptions& options) {
  const WarningsOnce once;                             // inputs are looked at here, and again when their clip begins
  std::vector<ClipFacts> clips = check_chain(config);  // before anything is written
  RunFolder folder(options.folder, identity_of(config, losses, options.threads), options.resume);
  folder.take_over_config();
  folder.note("hsi4d " + std::string(version()) + " (" + git_commit() + "), chain '" + config.name + "' of " +
              std::to_string(clips.size()) + " clips");
  try {
    ChainSummary summary = Chain(config, losses, options, std::move(clips)).run(folder);
    folder.set_state(RunState::kDone);
    write_chain_report(options.folder);
    folder.note("done: " + std::to_string(summary.all.frames) + " frames");
    return summary;
  } catch (const Interrupted& stop) {
    note_end(folder, RunState::kInterrupted, stop.what());
    throw;
  } catch (const std::exception& failure) {
    note_end(folder, RunState::kFailed, failure.what());
    throw;
  }
}

}  // namespace hsi4d
