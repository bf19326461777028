// What is around the numbers of a .spz file: header, gzip stream or Zstandard frames. The layout is described in
// splat/files/io_spz.h.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "core/file.h"

namespace hsi4d {

/// The newest version that is known, and the only one in frames.
inline constexpr int kSpzVersionInFrames = 4;

/// Bits of the header's flags.
inline constexpr unsigned kSpzAntialiased = 1, kSpzHasExtensions = 2;

/// The attributes of Gaussians, in the order of the file.
enum SpzAttribute : std::size_t {
  kSpzPositions,
  kSpzOpacities,
  kSpzColors,
  kSpzScales,
  kSpzRotations,
  kSpzHarmonics,
  kSpzAttributes
};

struct SpzHeader {
  int version = 0;
  std::uint64_t count = 0;
  int degree = 0;
  int fractional_bits = 0;
  unsigned flags = 0;

  int rest_count() const { return (degree + 1) * (degree + 1) - 1; }  // K − 1
  /// Bytes of an attribute of one Gaussian.
  std::uint64_t row_bytes(std::size_t attribute) const {
    switch (attribute) {
      case kSpzPositions:
        return version == 1 ? 6 : 9;
      case kSpzOpacities:
        return 1;
      case kSpzRotations:
        return version < 3 ? 3 : 4;
      case kSpzHarmonics:
        return 3 * static_cast<std::uint64_t>(rest_count());
      default:
        return 3;
    }
  }
  std::uint64_t bytes(std::size_t attribute) const { return count * row_bytes(attribute); }  // below 2^40
  std::uint64_t all_bytes() const {
    std::uint64_t sum = 0;
    for (std::size_t a = 0; a < kSpzAttributes; ++a) sum += bytes(a);
    return sum;
  }
};

/// A file's attributes, unpacked.
struct SpzContent {
  SpzHeader header;
  Bytes memory;  // what the spans look at; hence moved, not copied
  std::array<std::span<const std::uint8_t>, kSpzAttributes> attributes;
  Bytes extensions;  // their records

  SpzContent() = default;
  SpzContent(SpzContent&&) = default;
  SpzContent& operator=(SpzContent&&) = default;
};

/// Unpacks a file of any version. Throws DataError naming the file: no .spz file, a version or degree that is not read,
/// sizes that contradict each other, damage. No more memory is taken than the file's size makes credible.
SpzContent unpack_spz(std::span<const std::uint8_t> file, const std::string& name);

/// The bytes of a file: header and attributes, packed as the header's version says.
Bytes pack_spz(const SpzHeader& header, const std::array<Bytes, kSpzAttributes>& attributes);

}  // namespace hsi4d
