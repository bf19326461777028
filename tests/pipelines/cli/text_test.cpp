#include "pipelines/cli/text.h"

#include <sstream>

#include <catch2/catch.hpp>

namespace text_test {

using namespace hsi4d;
using namespace hsi4d::cli;
using Rows = std::vector<std::vector<std::string>>;

TEST_CASE("a table that is wider than a terminal is folded, its first column again before each part") {
  const Rows rows = {{"", "one", "second", "third"}, {"first row", "1.00 ± 0.10", "22", "333"}, {"b", "2", "", "4"}};
  const std::string whole =
      "           one          second  third\n"
      "first row  1.00 ± 0.10  22      333\n"
      "b          2                    4\n";
  CHECK(folded_table(rows, std::nullopt) == whole);
  CHECK(folded_table(rows, 37) == whole);
  CHECK(folded_table(rows, 36) ==
        "           one          second\n"
        "first row  1.00 ± 0.10  22\n"
        "b          2\n"
        "\n"
        "           third\n"
        "first row  333\n"
        "b          4\n");
  CHECK(folded_table(rows, 22) ==
        "           one\n"
        "first row  1.00 ± 0.10\n"
        "b          2\n"
        "\n"
        "           second\n"
        "first row  22\n"
        "b\n"
        "\n"
        "           third\n"
        "first row  333\n"
        "b          4\n");
}

TEST_CASE("names are shortened in the middle, by characters and not by bytes") {
  CHECK(shortened("garden_walk", 11) == "garden_walk");
  CHECK(shortened("garden_walk", 10) == "garde…walk");
  CHECK(shortened("αβγδεζ", 5) == "αβ…εζ");
  const Rows rows = {{"", "x"}, {std::string(40, 'n'), "1"}};
  CHECK(folded_table(rows, 30) == "                 x\nnnnnnnn…nnnnnnn  1\n");
}

TEST_CASE("text is broken between words") {
  CHECK(wrapped("one two three", 8) == "one two\nthree");
  CHECK(wrapped("one two three", 7) == "one two\nthree");
  CHECK(wrapped("one two three", 6) == "one\ntwo\nthree");
  CHECK(wrapped("± 1 longer_than_that 2", 4) == "± 1\nlonger_than_that\n2");
  CHECK(wrapped("", 5) == "");
}

}  // namespace text_test
