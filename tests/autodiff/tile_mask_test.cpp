// Losses of an image that tells which squares of it have changed.
#include "autodiff/tile_mask.h"

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/ssim.h"
#include "autodiff/weighted_image.h"
#include "core/parallel.h"
#include "tests/autodiff/ssim_images.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/operator_check.h"
#include "tests/support/patched_image.h"

namespace tile_mask_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

enum class Loss { kDSsim, kL1, kL2, kWeightedL1, kWeightedL2, kPhotometric, kWeightedDSsim };
constexpr Loss kLosses[] = {Loss::kDSsim,      Loss::kL1,          Loss::kL2,           Loss::kWeightedL1,
                            Loss::kWeightedL2, Loss::kPhotometric, Loss::kWeightedDSsim};

/// A patch that moves over an image, and all losses of it.
template <class S>
struct PatchScene {
  Shape shape{2, 150, 1210, 1216};
  std::shared_ptr<Patch> patch = std::make_shared<Patch>();
  Tape<S> tape;
  Var<S> base = tape.constant("base", shape), target = tape.constant("target", shape);
  Var<S> weight = tape.parameter("weight", image_shape<S>(1, 150, 1210)), x = tape.parameter("x", kScalarShape);
  Var<S> image = patched_image(base, x, patch);
  std::vector<Var<S>> losses;

  explicit PatchScene(bool tells) {
    patch->tells = tells;
    tape.freeze(weight);
    TestRandom random{9};
    for (const Var<S>& var : {base, target}) {
      const PaddedImage<S> numbers = random_image<S>(shape, random);
      std::copy(numbers.data.begin(), numbers.data.end(), tape.write(var).data);
    }
    const Array<S> w = tape.write(weight);
    for (Index i = 0; i < w.shape.memory(); ++i) w.data[i] = static_cast<S>(random(0, 1));
    for (Index r = 20; r < 110; ++r) std::fill_n(&w(0, r, 40), 600, S(0));
    tape.write(x).scalar() = S(0.3);
    losses = {d_ssim(image, target),
              l1(image, target),
              l2(image, target),
              l1(image, target, weight),
              l2(image, target, weight),
              l1(image, target) * 0.9 + d_ssim(image, target) * 0.1,
              d_ssim(weighted_image(image, weight), weighted_image(target, weight))};
  }

  void place(Index row, Index col, Index side) {
    patch->row = row;
    patch->col = col;
    patch->side = side;
    tape.write(x);
  }
  /// Value and derivative.
  std::pair<S, S> run(Loss loss) {
    const Var<S> result = losses[static_cast<std::size_t>(loss)];
    tape.forward(result);
    tape.backward(result);
    return {tape.value(result).scalar(), tape.gradient(x).scalar()};
  }
};

struct Place {
  Index row, col, side;
};
constexpr Place kPlaces[] = {{40, 600, 30}, {0, 0, 20},    {140, 1200, 40}, {70, 3, 0},
                             {0, 0, 1210},  {31, 1000, 2}, {40, 600, 30}};

}  // namespace

TEMPLATE_TEST_CASE("losses of squares that changed have the bits of those of the whole image", "[parallel]", float,
                   double) {
  for (const Loss loss : kLosses) {
    PatchScene<TestType> told(true), whole(false);
    for (const Place p : kPlaces) {
      INFO("loss " << static_cast<int>(loss) << ", square of " << p.side << " at " << p.row << "," << p.col);
      told.place(p.row, p.col, p.side);
      whole.place(p.row, p.col, p.side);
      const auto [value, derivative] = told.run(loss);
      const auto [all, all_derivative] = whole.run(loss);
      CHECK(value == all);
      CHECK(derivative == all_derivative);
    }
  }
}

TEMPLATE_TEST_CASE("a weight that is learned has its gradient at all pixels, whatever changed of the image", "", float,
                   double) {
  PatchScene<TestType> told(true), whole(false);
  for (PatchScene<TestType>* scene : {&told, &whole}) scene->tape.unfreeze(scene->weight);
  const auto gradient = [](PatchScene<TestType>& scene, Loss loss) {
    scene.run(loss);
    return hsi4d::test::detail::numbers<TestType>(scene.tape.gradient(scene.weight));
  };
  for (const Loss loss : {Loss::kWeightedL1, Loss::kWeightedL2, Loss::kWeightedDSsim}) {
    for (const Place p : kPlaces) {
      INFO("loss " << static_cast<int>(loss) << ", square of " << p.side << " at " << p.row << "," << p.col);
      told.place(p.row, p.col, p.side);
      whole.place(p.row, p.col, p.side);
      const bool has_the_bits = gradient(told, loss) == gradient(whole, loss);
      CHECK(has_the_bits);
    }
  }
  // And they are those of the formula: Σ over planes of |a − b|, over all numbers.
  gradient(told, Loss::kWeightedL1);
  const ConstArray<TestType> a = told.tape.value(told.image), b = told.tape.value(told.target);
  for (const Index col : {3, 300, 1000}) {  // in the hole of the weights too
    TestType sum = 0;
    for (Index plane = 0; plane < 2; ++plane) sum += std::abs(a(plane, 60, col) - b(plane, 60, col));
    CHECK(told.tape.gradient(told.weight)(0, 60, col) * 2 * 150 * 1210 == Approx(sum).epsilon(1e-5));
  }
}

TEST_CASE("a loss that missed a change looks at the whole image") {
  PatchScene<double> told(true), whole(false);
  for (const Place p : kPlaces) {
    for (const Loss loss : kLosses) {
      // Each loss sees a part of the places only.
      told.place(p.row, p.col + static_cast<Index>(loss), p.side);
      whole.place(p.row, p.col + static_cast<Index>(loss), p.side);
      CHECK(told.run(loss) == whole.run(loss));
    }
  }
}

TEST_CASE("a target, a weight or a base that is written counts everywhere") {
  PatchScene<float> told(true), whole(false);
  for (const int written : {0, 1, 2}) {
    for (PatchScene<float>* scene : {&told, &whole}) {
      for (const Loss loss : kLosses) scene->run(loss);
      const Var<float> var = written == 0 ? scene->target : written == 1 ? scene->weight : scene->base;
      scene->tape.write(var)(0, 140, 1000) += 0.5f;
      scene->place(40, 600 + 10 * written, 30);
    }
    for (const Loss loss : kLosses) {
      INFO("written " << written << ", loss " << static_cast<int>(loss));
      CHECK(told.run(loss) == whole.run(loss));
    }
  }
}

TEST_CASE("a mask counts its squares") {
  TileMask mask;
  mask.clear(33, 16);
  CHECK(mask.rows() == 3);
  CHECK(mask.cols() == 1);
  CHECK(mask.count() == 0);
  mask.add(2, 0);
  CHECK(mask.has(2, 0));
  CHECK_FALSE(mask.has(1, 0));
  CHECK(mask.count() == 1);
  mask.clear(10, 10);
  CHECK(mask.count() == 0);
}

TEST_CASE("steady iterations of losses in squares allocate nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      for (const bool tells : {false, true}) {
        PatchScene<float> scene(tells);
        const auto iterate = [&](Index i) {
          for (const Loss loss : kLosses) {
            scene.place(i % 100, 10 * (i % 100), 40);
            scene.run(loss);
          }
        };
        CHECK(steady_allocations([&] {
                for (Index i = 0; i < 20; ++i) iterate(i);
              }) == 0);
      }
    });
  }
}

}  // namespace tile_mask_test
