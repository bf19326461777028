#include "pipelines/metrics/solid.h"

#include <algorithm>
#include <memory>

#include "optim/solid/gaussian_surface.h"
#include "optim/solid/mesh_distance.h"
#include "optim/solid/mesh_file.h"
#include "optim/solid/occupancy_grid.h"

namespace hsi4d {

namespace {

using Point = Vector3<double>;

/// Discs of an object that are looked at, chosen at random: which side of each is seen takes long for more.
constexpr std::size_t kMostDiscs = 20000;

/// Viewpoints stand so many times as far from an object's centroid as its farthest disc.
constexpr double kViewDistance = 3;

SignedDistance distance_of(std::vector<SurfaceDisc> discs) {
  const auto distance = std::make_shared<const GaussianDistance>(std::move(discs), kMeasuredThickness);
  return [distance](const Point& place) { return distance->at(place); };
}

/// How far the discs' centres are from the origin.
double radius_of(const std::vector<SurfaceDisc>& discs) {
  double radius = 0;
  for (const SurfaceDisc& disc : discs) radius = std::max(radius, disc.center.norm());
  return radius;
}

/// The directions of a cube's faces, edges and corners.
std::vector<Point> places_around(double distance) {
  std::vector<Point> places;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x != 0 || y != 0 || z != 0) places.emplace_back(Point(x, y, z).normalized() * distance);
      }
    }
  }
  return places;
}

}  // namespace

Solid mesh_solid(const std::string& path) {
  const std::shared_ptr<const MeshDistance> mesh = read_mesh_distance(path, kMeasuredThickness);
  return {[mesh](const Point& place) { return mesh->at(place); }, "the mesh " + path};
}

Solid occupancy_solid(const std::string& path) {
  const auto grid = std::make_shared<const OccupancyDistance>(read_occupancy(path));
  return {[grid](const Point& place) { return grid->at(place); }, "the occupancy grid " + path};
}

Solid gaussian_solid(const Gaussians& scene, const std::vector<Point>& free_places, const std::string& name) {
  std::vector<SurfaceDisc> discs = facing(without_floaters(surface_discs(scene)), free_places);
  if (discs.empty()) return {};
  return {distance_of(std::move(discs)), "the Gaussians of " + name};
}

Solid object_solid(const Gaussians& object, const std::string& name) {
  std::vector<SurfaceDisc> discs = thinned(without_floaters(surface_discs(object)), kMostDiscs);
  const double radius = radius_of(discs);
  discs = facing_most(discs, places_around(kViewDistance * radius));
  if (discs.empty()) return {};
  double widest = 0;
  for (const SurfaceDisc& disc : discs) widest = std::max(widest, disc.width);
  const double farthest = radius + 2 * widest;  // nothing of it is farther from the centroid
  return {[near = distance_of(std::move(discs)), farthest](const Point& place) {
            const double beyond = place.norm() - farthest;
            return beyond > 0 ? beyond : near(place);
          },
          "the Gaussians of " + name};
}

Point mesh_centroid(const std::string& path) {
  const TriangleMesh mesh = read_mesh(path);
  Point sum = Point::Zero();
  for (const Point& vertex : mesh.vertices) sum += vertex;
  return sum / static_cast<double>(mesh.vertices.size());
}

Solid object_mesh_solid(const std::string& path, const Point& centroid) {
  Solid solid = mesh_solid(path);
  solid.distance = [in_file = solid.distance, centroid](const Point& place) { return in_file(place + centroid); };
  return solid;
}

}  // namespace hsi4d
