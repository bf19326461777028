#include "pipelines/synthetic/chain.h"

#include <array>
#include <numbers>

#include "body/kinematics.h"
#include "core/check.h"
#include "core/rotation.h"
#include "pipelines/draw/camera_selection.h"
#include "pipelines/synthetic/dataset.h"

namespace hsi4d {

namespace {

constexpr std::array<double, 4> kTurnsDeg = {30, -30, 20, -20};  // of views from that of the first clip
constexpr int kTrialPx = 128;                                    // size of the images in which joints are counted

Vector3<double> pelvis_in(const Avatar& avatar, const BodyPose& pose) {
  return Vector3<double>(pose_joints(avatar, pose).data());
}

/// The view of the first clip, carried along with the person from `start` and turned about it.
Viewpoint turned_view(const Viewpoint& first, const Vector3<double>& moved, double turn) {
  Viewpoint view = first;
  view.target = first.target + moved;
  view.eye = view.target + so3_exp(Vector3<double>(0, 0, turn)) * Vector3<double>(first.eye - first.target);
  view.turn = turn;
  return view;
}

/// Of views from other sides the one that sees most joints of the clip's first frame, as the first camera of any clip
/// is chosen; scenes are made to be seen from the front, so that these are few. Of equals the first, on the left and on
/// the right in turn.
Viewpoint chosen_view(const SyntheticClip& clip, const ClipSettings& settings, const Vector3<double>& start,
                      const SyntheticSetting& filmed, Index index) {
  const SceneSetup setup = setup_in(filmed, clip);
  const Viewpoint first = first_viewpoint(settings);
  Vector3<double> moved = pelvis_in(filmed.avatar, clip.motion.poses.front()) - start;
  moved[2] = 0;
  CameraSelectionSettings selection;
  selection.trial_px = kTrialPx;
  Viewpoint best;
  Index most = -1;
  for (const double degrees : kTurnsDeg) {
    const double side = index % 2 == 1 ? 1 : -1;
    const Viewpoint view = turned_view(first, moved, side * degrees * std::numbers::pi / 180);
    const Index visible = count_visible(setup, camera_at(view, 0, settings), selection, video_render_settings());
    if (visible <= most) continue;
    most = visible;
    best = view;
  }
  return best;
}

std::vector<Camera> cameras_from(const Viewpoint& view, Index frames, const ClipSettings& settings) {
  std::vector<Camera> cameras;
  for (Index t = 0; t < frames; ++t)
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

std::vector<SyntheticClip> cut_into_clips(const SyntheticClip& whole, const ClipSettings& settings, Index clips,
                                          const SyntheticSetting& filmed) {
  const Index all = std::ssize(whole.motion.poses), frames = (all - 1) / clips + 1;
  HSI4D_CHECK_EQ(all, clips * (frames - 1) + 1);
  const Vector3<double> start = pelvis_in(filmed.avatar, whole.motion.poses.front());
  std::vector<SyntheticClip> parts;
  for (Index k = 0; k < clips; ++k) {
    const Index begin = k * (frames - 1);
    SyntheticClip part = whole;
    part.motion.poses = part_of(whole.motion.poses, begin, frames);
    part.object = part_of(whole.object, begin, frames);
    part.cameras = k == 0 ? part_of(whole.cameras, 0, frames)
                          : cameras_from(chosen_view(part, settings, start, filmed, k), frames, settings);
    parts.push_back(std::move(part));
  }
  return parts;
}

}  // namespace hsi4d
