// Images of the kinds that OpenImageIO reads for us, told by their content alone.
#include "core/image_io.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::other_image_fuzz {

namespace {

Scratch& scratch() {
  static Scratch made({ScratchFile{"image", {}}});
  return made;
}

Bytes numbered(Bytes file, int count) {
  for (int i = 0; i < count; ++i) file.push_back(static_cast<uint8_t>(7 * i));
  return file;
}

/// BITMAPFILEHEADER, BITMAPINFOHEADER, 3x2 pixels of 24 bits.
Bytes bmp() {
  Bytes file = {'B', 'M', 78, 0, 0, 0, 0, 0, 0, 0, 54, 0, 0, 0, 40, 0, 0, 0, 3, 0, 0, 0, 2, 0, 0, 0, 1, 0, 24, 0};
  file.resize(54);
  return numbered(file, 24);
}

/// One strip of 3x2 grey pixels of 8 bits.
Bytes tiff() {
  Bytes file = {'I', 'I', 42, 0, 14, 0, 0, 0, 10, 20, 30, 40, 50, 60, 9, 0};
  const auto add = [&file](int tag, int type, int value) {
    for (const int part : {tag, type, 1, 0, value, 0}) {
      file.push_back(static_cast<uint8_t>(part & 255));
      file.push_back(static_cast<uint8_t>(part >> 8));
    }
  };
  for (const auto& [tag, value] :
       {std::pair{256, 3}, {257, 2}, {258, 8}, {259, 1}, {262, 1}, {273, 8}, {277, 1}, {278, 2}, {279, 6}})
    add(tag, 3, value);
  file.resize(file.size() + 4);
  return file;
}

}  // namespace

std::vector<Bytes> corpus() {
  return {numbered(bytes_of("P6\n3 2\n255\n"), 18), bytes_of("P2\n3 2\n15\n1 2 3 4 5 6\n"), bmp(), tiff()};
}

bool accepts(std::span<const uint8_t> file) {
  write_file(scratch() / "image", file);
  return is_read([&] { read_image(scratch() / "image"); });
}

const Target target("other_image", corpus, accepts);

}  // namespace hsi4d::fuzz::other_image_fuzz
