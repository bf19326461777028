// Rows of a table that is stored row by row.
#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "core/check.h"
#include "core/parallel.h"
#include "core/types.h"

namespace hsi4d {

/// The rows of a table [N, width] that are asked for, in that order, which may name one twice. Throws InternalError for
/// a row that is not there.
template <class T>
std::vector<T> gathered(const std::vector<T>& table, std::span<const Index> rows, Index width) {
  constexpr Index kGrain = 4096;
  const Index count = width > 0 ? std::ssize(table) / width : 0;
  for (const Index row : rows) HSI4D_CHECK(row >= 0 && row < count, "there is no row " + std::to_string(row));
  std::vector<T> result(rows.size() * static_cast<std::size_t>(width));
  parallel_for(std::ssize(rows), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      std::copy_n(table.begin() + rows[static_cast<std::size_t>(i)] * width, width, result.begin() + i * width);
  });
  return result;
}

}  // namespace hsi4d
