// Small pieces of text: lists of names, numbers in few digits. No locale.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace hsi4d {

/// "a, b, c"; empty for no words.
/// @param last  before the last word: with " or " it is "a, b or c"
std::string joined(std::span<const std::string> words, const std::string& last = ", ");

/// "a, b, c, d, e, f and 2 more", of names that a file may have in any number; bytes that are no plain text as \xNN.
std::string few_names(std::span<const std::string> names);

/// A number in that many significant digits, "0.01234", "123500" or "1e-08"; 0 for −0; "nan", "inf" or "-inf".
std::string rounded(double value, int digits);

/// A number in as many digits as give the same number back.
std::string number_text(double value);

/// A number of frame, row or file, with zeros before it to have at least four digits: "0007".
std::string four_digits(std::int64_t number);

/// Bytes of the character that text begins with, 1 to 4; 0 where it begins with none: empty, or not UTF-8 (overlong and
/// cut sequences and halves of surrogate pairs are not).
std::size_t utf8_length(std::string_view text);

/// The number of characters of UTF-8 text, for columns of a table.
std::size_t count_characters(std::string_view text);

/// Whether it is UTF-8 without control characters: something that every terminal, file and JSON text can hold.
bool is_plain_text(std::string_view text);

/// Whether it can be the name of a file or folder that stays in the folder where it is put: plain text of 1 to 200
/// bytes without / and \, and neither . nor ..
bool is_file_name(std::string_view text);
/// What is_file_name allows, for messages.
inline constexpr const char* kFileNameText =
    "a name of at most 200 bytes without /, \\ and control characters, not . or ..";

/// The text with every byte that is not of a plain character as \xNN.
std::string with_escapes(std::string_view text);

}  // namespace hsi4d
