#include "core/check.h"

#include <catch2/catch.hpp>

#include "core/version.h"

namespace check_test {

using Catch::Matchers::Contains;

TEST_CASE("a failed check names the source line and both values") {
  const int rows = 3;
  CHECK_THROWS_WITH(HSI4D_CHECK_EQ(rows, 4), Contains("check_test.cpp:") && Contains("rows == 4 (3 against 4)"));
  CHECK_NOTHROW(HSI4D_CHECK_EQ(rows, 3));
}

TEST_CASE("the version has three numbers") {
  CHECK(std::string(hsi4d::version()).find_first_of('.') != std::string::npos);
}

}  // namespace check_test
