// That tests run with the instruction set that HSI4D_ISA asks for, and that kernels agree between instruction sets.
#include "tests/support/isa.h"

#include <cstdio>
#include <cstdlib>
#include <string>

#include <catch2/catch.hpp>

#include "core/simd.h"

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("HSI4D_ISA took hold of every kernel", "[isa]") {
  const char* wish = std::getenv("HSI4D_ISA");
  std::printf("instruction set %s, vector kernels %s\n", isa_name(best_isa()), vector_target().c_str());
  CHECK(vector_target() == wanted_vector_target());
  if (wish == nullptr || *wish == '\0') return;
  if (std::string(wish) != isa_name(best_isa())) {
    std::printf("skipped: this processor has no %s\n", wish);
    WARN("skipped: this processor has no " << wish);
    CHECK(best_isa() < Isa::kAvx512);  // there is less, not more
  }
}

TEST_CASE("what is tried on every instruction set leaves the one that was asked for", "[isa]") {
  const std::string before = vector_target();
  int targets = 0;
  on_every_target([&] { ++targets; });
  CHECK(targets >= 1);
  CHECK(vector_target() == before);
  CHECK_THROWS(on_every_target([] { throw 1; }));
  CHECK(vector_target() == before);
}
