#include "core/formatted.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace hsi4d {

std::string formatted(const char* format, ...) {
  std::va_list numbers, again;
  va_start(numbers, format);
  va_copy(again, numbers);
  const int size = std::vsnprintf(nullptr, 0, format, numbers);
  va_end(numbers);
  std::string text(static_cast<std::size_t>(size > 0 ? size : 0), '\0');
  if (size > 0) std::vsnprintf(text.data(), text.size() + 1, format, again);
  va_end(again);
  return text;
}

std::string fixed_number(double value, int decimals) {
  if (!std::isfinite(value)) return "not finite";
  std::array<char, 512> buffer;  // the longest double has 309 digits before its point
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::fixed, decimals);
  std::string text(buffer.data(), end.ptr);
  const bool is_zero = text.find_first_not_of("-0.") == std::string::npos;
  return is_zero && text.starts_with('-') ? text.substr(1) : text;
}

}  // namespace hsi4d
