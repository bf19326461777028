#include "pipelines/synthetic_chain.h"

#include <cmath>
#include <numbers>

#include "core/check.h"
#include "core/rotation.h"
#include "pipelines/camera_selection.h"
#include "pipelines/synthetic.h"

namespace hsi4d {

namespace {

/// Few candidates, all of them good views: at the level of the eyes, from aslant.
CameraSelectionSettings views_around() {
  CameraSelectionSettings settings;
  settings.radii_m = {2.8};
  settings.elevations_deg = {10};
  settings.azimuths = 12;
  settings.trial_px = 128;
  return settings;
}

SceneSetup setup_in(const SyntheticSetting& filmed, const SyntheticClip& clip) {
  SceneSetup setup;
  setup.scene = filmed.scene;
  setup.avatar = filmed.avatar;
  setup.motion = clip.motion;
  if (filmed.object.exists()) {
    setup.objects.push_back({filmed.object.name, filmed.object.gaussians});
    setup.poses.push_back({so3_log(clip.object.front().rotation), clip.object.front().translation});
  }
  return setup;
}

/// Cameras that begin where the first frame is seen best.
std::vector<Camera> chosen_cameras(const SyntheticClip& clip, const ClipSettings& settings,
                                   const SyntheticSetting& filmed, const Observer& observer) {
  const SceneSetup setup = setup_in(filmed, clip);
  const CameraSelectionSettings views = views_around();
  Observer quiet;
  quiet.stop_requested = observer.stop_requested;
  const Camera camera = select_camera(setup, views, video_render_settings(),
                                      camera_at(first_viewpoint(settings.motion), 0, settings), quiet)
                            .camera;
  Viewpoint view = first_viewpoint(settings.motion);
  view.eye = -(camera.camera_from_world.rotation.transpose() * camera.camera_from_world.translation);
  view.target = view_center(setup, views);
  const Vector3<double> ahead = view.target - view.eye;
  view.turn = std::atan2(ahead[1], ahead[0]) - std::numbers::pi / 2;
  std::vector<Camera> cameras;
  for (std::size_t t = 0; t < clip.motion.poses.size(); ++t)
    cameras.push_back(camera_at(view, static_cast<double>(t) / settings.frame_rate, settings));
  return cameras;
}

template <class T>
std::vector<T> part_of(const std::vector<T>& all, Index begin, Index count) {
  if (all.empty()) return {};
  return {all.begin() + begin, all.begin() + begin + count};
}

}  // namespace

std::string clip_name(Index clip) { return "clip" + std::to_string(clip + 1); }

std::vector<SyntheticClip> cut_into_clips(const SyntheticClip& whole, const ClipSettings& settings, Index clips,
                                          const SyntheticSetting& filmed, const Observer& observer) {
  const Index all = std::ssize(whole.motion.poses), frames = (all - 1) / clips + 1;
  HSI4D_CHECK_EQ(all, clips * (frames - 1) + 1);
  std::vector<SyntheticClip> parts;
  for (Index k = 0; k < clips; ++k) {
    const Index begin = k * (frames - 1);
    SyntheticClip part = whole;
    part.motion.poses = part_of(whole.motion.poses, begin, frames);
    part.object = part_of(whole.object, begin, frames);
    part.cameras = k == 0 ? part_of(whole.cameras, 0, frames) : chosen_cameras(part, settings, filmed, observer);
    parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace hsi4d
