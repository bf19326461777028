#include <cmath>

#include "core/exr.h"
#include "core/image_io.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::exr_fuzz {

std::vector<Bytes> corpus() {
  Layers layers{{"R", "G", "B", "Z", "mask.human.A"}, Image(5, 6, 9), ""};
  for (int c = 0; c < 5; ++c) {
    for (int y = 0; y < 6; ++y) {
      for (int x = 0; x < 9; ++x) layers.planes(c, y, x) = std::sin(static_cast<float>(c + 2 * y + 3 * x));
    }
  }
  Image grey(1, 40, 3);
  grey(0, 20, 1) = 4;
  return {encode_layers("a", layers), encode_layers("a", layers, ExrPixels::half), encode_image("a.exr", grey)};
}

bool accepts(std::span<const uint8_t> file) {
  const ImageLimits limits{.max_bytes = int64_t{32} << 20};  // what takes long to clear is no finding
  is_read([&] { decode_image(file, "fuzz", limits); });
  return is_read([&] { decode_layers(file, "fuzz", limits); });
}

const Target target("exr", corpus, accepts);

}  // namespace hsi4d::fuzz::exr_fuzz
