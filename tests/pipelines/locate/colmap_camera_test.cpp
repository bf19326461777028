#include "pipelines/locate/colmap_camera.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/rotation.h"
#include "tests/support/temporary_folder.h"

namespace colmap_camera_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

void write_model(const TemporaryFolder& folder) {
  folder.write("model/sparse/0/cameras.txt",
               "1 PINHOLE 640 480 500 510 320 240\n2 SIMPLE_RADIAL 640 480 400 320 240 0.1\n");
  folder.write("model/sparse/0/images.txt",
               "1 0.6 0.8 0 0 1 2 3 1 photos/a.png\n\n2 1 0 0 0 0 0 0 1 new/frame.png\n\n"
               "3 1 0 0 0 0 0 1 1 old/frame.png\n\n4 1 0 0 0 0 0 0 2 bent.png\n\n");
}

template <class F>
std::string error_of(F call) {
  try {
    call();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

std::string error_of_picture(const std::string& name) {
  return error_of([&] { colmap_camera("model", name, {}); });
}

}  // namespace

TEST_CASE("a camera of a model sees the aligned scene as it saw its own") {
  const TemporaryFolder folder;
  write_model(folder);
  const Camera own = colmap_camera("model", "a.png", {});
  CHECK(own.fx == 500);
  CHECK(own.camera_from_world.translation == Vector3<double>(1, 2, 3));
  CHECK(colmap_camera("model", "new/frame.png", {}).camera_from_world.translation == Vector3<double>(0, 0, 0));
  const Similarity alignment{2.5, so3_exp(Vector3<double>(0.3, -0.8, 1.2)), {4, -3, 0.5}};
  const Camera moved = colmap_camera("model", "photos/a.png", alignment);
  for (const Vector3<double>& point : {Vector3<double>(0.1, 0.2, 4), Vector3<double>(-1, 0.5, 6)}) {
    const Vector2<double> before = project_point(own, transform_point(own.camera_from_world, point));
    const Vector2<double> after =
        project_point(moved, transform_point(moved.camera_from_world, transform_point(alignment, point)));
    CHECK((before - after).norm() < 1e-9);
  }
}

TEST_CASE("what a model does not have is told by name") {
  const TemporaryFolder folder;
  write_model(folder);
  CHECK_THAT(error_of_picture("c.png"), Catch::Contains("has not registered c.png, but photos/a.png, new/frame.png"));
  CHECK_THAT(error_of_picture("frame.png"),
             Catch::Contains("both new/frame.png and old/frame.png are called frame.png; --name says which"));
  CHECK_THAT(error_of_picture("bent.png"), Catch::Contains("the lens of bent.png bends"));
  CHECK_THAT(error_of([] { colmap_camera("nowhere", "a.png", {}); }), Catch::Contains("holds no model of COLMAP"));
}

TEST_CASE("alignments are read as hsi4d align writes them") {
  const std::string text =
      "{\"matrix\": [[0, -2, 0, 1], [2, 0, 0, -4], [0, 0, 2, 0.5], [0, 0, 0, 1]], \"scale\": 2, \"ground_share\": 0.3}";
  const Similarity similarity = decode_alignment(text, "alignment.json");
  CHECK(similarity.scale == Approx(2));
  CHECK((transform_point(similarity, Vector3<double>(1, 0, 0)) - Vector3<double>(1, -2, 0.5)).norm() < 1e-12);
  const auto error = [](const std::string& bad) { return error_of([&] { decode_alignment(bad, "a.json"); }); };
  CHECK(error("{}") == "a.json: /matrix: is missing; allowed: a matrix as hsi4d align writes it, 4 rows of 4 numbers");
  CHECK_THAT(error("{\"matrix\": [[1, 0, 0, 0], [0, 1, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}"),
             Catch::Contains("a.json: /matrix/1: "));
  CHECK_THAT(error("{\"matrix\": [[1, 0, 0, 0], [0, 1, 0, \"x\"], [0, 0, 1, 0], [0, 0, 0, 1]]}"),
             Catch::Contains("a.json: /matrix/1/3: \"x\" is no finite number"));
  CHECK_THAT(error("{\"matrix\": [[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}"),
             Catch::Contains("a.json: /matrix"));
  CHECK_THAT(error("{\"matrix\": "), Catch::Contains("a.json"));
}

}  // namespace colmap_camera_test
