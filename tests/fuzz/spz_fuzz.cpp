// Files of Gaussians in .spz: the three ways in which they are packed. The first byte says which: mutations of a gzip
// stream seldom get past its checksum, so what is inside is tried without it too. What is taken is whole (check_scene).
#include "core/compression.h"
#include "splat/files/io_spz.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/splat_scene.h"

namespace hsi4d::fuzz::spz_fuzz {
namespace {

Bytes unpacked(const Bytes& gzip) {
  GzipReader reader(gzip, "corpus");
  Bytes plain(std::size_t{1} << 16);
  plain.resize(reader.read_some(plain));
  return plain;
}

Bytes behind(std::uint8_t first, Bytes file) {
  file.insert(file.begin(), first);
  return file;
}

/// With the flag, and a record of extensions at the end: other axes.
Bytes with_extension(Bytes plain) {
  plain[14] = 3;
  for (const int byte : {3, 0, 0xbe, 0xad, 4, 0, 0, 0, 8, 0, 0, 0}) plain.push_back(static_cast<std::uint8_t>(byte));
  return plain;
}

}  // namespace

std::vector<Bytes> corpus() {
  const Bytes two = encode_spz(two_gaussians(1), {.version = 2}).bytes;
  const Bytes three = encode_spz(two_gaussians(3), {.version = 3}).bytes;
  const Bytes four = encode_spz(two_gaussians(2), {.version = 4}).bytes;
  return {behind(0, two),           behind(0, three),
          behind(0, four),          behind(0, unpacked(three)),
          behind(1, unpacked(two)), behind(1, with_extension(unpacked(three)))};
}

bool accepts(std::span<const uint8_t> file) {
  if (file.empty()) return false;
  const auto rest = file.subspan(1);
  const Bytes content = file[0] % 2 == 1 ? compress_gzip(rest) : Bytes(rest.begin(), rest.end());
  return is_read([&] { check_scene(decode_spz(content, "fuzz.spz")); });
}

const Target target("spz", corpus, accepts);

}  // namespace hsi4d::fuzz::spz_fuzz
