#include "core/safetensors.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "stress/scratch_folder.h"

namespace safetensors_test {

using namespace hsi4d;

namespace {

/// A file by hand: length, header, data.
Bytes file_of(const std::string& header, const Bytes& data = {}) {
  Bytes file;
  for (int i = 0; i < 8; ++i) file.push_back(static_cast<uint8_t>(header.size() >> (8 * i)));
  file.insert(file.end(), header.begin(), header.end());
  file.insert(file.end(), data.begin(), data.end());
  return file;
}

std::string error_of(const Bytes& file) {
  try {
    Safetensors::decode(file, "a");
  } catch (const DataError& error) {
    return error.what();
  }
  return "none";
}

std::string error_of_header(const std::string& header, std::size_t bytes = 0) {
  return error_of(file_of(header, Bytes(bytes, 0)));
}

SafetensorsWriter example() {
  SafetensorsWriter writer("hsi4d example", 3);
  writer.add<uint8_t>("bytes", {3}, {1, 2, 255});
  writer.add<float>("weights", {2, 3}, {1, 2, 3, 4, 5, -0.5F});
  writer.add<int64_t>("large", {2}, {std::numeric_limits<int64_t>::min(), std::numeric_limits<int64_t>::max()});
  writer.add<double>("empty", {0, 3}, {});
  writer.add<double>("scalar", {}, {0.1});
  writer.add<int32_t>("\xc3\xa4 \"quoted\"", {1}, {-7});
  const std::vector<std::string> names = {"left hand", "\xc3\xa4", "a\"b,\n"};
  writer.set_texts("names", names);
  return writer;
}

}  // namespace

TEST_CASE("safetensors come back as they were written") {
  const Safetensors file = Safetensors::decode(example().encode(), "a");
  CHECK(file.require_format("hsi4d example", 3) == 3);
  CHECK(file.array("bytes").require_shape({3}).as<int>() == std::vector<int>{1, 2, 255});
  CHECK(file.array("weights").require_shape({2, 3}).as<float>() == std::vector<float>{1, 2, 3, 4, 5, -0.5F});
  CHECK(file.array("large").as<int64_t>() ==
        std::vector<int64_t>{std::numeric_limits<int64_t>::min(), std::numeric_limits<int64_t>::max()});
  CHECK(file.array("empty").shape() == std::vector<int64_t>{0, 3});
  CHECK(file.array("scalar").require_shape({}).scalar<double>() == 0.1);
  CHECK(file.array("\xc3\xa4 \"quoted\"").as<int>() == std::vector<int>{-7});
  CHECK(file.texts("names") == std::vector<std::string>{"left hand", "\xc3\xa4", "a\"b,\n"});
  CHECK(file.names() ==
        std::vector<std::string>{"large", "empty", "scalar", "weights", "\xc3\xa4 \"quoted\"", "bytes"});
  CHECK(file.has("weights"));
  CHECK_FALSE(file.has("weight"));
  CHECK(example().encode() == example().encode());
  CHECK(Safetensors::decode(SafetensorsWriter().encode(), "a").names().empty());
}

TEST_CASE("a safetensors file has the bytes of the format") {
  SafetensorsWriter writer;
  writer.add<uint16_t>("a", {2}, {1, 513});
  writer.set_text("k", "v");
  std::string header = R"({"__metadata__": {"k": "v"}, "a": {"dtype": "U16", "shape": [2], "data_offsets": [0, 4]}})";
  header.resize(120, ' ');
  CHECK(writer.encode() == file_of(header, {1, 0, 1, 2}));
  // The numbers of every array lie at a multiple of their size.
  const Bytes file = example().encode();
  const std::string text(file.begin(), file.end());
  CHECK((file[0] + 256U * file[1] + 8) % 64 == 0);
  CHECK(text.find("\"bytes\"") > text.find("\"weights\""));
}

TEST_CASE("safetensors of other programs are read in all number types") {
  const auto numbers = [](const std::string& dtype, const Bytes& data, int64_t count) {
    const std::string header = "{\"x\":{\"data_offsets\":[0," + std::to_string(data.size()) + "],\"shape\":[" +
                               std::to_string(count) + "],\"dtype\":\"" + dtype + "\"}}   ";
    return Safetensors::decode(file_of(header, data), "a").array("x").as<double>();
  };
  using Doubles = std::vector<double>;
  CHECK(numbers("F16", {0x00, 0x3c, 0x00, 0xc0}, 2) == Doubles{1, -2});
  CHECK(numbers("BF16", {0x80, 0x3f, 0x20, 0xc0}, 2) == Doubles{1, -2.5});
  CHECK(std::isnan(numbers("BF16", {0xc0, 0x7f}, 1)[0]));
  CHECK(numbers("F32", {0, 0, 0x80, 0x3f}, 1) == Doubles{1});
  CHECK(numbers("F64", {0, 0, 0, 0, 0, 0, 0xf0, 0x3f}, 1) == Doubles{1});
  CHECK(numbers("I8", {0xff, 1}, 2) == Doubles{-1, 1});
  CHECK(numbers("I16", {0xff, 0xff}, 1) == Doubles{-1});
  CHECK(numbers("I32", {0xfe, 0xff, 0xff, 0xff}, 1) == Doubles{-2});
  CHECK(numbers("U8", {0xff}, 1) == Doubles{255});
  CHECK(numbers("U32", {0xff, 0xff, 0xff, 0xff}, 1) == Doubles{4294967295.0});
  CHECK(numbers("U64", {1, 0, 0, 0, 0, 0, 0, 0}, 1) == Doubles{1});
  CHECK(numbers("BOOL", {1, 0}, 2) == Doubles{1, 0});
  CHECK_THROWS_WITH(numbers("F8_E4M3", {1, 0}, 2), "a: array 'x': has dtype 'F8_E4M3', which is not read");
}

TEST_CASE("faults of safetensors name file and array") {
  CHECK(error_of({}) == "a: has 0 bytes; a safetensors file begins with 8 for a length");
  CHECK(error_of({255, 255, 255, 255, 255, 255, 255, 255, '{'}) ==
        "a: claims a header of 18446744073709551615 bytes; 1 follow, and at most 16777216 are read");
  CHECK(error_of({3, 0, 0, 0, 0, 0, 0, 0, '{', '}'}) ==
        "a: claims a header of 3 bytes; 2 follow, and at most 16777216 are read");
  CHECK(error_of_header("[]") == "a: the header does not begin with '{'; this is no safetensors file");
  CHECK(error_of_header("") == "a: the header does not begin with '{'; this is no safetensors file");
  CHECK(error_of_header("{\"x\"}").starts_with("a:1"));
  CHECK(error_of_header("{}") == "none");
  CHECK(error_of_header("{}", 2) == "a: the arrays end at byte 0 of the data, of which there are 2");
  CHECK(error_of_header("{\"x\":1}") == "a: array 'x': is a number, not an object");
  CHECK(error_of_header("{\"__metadata__\":[]}") == "a: the metadata is an array");
  CHECK(error_of_header("{\"__metadata__\":{\"n\":1}}") == "a: metadata 'n' is a number, not a string");
  const auto array = [](const std::string& name, const std::string& dtype, const std::string& shape,
                        const std::string& offsets) {
    return "\"" + name + "\":{\"dtype\":" + dtype + ",\"shape\":" + shape + ",\"data_offsets\":" + offsets + "}";
  };
  const auto one = [&](const std::string& dtype, const std::string& shape, const std::string& offsets) {
    return error_of_header("{" + array("x", dtype, shape, offsets) + "}", 8);
  };
  CHECK(one("\"F32\"", "[2]", "[0,8]") == "none");
  CHECK(one("1", "[2]", "[0,8]") == "a: array 'x': the dtype is a number, not a string");
  CHECK(one("\"F32\"", "[-2]", "[0,8]") == "a: array 'x': the shape is [-2]; allowed: at most 32 lengths from 0 on");
  CHECK(one("\"F32\"", "[2.0]", "[0,8]") == "a: array 'x': the shape is [2.0]; allowed: at most 32 lengths from 0 on");
  CHECK(one("\"F32\"", "[2]", "[8,0]") ==
        "a: array 'x': the data_offsets are [8, 0]; allowed: two numbers, the second not the smaller");
  CHECK(one("\"F32\"", "[2]", "[0,99999999999999999999]") ==
        "a: array 'x': the data_offsets are [0, 99999999999999999999]; allowed: two numbers, the second not the "
        "smaller");
  CHECK(one("\"F32\"", "[3]", "[0,8]") == "a: array 'x': has 8 bytes; shape [3] of F32 needs 12");
  CHECK(one("\"F32\"", "[4294967296,4294967296]", "[0,8]") ==
        "a: array 'x': has 8 bytes; shape [4294967296,4294967296] of F32 needs too many");
  CHECK(one("\"F32\"", "[2]", "[1,8]") ==
        "a: array 'x': begins at byte 1 of the data; it has to begin at 0, where the array before it ends");
  CHECK(one("\"F32\"", "[1000000000]", "[0,4000000000]") ==
        "a: the arrays end at byte 4000000000 of the data, of which there are 8; the file is cut short");
  CHECK(error_of_header("{\"x\":{\"dtype\":\"F32\",\"shape\":[2]}}", 8) ==
        "a: array 'x': needs the keys \"dtype\", \"shape\" and \"data_offsets\" and no other");
  CHECK(error_of_header("{" + array("x", "\"U8\"", "[5]", "[0,5]") + "," + array("y", "\"U8\"", "[5]", "[3,8]") + "}",
                        8) ==
        "a: array 'y': begins at byte 3 of the data; it has to begin at 5, where the array before it ends");
  CHECK(
      error_of_header("{" + array("x", "\"U8\"", "[4]", "[0,4]") + "," + array("x", "\"U8\"", "[4]", "[4,8]") + "}", 8)
          .starts_with("a:1"));
}

TEST_CASE("what is absent in safetensors is named") {
  const Safetensors file = Safetensors::decode(example().encode(), "a");
  CHECK_THROWS_WITH(file.array("weight"),
                    "a: has no array 'weight'; there are: large, empty, scalar, weights, \xc3\xa4 \"quoted\", bytes");
  CHECK_THROWS_WITH(file.text("gender"), "a: has no metadata 'gender'; there is: format, names, version");
  CHECK_THROWS_WITH(file.texts("version"), "a: metadata 'version' is no list of texts: [\"first\", \"second\"]");
  CHECK_THROWS_WITH(file.require_format("hsi4d other", 3), "a: the format is 'hsi4d example'; allowed: 'hsi4d other'");
  CHECK_THROWS_WITH(file.require_format("hsi4d example", 2),
                    "a: the format's version is '3'; allowed: 1 to 2 (the file is from a newer program)");
  CHECK_THROWS_WITH(
      Safetensors::decode(SafetensorsWriter("hsi4d example", 0).encode(), "a").require_format("hsi4d example", 2),
      "a: the format's version is '0'; allowed: 1 to 2");
  CHECK_THROWS_WITH(Safetensors::decode(file_of("{}"), "a").require_format("hsi4d other", 3),
                    "a: the metadata has no \"format\"; allowed: 'hsi4d other'");
}

TEST_CASE("what safetensors cannot hold is refused") {
  SafetensorsWriter writer;
  writer.add<float>("x", {2}, {1, 2});
  CHECK_THROWS_AS(writer.add<float>("x", {2}, {1, 2}), InternalError);
  CHECK_THROWS_AS(writer.add<float>("", {2}, {1, 2}), InternalError);
  CHECK_THROWS_AS(writer.add<float>("__metadata__", {2}, {1, 2}), InternalError);
  CHECK_THROWS_AS(writer.add<float>("y", {3}, {1, 2}), InternalError);
  CHECK_THROWS_AS(writer.add<float>("\xff", {2}, {1, 2}), InternalError);
  writer.set_text("k", "v");
  CHECK_THROWS_AS(writer.set_text("k", "v"), InternalError);
  CHECK_THROWS_AS(writer.set_text("l", "\xff"), InternalError);
  CHECK(Safetensors::decode(writer.encode(), "a").names() == std::vector<std::string>{"x"});
}

TEST_CASE("safetensors files are written in one step and known by their first bytes") {
  const ScratchFolder folder;
  const std::string path = folder / "a.safetensors";
  example().write(path);
  CHECK(folder.count() == 1);
  CHECK(Safetensors::read(path).array("bytes").size() == 3);
  CHECK(looks_like_safetensors(read_file_start(path, 9)));
  CHECK_FALSE(looks_like_safetensors(read_file_start(path, 8)));
  CHECK_FALSE(looks_like_safetensors(Bytes{'P', 'K', 3, 4, 20, 0, 0, 0, 0, 0}));
  CHECK_THROWS_AS(Safetensors::read(folder / "b.safetensors"), UserError);
}

}  // namespace safetensors_test
