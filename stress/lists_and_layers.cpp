// Rows G about what a render keeps and cuts up: layers of what stands still, lists in chunks, results on one tape.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "stress/flat_splats.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"

namespace hsi4d::stress {

namespace {

constexpr int kWide = 80, kHigh = 48;

/// Gaussians that stand still and others among them that move, with a loss on channels and T before a background.
template <class S>
struct StillAndMoving {
  Tape<S> tape;
  std::array<Var<S>, 5> still, moving;  ///< means, factors, depths, opacities, features
  Var<S> background, loss;
  Composited<S> out;

  /// @param skips  whether anything is kept from one iteration to the next
  /// @param of_t   weight of T in the loss
  StillAndMoving(const FlatSplats& first, const FlatSplats& second, bool skips, double of_t = 1) {
    SplatView view = front_view(kWide, kHigh);
    if (!skips) view.skip = {false, false, false, false, false};
    const SplatSet<S> set = recorded(first, still, false), other = recorded(second, moving, true);
    background = leaf(tape, "background", shape_of(1, first.channels),
                      std::vector<double>(static_cast<std::size_t>(first.channels), 0.7));
    out = composite(set, other, view, background);
    loss = weighted(out.channels, 1) + weighted(out.transmittance, of_t);
  }
  void move(const FlatSplats& splats) {
    const std::vector<double>* const numbers[] = {&splats.means, &splats.factors, &splats.depths, &splats.opacities,
                                                  &splats.features};
    for (std::size_t i = 0; i < 5; ++i) set_numbers(tape, moving[i], *numbers[i]);
  }
  void run() {
    tape.forward(loss);
    tape.backward(loss);
  }
  /// By what moves, and by the background.
  std::vector<double> gradients() const {
    std::vector<double> all = numbers_of<S>(tape.gradient(background));
    for (const std::size_t i : {0, 1, 3, 4}) {
      const std::vector<double> d = numbers_of<S>(tape.gradient(moving[i]));
      all.insert(all.end(), d.begin(), d.end());
    }
    return all;
  }
  std::vector<double> outputs() const {
    std::vector<double> all = numbers_of<S>(tape.value(out.channels)), t = numbers_of<S>(tape.value(out.transmittance));
    all.insert(all.end(), t.begin(), t.end());
    return all;
  }

 private:
  SplatSet<S> recorded(const FlatSplats& splats, std::array<Var<S>, 5>& vars, bool moves) {
    const Index n = splats.count();
    vars = {leaf(tape, "means", shape_of(n, 2), splats.means), leaf(tape, "factors", shape_of(n, 6), splats.factors),
            leaf(tape, "depths", shape_of(n, 1), splats.depths),
            leaf(tape, "opacities", shape_of(n, 1), splats.opacities),
            leaf(tape, "features", shape_of(n, splats.channels), splats.features)};
    for (const Var<S>& var : vars) {
      if (!moves) tape.freeze(var);
    }
    return {{vars[0], vars[1], vars[2], tape.constant("rest", shape_of(n, 1)), tape.constant("rest", shape_of(n, 2))},
            vars[3],
            vars[4]};
  }
  Var<S> weighted(Var<S> x, double factor) {
    const Random random(5, random_stream("stress.layers"));
    const Var<S> weights = tape.constant("weights", x.shape());
    std::vector<double> numbers;
    for (Index i = 0; i < x.shape().count(); ++i)
      numbers.push_back(factor * random.uniform(static_cast<std::uint64_t>(i), -1, 1));
    set_numbers(tape, weights, numbers);
    return sum(x * weights);
  }
};

FlatSplats still_set(Index channels) { return random_splats(300, kWide, kHigh, channels, 61); }

/// Twenty Gaussians about (x, y), at the depths of all others.
FlatSplats moving_set(double x, double y, Index channels) {
  FlatSplats splats = random_splats(20, 24, 24, channels, 62);
  for (std::size_t i = 0; i < splats.means.size(); i += 2) splats.means[i] += x, splats.means[i + 1] += y;
  for (double& mean : splats.means) mean = static_cast<double>(static_cast<float>(mean));
  return splats;
}

}  // namespace

/// G1: there and back, out of view and back, and with another background; layers and lists that are kept against a tape
/// that is new each time. Without: gradients of the place before.
std::vector<StressFigure> unusual_sequences(Remedy remedy) {
  double image = 0, gradient = 0;
  for (const Index channels : {1, 3, 7}) {
    const FlatSplats still = still_set(channels);
    StillAndMoving<float> kept(still, moving_set(10, 10, channels), true);
    std::vector<double> last_outputs, last_gradients;
    double grey = 0.7;
    for (const auto& [x, y] :
         {std::pair(10., 10.), {30., 12.}, {-500., 0.}, {30., 12.}, {10., 10.}, {10., 900.}, {12., 10.}, {10., 10.}}) {
      const FlatSplats moving = moving_set(x, y, channels);
      grey = y == 12 ? 0.2 : grey;
      const std::vector<double> background(static_cast<std::size_t>(channels), grey);
      StillAndMoving<float> fresh(still, moving, true);
      kept.move(moving);
      for (auto* scene : {&kept, &fresh}) {
        set_numbers(scene->tape, scene->background, background);
        scene->run();
      }
      const std::vector<double> outputs = fresh.outputs(), gradients = fresh.gradients();
      if (remedy == Remedy::kOn || !last_outputs.empty()) {
        image += unequal(remedy == Remedy::kOn ? kept.outputs() : last_outputs, outputs);
        gradient += unequal(remedy == Remedy::kOn ? kept.gradients() : last_gradients, gradients);
      }
      last_outputs = outputs, last_gradients = gradients;
    }
  }
  return {{"numbers of images with other bits", image, 0}, {"gradients with other bits", gradient, 0}};
}

/// G5: the loss is on T too, and what lies behind everything is not black.
std::vector<StressFigure> transmittance_through_layers(Remedy remedy) {
  const FlatSplats still = still_set(3), here = moving_set(10, 10, 3), there = moving_set(14, 11, 3);
  StillAndMoving<float> layered(still, here, true, remedy == Remedy::kOn ? 1 : 0);
  StillAndMoving<double> exact(still, there, false);
  layered.run();
  const auto layers = static_cast<double>(layered.out.counters->layers);  // that it made
  layered.move(there);
  layered.run();
  exact.run();
  return {{"gradients off those without layers in double, relative",
           relative_l2(layered.gradients(), exact.gradients()), 6e-7},
          {"channels and T off these", largest_difference(layered.outputs(), exact.outputs()), 1.5e-6},
          {"tiles with a layer that are missing, of 4", std::max(0.0, 4 - layers), 0}};
}

// --- G2 --------------------------------------------------------------------------------------------------------------

namespace {

/// Two losses on one image: of its left half, and of its right.
struct TwoResults {
  TapedScene<float> taped{small_scene(60, 64, 48, 64)};
  std::array<Var<float>, 2> losses;

  TwoResults() {
    Tape<float>& tape = taped.tape;
    const Var<float> image = taped.rendered.image, target = tape.constant("target", image.shape());
    for (std::size_t half = 0; half < 2; ++half) {
      const Var<float> weight = tape.constant("weight", image_shape<float>(1, 48, 64));
      for (Index r = 0; r < 48; ++r) std::fill_n(tape.write(weight).row(r) + 32 * half, 32, 1.0F);
      losses[half] = l2(image, target, weight);
    }
  }
  std::vector<double> gradient(std::size_t of) {
    taped.tape.backward(losses[of]);
    return taped.gradient(taped.means);
  }
};

}  // namespace

/// G2: forward a, forward b, backward a is the gradient of a, or refused; a forward run of a makes its tiles again.
/// Without: tiles that b did not make count as they are, then and later, which gives a no gradient there.
std::vector<StressFigure> two_results(Remedy remedy) {
  TwoResults both, alone;
  alone.taped.tape.forward(alone.losses[0]);
  const std::vector<double> exact = alone.gradient(0), nothing(exact.size(), 0);
  double silent = 0, refused = 0;
  both.taped.tape.forward(both.losses[0]);
  both.taped.tape.forward(both.losses[1]);
  try {
    silent = relative_l2(remedy == Remedy::kOn ? both.gradient(0) : nothing, exact);
  } catch (const StaleError&) {
  }
  try {
    both.taped.tape.forward(both.losses[0]);
    refused = unequal(remedy == Remedy::kOn ? both.gradient(0) : nothing, exact);
  } catch (const StaleError&) {
    refused = 1;
  }
  return {{"error of the first result's gradient, where it has one", silent, 0},
          {"gradients after a forward run of its own, refused or other", refused, 0}};
}

namespace {

/// Rows of a gradient below this are nothing: a thousandth of the largest.
double least_row(const std::vector<double>& gradient, std::size_t rows) {
  return 1e-3 * largest_size(row_norms(gradient, rows));
}

}  // namespace

// --- G6 --------------------------------------------------------------------------------------------------------------

namespace {

/// Gradients of many faint, wide Gaussians on one tile, by kind.
template <class S>
std::array<std::vector<double>, 4> dense_gradients(const FlatSplats& splats, const RenderSettings& settings) {
  FlatRender<S> flat(splats, front_view(16, 16, settings));
  flat.backward();
  return {flat.d(flat.means), flat.d(flat.factors), flat.d(flat.opacities), flat.d(flat.features)};
}

FlatSplats dense_splats() {
  RandomSequence random(66, 1);
  FlatSplats splats;
  for (int n = 0; n < 3000; ++n) {
    const double x = random.uniform(0, 16), y = random.uniform(0, 16), depth = random.uniform(1, 5);
    splats.add(x, y, depth, random.uniform(20, 40), random.uniform(5e-4, 1.5e-3),
               {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)});
  }
  return splats;
}

}  // namespace

namespace {

constexpr int kHugeWide = 8192, kHugeHigh = 2112, kCorner = 64;  // px; the corner is whole tiles

/// Gaussians about the corner of an image that begins at (x, y), at places that floats hold exactly there too.
FlatSplats corner_splats(double x, double y) {
  RandomSequence random(68, 1);
  const auto eighths = [&random] { return std::round(8 * random.uniform(0, kCorner)) / 8; };
  FlatSplats splats;
  for (int n = 0; n < 40; ++n) {
    const double right = eighths(), down = eighths(), depth = random.uniform(1, 5);
    splats.add(x + right, y + down, depth, random.uniform(1, 5), random.uniform(0.1, 0.9), {random.uniform(0, 1)});
  }
  return splats;
}

struct HugeImage {
  double values = 0, gradients = 0;
};

/// The last corner of an image of 67,584 tiles, off the same by itself. Without: what tiles numbered in 16 bits have
/// there, those of 65,536 before.
HugeImage huge_image(Remedy remedy) {
  const int x = kHugeWide - kCorner, y = kHugeHigh - kCorner;
  FlatRender<float> huge(corner_splats(x, y), front_view(kHugeWide, kHugeHigh, uncut_settings())),
      alone(corner_splats(0, 0), front_view(kCorner, kCorner, uncut_settings()));
  std::vector<float> in_corner(static_cast<std::size_t>(kHugeWide) * kHugeHigh, 0.0F);
  for (int r = y; r < kHugeHigh; ++r)
    std::fill_n(in_corner.end() - static_cast<std::ptrdiff_t>(kHugeHigh - r) * kHugeWide + x, kCorner, 1.0F);
  huge.backward(in_corner);
  alone.backward();
  const int from_y = remedy == Remedy::kOn ? y : y - 65536 / (kHugeWide / 16) * 16;
  const ConstArray<float> found = huge.tape.value(huge.out.channels), exact = alone.tape.value(alone.out.channels);
  HugeImage off;
  for (int r = 0; r < kCorner; ++r) {
    for (int c = 0; c < kCorner; ++c)
      off.values = larger(off.values, std::abs(static_cast<double>(found.row(from_y + r)[x + c] - exact.row(r)[c])));
  }
  for (const auto kind : {&FlatRender<float>::means, &FlatRender<float>::opacities, &FlatRender<float>::features}) {
    std::vector<double> d = huge.d(huge.*kind);
    if (remedy == Remedy::kOff) std::fill(d.begin(), d.end(), 0.0);
    off.gradients = larger(off.gradients, relative_l2(d, alone.d(alone.*kind)));
  }
  return off;
}

}  // namespace

/// G6: 3000 Gaussians in one tile, three chunks of its list. Without: rows that are those of the chunk before. An image
/// of 8192 x 2112 by value.
std::vector<StressFigure> long_lists(Remedy remedy) {
  const FlatSplats splats = dense_splats();
  const auto exact = dense_gradients<double>(splats, uncut_settings());
  auto found = dense_gradients<float>(splats, uncut_settings());
  const auto rows = static_cast<std::size_t>(splats.count());
  double worst = 0, all = 0;
  for (std::size_t kind = 0; kind < 4; ++kind) {
    if (remedy == Remedy::kOff) std::rotate(found[kind].begin(), found[kind].end() - 1024, found[kind].end());
    worst = larger(worst, worst_row_error(found[kind], exact[kind], rows, least_row(exact[kind], rows)));
    all = larger(all, relative_l2(found[kind], exact[kind]));
  }
  const HugeImage huge = huge_image(remedy);
  return {{"worst row of a gradient, relative", worst, 1e-4},
          {"gradients, relative", all, 1e-6},
          {"values in the last tiles of 8192 x 2112 px, off", huge.values, 0},
          {"gradients of what is there, relative", huge.gradients, 0}};
}

// --- G13 -------------------------------------------------------------------------------------------------------------

/// G13: rows of a gradient by themselves, beside the relative L2 of all. Without: the row of the least gradient among
/// a thousandth of the largest is half of what it is, which the L2 hardly sees.
std::vector<StressFigure> rows_of_little_energy(Remedy remedy) {
  Scene scene = random_scene(300, 67, 48, 32);
  apply_quality(scene.settings, Quality::kReference);
  TapedScene<float> single(scene);
  TapedScene<double> exact(scene);
  single.run();
  exact.run();
  const std::vector<double> truth = exact.gradient(exact.means);
  std::vector<double> found = single.gradient(single.means);
  const std::size_t rows = truth.size() / 3;
  const double least = least_row(truth, rows);
  std::vector<double> sizes = row_norms(truth, rows);
  for (double& size : sizes) size = size < least ? std::numeric_limits<double>::infinity() : size;
  const auto faint = static_cast<std::size_t>(std::min_element(sizes.begin(), sizes.end()) - sizes.begin());
  if (remedy == Remedy::kOff) {
    for (std::size_t c = 0; c < 3; ++c) found[3 * faint + c] /= 2;
  }
  const std::vector<double> errors = row_errors(found, truth, rows, least);
  const double worst = largest_size(errors);
  return {{"gradient by means, relative L2", relative_l2(found, truth), 2.5e-6},
          {"worst row", worst, 3e-5},
          {"worst row over median row", worst / median_row(errors, rows), 60}};
}

}  // namespace hsi4d::stress
