// Small pieces of text that the commands share.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/table.h"
#include "core/text.h"

namespace hsi4d::cli {

/// A number in 4 significant digits, without locale; 0 for −0.
std::string short_number(double value);

/// "1 Gaussian", "2 Gaussians", "2 losses".
std::string count_text(std::int64_t count, const std::string& one);

/// The ending of a path in lower case with its dot, ".ply"; "" without one.
std::string file_ending(const std::string& path);

/// Words in lines of at most so many characters; a longer word has a line of its own.
std::string wrapped(const std::string& text, std::size_t columns);

/// As many finite numbers as asked for, apart by commas: "1,2.5,-3".
/// @param where  starts the message: "hsi4d convert: --translate"
/// @param names  what they are: "x,y,z"
/// Throws UserError that names the text and what is allowed.
std::vector<double> parse_numbers(const std::string& text, std::size_t count, const std::string& where,
                                  const std::string& names);

/// Throws UserError unless a rate of frames, where it is given, is one that motions can have.
/// @param where  starts the message: "hsi4d motion: --from-rate"
void check_rate(const std::optional<double>& rate, const std::string& where);

}  // namespace hsi4d::cli
