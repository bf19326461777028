#include "autodiff/difference.h"

#include "autodiff/elementwise.h"
#include "autodiff/image_difference.h"
#include "autodiff/map.h"

namespace hsi4d {

namespace {

/// Mean of a lambda over the broadcast inputs.
template <class S, std::size_t K, class F>
Var<S> mean_over(const Var<S> (&inputs)[K], const F& f, const Source& where) {
  const Index count = detail::broadcast_all<S, K>(inputs).count();
  HSI4D_CHECK(count > 0, "mean of an empty array");
  return sum_over(inputs, f, where) * Operand<S>(1.0 / static_cast<double>(count), where);
}

/// w term, 0 where it does not count.
template <class W, class T>
auto weighted(W w, T term) {
  using S = decltype(value_of(term));
  return w * select(detail::counts(value_of(w), value_of(term)), term, S(0));
}

/// Mean of F over images.
template <class F, class S>
Var<S> image_mean(Var<S> a, Var<S> b, Var<S> weight, const Source& where) {
  return detail::image_difference<S, F>(a, b, weight, where) *
         Operand<S>(1.0 / static_cast<double>(a.shape().count()), where);
}

}  // namespace

template <class S>
Var<S> l1(Var<S> a, Var<S> b, Source where) {
  if (detail::are_images(a, b, Var<S>{})) return image_mean<detail::AbsoluteDifference>(a, b, Var<S>{}, where);
  return mean_over(
      {a, b}, [](auto x, auto y) { return abs(x - y); }, where);
}

template <class S>
Var<S> l1(Var<S> a, Var<S> b, Var<S> weight, Source where) {
  if (detail::are_images(a, b, weight)) return image_mean<detail::AbsoluteDifference>(a, b, weight, where);
  return mean_over(
      {a, b, weight}, [](auto x, auto y, auto w) { return weighted(w, abs(x - y)); }, where);
}

template <class S>
Var<S> l2(Var<S> a, Var<S> b, Source where) {
  if (detail::are_images(a, b, Var<S>{})) return image_mean<detail::SquaredDifference>(a, b, Var<S>{}, where);
  return mean_over(
      {a, b}, [](auto x, auto y) { return square(x - y); }, where);
}

template <class S>
Var<S> l2(Var<S> a, Var<S> b, Var<S> weight, Source where) {
  if (detail::are_images(a, b, weight)) return image_mean<detail::SquaredDifference>(a, b, weight, where);
  return mean_over(
      {a, b, weight}, [](auto x, auto y, auto w) { return weighted(w, square(x - y)); }, where);
}

template <class S>
Var<S> huber(Var<S> a, Var<S> b, double delta, Source where) {
  HSI4D_CHECK(delta > 0, "delta = " + std::to_string(delta));
  const S limit = static_cast<S>(delta);
  return mean_over(
      {a, b},
      [limit](auto x, auto y) {
        const auto d = x - y;
        const auto near = min(abs(d), limit);  // |d|, held at the limit
        return near * (abs(d) - S(0.5) * near);
      },
      where);
}

template <class S>
Var<S> charbonnier(Var<S> a, Var<S> b, double epsilon, Source where) {
  HSI4D_CHECK(epsilon > 0, "epsilon = " + std::to_string(epsilon));
  const S e = static_cast<S>(epsilon);
  return mean_over(
      {a, b},
      [e](auto x, auto y) {
        const auto d2 = square(x - y);
        return d2 / (sqrt(d2 + e * e) + e);
      },
      where);
}

#define HSI4D_DIFFERENCE(S)                              \
  template Var<S> l1(Var<S>, Var<S>, Source);            \
  template Var<S> l1(Var<S>, Var<S>, Var<S>, Source);    \
  template Var<S> l2(Var<S>, Var<S>, Source);            \
  template Var<S> l2(Var<S>, Var<S>, Var<S>, Source);    \
  template Var<S> huber(Var<S>, Var<S>, double, Source); \
  template Var<S> charbonnier(Var<S>, Var<S>, double, Source);
HSI4D_DIFFERENCE(float)
HSI4D_DIFFERENCE(double)
#undef HSI4D_DIFFERENCE

}  // namespace hsi4d
