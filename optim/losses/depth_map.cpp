// L = Σ v ρ(r²) / Σ v,   r = a (q − q̄) + p̄ − p,   v = c (1 − T):
//
// how far from a map p of depths is the depth q that is rendered, which is the mean camera z of a pixel's Gaussians, or
// of a map of disparities 1/z. The map comes from a single picture, so its scale and shift are nobody's: a and the
// means q̄ and p̄ are those of the least squares Σ v (a q + b − p)², found anew in every evaluation, a ≥ 0. [Ranftl et
// al. 2020, MiDaS, eqs. 3 to 5] The render is laid on the map, not the map on the render, as the map is the one with
// the noise: the other way round noise would draw the depths together. p has spread 1, so r and the scale of ρ are of
// that unit. c is how sure the map is, 1 − T what of a pixel shows something.
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/reduce.h"
#include "optim/losses/list.h"
#include "optim/losses/robust.h"

namespace hsi4d {

namespace {

enum class DepthMapKind { kDepth, kDisparity };

constexpr std::array<ConfigChoice<DepthMapKind>, 2> kKinds = {
    {{DepthMapKind::kDepth, "depth"}, {DepthMapKind::kDisparity, "disparity"}}};

/// Least weight of all pixels, and least square of the render's spread, m² or 1/m²: what has less tells nothing.
constexpr double kLeastWeight = 1e-6, kLeastSpread = 1e-8;

struct DepthMapSettings {
  DepthMapKind kind = DepthMapKind::kDepth;
  RobustKernel kernel = RobustKernel::kHuber;
  double scale = 0.1;
};

void describe(ConfigFields& fields, DepthMapSettings& settings) {
  fields.choice("kind", settings.kind, kKinds,
                "What the maps of data.depth_maps hold, up to scale and shift: depth, which grows with the distance, "
                "or disparity, which falls with it");
  fields.choice("kernel", settings.kernel, kSquareKernels,
                "Of a difference: its square; huber, constant pull beyond scale; geman_mcclure, by which one far "
                "beyond scale no longer pulls");
  fields.number("scale", settings.scale, {.above = 0, .max = 100},
                "Difference up to which the kernel is nearly the square, of the map's standard deviation");
  fields.rule({"scale", "kernel"}, [&settings] {
    return idle_scale_text(settings.kernel, settings.scale, DepthMapSettings().scale, "squared");
  });
}

/// Of each pixel: how much it counts, and what the map is compared with.
template <class S>
struct Compared {
  Var<S> weight, rendered, map;
};

template <class S>
Compared<S> compared(const LossInputs<S>& in, DepthMapKind kind) {
  const bool is_disparity = kind == DepthMapKind::kDisparity;
  return {map({in.depth_map_weight, in.transmittance}, [](auto c, auto t) { return c * (1 - t); }),
          map({in.depth},
              [is_disparity](auto z) {  // 0 where nothing is
                return select(value_of(z) <= 0, S(0), select(is_disparity, 1 / z, z));
              }),
          in.depth_map};
}

/// Where what is rendered falls as the map grows, no scale above 0 lays one on the other.
/// @param total  the weight of all pixels
/// @param both   Σ v (q − q̄) (p − p̄)
template <class S>
LeftOut opposite_ways(Var<S> total, Var<S> both) {
  return {
      "depth_map", "the map grows where the rendered depths, or disparities, fall; its kind may be the other one", 1,
      [=](Index) { return total.owner().value(total).scalar() > S(1) && !(both.owner().value(both).scalar() > S(0)); },
      true};
}

/// Mean of ρ(r²).
template <class S, class F>
Var<S> mean_of(const LossInputs<S>& in, const Compared<S>& c, const F& kernel) {
  const auto of_two = [](auto v, auto x) { return v * x; };
  const Var<S> total = sum(c.weight) + kLeastWeight;
  const Var<S> middle = sum_over({c.weight, c.rendered}, of_two) / total,
               middle_of_map = sum_over({c.weight, c.map}, of_two) / total;
  const Var<S> spread =
      sum_over({c.weight, c.rendered, middle}, [](auto v, auto q, auto m) { return v * square(q - m); });
  const Var<S> both = sum_over({c.weight, c.rendered, c.map, middle, middle_of_map},
                               [](auto v, auto q, auto p, auto m, auto m_map) { return v * (q - m) * (p - m_map); });
  if (in.left_out != nullptr) in.left_out->push_back(opposite_ways(total, both));
  const Var<S> factor = map({both, spread, total}, [](auto b, auto s, auto v) {
    return max(b, S(0)) / (s + static_cast<S>(kLeastSpread) * v);
  });
  const Var<S> apart = sum_over({c.weight, c.rendered, c.map, factor, middle, middle_of_map},
                                [kernel](auto v, auto q, auto p, auto a, auto m, auto m_map) {
                                  return v * kernel(square(a * (q - m) + m_map - p));
                                });
  return apart / total;
}

template <class S>
Var<S> difference(const LossInputs<S>& in, const DepthMapSettings& settings) {
  const Compared<S> pixels = compared(in, settings.kind);
  const float scale = static_cast<float>(settings.scale);
  if (settings.kernel == RobustKernel::kNone) return mean_of(in, pixels, [](auto squared) { return squared; });
  if (settings.kernel == RobustKernel::kHuber)
    return mean_of(in, pixels, [scale](auto squared) { return huber(squared, scale); });
  return mean_of(in, pixels, [limit = scale * scale](auto squared) { return geman_mcclure(squared, limit); });
}

}  // namespace

LossTerm depth_map_loss() {
  return needing({LossInput::kDepthMap},
                 make_loss_term<DepthMapSettings>(
                     "depth_map", "Difference of the rendered depths and a map of them, up to its scale and shift",
                     [](const auto& in, const DepthMapSettings& settings) { return difference(in, settings); }));
}

}  // namespace hsi4d
