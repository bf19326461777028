#include "pipelines/scan/start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nanoflann.hpp>
#include <unordered_map>

#include <Eigen/LU>

#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/text.h"
#include "splat/files/ply_table.h"
#include "splat/sh_basis.h"

namespace hsi4d {

namespace {

constexpr int kNeighbours = 3;
constexpr double kLeastSize = 1e-7;             // metres
constexpr std::size_t kMostDepths = 4'000'000;  // pixels that are looked at

/// Points as nanoflann wants them.
struct Cloud {
  const std::vector<ColoredPoint>& points;
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const { return points[i].place[static_cast<Index>(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>, Cloud, 3>;

/// The mean distance of each point to its nearest three; of all, where there are fewer.
std::vector<double> spacing_of(const std::vector<ColoredPoint>& points) {
  std::vector<double> spacing(points.size(), 1);
  if (points.size() < 2) return spacing;
  const Cloud cloud{points};
  const Tree tree(3, cloud);
  const std::size_t asked = std::min<std::size_t>(kNeighbours + 1, points.size());
  parallel_for(std::ssize(points), 1024, [&](Index begin, Index end) {
    std::array<std::uint32_t, kNeighbours + 1> rows{};
    std::array<double, kNeighbours + 1> squared{};
    for (Index i = begin; i < end; ++i) {
      tree.knnSearch(points[static_cast<std::size_t>(i)].place.data(), asked, rows.data(), squared.data());
      double sum = 0;
      for (std::size_t k = 1; k < asked; ++k) sum += std::sqrt(squared[k]);  // the first is the point itself
      spacing[static_cast<std::size_t>(i)] = sum / static_cast<double>(asked - 1);
    }
  });
  return spacing;
}

std::vector<Vector3<double>> centers_of(const std::vector<Camera>& cameras) {
  std::vector<Vector3<double>> centers;
  for (const Camera& camera : cameras) centers.push_back(camera_center_world(camera));
  return centers;
}

Vector3<double> mean_of(const std::vector<Vector3<double>>& points) {
  Vector3<double> sum = Vector3<double>::Zero();
  for (const Vector3<double>& point : points) sum += point;
  return points.empty() ? sum : Vector3<double>(sum / static_cast<double>(points.size()));
}

/// Mean place and colour of the pixels in a voxel.
struct Voxel {
  Vector3<double> place = Vector3<double>::Zero();
  Vector3<double> color = Vector3<double>::Zero();
  double count = 0;
};

/// A point that a pixel shows, and how far away.
struct SeenPoint {
  ColoredPoint point;
  double depth = 0;
};

/// A cube of a grid: of which grid, and where.
using Cell = std::array<std::int64_t, 4>;

/// Grids are twice as coarse for each doubling of the depth beyond `near`, as pixels are.
Cell cell_of(const SeenPoint& seen, double voxel, double near) {
  const int level = std::max(0, static_cast<int>(std::ceil(std::log2(seen.depth / near))));
  Cell cell{level};
  for (std::size_t k = 0; k < 3; ++k)
    cell[k + 1] =
        static_cast<std::int64_t>(std::floor(seen.point.place[static_cast<Index>(k)] / std::ldexp(voxel, level)));
  return cell;
}

struct CellHash {
  std::size_t operator()(const Cell& cell) const {
    std::uint64_t hash = 0;
    for (const std::int64_t x : cell) hash = (hash ^ static_cast<std::uint64_t>(x)) * 0x9E3779B97F4A7C15u;
    return hash ^ hash >> 31;
  }
};

/// One point a voxel, in the order in which voxels were met first; nothing where there are more than `most`.
std::vector<ColoredPoint> thinned(const std::vector<SeenPoint>& points, double voxel, double near, Index most) {
  std::unordered_map<Cell, std::size_t, CellHash> rows;
  std::vector<Voxel> voxels;
  for (const SeenPoint& seen : points) {
    const auto [at, is_new] = rows.emplace(cell_of(seen, voxel, near), voxels.size());
    if (is_new) voxels.emplace_back();
    if (std::ssize(voxels) > most) return {};
    const ColoredPoint& point = seen.point;
    Voxel& sum = voxels[at->second];
    sum.place += point.place;
    sum.color += Vector3<double>(point.color[0], point.color[1], point.color[2]);
    ++sum.count;
  }
  std::vector<ColoredPoint> result;
  for (const Voxel& sum : voxels) {
    const Vector3<double> color = sum.color / sum.count;
    result.push_back({sum.place / sum.count,
                      {static_cast<float>(color[0]), static_cast<float>(color[1]), static_cast<float>(color[2])}});
  }
  return result;
}

/// Places of pixels that have a depth, of every n-th where there are too many to look at.
std::vector<SeenPoint> places_of_pixels(const std::vector<Photo>& photos) {
  std::size_t pixels = 0;
  for (const Photo& photo : photos)
    pixels += static_cast<std::size_t>(photo.camera.width) * static_cast<std::size_t>(photo.camera.height);
  const std::size_t stride = pixels / kMostDepths + 1;
  std::vector<SeenPoint> points;
  std::size_t pixel = 0;
  for (const Photo& photo : photos) {
    const Rigid<double> world_from_camera = inverse(photo.camera.camera_from_world);
    for (int y = 0; y < photo.camera.height; ++y) {
      for (int x = 0; x < photo.camera.width; ++x) {
        if (pixel++ % stride != 0) continue;
        const double depth = photo.depth(0, y, x);
        if (!(depth > 0) || (!photo.alpha.empty() && photo.alpha(0, y, x) <= 0.5F)) continue;
        const Vector3<double> in_camera = unproject_pixel(photo.camera, Vector2<double>(x + 0.5, y + 0.5), depth);
        points.push_back({{world_from_camera.rotation * in_camera + world_from_camera.translation,
                           {photo.color(0, y, x), photo.color(1, y, x), photo.color(2, y, x)}},
                          depth});
      }
    }
  }
  return points;
}

double median_depth(const std::vector<SeenPoint>& points) {
  if (points.empty()) return 1;
  std::vector<double> depths;
  for (const SeenPoint& seen : points) depths.push_back(seen.depth);
  const auto middle = depths.begin() + std::ssize(depths) / 2;
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

/// A box of random places: of a scene as far as its cameras see sharply, of an object what all of them look at.
std::array<Vector3<double>, 2> box_of(const ScanSettings& settings, const std::vector<Camera>& cameras) {
  if (settings.start.box) {
    const std::array<double, 6>& b = *settings.start.box;
    return {Vector3<double>(b[0], b[1], b[2]), Vector3<double>(b[3], b[4], b[5])};
  }
  const double extent = extent_of(cameras);
  constexpr double kOfScene = 1.5, kOfObject = 0.5;  // extents
  const Vector3<double> center = looked_at(cameras);
  const Vector3<double> half =
      Vector3<double>::Constant(extent * (settings.kind == ScanKind::kScene ? kOfScene : kOfObject));
  return {center - half, center + half};
}

std::vector<ColoredPoint> random_points(const ScanSettings& settings, const std::vector<Camera>& cameras) {
  const auto [low, high] = box_of(settings, cameras);
  const Random random(static_cast<std::uint64_t>(settings.seed), random_stream("scan.start"));
  std::vector<ColoredPoint> points(static_cast<std::size_t>(settings.start.count));
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (Index k = 0; k < 3; ++k) {
      const double share = random.uniform(6 * i + static_cast<std::size_t>(k));
      points[i].place[k] = low[k] + share * (high[k] - low[k]);
      points[i].color[static_cast<std::size_t>(k)] = random.uniform<float>(6 * i + 3 + static_cast<std::size_t>(k));
    }
  }
  return points;
}

bool all_have_depth(const std::vector<Photo>& photos) {
  return std::all_of(photos.begin(), photos.end(), [](const Photo& photo) { return !photo.depth.empty(); });
}

ScanStartKind kind_of_start(const ScanSettings& settings, const PosedImages& set, const std::vector<Photo>& photos) {
  if (settings.start.from != ScanStartKind::kAuto) return settings.start.from;
  if (!settings.start.points.empty()) return ScanStartKind::kPoints;
  if (!set.points.empty()) return ScanStartKind::kPoints;
  return all_have_depth(photos) ? ScanStartKind::kDepth : ScanStartKind::kRandom;
}

}  // namespace

Vector3<double> looked_at(const std::vector<Camera>& cameras) {
  Matrix3<double> sum = Matrix3<double>::Zero();
  Vector3<double> right = Vector3<double>::Zero();
  for (const Camera& camera : cameras) {
    const Vector3<double> axis = camera.camera_from_world.rotation.row(2).transpose().normalized();
    const Matrix3<double> across = Matrix3<double>::Identity() - axis * axis.transpose();
    sum += across;
    right += across * camera_center_world(camera);
  }
  constexpr double kParallel = 1e-9;
  if (sum.determinant() < kParallel * std::pow(static_cast<double>(cameras.size()), 3))
    return mean_of(centers_of(cameras));
  return sum.inverse() * right;
}

double extent_of(const std::vector<Camera>& cameras) {
  const std::vector<Vector3<double>> centers = centers_of(cameras);
  const Vector3<double> mean = mean_of(centers), target = looked_at(cameras);
  double spread = 0, distance = 0;
  for (const Vector3<double>& center : centers) {
    spread = std::max(spread, (center - mean).norm());
    distance += (center - target).norm() / static_cast<double>(centers.size());
  }
  return std::max(1.1 * spread, 0.1 * distance);
}

std::vector<ColoredPoint> read_point_cloud(const std::filesystem::path& file) {
  const std::string name = file.string();
  const Bytes bytes = read_file(name);
  const PlyHeader header = read_ply_header(bytes, name);
  const int element = header.find("vertex");
  if (element < 0) throw DataError(name + ": there is no element \"vertex\"; a file of points has one");
  const PlyElement& vertex = header.elements[static_cast<std::size_t>(element)];
  std::vector<int> columns;
  for (const char* property : {"x", "y", "z"}) {
    columns.push_back(vertex.find(property));
    if (columns.back() < 0) throw DataError(name + ": element \"vertex\" has no property \"" + property + "\"");
  }
  bool has_colors = true;
  for (const char* property : {"red", "green", "blue"}) has_colors = has_colors && vertex.find(property) >= 0;
  for (const char* property : {"red", "green", "blue"}) {
    if (has_colors) columns.push_back(vertex.find(property));
  }
  std::vector<ColoredPoint> points;
  Index dropped = 0;
  read_ply_rows(bytes, header, name, element, columns, [&](Index, std::span<const double> values) {
    ColoredPoint point{Vector3<double>(values[0], values[1], values[2])};
    for (std::size_t c = 0; has_colors && c < 3; ++c)
      point.color[c] = static_cast<float>(std::clamp(values[3 + c] / 255, 0.0, 1.0));
    if (point.place.allFinite()) {
      points.push_back(point);
    } else {
      ++dropped;
    }
  });
  if (dropped > 0)
    log_warning(name + ": " + std::to_string(dropped) + " points are at no finite place and are left out");
  return points;
}

std::vector<ColoredPoint> points_of_depths(const ScanStart& settings, const std::vector<Photo>& photos) {
  const std::vector<SeenPoint> places = places_of_pixels(photos);
  const double cube_root = std::cbrt(2.0), near = median_depth(places);
  double voxel = settings.voxel;
  std::vector<ColoredPoint> points = thinned(places, voxel, near, settings.count);
  while (points.empty() && !places.empty()) points = thinned(places, voxel *= cube_root, near, settings.count);
  if (voxel > settings.voxel)
    log_info("start: voxels of " + rounded(voxel, 3) + " m in place of " + rounded(settings.voxel, 3) +
             ", for at most " + std::to_string(settings.count) + " Gaussians");
  return points;
}

Gaussians gaussians_at(const std::vector<ColoredPoint>& points, const ScanStart& settings, int sh_degree,
                       const Vector3<double>& origin) {
  Gaussians result;
  result.sh_degree = sh_degree;
  result.origin_world = origin;
  const std::vector<double> spacing = spacing_of(points);
  const auto logit = static_cast<float>(std::log(settings.opacity / (1 - settings.opacity)));
  const std::size_t coefficients = static_cast<std::size_t>(result.sh_coefficients());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3<double> place = points[i].place - origin;
    const auto size = static_cast<float>(std::log(std::max(settings.size * spacing[i], kLeastSize)));
    for (Index k = 0; k < 3; ++k) result.means.push_back(static_cast<float>(place[k]));
    result.log_scales.insert(result.log_scales.end(), 3, size);
    result.quats.insert(result.quats.end(), {1, 0, 0, 0});
    result.opacity_logits.push_back(logit);
    for (std::size_t c = 0; c < 3; ++c) result.sh.push_back(static_cast<float>((points[i].color[c] - 0.5) / kShC0));
    result.sh.insert(result.sh.end(), 3 * (coefficients - 1), 0.0F);
  }
  return result;
}

Gaussians first_gaussians(const ScanSettings& settings, const PosedImages& set, const std::vector<Photo>& photos) {
  std::vector<Camera> cameras;
  for (const Photo& photo : photos) cameras.push_back(photo.camera);
  std::vector<ColoredPoint> points;
  const ScanStartKind kind = kind_of_start(settings, set, photos);
  switch (kind) {
    case ScanStartKind::kDepth:
      if (!all_have_depth(photos))
        throw UserError(settings.file.string() + ": /start/from: not every picture of " + set.file.string() +
                        " has depths; allowed: points, random, auto");
      points = points_of_depths(settings.start, photos);
      break;
    case ScanStartKind::kPoints:
      points = settings.start.points.empty() ? set.points : read_point_cloud(settings.start.points);
      break;
    default:
      points = random_points(settings, cameras);
  }
  if (points.empty())
    throw UserError(set.file.string() +
                    ": there is no point to begin with; /start/points names a PLY of points, "
                    "/start/from \"random\" takes random places");
  log_info("start: " + std::to_string(points.size()) + " Gaussians from " +
           std::string(choice_name<ScanStartKind>(kScanStartKinds, kind)));
  if (settings.density.method != DensityMethod::kNone && std::ssize(points) > settings.density.most)
    throw UserError(settings.file.string() + ": /density/most: is " + std::to_string(settings.density.most) +
                    "; the start has " + std::to_string(points.size()) + " points already");
  return gaussians_at(points, settings.start, settings.sh_degree, mean_of(centers_of(cameras)));
}

}  // namespace hsi4d
