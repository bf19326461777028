// Small pieces of text that the commands share.
#pragma once

#include <string>

#include "core/text.h"

namespace hsi4d::cli {

/// A number in 4 significant digits, without locale; 0 for −0.
std::string short_number(double value);

/// The ending of a path in lower case with its dot, ".ply"; "" without one.
std::string file_ending(const std::string& path);

}  // namespace hsi4d::cli
