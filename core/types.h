// Index type, and a non-owning reference to a callable.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <utility>

namespace hsi4d {

/// Every count, row number and offset.
using Index = std::int64_t;

/// Alignment of all array memory: one cache line, one AVX-512 vector.
inline constexpr Index kAlignment = 64;

/// `value` rounded up to a multiple of `unit`.
constexpr Index round_up(Index value, Index unit) { return (value + unit - 1) / unit * unit; }

/// Elements from one row of an image or array to the next.
///
///   bytes = 64 ceil(width sizeof(S) / 64),  and 64 more where that is a multiple of 1024
///
/// Every row then begins on a cache line. Rows a multiple of 1024 bytes apart would share 4 or fewer of the 64 sets of
/// a first-level cache, so that a column of a tile evicts itself; this covers the powers of two from 1024 on.
///
/// @param width  elements, ≥ 0
/// @return       elements, ≥ width; 0 for 0
template <class S>
constexpr Index padded_row(Index width) {
  constexpr Index size = sizeof(S);
  static_assert(kAlignment % size == 0, "an element must not straddle cache lines");
  const Index bytes = round_up(width * size, kAlignment);
  return (bytes > 0 && bytes % 1024 == 0 ? bytes + kAlignment : bytes) / size;
}

template <class Signature>
class FunctionRef;

/// Non-owning reference to a callable; costs no allocation. The callable must outlive the call that it is passed to.
template <class Result, class... Args>
class FunctionRef<Result(Args...)> {
 public:
  template <class F>
  requires(!std::is_same_v<std::remove_cvref_t<F>, FunctionRef>)
      FunctionRef(F&& callable)  // NOLINT(google-explicit-constructor): a parameter type, meant to convert
      : object_(const_cast<void*>(static_cast<const void*>(std::addressof(callable)))),
        call_([](void* object, Args... args) -> Result {
          return (*static_cast<std::remove_reference_t<F>*>(object))(std::forward<Args>(args)...);
        }) {}
  Result operator()(Args... args) const { return call_(object_, std::forward<Args>(args)...); }

 private:
  void* object_;
  Result (*call_)(void*, Args...);
};

}  // namespace hsi4d
