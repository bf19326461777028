#include "core/npy.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "stress/scratch_folder.h"

namespace npy_test {

using namespace hsi4d;
using Catch::Contains;

namespace {

/// A file with this header text, padded as numpy does, and data.
Bytes npy(const std::string& dict, const std::string& data, int major = 1) {
  const size_t prefix = major == 1 ? 10 : 12;
  std::string text = dict;
  text.append(63 - (prefix + text.size()) % 64, ' ');
  text += '\n';
  std::string file = "\x93NUMPY";
  file += static_cast<char>(major);
  file += '\0';
  for (size_t i = 0; i < prefix - 8; ++i) file += static_cast<char>(text.size() >> (8 * i));
  file += text + data;
  return Bytes(file.begin(), file.end());
}

Bytes npy_of(const std::string& dtype, const std::string& shape, const std::string& data, bool fortran = false) {
  const std::string order = fortran ? "True" : "False";
  return npy("{'descr': '" + dtype + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }", data);
}

NpyArray array_of(const Bytes& file) { return decode_npy(file, "a.npy").array.value(); }

template <class T>
std::string raw(std::initializer_list<T> values) {
  std::string text(values.size() * sizeof(T), '\0');
  std::memcpy(text.data(), values.begin(), text.size());
  return text;
}

/// Each element's bytes the other way round.
template <class T>
std::string swapped(std::initializer_list<T> values) {
  std::string text = raw(values);
  for (size_t i = 0; i < text.size(); i += sizeof(T)) std::reverse(text.begin() + i, text.begin() + i + sizeof(T));
  return text;
}

template <class T>
void check_type(const std::string& code, std::initializer_list<T> values) {
  const std::vector<T> expected(values);
  const std::string shape = std::string("(") + std::to_string(values.size()) + ",)";
  INFO(code);
  CHECK(array_of(npy_of((sizeof(T) == 1 ? "|" : "<") + code, shape, raw(values))).template as<T>() == expected);
  CHECK(array_of(npy_of("<" + code, shape, raw(values))).template as<T>() == expected);
  CHECK(array_of(npy_of(">" + code, shape, swapped(values))).template as<T>() == expected);
  CHECK(array_of(npy_of("=" + code, shape, raw(values))).template as<T>() == expected);
}

std::string error_of(const Bytes& file) {
  try {
    decode_npy(file, "a.npy");
  } catch (const DataError& error) {
    return error.what();
  }
  return "none";
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

TEST_CASE("every number type is read in both byte orders") {
  check_type<float>("f4", {0.0f, -1.5f, 3e38f, 1e-45f});
  check_type<double>("f8", {0.0, -1.5, 1e300, kInfinity});
  check_type<int8_t>("i1", {-128, 0, 127});
  check_type<int16_t>("i2", {-32768, 1, 32767});
  check_type<int32_t>("i4", {std::numeric_limits<int32_t>::min(), 258, std::numeric_limits<int32_t>::max()});
  check_type<int64_t>("i8", {std::numeric_limits<int64_t>::min(), 258, std::numeric_limits<int64_t>::max()});
  check_type<uint8_t>("u1", {0, 200, 255});
  check_type<uint16_t>("u2", {0, 258, 65535});
  check_type<uint32_t>("u4", {0, 258, 4294967295u});
  check_type<uint64_t>("u8", {0, 258, std::numeric_limits<uint64_t>::max()});
}

TEST_CASE("half floats and booleans are read") {
  const std::vector<float> halves = {1, -2, 65504, 0.000000059604645f, 0.333251953125f};
  const std::initializer_list<uint16_t> bits = {0x3c00, 0xc000, 0x7bff, 0x0001, 0x3555};
  CHECK(array_of(npy_of("<f2", "(5,)", raw(bits))).as<float>() == halves);
  CHECK(array_of(npy_of(">f2", "(5,)", swapped(bits))).as<float>() == halves);
  CHECK(array_of(npy_of("|b1", "(3,)", {'\0', '\1', '\2'})).as<uint8_t>() == std::vector<uint8_t>{0, 1, 1});
}

TEST_CASE("scalars, empty arrays and shapes") {
  const NpyArray scalar = array_of(npy_of("<f8", "()", raw({2.5})));
  CHECK(scalar.shape().empty());
  CHECK(scalar.size() == 1);
  CHECK(scalar.scalar<double>() == 2.5);
  CHECK(scalar.dtype() == "<f8");
  const NpyArray empty = array_of(npy_of("<f4", "(0, 3)", ""));
  CHECK(empty.shape() == std::vector<int64_t>{0, 3});
  CHECK(empty.as<float>().empty());
  CHECK(array_of(npy_of("<f4", "(0, 9223372036854775807, 9223372036854775807)", "")).size() == 0);
  CHECK(array_of(npy_of("<f4", "(0, 9223372036854775807, 9223372036854775807)", "", true)).size() == 0);

  const NpyArray matrix = array_of(npy_of("<i2", "(2, 3)", raw<int16_t>({1, 2, 3, 4, 5, 6})));
  CHECK(matrix.require_shape({-1, 3}).as<int>() == std::vector<int>{1, 2, 3, 4, 5, 6});
  CHECK_NOTHROW(matrix.require_shape({2, 3}));
  CHECK_THROWS_WITH(matrix.require_shape({-1, 55}), "a.npy: has shape [2,3]; [*,55] is needed");
  CHECK_THROWS_WITH(matrix.require_shape({2}), "a.npy: has shape [2,3]; [2] is needed");
  CHECK_THROWS_WITH(matrix.scalar<int>(), "a.npy: has shape [2,3]; a single value is needed");
  CHECK_THROWS_WITH(empty.scalar<int>(), "a.npy: has shape [0,3]; a single value is needed");
  CHECK(array_of(npy_of("<i2", "(1, 1)", raw<int16_t>({7}))).scalar<int>() == 7);
}

TEST_CASE("Fortran order becomes C order") {
  // [[1,2,3],[4,5,6]] column by column.
  CHECK(array_of(npy_of("<i4", "(2, 3)", raw({1, 4, 2, 5, 3, 6}), true)).as<int>() ==
        std::vector<int>{1, 2, 3, 4, 5, 6});
  std::vector<double> expected;
  std::string data(2 * 3 * 4 * 8, '\0');
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 4; ++k) {
        const double value = 100 * i + 10 * j + k;
        expected.push_back(value);
        std::memcpy(data.data() + 8 * (i + 2 * (j + 3 * k)), &value, 8);
      }
    }
  }
  CHECK(array_of(npy_of("<f8", "(2, 3, 4)", data, true)).as<double>() == expected);
  CHECK(array_of(npy_of("<i4", "(3,)", raw({1, 2, 3}), true)).as<int>() == std::vector<int>{1, 2, 3});
}

TEST_CASE("strings are read as UTF-8") {
  const std::string unicode = raw<char32_t>({U'a', U'ä', U'€', U'😀', 0, 0, U'x', 0});
  const NpyArray texts = array_of(npy_of("<U4", "(2,)", unicode));
  CHECK(texts.strings() == std::vector<std::string>{"a\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80", std::string("\0\0x", 3)});
  CHECK(array_of(npy_of(">U2", "()", swapped<char32_t>({U'€', 0}))).text() == "\xe2\x82\xac");
  CHECK(array_of(npy_of("|S4", "(2,)", {"ab\0\0wxyz", 8})).strings() == std::vector<std::string>{"ab", "wxyz"});
  CHECK(array_of(npy_of("<U0", "(2,)", "")).strings() == std::vector<std::string>{"", ""});

  CHECK_THROWS_WITH(texts.text(), "a.npy: has shape [2]; a single value is needed");
  CHECK_THROWS_WITH(texts.as<float>(), "a.npy: holds text (dtype '<U4'); numbers are needed");
  CHECK_THROWS_WITH(array_of(npy_of("<f4", "(1,)", raw({1.0f}))).strings(),
                    "a.npy: holds numbers (dtype '<f4'); text is needed");
  CHECK_THROWS_WITH(array_of(npy_of("<U1", "(2,)", raw<uint32_t>({65, 0x110000}))).strings(),
                    "a.npy: element 1 holds 1114112, which is no Unicode character");
  CHECK_THROWS_WITH(array_of(npy_of("<U1", "(1,)", raw<uint32_t>({0xd800}))).strings(),
                    Contains("holds 55296, which is no Unicode character"));
  CHECK(error_of(npy_of("<U0", "(2000000,)", "")) == "a.npy: shape [2000000] of '<U0' is too large");
}

TEST_CASE("numbers are converted when the type can hold them") {
  const NpyArray root = array_of(npy_of("<u4", "(2,)", raw<uint32_t>({4294967295u, 0})));
  CHECK(root.as<int64_t>() == std::vector<int64_t>{4294967295, 0});
  CHECK(root.as<double>() == std::vector<double>{4294967295.0, 0});
  CHECK_THROWS_WITH(root.as<int32_t>(),
                    "a.npy: element 0 is 4294967295; whole numbers in the range of int32 are needed");
  CHECK_THROWS_WITH(array_of(npy_of("<i8", "(2,)", raw<int64_t>({3, -1}))).as<uint32_t>(),
                    "a.npy: element 1 is -1; whole numbers in the range of uint32 are needed");

  const auto from_double = [](double value) { return array_of(npy_of("<f8", "()", raw({value}))); };
  CHECK(from_double(2147483647.0).scalar<int32_t>() == 2147483647);
  CHECK(from_double(-9223372036854775808.0).scalar<int64_t>() == std::numeric_limits<int64_t>::min());
  CHECK_THROWS_WITH(from_double(2.7).scalar<int>(),
                    "a.npy: element 0 is 2.7; whole numbers in the range of int32 are needed");
  for (const double bad : {2147483648.0, -2147483649.0, 1e300, kInfinity, -kInfinity, std::nan("")}) {
    CHECK_THROWS_AS(from_double(bad).scalar<int32_t>(), DataError);
  }
  CHECK_THROWS_AS(from_double(9223372036854775808.0).scalar<int64_t>(), DataError);
  CHECK_THROWS_AS(from_double(-1).scalar<uint64_t>(), DataError);

  CHECK(from_double(0.1).scalar<float>() == 0.1f);
  CHECK(std::isnan(from_double(std::nan("")).scalar<float>()));
  CHECK(from_double(-kInfinity).scalar<float>() == -std::numeric_limits<float>::infinity());
  CHECK_THROWS_WITH(from_double(1e39).scalar<float>(),
                    "a.npy: element 0 is 1e+39; numbers in the range of float32 are needed");
}

TEST_CASE("versions 2 and 3, other key orders and Python 2 files are read") {
  const std::string dict = "{'descr': '<i4', 'fortran_order': False, 'shape': (2,), }";
  for (const int major : {1, 2, 3}) {
    CHECK(array_of(npy(dict, raw({1, 2}), major)).as<int>() == std::vector<int>{1, 2});
  }
  CHECK(array_of(npy("{\"shape\":(2L,),\"fortran_order\":False,\"descr\":\"<i4\"}", raw({1, 2}))).size() == 2);
  CHECK(error_of(npy(dict, "", 4)) == "a.npy: has npy version 4.0; 1.0, 2.0 and 3.0 are read");
}

TEST_CASE("what is not read is named, not unpickled") {
  const auto reason_of = [](const std::string& dict) {
    const NpyResult result = decode_npy(npy(dict, "\x80\x04."), "a.npy");
    return result.array ? "read" : result.unread_reason;
  };
  CHECK(reason_of("{'descr': '|O', 'fortran_order': False, 'shape': (), }") ==
        "holds Python objects (dtype '|O'), which are not unpickled");
  CHECK(reason_of("{'descr': '|O8', 'fortran_order': False, 'shape': (3,), }") ==
        "holds Python objects (dtype '|O8'), which are not unpickled");
  for (const std::string dtype : {"<c16", "<M8[ns]", "<f16", "<f3", "|f4", "|V8", "<i", ""}) {
    CHECK(reason_of("{'descr': '" + dtype + "', 'fortran_order': False, 'shape': (3,), }") ==
          "has dtype '" + dtype + "', which is not read");
  }
  CHECK(reason_of("{'descr': [('x', '<f4'), ('y', '<f4', (2, 3))], 'fortran_order': False, 'shape': (3,), }") ==
        "has dtype 'structured', which is not read");

  const ScratchFolder folder;
  write_file(folder / "o.npy", npy("{'descr': '|O', 'fortran_order': False, 'shape': (), }", ""));
  CHECK_THROWS_WITH(read_npy(folder / "o.npy"),
                    folder / "o.npy" + ": holds Python objects (dtype '|O'), which are not unpickled");
  write_file(folder / "a.npy", npy_of("<i2", "(2,)", raw<int16_t>({5, 6})));
  CHECK(read_npy(folder / "a.npy").as<int>() == std::vector<int>{5, 6});
  CHECK_THROWS_AS(read_npy(folder / "absent.npy"), UserError);
}

TEST_CASE("a shape that its data does not fill is an error with both sizes") {
  CHECK(error_of(npy_of("<f4", "(2, 3)", std::string(23, 'x'))) ==
        "a.npy: shape [2,3] of '<f4' needs 24 bytes, but 23 are there (truncated)");
  CHECK(error_of(npy_of("<f4", "(2, 3)", std::string(25, 'x'))) ==
        "a.npy: shape [2,3] of '<f4' needs 24 bytes, but 25 are there");
  CHECK(error_of(npy_of("<f8", "(4294967296, 4294967296)", "")) ==
        "a.npy: shape [4294967296,4294967296] of '<f8' is too large");
  CHECK(error_of(npy_of("<f8", "(2305843009213693952,)", "")) ==
        "a.npy: shape [2305843009213693952] of '<f8' is too large");
}

TEST_CASE("a header that is not numpy's is an error with its position") {
  const auto header = [](const std::string& dict) { return error_of(npy(dict, "")); };
  CHECK(error_of({}) == "a.npy: is not an npy file");
  CHECK(error_of(Bytes(64, 'x')) == "a.npy: is not an npy file");
  const std::string keys = "each of the keys 'descr', 'fortran_order' and 'shape' once expected";
  CHECK(header("{'descr': '<f4', 'descr': '<f4', 'shape': (), }") == "a.npy: npy header, byte 27: " + keys);
  CHECK(header("{'descr': '<f4', 'order': False, 'shape': (), }") == "a.npy: npy header, byte 27: " + keys);
  CHECK_THAT(header("{'descr': '<f4', 'shape': (), }"),
             Contains("the keys 'descr', 'fortran_order' and 'shape' expected"));
  CHECK(header("{'descr': '<f4', 'fortran_order': 0, 'shape': (), }") ==
        "a.npy: npy header, byte 44: True or False expected");
  const std::string begin = "{'descr': '<f4', 'fortran_order': False, 'shape': ";
  CHECK(header(begin + "(-1,), }") == "a.npy: npy header, byte 61: a length from 0 to 2^63-1 expected");
  CHECK(header(begin + "(9223372036854775808,), }") ==
        "a.npy: npy header, byte 61: a length from 0 to 2^63-1 expected");
  CHECK(header(begin + "(3), }") == "a.npy: npy header, byte 62: ',' expected");
  CHECK(header(begin + "3, }") == "a.npy: npy header, byte 60: '(' expected");
  CHECK(header(begin + "(3, 4, }") == "a.npy: npy header, byte 67: a length from 0 to 2^63-1 expected");
  CHECK_THAT(header(begin + "(3,), } x"), Contains("the header's end expected"));
  CHECK_THAT(header(begin + "(3,)"), Contains("'}' expected"));
  CHECK_THAT(header("{'descr': '<f4"), Contains("a string's end expected"));
  CHECK_THAT(header("{'descr': " + std::string(40, '[')), Contains("fewer brackets expected"));
  std::string many = "(";
  for (int i = 0; i < 33; ++i) many += "1, ";
  CHECK_THAT(header(begin + many + "), }"), Contains("at most 32 dimensions expected"));

  Bytes file = npy_of("<f4", "()", raw({1.0f}));
  CHECK(error_of(Bytes(file.begin(), file.begin() + 50)) == "a.npy: ends within its npy header");
  Bytes version2 = npy("{'descr': '<f4', 'fortran_order': False, 'shape': (), }", raw({1.0f}), 2);
  CHECK(error_of(Bytes(version2.begin(), version2.begin() + 11)) == "a.npy: ends within its npy header");
  version2[11] = 0x7f;
  CHECK_THAT(error_of(version2), Contains("a.npy: its npy header claims 21") && Contains("at most 1048576 are read"));
}

TEST_CASE("written arrays are numpy's bytes") {
  const std::vector<float> values = {1, 2, 3, 4, 5, 6};
  const std::vector<int64_t> shape = {2, 3};
  CHECK(encode_npy(std::span<const int64_t>(shape), std::span<const float>(values)) ==
        npy_of("<f4", "(2, 3)", raw({1.0f, 2.0f, 3.0f, 4.0f, 5.0f, 6.0f})));
  const int64_t three = 3;
  const std::vector<uint8_t> bytes = {7, 8, 9};
  CHECK(encode_npy(std::span(&three, 1), std::span<const uint8_t>(bytes)) == npy_of("|u1", "(3,)", "\7\10\11"));
  const int64_t big = -3;
  CHECK(encode_npy({}, std::span(&big, 1)) == npy_of("<i8", "()", raw({big})));
  const std::vector<std::string> texts = {"\xc3\xa4", "\xf0\x9f\x98\x80z", ""};
  CHECK(encode_npy(std::span(&three, 1), std::span<const std::string>(texts)) ==
        npy_of("<U2", "(3,)", raw<char32_t>({U'ä', 0, U'😀', U'z', 0, 0})));
  CHECK(array_of(encode_npy(std::span(&three, 1), std::span<const std::string>(texts))).strings() == texts);

  CHECK_THROWS_WITH(encode_npy(std::span<const int64_t>(shape), std::span<const uint8_t>(bytes)),
                    Contains("shape [2,3] for 3 values"));
  for (const std::string bad : {"\xc3", "\xff", "\xed\xa0\x80", "\xc0\x80", "\xc3z"}) {
    CHECK_THROWS_WITH(encode_npy({}, std::span(&bad, 1)), Contains("text is not UTF-8"));
  }
  const std::string zero("a\0", 2);
  CHECK_THROWS_WITH(encode_npy({}, std::span(&zero, 1)), Contains("text ends in a zero"));
}

}  // namespace npy_test
