#include "splat/reference/debug_pixel.h"

#include <cmath>
#include <utility>

#include "core/check.h"
#include "splat/reference/pixel_walk.h"

namespace hsi4d {

namespace {

/// o G at a pixel's centre, in double.
template <class S>
double uncapped_alpha(const detail::SplatRecord<S>& g, PixelPlace place) {
  const double dx = place.column + 0.5 - g.x, dy = place.row + 0.5 - g.y;
  const double u = static_cast<double>(g.l11) * dx + static_cast<double>(g.l21) * dy;
  const double w = static_cast<double>(g.l22) * dy;
  return static_cast<double>(g.opacity) * std::exp(-0.5 * (u * u + w * w));
}

template <class S>
PixelTrace trace_of(const detail::PixelWalk<S>& walk, const detail::SplatArrays<S>& splats, PixelPlace place) {
  PixelTrace trace;
  trace.place = place;
  trace.behind_stop = walk.visit(place.row, place.column, [&](const detail::PixelStep<S>& step) {
    const Index n = step.row;
    PixelSplat splat{n};
    splat.depth = detail::depth_of(splats, n);
    splat.alpha = static_cast<double>(step.alpha);
    splat.capped = step.capped;
    splat.full = step.drawn && !step.capped ? splat.alpha : uncapped_alpha(*step.record, place);
    splat.transmittance = static_cast<double>(step.transmittance);
    for (Index c = 0; c < 3; ++c) splat.color[static_cast<std::size_t>(c)] = static_cast<double>(splats.features(n, c));
    trace.stopped = step.stops;
    if (step.composited) {
      trace.add(splat);
      trace.transmittance = static_cast<double>(step.behind);
    } else if (step.drawn) {
      trace.refused = splat;
    } else {
      trace.skip(splat);
    }
  });
  return trace;
}

}  // namespace

double PixelTrace::weight_sum() const {
  double sum = 0;
  for (const PixelSplat& splat : composited) sum += splat.weight();
  return sum;
}

void PixelTrace::add(PixelSplat splat) {
  const std::array<double, 3> before = color();
  for (std::size_t c = 0; c < 3; ++c) splat.so_far[c] = before[c] + splat.weight() * splat.color[c];
  depth_sum += splat.weight() * splat.depth;
  composited.push_back(std::move(splat));
}

void PixelTrace::skip(const PixelSplat& splat) {
  ++skipped;
  if (!nearest_miss || splat.full > nearest_miss->full) nearest_miss = splat;
}

template <class S>
std::vector<PixelTrace> trace_pixels(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities,
                                     Var<S> features, const SplatView& view, std::span<const PixelPlace> places) {
  if (places.empty()) return {};
  const Camera& camera = view.camera;
  const detail::TileGrid grid = detail::tile_grid(camera.width, camera.height, view.settings.tile);
  std::optional<Index> tile = detail::tile_of(grid, places[0].row, places[0].column);
  for (const PixelPlace& place : places) {
    HSI4D_CHECK(place.column >= 0 && place.column < camera.width && place.row >= 0 && place.row < camera.height,
                "the pixel is not in the image");
    if (tile != detail::tile_of(grid, place.row, place.column)) tile.reset();
  }
  const detail::SplatArrays<S> splats = {tape.value(projected.means_px),
                                         tape.value(projected.factors),
                                         tape.value(projected.depths),
                                         tape.value(projected.depth_low),
                                         tape.value(projected.means_low),
                                         tape.value(opacities),
                                         tape.value(features)};
  HSI4D_CHECK(splats.features.shape.cols >= 3, std::to_string(splats.features.shape.cols) + " features hold no colour");
  const detail::PixelWalk<S> walk(splats, view, tile);
  std::vector<PixelTrace> traces;
  for (const PixelPlace& place : places) traces.push_back(trace_of(walk, splats, place));
  return traces;
}

template <class S>
PixelTrace trace_pixel(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities, Var<S> features,
                       const SplatView& view, PixelPlace place) {
  return std::move(trace_pixels(tape, projected, opacities, features, view, {&place, 1}).front());
}

template PixelTrace trace_pixel(const Tape<float>&, const Projected<float>&, Var<float>, Var<float>, const SplatView&,
                                PixelPlace);
template PixelTrace trace_pixel(const Tape<double>&, const Projected<double>&, Var<double>, Var<double>,
                                const SplatView&, PixelPlace);
template std::vector<PixelTrace> trace_pixels(const Tape<float>&, const Projected<float>&, Var<float>, Var<float>,
                                              const SplatView&, std::span<const PixelPlace>);
template std::vector<PixelTrace> trace_pixels(const Tape<double>&, const Projected<double>&, Var<double>, Var<double>,
                                              const SplatView&, std::span<const PixelPlace>);

}  // namespace hsi4d
