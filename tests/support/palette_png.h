// PNG files with a palette, made by hand: as programs write masks of several labels.
#pragma once

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "tests/support/crc32.h"

namespace hsi4d::test {

/// A PNG of 8-bit indices.
/// @param indices  row by row
/// @param colors   red, green, blue, alpha by index; a tRNS chunk is written where an alpha is not 255
inline Bytes palette_png(int width, int height, const Bytes& indices,
                         const std::vector<std::array<uint8_t, 4>>& colors) {
  const auto put_be32 = [](Bytes& bytes, uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<uint8_t>(value >> shift));
  };
  Bytes file = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  const auto add_chunk = [&](std::string_view name, const Bytes& content) {
    put_be32(file, static_cast<uint32_t>(content.size()));
    Bytes checked(name.begin(), name.end());
    checked.insert(checked.end(), content.begin(), content.end());
    file.insert(file.end(), checked.begin(), checked.end());
    put_be32(file, crc32_of(checked));
  };
  Bytes header;
  put_be32(header, static_cast<uint32_t>(width));
  put_be32(header, static_cast<uint32_t>(height));
  header.insert(header.end(), {8, 3, 0, 0, 0});  // bits, palette
  add_chunk("IHDR", header);
  Bytes palette, alphas;
  for (const auto& color : colors) {
    palette.insert(palette.end(), color.begin(), color.begin() + 3);
    alphas.push_back(color[3]);
  }
  add_chunk("PLTE", palette);
  if (std::any_of(alphas.begin(), alphas.end(), [](uint8_t a) { return a != 255; })) add_chunk("tRNS", alphas);
  Bytes rows;
  for (int y = 0; y < height; ++y) {
    rows.push_back(0);  // no filter
    rows.insert(rows.end(), indices.begin() + y * width, indices.begin() + (y + 1) * width);
  }
  // zlib: one block that is stored, and Adler's sum
  const auto size = static_cast<uint16_t>(rows.size());
  Bytes packed = {0x78, 0x01, 1};
  for (const int value : {int{size}, ~int{size}}) {
    packed.push_back(static_cast<uint8_t>(value & 255));
    packed.push_back(static_cast<uint8_t>(value >> 8 & 255));
  }
  packed.insert(packed.end(), rows.begin(), rows.end());
  uint32_t a = 1, b = 0;
  for (const uint8_t byte : rows) {
    a = (a + byte) % 65521;
    b = (b + a) % 65521;
  }
  put_be32(packed, b << 16 | a);
  add_chunk("IDAT", packed);
  add_chunk("IEND", {});
  return file;
}

}  // namespace hsi4d::test
