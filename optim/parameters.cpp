#include "optim/parameters.h"

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

template std::vector<Index> wrap_axis_angles(Var<float>);
template std::vector<Index> wrap_axis_angles(Var<double>);

}  // namespace hsi4d
