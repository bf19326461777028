// A chunk in a PNG file that a test makes.
#pragma once

#include <string_view>

#include "core/file.h"
#include "tests/support/crc32.h"

namespace hsi4d::test {

/// The PNG with one more chunk, behind its header.
inline Bytes with_png_chunk(Bytes png, std::string_view type, std::string_view content) {
  constexpr std::ptrdiff_t kHeaderEnd = 33;
  const auto be32 = [](std::size_t value) {
    Bytes bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<uint8_t>(value >> shift));
    return bytes;
  };
  Bytes checked(type.begin(), type.end());
  checked.insert(checked.end(), content.begin(), content.end());
  Bytes chunk = be32(content.size());
  chunk.insert(chunk.end(), checked.begin(), checked.end());
  const Bytes checksum = be32(crc32_of(checked));
  chunk.insert(chunk.end(), checksum.begin(), checksum.end());
  png.insert(png.begin() + kHeaderEnd, chunk.begin(), chunk.end());
  return png;
}

}  // namespace hsi4d::test
