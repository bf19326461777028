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
inline constexpr std::size_t kAlignment = 64;

/// `value` rounded up to a multiple of `unit`.
constexpr Index round_up(Index value, Index unit) { return (value + unit - 1) / unit * unit; }

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
