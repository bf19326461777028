// Small pieces of text: lists of names, numbers in few digits. No locale.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace hsi4d {

/// "a, b, c"; empty for no words.
std::string joined(std::span<const std::string> words);

/// A number in that many significant digits, "0.01234" or "1e-08"; 0 for −0; "nan", "inf" or "-inf".
std::string rounded(double value, int digits);

/// A number in as many digits as give the same number back.
std::string number_text(double value);

/// A number of frame, row or file, with zeros before it to have at least four digits: "0007".
std::string four_digits(std::int64_t number);

}  // namespace hsi4d
