// Rows B about the pixels of a Gaussian: which ones, where they are, and none.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "splat/render/project.h"
#include "splat/render/render.h"
#include "splat/render/tiles.h"
#include "stress/flat_splats.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/textbook_splat.h"

namespace hsi4d::stress {

// --- B7 --------------------------------------------------------------------------------------------------------------

namespace {

/// Exponent s of alpha = o exp(−s) at pixel (column, row), in double.
double exponent_at(const FlatSplats& splats, Index n, Index column, Index row) {
  return textbook_splat(splats.factor(n), kBlur)
      .exponent(static_cast<double>(column) + 0.5 - splats.means[2 * n],
                static_cast<double>(row) + 0.5 - splats.means[2 * n + 1]);
}

/// Gaussians from specks to sheets, faint to opaque, in and around an image.
FlatSplats splats_around(Index n, Index width, Index height) {
  RandomSequence random(4, 2);
  FlatSplats splats;
  for (Index i = 0; i < n; ++i) {
    const double length = std::pow(10, random.uniform(-1, 1.5)), breadth = length * random.uniform(0.05, 1);
    const double angle = random.uniform(0, 3.14159), c = std::cos(angle), s = std::sin(angle);
    const double opacity = i % 5 == 0 ? random.uniform(0.9, 5) / 255 : random.uniform(0, 1);
    const double x = random.uniform(-40, static_cast<double>(width) + 40);
    splats.add(x, random.uniform(-40, static_cast<double>(height) + 40), 1 + static_cast<double>(i),
               {c * length, -s * breadth, 0, s * length, c * breadth, 0}, opacity, {1});
  }
  return splats;
}

struct TileChoices {
  double needed = 0, missed = 0, in_vain = 0;
  double largest_left_out = 0;  ///< alpha
};

/// The tiles of Gaussians that the settings' footprint lists, against every pixel of every tile.
TileChoices tile_choices(const FlatSplats& splats, const SplatView& view) {
  const detail::TileGrid grid = detail::tile_grid(view.camera.width, view.camera.height, view.settings.tile);
  const FlatRender<float> render(splats, view);
  const detail::SplatArrays<float> arrays = render.arrays();
  TileChoices result;
  for (Index n = 0; n < splats.count(); ++n) {
    detail::SplatRecord<float> record;
    detail::Extent extent;
    detail::make_record(arrays, view.settings, grid, n, record, extent);
    std::vector<bool> listed(static_cast<std::size_t>(grid.count()));
    detail::for_each_tile(extent, grid, [&](Index tile, std::uint32_t) { listed[tile] = true; });
    for (Index tile = 0; tile < grid.count(); ++tile) {
      double least = std::numeric_limits<double>::infinity();
      const Index top = tile / grid.cols * grid.tile, left = tile % grid.cols * grid.tile;
      for (Index row = top; row < std::min(top + grid.tile, grid.height); ++row) {
        for (Index col = left; col < std::min(left + grid.tile, grid.width); ++col) {
          least = std::min(least, exponent_at(splats, n, col, row));
        }
      }
      const double alpha = splats.opacities[n] * std::exp(-least);
      const bool is_needed = alpha >= view.settings.alpha_min;
      result.needed += is_needed ? 1 : 0;
      result.missed += is_needed && !listed[tile] ? 1 : 0;
      result.in_vain += !is_needed && listed[tile] ? 1 : 0;
      if (!listed[tile]) result.largest_left_out = larger(result.largest_left_out, alpha);
    }
  }
  return result;
}

/// Largest error of images of single opaque Gaussians, against alpha at every pixel.
double error_of_opaque(const SplatView& view) {
  RandomSequence random(5, 2);
  double worst = 0;
  for (int i = 0; i < 60; ++i) {
    FlatSplats splats;
    const double x = random.uniform(0, view.camera.width), y = random.uniform(0, view.camera.height);
    splats.add(x, y, 1, random.uniform(1, 12), 1, {1});
    const std::vector<double> image = FlatRender<double>(splats, view).image();
    for (std::size_t p = 0; p < image.size(); ++p) {
      const Index column = static_cast<Index>(p) % view.camera.width, row = static_cast<Index>(p) / view.camera.width;
      const double alpha = std::min(view.settings.alpha_cap, std::exp(-exponent_at(splats, 0, column, row)));
      worst = larger(worst, std::abs(image[p] - (alpha < view.settings.alpha_min ? 0 : alpha)));
    }
  }
  return worst;
}

}  // namespace

std::vector<StressFigure> footprint(Remedy remedy) {
  SplatView view = front_view(75, 50);
  if (remedy == Remedy::kOff) view.settings.footprint = Footprint::kSquare3Sigma;
  const TileChoices tiles = tile_choices(splats_around(5000, 75, 50), view);  // 20 tiles
  return {{"tiles left out with a pixel to draw, of 1e5 pairs", tiles.missed, 0},
          {"largest alpha left out, steps of 1/255", 255 * tiles.largest_left_out, 1},
          {"tiles looked at in vain, share of those needed", tiles.in_vain / tiles.needed, 0.1},
          {"error of opaque ones, steps of 1/255", 255 * error_of_opaque(view), 1e-9}};
}

// --- B11 -------------------------------------------------------------------------------------------------------------

namespace {

/// What a render of Gaussians that cannot be seen leaves: numbers of the image that are not the background, and of the
/// gradients that are not 0.
struct Leftovers {
  double image = 0, gradients = 0;
};

constexpr float kBackground[3] = {0.1f, 0.7f, 0.3f};

/// After a first iteration in which they could be seen: what it left in memory is what is found where nothing is
/// written. Without the remedy tiles and Gaussians that are listed write what is theirs, and none is.
Leftovers leftovers(Remedy remedy, Index n, int width, int height) {
  Tape<float> tape;
  std::vector<double> seen, unseen;  // unseen: behind the camera, at it, beside the view
  for (const auto& mean : {std::array{0., 0., -2.}, {0., 0., 0.}, {1e4, 0., 1.}}) {
    unseen.insert(unseen.end(), mean.begin(), mean.end());
    seen.insert(seen.end(), {0.05, 0.05, 2});
  }
  std::vector<double> axes;
  for (Index i = 0; i < n; ++i) axes.insert(axes.end(), {0.3, 0, 0, 0, 0.3, 0, 0, 0, 0.3});
  for (std::vector<double>* means : {&seen, &unseen}) means->resize(static_cast<std::size_t>(3 * n));
  const std::vector<double> opacities(static_cast<std::size_t>(n), 0.9), colors(static_cast<std::size_t>(3 * n), 0.5);
  const SplatInputs<float> inputs = {
      leaf(tape, "means", shape_of(n, 3), seen), leaf(tape, "axes", shape_of(n, 9), axes),
      leaf(tape, "opacities", shape_of(n, 1), opacities), leaf(tape, "colors", shape_of(n, 3), colors)};
  const Var<float> xi = leaf(tape, "xi", shape_of(1, 6), std::vector<double>(6, 0));
  const Var<float> background = tape.constant("background", shape_of(1, 3));
  tape.set(background, std::span<const float>(kBackground));
  const Var<float> image = render(inputs, xi, background, front_view(width, height)).image;
  const auto run = [&] {
    tape.forward(image);
    tape.backward(image, std::vector<float>(static_cast<std::size_t>(image.shape().count()), 1));
  };
  run();
  if (remedy == Remedy::kOn) {
    tape.set(inputs.means, std::vector<float>(unseen.begin(), unseen.end()));
    run();
  }
  const std::vector<double> drawn = numbers_of<float>(tape.value(image));
  Leftovers left;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    left.image += drawn[i] == static_cast<double>(kBackground[3 * i / drawn.size()]) ? 0 : 1;
  }
  for (const Var<float> var : {inputs.means, inputs.axes, inputs.opacities, inputs.colors, xi}) {
    const std::vector<double> d = numbers_of<float>(tape.gradient(var));
    left.gradients += unequal(d, std::vector<double>(static_cast<std::size_t>(var.shape().count()), 0.0));
  }
  return left;
}

/// A Gaussian that filled the image is small and in its first tile now: numbers of the other tiles that are not 0.
/// Without the remedy they are what they were.
double empty_tiles_written(Remedy remedy) {
  constexpr int kSide = 40;
  FlatSplats splats;
  splats.add(4, 4, 1, 30, 0.9, {1});
  FlatRender<float> render(splats, front_view(kSide, kSide));
  if (remedy == Remedy::kOn) {
    render.tape.set(render.factors, {1, 0, 0, 0, 1, 0});
    render.tape.forward(render.out.channels);
  }
  const std::vector<double> image = render.image();
  double count = 0;
  for (int p = 0; p < kSide * kSide; ++p) {
    const bool is_listed = p % kSide < kTile && p / kSide < kTile;
    count += is_listed || image[static_cast<std::size_t>(p)] == 0 ? 0 : 1;
  }
  return count;
}

}  // namespace

std::vector<StressFigure> nothing_to_draw(Remedy remedy) {
  Leftovers all;
  for (const int width : {1, 15, 16, 17}) {
    for (const int height : {1, 15, 16, 17}) {
      for (const Index n : {0, 1, 3}) {
        const Leftovers left = leftovers(remedy, n, width, height);
        all.image += left.image;
        all.gradients += left.gradients;
      }
    }
  }
  return {{"numbers of images that are not the background", all.image, 0},
          {"gradients that are not exactly 0", all.gradients, 0},
          {"numbers of empty tiles that are not 0", empty_tiles_written(remedy), 0}};
}

// --- B20 -------------------------------------------------------------------------------------------------------------

namespace {

/// Column of a point at x/z, by the program or by normalised device coordinates: pixel centres at whole numbers.
double projected_column(Remedy remedy, double ratio, const SplatView& view) {
  Tape<float> tape;
  const Var<float> mean = leaf(tape, "mean", shape_of(1, 3), {2 * ratio, 0, 2});
  const Var<float> axes = leaf(tape, "axes", shape_of(1, 9), {1, 0, 0, 0, 1, 0, 0, 0, 1});
  const Projected<float> projected = project(mean, axes, tape.constant("xi", shape_of(1, 6)), view);
  tape.forward(projected.means_px);
  if (remedy == Remedy::kOn) return static_cast<double>(tape.value(projected.means_px)(0, 0));
  const Camera& camera = view.camera;
  const double ndc = 2 * camera.fx / camera.width * ratio;
  return ((ndc + 1) * camera.width - 1) / 2;
}

/// Means on a grid of 1/1024 pixel: mirrored and shifted without rounding.
FlatSplats gridded(FlatSplats splats) {
  for (double& x : splats.means) x = std::round(1024 * x) / 1024;
  return splats;
}

}  // namespace

std::vector<StressFigure> pixel_centres(Remedy remedy) {
  constexpr int kWidth = 37, kHeight = 23, kRight = 32, kDown = 16;  // a shift by whole tiles
  const bool on = remedy == Remedy::kOn;
  FlatSplats splats = gridded(random_splats(40, kWidth, kHeight, 1, 6)), mirrored = splats;
  for (std::size_t n = 0; n < splats.depths.size(); ++n) {
    mirrored.means[2 * n] = kWidth - splats.means[2 * n];
    for (std::size_t k = 0; k < 3; ++k) mirrored.factors[6 * n + k] *= -1;
  }
  // Half a pixel makes centres of the compositor's those of whole numbers.
  FlatSplats seen = splats, seen_mirrored = mirrored;
  for (std::vector<double>* means : {&seen.means, &seen_mirrored.means}) {
    for (double& x : *means) x += on ? 0 : 0.5;
  }
  const SplatView view = front_view(kWidth, kHeight);
  const std::vector<double> a = FlatRender<float>(seen, view).image(),
                            b = FlatRender<float>(seen_mirrored, view).image();
  // A part of a larger image; without the remedy what has its mean outside of the part is left out of it.
  FlatSplats around = gridded(random_splats(120, kWidth + 64, kHeight + 32, 1, 7)), part = around;
  std::vector<Index> inside;
  for (Index n = 0; n < part.count(); ++n) {
    double &x = part.means[2 * n], &y = part.means[2 * n + 1];
    x -= kRight, y -= kDown;
    if (on || (x >= 0 && x < kWidth && y >= 0 && y < kHeight)) inside.push_back(n);
  }
  const SplatView around_view = front_view(kWidth + 64, kHeight + 32);
  const std::vector<double> c = FlatRender<float>(part.picked(inside), view).image();
  const std::vector<double> d = FlatRender<float>(around, around_view).image();
  double mirror = 0, padding = 0;
  for (int p = 0; p < kWidth * kHeight; ++p) {
    const int row = p / kWidth, column = p % kWidth;
    mirror = larger(mirror, std::abs(a[p] - b[row * kWidth + kWidth - 1 - column]));
    padding = larger(padding, std::abs(c[p] - d[(row + kDown) * (kWidth + 64) + column + kRight]));
  }
  const double both = projected_column(remedy, 0.2, view) + projected_column(remedy, -0.2, view);
  return {{"image off its mirror image", mirror, 1e-6},
          {"image off the same part of a larger one", padding, 0},
          {"a column and its mirror image off the width, px", std::abs(both - kWidth), 1e-5}};
}

}  // namespace hsi4d::stress
