// Random sequences of what may happen to a render between iterations: moves, jumps out of view and back, masks,
// backgrounds, leaves that freeze and thaw, other results, dropped state. After each, what skips work has the bits of
// what skips nothing; static layers alone may round otherwise.
#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/random.h"
#include "tests/support/flat_splats.h"

namespace skip_fuzz_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr int kWidth = 84, kHeight = 52;

struct Skips {
  RenderSkips render;
  TapeSkips tape;
};
constexpr Skips kNothing = {{false, false, false, false, false}, {false, false, false}};
constexpr Skips kExact = {{true, false, true, true, true}, {}};
constexpr Skips kLayers = {};

/// What stays the same in a sequence.
struct Kind {
  std::string name;
  RenderSettings settings;
  Index channels, behind;  ///< of which so many lie over a background
  bool reads_transmittance, reads_more, squared;

  explicit Kind(RandomSequence& draw) {
    const std::vector<SettingsVariant> variants = settings_variants();
    const SettingsVariant& variant = variants[draw.below(variants.size())];
    variant.apply(settings);
    channels = std::array<Index, 8>{3, 1, 2, 4, 5, 8, 16, 18}[draw.below(8)];
    behind = 1 + static_cast<Index>(draw.below(static_cast<std::uint64_t>(std::min<Index>(channels, 4))));
    reads_transmittance = draw.below(2) == 0;
    reads_more = draw.below(2) == 0;
    squared = draw.below(2) == 0;
    name = variant.name + ", " + std::to_string(channels) + " channels, " + std::to_string(behind) +
           " over a background" + (reads_transmittance ? ", transmittance" : "") + (reads_more ? ", all channels" : "");
  }
};

/// Gaussians that stand still and that move, under some skips.
template <class S>
struct Rig {
  Tape<S> tape;
  std::vector<Var<S>> still, moving;  ///< means, factors, depths, opacities, features
  Var<S> background, target, weight, loss, other;

  Rig(const FlatSplats& of_still, const FlatSplats& of_moving, const Kind& kind, const Skips& skips) {
    SplatView view = front_view(kWidth, kHeight, kind.settings);
    view.skip = skips.render;
    tape.set_skips(skips.tape);
    const SplatSet<S> first = recorded(of_still, still), second = recorded(of_moving, moving);
    for (const Var<S>& var : still) tape.freeze(var);
    background = tape.parameter("background", shape_of(1, kind.behind));
    const Composited<S> out = composite(first, second, view, background);
    target = tape.constant("target", out.channels.shape());
    weight = tape.parameter("weight", out.transmittance.shape());
    tape.freeze(weight);
    loss = kind.squared ? l2(out.channels, target, weight) : l1(out.channels, target, weight);
    if (kind.reads_transmittance) loss = loss + l2(out.transmittance, weight, weight) * 0.7;
    if (kind.reads_more && out.more_channels.tape != nullptr) loss = loss + sum(square(out.more_channels)) * 1e-3;
    other = sum(square(out.channels)) * 1e-3;
  }
  SplatSet<S> recorded(const FlatSplats& splats, std::vector<Var<S>>& vars) {
    const Index n = splats.count();
    vars = {stress::leaf(tape, "means", shape_of(n, 2), splats.means),
            stress::leaf(tape, "factors", shape_of(n, 6), splats.factors),
            stress::leaf(tape, "depths", shape_of(n, 1), splats.depths),
            stress::leaf(tape, "opacities", shape_of(n, 1), splats.opacities),
            stress::leaf(tape, "features", shape_of(n, splats.channels), splats.features)};
    const Var<S> rest = tape.constant("rest", shape_of(n, 1)), means_low = tape.constant("rest", shape_of(n, 2));
    return {{vars[0], vars[1], vars[2], rest, means_low}, vars[3], vars[4]};
  }
  void freeze(Var<S> var, bool frozen) { frozen ? tape.freeze(var) : tape.unfreeze(var); }

  /// A result and, where it is differentiated, the gradients of all leaves; empty ones of those that have none.
  std::vector<std::vector<double>> run(Var<S> result, bool backward) {
    tape.forward(result);
    std::vector<std::vector<double>> all = {stress::numbers_of<S>(tape.value(result))};
    if (!backward) return all;
    tape.backward(result);
    std::vector<Var<S>> leaves = {background, weight};
    for (const auto& set : {moving, still}) leaves.insert(leaves.end(), set.begin(), set.end());
    for (const Var<S>& leaf : leaves)
      all.push_back(tape.has_gradient(leaf) ? stress::numbers_of<S>(tape.gradient(leaf)) : std::vector<double>());
    return all;
  }
};

/// The largest errors of static layers.
struct LayerErrors {
  double result = 0, gradient = 0;
};

template <class S>
class Sequence {
 public:
  explicit Sequence(std::uint64_t seed)
      : draw_(seed, 71),
        kind_(draw_),
        still_(random_flat(300, kWidth, kHeight, kind_.channels, seed)),
        moving_(random_flat(40, kWidth, kHeight, kind_.channels, seed + 1)),
        shape_(moving_) {
    Skips some = kExact;  // any of the exact ones
    for (bool* skip : {&some.render.static_tiles, &some.render.zero_cotangent, &some.render.unchanged_pixels,
                       &some.tape.frozen_inputs, &some.tape.unchanged_inputs, &some.tape.unread_pixels})
      *skip = draw_.below(2) == 0;
    for (const Skips& skips : {kNothing, kExact, some, kLayers})
      rigs_.push_back(std::make_unique<Rig<S>>(still_, moving_, kind_, skips));
    retarget();
    recolour();
    mask();
    move();
  }

  void step(LayerErrors& layers) {
    history_ += ";";
    for (std::uint64_t i = draw_.below(2); i < 2; ++i) {
      const Change& change = kChanges[draw_.below(kChanges.size())];
      history_ += std::string(" ") + change.name;
      (this->*change.make)();
    }
    compare(draw_.below(4) != 0, draw_.below(8) == 0, layers);
  }

 private:
  struct Change {
    const char* name;
    void (Sequence::*make)();
  };
  static constexpr std::array<Change, 17> kChanges = {{{"move", &Sequence::move},
                                                       {"move", &Sequence::move},
                                                       {"move", &Sequence::move},
                                                       {"jump", &Sequence::jump},
                                                       {"vanish", &Sequence::vanish},
                                                       {"fade", &Sequence::fade},
                                                       {"mask", &Sequence::mask},
                                                       {"target", &Sequence::retarget},
                                                       {"background", &Sequence::recolour},
                                                       {"still depths", &Sequence::shuffle_depths},
                                                       {"still features", &Sequence::repaint},
                                                       {"freeze one", &Sequence::freeze_one},
                                                       {"freeze still", &Sequence::freeze_still},
                                                       {"freeze background", &Sequence::freeze_background},
                                                       {"freeze weight", &Sequence::freeze_weight},
                                                       {"drop state", &Sequence::drop_state},
                                                       {"forward", &Sequence::run_forward}}};

  template <class F>
  void each(const F& f) {
    for (const auto& rig : rigs_) f(*rig);
  }
  void write(Var<S> Rig<S>::*leaf, const std::vector<double>& numbers) {
    each([&](Rig<S>& rig) { stress::set_numbers(rig.tape, rig.*leaf, numbers); });
  }
  void write(std::vector<Var<S>> Rig<S>::*set, std::size_t i, const std::vector<double>& numbers) {
    each([&](Rig<S>& rig) { stress::set_numbers(rig.tape, (rig.*set)[i], numbers); });
  }
  std::vector<double> numbers(Index count, double low, double high) {
    std::vector<double> result(static_cast<std::size_t>(count));
    for (double& x : result) x = draw_.uniform(low, high);
    return result;
  }

  /// What moves, about the place where it is now.
  void place() {
    for (std::size_t n = 0; n < moving_.depths.size(); ++n) {
      moving_.means[2 * n] = x_ + spread_ * (shape_.means[2 * n] / kWidth - 0.5);
      moving_.means[2 * n + 1] = y_ + spread_ * (shape_.means[2 * n + 1] / kHeight - 0.5);
      moving_.depths[n] = z_ * (0.8 + 0.1 * shape_.depths[n]);
    }
    write(&Rig<S>::moving, 0, moving_.means);
    write(&Rig<S>::moving, 2, moving_.depths);
  }
  void move() {
    x_ += draw_.uniform(-3, 3), y_ += draw_.uniform(-3, 3), z_ *= draw_.uniform(0.97, 1.03);
    place();
  }
  void jump() {
    x_ = draw_.uniform(0, kWidth), y_ = draw_.uniform(0, kHeight), z_ = draw_.uniform(0.5, 5.5);
    spread_ = draw_.uniform(8, 60);
    place();
  }
  void vanish() {
    for (std::size_t n = 0; n < moving_.depths.size(); ++n) moving_.means[2 * n] += 1000;  // until the next move
    write(&Rig<S>::moving, 0, moving_.means);
  }
  void fade() {
    moving_.opacities = numbers(moving_.count(), -0.3, 1);
    for (double& x : moving_.opacities) x = std::max(x, 0.0);
    write(&Rig<S>::moving, 3, moving_.opacities);
  }
  /// Everything counts, a rectangle, all but a rectangle, or nothing.
  void mask() {
    const auto what = draw_.below(4);
    const double left = draw_.uniform(0, kWidth), top = draw_.uniform(0, kHeight);
    const double right = left + draw_.uniform(1, 40), bottom = top + draw_.uniform(1, 40);
    std::vector<double> weights;
    for (int row = 0; row < kHeight; ++row) {
      for (int col = 0; col < kWidth; ++col) {
        const bool in = col >= left && col < right && row >= top && row < bottom;
        weights.push_back(what == 0 || (what == 1 && in) ? 1 : what == 2 && !in ? 0.5 : 0);
      }
    }
    write(&Rig<S>::weight, weights);
  }
  void retarget() { write(&Rig<S>::target, numbers(rigs_[0]->target.shape().count(), 0, 1)); }
  void recolour() { write(&Rig<S>::background, numbers(kind_.behind, -0.5, 1.5)); }
  void shuffle_depths() {
    for (double& x : still_.depths) x *= draw_.uniform(0.9, 1.1);
    write(&Rig<S>::still, 2, still_.depths);
  }
  void repaint() { write(&Rig<S>::still, 4, numbers(still_.count() * kind_.channels, -1, 1)); }
  void freeze_one() {
    const std::size_t i = std::array<std::size_t, 3>{1, 3, 4}[draw_.below(3)];
    const bool frozen = draw_.below(2) == 0;
    each([&](Rig<S>& rig) { rig.freeze(rig.moving[i], frozen); });
  }
  void freeze_still() {
    const bool frozen = draw_.below(3) != 0;
    each([&](Rig<S>& rig) {
      for (const Var<S>& var : rig.still) rig.freeze(var, frozen);
    });
  }
  void freeze_background() {
    const bool frozen = draw_.below(2) == 0;
    each([&](Rig<S>& rig) { rig.freeze(rig.background, frozen); });
  }
  void freeze_weight() {
    const bool frozen = draw_.below(3) != 0;
    each([&](Rig<S>& rig) { rig.freeze(rig.weight, frozen); });
  }
  void drop_state() {
    for (std::size_t i = 1; i < rigs_.size(); ++i) rigs_[i]->tape.drop_state();
  }
  void run_forward() {
    each([](Rig<S>& rig) { rig.tape.forward(rig.loss); });
  }

  /// @param of_other  of the result that reads all pixels
  void compare(bool backward, bool of_other, LayerErrors& layers) {
    INFO(kind_.name << history_ << (of_other ? " (other result)" : ""));
    std::vector<std::vector<std::vector<double>>> all;
    each([&](Rig<S>& rig) { all.push_back(rig.run(of_other ? rig.other : rig.loss, backward)); });
    for (const std::size_t exact : {std::size_t(1), std::size_t(2)}) {
      const bool has_the_bits = all[exact] == all[0];
      CHECK(has_the_bits);
    }
    for (std::size_t i = 0; i < all[0].size(); ++i) {
      const double error = relative_l2(all[3][i], all[0][i]);
      double& largest = i == 0 ? layers.result : layers.gradient;
      largest = larger(largest, error);
      INFO("static layers, array " << i << " is off by " << error);
      CHECK(error <= 1e-5);
    }
  }

  RandomSequence draw_;
  Kind kind_;
  FlatSplats still_, moving_, shape_;
  double x_ = kWidth / 2.0, y_ = kHeight / 2.0, z_ = 3, spread_ = 25;
  std::vector<std::unique_ptr<Rig<S>>> rigs_;  ///< that skip nothing, all that is exact, some of that, and all
  std::string history_;
};

/// Sequences with seeds from `seed` on.
template <class S>
void check_sequences(std::uint64_t seed, int sequences, int steps) {
  LayerErrors layers;
  for (int i = 0; i < sequences; ++i) {
    INFO("sequence " << seed + static_cast<std::uint64_t>(i));
    Sequence<S> sequence(seed + static_cast<std::uint64_t>(i));
    for (int step = 0; step < steps; ++step) sequence.step(layers);
  }
  std::printf("static layers in random sequences: results %.2g, gradients %.2g\n", layers.result, layers.gradient);
}

}  // namespace

TEST_CASE("whatever happens between iterations, what skips work has the bits of what skips nothing") {
  check_sequences<float>(1, 8, 4);
  check_sequences<double>(101, 2, 4);
}

TEST_CASE("whatever happens between iterations, over 300 sequences", "[full]") {
  check_sequences<float>(1000, 250, 25);
  check_sequences<double>(2000, 50, 25);
}

}  // namespace skip_fuzz_test
