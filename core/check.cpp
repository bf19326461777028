#include "core/check.h"

#include <string_view>

namespace hsi4d {

std::string source_name(const Source& where) {
  const std::string_view path = where.file_name();
  const size_t slash = path.find_last_of('/');
  const std::string_view file = slash == std::string_view::npos ? path : path.substr(slash + 1);
  return std::string(file) + ":" + std::to_string(where.line());
}

namespace detail {

void fail_check(const char* condition, const std::string& values, const Source& where) {
  throw InternalError(source_name(where) + ": check failed: " + condition + " (" + values + ")");
}

}  // namespace detail
}  // namespace hsi4d
