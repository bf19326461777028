// The checksum of zip and PNG, for files that tests make by hand.
#pragma once

#include <cstdint>
#include <span>

namespace hsi4d {

inline uint32_t crc32_of(std::span<const uint8_t> bytes) {
  uint32_t crc = 0xffffffffu;
  for (const uint8_t byte : bytes) {
    crc ^= byte;
    for (int k = 0; k < 8; ++k) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320u : 0);
  }
  return ~crc;
}

}  // namespace hsi4d
