// Fused depths: against a sum over all views at every node, and against shapes whose distance is known.
#include "optim/solid/depth_fusion.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/camera_places.h"
#include "core/check.h"
#include "core/parallel.h"

namespace depth_fusion_test {

using namespace hsi4d;

namespace {

constexpr double kRadius = 0.5;

/// Exact depths of a ball at the origin.
DepthView ball_view(const Camera& camera) {
  DepthView view{camera, {}};
  const Vector3<double> middle = transform_point(camera.camera_from_world, Vector3<double>(0, 0, 0));
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Vector3<double> ray = unproject_pixel(camera, Vector2<double>(x + 0.5, y + 0.5), 1.0);
      const double a = ray.squaredNorm(), b = ray.dot(middle), c = middle.squaredNorm() - kRadius * kRadius;
      const double root = b * b - a * c;
      view.depths.push_back(root > 0 ? static_cast<float>((b - std::sqrt(root)) / a) : 0.0F);
    }
  }
  return view;
}

/// Exact depths inside of the box [−1, 1]³.
DepthView room_view(const Camera& camera) {
  DepthView view{camera, {}};
  const Vector3<double> eye = camera_center_world(camera);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Vector3<double> ray = camera.camera_from_world.rotation.transpose() *
                                  unproject_pixel(camera, Vector2<double>(x + 0.5, y + 0.5), 1.0);
      double depth = 1e9;
      for (Index i = 0; i < 3; ++i) {
        if (ray[i] != 0) depth = std::min(depth, ((ray[i] > 0 ? 1 : -1) - eye[i]) / ray[i]);
      }
      view.depths.push_back(static_cast<float>(depth));
    }
  }
  return view;
}

std::vector<DepthView> ball_views(Index count, int size_px) {
  std::vector<DepthView> views;
  for (const Camera& camera : cameras_around(Vector3<double>::Zero(), kRadius, count, size_px, kAllSides))
    views.push_back(ball_view(camera));
  return views;
}

std::vector<DepthView> room_views(int size_px) {
  std::vector<DepthView> views;
  for (const Vector3<double>& eye : {Vector3<double>(0.2, 0.1, 0.3), Vector3<double>(-0.5, 0.4, -0.2)}) {
    for (const Camera& camera : cameras_to_all_sides(eye, size_px)) views.push_back(room_view(camera));
  }
  return views;
}

FusionSettings box_of(double half, double voxel) {
  FusionSettings settings;
  settings.voxel = voxel;
  settings.low = Vector3<double>(-half - 0.0013, -half + 0.0029, -half - 0.0007);  // no node on a pixel's edge
  settings.high = Vector3<double>::Constant(half);
  return settings;
}

/// |n·r| of a pixel: n from its place and those of the nearer of its neighbours to either side.
double slant_of(const DepthView& view, int x, int y) {
  const Camera& c = view.camera;
  const auto place = [&](int i, int j) {
    const int row = std::clamp(j, 0, c.height - 1), col = std::clamp(i, 0, c.width - 1);
    const float d = view.depths[static_cast<std::size_t>(row * c.width + col)];
    const double z = d > 0 ? static_cast<double>(d) : std::numeric_limits<double>::infinity();
    return Vector3<double>(z * (i + 0.5 - c.cx) / c.fx, z * (j + 0.5 - c.cy) / c.fy, z);
  };
  const Vector3<double> own = place(x, y);
  if (std::isinf(own[2])) return 1;
  Vector3<double> along[2];
  for (int axis = 0; axis < 2; ++axis) {
    const Vector3<double> a = own - place(x - (1 - axis), y - axis), b = place(x + (1 - axis), y + axis) - own;
    along[axis] = std::abs(a[2]) < std::abs(b[2]) ? a : b;
  }
  const Vector3<double> normal = cross(along[0], along[1]);
  const double slant = std::abs(dot(normal, own)) / normal.norm() / own[2];
  return std::isfinite(slant) ? static_cast<double>(static_cast<float>(std::clamp(slant, 0.25, 1.0))) : 1;
}

/// Every view asked at a node, by the formula alone; the four pixels around are one surface where they differ by less
/// than two truncations; else the nearest of them counts.
double said_of_node(const std::vector<DepthView>& views, const Vector3<double>& node, double t) {
  double sum = 0, count = 0;
  for (const DepthView& view : views) {
    const Camera& c = view.camera;
    const Vector3<double> p = c.camera_from_world.rotation * node + c.camera_from_world.translation;
    if (p[2] <= 1e-3) continue;
    const double u = c.fx * p[0] / p[2] + c.cx, v = c.fy * p[1] / p[2] + c.cy;
    if (u < 0 || v < 0 || u >= c.width || v >= c.height) continue;
    const auto depth = [&](int x, int y) {
      const float d = view.depths[static_cast<std::size_t>(y * c.width + x)];
      return d > 0 ? static_cast<double>(d) : std::numeric_limits<double>::infinity();
    };
    double seen = depth(static_cast<int>(u), static_cast<int>(v));
    const int x = static_cast<int>(std::floor(u - 0.5)), y = static_cast<int>(std::floor(v - 0.5));
    if (x >= 0 && y >= 0 && x + 1 < c.width && y + 1 < c.height) {
      double low = 1e300, high = 0, mixed = 0;
      for (int i = 0; i < 4; ++i) {
        const double d = depth(x + i % 2, y + i / 2), s = u - 0.5 - x, w = v - 0.5 - y;
        low = std::min(low, d);
        high = std::max(high, d);
        mixed += (i % 2 == 1 ? s : 1 - s) * (i / 2 == 1 ? w : 1 - w) * d;
      }
      seen = high - low <= 2 * t ? mixed : low;
    }
    const double slant = slant_of(view, static_cast<int>(u), static_cast<int>(v)), before = slant * (seen - p[2]);
    if (before < -t) continue;
    const double weight = before >= t ? 1 : slant * slant;
    sum += weight * std::min(before, t);
    count += weight;
  }
  return count == 0 ? -t : sum / count;
}

void check_against_formula(const std::vector<DepthView>& views, const FusionSettings& settings) {
  const SolidGrid grid = fused(views, settings);
  const double t = settings.truncation * settings.voxel;
  Index wrong = 0, looked = 0;
  for (std::int32_t i = 8; i < 8 * (grid.blocks[0] - 1); ++i) {
    for (std::int32_t j = 8; j < 8 * (grid.blocks[1] - 1); ++j) {
      for (std::int32_t k = 8; k < 8 * (grid.blocks[2] - 1); ++k) {
        const double expected = said_of_node(views, grid.place_of_node({i, j, k}), t);
        const double voxels = static_cast<double>(grid.at(NodePlace{i, j, k}));
        wrong += std::abs(voxels * settings.voxel - expected) <= 1e-5 * t ? 0 : 1;
        ++looked;
      }
    }
  }
  CHECK(looked > 10000);
  CHECK(wrong == 0);
}

}  // namespace

TEST_CASE("every node has the mean of what all views say, though most are never asked") {
  check_against_formula(ball_views(7, 40), box_of(0.8, 0.04));
  check_against_formula(room_views(24), box_of(1.2, 0.06));
  std::vector<DepthView> odd = ball_views(3, 33);  // one view has a corner of endless depth in the ball
  for (std::size_t i = 0; i < 200; ++i) odd[1].depths[odd[1].depths.size() / 2 + i] = 0;
  odd[2].camera = cropped(odd[2].camera, 5, 9, 33, 33);
  check_against_formula(odd, box_of(0.7, 0.05));
}

TEST_CASE("a ball from all around has its own distances", "[parallel]") {
  FusionSettings settings = box_of(0.7, 0.02);
  settings.is_outside_free = true;
  const std::vector<DepthView> views = ball_views(60, 128);
  SolidGrid grid;
  with_threads(1, [&] { grid = fused(views, settings); });
  clean_up(grid, {}, 8);
  double worst = 0;
  for (int n = 0; n < 2000; ++n) {
    const double a = 2.4 * n, z = -1 + n / 1000.0, r = std::sqrt(std::max(0.0, 1 - z * z));
    const Vector3<double> way(r * std::cos(a), r * std::sin(a), z);
    worst = std::max(worst, std::abs(grid.at(Vector3<double>(kRadius * way))));
    CHECK(grid.at(Vector3<double>((kRadius + 0.03) * way)) > 0);
    CHECK(grid.at(Vector3<double>((kRadius - 0.03) * way)) < 0);
  }
  CHECK(worst < 0.018);  // less than a voxel; the ball has 50 across
  CHECK(grid.at(Vector3<double>(0, 0, 0)) < 0);
  CHECK(grid.at(Vector3<double>(5, 0, 0)) > 0);
  SolidGrid again;
  with_threads(3, [&] { again = fused(views, settings); });
  clean_up(again, {}, 8);
  CHECK(again.block == grid.block);
  CHECK(again.values == grid.values);
}

TEST_CASE("a room is a hollow: what nobody sees is solid, also beyond the box") {
  const SolidGrid grid = fused(room_views(96), box_of(1.3, 0.03));
  CHECK(grid.at(Vector3<double>(0, 0, 0)) > 0);
  CHECK(grid.at(Vector3<double>(0.95, 0.9, -0.9)) > 0);
  CHECK(grid.at(Vector3<double>(1.05, 0, 0)) < 0);
  CHECK(grid.at(Vector3<double>(-1.2, 1.2, 0)) < 0);
  CHECK(grid.at(Vector3<double>(50, 0, 0)) < 0);
  CHECK(std::abs(grid.at(Vector3<double>(0.3, -0.2, -1))) < 0.005);
}

TEST_CASE("a box without a volume, and one of too many blocks, is refused") {
  const std::vector<DepthView> views = ball_views(2, 16);
  FusionSettings settings = box_of(1, 0.1);
  settings.high[1] = settings.low[1];
  CHECK_THROWS_WITH(fused(views, settings), Catch::Contains(", 0 and 2.0007 m"));
  settings = box_of(100, 1e-3);
  CHECK_THROWS_WITH(fused(views, settings), Catch::Contains("0.001 m is too small") && Catch::Contains("allowed"));
  settings.high[0] = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(fused(views, settings), UserError);
}

}  // namespace depth_fusion_test
