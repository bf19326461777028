// A few Gaussians before a camera on a tape, rendered: for rows that take a whole render.
#pragma once

#include <cmath>
#include <vector>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/random.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/render.h"
#include "splat/render/sh.h"
#include "stress/measures.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

/// Gaussians as numbers, harmonics of degree 1; the camera is at the origin and looks along z.
struct SmallScene {
  int width = 0, height = 0;
  Index count = 0;
  std::vector<double> means, quats, log_scales, logits, sh;
};

/// Gaussians all over the image, 2 to 5 m away, from 2 to 10 pixels wide. Every number is a float.
inline SmallScene small_scene(Index count, int width, int height, std::uint64_t seed) {
  SmallScene scene{width, height, count, {}, {}, {}, {}, {}};
  RandomSequence random(seed);
  const auto add = [&](std::vector<double>& to, double low, double high) {
    to.push_back(static_cast<double>(static_cast<float>(random.uniform(low, high))));
  };
  for (Index n = 0; n < count; ++n) {
    const double z = random.uniform(2, 5);
    const double half = 0.5 * z, aspect = static_cast<double>(height) / width;
    add(scene.means, -half, half);
    add(scene.means, -half * aspect, half * aspect);
    add(scene.means, z, z + 1e-3);
    for (int i = 0; i < 4; ++i) add(scene.quats, -1, 1);
    const double pixel = z / width;
    for (int i = 0; i < 3; ++i) add(scene.log_scales, std::log(pixel), std::log(5 * pixel));
    add(scene.logits, -1, 3);
    for (int i = 0; i < 12; ++i) add(scene.sh, i < 3 ? -1 : -0.2, i < 3 ? 1.5 : 0.2);
  }
  return scene;
}

inline SplatView view_of(const SmallScene& scene) {
  SplatView view;
  view.camera = {scene.width,
                 scene.height,
                 static_cast<double>(scene.width),
                 static_cast<double>(scene.width),
                 0.5 * scene.width,
                 0.5 * scene.height,
                 {}};
  return view;
}

/// The scene on a tape.
template <class S>
struct TapedSmallScene {
  Tape<S> tape;
  SplatView view;
  Var<S> means, quats, log_scales, logits, sh, xi, background;
  Rendered<S> rendered;

  explicit TapedSmallScene(const SmallScene& scene, const RenderRequest& request = {}) : view(view_of(scene)) {
    const auto leaf = [&](const char* name, const std::vector<double>& numbers) {
      const Var<S> var = tape.parameter(name, shape_of(scene.count, std::ssize(numbers) / scene.count));
      set_numbers(tape, var, numbers);
      return var;
    };
    means = leaf("means", scene.means);
    quats = leaf("quats", scene.quats);
    log_scales = leaf("log_scales", scene.log_scales);
    logits = leaf("logits", scene.logits);
    sh = leaf("sh", scene.sh);
    xi = tape.parameter("xi", shape_of(1, 6));
    background = tape.parameter("background", shape_of(1, 3));
    set_numbers(tape, background, {0.2, 0.3, 0.4});
    rendered =
        render<S>({means, gaussian_axes(quats, log_scales), gaussian_opacities(logits), sh_colors(sh, means, xi, view)},
                  xi, background, view, request);
  }

  std::vector<Var<S>> leaves() const { return {means, quats, log_scales, logits, sh, xi, background}; }
  std::vector<double> value(Var<S> of) const { return numbers_of<S>(tape.value(of)); }
  std::vector<double> gradient(Var<S> of) const { return numbers_of<S>(tape.gradient(of)); }
};

/// The image of a scene, in double.
inline std::vector<double> exact_image(const SmallScene& scene) {
  TapedSmallScene<double> taped(scene);
  taped.tape.forward(taped.rendered.image);
  return taped.value(taped.rendered.image);
}

}  // namespace hsi4d::stress
