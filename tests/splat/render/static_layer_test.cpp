#include "splat/render/static_layer.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/flat_splats.h"
#include "tests/support/isa.h"
#include "tests/support/measures.h"

namespace static_layer_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Gaussians all over an image, and some in a part of it between them in depth.
struct Sets {
  FlatSplats still, moving;
  FlatSplats both() const {
    FlatSplats all = still;
    const auto append = [](std::vector<double>& to, const std::vector<double>& from) {
      to.insert(to.end(), from.begin(), from.end());
    };
    append(all.means, moving.means);
    append(all.factors, moving.factors);
    append(all.depths, moving.depths);
    append(all.opacities, moving.opacities);
    append(all.features, moving.features);
    return all;
  }
};

constexpr int kWidth = 150, kHeight = 100;

/// What moves lies about (x, y), `spread` pixels wide.
Sets made_sets(double x, double y, double spread, Index channels = 3, std::uint64_t seed = 5) {
  Sets sets;
  sets.still = random_flat(1500, kWidth, kHeight, channels, seed);
  sets.moving = random_flat(120, kWidth, kHeight, channels, seed + 1);
  for (Index n = 0; n < sets.moving.count(); ++n) {
    double* const mean = sets.moving.means.data() + 2 * n;
    mean[0] = static_cast<float>(x + spread * (mean[0] / kWidth - 0.5));
    mean[1] = static_cast<float>(y + spread * (mean[1] / kHeight - 0.5));
    double& depth = sets.moving.depths[static_cast<std::size_t>(n)];
    depth = static_cast<float>(2.2 + 0.1 * depth);
  }
  // Equal depths in both sets, and what moves in front of and behind everything.
  sets.moving.depths[0] = sets.still.depths[0];
  sets.moving.depths[1] = 0.5;
  sets.moving.depths[2] = 50;
  return sets;
}

/// Two sets on a tape.
template <class S>
struct TwoSets {
  Tape<S> tape;
  std::vector<Var<S>> still, moving;  ///< means, factors, depths, opacities, features
  Var<S> background;                  ///< of all channels; 0 until it is written
  Composited<S> out;

  TwoSets(const Sets& sets, const SplatView& view, bool moves_all = false) {
    const SplatSet<S> first = recorded(sets.still, still), second = recorded(sets.moving, moving);
    for (const Var<S>& var : still) {
      if (!moves_all) tape.freeze(var);
    }
    background = tape.constant("background", shape_of(1, sets.still.channels));
    out = composite(first, second, view, background);
  }
  void move(const FlatSplats& splats) { write(splats, moving); }
  void write(const FlatSplats& splats, const std::vector<Var<S>>& vars) {
    const std::vector<double>* const numbers[] = {&splats.means, &splats.factors, &splats.depths, &splats.opacities,
                                                  &splats.features};
    for (std::size_t i = 0; i < vars.size(); ++i) {
      tape.set(vars[i], std::vector<S>(numbers[i]->begin(), numbers[i]->end()));
    }
  }
  void run() {
    tape.forward(out.channels);
    tape.backward(out.channels, cotangent(out));
  }
  static std::vector<S> cotangent(const Composited<S>& of) {
    const std::vector<double> numbers = random_cotangent(of.channels.shape().count(), 3);
    return {numbers.begin(), numbers.end()};
  }
  std::vector<double> image() const { return numbers_of<S>(tape.value(out.channels)); }
  std::vector<double> transmittance() const { return numbers_of<S>(tape.value(out.transmittance)); }
  std::vector<std::vector<double>> gradients(const std::vector<Var<S>>& of) const {
    std::vector<std::vector<double>> all;
    for (const std::size_t i : {0, 1, 3, 4}) all.push_back(numbers_of<S>(tape.gradient(of[i])));
    return all;
  }

 private:
  SplatSet<S> recorded(const FlatSplats& splats, std::vector<Var<S>>& vars) {
    const Index n = splats.count();
    vars = {tape.parameter("means", shape_of(n, 2)), tape.parameter("factors", shape_of(n, 6)),
            tape.parameter("depths", shape_of(n, 1)), tape.parameter("opacities", shape_of(n, 1)),
            tape.parameter("features", shape_of(n, splats.channels))};
    write(splats, vars);
    const Var<S> rest = tape.constant("rest", shape_of(n, 1)), means_low = tape.constant("rest", shape_of(n, 2));
    return {{vars[0], vars[1], vars[2], rest, means_low}, vars[3], vars[4]};
  }
};

/// The same as one set, without anything skipped.
template <class S>
struct OneSet {
  FlatRender<S> flat;
  Index second;
  OneSet(const Sets& sets, const SplatView& view) : flat(sets.both(), view), second(sets.still.count()) {
    flat.tape.forward(flat.out.transmittance);
    flat.backward(TwoSets<S>::cotangent(flat.out));
  }
  std::vector<double> image() { return flat.value(flat.out.channels); }
  std::vector<double> transmittance() { return flat.value(flat.out.transmittance); }
  std::vector<std::vector<double>> gradients(bool of_moving) {
    std::vector<std::vector<double>> all;
    for (const Var<S>& var : {flat.means, flat.factors, flat.opacities, flat.features}) {
      const std::vector<double> d = flat.d(var);
      const auto cut = d.begin() + static_cast<std::ptrdiff_t>(second * var.shape().cols);
      all.emplace_back(of_moving ? cut : d.begin(), of_moving ? d.end() : cut);
    }
    return all;
  }
};

SplatView view_with(const RenderSettings& settings, bool tiles, bool layer) {
  SplatView view = front_view(kWidth, kHeight, settings);
  view.skip = {tiles, layer, true, true};
  return view;
}

double largest_error(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b) {
  double worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = larger(worst, relative_l2(a[i], b[i]));
  return worst;
}

/// The worst row of the gradients of so many Gaussians.
double largest_row_error(const std::vector<std::vector<double>>& a, const std::vector<std::vector<double>>& b,
                         Index rows) {
  double worst = 0;
  const auto n = static_cast<std::size_t>(rows);
  for (std::size_t i = 0; i < a.size(); ++i) worst = larger(worst, worst_row_error(a[i], b[i], n, median_row(b[i], n)));
  return worst;
}

/// What is tried: all, or less where the instruction set is held.
std::vector<Index> tried(std::vector<Index> channels) {
  if (is_held_isa()) channels.resize(1);
  return channels;
}
std::vector<SettingsVariant> tried_variants() {
  std::vector<SettingsVariant> variants = settings_variants();
  if (is_held_isa()) variants.resize(3);
  return variants;
}

}  // namespace

TEMPLATE_TEST_CASE("rendering only what moves makes the bits of rendering everything", "[isa]", float, double) {
  for (const SettingsVariant& variant : tried_variants()) {
    RenderSettings settings;
    variant.apply(settings);
    for (const Index channels : tried({3, 5, 18})) {
      INFO(variant.name << ", " << channels << " channels");
      const Sets sets = made_sets(60, 50, 30, channels);
      OneSet<TestType> all(sets, view_with(settings, false, false));
      TwoSets<TestType> two(sets, view_with(settings, true, false));
      for (int i = 0; i < 2; ++i) {
        two.run();
        CHECK(two.image() == all.image());
        CHECK(two.transmittance() == all.transmittance());
        CHECK(two.gradients(two.moving) == all.gradients(true));
        two.move(sets.moving);
      }
    }
  }
}

TEST_CASE("static layers change images by less than 1e-6 and gradients by less than 1e-5", "[isa]") {
  double image = 0, gradients = 0;
  for (const SettingsVariant& variant : settings_variants()) {
    RenderSettings settings;
    variant.apply(settings);
    for (const Index channels : tried({3, 1, 5})) {
      INFO(variant.name << ", " << channels << " channels");
      const Sets sets = made_sets(60, 50, 30, channels);
      OneSet<float> all(sets, view_with(settings, false, false));
      TwoSets<float> two(sets, view_with(settings, true, true));
      two.run();
      const double of_image = largest_difference(two.image(), all.image());
      const double of_t = largest_difference(two.transmittance(), all.transmittance());
      const double of_gradients = largest_error(two.gradients(two.moving), all.gradients(true));
      CHECK(of_image <= 1e-6);
      CHECK(of_t <= 1e-6);
      CHECK(of_gradients <= 1e-5);
      CHECK(largest_row_error(two.gradients(two.moving), all.gradients(true), sets.moving.count()) <= 1e-4);
      image = larger(image, of_image);
      gradients = larger(gradients, of_gradients);
    }
  }
  WARN("static layers: image " << image << ", gradients " << gradients);
}

TEST_CASE("what moves there and back leaves the same bits, and those of a new tape", "[isa]") {
  const Sets here = made_sets(60, 50, 30), there = made_sets(100, 30, 45);
  for (const bool layer : {false, true}) {
    const SplatView view = view_with({}, true, layer);
    TwoSets<float> moved(here, view), fresh_there(there, view);
    moved.run();
    const auto image = moved.image();
    const auto gradients = moved.gradients(moved.moving);
    fresh_there.run();
    moved.move(there.moving);
    moved.run();
    CHECK(moved.image() == fresh_there.image());
    CHECK(moved.transmittance() == fresh_there.transmittance());
    CHECK(moved.gradients(moved.moving) == fresh_there.gradients(fresh_there.moving));
    moved.move(here.moving);
    moved.run();
    CHECK(moved.image() == image);
    CHECK(moved.gradients(moved.moving) == gradients);
    moved.tape.drop_state();
    moved.move(here.moving);
    moved.run();
    CHECK(moved.image() == image);
    CHECK(moved.gradients(moved.moving) == gradients);
  }
}

TEST_CASE("what moves out of sight leaves what stands still") {
  const Sets here = made_sets(60, 50, 30);
  FlatSplats gone = here.moving;
  for (double& x : gone.means) x -= 1000;
  TwoSets<float> two(here, view_with({}, true, true));
  two.run();
  two.move(gone);
  two.run();
  FlatRender<float> still(here.still, view_with({}, false, false));
  CHECK(two.image() == still.value(still.out.channels));
  CHECK(two.out.counters->tiles > 0);
  for (const auto& d : two.gradients(two.moving))
    CHECK(std::all_of(d.begin(), d.end(), [](double x) { return x == 0; }));
  two.move(gone);
  two.run();
  CHECK(two.out.counters->tiles == 0);
  CHECK(two.out.counters->fragments == 0);
}

TEST_CASE("what stands still is taken anew when it changes") {
  const Sets before = made_sets(60, 50, 30);
  Sets after = made_sets(60, 50, 30, 3, 77);
  after.moving = before.moving;
  for (const bool layer : {false, true}) {
    const SplatView view = view_with({}, true, layer);
    TwoSets<float> changed(before, view), fresh(after, view);
    changed.run();
    changed.write(after.still, changed.still);
    changed.run();
    fresh.run();
    CHECK(changed.out.counters->times.still_s > 0);
    CHECK(changed.image() == fresh.image());
    CHECK(changed.gradients(changed.moving) == fresh.gradients(fresh.moving));
  }
}

TEMPLATE_TEST_CASE("a background lies behind everything, and anew when it changes", "", float, double) {
  using S = TestType;
  const Sets sets = made_sets(60, 50, 30);
  OneSet<S> without(sets, view_with({}, false, false));
  TwoSets<S> all(sets, view_with({}, false, false)), skipping(sets, view_with({}, true, false));
  const std::vector<double> colors = without.image(), t = without.transmittance();
  const std::size_t pixels = t.size();
  for (const std::vector<S>& background : {std::vector<S>{S(0.1), S(0.7), S(-3)}, std::vector<S>{S(2), S(0), S(0.3)}}) {
    for (TwoSets<S>* sets_of : {&all, &skipping}) {
      sets_of->tape.set(sets_of->background, background);
      sets_of->run();
    }
    std::vector<double> expected;
    for (std::size_t i = 0; i < colors.size(); ++i) {
      const S color = static_cast<S>(colors[i]), through = static_cast<S>(t[i % pixels]);
      expected.push_back(static_cast<double>(color + through * background[i / pixels]));
    }
    CHECK(all.image() == expected);
    CHECK(skipping.image() == expected);
    CHECK(skipping.transmittance() == t);
    CHECK(skipping.gradients(skipping.moving) == all.gradients(all.moving));
    CHECK(all.gradients(all.moving) != without.gradients(true));
  }
}

TEST_CASE("with a gradient in what stands still, two sets are one") {
  const Sets sets = made_sets(60, 50, 30);
  OneSet<float> all(sets, view_with({}, false, false));
  TwoSets<float> two(sets, view_with({}, true, true), true);
  two.run();
  CHECK(two.image() == all.image());
  CHECK(two.gradients(two.moving) == all.gradients(true));
  CHECK(two.gradients(two.still) == all.gradients(false));
  // And back again.
  for (const Var<float>& var : two.still) two.tape.freeze(var);
  two.run();
  CHECK(largest_difference(two.image(), all.image()) <= 1e-6);
  CHECK(largest_error(two.gradients(two.moving), all.gradients(true)) <= 1e-5);
}

TEST_CASE("counters of a render with static layers") {
  const Sets sets = made_sets(60, 50, 30);
  FlatRender<float> all(sets.both(), view_with({}, false, false));
  TwoSets<float> tiles(sets, view_with({}, true, false)), layers(sets, view_with({}, true, true));
  const Index whole = all.out.counters->fragments, every = all.out.counters->tiles;
  for (TwoSets<float>* two : {&tiles, &layers}) {
    two->run();
    CHECK(two->out.counters->visible == all.out.counters->visible);
    CHECK(two->out.counters->tiles == every);
    CHECK(two->out.counters->fragments >= whole);
    CHECK((two->out.counters->layers > 0) == (two == &layers));
    two->move(sets.moving);
    two->run();
    CHECK(two->out.counters->times.still_s == 0);
    CHECK(two->out.counters->layers == 0);
  }
  CHECK(tiles.out.counters->tiles < every / 2);
  CHECK(tiles.out.counters->fragments < whole / 2);
  CHECK(tiles.out.counters->pairs < all.out.counters->pairs / 2);
  CHECK(layers.out.counters->tiles == tiles.out.counters->tiles);
  CHECK(layers.out.counters->fragments < tiles.out.counters->fragments);
  CHECK(layers.out.counters->groups < tiles.out.counters->groups);
}

TEST_CASE("static layers make the same bits on any number of threads, again and again", "[isa]") {
  const Sets here = made_sets(60, 50, 30), there = made_sets(100, 30, 45);
  std::vector<double> image;
  std::vector<std::vector<double>> gradients;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      TwoSets<float> two(here, view_with({}, true, true));
      for (int i = 0; i < 20; ++i) {
        two.move(i % 2 == 0 ? there.moving : here.moving);
        two.run();
        if (i % 2 == 0) continue;
        if (image.empty()) {
          image = two.image();
          gradients = two.gradients(two.moving);
        }
        REQUIRE(two.image() == image);
        REQUIRE(two.gradients(two.moving) == gradients);
      }
    });
  }
}

TEST_CASE("a steady iteration with static layers allocates nothing") {
  if (!allocations_are_counted()) return;
  const Sets here = made_sets(60, 50, 30), there = made_sets(64, 52, 30);
  TwoSets<float> two(here, view_with({}, true, true));
  const auto cotangent = TwoSets<float>::cotangent(two.out);
  const std::vector<float> x_here(here.moving.means.begin(), here.moving.means.end());
  const std::vector<float> x_there(there.moving.means.begin(), there.moving.means.end());
  const auto iterate = [&](const std::vector<float>& x) {
    two.tape.set(two.moving[0], x);
    two.tape.forward(two.out.channels);
    two.tape.backward(two.out.channels, cotangent);
  };
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      CHECK(steady_allocations([&] {
              iterate(x_here);
              iterate(x_there);
            }) == 0);
    });
  }
}

}  // namespace static_layer_test
