// Small pieces of text that the commands share.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/text.h"

namespace hsi4d::cli {

/// A number in 4 significant digits, without locale; 0 for −0.
std::string short_number(double value);

/// "1 Gaussian", "2 Gaussians", "2 losses".
std::string count_text(std::int64_t count, const std::string& one);

/// The ending of a path in lower case with its dot, ".ply"; "" without one.
std::string file_ending(const std::string& path);

/// The characters of the widest word of each column.
std::vector<std::size_t> column_widths(const std::vector<std::vector<std::string>>& rows);

/// The characters of a line of table() whose columns have these widths.
std::size_t table_width(const std::vector<std::size_t>& widths);

/// Rows of words in columns of equal width, two blanks apart; a line each.
std::string table(const std::vector<std::vector<std::string>>& rows);

/// As table(), in lines of at most so many characters: columns that find no place beside the others follow below, with
/// the first column before them again. That one is shortened to half a line; other columns keep their width, and one
/// that is wider than a line stays so.
/// @param columns  of the terminal; nothing: as table()
std::string folded_table(std::vector<std::vector<std::string>> rows, std::optional<int> columns);

/// The text in at most so many characters, begin and end with … between them where it is longer.
std::string shortened(const std::string& text, std::size_t most);

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
