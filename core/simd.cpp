#include "core/simd.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <string_view>

#include <hwy/highway.h>
#include <hwy/targets.h>

#include "core/check.h"
#include "core/held_isa.h"

namespace hsi4d {

namespace {

constexpr std::array kAll = {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512};

Isa supported_isa() {
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512bw")) {
    return Isa::kAvx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return Isa::kAvx2;
#endif
  return Isa::kBaseline;
}

/// Highway's kernels too take no more than `isa`.
void hold_highway(Isa isa) {
  // Better targets are lower bits.
  if (isa == Isa::kAvx2) hwy::SetSupportedTargetsForTest(~(static_cast<std::int64_t>(HWY_AVX2) - 1));
  if (isa == Isa::kBaseline) hwy::SetSupportedTargetsForTest(HWY_STATIC_TARGET);
}

Isa choose_isa() {
  const char* wish = std::getenv("HSI4D_ISA");
  if (wish == nullptr || *wish == '\0') return supported_isa();
  for (const Isa isa : kAll) {
    if (std::string_view(wish) != isa_name(isa)) continue;
    hold_highway(isa);
    return std::min(isa, supported_isa());
  }
  throw UserError("environment variable HSI4D_ISA: '" + std::string(wish) +
                  "' is unknown; allowed: baseline, avx2, avx512");
}

Isa& chosen_isa() {
  static Isa isa = choose_isa();
  return isa;
}

}  // namespace

Isa best_isa() { return chosen_isa(); }

HeldIsa::HeldIsa(Isa isa) : before_(chosen_isa()), targets_before_(hwy::SupportedTargets()) {
  HSI4D_CHECK(isa <= before_, std::string("cannot hold to ") + isa_name(isa) + ", which is more than there is");
  if (isa == before_) return;
  chosen_isa() = isa;
  hold_highway(isa);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

HeldIsa::~HeldIsa() {
  chosen_isa() = before_;
  hwy::SetSupportedTargetsForTest(targets_before_);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

const char* isa_name(Isa isa) {
  switch (isa) {
    case Isa::kAvx512:
      return "avx512";
    case Isa::kAvx2:
      return "avx2";
    case Isa::kBaseline:
      break;
  }
  return "baseline";
}

}  // namespace hsi4d
