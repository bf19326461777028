// Numbers and text of tables.
#pragma once

#include <string>

namespace hsi4d {

/// As printf writes it, of any length. The decimal point is that of the C locale, which the program never leaves.
[[gnu::format(printf, 1, 2)]] std::string formatted(const char* format, ...);

/// `value` with a fixed number of decimals, whatever the locale; "-0.00" is "0.00". "not finite" for NaN and infinity.
std::string fixed_number(double value, int decimals);

}  // namespace hsi4d
