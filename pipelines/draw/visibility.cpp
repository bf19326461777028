#include "pipelines/draw/visibility.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "core/check.h"
#include "core/config_value.h"
#include "core/log.h"
#include "core/rotation.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "pipelines/draw/posed_avatar.h"
#include "splat/limits.h"

namespace hsi4d {

namespace {

/// A point of the world by its number.
using PointOf = std::function<Vector3<double>(std::size_t)>;

bool is_any_in_view(const Camera& camera, Index points, const PointOf& point_world) {
  const View<double> view = view_of<double>(camera);
  for (Index i = 0; i < points; ++i) {
    const Vector3<double> place = point_in_view(view, point_world(static_cast<std::size_t>(i)));
    if (!(place[2] > kNear)) continue;
    const Vector2<double> pixel = project_point(camera, place);
    if (pixel[0] >= 0 && pixel[0] < camera.width && pixel[1] >= 0 && pixel[1] < camera.height) return true;
  }
  return false;
}

Vector3<double> mean_of(const std::vector<float>& means, std::size_t i) {
  return Vector3<float>(means.data() + 3 * i).cast<double>();
}

bool is_human_in_view(const Camera& camera, const Avatar& avatar, const BodyPose& pose) {
  const std::vector<double> transforms = blended_transforms(avatar, pose);
  return is_any_in_view(camera, avatar.count(), [&](std::size_t i) {
    const double* row = transforms.data() + 12 * i;
    const Vector3<double> mean = mean_of(avatar.means, i);
    return Vector3<double>(row[0] * mean[0] + row[1] * mean[1] + row[2] * mean[2] + row[3],
                           row[4] * mean[0] + row[5] * mean[1] + row[6] * mean[2] + row[7],
                           row[8] * mean[0] + row[9] * mean[1] + row[10] * mean[2] + row[11]);
  });
}

bool is_object_in_view(const Camera& camera, const Gaussians& object, const ObjectPose& pose) {
  const Matrix3<double> rotation = so3_exp(pose.rotation);
  return is_any_in_view(camera, object.count(), [&](std::size_t i) {
    return Vector3<double>(rotation * (mean_of(object.means, i) + object.origin_world) + pose.translation);
  });
}

/// Warns of the frames from 1 on in which something is not in view.
/// @param what    "the human"
/// @param of_all  how many Gaussians it has
void warn_of_none(const std::string& what, Index of_all, const std::vector<PartsInView>& frames,
                  const std::function<bool(const PartsInView&)>& is_in_view) {
  std::vector<Index> empty;
  for (std::size_t t = 1; t < frames.size(); ++t) {
    if (!is_in_view(frames[t])) empty.push_back(static_cast<Index>(t));
  }
  if (empty.empty()) return;
  log_warning(what + " is out of view in " + (empty.size() == 1 ? "frame " : "frames ") + frame_ranges(empty) +
              ": none of its " + std::to_string(of_all) +
              " Gaussians has its centre in the image, which tells nothing of it there");
}

/// Of its mean colour everywhere.
Image plain_of(const Image& image) {
  Image plain(image.channels(), image.height(), image.width());
  for (int c = 0; c < image.channels(); ++c) {
    double sum = 0;
    for (int y = 0; y < image.height(); ++y)
      sum = std::accumulate(image.row(c, y), image.row(c, y) + image.width(), sum);
    const auto mean = static_cast<float>(sum / (static_cast<double>(image.height()) * image.width()));
    for (int y = 0; y < image.height(); ++y) std::fill_n(plain.row(c, y), image.width(), mean);
  }
  return plain;
}

}  // namespace

PartsInView parts_in_view(const Clip& clip, const SceneState& state) {
  Camera camera = clip.camera;
  camera.camera_from_world = state.camera_from_world;
  PartsInView seen;
  seen.scene = is_any_in_view(camera, clip.scene.count(), [&](std::size_t i) {
    return Vector3<double>(mean_of(clip.scene.means, i) + clip.scene.origin_world);
  });
  seen.human = is_human_in_view(camera, clip.avatar, state.body);
  for (std::size_t o = 0; o < clip.objects.size(); ++o)
    seen.objects.push_back(is_object_in_view(camera, clip.objects[o].gaussians, state.objects[o]));
  for (std::size_t p = 0; p < clip.others.size(); ++p)
    seen.others.push_back(is_human_in_view(camera, clip.others[p].avatar, state.others[p]));
  return seen;
}

void check_first_view(const Clip& clip, const std::string& camera_file) {
  const PartsInView seen = parts_in_view(clip, clip.first);
  if (seen.scene) return;
  if (!seen.human && std::find(seen.objects.begin(), seen.objects.end(), true) == seen.objects.end())
    throw DataError(camera_file +
                    ": nothing is in view in frame 0, neither scene nor human nor objects. The pose must be "
                    "camera_from_world in OpenCV's axes (x right, y down, z forward), in metres");
  log_warning(camera_file + ": none of the scene's " + std::to_string(clip.scene.count()) +
              " Gaussians is in view in frame 0; what a stage is to find by the scene, it cannot");
}

void warn_of_other_first_frame(const Image& drawn, const Image& frame) {
  const Image plain = plain_of(frame);
  const double psnr = psnr_db(drawn, frame), of_plain = psnr_db(plain, frame);
  if (psnr >= of_plain) return;
  log_warning("frame 0 as it is drawn from what is given has a PSNR of " + rounded(psnr, 3) +
              " dB against the video's, less than its mean colour has (" + rounded(of_plain, 3) +
              " dB): scene, camera and the state of frame 0 may not be in one world (metres, z up)");
}

void warn_of_what_is_out_of_view(const Clip& clip, const std::vector<SceneState>& states) {
  std::vector<PartsInView> frames;
  for (const SceneState& state : states) frames.push_back(parts_in_view(clip, state));
  warn_of_none("the scene", clip.scene.count(), frames, [](const PartsInView& seen) { return seen.scene; });
  warn_of_none("the human", clip.avatar.count(), frames, [](const PartsInView& seen) { return seen.human; });
  for (std::size_t o = 0; o < clip.objects.size(); ++o)
    warn_of_none("the object " + json_string(clip.objects[o].name), clip.objects[o].gaussians.count(), frames,
                 [o](const PartsInView& seen) { return seen.objects[o]; });
  for (std::size_t p = 0; p < clip.others.size(); ++p)
    warn_of_none("the person " + json_string(clip.others[p].name), clip.others[p].avatar.count(), frames,
                 [p](const PartsInView& seen) { return seen.others[p]; });
}

}  // namespace hsi4d
