// The instruction sets that vector kernels can be run with here.
#pragma once

#include "core/types.h"

namespace hsi4d::stress {

/// Runs f with each set of vector instructions that the kernels are built for, the processor knows and HSI4D_ISA
/// allows; then all is as before. Returns their number. Not while other threads run kernels.
Index on_every_vector_target(FunctionRef<void()> f);

}  // namespace hsi4d::stress
