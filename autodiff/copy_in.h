// Dense numbers into an array with padded rows, for the sources of the tape.
#pragma once

#include <cstring>
#include <span>

#include "autodiff/array.h"
#include "core/check.h"

namespace hsi4d::detail {

/// Copies `values`, row-major without padding, into `to`.
template <class S>
void copy_in(std::span<const S> values, const Array<S>& to) {
  HSI4D_CHECK_EQ(static_cast<Index>(values.size()), to.shape.count());
  if (to.shape.dense()) {
    if (!values.empty()) std::memcpy(to.data, values.data(), values.size_bytes());
    return;
  }
  const std::size_t row_bytes = static_cast<std::size_t>(to.shape.cols) * sizeof(S);
  for (Index r = 0; r < to.total_rows() && row_bytes > 0; ++r) {
    std::memcpy(to.row(r), values.data() + r * to.shape.cols, row_bytes);
  }
}

}  // namespace hsi4d::detail
