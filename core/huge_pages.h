// Large tables in large pages.
#pragma once

#include "core/types.h"

namespace hsi4d {

/// Asks the system to keep freshly taken memory in pages of 2 MiB, which a table of tens of megabytes is read faster
/// from. Only a wish; memory of less than a few such pages is left alone.
void advise_huge_pages(void* memory, Index bytes);

}  // namespace hsi4d
