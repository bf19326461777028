// A user's own loss term: the example of docs/adding_a_loss.md.
#pragma once

#include <hsi4d/autodiff/elementwise.h>
#include <hsi4d/autodiff/map.h>
#include <hsi4d/autodiff/matrix.h>
#include <hsi4d/optim/loss_term.h>

// L = mean (s(rendered) − s(target))², s = max(r, g, b) − min(r, g, b).
namespace outside {

struct SaturationSettings {
  double floor = 0.01;  // spreads below this count as grey
};

inline void describe(hsi4d::ConfigFields& fields, SaturationSettings& settings) {
  fields.number("floor", settings.floor, {.min = 0, .max = 1}, "Spreads below this count as grey");
}

/// One channel of an image [3,H,W] as [1, H·W].
template <class S>
hsi4d::Var<S> channel(hsi4d::Var<S> image, hsi4d::Index c) {
  const hsi4d::Shape shape = image.shape();
  return slice_rows(reshape(image, shape.planes, shape.rows * shape.cols), c, 1);
}

inline hsi4d::LossTerm saturation_loss() {
  using namespace hsi4d;
  return make_loss_term<SaturationSettings>(
      "saturation", "Difference of the colours' saturation", [](const auto& in, const SaturationSettings& settings) {
        if (!in.given(in.rendered) || !in.given(in.target)) return decltype(in.rendered){};
        const auto x = in.rendered, y = in.target;
        const float floor = static_cast<float>(settings.floor);
        const auto total =
            sum_over({channel(x, 0), channel(x, 1), channel(x, 2), channel(y, 0), channel(y, 1), channel(y, 2)},
                     [floor](auto r, auto g, auto b, auto R, auto G, auto B) {
                       const auto s = max(max(r, max(g, b)) - min(r, min(g, b)), floor);
                       const auto t = max(max(R, max(G, B)) - min(R, min(G, B)), floor);
                       return square(s - t);
                     });
        return total * (3.0 / static_cast<double>(x.shape().count()));
      });
}

}  // namespace outside
