#include "pipelines/solid.h"

#include <algorithm>
#include <memory>

#include "optim/gaussian_surface.h"
#include "optim/mesh_distance.h"
#include "optim/occupancy_grid.h"

namespace hsi4d {

namespace {

using Point = Vector3<double>;

/// Discs of an object that are looked at, evenly chosen: which side of each is seen takes long for more.
constexpr std::size_t kMostDiscs = 20000;

/// Viewpoints stand so many times as far from an object's centroid as its farthest mean.
constexpr double kViewDistance = 3;

SignedDistance distance_of(std::vector<SurfaceDisc> discs) {
  const auto distance = std::make_shared<const GaussianDistance>(std::move(discs), kMeasuredThickness);
  return [distance](const Point& place) { return distance->at(place); };
}

double radius_of(const Gaussians& object) {
  double radius = 0;
  for (Index g = 0; g < object.count(); ++g)
    radius = std::max(radius, Vector3<float>(object.means.data() + 3 * g).cast<double>().norm());
  return radius;
}

std::vector<SurfaceDisc> at_most(std::vector<SurfaceDisc> discs, std::size_t most) {
  if (discs.size() <= most) return discs;
  std::vector<SurfaceDisc> chosen;
  for (std::size_t i = 0; i < most; ++i) chosen.push_back(discs[i * discs.size() / most]);
  return chosen;
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

/// Discs turned to the side from which more of the places see them: a ray that slips between two discs of the near side
/// sees the far side's back, which one place alone would take for its front. Those that none sees are left out.
std::vector<SurfaceDisc> facing_most(const std::vector<SurfaceDisc>& discs, const std::vector<Point>& places) {
  std::vector<double> votes(discs.size(), 0);
  for (const Point& place : places) {
    std::size_t i = 0;
    for (const SurfaceDisc& seen : facing(discs, {place})) {  // in the order of `discs`
      while (discs[i].center != seen.center) ++i;
      votes[i] += dot(seen.normal, discs[i].normal);
      ++i;
    }
  }
  std::vector<SurfaceDisc> turned;
  for (std::size_t i = 0; i < discs.size(); ++i) {
    if (votes[i] == 0) continue;
    turned.push_back(discs[i]);
    if (votes[i] < 0) turned.back().normal = -turned.back().normal;
  }
  return turned;
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
  std::vector<SurfaceDisc> discs = facing(surface_discs(scene), free_places);
  if (discs.empty()) return {};
  return {distance_of(std::move(discs)), "the Gaussians of " + name};
}

Solid object_solid(const Gaussians& object, const std::string& name) {
  const double radius = radius_of(object);
  std::vector<SurfaceDisc> discs =
      facing_most(at_most(surface_discs(object), kMostDiscs), places_around(kViewDistance * radius));
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

Solid object_mesh_solid(const std::string& path, const Point& centroid) {
  Solid solid = mesh_solid(path);
  solid.distance = [in_file = solid.distance, centroid](const Point& place) { return in_file(place + centroid); };
  return solid;
}

}  // namespace hsi4d
