// Small pieces of text that the commands share.
#pragma once

#include <span>
#include <string>

namespace hsi4d::cli {

/// A number in 4 significant digits, without locale; 0 for −0.
std::string short_number(double value);

/// The ending of a path in lower case with its dot, ".ply"; "" without one.
std::string file_ending(const std::string& path);

/// "a, b, c".
std::string joined(std::span<const std::string> words);

}  // namespace hsi4d::cli
