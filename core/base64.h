// Bytes as text.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace hsi4d {

/// RFC 4648, section 4: with + and /, padded, in one line.
std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace hsi4d
