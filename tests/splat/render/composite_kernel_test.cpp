#include "splat/render/composite_kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "stress/pixel_powers.h"
#include "tests/support/flat_splats.h"
#include "tests/support/isa.h"

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
  FlatRender<S> three(colored, view);
  three.backward();
  const std::vector<double> d_three = three.d(three.features);
  Index drawn = 0, differ = 0;
  for (Index first = 0; first < n; first += kTogether) {
    FlatSplats names = splats;
    names.channels = kTogether;
    names.features.assign(static_cast<std::size_t>(n * kTogether), 0);
    for (Index i = first; i < std::min(n, first + kTogether); ++i)
      names.features[static_cast<std::size_t>(i * kTogether + i - first)] = 1;
    FlatRender<S> named(names, view);
    named.backward();
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
  const SplatView view = front_view(1, 1, settings);
  check_weights_of<float>(splats, colored, view);
  check_weights_of<double>(splats, colored, view);
}

/// How far powers are off the exact ones.
struct PowerErrors {
  double ulps = 0, relative = 0;
  double near_one = 0;  ///< ulps where the argument is above −1/64
};

/// Along [lowest, 0], and number by number about multiples of `every`, where the power of two changes. Checks that the
/// power falls with its argument, from 1 at 0.
///
/// @param pixel_at  of a wanted argument: a pixel
/// @param exact     of a pixel's argument, in long double
template <class S, class F, class G>
PowerErrors errors_of_powers(const F& pixel_at, const G& exact, double lowest, double step, double every) {
  PowerErrors worst;
  bool falls = true;
  stress::Pixel<S> last{1, 2};
  const auto try_at = [&](S wanted) {
    const stress::Pixel<S> now = pixel_at(wanted);
    falls = falls && (now.argument > last.argument || now.value <= last.value);
    last = now;
    const long double power = exact(static_cast<long double>(now.argument));
    const S near = static_cast<S>(power);
    const auto error = static_cast<double>(std::abs(static_cast<long double>(now.value) - power));
    const double ulps = error / static_cast<double>(near - std::nextafter(near, S(0)));
    worst.ulps = larger(worst.ulps, ulps);
    worst.relative = larger(worst.relative, error / static_cast<double>(power));
    if (now.argument > S(-1) / 64) worst.near_one = larger(worst.near_one, ulps);
  };
  for (double x = 0; x > lowest; x -= step) try_at(static_cast<S>(x));
  for (double at = 0; at >= lowest + 1; at -= every) {
    last = {1, 2};
    S x = static_cast<S>(at + 20 * static_cast<double>(std::numeric_limits<S>::epsilon()) * std::max(1.0, -at));
    for (int i = 0; i < 60; ++i, x = std::nextafter(x, S(-1000))) {
      if (x <= 0) try_at(x);
    }
  }
  CHECK(falls);
  CHECK(pixel_at(S(0)).value == S(1));
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

TEST_CASE("the exponential of the row kernel: within 2 ulp, falls with its argument, exact at its ends [B17]") {
  on_every_target([] {
    const auto exact = [](long double x) { return std::exp(x); };
    const double half = 0.5 * std::log(2.0);  // twice as often as rows need it
    CHECK(errors_of_powers<float>(stress::row_exponential<float>, exact, -87, 2e-3, half).ulps <= 2);
    CHECK(errors_of_powers<double>(stress::row_exponential<double>, exact, -708, 2e-2, half).ulps <= 2);
    CHECK(stress::row_exponential(-std::numeric_limits<float>::infinity()).value == 0);
    CHECK(stress::row_exponential(-5e7).value == 0);
  });
}

TEST_CASE("the exponential of the block kernel, both forms: falls, exact at 0, within 3.1 ulp and 1.2 ulp [B17]") {
  on_every_target([] {
    const auto power = [](long double p) { return std::exp2(p); };
    const PowerErrors plain = errors_of_powers<float>(stress::block_exponential, power, -19.9, 1e-4, 0.125);
    const PowerErrors exact = errors_of_powers<float>(stress::exact_block_exponential, power, -125, 1e-4, 0.125);
    INFO("plain " << plain.ulps << " ulp, " << plain.relative << " of the value; exact " << exact.ulps << " ulp, "
                  << exact.relative << ", near 1 " << exact.near_one << " ulp");
    CHECK(plain.ulps <= 3.1);
    CHECK(plain.relative <= 1.9e-7);
    CHECK(exact.ulps <= 1.2);
    CHECK(exact.relative <= 1e-7);
    CHECK(exact.near_one <= 0.6);
    CHECK(stress::exact_block_exponential(-125.9f).value >= 0x1p-126f);
    for (const float p : {-126.1f, -140.0f, -200.0f}) CHECK(stress::exact_block_exponential(p).value == 0);
  });
}

}  // namespace composite_kernel_test
