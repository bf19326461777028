// Structural similarity of an image of which only a region changes.
#include "autodiff/ssim.h"
#include "core/parallel.h"
#include "tests/autodiff/ssim_images.h"
#include "tests/support/allocation_counter.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// A scene of a base image on which a square moves.
template <class S>
struct RegionScene {
  Shape shape{2, 150, 1210, 1216};
  TestRandom random{9};
  PaddedImage<S> base = random_image<S>(shape, random), target = random_image<S>(shape, random);
  Tape<S> tape;
  Var<S> image = tape.parameter("image", shape);
  Var<S> goal = tape.constant("target", shape);
  Var<S> still = tape.constant("base", shape);
  Var<S> touched = tape.constant("touched", shape_of(ssim_tiles(150), ssim_tiles(1210)));
  Var<S> whole, region;

  RegionScene() {
    std::copy(target.data.begin(), target.data.end(), tape.write(goal).data);
    std::copy(base.data.begin(), base.data.end(), tape.write(still).data);
    whole = d_ssim(image, goal);
    region = d_ssim_region(image, goal, SsimRegion<S>{touched, ssim_tile_sums(still, goal)});
  }

  /// The image with a square at (row, col), and the tiles that it touches.
  void place(Index row, Index col, Index side) {
    const Array<S> to = tape.write(image), tiles = tape.write(touched);
    std::copy(base.data.begin(), base.data.end(), to.data);
    for (Index r = 0; r < tiles.shape.rows; ++r) std::fill_n(tiles.row(r), tiles.shape.cols, S(0));
    for (Index r = row; r < std::min(row + side, shape.rows); ++r) {
      for (Index c = col; c < std::min(col + side, shape.cols); ++c) {
        to(0, r, c) = S(0.25) + to(0, r, c) / 2;
        to(1, r, c) = S(0.5);
        tiles(r / kSsimTilePx, c / kSsimTilePx) = 1;
      }
    }
  }
  std::pair<S, std::vector<S>> run(Var<S> loss) {
    tape.forward(loss);
    tape.backward(loss);
    return {tape.value(loss).scalar(), test::detail::numbers<S>(tape.gradient(image))};
  }
};

}  // namespace

TEMPLATE_TEST_CASE("the region form gives the bits of the whole form, wherever the region was before", "[parallel]",
                   float, double) {
  RegionScene<TestType> scene;
  struct Place {
    Index row, col, side;
  };
  for (const Place p : {Place{40, 600, 30}, Place{0, 0, 20}, Place{140, 1200, 40}, Place{70, 3, 0}, Place{0, 0, 1210},
                        Place{31, 1000, 2}, Place{40, 600, 30}}) {
    INFO("square of " << p.side << " at " << p.row << "," << p.col);
    scene.place(p.row, p.col, p.side);
    const auto [whole, d_whole] = scene.run(scene.whole);
    const auto [region, d_region] = scene.run(scene.region);
    CHECK(region == whole);
    const ConstArray<TestType> tiles = scene.tape.value(scene.touched);
    bool same = true;
    Index untouched = 0;
    for (Index i = 0; i < scene.shape.count(); ++i) {
      const Index r = i / scene.shape.cols % scene.shape.rows, c = i % scene.shape.cols;
      const TestType d = d_region[static_cast<std::size_t>(i)];
      if (tiles(r / kSsimTilePx, c / kSsimTilePx) != 0) {
        same &= d == d_whole[static_cast<std::size_t>(i)];
      } else if (d == 0) {
        ++untouched;
      } else {
        same &= d == d_whole[static_cast<std::size_t>(i)];
      }
    }
    CHECK(same);
    if (p.side <= 40) CHECK(untouched > scene.shape.count() * 8 / 10);
  }
}

TEST_CASE("the region form sums the base's tiles once, and again when base or target changes") {
  RegionScene<float> scene;
  const auto runs = [&] {
    for (const NodeStatistics& node : scene.tape.statistics()) {
      if (node.name == "ssim_tile_sums") return node.forward_runs;
    }
    return Index(-1);
  };
  for (Index i = 0; i < 5; ++i) {
    scene.place(10 * i, 50 * i, 30);
    scene.tape.forward(scene.region);
  }
  CHECK(runs() == 1);
  const float before = scene.tape.value(scene.region).scalar();
  for (const Var<float> changed : {scene.goal, scene.still}) scene.tape.write(changed)(1, 140, 1000) += 0.5f;
  scene.tape.forward(scene.region);
  CHECK(runs() == 2);
  CHECK(scene.tape.value(scene.region).scalar() != before);
}

TEST_CASE("steady iterations of d_ssim allocate nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      RegionScene<float> scene;
      const auto iterate = [&](Index i) {
        scene.place(i % 100, 10 * (i % 100), 40);
        for (const Var<float> loss : {scene.whole, scene.region}) {
          scene.tape.forward(loss);
          scene.tape.backward(loss);
        }
      };
      CHECK(steady_allocations([&] {
              for (Index i = 0; i < 20; ++i) iterate(i);
            }) == 0);
    });
  }
}
