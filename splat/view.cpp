#include "splat/view.h"

#include <Eigen/LU>

#include "core/parallel.h"

namespace hsi4d::detail {

MovedCamera moved_camera(const SplatView& view, const Vector6<double>& xi) {
  const Rigid<double>& start = view.camera.camera_from_world;
  const Matrix3<double> start_inverse = start.rotation.inverse();
  const Rigid<double> update = se3_exp(xi);
  MovedCamera moved;
  moved.rotation = update.rotation * start.rotation;
  moved.inverse = start_inverse * update.rotation.transpose();
  // −W⁻¹ (E t + τ), in an order that keeps the large −T⁻¹ t as it is.
  const Vector3<double> start_center = -(start_inverse * start.translation);
  moved.center = (start_center - view.origin_world) - moved.inverse * update.translation;
  return moved;
}

void moved_camera_adjoint(const Vector6<double>& xi, const Vector6<double>& d_delta, Vector6<double>& d_xi) {
  // A gradient of the matrix E = Exp(ξ) under which Exp(δ) E has the gradient d_δ; then on to ξ.
  const Rigid<double> update = se3_exp(xi);
  const Vector3<double> d_rho = d_delta.head<3>(), d_phi = d_delta.tail<3>();
  const Vector3<double> turn = d_phi - cross(update.translation, d_rho);
  Rigid<double> d_update;
  d_update.translation = d_rho;
  d_update.rotation = hat(Vector3<double>(turn * 0.5)) * update.rotation;
  se3_exp_adjoint(xi, d_update, d_xi);
}

template <class S>
void add_camera_gradient(const ConstArray<S>& xi, std::span<const double> partials, Index chunks,
                         const Array<S>& d_xi) {
  Vector6<double> d_delta;
  std::array<double, kReductionSlots> column;
  HSI4D_CHECK(chunks <= kReductionSlots, std::to_string(chunks) + " chunks");
  for (Index i = 0; i < 6; ++i) {
    for (Index c = 0; c < chunks; ++c)
      column[static_cast<std::size_t>(c)] = partials[static_cast<std::size_t>(6 * c + i)];
    d_delta[i] = pairwise_sum(column.data(), chunks);
  }
  Vector6<double> d = Vector6<double>::Zero();
  moved_camera_adjoint(camera_update(xi), d_delta, d);
  for (Index i = 0; i < 6; ++i) d_xi.data[i] += static_cast<S>(d[i]);
}

template void add_camera_gradient(const ConstArray<float>&, std::span<const double>, Index, const Array<float>&);
template void add_camera_gradient(const ConstArray<double>&, std::span<const double>, Index, const Array<double>&);

}  // namespace hsi4d::detail
