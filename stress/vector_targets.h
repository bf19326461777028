// The instruction sets that vector kernels can be run with here.
#pragma once

#include "core/types.h"

namespace hsi4d::stress {

/// Runs f(name) with each set of vector instructions that the kernels are built for, the processor knows and HSI4D_ISA
/// allows; then all is as before. Returns their number. Not while other threads run kernels.
///
/// The name is that of isa_name where one of core/simd.h belongs to it, else Highway's.
Index on_every_vector_target(FunctionRef<void(const char*)> f);

}  // namespace hsi4d::stress
