#include "optim/parameters.h"

#include <algorithm>

#include "core/rotation.h"

namespace hsi4d {

template <class S>
std::vector<Index> wrap_axis_angles(Var<S> axis_angles) {
  Tape<S>& tape = axis_angles.owner();
  const ConstArray<S> now = tape.value(axis_angles);
  HSI4D_CHECK_EQ(now.shape.cols, Index{3});
  std::vector<Index> changed;
  for (Index r = 0; r < now.total_rows(); ++r) {
    Vector3<S> w(now.row(r)[0], now.row(r)[1], now.row(r)[2]);
    if (!wrap_axis_angle(w)) continue;
    std::copy_n(w.data(), 3, tape.write(axis_angles).row(r));
    changed.push_back(r);
  }
  return changed;
}

template <class S>
bool hold_in_range(Var<S> leaf, const ParameterRange& range) {
  const S low = static_cast<S>(range.low), high = static_cast<S>(range.high);
  const ConstArray<S> now = leaf.owner().value(leaf);
  const Index cols = now.shape.cols;
  Index out = 0;
  for (Index r = 0; r < now.total_rows(); ++r) {
    out += std::count_if(now.row(r), now.row(r) + cols, [&](S x) { return x < low || x > high; });
  }
  if (out == 0) return false;
  const Array<S> held = leaf.owner().write(leaf);
  for (Index r = 0; r < held.total_rows(); ++r) {
    std::transform(held.row(r), held.row(r) + cols, held.row(r), [&](S x) { return std::clamp(x, low, high); });
  }
  return true;
}

template bool hold_in_range(Var<float>, const ParameterRange&);
template bool hold_in_range(Var<double>, const ParameterRange&);
template std::vector<Index> wrap_axis_angles(Var<float>);
template std::vector<Index> wrap_axis_angles(Var<double>);

}  // namespace hsi4d
