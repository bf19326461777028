// How far apart numbers are: the measures of the stress suite, for tests.
#pragma once

#include "stress/measures.h"

namespace hsi4d::test {

using stress::larger;
using stress::largest_difference;
using stress::median_row;
using stress::relative_l2;
using stress::worst_row_error;

}  // namespace hsi4d::test
