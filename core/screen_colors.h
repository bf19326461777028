// Transfers and primaries of pictures for a usual screen, by their numbers in ITU-T H.273, which PNG's cICP has, and by
// ffmpeg's names. What is of others (PQ, HLG, Display P3, BT.2020's primaries) would be shown wrongly and is refused.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>

namespace hsi4d {

struct ColorCode {
  std::uint8_t number;
  std::string_view name;
};

inline constexpr std::array<ColorCode, 12> kScreenTransfers = {{{1, "bt709"},
                                                                {6, "smpte170m"},
                                                                {7, "smpte240m"},
                                                                {4, "bt470m"},
                                                                {5, "bt470bg"},
                                                                {4, "gamma22"},
                                                                {5, "gamma28"},
                                                                {13, "iec61966-2-1"},
                                                                {11, "iec61966-2-4"},
                                                                {12, "bt1361e"},
                                                                {14, "bt2020-10"},
                                                                {15, "bt2020-12"}}};
inline constexpr std::array<ColorCode, 5> kScreenPrimaries = {
    {{1, "bt709"}, {6, "smpte170m"}, {7, "smpte240m"}, {4, "bt470m"}, {5, "bt470bg"}}};

inline constexpr std::uint8_t kUnspecifiedColor = 2;

template <std::size_t N>
bool has_name(const std::array<ColorCode, N>& codes, std::string_view name) {
  return std::any_of(codes.begin(), codes.end(), [name](const ColorCode& code) { return code.name == name; });
}

/// True for the number of "unspecified" too.
template <std::size_t N>
bool has_number(const std::array<ColorCode, N>& codes, std::uint8_t number) {
  return number == kUnspecifiedColor ||
         std::any_of(codes.begin(), codes.end(), [number](const ColorCode& code) { return code.number == number; });
}

}  // namespace hsi4d
