// Text as printf writes it, for tables.
#pragma once

#include <string>

namespace hsi4d {

/// As printf writes it, of any length. The decimal point is that of the C locale, which the program never leaves.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

}  // namespace hsi4d
