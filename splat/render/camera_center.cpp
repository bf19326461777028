#include "splat/render/camera_center.h"

namespace hsi4d {

namespace {

template <class S>
struct CameraCenter {
  static constexpr const char* kName = "camera_center";
  SplatView view;

  void forward(NodeIo<S>& io) {
    const Vector3<double> center = detail::moved_camera(view, detail::camera_update(io.in(0))).center;
    for (int i = 0; i < 3; ++i) io.out().data[i] = static_cast<S>(center[i]);
  }
  // d_δ_ρ = −W⁻ᵀ d_c
  void backward(NodeIo<S>& io) {
    const ConstArray<S> d_c = io.d_out();
    const Vector3<double> d(static_cast<double>(d_c.data[0]), static_cast<double>(d_c.data[1]),
                            static_cast<double>(d_c.data[2]));
    const Matrix3<double> inverse = detail::moved_camera(view, detail::camera_update(io.in(0))).inverse;
    Vector6<double> d_delta = Vector6<double>::Zero();
    d_delta.head<3>() = -(inverse.transpose() * d);
    detail::add_camera_gradient(io.in(0), std::span<const double>(d_delta.data(), 6), 1, io.d_in(0));
  }
};

}  // namespace

template <class S>
Var<S> camera_center(Var<S> xi, const SplatView& view, Source where) {
  HSI4D_CHECK_EQ(xi.shape(), shape_of(1, 6));
  check_camera(view.camera);
  return xi.owner().record(CameraCenter<S>{view}, {xi}, shape_of(1, 3), where);
}

template Var<float> camera_center(Var<float>, const SplatView&, Source);
template Var<double> camera_center(Var<double>, const SplatView&, Source);

}  // namespace hsi4d
