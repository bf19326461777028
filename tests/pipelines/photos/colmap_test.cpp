#include "pipelines/photos/colmap.h"

#include <cstring>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/rotation.h"

namespace colmap_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

using Bytes = std::vector<std::uint8_t>;

template <class T>
void put(Bytes& bytes, T value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof(T));
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

void put_text(Bytes& bytes, const std::string& text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
  bytes.push_back(0);
}

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

const std::string kCameras =
    "# Camera list\n1 OPENCV 640 480 500 510 320.5 240.25 0.1 -0.02 0.001 -0.002\n2 SIMPLE_RADIAL 640 480 400 320 240 "
    "0.05\n3 PINHOLE 100 200 50 60 51 99\n4 SIMPLE_PINHOLE 100 200 50 51 99\n5 RADIAL 10 20 5 5 10 0.1 0.2\n";
// Half a turn about x; and a quarter about z, with observations and a name with a blank.
const std::string kImages =
    "# Image list\n7 0 1 0 0 1 2 3 1 b.jpg\n10.5 20.5 3 11 12 -1\n"
    "8 0.70710678118654752 0 0 0.70710678118654752 -1 0.5 4 3 dir/a b.png\n\n";
const std::string kPoints = "# points\n3 1.5 -2 3 255 0 51 0.3 7 0 8 1\n4 0 0 1 1 2 3 0.1\n";

ColmapModel from_text() {
  const Bytes cameras = bytes_of(kCameras), images = bytes_of(kImages), points = bytes_of(kPoints);
  return decode_colmap({"cameras.txt", cameras}, {"images.txt", images}, {"points3D.txt", points});
}

Bytes binary_cameras(std::uint32_t model = 4, std::uint64_t width = 640) {
  Bytes bytes;
  put<std::uint64_t>(bytes, 1);
  put<std::int32_t>(bytes, 1);
  put<std::uint32_t>(bytes, model);
  put<std::uint64_t>(bytes, width);
  put<std::uint64_t>(bytes, 480);
  for (const double p : {500.0, 510.0, 320.5, 240.25, 0.1, -0.02, 0.001, -0.002}) put(bytes, p);
  return bytes;
}

Bytes binary_images() {
  Bytes bytes;
  put<std::uint64_t>(bytes, 1);
  put<std::int32_t>(bytes, 7);
  for (const double p : {0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0}) put(bytes, p);
  put<std::int32_t>(bytes, 1);
  put_text(bytes, "b.jpg");
  put<std::uint64_t>(bytes, 2);
  for (int i = 0; i < 2; ++i) {
    put(bytes, 10.5);
    put(bytes, 20.5);
    put<std::int64_t>(bytes, -1);
  }
  return bytes;
}

Bytes binary_points() {
  Bytes bytes;
  put<std::uint64_t>(bytes, 1);
  put<std::uint64_t>(bytes, 3);
  for (const double p : {1.5, -2.0, 3.0}) put(bytes, p);
  for (const int c : {255, 0, 51}) bytes.push_back(static_cast<std::uint8_t>(c));
  put(bytes, 0.3);
  put<std::uint64_t>(bytes, 1);
  put<std::int32_t>(bytes, 7);
  put<std::int32_t>(bytes, 0);
  return bytes;
}

std::string refusal(const std::string& cameras, const std::string& images = kImages, const std::string& points = "") {
  const Bytes c = bytes_of(cameras), i = bytes_of(images), p = bytes_of(points);
  try {
    decode_colmap({"c.txt", c}, {"i.txt", i}, {"p.txt", p});
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a model of COLMAP in text") {
  const ColmapModel model = from_text();
  REQUIRE(model.images.size() == 2);
  const PosedImage& b = model.images[0];
  CHECK(b.name == "b.jpg");
  CHECK(b.camera.width == 640);
  CHECK(b.camera.fx == 500);
  CHECK(b.camera.fy == 510);
  CHECK(b.camera.cy == 240.25);
  CHECK(b.lens == Lens{.k1 = 0.1, .k2 = -0.02, .p1 = 0.001, .p2 = -0.002});
  const Matrix3<double> half_turn = Vector3<double>(1, -1, -1).asDiagonal();
  CHECK((b.camera.camera_from_world.rotation - half_turn).norm() < 1e-15);
  CHECK(b.camera.camera_from_world.translation == Vector3<double>(1, 2, 3));
  const PosedImage& a = model.images[1];
  CHECK(a.name == "dir/a b.png");
  CHECK(a.camera.fy == 60);
  CHECK(a.lens.is_straight());
  const Matrix3<double> quarter = so3_exp(Vector3<double>(0, 0, std::acos(-1.0) / 2));
  CHECK((a.camera.camera_from_world.rotation - quarter).norm() < 1e-15);
  REQUIRE(model.points.size() == 2);
  CHECK(model.points[0].place == Vector3<double>(1.5, -2, 3));
  CHECK(model.points[0].color[0] == 1);
  CHECK(model.points[0].color[2] == Approx(0.2));
}

TEST_CASE("a model of COLMAP in binary is the same") {
  const Bytes cameras = binary_cameras(), images = binary_images(), points = binary_points();
  const ColmapModel model = decode_colmap({"c.bin", cameras}, {"i.bin", images}, {"p.bin", points});
  const ColmapModel text = from_text();
  REQUIRE(model.images.size() == 1);
  CHECK(model.images[0].name == text.images[0].name);
  CHECK(model.images[0].lens == text.images[0].lens);
  CHECK(model.images[0].camera.fy == text.images[0].camera.fy);
  CHECK(model.images[0].camera.camera_from_world.rotation == text.images[0].camera.camera_from_world.rotation);
  REQUIRE(model.points.size() == 1);
  CHECK(model.points[0].place == text.points[0].place);
  CHECK(model.points[0].color == text.points[0].color);
}

TEST_CASE("what is wrong with a model of COLMAP is named with its place") {
  CHECK_THAT(refusal("1 FOV 10 10 1 2 3 4 5\n"), Contains("c.txt:1: the camera model FOV is not read"));
  CHECK_THAT(refusal("1 OPENCV_FISHEYE 10 10 1 2 3 4 5 6 7 8\n"),
             Contains("OPENCV_FISHEYE is not read; allowed: SIMPLE_PIN"));
  CHECK_THAT(refusal("1 PINHOLE 10 10 1 2 3\n"), Contains("c.txt:1: the line ends too early"));
  CHECK_THAT(refusal("1 PINHOLE 10 10 1 2 3 4 5\n"), Contains("more than the 4 parameters of PINHOLE"));
  CHECK_THAT(refusal("1 PINHOLE 10 0 1 2 3 4\n"), Contains("10 x 0 pixels"));
  CHECK_THAT(refusal("1 PINHOLE 10 10 0 2 3 4\n"), Contains("the focal length is 0"));
  CHECK_THAT(refusal("1 PINHOLE 10 10 1 nan 3 4\n"), Contains("not finite"));
  CHECK_THAT(refusal("1 PINHOLE 10 10 1 1 3 4\n1 PINHOLE 10 10 1 1 3 4\n"),
             Contains("c.txt:2: there are two cameras 1"));
  CHECK_THAT(refusal("9 PINHOLE 10 10 1 1 3 4\n"), Contains("i.txt:2: is of camera 1"));
  CHECK_THAT(refusal(kCameras, "7 0 0 0 0 1 2 3 1 b.jpg\n\n"),
             Contains("i.txt:1: its pose is not finite, or no rotation"));
  CHECK_THAT(refusal(kCameras, "7 2 0 0 0 1 2 3 1 b.jpg\n\n"), Contains("allowed: a quaternion of length 1"));
  CHECK_THAT(refusal(kCameras, "7 1e200 1e200 0 0 1 2 3 1 b.jpg\n\n"), Contains("no rotation"));
  CHECK_THAT(refusal(kCameras, "7 1 0 0 0 1 2 3 1 a.jpg\n8 1 0 0 0 1 2 3 1 b.jpg\n"),
             Contains("i.txt:2: is no line of observations"));
  CHECK_THAT(refusal(kCameras, "7 1 0 0 0 1 2 3 1\n\n"), Contains("i.txt:1: has no name"));
  CHECK_THAT(refusal(kCameras, kImages, "1 0 0 inf 1 1 1 0\n"), Contains("p.txt:1: its place is not finite"));
  CHECK_THAT(refusal(kCameras, kImages, "1 0 0 0 1 256 1 0\n"), Contains("p.txt:1: the colour 256"));
}

TEST_CASE("a binary model of COLMAP that is cut, too long or of another kind is refused") {
  const Bytes cameras = binary_cameras(), images = binary_images(), points = binary_points();
  const auto refused = [&](const Bytes& c, const Bytes& i, const Bytes& p) -> std::string {
    try {
      decode_colmap({"c.bin", c}, {"i.bin", i}, {"p.bin", p});
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  };
  for (std::size_t n = 0; n < cameras.size(); ++n)
    CHECK_THAT(refused(Bytes(cameras.begin(), cameras.begin() + static_cast<std::ptrdiff_t>(n)), images, points),
               Contains("c.bin: byte "));
  for (std::size_t n = 0; n < images.size(); ++n)
    CHECK_THAT(refused(cameras, Bytes(images.begin(), images.begin() + static_cast<std::ptrdiff_t>(n)), points),
               Contains("i.bin: byte "));
  for (std::size_t n = 1; n < points.size(); ++n)
    CHECK_THAT(refused(cameras, images, Bytes(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(n))),
               Contains("p.bin: byte "));
  Bytes longer = points;
  longer.push_back(0);
  CHECK_THAT(refused(cameras, images, longer), Contains("1 bytes follow after the last entry"));
  CHECK_THAT(refused(binary_cameras(5), images, points), Contains("OPENCV_FISHEYE"));
  CHECK_THAT(refused(binary_cameras(99), images, points), Contains("number 99"));
  CHECK_THAT(refused(binary_cameras(4, 70000), images, points), Contains("70000 x 480 pixels"));
}

}  // namespace colmap_test
