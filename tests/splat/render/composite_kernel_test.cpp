#include "splat/render/composite_kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "splat/limits.h"
#include "splat/render/block_kernel.h"
#include "tests/support/flat_splats.h"
#include "tests/support/isa.h"
#include "tests/support/larger.h"

namespace composite_kernel_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

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

/// exp(−d²/2) as a pixel of the row kernel gets it.
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
    worst = larger(worst, static_cast<double>(std::abs(static_cast<long double>(value) - exact) / ulp));
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

constexpr float kLog2ScaleFloat = static_cast<float>(hsi4d::detail::kLog2Scale);

/// α at a pixel of the block kernel of a Gaussian of opacity 1.
float block_alpha(const hsi4d::detail::SplatRecord<float>& record, float alpha_min, bool exact) {
  const hsi4d::detail::CompositeRules<float> rules{1, alpha_min, exact ? 0.0f : 1e-4f, false, false, 0.3f};
  return hsi4d::detail::block_pixel_alpha(16, record, rules, 0, 0, 0, 0).alpha;
}

/// A number p and 2^p as the block kernel's pixels compute it.
struct Power {
  float p, value;
};

/// With L = 0 what is left of the exponent is log₂ o.
Power plain_power(double wanted) {
  hsi4d::detail::SplatRecord<float> record{};
  record.opacity = 1;
  record.log2_opacity = static_cast<float>(wanted);
  return {record.log2_opacity, block_alpha(record, kExactBelowAlpha, false)};
}

/// There log₂ o is not in the exponent, which is −w² here: of a mean so far away, and an l22 so small, that where in
/// the tile the pixel lies is lost beside it.
Power exact_power(double wanted) {
  hsi4d::detail::SplatRecord<float> record{};
  record.opacity = 1;
  record.l22 = 0x1p-60f;
  const double y = std::sqrt(-wanted) / static_cast<double>(kLog2ScaleFloat);
  record.y = -0x1p60 * y;
  const auto w = static_cast<float>(static_cast<double>(kLog2ScaleFloat) * y);
  return {-(w * w), block_alpha(record, hsi4d::kLeastAlpha, true)};
}

/// Errors of 2^p for p from 0 down to `lowest`.
struct PowerErrors {
  double ulps = 0, relative = 0;
  double near_one = 0;  ///< ulp where p > −1/64
  bool monotone = true;
};

template <class F>
PowerErrors errors_of_powers(const F& power_at, double lowest) {
  PowerErrors worst;
  Power last{1, 2};
  const auto try_at = [&](double wanted) {
    const Power now = power_at(wanted);
    const long double exact = std::exp2(static_cast<long double>(now.p));
    const auto near = static_cast<float>(exact);
    const long double error = std::abs(static_cast<long double>(now.value) - exact);
    const auto ulps = static_cast<double>(error / (near - std::nextafter(near, 0.0f)));
    worst.ulps = std::max(worst.ulps, ulps);
    worst.relative = std::max(worst.relative, static_cast<double>(error / exact));
    if (now.p > -1.0f / 64) worst.near_one = std::max(worst.near_one, ulps);
    worst.monotone = worst.monotone && (now.p > last.p || now.value <= last.value);
    last = now;
  };
  for (double p = 0; p > lowest; p -= 1e-4) try_at(p);
  for (double at = 0; at >= lowest + 1; at -= 0.125) {  // number by number, where p's whole part changes and elsewhere
    last = {1, 2};
    auto p = static_cast<float>(at + 20 * 0x1p-23 * std::max(1.0, -at));
    for (int i = 0; i < 60; ++i, p = std::nextafter(p, -200.0f)) {
      if (p <= 0) try_at(static_cast<double>(p));
    }
  }
  CHECK(worst.monotone);
  CHECK(power_at(0).value == 1.0f);
  return worst;
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
    std::vector<RenderSettings> all(4);
    apply_compatibility(all[1], Compatibility::kGsplat);
    apply_quality(all[2], Quality::kAccurate);
    apply_quality(all[3], Quality::kReference);
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

TEST_CASE("the exponential of the row kernel: within 2 ulp, monotone, exact at its ends [B17]") {
  on_every_target([] {
    check_exponential<float>(87, 2e-3);
    check_exponential<double>(708, 2e-2);
  });
}

TEST_CASE("the exponential of the block kernel, both forms: monotone, exact at 0, within 3.1 ulp and 1.2 ulp [B17]") {
  on_every_target([] {
    const PowerErrors plain = errors_of_powers(plain_power, -19.9), exact = errors_of_powers(exact_power, -125);
    INFO("plain " << plain.ulps << " ulp, " << plain.relative << " of the value; exact " << exact.ulps << " ulp, "
                  << exact.relative << ", near 1 " << exact.near_one << " ulp");
    CHECK(plain.ulps <= 3.1);
    CHECK(plain.relative <= 1.9e-7);
    CHECK(exact.ulps <= 1.2);
    CHECK(exact.relative <= 1e-7);
    CHECK(exact.near_one <= 0.6);
    CHECK(exact_power(-125.9).value >= 0x1p-126f);
    for (const double p : {-126.1, -140.0, -200.0}) CHECK(exact_power(p).value == 0);
  });
}

}  // namespace composite_kernel_test
