// How far apart numbers are: the measures of the stress suite, for tests.
#pragma once

#include "stress/measures.h"

namespace hsi4d::test {

using stress::larger;
using stress::largest_difference;
using stress::relative_l2;

}  // namespace hsi4d::test
