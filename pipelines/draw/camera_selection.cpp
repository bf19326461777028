#include "pipelines/draw/camera_selection.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/angles.h"
#include "core/check.h"
#include "core/progress.h"
#include "core/rotation.h"
#include "optim/metrics.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/draw/posed_avatar.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

constexpr double kHalf = 0.5;  // transmittance at which a surface is

Vector joint(const std::vector<double>& joints, Index j) { return Vector(joints.data() + 3 * j); }

/// Depth at which the transmittance of a pixel falls below ½; none where it does not.
std::optional<double> surface_depth(const PixelTrace& trace) {
  for (const PixelSplat& splat : trace.composited) {
    if (splat.transmittance * (1 - splat.alpha) < kHalf) return splat.depth;
  }
  return {};
}

/// The pixels of the joints that are before the camera and in the image.
std::vector<PixelPlace> joint_pixels(const std::vector<double>& joints, const Camera& camera) {
  std::vector<PixelPlace> pixels;
  for (Index j = 0; j < kMetricJoints; ++j) {
    const Vector p = transform_point(camera.camera_from_world, joint(joints, j));
    if (!(p[2] > 0)) continue;
    const Vector2<double> pixel = project_point(camera, p);
    if (pixel[0] >= 0 && pixel[0] < camera.width && pixel[1] >= 0 && pixel[1] < camera.height)
      pixels.push_back({static_cast<int>(pixel[0]), static_cast<int>(pixel[1])});
  }
  return pixels;
}

Camera camera_of(const CameraSelectionSettings& settings) {
  const double focal = settings.width / (2 * std::tan(settings.field_of_view_deg * kDegree / 2));
  return {settings.width, settings.height, focal, focal, settings.width / 2.0, settings.height / 2.0, {}};
}

Vector center_world(const Camera& camera) {
  return -(camera.camera_from_world.rotation.transpose() * camera.camera_from_world.translation);
}

std::vector<double> first_joints(const SceneSetup& setup) {
  return pose_joints(setup.avatar, setup.motion.poses.front());
}

bool is_better(const CandidateView& a, const CandidateView& b) {
  if (a.visible != b.visible) return a.visible > b.visible;
  const auto steps = [](const CandidateView& view) { return std::lround(view.cover.value_or(0) / kCoverStep); };
  if (steps(a) != steps(b)) return steps(a) > steps(b);
  return std::fabs(a.elevation_deg) < std::fabs(b.elevation_deg);
}

}  // namespace

Vector heading_of(const BodyPose& pose) {
  Vector forward = so3_exp(pose.rotation_of(0)) * Vector(0, 0, 1);
  forward[2] = 0;
  if (forward.norm() < 1e-3)
    throw UserError("the human of frame 0 faces up or down: it has no heading to choose a view by");
  return forward / forward.norm();
}

Vector view_center(const SceneSetup& setup, const CameraSelectionSettings& settings) {
  const Vector pelvis = joint(first_joints(setup), 0), heading = heading_of(setup.motion.poses.front());
  double farthest = 0;  // along the heading; objects behind the human count for nothing
  for (std::size_t o = 0; o < setup.objects.size(); ++o) {
    const Rigid<double> pose{so3_exp(setup.poses[o].rotation), setup.poses[o].translation};
    const Gaussians& object = setup.objects[o].gaussians;
    for (Index i = 0; i < object.count(); ++i) {
      const Vector place = transform_point(pose, Vector(Vector3<float>(object.means.data() + 3 * i).cast<double>()));
      farthest = std::max(farthest, (place - pelvis).dot(heading));
    }
  }
  return pelvis + heading * (farthest / 2) + Vector(0, 0, settings.above_pelvis_m);
}

std::vector<CandidateView> candidate_views(const SceneSetup& setup, const CameraSelectionSettings& settings) {
  const Vector center = view_center(setup, settings), heading = heading_of(setup.motion.poses.front());
  const double forward = std::atan2(heading[1], heading[0]);
  std::vector<CandidateView> views;
  for (const double radius : settings.radii_m) {
    for (const double elevation : settings.elevations_deg) {
      for (int k = 0; k < settings.azimuths; ++k) {
        const double azimuth = 360.0 * k / settings.azimuths, up = elevation * kDegree;
        const double around = forward + azimuth * kDegree;
        const Vector out(std::cos(up) * std::cos(around), std::cos(up) * std::sin(around), std::sin(up));
        const double along = out.dot(heading);
        if (!(along > 1e-9) || along > std::cos(settings.frontal_deg * kDegree)) continue;
        views.push_back(
            {radius, azimuth > 180 ? azimuth - 360 : azimuth, elevation, look_at(center + radius * out, center), 0});
      }
    }
  }
  return views;
}

FirstFrame first_frame(const SceneSetup& setup, const Vector& camera_center) {
  FirstFrame frame;
  frame.human = posed_avatar(setup.avatar, setup.motion.poses.front(), &camera_center);
  std::vector<PosedGaussians> parts = {{setup.scene, {}}};
  for (std::size_t o = 0; o < setup.objects.size(); ++o)
    parts.push_back(posed_object(setup.objects[o].gaussians, setup.poses[o]));
  parts.push_back(frame.human);
  frame.all = concatenated(parts);
  return frame;
}

namespace {

Index count_visible(const FirstFrame& frame, const std::vector<double>& joints, const Camera& camera,
                    const CameraSelectionSettings& settings, const RenderSettings& render) {
  SceneView view;
  view.camera = reduced_camera(camera, settings.trial_px);
  view.settings = render;
  const std::vector<PixelPlace> pixels = joint_pixels(joints, view.camera);
  if (pixels.empty()) return 0;
  const std::vector<PixelTrace> human = render_scene(frame.human, view, pixels).traces,
                                all = render_scene(frame.all, view, pixels).traces;
  Index visible = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::optional<double> of_human = surface_depth(human[i]), of_all = surface_depth(all[i]);
    if (of_human && of_all && std::fabs(*of_human - *of_all) < settings.tolerance_m) ++visible;
  }
  return visible;
}

/// How much of the image something covers: mean of its opacity.
double cover_of(const FirstFrame& frame, const Camera& camera, const CameraSelectionSettings& settings,
                const RenderSettings& render) {
  SceneView view;
  view.camera = reduced_camera(camera, settings.trial_px);
  view.settings = render;
  const std::vector<double> alpha = render_scene(frame.all, view).alpha;
  return std::accumulate(alpha.begin(), alpha.end(), 0.0) / static_cast<double>(alpha.size());
}

}  // namespace

Index count_visible(const SceneSetup& setup, const Camera& camera, const CameraSelectionSettings& settings,
                    const RenderSettings& render) {
  return count_visible(first_frame(setup, center_world(camera)), first_joints(setup), camera, settings, render);
}

CameraChoice select_camera(const SceneSetup& setup, const CameraSelectionSettings& settings,
                           const RenderSettings& render, const std::optional<Camera>& intrinsics,
                           const Observer& observer) {
  CameraChoice choice{intrinsics ? *intrinsics : camera_of(settings), candidate_views(setup, settings)};
  if (choice.candidates.empty())
    throw UserError(
        "camera_selection: there are no candidates: radii_m or frontal_deg leaves none that faces the human");
  const std::vector<double> joints = first_joints(setup);
  const FirstFrame frame = first_frame(setup, view_center(setup, settings));  // colours do not matter
  Progress bar("candidates", std::ssize(choice.candidates), observer.progress, observer.progress_interval);
  for (CandidateView& candidate : choice.candidates) {
    if (observer.wants_stop()) throw Interrupted("interrupted while cameras were tried; nothing is written");
    choice.camera.camera_from_world = candidate.camera_from_world;
    candidate.visible = count_visible(frame, joints, choice.camera, settings, render);
    bar.step();
  }
  bar.finish();
  const Index most =
      std::max_element(choice.candidates.begin(), choice.candidates.end(), [](const auto& a, const auto& b) {
        return a.visible < b.visible;
      })->visible;
  for (CandidateView& candidate : choice.candidates) {
    if (observer.wants_stop()) throw Interrupted("interrupted while cameras were tried; nothing is written");
    if (!settings.by_cover || candidate.visible < most) continue;
    choice.camera.camera_from_world = candidate.camera_from_world;
    candidate.cover = cover_of(frame, choice.camera, settings, render);
  }
  std::stable_sort(choice.candidates.begin(), choice.candidates.end(), is_better);
  if (choice.candidates.front().visible == 0)
    throw UserError("no joint of the human is to be seen from any of " + std::to_string(choice.candidates.size()) +
                    " candidates; camera_selection.radii_m says how far away they are");
  choice.camera.camera_from_world = choice.candidates.front().camera_from_world;
  return choice;
}

}  // namespace hsi4d
