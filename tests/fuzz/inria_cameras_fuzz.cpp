// Any bytes as a cameras.json of INRIA's programs.
#include <string>
#include <string_view>

#include "pipelines/photos/inria_cameras.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::inria_cameras_fuzz {

std::vector<Bytes> corpus() {
  constexpr std::string_view kText =
      R"([{"id": 0, "img_name": "00001", "width": 8, "height": 6, "position": [1, 2, 3],
 "rotation": [[0, 0, 1], [1, 0, 0], [0, 1, 0]], "fy": 11, "fx": 10.5}])";
  return {Bytes(kText.begin(), kText.end())};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    for (const PosedImage& image : decode_inria_cameras(std::string(file.begin(), file.end()), "fuzz.json"))
      check_camera(image.camera, "an accepted camera");
  });
}

const Target target("inria_cameras", corpus, accepts);

}  // namespace hsi4d::fuzz::inria_cameras_fuzz
