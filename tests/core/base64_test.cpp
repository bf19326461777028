#include "core/base64.h"

#include <vector>

#include <catch2/catch.hpp>

namespace base64_test {

using namespace hsi4d;

TEST_CASE("base64 of the test vectors of RFC 4648") {
  const auto of = [](std::string_view text) { return base64(std::vector<std::uint8_t>(text.begin(), text.end())); };
  CHECK(of("").empty());
  CHECK(of("f") == "Zg==");
  CHECK(of("fo") == "Zm8=");
  CHECK(of("foo") == "Zm9v");
  CHECK(of("foob") == "Zm9vYg==");
  CHECK(of("fooba") == "Zm9vYmE=");
  CHECK(of("foobar") == "Zm9vYmFy");
  CHECK(of("\xfb\xff\xbf") == "+/+/");
}

}  // namespace base64_test
