#include "pipelines/photos/photo_set.h"

#include "core/config_value.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/text.h"

namespace hsi4d {

namespace {

std::string image_name(Index number) { return "images/" + four_digits(number) + ".png"; }
std::string depth_name(Index number) { return "depths/" + four_digits(number) + ".exr"; }

ConfigValue matrix_value(const Camera& camera) {
  const Rigid<double> world_from_camera = inverse(camera.camera_from_world);
  Matrix4<double> matrix = matrix_from_rigid(world_from_camera);
  matrix.col(1) *= -1;  // OpenGL's camera has y up and z backward
  matrix.col(2) *= -1;
  ConfigValue rows = ConfigValue::make_array();
  for (int i = 0; i < 4; ++i) {
    ConfigValue row = ConfigValue::make_array();
    for (int j = 0; j < 4; ++j) row.items.push_back(ConfigValue::make_number(matrix(i, j)));
    rows.items.push_back(std::move(row));
  }
  return rows;
}

ConfigValue transforms_of(const Camera& camera) {
  ConfigValue file = ConfigValue::make_object();
  file.add("camera_model", ConfigValue::make_string("PINHOLE"));
  file.add("w", ConfigValue::make_integer(camera.width));
  file.add("h", ConfigValue::make_integer(camera.height));
  file.add("fl_x", ConfigValue::make_number(camera.fx));
  file.add("fl_y", ConfigValue::make_number(camera.fy));
  file.add("cx", ConfigValue::make_number(camera.cx));
  file.add("cy", ConfigValue::make_number(camera.cy));
  return file;
}

}  // namespace

void write_photo(const FolderInMaking& out, Index number, const Image& picture, const Image& depth) {
  write_image(out.file(image_name(number)), picture);
  write_image(out.file(depth_name(number)), depth);
}

void write_photo_cameras(const FolderInMaking& out, std::span<const Camera> cameras) {
  ConfigValue frames = ConfigValue::make_array();
  for (Index k = 0; k < std::ssize(cameras); ++k) {
    ConfigValue frame = ConfigValue::make_object();
    frame.add("file_path", ConfigValue::make_string(image_name(k)));
    frame.add("depth_file_path", ConfigValue::make_string(depth_name(k)));
    frame.add("transform_matrix", matrix_value(cameras[static_cast<std::size_t>(k)]));
    frames.items.push_back(std::move(frame));
  }
  ConfigValue transforms = transforms_of(cameras.front());
  transforms.add("frames", std::move(frames));
  write_text_file(out.file("transforms.json"), to_json(transforms));
}

}  // namespace hsi4d
