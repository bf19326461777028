#include "core/text.h"

#include <limits>
#include <vector>

#include <catch2/catch.hpp>

using namespace hsi4d;

TEST_CASE("words are joined by commas") {
  CHECK(joined({}).empty());
  CHECK(joined(std::vector<std::string>{"a"}) == "a");
  CHECK(joined(std::vector<std::string>{"a", "b", "c"}) == "a, b, c");
}

TEST_CASE("numbers are written in few digits, or in all that they need") {
  CHECK(rounded(0.0123456, 4) == "0.01235");
  CHECK(rounded(123456, 4) == "1.235e+05");
  CHECK(rounded(-0.0, 4) == "0");
  CHECK(rounded(-std::numeric_limits<double>::quiet_NaN(), 4) == "nan");
  CHECK(rounded(-std::numeric_limits<double>::infinity(), 4) == "-inf");
  CHECK(number_text(0.1) == "0.1");
  CHECK(std::stod(number_text(1.0 / 3)) == 1.0 / 3);
  CHECK(four_digits(7) == "0007");
  CHECK(four_digits(12345) == "12345");
}
