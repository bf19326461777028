#include <cmath>

#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "pipelines/photos/photo.h"
#include "stress/scratch_folder.h"

namespace posed_images_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace fs = std::filesystem;

namespace {

/// A folder with pictures of 8 x 6 pixels of one colour.
struct Pictures {
  explicit Pictures(const std::vector<std::string>& names, int width = 8) {
    for (const std::string& name : names) write(name, 3, 0.5F, width);
  }
  void write(const std::string& name, int channels, float value, int width = 8) const {
    Image image(channels, 6, width);
    for (int c = 0; c < channels; ++c) {
      for (int y = 0; y < 6; ++y) std::fill_n(image.row(c, y), width, value);
    }
    const fs::path file = path(name);
    fs::create_directories(file.parent_path());
    write_image(file.string(), image, {.png_bits = 16});
  }
  fs::path path(const std::string& name) const { return fs::path(folder.path()) / name; }
  fs::path text(const std::string& name, const std::string& content) const {
    fs::create_directories(path(name).parent_path());
    write_text_file(path(name).string(), content);
    return path(name);
  }
  ScratchFolder folder;
};

const std::string kIdentity = R"("transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]])";
const std::string kIntrinsics = R"("w": 8, "h": 6, "fl_x": 10, "fl_y": 10, "cx": 4, "cy": 3)";

std::string entry(const std::string& name, const std::string& more = "") {
  return R"({"file_path": ")" + name + "\", " + more + kIdentity + "}";
}
std::string transforms(const std::string& top, const std::vector<std::string>& entries) {
  std::string text = "{" + top + ", \"frames\": [";
  for (std::size_t i = 0; i < entries.size(); ++i) text += (i == 0 ? "" : ", ") + entries[i];
  return text + "]}";
}

template <class F>
std::string message(F&& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("pictures of transforms.json, with lens, mask and depth, by name") {
  const Pictures made({"images/b.png", "images/a.png", "masks/a.png", "depths/c.png"});
  Image mask(1, 6, 8);  // whole, but for column 4
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) mask(0, y, x) = x == 4 ? 0.5F : 1.0F;
  }
  write_image(made.path("masks/a.png").string(), mask, {.png_bits = 16});
  made.write("depths/a.png", 1, 0.5F);
  made.write("depths/b.png", 1, 0.5F);
  const fs::path file = made.text(
      "transforms.json",
      transforms(
          kIntrinsics + R"(, "k1": 0.1, "p2": 0.01)",
          {entry("images/b.png", R"("k1": 0.2, "mask_path": "masks/a.png", "depth_file_path": "depths/b.png", )"),
           entry("./images/a", R"("mask_path": "masks/a.png", "depth_file_path": "depths/a.png", )")}));
  const PosedImages set = read_posed_images(file);
  REQUIRE(set.images.size() == 2);
  CHECK(set.images[0].name == "./images/a");
  CHECK(set.images[0].image.filename() == "a.png");
  CHECK(set.images[0].mask.filename() == "a.png");
  CHECK(set.images[0].lens == Lens{.k1 = 0.1, .p2 = 0.01});
  CHECK(set.images[1].lens == Lens{.k1 = 0.2, .p2 = 0.01});
  // OpenGL looks along −z, OpenCV along z.
  CHECK(set.images[0].camera.camera_from_world.rotation(2, 2) == -1);
  CHECK_THROWS_AS(read_cameras(file.string()), UserError);  // nobody straightens there
  PhotoRules rules;
  rules.depth_unit = 0.002;
  Photo photo = read_photo(set.images[0], rules);
  CHECK(photo.weight(0, 3, 4) == Approx(0.5).margin(0.05));  // half of it counts; the lens bends a little
  CHECK(photo.weight(0, 3, 2) == Approx(1));
  CHECK(photo.alpha.empty());
  CHECK(photo.depth(0, 3, 4) == Approx(0.002 * std::round(0.5 * 65535)).epsilon(1e-6));
  rules.masks = MaskMeaning::kWanted;
  photo = read_photo(set.images[0], rules);
  CHECK(photo.weight(0, 3, 4) == 1);  // the lens shows it
  CHECK(photo.alpha(0, 3, 4) == Approx(0.5).margin(0.05));
  PosedImage colored = set.images[0];
  colored.depth = made.path("depths/c.png");
  CHECK_THAT(message([&] { read_photo(colored, rules); }), Contains("allowed: a grey PNG of 16 bits, OpenEXR"));
}

TEST_CASE("a field of view stands for intrinsics that a file does not have") {
  const Pictures made({"train/r_0.png"});
  const fs::path file = made.text(
      "transforms_train.json", transforms(R"("camera_angle_x": 1.0)", {entry("./train/r_0", R"("rotation": 0.01, )")}));
  const PosedImages set = read_posed_images(made.folder.path());
  REQUIRE(set.images.size() == 1);
  CHECK(set.images[0].camera.width == 8);
  CHECK(set.images[0].camera.fx == Approx(4 / std::tan(0.5)));
  CHECK(set.images[0].camera.cy == 3);
  CHECK_THAT(message([&] { read_cameras(file.string()); }), Contains("w is missing"));
}

TEST_CASE("what else a file says of intrinsics counts beside a field of view") {
  const Pictures made({"a.png"});
  const auto camera = [&](const std::string& top) {
    return read_posed_images(made.text("transforms.json", transforms(top, {entry("a.png")}))).images[0].camera;
  };
  const Camera given = camera(R"("camera_angle_x": 1.0, "camera_angle_y": 0.5, "cx": 3.5, "w": 8)");
  CHECK(given.cx == 3.5);
  CHECK(given.cy == 3);
  CHECK(given.fy == Approx(3 / std::tan(0.25)));
  const PosedImages other = read_posed_images(
      made.text("transforms.json", transforms(R"("camera_angle_x": 1.0, "w": 16)", {entry("a.png")})));
  CHECK_THAT(message([&] { read_photo(other.images[0], {}); }), Contains("its camera has 16 x 6"));
}

TEST_CASE("what is transparent has no part in colours that are made smaller or straightened") {
  const Pictures made({});
  Image picture(4, 6, 8);  // red on the left, and on the right a blue that nobody sees
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) {
      picture(0, y, x) = x < 3 ? 1.0F : 0.0F;
      picture(2, y, x) = x < 3 ? 0.0F : 1.0F;
      picture(3, y, x) = x < 3 ? 1.0F : 0.0F;
    }
  }
  write_image(made.path("p.png").string(), picture);
  Image multiplied(4, 6, 8);  // as OpenEXR has colours: half of a grey
  for (int c = 0; c < 4; ++c) {
    for (int y = 0; y < 6; ++y) std::fill_n(multiplied.row(c, y), 8, c == 3 ? 0.5F : 0.25F);
  }
  write_image(made.path("p.exr").string(), multiplied);
  PosedImage posed;
  posed.image = made.path("p.png");
  posed.camera.width = 8;
  posed.camera.height = 6;
  posed.camera.fx = posed.camera.fy = 10;
  posed.camera.cx = 4;
  posed.camera.cy = 3;
  PhotoRules rules;
  rules.longest_side = 4;
  Photo photo = read_photo(posed, rules);
  CHECK(photo.color(0, 1, 1) == 1);  // columns 2 and 3: one of them counts
  CHECK(photo.color(2, 1, 1) == 0);
  CHECK(photo.alpha(0, 1, 1) == 0.5F);
  rules.longest_side = 0;
  PosedImage exr = posed;
  exr.image = made.path("p.exr");
  CHECK(read_photo(exr, rules).color(0, 2, 2) == 0.5F);
  CHECK(read_photo(exr, rules).alpha(0, 2, 2) == 0.5F);
  multiplied(1, 4, 5) = std::nanf("");
  write_image(made.path("p.exr").string(), multiplied);
  CHECK_THAT(message([&] { read_photo(exr, rules); }), Contains("the pixel of row 4 and column 5 is not finite"));
  posed.lens.k1 = 0.5;
  photo = read_photo(posed, rules);
  for (int x = 0; x < 8; ++x) {
    if (photo.weight(0, 3, x) > 0 && photo.alpha(0, 3, x) > 0) {
      CHECK(photo.color(0, 3, x) == Approx(1));
      CHECK(photo.color(2, 3, x) == 0);
    }
  }
}

TEST_CASE("pictures of INRIA's cameras.json") {
  const Pictures made({"images/00001.png"});
  const auto cameras = [](const std::string& rotation) {
    return R"([{"id": 0, "img_name": "00001", "width": 8, "height": 6, "position": [1, 2, 3], "rotation": )" +
           rotation + R"(, "fy": 11, "fx": 10}])";
  };
  const PosedImages set = read_posed_images(made.text("cameras.json", cameras("[[0,0,1],[1,0,0],[0,1,0]]")));
  REQUIRE(set.images.size() == 1);
  const Camera& camera = set.images[0].camera;
  CHECK(camera_center_world(camera).isApprox(Vector3<double>(1, 2, 3), 1e-15));
  CHECK(camera.camera_from_world.rotation.row(2).isApprox(Vector3<double>(1, 0, 0).transpose()));  // looks along x
  CHECK(camera.cx == 4);
  CHECK(camera.fy == 11);
  CHECK_THAT(message([&] { read_posed_images(made.text("cameras.json", cameras("[[2,0,0],[0,2,0],[0,0,2]]"))); }),
             Contains("/0/rotation"));
  CHECK_THAT(message([&] { read_posed_images(made.text("cameras.json", "[]")); }), Contains("holds no camera"));
  CHECK_THAT(message([&] { read_posed_images(made.text("cameras.json", "[{}]")); }),
             Contains("the key \"img_name\" is missing"));
}

TEST_CASE("pictures of a folder of COLMAP") {
  const Pictures made({"images/a.png", "images/b.png", "masks/a.png", "masks/b.png.png"});
  made.text("sparse/0/cameras.txt", "1 SIMPLE_RADIAL 8 6 10 4 3 0.1\n");
  made.text("sparse/0/images.txt", "1 1 0 0 0 0 0 0 1 b.png\n\n2 1 0 0 0 1 0 0 1 a.png\n\n");
  made.text("sparse/0/points3D.txt", "1 0 0 1 255 255 255 0.1\n");
  const PosedImages set = read_posed_images(made.folder.path());
  REQUIRE(set.images.size() == 2);
  CHECK(set.images[0].name == "a.png");
  CHECK(set.images[0].mask.filename() == "a.png");
  CHECK(set.images[1].mask.filename() == "b.png.png");
  CHECK(set.points.size() == 1);
  CHECK(set.images[0].lens.k1 == 0.1);
  fs::remove(made.path("masks/a.png"));
  CHECK_THAT(message([&] { read_posed_images(made.folder.path()); }), Contains("1 of 2 pictures have no mask: a.png"));
  fs::remove(made.path("masks/b.png.png"));
  made.write("masks/other.png", 1, 1);
  CHECK_THAT(message([&] { read_posed_images(made.folder.path()); }),
             Contains("masks: no file there has the name of a picture, such as b.png"));
  CHECK_THAT(message([&] { read_posed_images(made.path("images/a.png")); }), Contains("is a picture; allowed: "));
  fs::remove_all(made.path("masks"));
  fs::remove(made.path("images/a.png"));
  CHECK(read_posed_images(made.folder.path()).images.size() == 1);  // the other camera is left out
  fs::remove(made.path("images/b.png"));
  CHECK_THAT(message([&] { read_posed_images(made.folder.path()); }), Contains("2 of 2 cameras have no picture in"));
}

TEST_CASE("sets of pictures that make no sense are refused") {
  const Pictures made({"a.png"});
  CHECK_THAT(message([&] { read_posed_images(made.folder.path()); }),
             Contains("no cameras are there; allowed: a folder with a model of COLMAP"));
  const auto refused = [&](const std::string& top, const std::vector<std::string>& entries) {
    return message([&] { read_posed_images(made.text("transforms.json", transforms(top, entries))); });
  };
  CHECK_THAT(refused(kIntrinsics, {entry("a.png"), entry("a.png")}), Contains("two cameras are of one picture: a.png"));
  CHECK_THAT(refused(kIntrinsics, {entry("a.png"), entry("./a")}), Contains("two cameras are of one picture: ./a"));
  CHECK_THAT(refused(kIntrinsics, {entry("z.png")}), Contains("1 of 1 cameras have no picture in"));
  CHECK_THAT(refused(kIntrinsics, {entry("a.png", R"("mask_path": "m.png", )")}),
             Contains("names m.png, which is not there"));
  CHECK_THAT(refused(kIntrinsics + R"(, "k4": 0.1)", {entry("a.png")}), Contains("/k4"));
  CHECK_THAT(refused(kIntrinsics + R"(, "is_fisheye": true)", {entry("a.png")}), Contains("/is_fisheye"));
  CHECK_THAT(refused(kIntrinsics, {}), Contains("holds no camera of a picture"));
  CHECK_THAT(refused(kIntrinsics, {"{" + kIdentity + "}"}), Contains("names no picture (file_path)"));
}

TEST_CASE("a picture is read as its camera says") {
  const Pictures made({"a.png"});
  made.write("grey.png", 1, 0.25F);
  made.write("alpha.png", 4, 0.75F);
  PosedImage posed;
  posed.image = made.path("a.png");
  posed.camera.width = 9;
  posed.camera.height = 6;
  posed.camera.fx = posed.camera.fy = 10;
  posed.camera.cx = 4;
  posed.camera.cy = 3;
  CHECK_THAT(message([&] { read_photo(posed, {}); }), Contains("a picture of 8 x 6 pixels; its camera has 9 x 6"));
  posed.camera.width = 8;
  posed.image = made.path("grey.png");
  CHECK(read_photo(posed, {}).color.channels() == 3);
  posed.image = made.path("alpha.png");
  PhotoRules rules;
  rules.longest_side = 4;
  const Photo photo = read_photo(posed, rules);
  CHECK(photo.camera.width == 4);
  CHECK(photo.camera.height == 3);
  CHECK(photo.camera.fx == 5);
  CHECK(photo.alpha(0, 1, 1) == Approx(0.75).epsilon(1e-4));
  Image depth(1, 6, 8);
  depth(0, 2, 2) = -1;
  write_image(made.path("depth.exr").string(), depth);
  posed.depth = made.path("depth.exr");
  CHECK_THAT(message([&] { read_photo(posed, {}); }), Contains("a depth of -1"));
}

}  // namespace posed_images_test
