// Holding plain loops and vector kernels to a lesser instruction set for a while, to compare their times.
#pragma once

#include <cstdint>

#include "core/simd.h"

namespace hsi4d {

/// While it lives best_isa() is `isa`, and Highway's kernels are held to it; then all is as before. Not while other
/// threads compute. Tables of kernels that are chosen once (body/skinning.cpp, body/directions.cpp,
/// autodiff/mlp_kernel.h) keep what they have. Throws InternalError for a better set than the one before.
class HeldIsa {
 public:
  explicit HeldIsa(Isa isa);
  ~HeldIsa();
  HeldIsa(const HeldIsa&) = delete;
  HeldIsa& operator=(const HeldIsa&) = delete;

 private:
  Isa before_;
  std::int64_t targets_before_;
};

}  // namespace hsi4d
