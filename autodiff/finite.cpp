#include "autodiff/finite.h"

#include <bit>
#include <limits>

#include "core/simd.h"

namespace hsi4d {

namespace {

template <class S>
using Bits = std::conditional_t<sizeof(S) == 4, std::uint32_t, std::uint64_t>;

template <class S>
constexpr Bits<S> kExponent = std::bit_cast<Bits<S>>(std::numeric_limits<S>::infinity());

template <class S>
bool is_non_finite(S x) {
  return (std::bit_cast<Bits<S>>(x) & kExponent<S>) == kExponent<S>;
}

/// True when a run of numbers holds one that is not finite. No early exit: the loop is vector code.
template <class S>
bool any_non_finite(const S* x, Index n) {
  Bits<S> largest = 0;
  on_best_isa([&] {
    Bits<S> found = 0;
    for (Index i = 0; i < n; ++i) {
      const Bits<S> exponent = std::bit_cast<Bits<S>>(x[i]) & kExponent<S>;
      found = exponent > found ? exponent : found;
    }
    largest = found;
  });
  return largest == kExponent<S>;
}

}  // namespace

template <class S>
Index first_non_finite(const ConstArray<S>& numbers) {
  const Shape& shape = numbers.shape;
  const bool dense = shape.dense();
  const Index runs = dense ? 1 : numbers.total_rows();
  const Index length = dense ? shape.count() : shape.cols;
  for (Index r = 0; r < runs; ++r) {
    const S* run = dense ? numbers.data : numbers.row(r);
    if (!any_non_finite(run, length)) continue;
    for (Index i = 0; i < length; ++i) {
      if (is_non_finite(run[i])) return r * length + i;
    }
  }
  return -1;
}

template Index first_non_finite(const ConstArray<float>&);
template Index first_non_finite(const ConstArray<double>&);

}  // namespace hsi4d
