#include "core/text.h"

#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>

namespace text_test {

using namespace hsi4d;

TEST_CASE("words are joined by commas") {
  CHECK(few_names(std::vector<std::string>{"a", "b\n", "c", "d", "e", "f", "g", "h"}) ==
        "a, b\\x0a, c, d, e, f and 2 more");
  CHECK(joined({}).empty());
  CHECK(joined(std::vector<std::string>{"a"}) == "a");
  CHECK(joined(std::vector<std::string>{"a", "b", "c"}) == "a, b, c");
  CHECK(joined(std::vector<std::string>{"a", "b", "c"}, " or ") == "a, b or c");
  CHECK(joined(std::vector<std::string>{"a"}, " or ") == "a");
}

TEST_CASE("numbers are written in few digits, or in all that they need") {
  CHECK(rounded(0.0123456, 4) == "0.01235");
  CHECK(rounded(123456, 4) == "123500");
  CHECK(rounded(1e5, 4) == "100000");
  CHECK(rounded(-99999.9, 4) == "-100000");
  CHECK(rounded(1e-8, 4) == "1e-08");
  CHECK(rounded(1.5e20, 4) == "1.5e+20");
  CHECK(number_text(1e8) == "100000000");
  CHECK(number_text(1e5) == "100000");
  CHECK(number_text(-123456.5) == "-123456.5");
  CHECK(number_text(1e20) == "1e+20");
  CHECK(rounded(-0.0, 4) == "0");
  CHECK(rounded(-std::numeric_limits<double>::quiet_NaN(), 4) == "nan");
  CHECK(rounded(-std::numeric_limits<double>::infinity(), 4) == "-inf");
  CHECK(number_text(0.1) == "0.1");
  CHECK(std::stod(number_text(1.0 / 3)) == 1.0 / 3);
  CHECK(four_digits(7) == "0007");
  CHECK(four_digits(12345) == "12345");
}

TEST_CASE("text that is UTF-8 without control characters is told from what is not") {
  const std::vector<std::string> plain = {"", "0001.png", " ", "\xc3\xa4", "\xe2\x82\xac", "\xf0\x9f\x98\x80", "~"};
  for (const std::string& text : plain) {
    INFO(text);
    CHECK(is_plain_text(text));
    CHECK(with_escapes(text) == text);
  }
  for (const auto& [text, escaped] : std::vector<std::pair<std::string, std::string>>{
           {"a\xffz", "a\\xffz"},
           {"\x80", "\\x80"},                             // begins no character
           {"\xc3", "\\xc3"},                             // cut
           {"\xc3(", "\\xc3("},                           // the second byte is none
           {"\xc0\xaf", "\\xc0\\xaf"},                    // overlong
           {"\xe0\x80\xaf", "\\xe0\\x80\\xaf"},           // overlong
           {"\xed\xa0\x80", "\\xed\\xa0\\x80"},           // half of a pair
           {"\xf4\x90\x80\x80", "\\xf4\\x90\\x80\\x80"},  // beyond the last
           {"\xc3\xa4\xe4", "\xc3\xa4\\xe4"},
           {"a\nb\x7f", "a\\x0ab\\x7f"}}) {
    INFO(escaped);
    CHECK_FALSE(is_plain_text(text));
    CHECK(with_escapes(text) == escaped);
  }
  CHECK(utf8_length("") == 0);
  CHECK(utf8_length("\xe2\x82\xac.") == 3);
}

TEST_CASE("names of files that stay in their folder are told from others") {
  for (const char* name : {"walk-2", "a b", "\xc3\xa4", "...", ".x", "x..y"}) CHECK(is_file_name(name));
  CHECK(is_file_name(std::string(200, 'a')));
  CHECK_FALSE(is_file_name(std::string(201, 'a')));
  for (const std::string& name :
       {std::string("x\0y", 3), std::string(), std::string("."), std::string(".."), std::string("../../evil"),
        std::string("/tmp"), std::string("a\\b"), std::string("a\nb"), std::string("\xff")})
    CHECK_FALSE(is_file_name(name));
}

}  // namespace text_test
