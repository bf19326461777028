#include "pipelines/cli/text.h"

#include <sstream>

#include <catch2/catch.hpp>

namespace text_test {

using namespace hsi4d;
using namespace hsi4d::cli;

TEST_CASE("text is broken between words") {
  CHECK(wrapped("one two three", 8) == "one two\nthree");
  CHECK(wrapped("one two three", 7) == "one two\nthree");
  CHECK(wrapped("one two three", 6) == "one\ntwo\nthree");
  CHECK(wrapped("± 1 longer_than_that 2", 4) == "± 1\nlonger_than_that\n2");
  CHECK(wrapped("", 5) == "");
}

}  // namespace text_test
