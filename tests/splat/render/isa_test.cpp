// That tests run with the instruction set that HSI4D_ISA asks for, and that kernels agree between instruction sets.
#include "tests/support/isa.h"

#include <cstdio>
#include <cstdlib>
#include <string>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/held_isa.h"
#include "tests/support/taped_splats.h"

namespace isa_test {

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

TEST_CASE("all kernels can be held to a lesser instruction set for a while", "[isa]") {
  const Isa before = best_isa();
  const std::string target = vector_target();
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa > before) {
      CHECK_THROWS_AS(HeldIsa(isa), InternalError);
      continue;
    }
    const HeldIsa held(isa);
    CHECK(best_isa() == isa);
    CHECK(vector_target() == wanted_vector_target());
    const HeldIsa less(Isa::kBaseline);
    CHECK(best_isa() == Isa::kBaseline);
    CHECK(vector_target() == wanted_vector_target());
    if (isa > Isa::kBaseline) CHECK_THROWS_AS(HeldIsa(isa), InternalError);
  }
  CHECK(best_isa() == before);
  CHECK(vector_target() == target);
}

TEMPLATE_TEST_CASE("instruction sets agree to rounding [B13, F10]", "", float, double) {
  using S = TestType;
  constexpr bool kIsFloat = std::is_same_v<S, float>;
  for (const SettingsVariant& variant : settings_variants()) {
    SplatScene scene = random_splats(120, 33, {49, 37});
    variant.apply(scene.settings);
    INFO(variant.name);
    std::vector<double> image;
    std::vector<NamedNumbers> gradients;
    on_every_target([&] {
      TapedSplats<S> taped(scene, cotangent_of(scene.camera));
      taped.run();
      if (image.empty()) {
        image = taped.value(taped.rendered.image);
        gradients = taped.gradients();
      }
      CHECK(largest_difference(taped.value(taped.rendered.image), image) <= (kIsFloat ? 2e-6 : 1e-14));
      for (const ClassError& e : gradient_errors(taped.gradients(), gradients)) {
        INFO(e.name);
        CHECK(e.all <= (kIsFloat ? 5e-6 : 1e-12));
        CHECK(e.worst_row <= (kIsFloat ? 1e-4 : 1e-11));
      }
    });
  }
}

}  // namespace isa_test
