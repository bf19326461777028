#include "splat/render/opacity.h"

#include "autodiff/dual.h"
#include "autodiff/map.h"

namespace hsi4d {

namespace {

template <class S>
struct GaussianOpacities {
  static constexpr const char* kName = "gaussian_opacities";
  S value(S x) const { return sigmoid(x); }
  template <class>
  S partials(S* p, S x) const {
    const S slope = sigmoid_derivative(x);
    p[0] = slope == slope ? slope : S(0);
    return sigmoid(x);
  }
};

}  // namespace

template <class S>
Var<S> gaussian_opacities(Var<S> logits, Source where) {
  const Shape shape = logits.shape();
  return logits.owner().record(MapOp<S, 1, GaussianOpacities<S>>{{}}, {logits}, shape, where);
}

template Var<float> gaussian_opacities(Var<float>, Source);
template Var<double> gaussian_opacities(Var<double>, Source);

}  // namespace hsi4d
