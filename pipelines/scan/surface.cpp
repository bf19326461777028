#include "pipelines/scan/surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/camera_places.h"
#include "core/check.h"
#include "core/log.h"
#include "pipelines/draw/median_depth.h"
#include "pipelines/scan/align.h"

namespace hsi4d {

namespace {

using Points = std::vector<Vector3<double>>;

/// Low and high corner.
struct Box {
  Vector3<double> low, high;
};

/// Depths of all cameras, in turn.
std::vector<DepthView> depths_of(const Gaussians& gaussians, const std::vector<Camera>& cameras,
                                 const SurfaceSettings& settings, const Observer& observer) {
  Progress shown("views", std::ssize(cameras), observer.progress, observer.progress_interval);
  std::vector<DepthView> views;
  for (const Camera& camera : cameras) {
    if (observer.wants_stop()) throw Interrupted("interrupted while depths were made; nothing is left of them");
    SceneView view;
    view.camera = reduced_camera(camera, settings.size_px);
    view.settings = settings.render;
    views.push_back({view.camera, median_depths(gaussians, view)});
    shown.step();
  }
  return views;
}

double median_of_depths(const std::vector<DepthView>& views) {
  std::vector<float> depths;
  for (const DepthView& view : views) {
    for (const float depth : view.depths) {
      if (depth > 0) depths.push_back(depth);
    }
  }
  if (depths.empty()) throw UserError("the cameras see nothing that stops half of the light");
  const auto middle = depths.begin() + std::ssize(depths) / 2;
  std::nth_element(depths.begin(), middle, depths.end());
  return static_cast<double>(*middle);
}

/// Every few pixels, where they show something that is no far background.
Points seen_points(const std::vector<DepthView>& views) {
  constexpr Index kEvery = 5;  // pixels
  constexpr double kFar = 3;   // median depths
  const double farthest = kFar * median_of_depths(views);
  Points points;
  for (const DepthView& view : views) {
    const Rigid<double> world_from_camera = inverse(view.camera.camera_from_world);
    for (Index y = 0; y < view.camera.height; y += kEvery) {
      for (Index x = 0; x < view.camera.width; x += kEvery) {
        const double depth = static_cast<double>(view.depths[static_cast<std::size_t>(y * view.camera.width + x)]);
        if (depth <= 0 || depth > farthest) continue;
        const Vector2<double> pixel(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
        points.push_back(transform_point(world_from_camera, unproject_pixel(view.camera, pixel, depth)));
      }
    }
  }
  return points;
}

/// The box of nearly all points, and a little more.
Box box_around(const Points& points) {
  constexpr double kLeftOut = 0.001, kMore = 0.03;  // shares: of points at each end, of the longest side
  Box box;
  std::vector<double> along(points.size());
  for (Index axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < points.size(); ++i) along[i] = points[i][axis];
    std::sort(along.begin(), along.end());
    const auto last = static_cast<double>(along.size() - 1);
    box.low[axis] = along[static_cast<std::size_t>(kLeftOut * last)];
    box.high[axis] = along[static_cast<std::size_t>((1 - kLeftOut) * last)];
  }
  const double more = kMore * (box.high - box.low).maxCoeff();
  return {box.low - Vector3<double>::Constant(more), box.high + Vector3<double>::Constant(more)};
}

/// With the given cameras, around which something is free.
Box box_of(const SurfaceSettings& settings, const std::vector<DepthView>& views) {
  if (!settings.box) {
    Box box = box_around(seen_points(views));
    for (const Camera& camera : settings.is_object ? std::vector<Camera>{} : settings.cameras) {
      box.low = box.low.cwiseMin(camera_center_world(camera));
      box.high = box.high.cwiseMax(camera_center_world(camera));
    }
    return box;
  }
  const std::array<double, 6>& b = *settings.box;
  return {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
}

FusionSettings fusion_of(const SurfaceSettings& settings, const Box& box) {
  FusionSettings fusion;
  fusion.low = box.low;
  fusion.high = box.high;
  const double along = settings.is_object ? kVoxelsAlongObject : kVoxelsAlongRoom;
  fusion.voxel = settings.voxel.value_or((box.high - box.low).maxCoeff() / along);
  fusion.is_outside_free = settings.is_object;
  return fusion;
}

/// Around what is opaque.
std::vector<Camera> cameras_around_object(const Gaussians& gaussians, const SurfaceSettings& settings) {
  const Points points = solid_points(gaussians);
  if (points.empty()) throw UserError("there is no Gaussian of opacity above 0.5: nothing is solid");
  const Box box = box_around(points);
  const Vector3<double> center = 0.5 * (box.low + box.high);
  return cameras_around(center, 0.5 * (box.high - box.low).norm(), settings.more_views, settings.size_px, kAllSides);
}

void append(std::vector<DepthView> more, std::vector<DepthView>& views) {
  views.insert(views.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

/// Halfway to what some pixels of each view show: a camera itself may stand where no view looks.
Points free_places(const std::vector<DepthView>& views) {
  constexpr Index kAcross = 4;  // pixels of a row
  Points places;
  for (const DepthView& view : views) {
    const Camera& camera = view.camera;
    const Rigid<double> world_from_camera = inverse(camera.camera_from_world);
    for (Index n = 0; n < kAcross * kAcross; ++n) {
      const Index x = (2 * (n % kAcross) + 1) * camera.width / (2 * kAcross),
                  y = (2 * (n / kAcross) + 1) * camera.height / (2 * kAcross);
      const double depth = static_cast<double>(view.depths[static_cast<std::size_t>(y * camera.width + x)]);
      const Vector2<double> pixel(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      if (depth > 0) places.push_back(transform_point(world_from_camera, unproject_pixel(camera, pixel, 0.5 * depth)));
    }
  }
  return places;
}

/// Whether nothing solid is within `clearance`, as far as 26 directions tell.
bool is_clear(const SolidGrid& grid, const Vector3<double>& place, double clearance) {
  for (int n = 0; n < 27; ++n) {
    const Vector3<double> way(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
    const double length = n == 13 ? 0 : clearance / way.norm();
    if (grid.at(Vector3<double>(place + length * way)) <= 0) return false;
  }
  return true;
}

/// A lattice of free places.
Points clear_places(const SolidGrid& grid, double clearance) {
  const double side = static_cast<double>(kSolidBlock) * grid.voxel;
  const double step = std::max(clearance, side);
  const auto count = [&](Index axis) {
    return static_cast<Index>(std::floor(side * grid.blocks[static_cast<std::size_t>(axis)] / step));
  };
  Points places;
  for (Index i = 0; i < count(0); ++i) {
    for (Index j = 0; j < count(1); ++j) {
      for (Index k = 0; k < count(2); ++k) {
        const Vector3<double> place =
            grid.origin +
            step * Vector3<double>(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
        if (is_clear(grid, place, clearance)) places.push_back(place);
      }
    }
  }
  return places;
}

ScannedSolid object_solid_of(const Gaussians& gaussians, const SurfaceSettings& settings, const Observer& observer) {
  ScannedSolid result;
  std::vector<Camera> cameras = settings.cameras;
  for (const Camera& camera : cameras_around_object(gaussians, settings)) cameras.push_back(camera);
  result.views = depths_of(gaussians, cameras, settings, observer);
  result.grid = fused(result.views, fusion_of(settings, box_of(settings, result.views)));
  return result;
}

ScannedSolid room_solid_of(const Gaussians& gaussians, const SurfaceSettings& settings, const Observer& observer) {
  constexpr double kCoarse = 3;        // voxels of the first look, of the last
  constexpr double kClearance = 0.04;  // of the box's longest side
  constexpr Index kSides = 6;
  if (settings.cameras.empty())
    throw UserError("where is free space? A scene needs the cameras that took its pictures");
  ScannedSolid result;
  result.views = depths_of(gaussians, settings.cameras, settings, observer);
  const Box box = box_of(settings, result.views);
  FusionSettings fusion = fusion_of(settings, box);
  if (settings.more_views > 0) {
    FusionSettings first = fusion;
    first.voxel *= kCoarse;
    SolidGrid coarse = fused(result.views, first);
    clean_up(coarse, free_places(result.views), 0);
    const double clearance = kClearance * (box.high - box.low).maxCoeff();
    std::vector<Camera> cameras;
    for (const Vector3<double>& eye :
         more_eyes(coarse, settings.cameras, (settings.more_views + kSides - 1) / kSides, clearance)) {
      for (const Camera& camera : cameras_to_all_sides(eye, settings.size_px)) cameras.push_back(camera);
    }
    if (std::ssize(cameras) < settings.more_views)
      log_warning("there is room for " + std::to_string(cameras.size()) +
                  " more views in free space; asked for: " + std::to_string(settings.more_views));
    append(depths_of(gaussians, cameras, settings, observer), result.views);
  }
  result.grid = fused(result.views, fusion);
  return result;
}

}  // namespace

std::vector<Vector3<double>> more_eyes(const SolidGrid& grid, const std::vector<Camera>& cameras, Index count,
                                       double clearance) {
  const Points places = clear_places(grid, clearance);
  std::vector<double> nearest(places.size(), std::numeric_limits<double>::infinity());  // eye
  const auto add = [&](const Vector3<double>& eye) {
    for (std::size_t i = 0; i < places.size(); ++i)
      nearest[i] = std::min(nearest[i], Vector3<double>(places[i] - eye).squaredNorm());
  };
  for (const Camera& camera : cameras) add(camera_center_world(camera));
  Points eyes;
  while (std::ssize(eyes) < std::min(count, std::ssize(places))) {
    const auto farthest = static_cast<std::size_t>(std::max_element(nearest.begin(), nearest.end()) - nearest.begin());
    eyes.push_back(places[farthest]);
    add(places[farthest]);
  }
  return eyes;
}

ScannedSolid scanned_solid(const Gaussians& gaussians, const SurfaceSettings& settings, const Observer& observer) {
  ScannedSolid result = settings.is_object ? object_solid_of(gaussians, settings, observer)
                                           : room_solid_of(gaussians, settings, observer);
  result.cleaned = clean_up(result.grid, free_places(result.views), settings.smallest);
  return result;
}

}  // namespace hsi4d
