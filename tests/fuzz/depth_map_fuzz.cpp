// Any bytes as a depth map: a picture, OpenEXR, an array, an archive of arrays.
#include "core/exr.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "pipelines/input/depth_maps.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::depth_map_fuzz {

std::vector<Bytes> corpus() {
  Image map(1, 3, 4);
  for (int i = 0; i < 12; ++i) map(0, i / 4, i % 4) = static_cast<float>(i) / 12;
  const std::vector<float> numbers = to_interleaved(map);
  Layers layers{{"R", "Z"}, Image(2, 3, 4), ""};
  NpzWriter archive;
  archive.add<float>("depth", {1, 3, 4}, numbers);
  archive.add<float>("focal", {1}, {500});
  return {encode_image("a.png", map, {.png_bits = 16}), encode_image("a.exr", map), encode_layers("a", layers),
          encode_npy<float>(std::vector<std::int64_t>{3, 4, 1}, numbers), archive.encode()};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const ImageLimits limits{.max_bytes = int64_t{32} << 20};  // what takes long to clear is no finding
    const Image map = decode_depth_map(Bytes(file.begin(), file.end()), "fuzz", limits);
    HSI4D_CHECK(map.channels() == 1 && map.height() > 0 && map.width() > 0, "an accepted map");
  });
}

const Target target("depth_map", corpus, accepts);

}  // namespace hsi4d::fuzz::depth_map_fuzz
