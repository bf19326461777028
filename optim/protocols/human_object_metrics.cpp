#include "optim/protocols/human_object_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "optim/metrics.h"
#include "optim/protocols/surface_points.h"
#include "optim/similarity.h"

namespace hsi4d {
namespace {

/// Points, as nanoflann reads them.
struct PointCloud {
  std::span<const double> numbers;  // [N,3]
  std::size_t kdtree_get_point_count() const { return numbers.size() / 3; }
  double kdtree_get_pt(std::size_t point, std::size_t axis) const { return numbers[3 * point + axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using PointTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointCloud>, PointCloud, 3>;

/// The mean distance of points from the nearest of a cloud.
double mean_nearest(std::span<const double> points, const PointTree& tree) {
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); i += 3) {
    std::uint32_t nearest = 0;
    double squared = 0;
    tree.knnSearch(points.data() + i, 1, &nearest, &squared);
    sum += std::sqrt(squared);
  }
  return sum / static_cast<double>(points.size() / 3);
}

bool are_finite(std::span<const double> points) {
  return std::all_of(points.begin(), points.end(), [](double x) { return std::isfinite(x); });
}

void check_alike(const std::vector<std::vector<double>>& points, const std::vector<std::vector<double>>& truth) {
  HSI4D_CHECK_EQ(points.size(), truth.size());
  HSI4D_CHECK(!points.empty(), "there is no frame to compare");
  for (std::size_t t = 0; t < points.size(); ++t) {
    HSI4D_CHECK(!points[t].empty() && points[t].size() % 3 == 0, "there are no points [P,3] to compare");
    HSI4D_CHECK_EQ(points[t].size(), points[0].size());
    HSI4D_CHECK_EQ(truth[t].size(), points[0].size());
  }
}

/// Frames [begin, end) that are laid on the truth together.
struct Piece {
  std::size_t begin = 0, end = 0;
  Similarity fit = {};

  std::size_t frames() const { return end - begin; }
};

Similarity fit_of(const HumanObjectMotion& estimate, const HumanObjectMotion& truth, const Piece& piece) {
  std::vector<std::span<const double>> from, to;
  for (const auto part : {&HumanObjectMotion::human, &HumanObjectMotion::object}) {
    for (std::size_t t = piece.begin; t < piece.end; ++t) {
      from.emplace_back((estimate.*part)[t]);
      to.emplace_back((truth.*part)[t]);
    }
  }
  return fit_similarity(from, to, FitScale::kFree);
}

std::vector<Piece> pieces_of(const HumanObjectMotion& estimate, const HumanObjectMotion& truth, Index window) {
  std::vector<Piece> pieces;
  const std::size_t frames = truth.human.size();
  for (std::size_t begin = 0; begin < frames; begin += static_cast<std::size_t>(window)) {
    pieces.push_back({begin, std::min(frames, begin + static_cast<std::size_t>(window))});
    pieces.back().fit = fit_of(estimate, truth, pieces.back());
  }
  return pieces;
}

std::vector<double> moved_points(std::vector<double> points, const Similarity& fit) {
  for (std::size_t i = 0; i < points.size(); i += 3) {
    const Vector3<double> place = fit(Vector3<double>(points.data() + i));
    std::copy(place.data(), place.data() + 3, points.data() + i);
  }
  return points;
}

/// Points of a surface; the vertices themselves where there are no triangles.
std::vector<double> compared_points(const std::vector<double>& vertices, const Triangles& faces, std::size_t frame,
                                    const char* stream) {
  if (faces.empty()) return vertices;
  return surface_points(vertices, faces, kSurfacePoints, {frame, random_stream(stream)});
}

std::vector<double> joined_points(std::vector<double> points, const std::vector<double>& more) {
  points.insert(points.end(), more.begin(), more.end());
  return points;
}

/// The chamfer distances of one frame, metres.
HumanObjectErrors frame_distances(const HumanObjectMotion& estimate, const HumanObjectMotion& truth,
                                  const HumanObjectSurfaces& surfaces, std::size_t frame, const Similarity& fit) {
  const std::vector<double> human = compared_points(truth.human[frame], surfaces.human, frame, "metrics.human"),
                            object = compared_points(truth.object[frame], surfaces.object, frame, "metrics.object");
  // Drawn before they are moved: where they lie on the surface does not change with its size.
  const std::vector<double> its_human =
      moved_points(compared_points(estimate.human[frame], surfaces.human, frame, "metrics.estimate.human"), fit);
  const std::vector<double> its_object =
      moved_points(compared_points(estimate.object[frame], surfaces.object, frame, "metrics.estimate.object"), fit);
  HumanObjectErrors errors;
  errors.cd_human = chamfer_distance(its_human, human);
  errors.cd_object = chamfer_distance(its_object, object);
  errors.cd_both = chamfer_distance(joined_points(its_human, its_object), joined_points(human, object));
  return errors;
}

/// The mean acceleration error of a piece, metres a frame²; it has three frames at least.
double acceleration_of(const std::vector<std::vector<double>>& points, const std::vector<std::vector<double>>& truth,
                       const Piece& piece) {
  double sum = 0;
  const auto bend = [](const std::vector<std::vector<double>>& frames, std::size_t t, std::size_t i) {
    const Vector3<double> here(frames[t].data() + i);
    return Vector3<double>((Vector3<double>(frames[t + 1].data() + i) - here) -
                           (here - Vector3<double>(frames[t - 1].data() + i)));
  };
  for (std::size_t t = piece.begin + 1; t + 1 < piece.end; ++t) {
    for (std::size_t i = 0; i < truth[t].size(); i += 3)
      sum += (piece.fit.rotation * bend(points, t, i) * piece.fit.scale - bend(truth, t, i)).norm();
  }
  return sum / static_cast<double>((piece.frames() - 2) * (truth[piece.begin].size() / 3));
}

/// The mean over the frames of all pieces that have one, metres a frame².
std::optional<double> mean_acceleration(const std::vector<std::vector<double>>& points,
                                        const std::vector<std::vector<double>>& truth,
                                        const std::vector<Piece>& pieces) {
  double sum = 0;
  std::size_t frames = 0;
  for (const Piece& piece : pieces) {
    if (piece.frames() < 3) continue;
    sum += acceleration_of(points, truth, piece) * static_cast<double>(piece.frames());
    frames += piece.frames();
  }
  if (frames == 0) return std::nullopt;
  return kCentimetres * sum / static_cast<double>(frames);
}

}  // namespace

double chamfer_distance(std::span<const double> a, std::span<const double> b) {
  HSI4D_CHECK(!a.empty() && !b.empty() && a.size() % 3 == 0 && b.size() % 3 == 0, "there are no points [N,3]");
  if (!are_finite(a) || !are_finite(b)) return std::numeric_limits<double>::quiet_NaN();
  const PointCloud of_a{a}, of_b{b};
  const PointTree in_a(3, of_a), in_b(3, of_b);
  return mean_nearest(a, in_b) + mean_nearest(b, in_a);
}

HumanObjectErrors human_object_errors(const HumanObjectMotion& estimate, const HumanObjectMotion& truth,
                                      const HumanObjectSurfaces& surfaces, Index window) {
  check_alike(estimate.human, truth.human);
  check_alike(estimate.object, truth.object);
  HSI4D_CHECK_EQ(truth.human.size(), truth.object.size());
  HSI4D_CHECK(window > 0, "a piece needs frames");
  const std::vector<Piece> pieces = pieces_of(estimate, truth, window);
  const std::size_t frames = truth.human.size();
  std::vector<HumanObjectErrors> by_frame(frames);
  parallel_for(static_cast<Index>(frames), 1, [&](Index begin, Index end) {
    for (auto t = static_cast<std::size_t>(begin); t < static_cast<std::size_t>(end); ++t) {
      const Similarity& fit = pieces[t / static_cast<std::size_t>(window)].fit;
      by_frame[t] = frame_distances(estimate, truth, surfaces, t, fit);
    }
  });
  HumanObjectErrors errors;
  const double scale = kCentimetres / static_cast<double>(frames);
  for (const HumanObjectErrors& one : by_frame) {
    errors.cd_human += scale * one.cd_human;
    errors.cd_object += scale * one.cd_object;
    errors.cd_both += scale * one.cd_both;
  }
  errors.acceleration_human = mean_acceleration(estimate.human, truth.human, pieces);
  errors.acceleration_object = mean_acceleration(estimate.object, truth.object, pieces);
  return errors;
}

}  // namespace hsi4d
