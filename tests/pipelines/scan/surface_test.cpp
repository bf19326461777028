// Closed surfaces of made scenes and objects against the truth.
#include "pipelines/scan/surface.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "optim/solid/mesh_distance.h"
#include "optim/solid/mesh_topology.h"
#include "optim/solid/solid_mesh.h"
#include "pipelines/synthetic/object.h"
#include "pipelines/synthetic/photos.h"
#include "pipelines/synthetic/scene.h"

namespace surface_test {

using namespace hsi4d;

namespace {

using Point = Vector3<double>;

/// A place on a mesh, every triangle by its area.
std::vector<Point> sampled(const TriangleMesh& mesh, std::size_t count) {
  std::vector<double> until;
  double area = 0;
  const auto corner = [&](std::size_t f, std::size_t i) {
    return mesh.vertices[static_cast<std::size_t>(mesh.faces[f][i])];
  };
  for (std::size_t f = 0; f < mesh.faces.size(); ++f)
    until.push_back(area += cross(Point(corner(f, 1) - corner(f, 0)), Point(corner(f, 2) - corner(f, 0))).norm());
  const Random random(7, random_stream("surface_test"));
  std::vector<Point> points;
  for (std::uint64_t n = 0; n < count; ++n) {
    const double at = random.uniform(3 * n, 0, area);
    const auto f = static_cast<std::size_t>(std::lower_bound(until.begin(), until.end(), at) - until.begin());
    const double a = std::sqrt(random.uniform(3 * n + 1, 0, 1)), b = random.uniform(3 * n + 2, 0, 1);
    points.push_back((1 - a) * corner(f, 0) + a * (1 - b) * corner(f, 1) + a * b * corner(f, 2));
  }
  return points;
}

/// The depth that a view has at a point's pixel and that of the point; none where the point is not in the image.
std::optional<std::pair<double, double>> depths_at(const DepthView& view, const Point& point) {
  const Point p = transform_point(view.camera.camera_from_world, point);
  if (p[2] <= 0.01) return {};
  const Vector2<double> pixel = project_point(view.camera, p);
  if (!(pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] < view.camera.width && pixel[1] < view.camera.height)) return {};
  const auto at = static_cast<std::size_t>(pixel[1]) * static_cast<std::size_t>(view.camera.width) +
                  static_cast<std::size_t>(pixel[0]);
  return std::pair(static_cast<double>(view.depths[at]), p[2]);
}

bool is_seen(const std::vector<DepthView>& views, const Point& point, double within) {
  for (const DepthView& view : views) {
    const auto depths = depths_at(view, point);
    if (depths && std::abs(depths->first - depths->second) < within) return true;
  }
  return false;
}

struct Agreement {
  double near = 0;   ///< share of places on the truth's surface that cameras saw, within a tolerance of the mesh
  double solid = 0;  ///< share of places well inside of the truth that are inside of the mesh
  double free = 0;   ///< share of places well in front of what a camera sees that are outside of it
};

/// @param deep  metres: what counts as well inside, or in front
Agreement agreement(const TriangleMesh& mesh, const TriangleMesh& truth, const std::vector<DepthView>& views,
                    double tolerance, double deep) {
  const MeshDistance made(mesh, 0.1), real(truth, 0.1);
  Agreement result;
  double seen = 0;
  for (const Point& point : sampled(truth, 4000)) {
    if (!is_seen(views, point, tolerance)) continue;
    ++seen;
    result.near += std::abs(made.at(point)) <= tolerance ? 1 : 0;
  }
  result.near /= seen;
  const Random random(8, random_stream("surface_test"));
  Point low = truth.vertices.front(), high = low;
  for (const Point& v : truth.vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  double inside = 0, outside = 0;
  for (std::uint64_t n = 0; n < 20000 && inside < 1000; ++n) {
    Point point;
    for (Index i = 0; i < 3; ++i) point[i] = random.uniform(8 * n + static_cast<std::uint64_t>(i), low[i], high[i]);
    if (!(real.at(point) < -deep)) continue;
    ++inside;
    result.solid += made.at(point) < 0 ? 1 : 0;
  }
  result.solid /= inside;
  for (std::uint64_t n = 0; n < 2000; ++n) {
    const DepthView& view = views[n % views.size()];
    const auto x = static_cast<double>(view.camera.width) * random.uniform(8 * n + 3, 0, 1),
               y = static_cast<double>(view.camera.height) * random.uniform(8 * n + 4, 0, 1);
    const auto at =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(view.camera.width) + static_cast<std::size_t>(x);
    const double end = static_cast<double>(view.depths[at]) - deep;
    if (end <= 0.1) continue;
    const Point seen_at = unproject_pixel(view.camera, Vector2<double>(std::floor(x) + 0.5, std::floor(y) + 0.5),
                                          random.uniform(8 * n + 5, 0.1, end));
    const Point point = transform_point(inverse(view.camera.camera_from_world), seen_at);
    if (real.at(point) < deep) continue;
    ++outside;
    result.free += made.at(point) > 0 ? 1 : 0;
  }
  result.free /= outside;
  return result;
}

void check_closed(const TriangleMesh& mesh) {
  CHECK(bad_vertices(mesh).empty());
  CHECK(count_edges(mesh).open == 0);
}

SurfaceSettings room_settings() {
  SurfaceSettings settings;
  settings.cameras = cameras_in_scene(24, 160, 1);
  settings.voxel = 0.03;
  settings.more_views = 48;
  settings.size_px = 160;
  return settings;
}

}  // namespace

TEST_CASE("a made room becomes one closed hollow that agrees with its furniture", "[parallel]") {
  SyntheticSettings made;
  made.scene = SyntheticSceneKind::kLivingRoom;
  const Gaussians scene = synthetic_scene(made.scene, 40000, {}, 0);
  ScannedSolid solid = scanned_solid(scene, room_settings());
  CHECK(solid.views.size() > 60);
  const TriangleMesh mesh = surface_of(solid.grid, 0);
  check_closed(mesh);
  const std::vector<TriangleMesh> parts = connected_parts(mesh);
  const auto& largest = *std::max_element(parts.begin(), parts.end(),
                                          [](const auto& a, const auto& b) { return a.faces.size() < b.faces.size(); });
  CHECK(signed_volume(largest) < 0);
  CHECK(signed_volume(mesh) < -20);
  const Agreement result = agreement(mesh, synthetic_solids(made, {}), solid.views, 0.03, 0.04);
  CAPTURE(result.near, result.solid, result.free);
  CHECK(result.near > 0.87);
  CHECK(result.solid > 0.97);
  CHECK(result.free > 0.99);
}

TEST_CASE("an object from all around becomes a solid of its size") {
  SyntheticSettings made;
  const SyntheticObject object = synthetic_object(made);
  SurfaceSettings settings;
  settings.is_object = true;
  settings.more_views = 40;
  settings.size_px = 160;
  settings.voxel = 0.005;
  ScannedSolid solid = scanned_solid(object.gaussians, settings);
  const TriangleMesh mesh = surface_of(solid.grid, 0);
  check_closed(mesh);
  const MeshDistance distance(mesh, 0.1);
  Index near = 0;
  const Gaussians& g = object.gaussians;
  for (Index n = 0; n < g.count(); ++n) {
    const Point mean = Vector3<float>(g.means.data() + 3 * n).cast<double>() + g.origin_world;
    near += std::abs(distance.at(mean)) < 0.01 ? 1 : 0;
  }
  CHECK(static_cast<double>(near) > 0.9 * static_cast<double>(g.count()));
  ScannedSolid again;
  with_threads(1, [&] { again = scanned_solid(g, settings); });
  const TriangleMesh same = surface_of(again.grid, 0);
  CHECK(same.vertices == mesh.vertices);
  CHECK(same.faces == mesh.faces);
}

TEST_CASE("a scene without cameras, cameras that see nothing, and nothing opaque are refused in words") {
  const Gaussians scene = synthetic_scene(SyntheticSceneKind::kLivingRoom, 12000, {}, 0);
  SurfaceSettings settings = room_settings();
  settings.cameras.clear();
  CHECK_THROWS_WITH(scanned_solid(scene, settings), Catch::Contains("needs the cameras"));
  settings.cameras = {room_settings().cameras.front()};
  settings.cameras[0].camera_from_world.translation += Vector3<double>(0, 0, -1e5);
  CHECK_THROWS_WITH(scanned_solid(scene, settings), Catch::Contains("see nothing"));
  Gaussians faint = scene;
  for (float& logit : faint.opacity_logits) logit = -6;
  settings.is_object = true;
  CHECK_THROWS_WITH(scanned_solid(faint, settings), Catch::Contains("opacity above 0.5"));
}

TEST_CASE("one camera is enough: behind it nothing is known") {
  SurfaceSettings settings = room_settings();
  settings.cameras.resize(1);
  settings.more_views = 12;
  ScannedSolid solid = scanned_solid(synthetic_scene(SyntheticSceneKind::kLivingRoom, 12000, {}, 0), settings);
  CHECK(solid.views.size() == 13);
  check_closed(surface_of(solid.grid, 0));
}

TEST_CASE("eyes are placed in free space, far from each other") {
  SolidGrid grid;
  grid.voxel = 0.1;
  grid.blocks = {10, 6, 6};
  grid.block.assign(static_cast<std::size_t>(grid.block_count()), SolidGrid::kSolid);
  for (std::int32_t i = 1; i < 9; ++i) {
    for (std::int32_t j = 1; j < 5; ++j) {
      for (std::int32_t k = 1; k < 5; ++k)
        grid.block[static_cast<std::size_t>(grid.number({i, j, k}))] = SolidGrid::kFree;
    }
  }
  const std::vector<Point> eyes = more_eyes(grid, {}, 6, 0.5);
  REQUIRE(eyes.size() == 6);
  for (std::size_t i = 0; i < eyes.size(); ++i) {
    CHECK(grid.at(eyes[i]) > 0);
    for (std::size_t j = 0; j < i; ++j) CHECK((eyes[i] - eyes[j]).norm() > 1.5);
  }
  CHECK(more_eyes(grid, {}, 100000, 1.5).size() < 200);
}

}  // namespace surface_test
