#include "core/formatted.h"

#include <catch2/catch.hpp>

namespace formatted_test {

using namespace hsi4d;

TEST_CASE("formatted text is printf's, of any length") {
  CHECK(formatted("%-4s|%6.2f|%lld", "ab", 1.005, 7LL) == "ab  |  1.00|7");
  CHECK(formatted("%s", "").empty());
  const std::string many(5000, 'x');
  CHECK(formatted("<%s>", many.c_str()) == "<" + many + ">");
}

}  // namespace formatted_test
