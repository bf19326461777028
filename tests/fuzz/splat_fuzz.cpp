// Files of Gaussians told by content and ending, here .splat: any bytes. What is taken is whole (check_scene).
#include "splat/files/io_splat.h"
#include "splat/files/splat_file.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/splat_scene.h"

namespace hsi4d::fuzz::splat_fuzz {

std::vector<Bytes> corpus() {
  const EncodedSplats two = encode_splat(two_gaussians(0));
  Bytes bad = two.bytes;  // a scale of 0, one below it, a quaternion that is zero
  for (std::size_t i = 12; i < 16; ++i) bad.at(i) = 0;
  bad.at(32 + 19) = 0xbf;
  for (std::size_t i = 28; i < 32; ++i) bad.at(i) = 128;
  return {two.bytes,
          bad,
          {},
          encode_splats("a.spz", two_gaussians(1)).bytes,
          encode_splats("a.ply", two_gaussians(0)).bytes};
}

bool accepts(std::span<const uint8_t> file) {
  const bool is_splat = is_read([&] { check_scene(decode_splats(file, "fuzz.splat")); });
  return is_read([&] { check_scene(decode_splats(file, "fuzz.bin")); }) || is_splat;
}

const Target target("splat", corpus, accepts);

}  // namespace hsi4d::fuzz::splat_fuzz
