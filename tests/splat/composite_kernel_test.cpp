#include "splat/composite_kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>
#include <hwy/highway.h>

#include "core/random.h"
#include "tests/support/flat_splats.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

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
