#include "splat/composite.h"

#include <cmath>
#include <limits>

#include <hwy/highway.h>

#include "autodiff/elementwise.h"
#include "core/parallel.h"
#include "core/random.h"
#include "splat/composite_kernel.h"
#include "tests/support/operator_check.h"
#include "tests/support/taped_splats.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Nothing is cut, so that everything is smooth.
RenderSettings smooth_settings() {
  RenderSettings settings;
  apply_quality(settings, Quality::kReference);
  return settings;
}

SplatView view_of_size(int width, int height, const RenderSettings& settings) {
  SplatView view;
  view.camera = plain_camera({width, height});
  view.settings = settings;
  return view;
}

/// Gaussians given in the image.
struct FlatSplats {
  std::vector<double> means, factors, depths, opacities, features;
  Index channels = 1;

  Index count() const { return static_cast<Index>(depths.size()); }
  /// A round Gaussian of radius `sigma` (without the blur).
  void add(double x, double y, double depth, double sigma, double opacity, const std::vector<double>& feature) {
    means.insert(means.end(), {x, y});
    factors.insert(factors.end(), {sigma, 0, 0, 0, sigma, 0});
    depths.push_back(depth);
    opacities.push_back(opacity);
    features.insert(features.end(), feature.begin(), feature.end());
    channels = static_cast<Index>(feature.size());
  }
};

template <class S>
struct Flat {
  Tape<S> tape;
  Var<S> means, factors, depths, opacities, features;
  Composited<S> out;

  Flat(const FlatSplats& splats, const SplatView& view) {
    const Index n = splats.count();
    means = leaf("means", shape_of(n, 2), splats.means);
    factors = leaf("factors", shape_of(n, 6), splats.factors);
    depths = leaf("depths", shape_of(n, 1), splats.depths);
    opacities = leaf("opacities", shape_of(n, 1), splats.opacities);
    features = leaf("features", shape_of(n, splats.channels), splats.features);
    const Var<S> rest = tape.constant("rest", shape_of(n, 1)), means_rest = tape.constant("rest", shape_of(n, 2));
    out = composite<S>({means, factors, depths, rest, means_rest}, opacities, features, view);
    tape.forward(out.channels);
  }
  void backward(const std::vector<S>& cotangent) { tape.backward(out.channels, cotangent); }
  void backward_ones() { backward(std::vector<S>(static_cast<std::size_t>(out.channels.shape().count()), S(1))); }
  std::vector<double> value(Var<S> of) { return wide_numbers<S>(tape.value(of)); }
  std::vector<double> d(Var<S> of) { return wide_numbers<S>(tape.gradient(of)); }

 private:
  Var<S> leaf(const char* name, const Shape& shape, const std::vector<double>& numbers) {
    const Var<S> var = tape.parameter(name, shape);
    tape.set(var, std::vector<S>(numbers.begin(), numbers.end()));
    return var;
  }
};

/// Gaussians all over an image, in random order.
FlatSplats random_flat(Index n, int width, int height, Index channels, std::uint64_t seed) {
  RandomSequence random(seed, 1);
  FlatSplats splats;
  for (Index i = 0; i < n; ++i) {
    std::vector<double> feature;
    for (Index k = 0; k < channels; ++k) feature.push_back(static_cast<float>(random.uniform(-1, 1)));
    splats.add(static_cast<float>(random.uniform(0, width)), static_cast<float>(random.uniform(0, height)),
               static_cast<float>(random.uniform(1, 5)), 1, static_cast<float>(random.uniform(0.1, 0.95)), feature);
    for (int k = 0; k < 6; ++k) {
      splats.factors[splats.factors.size() - 6 + static_cast<std::size_t>(k)] =
          static_cast<float>(random.uniform(-3, 3));
    }
  }
  return splats;
}

void check_composite(const std::string& name, const SplatView& view, Index channels, const OperatorCheck& options) {
  FlatSplats splats = random_flat(25, view.camera.width, view.camera.height, channels, 9);
  const Index n = splats.count();
  for (std::size_t i = 0; i < splats.depths.size(); ++i) splats.depths[i] = 1 + 0.125 * static_cast<double>(i * 7 % 25);
  const auto record = [&](const auto& in) {
    auto& tape = in[0].owner();
    const auto rest = tape.constant("rest", shape_of(n, 1));
    const auto means_rest = tape.constant("means rest", shape_of(n, 2));
    const auto out = composite({in[0], in[1], in[2], rest, means_rest}, in[3], in[4], view);
    return out.channels + out.transmittance;  // the transmittance is added to every channel
  };
  check_operator(name,
                 {{"means", shape_of(n, 2), 0, 1, splats.means},
                  {"factors", shape_of(n, 6), 0, 1, splats.factors},
                  {"depths", shape_of(n, 1), 0, 1, splats.depths},
                  {"opacities", shape_of(n, 1), 0, 1, splats.opacities},
                  {"features", shape_of(n, channels), 0, 1, splats.features}},
                 record, options);
}

/// Runs f with each set of vector instructions that this program has code for and the processor knows.
template <class F>
void on_every_target(const F& f) {
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    INFO("target " << hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    f();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

/// One pixel: with features that name Gaussians, eight at a time, its channels are their weights, and so are the
/// gradients of the features where the cotangent is 1. A Gaussian that only one of both composites has weight 0 in the
/// other.
template <class S>
void check_weights_of(const FlatSplats& splats, const FlatSplats& colored, const SplatView& view) {
  constexpr Index kTogether = 8;
  const Index n = splats.count();
  Flat<S> three(colored, view);
  three.backward_ones();
  const std::vector<double> d_three = three.d(three.features);
  Index drawn = 0, differ = 0;
  for (Index first = 0; first < n; first += kTogether) {
    FlatSplats names = splats;
    names.channels = kTogether;
    names.features.assign(static_cast<std::size_t>(n * kTogether), 0);
    for (Index i = first; i < std::min(n, first + kTogether); ++i)
      names.features[static_cast<std::size_t>(i * kTogether + i - first)] = 1;
    Flat<S> named(names, view);
    named.backward_ones();
    const std::vector<double> weights = named.value(named.out.channels), d = named.d(named.features);
    for (Index i = first; i < std::min(n, first + kTogether); ++i) {
      const double weight = weights[static_cast<std::size_t>(i - first)];
      drawn += weight != 0 ? 1 : 0;
      differ += weight != d[static_cast<std::size_t>(i * kTogether + i - first)] ? 1 : 0;
      differ += weight != d_three[static_cast<std::size_t>(3 * i)] ? 1 : 0;
    }
    CHECK(named.out.counters->fragments == three.out.counters->fragments);
    const double t = named.value(named.out.transmittance)[0];
    CHECK((t >= 0 && t <= 1));
  }
  CHECK(drawn == three.out.counters->fragments);
  CHECK(drawn > 3);
  CHECK(differ == 0);
}

void check_same_weights(const FlatSplats& splats, const FlatSplats& colored, const RenderSettings& settings) {
  const SplatView view = view_of_size(1, 1, settings);
  check_weights_of<float>(splats, colored, view);
  check_weights_of<double>(splats, colored, view);
}

/// exp(−d²/2) as a pixel of the compositor gets it.
template <class S>
S pixel_gaussian(S d) {
  hsi4d::detail::SplatRecord<S> record{};
  record.l22 = record.opacity = 1;
  record.y = 0.5 - static_cast<double>(d);
  hsi4d::detail::TileJob<S> job{};
  job.width = job.height = 16;
  return hsi4d::detail::pixel_alpha(record, hsi4d::detail::CompositeRules<S>{S(1), S(0), S(0), false, false}, job, 0, 0)
      .alpha;
}

template <class S>
void check_exponential(double lowest, double step) {
  double worst = 0;
  bool monotone = true;
  S last_x = 1, last = 2;
  const auto try_at = [&](S wanted) {
    const S d = S(0.5) - static_cast<S>(0.5 - static_cast<double>(wanted)), x = S(-0.5) * d * d;  // as the loops do
    const S value = pixel_gaussian(wanted);
    const long double exact = std::exp(static_cast<long double>(x));
    const S near = static_cast<S>(exact), ulp = std::nextafter(near, S(2)) - near;
    worst = std::max(worst, static_cast<double>(std::abs(static_cast<long double>(value) - exact) / ulp));
    monotone = monotone && (x < last_x ? value <= last : value >= last || x != last_x);
    last_x = x;
    last = value;
  };
  for (double s = 0; s < lowest; s += step) try_at(static_cast<S>(std::sqrt(2 * s)));
  for (int k = 0; k < lowest / std::log(2.) - 1; ++k) {  // where the power of two changes, number by number
    last_x = 1;
    last = 2;
    S d = static_cast<S>(std::sqrt(2 * (k + 0.5) * std::log(2.)) * (1 - 20 * std::numeric_limits<S>::epsilon()));
    for (int i = 0; i < 40; ++i, d = std::nextafter(d, S(100))) try_at(d);
  }
  CHECK(worst <= 2);
  CHECK(monotone);
  CHECK(pixel_gaussian(S(0)) == S(1));
  CHECK(pixel_gaussian(-std::numeric_limits<S>::infinity()) == S(0));
  CHECK(pixel_gaussian(S(1e4)) == S(0));
}

}  // namespace

TEST_CASE("compositing passes the operator checks where nothing is cut [B6, B21]", "[parallel]") {
  OperatorCheck options;
  options.entries = 24;
  check_composite("composite", view_of_size(35, 20, smooth_settings()), 3, options);
  SplatView view = view_of_size(19, 17, smooth_settings());
  view.settings.tile = 8;
  check_composite("composite, small tiles, 5 channels", view, 5, options);
  view.settings.antialias = true;
  view.settings.blur = 2;
  check_composite("composite, antialias, 1 channel", view, 1, options);
}

TEST_CASE("compositing passes the operator checks with the default cuts", "[parallel]") {
  OperatorCheck options;
  options.entries = 24;
  options.kink_share = 0.8;        // a cut anywhere in the image is a kink
  options.float_tolerance = 3e-4;  // a pixel may be cut in one precision alone
  SplatView view = view_of_size(35, 20, RenderSettings());
  check_composite("composite, default", view, 3, options);
  apply_compatibility(view.settings, Compatibility::kGsplat);
  check_composite("composite, gsplat", view, 3, options);
}

TEST_CASE("forward and backward composite the same Gaussians with the same weights, to the last bit [B13]") {
  on_every_target([] {
    const Index n = 90;
    FlatSplats splats = random_flat(n, 1, 1, n, 21);
    for (Index i = 0; i < n; ++i) {
      for (Index k = 0; k < n; ++k) splats.features[static_cast<std::size_t>(i * n + k)] = i == k ? 1 : 0;
    }
    FlatSplats colored = splats;
    colored.features.assign(static_cast<std::size_t>(3 * n), 1.0);
    colored.channels = 3;
    std::vector<RenderSettings> all(3);
    apply_compatibility(all[1], Compatibility::kGsplat);
    apply_quality(all[2], Quality::kAccurate);
    for (const double faintness : {0.3, 1.0}) {
      for (Index i = 0; i < n; ++i) {
        const auto at = static_cast<std::size_t>(i);
        splats.opacities[at] = static_cast<float>(faintness * (0.05 + 0.9 * static_cast<double>(i * 37 % n) / n));
      }
      colored.opacities = splats.opacities;
      for (const RenderSettings& settings : all) check_same_weights(splats, colored, settings);
    }
  });
}

TEST_CASE("the exponential of the pixel loops: within 2 ulp, monotone, exact at its ends [B17]") {
  on_every_target([] {
    check_exponential<float>(87, 2e-3);
    check_exponential<double>(708, 2e-2);
  });
}

TEST_CASE("transmittance is kept, not recovered: stacks down to 1e-8 [B1, B2]") {
  for (const double end : {1e-2, 1e-4, 1e-6, 1e-8}) {
    for (const double stop : {1e-4, 1e-7, 0.0}) {
      const int layers = 37;  // so that no threshold is met exactly
      const double alpha = 1 - std::pow(end, 1.0 / layers);
      FlatSplats splats;
      RandomSequence random(3, 1);
      for (int i = 0; i < layers; ++i) {
        splats.add(8.5, 8.5, 1 + i, 3, static_cast<float>(alpha), {static_cast<float>(random.uniform(0, 1))});
      }
      SplatView view = view_of_size(17, 17, smooth_settings());
      view.settings.transmittance_stop = stop;
      Flat<float> fast(splats, view);
      Flat<double> exact(splats, view);
      const double t = exact.value(exact.out.transmittance)[8 * 17 + 8];
      INFO("T down to " << end << ", stop " << stop);
      CHECK(std::abs(fast.value(fast.out.transmittance)[8 * 17 + 8] / t - 1) < 1e-5);
      fast.backward_ones();
      exact.backward_ones();
      CHECK(relative_l2(fast.d(fast.opacities), exact.d(exact.opacities)) < 1e-4);
      CHECK(relative_l2(fast.d(fast.factors), exact.d(exact.factors)) < 1e-4);
    }
  }
}

TEST_CASE("opaque Gaussians have finite and right gradients without a cap [B2]") {
  for (const double opacity : {1 - 1e-7, 1.0, 0.999, 1 / (1 + std::exp(-20.)), 1 / (1 + std::exp(-40.))}) {
    FlatSplats splats;
    RandomSequence random(4, 1);
    for (int i = 0; i < 12; ++i) {
      splats.add(8.5, 8.5, 1 + i, 2, i % 3 == 1 ? static_cast<float>(opacity) : 0.5f,
                 {static_cast<float>(random.uniform(0, 1))});
    }
    const SplatView view = view_of_size(17, 17, smooth_settings());
    Flat<float> fast(splats, view);
    Flat<double> exact(splats, view);
    fast.backward_ones();
    exact.backward_ones();
    INFO("opacity 1 - " << 1 - opacity);
    const auto computed = fast.d(fast.opacities), expected = exact.d(exact.opacities);
    const double largest = std::abs(*std::max_element(expected.begin(), expected.end(),
                                                      [](double a, double b) { return std::abs(a) < std::abs(b); }));
    CHECK(largest_difference(computed, expected) < 1e-5 * largest);
  }
}

TEST_CASE("where the cap holds alpha there is no gradient, or all of it [B3]") {
  FlatSplats splats;
  splats.add(0.5, 0.5, 1, 3, 0.9999, {1});  // the image is its centre pixel
  SplatView view = view_of_size(1, 1, RenderSettings());
  Flat<double> held(splats, view);
  held.backward_ones();
  CHECK(held.value(held.out.channels)[0] == view.settings.alpha_cap);
  for (const auto& d : {held.d(held.opacities), held.d(held.means), held.d(held.factors)}) {
    CHECK(std::all_of(d.begin(), d.end(), [](double x) { return x == 0; }));
  }
  CHECK(held.d(held.features)[0] == view.settings.alpha_cap);
  view.settings.cap_gradient = CapGradient::kPass;
  Flat<double> passed(splats, view);
  passed.backward_ones();
  CHECK(passed.d(passed.opacities)[0] == 1);
  splats.opacities[0] = view.settings.alpha_cap * (1 - 1e-9);
  Flat<double> below(splats, view);
  below.backward_ones();
  CHECK(below.d(below.opacities)[0] == 1);
}

TEST_CASE("an inclusive stop loses at most the threshold, an exclusive one the last Gaussian [B4]") {
  FlatSplats splats;
  splats.add(0.5, 0.5, 1, 3, 1 - 0.0999, {0});
  splats.add(0.5, 0.5, 2, 3, 0.9995, {1});
  splats.add(0.5, 0.5, 3, 3, 0.9, {1});
  SplatView view = view_of_size(1, 1, RenderSettings());
  view.settings.alpha_cap = 0.9999;
  Flat<double> inclusive(splats, view);
  CHECK(std::abs(inclusive.value(inclusive.out.channels)[0] - 0.0999) < 1.1e-4);
  CHECK(inclusive.out.counters->fragments == 2);
  view.settings.stop_rule = StopRule::kExclusive;
  Flat<double> exclusive(splats, view);
  CHECK(exclusive.value(exclusive.out.channels)[0] == 0);
  CHECK(exclusive.out.counters->fragments == 1);
  CHECK(exclusive.value(exclusive.out.transmittance)[0] == Approx(0.0999));

  // Over random stacks.
  RandomSequence random(5, 1);
  for (int i = 0; i < 50; ++i) {
    FlatSplats stack;
    for (int k = 0; k < 60; ++k) stack.add(0.5, 0.5, 1 + k, 3, random.uniform(0, 1), {random.uniform(0, 1)});
    SplatView endless = view_of_size(1, 1, RenderSettings());
    Flat<double> stopped(stack, endless);
    endless.settings.transmittance_stop = 0;
    Flat<double> whole(stack, endless);
    CHECK(largest_difference(stopped.value(stopped.out.channels), whole.value(whole.out.channels)) <= 1e-4);
  }
}

TEST_CASE("whether a transmittance equal to the threshold stops is a setting") {
  FlatSplats splats;
  for (int i = 0; i < 4; ++i) splats.add(0.5, 0.5, 1 + i, 3, 0.5, {1});
  SplatView view = view_of_size(1, 1, RenderSettings());
  view.settings.transmittance_stop = 0.25;  // exactly what two of them leave
  for (const bool at : {false, true}) {
    for (const bool exclusive : {false, true}) {
      view.settings.stop_when = at ? StopWhen::kAtOrBelow : StopWhen::kBelow;
      view.settings.stop_rule = exclusive ? StopRule::kExclusive : StopRule::kInclusive;
      const Index fragments = (at ? 2 : 3) - (exclusive ? 1 : 0);
      CHECK(Flat<double>(splats, view).out.counters->fragments == fragments);
      CHECK(Flat<float>(splats, view).out.counters->fragments == fragments);
    }
  }
}

TEST_CASE("layers below alpha_min are missing as computed; without it nothing is [B5]") {
  FlatSplats splats;
  const double alpha = 0.0039;  // just below 1/255
  for (int i = 0; i < 1000; ++i) splats.add(0.5, 0.5, 1 + i, 3, static_cast<float>(alpha), {1});
  SplatView view = view_of_size(1, 1, RenderSettings());
  Flat<float> none(splats, view);
  CHECK(none.value(none.out.channels)[0] == 0);
  view.settings = smooth_settings();
  Flat<float> all(splats, view);
  CHECK(all.value(all.out.channels)[0] == Approx(1 - std::pow(1 - alpha, 1000)).margin(1e-5));
  CHECK(all.out.counters->fragments == 1000);
}

TEST_CASE("nothing to draw, and images of every edge: exact zeros [B11]") {
  for (const int width : {1, 8, 15, 16, 17}) {
    for (const int height : {1, 16, 17}) {
      for (const int tile : {8, 16}) {
        SplatView view = view_of_size(width, height, RenderSettings());
        view.settings.tile = tile;
        INFO(width << " x " << height << ", tiles of " << tile);
        FlatSplats none, behind, drawn;
        none.channels = 3;
        behind.add(3, 3, -1, 1, 0.9, {1, 1, 1});            // behind the camera
        behind.add(3, 3, 2, 0, 0.9, {1, 1, 1});             // six zeros
        behind.add(-1000, 3, 2, 1, 0.9, {1, 1, 1});         // beside the image
        behind.add(3, 3, 2, 1, 0.9 / 255, {1, 1, 1});       // too faint
        behind.add(std::nan(""), 3, 2, 1, 0.9, {1, 1, 1});  // broken
        behind.add(3, 3, 2, 1, 0.9, {1, std::nan(""), 1});  // broken
        for (const FlatSplats* splats : {&none, &behind}) {
          Flat<float> flat(*splats, view);
          flat.backward_ones();
          for (const double x : flat.value(flat.out.channels)) CHECK(x == 0);
          for (const double t : flat.value(flat.out.transmittance)) CHECK(t == 1);
          for (const auto& d :
               {flat.d(flat.means), flat.d(flat.factors), flat.d(flat.opacities), flat.d(flat.features)}) {
            CHECK(std::all_of(d.begin(), d.end(), [](double x) { return x == 0; }));
          }
          const RenderCounters& counters = *flat.out.counters;
          CHECK((counters.visible == 0 && counters.pairs == 0 && counters.fragments == 0 && counters.tiles == 0));
        }
        drawn.add(width / 2.0, height / 2.0, 2, 30, 0.9, {1, 2, 3});
        Flat<double> flat(drawn, view);
        flat.backward_ones();
        CHECK(flat.out.counters->fragments == width * height);
        CHECK(flat.d(flat.features)[0] == Approx(flat.d(flat.features)[1]));
      }
    }
  }
}

TEST_CASE("a million Gaussians on one pixel keep their order and stay finite [B12]") {
  FlatSplats splats;
  for (int i = 0; i < 1000000; ++i) splats.add(8.5, 8.5, 2, 0.2, 0.3, {i < 8 ? 1.0 : 0.0, 1});
  SplatView view = view_of_size(17, 17, RenderSettings());
  Flat<float> flat(splats, view);
  flat.backward_ones();
  const auto channels = flat.value(flat.out.channels), t = flat.value(flat.out.transmittance);
  for (std::size_t p = 0; p < t.size(); ++p) {
    CHECK((t[p] >= 0 && t[p] <= 1));
    CHECK(channels[t.size() + p] + t[p] == Approx(1).margin(1e-6));
  }
  // Equal depths are composited by index: the first eight are in front.
  const double g = 0.3;
  CHECK(channels[8 * 17 + 8] == Approx(1 - std::pow(1 - g, 8)).margin(1e-6));
  const auto d = flat.d(flat.opacities);
  CHECK(std::all_of(d.begin(), d.end(), [](double x) { return std::isfinite(x); }));
  CHECK(d[0] != 0);
  CHECK(d[999999] == 0);
  CHECK(flat.out.counters->visible == 1000000);
  // The backward pass ends where the last pixel does: of 4 tiles, where 0.3 G is hardly above alpha_min.
  CHECK(flat.out.counters->pairs >= 1000000);
  CHECK(flat.out.counters->reached < 20000);
}

TEST_CASE("an opaque wall leaks what the cap lets through [B16]") {
  FlatSplats splats;
  splats.add(8, 8, 1, 1e5, 1, {0});
  splats.add(8, 8, 2, 1e5, 1, {1});
  for (const double cap : {0.99, kAlphaCap}) {
    SplatView view = view_of_size(16, 16, smooth_settings());
    view.settings.alpha_cap = cap;
    Flat<double> flat(splats, view);
    for (const double x : flat.value(flat.out.channels)) CHECK(x == Approx((1 - cap) * cap).epsilon(1e-12));
  }
}

TEST_CASE("a mirrored scene makes a mirrored image, and a padded image the same pixels [B20]") {
  const int width = 37, height = 23;
  const FlatSplats splats = random_flat(40, width, height, 3, 6);
  FlatSplats mirrored = splats, shifted = splats;
  for (std::size_t n = 0; n < splats.depths.size(); ++n) {
    mirrored.means[2 * n] = width - splats.means[2 * n];
    for (std::size_t k = 0; k < 3; ++k) mirrored.factors[6 * n + k] *= -1;
    shifted.means[2 * n] += 32;
    shifted.means[2 * n + 1] += 16;
  }
  const SplatView view = view_of_size(width, height, RenderSettings());
  Flat<double> plain(splats, view), mirror(mirrored, view);
  Flat<double> padded(shifted, view_of_size(width + 50, height + 40, RenderSettings()));
  const auto a = plain.tape.value(plain.out.channels), b = mirror.tape.value(mirror.out.channels);
  const auto c = padded.tape.value(padded.out.channels);
  double mirror_error = 0, padding_error = 0;
  for (Index k = 0; k < 3; ++k) {
    for (Index r = 0; r < height; ++r) {
      for (Index x = 0; x < width; ++x) {
        mirror_error = std::max(mirror_error, std::abs(a(k, r, x) - b(k, r, width - 1 - x)));
        padding_error = std::max(padding_error, std::abs(a(k, r, x) - c(k, r + 16, x + 32)));
      }
    }
  }
  CHECK(mirror_error <= 1e-12);
  CHECK(padding_error <= 1e-12);
}

TEST_CASE("the size of tiles changes nothing but rounding [B7]") {
  const FlatSplats splats = random_flat(200, 61, 45, 3, 8);
  SplatView view = view_of_size(61, 45, RenderSettings());
  Flat<float> large(splats, view);
  view.settings.tile = 8;
  Flat<float> small(splats, view);
  CHECK(largest_difference(large.value(large.out.channels), small.value(small.out.channels)) <= 1e-6);
  CHECK(large.out.counters->fragments == small.out.counters->fragments);
  large.backward_ones();
  small.backward_ones();
  CHECK(relative_l2(small.d(small.factors), large.d(large.factors)) <= 1e-5);
}

TEST_CASE("the order of the rows does not matter where depths differ [B8]") {
  const FlatSplats splats = random_flat(60, 33, 20, 2, 10);
  FlatSplats turned;
  const Index n = splats.count();
  for (Index i = n - 1; i >= 0; --i) {
    const auto at = [&](const std::vector<double>& from, std::vector<double>& to, Index size) {
      to.insert(to.end(), from.begin() + i * size, from.begin() + (i + 1) * size);
    };
    at(splats.means, turned.means, 2);
    at(splats.factors, turned.factors, 6);
    at(splats.depths, turned.depths, 1);
    at(splats.opacities, turned.opacities, 1);
    at(splats.features, turned.features, 2);
  }
  turned.channels = 2;
  const SplatView view = view_of_size(33, 20, RenderSettings());
  Flat<float> a(splats, view), b(turned, view);
  CHECK(a.value(a.out.channels) == b.value(b.out.channels));
}

TEST_CASE("long lists are composited over many segments as over one") {
  FlatSplats splats;
  RandomSequence random(11, 1);
  for (int i = 0; i < 700; ++i) {
    splats.add(random.uniform(0, 16), random.uniform(0, 16), 1 + i, 4, random.uniform(0.001, 0.02),
               {random.uniform(0, 1)});
  }
  const SplatView view = view_of_size(16, 16, smooth_settings());
  Flat<double> flat(splats, view);
  flat.backward_ones();
  // v_i by its definition, at every pixel, for a few Gaussians.
  const auto d = flat.d(flat.opacities);
  for (const std::size_t i : {std::size_t(0), std::size_t(63), std::size_t(64), std::size_t(500), std::size_t(699)}) {
    double expected = 0;
    for (int p = 0; p < 256; ++p) {
      double through = 1, behind = 0, before_i = 0, g_i = 0;
      std::vector<double> alphas;
      for (std::size_t k = 0; k < 700; ++k) {
        const double dx = p % 16 + 0.5 - splats.means[2 * k], dy = p / 16 + 0.5 - splats.means[2 * k + 1];
        const double g = std::exp(-0.5 * (dx * dx + dy * dy) / (16 + kBlur));
        if (k == i) before_i = through, g_i = g;
        alphas.push_back(splats.opacities[k] * g);
        through *= 1 - alphas.back();
      }
      for (std::size_t k = 699; k > i; --k) behind = alphas[k] * splats.features[k] + (1 - alphas[k]) * behind;
      expected += before_i * g_i * (splats.features[i] - behind);
    }
    CHECK(d[i] == Approx(expected).epsilon(1e-11));
  }
}

TEST_CASE("shapes that do not fit are refused") {
  Tape<float> tape;
  const auto v = [&](Index rows, Index cols) { return tape.parameter("v", shape_of(rows, cols)); };
  const SplatView view = view_of_size(16, 16, RenderSettings());
  CHECK_THROWS_AS(composite<float>({v(3, 2), v(3, 6), v(3, 1), v(3, 1), v(3, 2)}, v(2, 1), v(3, 3), view),
                  InternalError);
  CHECK_THROWS_AS(composite<float>({v(3, 2), v(3, 6), v(3, 1), v(3, 1), v(3, 2)}, v(3, 1), v(3, 0), view),
                  InternalError);
  SplatView odd = view;
  odd.settings.tile = 12;
  CHECK_THROWS_AS(composite<float>({v(3, 2), v(3, 6), v(3, 1), v(3, 1), v(3, 2)}, v(3, 1), v(3, 3), odd),
                  InternalError);
}
