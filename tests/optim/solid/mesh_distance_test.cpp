#include "optim/solid/mesh_distance.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/log.h"
#include "core/random.h"
#include "stress/scratch_folder.h"
#include "tests/optim/solid/meshes.h"

namespace mesh_distance_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Point = Vector3<double>;

const Point kLow(-0.3, -0.2, 0.1), kHigh(0.4, 0.5, 0.9);

Point random_point(RandomSequence& random, double size) {
  return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

}  // namespace

TEST_CASE("the distance of a box mesh is that of the box, in and out, at faces, edges and corners") {
  const MeshDistance distance(cleaned(box_mesh(kLow, kHigh), "box"), 0.1);
  RandomSequence random(1);
  for (int i = 0; i < 2000; ++i) {
    const Point p = random_point(random, 1.2);
    CHECK(distance.at(p) == Approx(box_distance(kLow, kHigh, p)).margin(1e-7));
  }
  CHECK(distance.at({100, 0, 0.5}) == Approx(99.6).epsilon(1e-6));
}

TEST_CASE("the distance of a sphere mesh comes near to that of the sphere") {
  const MeshDistance distance(cleaned(sphere_mesh(0.5, 4), "sphere"), 0.1);
  RandomSequence random(2);
  for (int i = 0; i < 500; ++i) {
    const Point p = random_point(random, 1);
    CHECK(distance.at(p) == Approx(p.norm() - 0.5).margin(1.2e-3));
  }
}

TEST_CASE("the distance of overlapping boxes has the sign of their union, and is exact outside") {
  const Point low(0.2, 0.3, 0.5), high(1, 0.4, 1.5);
  TriangleMesh both = box_mesh(kLow, kHigh);
  append_mesh(box_mesh(low, high), both);
  const MeshDistance distance(cleaned(both, "boxes"), 0.1);
  RandomSequence random(3);
  for (int i = 0; i < 2000; ++i) {
    const Point p = random_point(random, 1.2);
    const double least = std::min(box_distance(kLow, kHigh, p), box_distance(low, high, p));
    CHECK(distance.at(p) == Approx(least).margin(1e-7));
  }
}

TEST_CASE("two rooms: what is outside of both is solid") {
  TriangleMesh rooms = turned_inwards(box_mesh({0, 0, 0}, {1, 1, 1}));
  append_mesh(turned_inwards(box_mesh({2, 0, 0}, {3, 1, 1})), rooms);
  const MeshDistance distance(cleaned(rooms, "rooms"), 0.1);
  CHECK(distance.at({0.5, 0.5, 0.7}) == Approx(0.3));
  CHECK(distance.at({2.6, 0.5, 0.5}) == Approx(0.4));
  CHECK(distance.at({1.4, 0.5, 0.5}) == Approx(-0.4));
  CHECK(distance.at({9, 0.5, 0.5}) == Approx(-6));
}

TEST_CASE(
    "a surface turned inwards is a hollow of the solid around it, and without one the rest of the world is solid") {
  const Point low(-0.2, -0.1, 0.2), high(0.3, 0.4, 0.8);
  const TriangleMesh hollow = turned_inwards(box_mesh(low, high));
  TriangleMesh walls = box_mesh(kLow, kHigh);
  append_mesh(hollow, walls);
  const MeshDistance alone(cleaned(hollow, "hollow"), 0.1), in_walls(cleaned(walls, "walls"), 0.1);
  RandomSequence random(4);
  for (int i = 0; i < 1000; ++i) {
    const Point p = random_point(random, 1);
    const double room = -box_distance(low, high, p);
    CHECK(alone.at(p) == Approx(room).margin(1e-7));
    const double expected = std::max(box_distance(kLow, kHigh, p), room);
    if (p.cwiseMax(kLow).cwiseMin(kHigh) == p) CHECK(in_walls.at(p) == Approx(expected).margin(1e-7));
    CHECK((in_walls.at(p) < 0) == (expected < 0));
  }
}

TEST_CASE("an open mesh is solid down to its thickness behind its faces, and nothing is known deeper") {
  TriangleMesh floor;
  floor.vertices = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  floor.faces = {{0, 1, 2}, {0, 2, 3}};
  const MeshDistance distance(cleaned(floor, "floor"), 0.1);
  CHECK(distance.at({0.2, 0.1, 0.3}) == Approx(0.3));
  CHECK(distance.at({0.2, 0.1, -0.05}) == Approx(-0.05));
  CHECK(distance.at({0.3, 0.3, -0.05}) == Approx(-0.05));  // above the diagonal, which is no border
  CHECK(std::isnan(distance.at({0.2, 0.1, -0.2})));
  CHECK(distance.at({1.3, 0, -0.4}) == Approx(0.5));  // beside it nothing is solid
  CHECK(count_edges(floor).edges == 5);
  CHECK(count_edges(floor).open == 4);
  CHECK(count_edges(cleaned(box_mesh(kLow, kHigh), "box")).open == 0);
}

TEST_CASE("what is unknown behind an open mesh does not hide a solid") {
  TriangleMesh mesh;
  mesh.vertices = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.faces = {{0, 1, 2}, {0, 2, 3}};
  append_mesh(box_mesh({-0.2, -0.2, -0.6}, {0.2, 0.2, -0.4}), mesh);
  const MeshDistance distance(cleaned(mesh, "mesh"), 0.1);
  CHECK(distance.at({0, 0, -0.45}) == Approx(-0.05));
  CHECK(distance.at({0, 0, -0.35}) == Approx(0.05));  // nearer to the box, which says free
  CHECK(std::isnan(distance.at({0, 0, -0.15})));
}

TEST_CASE("nothing within the free radius of a place is solid") {
  TriangleMesh open = box_mesh(kLow, kHigh);
  open.faces.pop_back();  // half of a side is open: behind the others is a slab
  for (const TriangleMesh& mesh : {box_mesh(kLow, kHigh), open}) {
    const MeshDistance distance(cleaned(mesh, "box"), 0.1);
    RandomSequence random(4);
    int tried = 0, beside = 0;
    for (int i = 0; i < 20000; ++i) {
      const Point p = random_point(random, 1.2);
      const double d = distance.at(p), radius = d > 0 ? distance.free_radius(d) : 0;
      if (!(radius > 0)) continue;
      const Point way = random_point(random, 1);
      const Point q = p + way / way.norm() * radius * random.uniform(0.9, 1);
      ++tried;
      CHECK_FALSE(distance.at(q) < 0);
      beside += distance.at(p + way / way.norm() * (d + 0.02)) < 0 ? 1 : 0;
    }
    CHECK(tried > 1000);
    CHECK(beside > 10);  // a little farther it may be
  }
}

TEST_CASE("a mesh that is not closed, or turned inwards, is told in the log") {
  const ScratchFolder folder;
  std::vector<std::string> told;
  const LogSink sink = log_to([&](LogLevel, std::string_view text) { told.emplace_back(text); }, LogLevel::kInfo);
  const auto read = [&](const char* name, const TriangleMesh& mesh) {
    const std::string path = std::string(folder.path()) + "/" + name;
    write_mesh(path, mesh);
    told.clear();
    read_mesh_distance(path, 0.1);
    return path;
  };
  read("closed.ply", box_mesh(kLow, kHigh));
  CHECK(told.empty());
  TriangleMesh open = box_mesh(kLow, kHigh);
  open.faces.pop_back();
  const std::string path = read("open.ply", open);
  CHECK(told ==
        std::vector<std::string>{path + ": 3 of the mesh's 18 edges are not between two triangles that agree on their "
                                        "side: the mesh is not closed. Its open pieces count as solid only near their "
                                        "backs"});
  const std::string inwards = read("inwards.ply", turned_inwards(box_mesh(kLow, kHigh)));
  CHECK(told == std::vector<std::string>{
                    inwards + ": the mesh is turned inwards, as a room is: what lies outside of it counts as "
                              "solid"});
}

}  // namespace mesh_distance_test
