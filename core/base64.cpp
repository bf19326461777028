#include "core/base64.h"

#include <algorithm>
#include <string_view>

namespace hsi4d {

std::string base64(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = std::min<std::size_t>(3, bytes.size() - i);
    unsigned group = static_cast<unsigned>(bytes[i]) << 16U;
    if (left > 1) group |= static_cast<unsigned>(bytes[i + 1]) << 8U;
    if (left > 2) group |= static_cast<unsigned>(bytes[i + 2]);
    for (std::size_t k = 0; k < 4; ++k) text += k <= left ? kDigits[(group >> (18 - 6 * k)) & 63U] : '=';
  }
  return text;
}

}  // namespace hsi4d
