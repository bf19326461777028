// Any bytes as a file of cameras: the reader answers with cameras that check_camera takes, or with a UserError.
#include <string>
#include <string_view>

#include "core/camera_file.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::camera_fuzz {
namespace {

Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

}  // namespace

std::vector<Bytes> corpus() {
  return {
      bytes_of(R"({"width": 64, "height": 48, "fx": 50.5, "fy": 50, "cx": 32, "cy": 24,
 "world_to_camera": [[0, -1, 0, 7], [0, 0, -1, 8], [1, 0, 0, 9], [0, 0, 0, 1]]})"),
      bytes_of(R"({"format": "hsi4d cameras", "version": 1, "cameras": [{"width": 2, "height": 1, "fx": 1, "fy": 1,
 "cx": 1, "cy": 0.5, "world_to_camera": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]})"),
      bytes_of(R"({"camera_model": "OPENCV", "w": 8, "h": 6, "fl_x": 7, "fl_y": 7, "cx": 4, "cy": 3, "k1": 0, "frames":
 [{"file_path": "a", "transform_matrix": [[1, 0, 0, 0], [0, 0, -1, -5], [0, 1, 0, 1], [0, 0, 0, 1]]},
  {"w": 9, "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]})"),
      bytes_of(R"({"camera_angle_x": 0.7, "k1": 0.1, "frames":
 [{"file_path": "a", "mask_path": "m", "transform_matrix": [[1, 0, 0, 0], [0, 0, -1, -5], [0, 1, 0, 1], [0, 0, 0, 1]]}]})"),
  };
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
           for (const Camera& camera : decode_cameras(std::string(file.begin(), file.end()), "fuzz.json"))
             check_camera(camera, "an accepted camera");
         }) |
         is_read([&] {  // both, always
           for (const PictureCamera& one : decode_photo_cameras(std::string(file.begin(), file.end()), "fuzz.json")) {
             if (one.angle_x == 0) check_camera(one.camera, "an accepted camera of a picture");
           }
         });
}

const Target target("camera", corpus, accepts);

}  // namespace hsi4d::fuzz::camera_fuzz
