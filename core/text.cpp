#include "core/text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace hsi4d {

std::string joined(std::span<const std::string> words, const std::string& last) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : &word == &words.back() ? last : ", ") + word;
  return text;
}

namespace {

/// Whether a number is large, and still short enough to be read without an exponent.
bool is_written_out(double value) { return std::abs(value) >= 1 && std::abs(value) < 1e12; }

}  // namespace

std::string rounded(double value, int digits) {
  if (!std::isfinite(value)) return std::isnan(value) ? "nan" : value < 0 ? "-inf" : "inf";
  std::array<char, 64> buffer;
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value + 0.0, std::chars_format::general, digits);
  if (std::find(buffer.data(), end.ptr, 'e') == end.ptr || !is_written_out(value)) return {buffer.data(), end.ptr};
  double few = 0;
  std::from_chars(buffer.data(), end.ptr, few);
  return number_text(few);
}

std::string number_text(double value) {
  std::array<char, 64> buffer;
  char* const end = buffer.data() + buffer.size();
  const auto written = is_written_out(value) ? std::to_chars(buffer.data(), end, value, std::chars_format::fixed)
                                             : std::to_chars(buffer.data(), end, value);
  return {buffer.data(), written.ptr};
}

std::string four_digits(std::int64_t number) {
  std::string digits = std::to_string(number);
  if (digits.size() < 4) digits.insert(0, 4 - digits.size(), '0');
  return digits;
}

std::size_t utf8_length(std::string_view text) {
  if (text.empty()) return 0;
  const auto byte = [&](std::size_t i) { return static_cast<unsigned>(static_cast<unsigned char>(text[i])); };
  const unsigned lead = byte(0);
  if (lead < 0x80) return 1;
  const std::size_t length = lead >> 5U == 6 ? 2 : lead >> 4U == 14 ? 3 : lead >> 3U == 30 ? 4 : 0;
  if (length == 0 || length > text.size()) return 0;
  unsigned code = lead & (0x7fU >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if (byte(i) >> 6U != 2) return 0;
    code = code << 6U | (byte(i) & 0x3fU);
  }
  constexpr std::array<unsigned, 5> kFirst = {0, 0, 0x80, 0x800, 0x10000};  // that needs so many bytes
  const bool is_half = code >= 0xd800 && code < 0xe000;
  return code >= kFirst[length] && code < 0x110000 && !is_half ? length : 0;
}

namespace {

/// As utf8_length, and 0 for control characters.
std::size_t plain_length(std::string_view text) {
  const std::size_t length = utf8_length(text);
  return length == 1 && (static_cast<unsigned char>(text[0]) < 0x20 || text[0] == 0x7f) ? 0 : length;
}

}  // namespace

std::size_t count_characters(std::string_view text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

bool is_plain_text(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = plain_length(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

bool is_file_name(std::string_view text) {
  constexpr std::size_t kLongest = 200;  // of 255, so that endings and numbers have room
  return !text.empty() && text.size() <= kLongest && text != "." && text != ".." && is_plain_text(text) &&
         text.find_first_of("/\\") == std::string_view::npos;
}

std::string with_escapes(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string escaped;
  while (!text.empty()) {
    const std::size_t length = plain_length(text);
    if (length == 0) {
      const auto byte = static_cast<unsigned char>(text[0]);
      escaped += {'\\', 'x', kDigits[byte >> 4U], kDigits[byte & 15U]};
    } else {
      escaped += text.substr(0, length);
    }
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return escaped;
}

std::string few_names(std::span<const std::string> names) {
  constexpr std::size_t kMost = 6;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMost, names.size()); ++i) text += (i == 0 ? "" : ", ") + with_escapes(names[i]);
  return names.size() <= kMost ? text : text + " and " + std::to_string(names.size() - kMost) + " more";
}

}  // namespace hsi4d
