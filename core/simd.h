// Run-time choice of the instruction set for plain loops.
//
// `on_best_isa(f)` calls f inside a function that is compiled for the best instruction set of the processor; the
// compiler inlines f there and vectorises its loops with it. Results do not depend on the choice: contraction is off
// and the order of every sum is written out. Kernels that need explicit vectors use Highway instead.
//
// Under AddressSanitizer there is one version of f: the others would read and write the same places.
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

namespace hsi4d {

enum class Isa { kBaseline, kAvx2, kAvx512 };

/// The best instruction set of this processor, or the lower one that HSI4D_ISA=baseline|avx2|avx512 asks for; Highway's
/// kernels are held to it as well, if this is called before the first of them runs.
Isa best_isa();

/// "baseline", "avx2" or "avx512".
const char* isa_name(Isa isa);

namespace detail {

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define HSI4D_ISA_CLONES 1
template <class F>
[[gnu::target("avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,prefer-vector-width=512"), gnu::flatten, gnu::noinline]] void
on_avx512(F& f) {
  f();
}
template <class F>
[[gnu::target("avx2,fma"), gnu::flatten, gnu::noinline]] void on_avx2(F& f) {
  f();
}
#endif

}  // namespace detail

/// Calls f() compiled for instruction set `isa`.
template <class F>
void on_isa([[maybe_unused]] Isa isa, F&& f) {
#if defined(HSI4D_ISA_CLONES)
  if (isa == Isa::kAvx512) return detail::on_avx512(f);
  if (isa == Isa::kAvx2) return detail::on_avx2(f);
#endif
  f();
}

/// Calls f() compiled for the best instruction set of this processor.
template <class F>
void on_best_isa(F&& f) {
  on_isa(best_isa(), f);
}

/// As on_best_isa, for loops over numbers of type S. For double there is no code for AVX-512: what runs in double
/// measures the error of float, and a third of the code would be for that alone.
template <class S, class F>
void on_best_isa_for(F&& f) {
  if constexpr (std::is_same_v<S, double>) {
#if defined(HSI4D_ISA_CLONES)
    if (best_isa() != Isa::kBaseline) return detail::on_avx2(f);
#endif
    f();
  } else {
    on_best_isa(f);
  }
}

/// Calls f(kCount), a constant, compiled for the best instruction set: as many doubles as work best in step there
/// (core/lanes.h), which are a register of AVX-512 and of AVX2.
template <class F>
void with_best_lanes(F&& f) {
  auto four = [&] { f(std::integral_constant<std::ptrdiff_t, 4>()); };
  auto eight = [&] { f(std::integral_constant<std::ptrdiff_t, 8>()); };
  if (best_isa() == Isa::kAvx512) return on_isa(Isa::kAvx512, eight);
  if (best_isa() == Isa::kAvx2) return on_isa(Isa::kAvx2, four);
  four();
}

}  // namespace hsi4d
