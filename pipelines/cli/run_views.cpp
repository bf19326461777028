#include "pipelines/cli/run_views.h"

#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/log.h"
#include "pipelines/config/run_config.h"
#include "pipelines/input/body_files.h"
#include "pipelines/record/folder.h"

namespace hsi4d::cli {

namespace {

namespace fs = std::filesystem;

/// Throws UserError unless the files of a run that is done are there.
void check_is_done(const RunPaths& paths) {
  for (const std::string& file : {paths.config(), paths.motion(), paths.cameras()}) {
    if (!fs::exists(file))
      throw UserError(paths.folder.string() + ": holds no " + fs::path(file).filename().string() +
                      "; allowed: the folder of a run that is done");
  }
}

/// The avatar that the run found, or else that which it was given.
std::string avatar_of(const RunPaths& paths, const RunConfig& config) {
  return fs::exists(paths.avatar()) ? paths.avatar() : config.data.avatar.string();
}

/// The lens that the run's frames were seen through.
Lens lens_of(const RunPaths& paths, const RunConfig& config) {
  if (config.data.lens.estimate_k1)
    throw UserError(paths.config() +
                    ": /data/lens/k1: is \"estimate\", and what the run found is in its log.txt alone; a "
                    "fit needs a run with that number in its place");
  return config.data.lens.lens;
}

/// The sections of a fit that are the run's.
ConfigValue settings_of(const RunPaths& paths, const RunConfig& config, const std::vector<LossDescription>& losses) {
  const ConfigValue resolved = sections_beside_data(config, losses);
  ConfigValue render = *find_member(resolved, "render");
  if (config.estimate_blur) {  // what the run found is in its log alone
    std::erase_if(render.members, [](const ConfigMember& member) { return member.key == "blur"; });
    log_warning("render.blur of the run is \"estimate\"; the fit takes the preset's, or --set render.blur=X");
  }
  ConfigValue settings = ConfigValue::make_object();
  settings.add("avatar", ConfigValue::make_string(avatar_of(paths, config)));
  settings.add("render", std::move(render));
  return settings;
}

/// All frames, or kMostRunViews of them, the first and the last included.
std::vector<PosedView> chosen_views(Index frames) {
  const Index count = std::min(frames, kMostRunViews);
  std::vector<PosedView> views;
  for (Index k = 0; k < count; ++k) {
    const Index frame = count == 1 ? 0 : k * (frames - 1) / (count - 1);
    views.push_back({{}, {}, frame, frame});
  }
  return views;
}

}  // namespace

RunViews run_views(const fs::path& run, const std::vector<LossDescription>& losses) {
  const RunPaths paths{run};
  check_is_done(paths);
  const RunConfig config = load_run_config(paths.config(), {}, losses);
  if (!config.chain.empty())
    throw UserError(run.string() + ": is a chain; allowed: the run of one of its clips, clips/NAME");
  ViewSet set;
  set.file = paths.config();
  set.motion_file = paths.motion();
  set.cameras_file = paths.cameras();
  set.motion = read_motion_with_warnings(paths.motion());
  set.cameras = read_cameras(paths.cameras());
  ClipVideo video = open_video(config.data, {});
  video.lens = lens_of(paths, config);
  video.camera = set.cameras.empty() ? Camera() : set.cameras.front();
  set.video = std::make_shared<const ClipVideo>(std::move(video));
  const Index frames = set.video->frames.count();
  if (std::ssize(set.motion.poses) != frames || std::ssize(set.cameras) != frames)
    throw UserError(run.string() + ": has " + std::to_string(set.motion.poses.size()) + " poses and " +
                    std::to_string(set.cameras.size()) + " cameras, its video " + std::to_string(frames) +
                    " frames; allowed: as many of each");
  set.views = chosen_views(frames);
  return {std::move(set), settings_of(paths, config, losses)};
}

}  // namespace hsi4d::cli
