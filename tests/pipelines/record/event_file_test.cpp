#include "pipelines/record/event_file.h"

#include <bit>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/png.h"

namespace event_file_test {

using namespace hsi4d;
using Catch::Contains;
using Scalars = std::vector<std::pair<std::string, double>>;

namespace {

/// Bytes written as pairs of digits, blanks between them passed over.
std::string hex(const std::string& digits) {
  std::string bytes, pair;
  for (const char digit : digits) {
    if (digit == ' ') continue;
    pair += digit;
    if (pair.size() < 2) continue;
    bytes += static_cast<char>(std::stoi(pair, nullptr, 16));
    pair.clear();
  }
  return bytes;
}

std::string in_hex(const std::string& bytes) {
  std::string digits;
  for (const char byte : bytes) {
    for (const int half : {static_cast<unsigned char>(byte) >> 4, byte & 15}) digits += "0123456789abcdef"[half];
  }
  return digits;
}

}  // namespace

TEST_CASE("CRC-32C of known texts") {
  CHECK(crc32c("") == 0);
  CHECK(crc32c("123456789") == 0xe3069283);
  // RFC 3720, B.4.
  std::string rising, falling;
  for (int i = 0; i < 32; ++i) {
    rising += static_cast<char>(i);
    falling += static_cast<char>(31 - i);
  }
  CHECK(crc32c(std::string(32, '\0')) == 0x8a9136aa);
  CHECK(crc32c(std::string(32, '\xff')) == 0x62a8ab43);
  CHECK(crc32c(rising) == 0x46dd794e);
  CHECK(crc32c(falling) == 0x113fdb5c);
  CHECK(crc32c(hex("01c00000 00000000 00000000 00000000 14000000 00000400 00000014 00000018"
                   "28000000 00000000 02000000 00000000")) == 0xd9963a56);
}

TEST_CASE("the first record of a file that TensorFlow has written") {
  const double seconds = std::bit_cast<double>(std::uint64_t{0x41d7d69938800000});
  CHECK(in_hex(event_record(version_event(seconds))) ==
        in_hex(hex("18000000 00000000 a37f4b22  09 00008038 99d6d741 1a0d") + "brain.Event:2" + hex("124b36ab")));
}

TEST_CASE("scalars are floats by tag") {
  CHECK(in_hex(scalars_event({1.5, 300}, Scalars{{"a", 0.5}})) ==
        in_hex(hex("09 00000000 0000f83f  10 ac02  2a 0a  0a 08  0a 01 61  15 0000003f")));
  // 0 is told: a value of that number is no value that is missing.
  CHECK(in_hex(scalars_event({0, 0}, Scalars{{"a", 0}, {"b/c", -2}})) ==
        in_hex(hex("09 00000000 00000000  10 00  2a 16  0a 08 0a 01 61 15 00000000  0a 0a 0a 03 622f63 15 000000c0")));
  // A length that takes two bytes.
  const std::string tag(200, 'x');
  CHECK(in_hex(scalars_event({0, 0}, Scalars{{tag, 1}})) ==
        in_hex(hex("09 00000000 00000000 10 00  2a d301  0a d001  0a c801") + tag + hex("15 0000803f")));
  CHECK(scalars_event({0, std::int64_t{1} << 40}, {}) == hex("09 00000000 00000000  10 808080808020  2a 00"));
  CHECK(scalars_event({0, 0}, Scalars{{"a", 1e300}}).ends_with(hex("15 0000807f")));  // beyond a float: infinity
}

TEST_CASE("an image keeps the bytes of its PNG") {
  const Bytes pixels(2 * 3 * 4, 7);
  for (const int channels : {1, 2, 3, 4}) {
    INFO(channels << " channels");
    const Bytes png =
        encode_png({3, 2, channels, PackedType::kUint8, Bytes(pixels.begin(), pixels.begin() + 6 * channels)});
    const std::string event = image_event({0, 1}, "images/render", png), text(png.begin(), png.end());
    REQUIRE(event.ends_with(text));
    // Tag, the image's length, height, width, colour space.
    CHECK_THAT(in_hex(event), Contains(in_hex("images/render") + "22"));
    CHECK_THAT(in_hex(event), Contains(in_hex(hex("08 02 10 03 18") + static_cast<char>(channels) + hex("22"))));
  }
  CHECK_THROWS_AS(image_event({0, 1}, "images/render", pixels), InternalError);
  CHECK_THROWS_AS(image_event({0, 1}, "images/render", {}), InternalError);
}

TEST_CASE("settings keep their types") {
  ConfigValue settings = ConfigValue::make_object();
  settings.add("n", ConfigValue::make_number(0.5));
  settings.add("b", ConfigValue::make_boolean(true));
  settings.add("s", ConfigValue::make_string("paper"));
  settings.add("a", ConfigValue::make_array({ConfigValue::make_integer(1)}));
  const std::string event = hparams_event(0.5, settings);
  CHECK_THAT(event, Contains("_hparams_/session_start_info") && Contains("hparams"));
  const std::string start = hex("0a 0e 0a 01") + "n" + hex("12 09 11 00000000 0000e03f") + hex("0a 07 0a 01") + "b" +
                            hex("12 02 20 01") + hex("0a 0c 0a 01") + "s" + hex("12 07 1a 05") + "paper" +
                            hex("0a 0a 0a 01") + "a" + hex("12 05 1a 03") + "[1]" + hex("29 00000000 0000e03f");
  CHECK_THAT(in_hex(event), Contains(in_hex(hex("1a") + static_cast<char>(start.size()) + start)));
}

}  // namespace event_file_test
