#include "tests/support/isa.h"

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)  // as the kernels
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/support/isa.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace hsi4d::test::HWY_NAMESPACE {
std::int64_t target() { return HWY_TARGET; }
}  // namespace hsi4d::test::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <algorithm>
#include <cstdlib>
#include <string_view>

#include <catch2/catch.hpp>

#include "core/simd.h"

namespace hsi4d::test {

namespace {

HWY_EXPORT(target);

/// The targets that Highway may choose from, while it lives.
class HeldTargets {
 public:
  HeldTargets() : before_(hwy::SupportedTargets()) {}
  ~HeldTargets() { hold(before_); }
  HeldTargets(const HeldTargets&) = delete;
  HeldTargets& operator=(const HeldTargets&) = delete;
  static void hold(std::int64_t targets) {
    hwy::SetSupportedTargetsForTest(targets);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }

 private:
  std::int64_t before_;
};

}  // namespace

std::string vector_target() { return hwy::TargetName(HWY_DYNAMIC_DISPATCH(target)()); }

std::string wanted_vector_target() {
  const std::int64_t wanted = best_isa() == Isa::kAvx512 ? HWY_AVX3
                              : best_isa() == Isa::kAvx2 ? HWY_AVX2
                                                         : HWY_STATIC_TARGET;
  return hwy::TargetName(std::min<std::int64_t>(wanted, HWY_STATIC_TARGET));  // better ones are lower
}

bool is_held_isa() {
  const char* wish = std::getenv("HSI4D_ISA");
  return wish != nullptr && *wish != '\0' && std::string_view(wish) != isa_name(Isa::kAvx512);
}

void on_every_target(FunctionRef<void()> f) {
  const HeldTargets before;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    HeldTargets::hold(target);
    INFO("target " << vector_target());
    CHECK(vector_target() == hwy::TargetName(target));
    f();
  }
}

}  // namespace hsi4d::test
#endif
