#include "core/formatted.h"

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

}  // namespace hsi4d
