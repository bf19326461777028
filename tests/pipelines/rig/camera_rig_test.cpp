#include "pipelines/rig/camera_rig.h"

#include <set>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "tests/pipelines/rig/mesh_files.h"

namespace camera_rig_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

TexturedMesh textured(const QuadMesh& quads) { return textured_mesh(loaded(quads, {}), "mesh.obj"); }

/// Faces that some camera sees.
std::set<std::int32_t> seen_faces(const CastMesh& mesh, const std::vector<Camera>& cameras) {
  std::set<std::int32_t> seen;
  for (const Camera& camera : cameras) {
    const PictureRays picture(camera);
    std::vector<WorldRay> rays;
    for (int i = 0; i < 16 * 16; ++i)
      rays.push_back(picture.through((i % 16 + 0.5) * camera.width / 16, (i / 16 + 0.5) * camera.height / 16));
    for (const std::int32_t face : mesh.faces_met(rays)) seen.insert(face);
  }
  seen.erase(-1);
  return seen;
}

/// A room of 5 × 4 × 2.5 m with a solid block in it.
QuadMesh room() {
  QuadMesh quads;
  quads.add_box(Vector3<double>(0, 0, 0), Vector3<double>(5, 4, 2.5), true);
  quads.add_box(Vector3<double>(1.5, 1, 0.01), Vector3<double>(3.5, 2.5, 1.2));
  return quads;
}

RigSettings few(Index count) {
  RigSettings settings;
  settings.count = count;
  settings.size = 64;
  return settings;
}

}  // namespace

TEST_CASE("a rig around a cube sees all of its faces, and all of it is in each picture") {
  QuadMesh cube;
  cube.add_box(Vector3<double>(9, 9, 9), Vector3<double>(11, 10, 9.5));
  const CastMesh mesh(textured(cube));
  const Rig rig = rig_around(mesh.mesh(), {});
  CHECK(std::ssize(rig.cameras) == kPicturesOfObject);
  CHECK(seen_faces(mesh, rig.cameras).size() == 12);
  for (const Camera& camera : rig.cameras) {
    for (const std::array<float, 3>& place : cube.places) {
      const Vector3<double> world = Vector3<float>(place.data()).cast<double>();
      const Rigid<double>& pose = camera.camera_from_world;
      const Vector2<double> pixel = project_point(camera, Vector3<double>(pose.rotation * world + pose.translation));
      CHECK((pixel[0] > 0 && pixel[0] < camera.width && pixel[1] > 0 && pixel[1] < camera.height));
    }
  }
}

TEST_CASE("a rig in a room sees all that can be seen, from places where somebody can be") {
  const CastMesh mesh(textured(room()));
  const Rig rig = rig_inside(mesh, few(40), 1, "room");
  REQUIRE(rig.cameras.size() == 40);
  CHECK(seen_faces(mesh, rig.cameras).size() >= 22);  // all but the block's bottom
  CHECK(rig.no_room > 0);
  CHECK(rig.seen > 0.6);
  for (const Camera& camera : rig.cameras) {
    const Vector3<double> eye = camera_center_world(camera);
    CHECK((eye[2] > 0.59 && eye[2] < 2.5));
    const bool in_block = eye[0] > 1.4 && eye[0] < 3.6 && eye[1] > 0.9 && eye[1] < 2.6 && eye[2] < 1.3;
    CHECK_FALSE(in_block);
  }
}

TEST_CASE("views of backs and places without a floor are left out, and none at all is refused in words") {
  QuadMesh solid;  // seen from inside, all faces show their backs
  solid.add_box(Vector3<double>(0, 0, 0), Vector3<double>(5, 4, 2.5));
  const CastMesh mesh(textured(solid));
  CHECK_THROWS_WITH(rig_inside(mesh, few(5), 1, "solid.obj"),
                    Catch::Contains("solid.obj: no camera") && Catch::Contains("/photos/rig/box"));
  RigSettings bold = few(5);
  bold.most_backs = 1;
  CHECK(rig_inside(mesh, bold, 1, "solid.obj").cameras.size() == 5);
  QuadMesh tiny;
  tiny.add_box(Vector3<double>(0, 0, 0), Vector3<double>(0.2, 0.2, 0.2), true);
  CHECK_THROWS_AS(rig_inside(CastMesh(textured(tiny)), few(5), 1, "tiny.obj"), UserError);
}

TEST_CASE("cameras stay in the box that is given") {
  const CastMesh mesh(textured(room()));
  RigSettings settings = few(10);
  settings.box = {3.8, 0, 0, 5, 4, 2};
  for (const Camera& camera : rig_inside(mesh, settings, 1, "room").cameras)
    CHECK(camera_center_world(camera)[0] > 3.8);
}

TEST_CASE("a rig is a function of its seed, on any number of threads", "[parallel]") {
  const CastMesh mesh(textured(room()));
  const auto eyes = [&](int threads, std::uint64_t seed) {
    std::vector<double> numbers;
    with_threads(threads, [&] {
      for (const Camera& camera : rig_inside(mesh, few(8), seed, "room").cameras)
        numbers.push_back(camera_center_world(camera)[0]);
    });
    return numbers;
  };
  CHECK(eyes(1, 1) == eyes(2, 1));
  CHECK(eyes(1, 1) != eyes(1, 2));
}

}  // namespace camera_rig_test
