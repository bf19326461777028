#include "tests/support/pixel_choices.h"

#include <limits>

#include "splat/reference/pixel_walk.h"

namespace hsi4d::test {

namespace {

/// FNV-1a over numbers.
struct Hash {
  std::uint64_t value = 0xcbf29ce484222325u;
  void add(std::uint64_t number) { value = (value ^ number) * 0x100000001b3u; }
};

/// The choices at one pixel.
template <class S>
std::uint64_t choices_at(const hsi4d::detail::PixelWalk<S>& walk, Index row, Index col, PixelChoices& count) {
  Hash hash;
  walk.visit(row, col, [&](const hsi4d::detail::PixelStep<S>& step) {
    if (!step.drawn) {
      ++count.skipped;
      return;
    }
    hash.add(4 * static_cast<std::uint64_t>(step.row) + (step.stops ? 2 : 0) + (step.capped ? 1 : 0));
    count.stopped += step.stops ? 1 : 0;
    if (!step.composited) return;
    count.fragments += step.alpha >= std::numeric_limits<S>::min() ? 1 : 0;  // below, the compositor's threads have 0
    count.capped += step.capped ? 1 : 0;
  });
  return hash.value;
}

}  // namespace

template <class S>
PixelChoices pixel_choices(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities,
                           const SplatView& view) {
  const hsi4d::detail::SplatArrays<S> splats = {tape.value(projected.means_px),  tape.value(projected.factors),
                                                tape.value(projected.depths),    tape.value(projected.depth_low),
                                                tape.value(projected.means_low), tape.value(opacities),
                                                tape.value(projected.depths)};
  const hsi4d::detail::PixelWalk<S> walk(splats, view);
  const Index width = walk.grid().width, height = walk.grid().height;
  PixelChoices result;
  result.hashes.resize(static_cast<std::size_t>(width * height));
  for (Index row = 0; row < height; ++row) {
    for (Index col = 0; col < width; ++col) {
      result.hashes[static_cast<std::size_t>(row * width + col)] = choices_at(walk, row, col, result);
    }
  }
  return result;
}

template PixelChoices pixel_choices(const Tape<float>&, const Projected<float>&, Var<float>, const SplatView&);
template PixelChoices pixel_choices(const Tape<double>&, const Projected<double>&, Var<double>, const SplatView&);

std::vector<std::size_t> flipped_pixels(const PixelChoices& a, const PixelChoices& b) {
  std::vector<std::size_t> flipped;
  for (std::size_t p = 0; p < a.hashes.size(); ++p) {
    if (a.hashes[p] != b.hashes[p]) flipped.push_back(p);
  }
  return flipped;
}

}  // namespace hsi4d::test
