#include "pipelines/scan/density_rows.h"

#include <algorithm>

namespace hsi4d {

namespace {

template <class T>
void copy_numbers(std::vector<T>& values, Index from, Index to, Index columns) {
  std::copy_n(values.begin() + from * columns, columns, values.begin() + to * columns);
}

}  // namespace

Random density_random(std::int64_t seed, const char* purpose, Index iteration) {
  constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15u;
  return Random(static_cast<std::uint64_t>(seed),
                random_stream(purpose) + kGolden * static_cast<std::uint64_t>(iteration));
}

void resize_rows(ScanState& state, Index rows) {
  const auto columns = state.columns();
  const auto arrays = arrays_of(state.gaussians);
  for (std::size_t i = 0; i < kScanGroups; ++i) {
    arrays[i]->resize(static_cast<std::size_t>(rows * columns[i]));
    if (!state.moments[i].steps.empty()) state.moments[i].resize(rows, columns[i]);
  }
}

void copy_row(ScanState& state, Index from, Index to) {
  const auto columns = state.columns();
  const auto arrays = arrays_of(state.gaussians);
  for (std::size_t i = 0; i < kScanGroups; ++i) copy_numbers(*arrays[i], from, to, columns[i]);
}

void forget_moments(ScanState& state, Index row) {
  const auto columns = state.columns();
  for (std::size_t i = 0; i < kScanGroups; ++i) {
    if (!state.moments[i].steps.empty()) state.moments[i].clear_row(row, columns[i]);
  }
}

void keep_rows(ScanState& state, const std::vector<bool>& keeps) {
  const auto columns = state.columns();
  Index kept = 0;
  for (Index row = 0; row < std::ssize(keeps); ++row) {
    if (!keeps[static_cast<std::size_t>(row)]) continue;
    if (row == kept++) continue;
    copy_row(state, row, kept - 1);
    for (std::size_t i = 0; i < kScanGroups; ++i) {
      RowMoments<float>& moments = state.moments[i];
      if (moments.steps.empty()) continue;
      copy_numbers(moments.mean, row, kept - 1, columns[i]);
      copy_numbers(moments.square, row, kept - 1, columns[i]);
      copy_numbers(moments.steps, row, kept - 1, 1);
    }
  }
  resize_rows(state, kept);
}

}  // namespace hsi4d
