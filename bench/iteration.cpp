#include "bench/iteration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "core/parallel.h"
#include "core/stopwatch.h"
#include "splat/render/covariance.h"
#include "splat/render/render.h"

namespace hsi4d {

namespace {

struct Mode {
  const char* name;
  RenderSkips skip;
};
constexpr std::array<Mode, 3> kModes = {{{"iteration", {false, false, false}},
                                         {"iteration_static_tiles", {true, false, true}},
                                         {"iteration_static_layer", {true, true, true}}}};

/// A workload on a tape as two sets, from means and axes to the image.
struct Iterated {
  Tape<float> tape;
  std::vector<Var<float>> wanted;  ///< what moves
  std::vector<float> means;
  Rendered<float> rendered;
  std::vector<float> cotangent;

  Iterated(const Workload& w, const Mode& mode) {
    SplatView view = w.view;
    view.skip = mode.skip;
    const SplatInputs<float> still = inputs_of(w, 0, w.moving_begin, false);
    const SplatInputs<float> moving = inputs_of(w, w.moving_begin, w.count, true);
    const Var<float> xi = tape.constant("xi", shape_of(1, 6)), background = tape.constant("background", shape_of(1, 3));
    rendered = render(still, moving, xi, background, view);
    means.assign(w.means.begin() + 3 * w.moving_begin, w.means.end());
    cotangent.resize(static_cast<std::size_t>(rendered.image.shape().count()));
    for (std::size_t i = 0; i < cotangent.size(); ++i) {
      cotangent[i] = static_cast<float>(std::sin(0.37 * static_cast<double>(i)));
    }
  }

  /// One iteration, what moves `shift` metres aside.
  void run(float shift) {
    float* const to = tape.write(wanted.front()).data;
    for (std::size_t i = 0; i < means.size(); ++i) to[i] = means[i] + (i % 3 == 0 ? shift : 0.0f);
    tape.forward(rendered.image);
    tape.backward(rendered.image, cotangent);
  }

 private:
  SplatInputs<float> inputs_of(const Workload& w, Index begin, Index end, bool moves) {
    const auto leaf = [&](const char* name, Index cols, const std::vector<float>& values) {
      const Shape shape = shape_of(end - begin, cols);
      const Var<float> var = moves ? tape.parameter(name, shape) : tape.constant(name, shape);
      std::copy(values.begin() + begin * cols, values.begin() + end * cols, tape.write(var).data);
      if (moves) wanted.push_back(var);
      return var;
    };
    const Var<float> at = leaf("means", 3, w.means), quats = leaf("quats", 4, w.quats);
    const Var<float> scales = leaf("log_scales", 3, w.log_scales), opacities = leaf("opacities", 1, w.opacities);
    return {at, gaussian_axes(quats, scales), opacities, leaf("colors", 3, w.colors)};
  }
};

double iterated_image_error(const Iterated& a, const Iterated& b) {
  const ConstArray<float> x = a.tape.value(a.rendered.image), y = b.tape.value(b.rendered.image);
  double worst = 0;
  for (Index r = 0; r < x.total_rows(); ++r) {
    for (Index c = 0; c < x.shape.cols; ++c) {
      worst = std::max(worst, std::abs(static_cast<double>(x.row(r)[c]) - static_cast<double>(y.row(r)[c])));
    }
  }
  return worst;
}

/// The largest relative L2 error of the moving arrays' gradients.
double gradient_error(const Iterated& a, const Iterated& b) {
  double worst = 0;
  for (std::size_t v = 0; v < a.wanted.size(); ++v) {
    const ConstArray<float> x = a.tape.gradient(a.wanted[v]), y = b.tape.gradient(b.wanted[v]);
    double difference = 0, size = 0;
    for (Index i = 0; i < x.shape.count(); ++i) {
      const double d = static_cast<double>(x.data[i]) - static_cast<double>(y.data[i]);
      difference += d * d;
      size += static_cast<double>(y.data[i]) * static_cast<double>(y.data[i]);
    }
    worst = std::max(worst, std::sqrt(difference / size));
  }
  return worst;
}

}  // namespace

void bench_iteration(const Workload& w, const cli::BenchOptions& options,
                     const std::function<void(const Measurement&)>& report) {
  std::vector<std::unique_ptr<Iterated>> all;
  for (const Mode& mode : kModes) all.push_back(std::make_unique<Iterated>(w, mode));
  std::vector<std::vector<double>> seconds(all.size());
  constexpr float kShift = 0.002f;  // metres: some pixels' tenths, as in an optimisation
  for (int round = -2; round < options.repeats; ++round) {
    for (std::size_t m = 0; m < all.size(); ++m) {
      Stopwatch watch;
      all[m]->run(round % 2 == 0 ? kShift : 0.0f);
      if (round >= 0) seconds[m].push_back(watch.lap());
    }
  }
  for (std::size_t m = 0; m < all.size(); ++m) {
    const RenderCounters& counters = *all[m]->rendered.counters;
    Measurement result = measured(w, counters, options.threads, kModes[m].name, seconds[m]);
    if (m > 0) {
      result.image_error = iterated_image_error(*all[m], *all.front());
      result.gradient_error = gradient_error(*all[m], *all.front());
    }
    report(result);
  }
}

}  // namespace hsi4d
