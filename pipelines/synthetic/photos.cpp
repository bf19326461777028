#include "pipelines/synthetic/photos.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/camera_places.h"
#include "core/check.h"
#include "core/file.h"
#include "core/folder_in_making.h"
#include "core/random.h"
#include "pipelines/photos/photo_set.h"
#include "pipelines/synthetic/dataset.h"
#include "pipelines/synthetic/object.h"
#include "pipelines/synthetic/scene.h"
#include "pipelines/synthetic/views.h"
#include "splat/files/splat_file.h"

namespace hsi4d {

namespace {

constexpr double kSeen = 0.5;  // alpha from which a pixel shows something

/// What the pictures show.
struct Subject {
  Gaussians gaussians;
  std::vector<Camera> cameras;
  bool has_alpha = false;
};

Subject object_of(const SyntheticSettings& settings) {
  Subject subject;
  subject.gaussians = synthetic_object(settings).gaussians;
  const Gaussians& g = subject.gaussians;
  double radius = 0;
  for (Index i = 0; i < g.count(); ++i)
    radius = std::max(radius, Vector3<float>(g.means.data() + 3 * i).cast<double>().norm());
  subject.cameras = cameras_around(g.origin_world, radius, settings.photos, settings.size_px, kMostSides);
  subject.has_alpha = true;
  return subject;
}

Subject scene_of(const SyntheticSettings& settings) {
  Subject subject;
  subject.gaussians = settings.scene_file.empty() ? synthetic_scene(settings, ScenePlan{})
                                                  : read_splats(settings.scene_file.string()).gaussians;
  subject.cameras = cameras_in_scene(settings.photos, settings.size_px, static_cast<std::uint64_t>(settings.seed));
  return subject;
}

Image depth_image(const SceneImage& picture) {
  Image depth(1, picture.height, picture.width);
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const std::size_t at =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.width()) + static_cast<std::size_t>(x);
      depth(0, y, x) = picture.alpha[at] > kSeen ? static_cast<float>(picture.depth[at]) : 0.0F;
    }
  }
  return depth;
}

}  // namespace

std::vector<Camera> cameras_in_scene(Index count, int size_px, std::uint64_t seed) {
  constexpr double kFocal = 0.8;
  const Random random(seed, random_stream("synthetic.photos"));
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  std::vector<Camera> cameras;
  for (Index k = 0; k < count; ++k) {
    const auto at = static_cast<std::uint64_t>(8 * k);
    const double radius = 2.6 * std::sqrt((static_cast<double>(k) + 0.5) / static_cast<double>(count));
    const double angle = golden * static_cast<double>(k);
    const Vector3<double> eye(radius * std::cos(angle), -0.6 + 0.9 * radius * std::sin(angle),
                              random.uniform(at, 0.6, 2.0));
    const double turn = random.uniform(at + 1, 0, 2 * std::numbers::pi);
    // Half of them look across the middle, half to some side.
    const Vector3<double> target =
        k % 2 == 0 ? Vector3<double>(random.uniform(at + 2, -0.8, 0.8), random.uniform(at + 3, 0, 1.4),
                                     random.uniform(at + 4, 0.3, 1.1))
                   : Vector3<double>(eye + Vector3<double>(2 * std::cos(turn), 2 * std::abs(std::sin(turn)),
                                                           random.uniform(at + 5, -1.0, 0.3)));
    cameras.push_back(camera_at(eye, target, kFocal, size_px));
  }
  return cameras;
}

bool is_good_view(const SceneImage& picture) {
  constexpr double kNearest = 0.25;                      // metres
  constexpr double kMostNear = 0.02, kLeastSeen = 0.02;  // shares of pixels
  std::size_t near = 0, seen = 0;
  for (std::size_t i = 0; i < picture.alpha.size(); ++i) {
    if (picture.alpha[i] <= kSeen) continue;
    ++seen;
    if (picture.depth[i] < kNearest) ++near;
  }
  const auto pixels = static_cast<double>(picture.alpha.size());
  return static_cast<double>(near) <= kMostNear * pixels && static_cast<double>(seen) >= kLeastSeen * pixels;
}

void write_photos(const SyntheticSettings& settings, const RenderSettings& render, const std::filesystem::path& folder,
                  const Observer& observer) {
  FolderInMaking out(folder);
  const bool is_object = settings.photos_of == SyntheticSubject::kObject;
  const Subject subject = is_object ? object_of(settings) : scene_of(settings);
  write_splats(out.file(is_object ? "truth/object.ply" : "truth/scene.ply"), subject.gaussians);
  std::vector<Camera> taken;
  Progress shown("pictures", std::ssize(subject.cameras), observer.progress, observer.progress_interval);
  for (const Camera& camera : subject.cameras) {
    if (observer.wants_stop()) throw Interrupted("interrupted while pictures were made; nothing is left of them");
    shown.step();
    const PosedGaussians posed{subject.gaussians, {}};
    SceneView view;
    view.camera = camera;
    view.settings = render;
    view.precision = Precision::kFloat;
    const SceneImage plain = render_scene(posed, view);
    if (!is_good_view(plain)) continue;
    const Image picture = picture_with_alpha(posed, camera, render, Precision::kFloat, settings.supersample);
    write_photo(out, std::ssize(taken), subject.has_alpha ? picture : before_black(picture), depth_image(plain));
    taken.push_back(camera);
  }
  if (taken.empty())
    throw UserError("/synthetic: no camera of " + std::to_string(subject.cameras.size()) +
                    " sees enough of what is to be shown, or all are inside of it");
  write_photo_cameras(out, taken);
  write_text_file(out.file(kSyntheticFile), synthetic_settings_json(settings));
  out.commit();
}

}  // namespace hsi4d
