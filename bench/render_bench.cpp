// The taped renderer: forward, and forward with backward, of a made-up scene.
#include <cmath>
#include <random>
#include <string>

#include <benchmark/benchmark.h>

#include "bench/goals.h"
#include "core/parallel.h"
#include "splat/covariance.h"
#include "splat/render.h"

namespace {

using namespace hsi4d;

/// n Gaussians that fill the view of a camera at the origin, opaque to half of them, and the loss ½ Σ image².
template <class S>
struct Scene {
  Tape<S> tape;
  Var<S> means, quats, scales, opacities, colors, xi, background;
  Rendered<S> rendered;
  std::vector<S> cotangent;

  Scene(Index n, int side, double pixels) {
    SplatView view;
    view.camera.width = view.camera.height = side;
    view.camera.fx = view.camera.fy = side;
    view.camera.cx = view.camera.cy = side / 2.0;
    std::minstd_rand random(1);
    std::uniform_real_distribution<double> unit(0, 1);
    means = tape.parameter("means", shape_of(n, 3));
    quats = tape.parameter("quats", shape_of(n, 4));
    scales = tape.parameter("log_scales", shape_of(n, 3));
    opacities = tape.parameter("opacities", shape_of(n, 1));
    colors = tape.parameter("colors", shape_of(n, 3));
    xi = tape.parameter("xi", shape_of(1, 6));
    background = tape.constant("background", shape_of(1, 3));
    const Array<S> m = tape.write(means), q = tape.write(quats), l = tape.write(scales), c = tape.write(colors);
    const Array<S> o = tape.write(opacities);
    for (Index i = 0; i < n; ++i) {
      const double z = 2 + 2 * unit(random);
      m(i, 0) = static_cast<S>((unit(random) - 0.5) * z);
      m(i, 1) = static_cast<S>((unit(random) - 0.5) * z);
      m(i, 2) = static_cast<S>(z);
      for (int k = 0; k < 4; ++k) q(i, k) = static_cast<S>(unit(random) - 0.5);
      for (int k = 0; k < 3; ++k) l(i, k) = static_cast<S>(std::log(pixels * z / side) + unit(random) - 0.5);
      o.data[i] = static_cast<S>(0.1 + 0.85 * unit(random));
      for (int k = 0; k < 3; ++k) c(i, k) = static_cast<S>(unit(random));
    }
    rendered = render<S>({means, gaussian_axes(quats, scales), opacities, colors}, xi, background, view);
    cotangent.assign(static_cast<std::size_t>(3 * side * side), S(1));
  }
};

/// Arguments: Gaussians, side of the image, size of a Gaussian in tenths of a pixel, with backward.
template <class S>
void run(benchmark::State& state) {
  Scene<S> scene(state.range(0), static_cast<int>(state.range(1)), static_cast<double>(state.range(2)) / 10);
  with_threads(1, [&] {
    for (auto _ : state) {
      scene.tape.write(scene.means);
      scene.tape.write(scene.scales);
      scene.tape.forward(scene.rendered.image);
      if (state.range(3) != 0) scene.tape.backward(scene.rendered.image, scene.cotangent);
    }
  });
  const RenderCounters& counters = *scene.rendered.counters;
  state.counters["pairs"] = static_cast<double>(counters.pairs);
  state.counters["fragments"] = static_cast<double>(counters.fragments);
  state.counters["fragments/s"] =
      benchmark::Counter(static_cast<double>(counters.fragments), benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(run<float>)
    ->Name("render")
    ->ArgNames({"gaussians", "side", "tenths", "backward"})
    ->Args({12000, 256, 10, 0})
    ->Args({12000, 256, 10, 1})
    ->Args({100000, 1024, 15, 0})
    ->Args({100000, 1024, 15, 1})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(run<double>)
    ->Name("render_double")
    ->ArgNames({"gaussians", "side", "tenths", "backward"})
    ->Args({12000, 256, 10, 1})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

const bench::AtStart goals([] {
  bench::ask_time("12 000 Gaussians at 256 x 256, forward + backward",
                  "render/gaussians:12000/side:256/tenths:10/backward:1/real_time", 15e6);
});

}  // namespace
