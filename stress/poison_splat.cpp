// Row P4: the operators of splat whose rows are Gaussians.
#include "splat/render/camera_center.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/sh.h"
#include "stress/poison.h"

namespace hsi4d::stress {

namespace {

constexpr Index kSplatRows = 40;

SplatView some_view(int sh_degree) {
  SplatView view = front_view(64, 48);
  view.settings.sh_degree = sh_degree;
  view.camera.camera_from_world.translation = {0, 0, 3};
  return view;
}

struct Splats {
  template <class S>
  std::vector<PoisonedOperator<S>> operator()() const {
    const PoisonInput means{shape_of(kSplatRows, 3)}, axes{shape_of(kSplatRows, 9), {}, -0.2, 0.2};
    const PoisonInput xi{shape_of(1, 6), shared, -0.05, 0.05};
    std::vector<PoisonedOperator<S>> all;
    all.push_back(
        {{{shape_of(kSplatRows, 1), {}, -3, 3}}, [](const Vars<S>& in) { return gaussian_opacities(in[0]); }});
    all.push_back({{{shape_of(kSplatRows, 4)}, {shape_of(kSplatRows, 3), {}, -3, 0}},
                   [](const Vars<S>& in) { return gaussian_axes(in[0], in[1]); }});
    all.push_back({{{shape_of(kSplatRows, 12)}, {shape_of(kSplatRows, 9)}},
                   [](const Vars<S>& in) { return transform_axes(in[0], in[1]); }});
    all.push_back({{{shape_of(1, 12), shared}, {shape_of(kSplatRows, 9)}},
                   [](const Vars<S>& in) { return transform_axes(in[0], in[1]); }});
    const auto projection = [](const Vars<S>& in) {
      const Projected<S> p = project(in[0], in[1], in[2], some_view(0), in.size() > 3 ? in[3] : Var<S>{});
      return Vars<S>{p.means_px, p.factors, p.depths};
    };
    all.push_back({{means, axes, xi}, projection, {}, true});
    all.push_back({{means, axes, xi, {shape_of(1, 4), shared, 30, 40}}, projection, {}, true});
    for (int degree = 0; degree <= 3; ++degree) {
      const PoisonInput sh{shape_of(kSplatRows, 3 * (degree + 1) * (degree + 1)), {}, -0.3, 0.3};
      all.push_back({{sh, means, xi},
                     [degree](const Vars<S>& in) { return sh_colors(in[0], in[1], in[2], some_view(degree)); },
                     {},
                     true});
      all.push_back({{sh, means, xi, {shape_of(1, 12), shared}},
                     [degree](const Vars<S>& in) { return sh_colors(in[0], in[1], in[2], some_view(degree), in[3]); },
                     {},
                     true});
    }
    all.push_back({{xi}, [](const Vars<S>& in) { return camera_center(in[0], some_view(0)); }, {shared}});
    return all;
  }
};

}  // namespace

std::vector<StressFigure> poisoned_splats(Remedy remedy) { return family_leaks(Splats(), remedy); }

void add_splat_operators(OperatorNames& names) { add_family_operators(Splats(), names); }

}  // namespace hsi4d::stress
