#include "pipelines/metrics/solid.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/npz.h"
#include "core/random.h"
#include "optim/solid/gaussian_surface.h"
#include "pipelines/metrics/penetration.h"
#include "pipelines/synthetic/object.h"
#include "tests/optim/solid/meshes.h"
#include "tests/optim/solid/surface_of_test.h"
#include "tests/support/temporary_folder.h"

namespace solid_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Point = Vector3<double>;

/// The six sides of a box.
Gaussians sheets_of_box(const Point& low, const Point& high, double spacing = 0.02) {
  Gaussians gaussians;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      Point corner = low, u = Point::Zero(), v = Point::Zero();
      const int a = (axis + 1) % 3, b = (axis + 2) % 3;
      corner[axis] = side < 0 ? low[axis] : high[axis];
      u[a] = high[a] - low[a];
      v[b] = high[b] - low[b];
      add_sheet(gaussians, corner, u, v, spacing);
    }
  }
  return gaussians;
}

}  // namespace

TEST_CASE("a box as a mesh, as voxels and as Gaussians is the same solid") {
  const TemporaryFolder here;
  const Point low(-0.2, -0.3, -0.1), high(0.2, 0.3, 0.1);
  write_mesh("box.ply", box_mesh(low, high));
  NpzWriter file;
  const std::array<std::int64_t, 3> cells = {40, 50, 30};  // of 2 cm, from (-0.4, -0.5, -0.3)
  std::vector<std::uint8_t> voxels;
  for (std::int64_t i = 0; i < cells[0]; ++i) {
    for (std::int64_t j = 0; j < cells[1]; ++j) {
      for (std::int64_t k = 0; k < cells[2]; ++k)
        voxels.push_back(i >= 10 && i < 30 && j >= 10 && j < 40 && k >= 10 && k < 20 ? 1 : 0);
    }
  }
  file.add<std::uint8_t>("occupancy", std::span(cells), std::span<const std::uint8_t>(voxels));
  file.add<double>("origin", {3}, {-0.4, -0.5, -0.3});
  file.add_scalar("voxel_size", 0.02);
  file.write("box.npz");
  const Gaussians gaussians = sheets_of_box(low, high);
  const Solid mesh = mesh_solid("box.ply"), grid = occupancy_solid("box.npz"), shown = object_solid(gaussians, "box");
  CHECK(mesh.source == "the mesh box.ply");
  CHECK(grid.source == "the occupancy grid box.npz");
  CHECK(shown.source == "the Gaussians of box");
  REQUIRE(shown.distance);
  RandomSequence random(5);
  for (int i = 0; i < 300; ++i) {
    const Point place(random.uniform(-0.39, 0.39), random.uniform(-0.49, 0.49), random.uniform(-0.29, 0.29));
    const double truth = box_distance(low, high, place);
    INFO(place.transpose());
    CHECK(mesh.distance(place) == Approx(truth).margin(1e-9));
    CHECK(grid.distance(place) == Approx(truth).margin(0.02));
    if (std::fabs(truth) > 0.03) CHECK((shown.distance(place) < 0) == (truth < 0));
  }
  CHECK(shown.distance({5, 0, 0}) > 4);
  // About a centroid that is not the file's origin.
  const Solid moved = object_mesh_solid("box.ply", {0.1, 0, 0});
  CHECK(moved.distance({0.1, 0, 0}) == Approx(mesh.distance({0.2, 0, 0})).margin(1e-12));
}

TEST_CASE("few Gaussians that float far from an object change nothing") {
  const Point low(-0.2, -0.3, -0.1), high(0.2, 0.3, 0.1);
  Gaussians gaussians = sheets_of_box(low, high);
  const Solid alone = object_solid(gaussians, "box");
  add_disc(gaussians, {0, 0, 40}, {0, 0, 1}, 0.01);
  add_disc(gaussians, {900, 0, 0}, {0, 0, 1}, 0.01);
  gaussians.opacity_logits.back() = -3;  // faint
  const Solid with = object_solid(gaussians, "box");
  RandomSequence random(6);
  for (int i = 0; i < 200; ++i) {
    const Point place(random.uniform(-0.4, 0.4), random.uniform(-0.5, 0.5), random.uniform(-0.3, 0.3));
    INFO(place.transpose());
    CHECK(with.distance(place) == alone.distance(place));
  }
  CHECK(with.distance({0, 0, 39.95}) > 30);
}

TEST_CASE("an object larger than a room is solid within") {
  const Point low(-4, -3, -2), high(4, 3, 2);
  const Solid solid = object_solid(sheets_of_box(low, high, 0.2), "ship");
  REQUIRE(solid.distance);
  for (const Point& inner : {Point(-3.95, 0.1, 0.2), Point(0.3, 2.95, 0.1), Point(1, 1, -1.95)})
    CHECK(solid.distance(inner) == Approx(-0.05).margin(1e-3));
  CHECK(solid.distance({-4.05, 0.1, 0.2}) == Approx(0.05).margin(1e-3));
}

TEST_CASE("behind a Gaussian that floats in the air of a scene all is free") {
  Gaussians scene;
  add_sheet(scene, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0.04);
  add_disc(scene, {0.5, 0, 1}, {1, 0, 0}, 0.1);
  const Solid solid = gaussian_solid(scene, {Point(3, 0, 1.2)}, "scene.ply");
  CHECK(solid.distance({0.45, 0, 1}) > 0);
  CHECK(solid.distance({0.1, 0.1, -0.02}) == Approx(-0.02).margin(1e-3));
}

TEST_CASE("the centroid of a mesh is the mean of its vertices") {
  const TemporaryFolder here;
  write_mesh("box.ply", box_mesh({1, 2, 3}, {3, 6, 4}));
  CHECK((mesh_centroid("box.ply") - Point(2, 4, 3.5)).norm() < 1e-12);
}

TEST_CASE("points inside of objects that move count once, as deep as they are at most") {
  const auto sphere = [](double radius) {
    return SignedDistance([radius](const Point& place) { return place.norm() - radius; });
  };
  const std::vector<SignedDistance> distances = {sphere(1), SignedDistance(), sphere(2)};
  const std::vector<Rigid<double>> poses = {{Matrix3<double>::Identity(), {10, 0, 0}},
                                            {Matrix3<double>::Identity(), {0, 0, 0}},
                                            {Matrix3<double>::Identity(), {11, 0, 0}}};
  const std::vector<double> points = {10, 0, 0, 12.5, 0, 0, 0, 0, 0, 13.5, 0, 0};
  const Penetration counts = penetration_of(distances, poses, points);
  CHECK(counts.points == 4);
  CHECK(counts.inside == 2);
  CHECK(counts.depth == Approx(1 + 0.5));
  const MetricValues values = object_penetration_values(counts);
  CHECK(values[0] == std::pair<std::string, double>("object_penetration_share", 0.5));
  CHECK(values[1].first == "object_penetration_depth_mm");
  CHECK(values[1].second == Approx(750));
  CHECK(sum_after_first({counts, counts, counts}).points == 8);
}

TEST_CASE("made objects are solid to what their Gaussians show") {
  const SyntheticObject can = synthetic_object(SyntheticObjectKind::kWateringCan, 3000, 1);
  const Solid solid = object_solid(can.gaussians, "can");
  REQUIRE(solid.distance);
  // Most of its surface: edges and the tube of the spout are narrower than the discs are wide.
  int discs = 0, free_outside = 0, solid_inside = 0;
  for (const SurfaceDisc& disc : surface_discs(can.gaussians)) {  // normals point outwards, as they were made
    ++discs;
    free_outside += solid.distance(disc.center + 0.02 * disc.normal) < 0 ? 0 : 1;
    solid_inside += solid.distance(disc.center - 0.004 * disc.normal) < 0 ? 1 : 0;
  }
  REQUIRE(discs > 1000);
  CHECK(free_outside > 0.8 * discs);
  CHECK(solid_inside > 0.8 * discs);
  CHECK_FALSE(object_solid(Gaussians(), "nothing").distance);
}

}  // namespace solid_test
