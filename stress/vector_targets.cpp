#include "stress/vector_targets.h"

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)  // as the kernels
#include <hwy/highway.h>
#include <hwy/targets.h>

#include "core/simd.h"

namespace hsi4d::stress {

namespace {

void hold(std::int64_t targets) {
  hwy::SetSupportedTargetsForTest(targets);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

/// Puts back what was allowed.
class HeldTargets {
 public:
  HeldTargets() : before_((best_isa(), hwy::SupportedTargets())) {}
  ~HeldTargets() { hold(before_); }
  HeldTargets(const HeldTargets&) = delete;
  HeldTargets& operator=(const HeldTargets&) = delete;

 private:
  std::int64_t before_;
};

const char* name_of(std::int64_t target) {
  if (target == HWY_AVX3) return isa_name(Isa::kAvx512);
  if (target == HWY_AVX2) return isa_name(Isa::kAvx2);
  return target == HWY_STATIC_TARGET ? isa_name(Isa::kBaseline) : hwy::TargetName(target);
}

}  // namespace

Index on_every_vector_target(FunctionRef<void(const char*)> f) {
  const HeldTargets held;
  const auto targets = hwy::SupportedAndGeneratedTargets();
  for (const std::int64_t target : targets) {
    hold(target);
    f(name_of(target));
  }
  return static_cast<Index>(targets.size());
}

}  // namespace hsi4d::stress
