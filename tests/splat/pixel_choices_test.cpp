// What tests call a flip (tests/support/pixel_choices.h): any change of what is composited, capped or stopped at, and
// no other change.
#include "tests/support/pixel_choices.h"

#include <functional>

#include <catch2/catch.hpp>

#include "tests/support/flat_splats.h"

namespace pixel_choices_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// The choices, their number checked against the compositor's counter.
PixelChoices choices_of(const FlatSplats& splats, const SplatView& view) {
  FlatRender<float> flat(splats, view);
  const PixelChoices choices = pixel_choices(flat.tape, flat.projected, flat.opacities, view);
  CHECK(choices.fragments == flat.out.counters->fragments);
  return choices;
}

bool flips(const FlatSplats& splats, const SplatView& view, const std::function<void(FlatSplats&)>& change) {
  FlatSplats changed = splats;
  change(changed);
  return !flipped_pixels(choices_of(splats, view), choices_of(changed, view)).empty();
}

}  // namespace

TEST_CASE("pixel choices: what is a flip and what is none") {
  const SplatView view = front_view(1, 1);
  FlatSplats splats;
  for (int i = 0; i < 4; ++i) splats.add(0.5, 0.5, 1 + i, 3, 0.5, {1});
  CHECK_FALSE(flips(splats, view, [](FlatSplats& s) { s.opacities[1] = 0.9; }));
  CHECK_FALSE(flips(splats, view, [](FlatSplats& s) { s.features[1] = 2; }));
  CHECK_FALSE(flips(splats, view, [](FlatSplats& s) { s.depths[1] = 1.5; }));
  CHECK_FALSE(flips(splats, view, [](FlatSplats& s) { s.means[1] = 0.7; }));
  CHECK(flips(splats, view, [](FlatSplats& s) { s.opacities[3] = 0.99 * kAlphaMin; }));        // not drawn
  CHECK(flips(splats, view, [](FlatSplats& s) { s.depths[1] = -1; }));                         // nor this
  CHECK(flips(splats, view, [](FlatSplats& s) { s.opacities[3] = 1; }));                       // held by the cap
  CHECK(flips(splats, view, [](FlatSplats& s) { s.depths[1] = 3.5; }));                        // another order
  CHECK(flips(splats, view, [](FlatSplats& s) { s.opacities[0] = s.opacities[1] = 0.999; }));  // stops at the second
  // It stops at the last one, or not at all: the same Gaussians, and still a flip.
  splats.opacities = {0.9, 0.9, 0.85, 0.5};
  CHECK_FALSE(flips(splats, view, [](FlatSplats& s) { s.opacities[3] = 0.9; }));
  CHECK(flips(splats, view, [](FlatSplats& s) { s.opacities[3] = 0.3; }));
}

TEST_CASE("pixel choices: counts, and only the pixels that change") {
  SplatView view = front_view(40, 30);
  const FlatSplats splats = random_flat(60, 40, 30, 3, 5);
  FlatSplats changed = splats;
  changed.add(20.5, 10.5, 0.5, 0.2, 2 * kAlphaMin, {1, 1, 1});  // reaches one pixel in front of all
  changed.opacities.back() = static_cast<float>(1.5 * kAlphaMin);
  CHECK(flipped_pixels(choices_of(splats, view), choices_of(changed, view)) == std::vector<std::size_t>{10 * 40 + 20});
  for (const SettingsVariant& variant : settings_variants()) {
    INFO(variant.name);
    view.settings = {};
    variant.apply(view.settings);
    const PixelChoices choices = choices_of(splats, view);
    CHECK(choices.fragments > 1000);
    CHECK((choices.skipped > 0) == (view.settings.alpha_min > 0));
    if (view.settings.transmittance_stop == 0) CHECK(choices.stopped == 0);
  }
}

}  // namespace pixel_choices_test
