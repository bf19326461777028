#include "pipelines/draw/track_points.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "core/check.h"
#include "core/log.h"
#include "core/rotation.h"
#include "pipelines/draw/posed_avatar.h"

namespace hsi4d {

namespace {

/// Least opacity of a pixel, and least volume that a body's transform may leave of one, to be followed.
constexpr double kLeastOpacity = 0.5, kLeastVolume = 1e-3;

/// Everything in a state: the scene, then objects, then the human.
struct DrawnParts {
  PosedGaussians all;
  std::vector<Index> ends;  ///< of the rows of each part
  std::vector<double> human_transforms;

  DrawnParts(const Clip& clip, const SceneState& state)
      : human_transforms(blended_transforms(clip.avatar, state.body)) {
    std::vector<PosedGaussians> parts;
    parts.push_back({clip.scene, {}});
    for (std::size_t o = 0; o < clip.objects.size(); ++o)
      parts.push_back(posed_object(clip.objects[o].gaussians, state.objects[o]));
    parts.push_back({rest_gaussians(clip.avatar), human_transforms});
    Index rows = 0;
    for (const PosedGaussians& part : parts) ends.push_back(rows += part.gaussians.count());
    all = concatenated(parts);
  }
  std::size_t part_of(Index row) const {
    return static_cast<std::size_t>(std::upper_bound(ends.begin(), ends.end(), row) - ends.begin());
  }
};

/// What weighs most in a pixel.
struct SeenPart {
  std::size_t part = 0;
  Index row = 0;  ///< of all parts
  double depth = 0;
  double opacity = 0;  ///< of the pixel
};

SeenPart seen_part(const PixelTrace& trace, const DrawnParts& parts) {
  struct Sum {
    double weight = 0, depths = 0, largest = 0;
    Index row = 0;
  };
  std::vector<Sum> sums(parts.ends.size());
  for (const PixelSplat& splat : trace.composited) {
    Sum& sum = sums[parts.part_of(splat.index)];
    sum.weight += splat.weight();
    sum.depths += splat.weight() * splat.depth;
    if (splat.weight() <= sum.largest) continue;
    sum.largest = splat.weight();
    sum.row = splat.index;
  }
  const auto most =
      std::max_element(sums.begin(), sums.end(), [](const Sum& a, const Sum& b) { return a.weight < b.weight; });
  return {static_cast<std::size_t>(most - sums.begin()), most->row, most->weight > 0 ? most->depths / most->weight : 0,
          1 - trace.transmittance};
}

/// Where a point of the world is at rest, of what the rows [3,4] take into the world; false where that is not known.
bool to_rest(const double* rows, Vector3<double>& point) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> transform(rows);
  const Matrix3<double> linear = transform.leftCols<3>();
  if (!(std::abs(linear.determinant()) >= kLeastVolume)) return false;
  point = linear.inverse() * (point - transform.col(3));
  return true;
}

Vector3<double> mean_of_row(const std::vector<float>& means, Index row) {
  return Vector3<float>(means.data() + 3 * row).cast<double>();
}

/// Finds the points of tracks that begin in one frame.
class FrameBinding {
 public:
  FrameBinding(const Clip& clip, const SceneState& state) : clip_(clip), state_(state), parts_(clip, state) {
    camera_ = clip.camera;
    camera_.camera_from_world = state.camera_from_world;
  }

  /// @param tracks  that begin in the frame
  std::vector<TrackPoint> points(const std::vector<Index>& tracks, const std::vector<TrackPlace>& places,
                                 const RenderSettings& render) {
    std::vector<PixelPlace> pixels;
    for (const Index track : tracks) pixels.push_back(pixel_of(places[static_cast<std::size_t>(track)]));
    const SceneImage drawn = render_scene(parts_.all, {camera_, {}, render, Precision::kFloat}, pixels);
    std::vector<TrackPoint> found;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      const TrackPlace& place = places[static_cast<std::size_t>(tracks[i])];
      TrackPoint point{tracks[i]};
      if (bind(seen_part(drawn.traces[i], parts_), place, point)) found.push_back(point);
    }
    return found;
  }

  /// "of 9 tracks that begin in frame 0, 4 follow the human, 2 box, 3 nothing that moves"
  std::string text(Index frame, std::size_t tracks, const std::vector<TrackPoint>& found) const {
    std::string text = "of " + std::to_string(tracks) + " tracks that begin in frame " + std::to_string(frame) + ", ";
    const auto add = [&](Index object, const std::string& name) {
      const auto is_of = [object](const TrackPoint& point) { return point.object == object; };
      text += std::to_string(std::count_if(found.begin(), found.end(), is_of)) + " follow " + name + ", ";
    };
    add(std::ssize(clip_.objects), "the human");
    for (std::size_t o = 0; o < clip_.objects.size(); ++o) add(static_cast<Index>(o), clip_.objects[o].name);
    return text + std::to_string(tracks - found.size()) + " nothing that moves";
  }

 private:
  PixelPlace pixel_of(const TrackPlace& place) const {
    const auto within = [](double share, int size) {
      return std::clamp(static_cast<int>(std::floor(share * size)), 0, size - 1);
    };
    return {within(place.x, camera_.width), within(place.y, camera_.height)};
  }
  bool bind(const SeenPart& seen, const TrackPlace& place, TrackPoint& point) const {
    if (seen.part == 0 || seen.opacity < kLeastOpacity) return false;
    const Vector3<double> in_camera((place.x * camera_.width - camera_.cx) / camera_.fx * seen.depth,
                                    (place.y * camera_.height - camera_.cy) / camera_.fy * seen.depth, seen.depth);
    Vector3<double> at = transform_point(inverse(camera_.camera_from_world), in_camera);
    point.object = static_cast<Index>(seen.part) - 1;
    point.row = seen.row - parts_.ends[seen.part - 1];
    if (point.object == std::ssize(clip_.objects)) {
      if (!to_rest(parts_.human_transforms.data() + 12 * point.row, at)) return false;
      point.offset = at - mean_of_row(clip_.avatar.means, point.row);
      return true;
    }
    const auto o = static_cast<std::size_t>(point.object);
    const ObjectPose& pose = state_.objects[o];
    at = so3_exp(pose.rotation).transpose() * (at - pose.translation);
    point.offset = at - mean_of_row(clip_.objects[o].gaussians.means, point.row);
    return true;
  }

  const Clip& clip_;
  const SceneState& state_;
  DrawnParts parts_;
  Camera camera_;
};

}  // namespace

const std::vector<TrackPoint>& TrackPoints::of(const Clip& clip, const RenderSettings& render,
                                               std::span<const SceneState> done) {
  HSI4D_CHECK(clip.tracks.has_value(), "a clip without tracks");
  const PointTracks& tracks = *clip.tracks;
  for (; frames_ < done.size(); ++frames_) {
    std::vector<Index> begin;
    for (Index n = 0; n < tracks.count(); ++n) {
      const std::vector<TrackPlace>& places = tracks.frames[frames_];
      const TrackPlace& place = places[static_cast<std::size_t>(n)];
      const bool is_inside = place.x >= 0 && place.x < 1 && place.y >= 0 && place.y < 1;
      if (tracks.begin(n) == static_cast<Index>(frames_) && is_inside) begin.push_back(n);
    }
    if (begin.empty()) continue;
    FrameBinding binding(clip, done[frames_]);
    const std::vector<TrackPoint> found = binding.points(begin, tracks.frames[frames_], render);
    log_info("data.tracks: " + binding.text(static_cast<Index>(frames_), begin.size(), found));
    points_.insert(points_.end(), found.begin(), found.end());
  }
  return points_;
}

}  // namespace hsi4d
