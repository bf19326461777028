#include "core/camera_file.h"

#include <array>
#include <charconv>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/rotation.h"
#include "stress/scratch_folder.h"

namespace camera_file_test {

using namespace hsi4d;
using Catch::Matchers::Message;

namespace {

Camera odd_camera() {
  Camera camera;
  camera.width = 640;
  camera.height = 427;
  camera.fx = 500.1;
  camera.fy = 1.0 / 3;
  camera.cx = 321.25;
  camera.cy = -7e-5;
  camera.camera_from_world = look_at({3.3, -2.1, 1.7}, {0.1, 0.2, 0.3});
  return camera;
}

bool same_bits(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
         a.camera_from_world.rotation == b.camera_from_world.rotation &&
         a.camera_from_world.translation == b.camera_from_world.translation;
}

/// A camera file whose matrix has these rows.
std::string with_matrix(const std::string& matrix, const std::string& more = "") {
  return "{\"width\": 4, \"height\": 3, \"fx\": 5, \"fy\": 6, \"cx\": 2, \"cy\": 1.5,\n\"world_to_camera\": " + matrix +
         more + "}";
}
const std::string kIdentity = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";

/// In as many digits as give the same number back.
std::string precise(double value) {
  std::array<char, 32> buffer;
  return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr};
}

std::string fault(const std::string& text) {
  try {
    decode_cameras(text, "c.json");
  } catch (const UserError& error) {
    return error.what();
  }
  return "no fault";
}

}  // namespace

TEST_CASE("a camera is read as given") {
  const auto cameras =
      decode_cameras(with_matrix("[[0, -1, 0, 7], [0, 0, -1, 8], [1, 0, 0, 9], [0, 0, 0, 1]]"), "c.json");
  REQUIRE(cameras.size() == 1);
  const Camera& camera = cameras[0];
  CHECK(camera.width == 4);
  CHECK(camera.height == 3);
  CHECK(camera.fx == 5);
  CHECK(camera.fy == 6);
  CHECK(camera.cx == 2);
  CHECK(camera.cy == 1.5);
  CHECK(camera.camera_from_world.translation == Vector3<double>(7, 8, 9));
  CHECK(transform_point(camera.camera_from_world, Vector3<double>(1, 2, 3)) == Vector3<double>(5, 5, 10));
  // Not orthonormal to 5e-5: within the tolerance, and not put right.
  const Camera rough =
      decode_cameras(with_matrix("[[1.00002, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"), "c.json")[0];
  CHECK(rough.camera_from_world.rotation(0, 0) == 1.00002);
}

TEST_CASE("cameras are written and read back bitwise") {
  const ScratchFolder folder;
  Camera other = odd_camera();
  other.camera_from_world.translation = {1e-17, -1.0 / 7, 123456.789};
  other.width = 1;
  write_camera(folder / "one.json", odd_camera());
  CHECK(same_bits(read_camera(folder / "one.json"), odd_camera()));
  write_cameras(folder / "many.json", std::vector<Camera>{odd_camera(), other});
  const std::vector<Camera> many = read_cameras(folder / "many.json");
  REQUIRE(many.size() == 2);
  CHECK(same_bits(many[0], odd_camera()));
  CHECK(same_bits(many[1], other));
  CHECK(same_bits(read_camera(folder / "many.json", 1), other));
  CHECK_THROWS_MATCHES(read_camera(folder / "many.json", 2), UserError,
                       Message(folder / "many.json" + ": there is no camera 2; allowed: 0 to 1"));
  CHECK_THROWS_MATCHES(read_camera(folder / "one.json", -1), UserError,
                       Message(folder / "one.json" + ": there is no camera -1; allowed: 0 to 0"));
  write_cameras(folder / "none.json", {});
  CHECK(read_cameras(folder / "none.json").empty());
  other.fx = -1;
  CHECK_THROWS_AS(write_camera(folder / "bad.json", other), UserError);
  CHECK(folder.count() == 3);
}

TEST_CASE("what is wrong with a camera file is told to the letter") {
  CHECK(fault(with_matrix(kIdentity)) == "no fault");
  CHECK(fault("[]") == "c.json:1: [] is an array; a file of cameras is an object: {...}");
  CHECK(fault(with_matrix(kIdentity, ", \"heigth\": 3")) == "c.json:2: /heigth: unknown key; did you mean \"height\"?");
  CHECK(fault(with_matrix("[1, 2, 3]")) ==
        "c.json:2: /world_to_camera: [1, 2, 3] has length 3; allowed: 4 rows of 4 numbers");
  CHECK(fault(with_matrix("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1], [0, 0, 0, 1]]")) ==
        "c.json:2: /world_to_camera/2: [0, 0, 1] has length 3; allowed: 4 numbers");
  CHECK(fault(with_matrix("[[1, 0, 0, \"0\"], [0, 1, 0, 0], [0, 0, 1, 0], 7]")) ==
        "2 problems in c.json:\nc.json:2: /world_to_camera/0/3: \"0\" is a string, not a number\n"
        "c.json:2: /world_to_camera/3: 7 is a number; allowed: 4 numbers");
  CHECK(fault(with_matrix("[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]")) ==
        "c.json:2: /world_to_camera: the last row is 0 0 0 2; allowed: 0 0 0 1");
  CHECK(fault(with_matrix("[[1.001, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]")) ==
        "c.json:2: /world_to_camera: the rotation R is not orthonormal: |R R^T - I| is 0.0020009999999996975; "
        "allowed: at most 1e-04");
  CHECK_THAT(fault(with_matrix("[[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]")),
             Catch::Matchers::StartsWith("c.json:2: /world_to_camera: the rotation R mirrors: its determinant is -1;"));
  CHECK(fault(R"({"width": 0, "height": 2.5, "fx": -1, "fy": 1, "cx": 0, "cy": 0, "world_to_camera": )" + kIdentity +
              "}") ==
        "3 problems in c.json:\nc.json:1: /width: 0 is out of range; allowed: 1 to 65536\n"
        "c.json:1: /height: 2.5 is not a whole number; allowed: 1 to 65536\n"
        "c.json:1: /fx: -1 is out of range; allowed: above 0");
  CHECK(fault(R"({"format": "hsi4d cameras", "version": 2, "cameras": []})") ==
        "c.json:1: /version: 2 is out of range; allowed: 1 to 1");
  CHECK(fault("{\"format\": \"hsi4d cameras\", \"version\": 1, \"cameras\": [\n" + with_matrix(kIdentity) + ",\n" +
              with_matrix("[[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]") + "]}") ==
        "c.json:4: /cameras/1/world_to_camera: the rotation R is not orthonormal: |R R^T - I| is 3; "
        "allowed: at most 1e-04");
  CHECK(fault("{\"width\": 4,}") != "no fault");
}

TEST_CASE("nerfstudio's transforms are turned from OpenGL to OpenCV axes") {
  // A camera at (0, -5, 1) that looks along +y with z up: in OpenGL's axes x = +x, y = +z, z = -y of the world.
  const std::string text = R"({"camera_model": "OPENCV", "w": 800, "h": 600.0, "fl_x": 700, "fl_y": 710, "cx": 400,
    "cy": 300, "k1": 0.0, "p2": 0, "orientation_override": "none", "ply_file_path": "x.ply", "frames": [
    {"file_path": "a.png", "transform_matrix": [[1, 0, 0, 0], [0, 0, -1, -5], [0, 1, 0, 1], [0, 0, 0, 1]]},
    {"file_path": "b.png", "w": 80, "fl_x": 70, "cx": 40,
     "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 9], [0, 0, 0, 1]]}]})";
  const std::vector<Camera> cameras = decode_cameras(text, "transforms.json");
  REQUIRE(cameras.size() == 2);
  CHECK(cameras[0].width == 800);
  CHECK(cameras[0].height == 600);
  CHECK(cameras[0].fy == 710);
  CHECK(camera_center_world(cameras[0]) == Vector3<double>(0, -5, 1));
  // 2 m ahead, 1 m to the right, 0.5 m up: right and up in the image.
  const Vector3<double> seen = transform_point(cameras[0].camera_from_world, Vector3<double>(1, -3, 1.5));
  CHECK(seen == Vector3<double>(1, -0.5, 2));
  CHECK(cameras[1].width == 80);
  CHECK(cameras[1].height == 600);
  CHECK(cameras[1].fx == 70);
  CHECK(cameras[1].cx == 40);
  CHECK(transform_point(cameras[1].camera_from_world, Vector3<double>(0, 0, 7)) == Vector3<double>(0, 0, 2));
}

TEST_CASE("a pose whose matrix is off by what is allowed is inverted, not transposed") {
  // Far away, so that 5e-5 of the rotation are 5 cm of the place.
  const Vector3<double> center(600, -800, 20);
  Matrix3<double> rotation = so3_exp(Vector3<double>(0.3, -1.1, 0.4));
  rotation(0, 0) += 5e-5;
  rotation(1, 2) -= 3e-5;
  std::string rows;
  for (int r = 0; r < 3; ++r) {
    rows += "[";
    for (int c = 0; c < 3; ++c) rows += precise(rotation(r, c)) + ", ";
    rows += precise(center[r]) + "], ";
  }
  const Camera camera =
      decode_cameras(R"({"w": 8, "h": 6, "fl_x": 7, "fl_y": 7, "cx": 4, "cy": 3, "frames": [{"transform_matrix": [)" +
                         rows + "[0, 0, 0, 1]]}]}",
                     "c.json")[0];
  CHECK((camera_center_world(camera) - center).norm() < 1e-10);
  CHECK(transform_point(camera.camera_from_world, center).norm() < 1e-10);
  // A point of OpenGL's camera goes to the world by the file's matrix, and back to where OpenCV's axes have it.
  const Vector3<double> world = rotation * Vector3<double>(1, 2, -300) + center;
  CHECK((transform_point(camera.camera_from_world, world) - Vector3<double>(1, -2, 300)).norm() < 1e-9);
}

TEST_CASE("transforms that cannot be used are refused") {
  const auto transforms = [](const std::string& top, const std::string& frame) {
    return "{" + top + "\"h\": 6, \"fl_x\": 7, \"fl_y\": 7, \"cx\": 4, \"cy\": 3, \"frames\": [\n{" + frame +
           "\"transform_matrix\": " + kIdentity + "}]}";
  };
  CHECK(fault(transforms("\"w\": 8, ", "")) == "no fault");
  CHECK(fault(transforms("", "\"w\": 8, ")) == "no fault");
  CHECK(fault(transforms("", "")) == "c.json:2: /frames/0: w is missing, here and at the top of the file");
  CHECK(fault(transforms("\"w\": 8, \"k1\": 0.03, ", "")) ==
        "c.json:1: /k1: 0.03 is a lens distortion, which is not rendered: undistort the images first; allowed: 0");
  CHECK(fault(transforms("\"w\": 8, ", "\"p1\": -1e-9, ")) ==
        "c.json:2: /frames/0/p1: -1e-9 is a lens distortion, which is not rendered: undistort the images first; "
        "allowed: 0");
  CHECK(fault(transforms("\"w\": 8, \"camera_model\": \"OPENCV_FISHEYE\", ", "")) ==
        "c.json:1: /camera_model: \"OPENCV_FISHEYE\" is not one of the choices; allowed: \"PINHOLE\", "
        "\"SIMPLE_PINHOLE\", \"OPENCV\"");
  CHECK(fault(R"({"w": 1, "h": 1, "fl_x": 1, "fl_y": 1, "cx": 0, "cy": 0, "frames": [{}, 3]})") ==
        "2 problems in c.json:\nc.json:1: /frames/0: the key \"transform_matrix\" is missing; allowed: 4 rows of 4 "
        "numbers\n"
        "c.json:1: /frames/1: 3 is a number, not an object");
  CHECK(fault(R"({"w": 1, "h": 1, "fl_x": 1, "fl_y": 1, "cx": 0, "cy": 0, "frames": [{"transform_matrix":
        [[1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]})") ==
        "c.json:1: /frames/0/transform_matrix: the rotation R is not orthonormal: |R R^T - I| is 1; allowed: at most "
        "1e-04");
  CHECK_THAT(fault(R"({"w": 1, "h": 1, "fl_x": 1, "fl_y": 1, "cx": 0, "cy": 0, "frames": [{"transform_matrix":
        [[1, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]}]})"),
             Catch::Matchers::StartsWith("c.json:1: /frames/0/transform_matrix: the rotation R mirrors: its "
                                         "determinant is -1;"));
  CHECK(fault(R"({"w": "8", "frames": {}})") ==
        "2 problems in c.json:\nc.json:1: /w: \"8\" is a string, not a whole number; allowed: 1 to 65536\n"
        "c.json:1: /frames: {} is an object, not an array");
}

TEST_CASE("transforms of another lens or shutter are refused, whoever's word for it they use") {
  const auto fault_of = [](const std::string& top, const std::string& frame = "") {
    return fault("{" + top + "\"w\": 8, \"h\": 6, \"fl_x\": 7, \"fl_y\": 7, \"cx\": 4, \"cy\": 3, \"frames\": [\n{" +
                 frame + "\"transform_matrix\": " + kIdentity + "}]}");
  };
  CHECK(fault_of("\"is_fisheye\": true, ") ==
        "c.json:1: /is_fisheye: true says that this is a fisheye lens; pinhole cameras alone are drawn: undistort the "
        "images first");
  CHECK(
      fault_of("", "\"rolling_shutter_time\": 0.012, ") ==
      "c.json:2: /frames/0/rolling_shutter_time: 0.012 says that this is a rolling shutter; pinhole cameras alone are "
      "drawn: undistort the images first");
  for (const char* other : {"\"ftheta_p0\": 1e-9, ",
                            "\"fisheye_crop_radius\": 300, ",
                            "\"latlong\": true, ",
                            "\"equirectangular\": 1, ",
                            "\"is_orthographic\": true, ",
                            "\"ortho_scale\": 2.5, ",
                            "\"rolling_shutter\": [0, 0.5, 0, 0], ",
                            "\"camera_type\": \"equirectangular\", ",
                            "\"lens_type\": \"FISHEYE\", ",
                            "\"distortion\": {\"k\": [0.1]}, ",
                            "\"shutter_type\": \"ROLLING_TOP_TO_BOTTOM\", ",
                            "\"lens\": \"GoPro, Fisheye\", ",
                            "\"xi\": 0.7, ",
                            "\"camera_model\": \"OPENCV_FISHEYE\", ",
                            "\"camera_model\": \"fisheye\", ",
                            "\"model\": \"fisheye624\", ",
                            "\"k5\": 0.1, ",
                            "\"s1\": 0.1, ",
                            "\"from_mitsuba\": true, ",
                            "\"skew\": 0.3, "}) {
    INFO(other);
    CHECK(fault_of(other) != "no fault");
    CHECK(fault_of("", other) != "no fault");
  }
  for (const char* pinhole :
       {"\"is_fisheye\": false, ", "\"rolling_shutter_time\": 0.0, ", "\"rolling_shutter\": [0, 0, -0.0, 0e7], ",
        "\"ortho_scale\": null, ", "\"camera_type\": \"perspective\", ", "\"distortion_model\": \"none\", ",
        "\"undistorted\": true, ", "\"k6\": 0, ", "\"shutter_speed\": 0.01, ", "\"shutter_type\": \"GLOBAL\", ",
        "\"lens\": \"24 mm f/1.8\", ", "\"xi\": 0, ", "\"aabb_scale\": 16, "}) {
    INFO(pinhole);
    CHECK(fault_of(pinhole) == "no fault");
    CHECK(fault_of("", pinhole) == "no fault");
  }
}

}  // namespace camera_file_test
