// Rows P5, P6: a Gaussian with a number that is none is not drawn: image and gradients of the others have the bits that
// they have without it.
#include <algorithm>
#include <array>
#include <utility>

#include "stress/measures.h"
#include "stress/poison.h"

namespace hsi4d::stress {

namespace {

constexpr Index kRows = 40;

/// What a render is made of, and what becomes of it.
template <class S>
struct Drawing {
  Tape<S>& tape;
  Vars<S> inputs;  ///< that have a gradient
  Vars<S> images = {};
  Var<S> loss = {};

  void look_at(const Vars<S>& seen) {
    images = seen;
    RandomSequence random(79);
    for (const Var<S> image : images) {
      const Var<S> weight = tape.constant("weight", image.shape());
      std::vector<double> numbers;
      for (Index i = 0; i < image.shape().count(); ++i) numbers.push_back(random.uniform(-1, 1));
      set_numbers(tape, weight, numbers);
      const Var<S> term = sum(image * weight);
      loss = loss.tape == nullptr ? term : loss + term;
    }
  }
  void run() {
    tape.forward(loss);
    tape.backward(loss);
  }
  std::vector<double> pixels() const {
    std::vector<double> all;
    for (const Var<S> image : images) {
      const std::vector<double> numbers = numbers_of<S>(tape.value(image));
      all.insert(all.end(), numbers.begin(), numbers.end());
    }
    return all;
  }
  /// Of all inputs; those of a row left out.
  std::vector<double> gradients(Index without) const {
    std::vector<double> all;
    for (const Var<S> input : inputs) {
      const ConstArray<S> d = tape.gradient(input);
      for (Index r = 0; r < d.shape.rows; ++r) {
        if (r == without && d.shape.rows == kRows) continue;
        for (Index c = 0; c < d.shape.cols; ++c) all.push_back(static_cast<double>(d(r, c)));
      }
    }
    return all;
  }
  /// Numbers of a row's gradients that are not 0.
  double own_gradients(Index row) const {
    double count = 0;
    for (const Var<S> input : inputs) {
      const ConstArray<S> d = tape.gradient(input);
      for (Index c = 0; c < d.shape.cols && d.shape.rows == kRows; ++c) count += d(row, c) == S(0) ? 0 : 1;
    }
    return count;
  }
};

struct Changes {
  double pixels = 0, gradients = 0, not_finite = 0;
  double kept = 0;       ///< results that are others after a bad number has gone
  double swallowed = 0;  ///< finite pixels of what is shared and is not finite
};

double different(const std::vector<double>& a, const std::vector<double>& b) {
  double count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) count += same_bits(a[i], b[i]) ? 0 : 1;
  return count;
}

/// An input that is poisoned, and what of it leaves the Gaussian out.
template <class S>
struct PoisonedPlace {
  Var<S> input;
  bool infinite_is_bad = true;      ///< NaN is bad everywhere
  bool gradients_overflow = false;  ///< at huge numbers: sums of them are beyond the largest
};

/// One number in place of another.
template <class S>
void try_number(Drawing<S>& drawing, const PoisonedPlace<S>& place, Index row, S poison,
                const std::array<std::vector<double>, 2>& without, Changes& changes) {
  const Index col = row % place.input.shape().cols;
  const S good = std::exchange(drawing.tape.write(place.input)(row, col), poison);
  drawing.run();
  drawing.tape.write(place.input)(row, col) = good;
  if (std::isnan(poison) || (std::isinf(poison) && place.infinite_is_bad)) {
    changes.pixels += different(drawing.pixels(), without[0]);
    changes.gradients += different(drawing.gradients(row), without[1]) + drawing.own_gradients(row);
  } else {
    changes.not_finite += not_finite(drawing.pixels());
    if (std::abs(poison) <= 1 || !place.gradients_overflow) changes.not_finite += not_finite(drawing.gradients(row));
  }
}

/// @param left_out  the numbers [kRows,·] of `means` or the like that take a Gaussian away without harm
template <class S>
void try_poison(Drawing<S>& drawing, const std::vector<PoisonedPlace<S>>& places, Var<S> taken,
                const std::vector<double>& left_out, Changes& changes) {
  const Index cols = taken.shape().cols;
  for (const Index row : {Index(0), Index(17), kRows - 1}) {
    S* const numbers = drawing.tape.write(taken).row(row);
    const std::vector<S> good(numbers, numbers + cols);
    for (Index c = 0; c < cols; ++c) numbers[c] = static_cast<S>(left_out[static_cast<std::size_t>(row * cols + c)]);
    drawing.run();
    const std::array without = {drawing.pixels(), drawing.gradients(row)};
    std::copy(good.begin(), good.end(), drawing.tape.write(taken).row(row));
    for (const PoisonedPlace<S>& place : places) {
      for (const S poison : kPoison<S>) try_number(drawing, place, row, poison, without, changes);
    }
  }
}

/// The pixels with a number in place of another.
template <class S>
std::vector<double> pixels_with(Drawing<S>& drawing, Var<S> place, S number) {
  const S before = std::exchange(drawing.tape.write(place)(0, 1), number);
  drawing.tape.forward(drawing.loss);
  drawing.tape.write(place)(0, 1) = before;
  return drawing.pixels();
}

/// What all Gaussians share may spoil everything while it is bad, and nothing afterwards.
///
/// @param seen  what has to be seen while it is not finite; nothing is drawn by a camera that is not (kGates)
template <class S>
void try_shared(Drawing<S>& drawing, const Vars<S>& places, Var<S> seen, Changes& changes) {
  drawing.run();
  const std::array good = {drawing.pixels(), drawing.gradients(-1)};
  for (const Var<S> place : places) {
    const PoisonResults others = {pixels_with(drawing, place, drawing.tape.value(place)(0, 1) + S(1e-2))};
    const std::vector<std::vector<bool>> depends = changed_numbers(others, {good[0]});
    for (const S poison : kPoison<S>) {
      const S before = std::exchange(drawing.tape.write(place)(0, 1), poison);
      try {
        drawing.run();
        if (!std::isfinite(poison) && place.id == seen.id)
          changes.swallowed += swallowed_numbers({drawing.pixels()}, depends, {});
      } catch (const UserError&) {  // a camera that makes no sense: told
      }
      drawing.tape.write(place)(0, 1) = before;
      drawing.run();
      changes.kept += different(drawing.pixels(), good[0]) + different(drawing.gradients(-1), good[1]);
    }
  }
}

/// Gaussians given in the image.
struct Flat {
  std::vector<double> means, factors, depths, opacities, features;

  Flat() {
    RandomSequence random(80);
    for (Index n = 0; n < kRows; ++n) {
      means.insert(means.end(), {random.uniform(0, 32), random.uniform(0, 24)});
      for (int i = 0; i < 6; ++i) factors.push_back(random.uniform(-3, 3));
      depths.push_back(random.uniform(1, 5));
      opacities.push_back(random.uniform(0.2, 0.95));
      for (int i = 0; i < 3; ++i) features.push_back(random.uniform(0, 1));
    }
  }
};

/// They on a tape, composited.
template <class S>
struct FlatDrawing {
  Tape<S> tape;
  Drawing<S> drawing{tape, {}};
  Var<S> means, factors, depths, depth_low, means_low, opacities, features, background;

  FlatDrawing();
  Vars<S> poisoned() const { return {means, factors, depths, depth_low, means_low, opacities, features, background}; }
};

template <class S>
FlatDrawing<S>::FlatDrawing() {
  const Flat flat;
  const auto leaf = [&](Index cols, const std::vector<double>& numbers) {
    return stress::leaf(tape, "input", shape_of(std::ssize(numbers) / cols, cols), numbers);
  };
  means = leaf(2, flat.means);
  factors = leaf(6, flat.factors);
  opacities = leaf(1, flat.opacities);
  features = leaf(3, flat.features);
  background = leaf(3, {0.2, 0.3, 0.4});
  depths = tape.constant("depths", shape_of(kRows, 1));
  depth_low = tape.constant("rest", shape_of(kRows, 1));
  means_low = tape.constant("rest", shape_of(kRows, 2));
  set_numbers(tape, depths, flat.depths);
  const Composited<S> out = composite(SplatSet<S>{{means, factors, depths, depth_low, means_low}, opacities, features},
                                      front_view(32, 24), background);
  drawing.inputs = {means, factors, opacities, features, background};
  drawing.look_at({out.channels, out.transmittance});
}

template <class S>
void try_composite(Changes& changes) {
  FlatDrawing<S> flat;
  try_poison<S>(flat.drawing,
                {{flat.means},
                 {flat.factors},
                 {flat.depths},
                 {flat.depth_low},
                 {flat.means_low},
                 {flat.opacities},
                 {flat.features, true, true}},
                flat.factors, std::vector<double>(6 * kRows, 0), changes);
  try_shared<S>(flat.drawing, {flat.background}, flat.background, changes);
}

RenderRequest with_all(bool with_depth) {
  RenderRequest request;
  request.depth = with_depth;
  if (with_depth) request.groups = {{0, kRows / 2}, {kRows / 4, kRows}};
  return request;
}

template <class S>
Vars<S> all_images(const Rendered<S>& out, bool with_depth) {
  Vars<S> seen = {out.image, out.transmittance};
  if (with_depth) seen.insert(seen.end(), {out.depth, out.group_opacity});
  return seen;
}

/// @param with_depth  and opacities of groups beside the image; a Gaussian 3e38 m away is drawn, and gradients by its
///                    depth are beyond the largest number
template <class S>
void try_render(bool with_depth, Changes& changes) {
  const Scene scene = small_scene(kRows, 32, 24, 81);
  TapedScene<S> taped(scene, {}, with_all(with_depth));
  Drawing<S> drawing{taped.tape, taped.leaves()};
  drawing.look_at(all_images(taped.rendered, with_depth));
  std::vector<double> behind(scene.gaussians.means.begin(), scene.gaussians.means.end());
  for (std::size_t i = 2; i < behind.size(); i += 3) behind[i] *= -1;
  try_poison<S>(drawing,
                {{taped.means, true, with_depth},
                 {taped.quats},
                 {taped.log_scales, false},
                 {taped.opacity_logits, false},
                 {taped.sh, true, true}},
                taped.means, behind, changes);
  try_shared<S>(drawing, {taped.xi, taped.background}, taped.background, changes);
}

/// Pixels of which a Gaussian is left out by a factor of 0 in place of a gate: Σ weight · valid · colour.
Changes masked_by_product() {
  const Flat flat;
  const auto image = [&flat](Index bad, double poison, bool is_there) {
    std::vector<double> pixels;
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 32; ++x) {
        double sum = 0, t = 1;
        for (Index n = 0; n < kRows; ++n) {
          if (n == bad && !is_there) continue;
          const double* const mean = flat.means.data() + 2 * n;
          const double color = n == bad ? poison : flat.features[static_cast<std::size_t>(3 * n)];
          const double dx = x + 0.5 - mean[0], dy = y + 0.5 - mean[1], valid = std::isfinite(color) ? 1 : 0;
          const double alpha =
              valid * flat.opacities[static_cast<std::size_t>(n)] * std::exp(-0.5 * (dx * dx + dy * dy) / 4);
          sum += t * alpha * color;
          t *= 1 - alpha;
        }
        pixels.push_back(sum);
      }
    }
    return pixels;
  };
  Changes changes;
  for (const double poison : kPoison<double>) {
    if (std::isfinite(poison)) continue;
    const std::vector<double> without = image(17, poison, false);
    changes.pixels += different(image(17, poison, true), without);
    // A background that is not finite, taken for black where it is not, and taken away again where it is.
    changes.swallowed += swallowed_numbers({without}, {std::vector<bool>(without.size(), true)}, {});
    for (const double pixel : without) changes.kept += same_bits((pixel + poison) - poison, pixel) ? 0 : 1;
  }
  return changes;
}

template <class F>
std::vector<StressFigure> figures_of(Remedy remedy, const F& measure) {
  Changes changes;
  if (remedy == Remedy::kOff) {
    changes = masked_by_product();
  } else {
    measure(changes);
  }
  return {{"pixels that differ from those without the Gaussian", changes.pixels, 0},
          {"gradients that do, or are not 0 for it", changes.gradients, 0},
          {"numbers that are not finite where inputs are", changes.not_finite, 0},
          {"finite pixels of what all share and is not", changes.swallowed, 0},
          {"results that differ when what all share is good again", changes.kept, 0}};
}

}  // namespace

std::vector<StressFigure> poisoned_composite(Remedy remedy) {
  return figures_of(remedy, [](Changes& changes) {
    try_composite<float>(changes);
    try_composite<double>(changes);
  });
}

std::vector<StressFigure> poisoned_render(Remedy remedy) {
  return figures_of(remedy, [](Changes& changes) {
    for (const bool with_depth : {false, true}) {
      try_render<float>(with_depth, changes);
      try_render<double>(with_depth, changes);
    }
  });
}

void add_render_operators(OperatorNames& names) {
  FlatDrawing<double> flat;
  add_poisoned_operators<double>(flat.tape, flat.poisoned(), flat.drawing.images, names);
  TapedScene<double> taped(small_scene(kRows, 32, 24, 81), {}, with_all(true));
  add_poisoned_operators<double>(taped.tape, taped.leaves(), all_images(taped.rendered, true), names);
}

}  // namespace hsi4d::stress
