// Instruction sets in tests: which one the vector kernels run with, and runs with each.
#pragma once

#include <string>

#include "core/types.h"

namespace hsi4d::test {

/// The set of vector instructions that Highway's kernels are dispatched to, by Highway's name; as a kernel of the
/// tests' own tells when it is called.
std::string vector_target();
/// The one that belongs to what best_isa() says.
std::string wanted_vector_target();

/// True where HSI4D_ISA holds the tests to less than the processor has. Slow tests try less there.
bool is_held_isa();

/// Runs f with each set of vector instructions that the kernels are built for, the processor knows and HSI4D_ISA
/// allows; then all is as before.
void on_every_target(FunctionRef<void()> f);

}  // namespace hsi4d::test
