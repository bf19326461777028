// The renderer at its limits: sizes of images, Gaussians on the camera, a million on one pixel, many repeats.
#include <algorithm>
#include <cmath>
#include <ctime>

#include <catch2/catch.hpp>

#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/taped_splats.h"

namespace render_robust_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Everything that a run makes.
template <class S>
std::vector<std::vector<double>> all_numbers(const TapedSplats<S>& taped) {
  std::vector<std::vector<double>> all = {taped.value(taped.loss), taped.value(taped.rendered.image),
                                          taped.value(taped.rendered.transmittance)};
  for (const NamedNumbers& g : taped.gradients()) all.push_back(g.numbers);
  return all;
}

bool all_finite(const std::vector<double>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); });
}

/// Float and double against brute force: image and gradients, each class within the bound of its precision.
void check_against_reference(const SplatScene& scene, double float_bound, double double_bound) {
  const SplatCotangent cotangent = cotangent_of(scene.camera);
  const ReferenceResult expected = reference_result(scene, cotangent);
  const auto check = [&]<class S>(S, double bound) {
    INFO("bound " << bound);
    TapedSplats<S> taped(scene, cotangent);
    taped.run();
    CHECK(largest_difference(taped.value(taped.rendered.image), expected.image) <= bound);
    for (const ClassError& e : gradient_errors(taped.gradients(), expected.gradients)) {
      INFO(e.name);
      CHECK(e.all <= bound);
      CHECK(e.worst_row <= 10 * bound);
    }
  };
  check(double(), double_bound);
  check(float(), float_bound);
}

/// Seconds that the processor gave this process.
double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// A large image with three Gaussians, one of which covers a fifth of it, and a loss that holds no image of its own.
struct LargeImage {
  Tape<float> tape;
  Var<float> means, image, transmittance, loss;
  std::shared_ptr<const RenderCounters> counters;

  explicit LargeImage(int side) {
    SplatScene scene;
    scene.camera = plain_camera({side, side});
    scene.add({0.25, 0.25, 1}, 0.1, 2, {1, 0.5, 0.25});
    scene.add({-0.3, 0.2, 1}, 2.0 / side, 2, {0.2, 0.5, 0.9});
    scene.add({0, -0.25, 2}, 4.0 / side, 2, {0.7, 0.1, 0.3});
    const auto leaf = [&](const char* name, Index cols, const std::vector<float>& numbers) {
      const Var<float> var = tape.parameter(name, shape_of(scene.count(), cols));
      tape.set(var, numbers);
      return var;
    };
    means = leaf("means", 3, scene.means);
    const Var<float> axes = gaussian_axes(leaf("quats", 4, scene.quats), leaf("log_scales", 3, scene.log_scales));
    const Var<float> opacities = gaussian_opacities(leaf("logits", 1, scene.opacity_logits));
    const SplatView view{scene.camera, Vector3<double>::Zero(), scene.settings};
    const Var<float> xi = tape.constant("xi", shape_of(1, 6)), background = tape.constant("black", shape_of(1, 3));
    const Var<float> sh = leaf("sh", 3, scene.sh);
    const Rendered<float> rendered =
        render<float>({means, axes, opacities, sh_colors(sh, means, xi, view)}, xi, background, view);
    image = rendered.image;
    transmittance = rendered.transmittance;
    counters = rendered.counters;
    loss = sum(image);
  }

  void check(int side) {
    tape.forward(loss);
    tape.backward(loss);
    // An isolated Gaussian of α = o G with o = sigmoid(2): Σ_pixels α c = 2π o σ² c, less what alpha_min cuts.
    const double o = 1 / (1 + std::exp(-2.)), pixels = static_cast<double>(side) * side;
    const double whole = 2 * 3.14159265 * o * 0.01 * pixels * 1.75;
    const double cut = kAlphaMin / o;  // of G: a share of as much is lost
    CHECK(static_cast<double>(tape.value(loss).data[0]) == Approx(whole * (1 - cut)).epsilon(0.1));
    const auto at = [&](double x, double y) {
      return tape.value(transmittance)(static_cast<Index>(y * side), static_cast<Index>(x * side));
    };
    CHECK(at(0.75, 0.75) == Approx(1 - o).epsilon(1e-3));
    CHECK(at(0.2, 0.7) > 0.99f * static_cast<float>(1 - o));  // up to 0.7 pixels beside the mean
    CHECK(at(0.2, 0.7) < 0.2f);
    CHECK(at(0.1, 0.1) == 1);
    CHECK(counters->visible == 3);
    CHECK(counters->fragments > static_cast<Index>(0.15 * pixels));
    CHECK(counters->fragments < static_cast<Index>(0.5 * pixels));
    const std::vector<double> d = numbers_of<float>(tape.gradient(means));
    CHECK(all_finite(d));
    CHECK(d[2] < 0);  // farther is smaller
    // Image and its three channels, T and their adjoints: 14 numbers a pixel; what the tiles keep comes to less.
    CHECK(static_cast<double>(tape.memory_bytes()) < 4 * 16 * pixels);
  }
};

}  // namespace

TEST_CASE("an image of one pixel, of one row and of one column are those of brute force", "[isa]") {
  for (const SceneSize& size : {SceneSize{1, 1}, SceneSize{33, 1}, SceneSize{1, 33}}) {
    INFO(size.width << " x " << size.height);
    SplatScene scene = random_splats(40, 3, size);
    scene.camera.fx = scene.camera.fy = 30;
    check_against_reference(scene, 1e-5, 1e-11);
  }
}

TEST_CASE("a large image with few Gaussians") { LargeImage(1500).check(1500); }

TEST_CASE("an image of 8192 x 8192 pixels", "[full]") { LargeImage(8192).check(8192); }

TEST_CASE("a camera inside of Gaussians sees what brute force sees", "[isa]") {
  SplatScene scene;
  scene.camera = plain_camera({40, 30});
  scene.background = {0.1F, 0.2F, 0.3F};
  scene.add({0, 0, 0}, 1, 1, {1, 0, 0});              // its mean is the camera's centre: not drawn
  scene.add({0.01, -0.02, 0.05}, 1, 0, {0, 1, 0});    // round the camera, its mean just in front
  scene.add({0.3, 0.1, 0.012}, 2, 0.5, {0, 0, 1});    // its mean at near, far beyond the view's side
  scene.add({-0.2, 0.1, -0.3}, 5, 1, {1, 1, 0});      // round the camera, its mean behind it: not drawn
  scene.add({0.1, 0.1, 3}, 0.4, 0, {0.5, 0.5, 0.5});  // an ordinary one, seen through them
  for (const SettingsVariant& variant : settings_variants()) {
    INFO(variant.name);
    SplatScene changed = scene;
    variant.apply(changed.settings);
    check_against_reference(changed, 2e-5, 1e-10);
  }
}

TEST_CASE("a million Gaussians on one pixel") {
  constexpr Index kMany = 1000000;
  const auto image_of = [](const SplatScene& scene, SplatCotangent& cotangent) {
    TapedSplats<float> fast(scene, cotangent);
    TapedSplats<double> exact(scene, cotangent);
    fast.run();
    exact.run();
    const std::vector<double> image = fast.value(fast.rendered.image);
    CHECK(all_finite(image));
    CHECK(largest_difference(image, exact.value(exact.rendered.image)) <= 1e-4);
    for (const NamedNumbers& g : fast.gradients()) CHECK(all_finite(g.numbers));
    for (const ClassError& e : gradient_errors(fast.gradients(), exact.gradients())) {
      INFO(e.name << " is off by " << e.all << ", its worst row by " << e.worst_row);
      CHECK(e.all <= 1e-3);
    }
    return *fast.rendered.counters;
  };
  SECTION("all of them are composited") {
    SplatScene scene = stack(kMany, 3e-6, 7, {3, 3});
    apply_quality(scene.settings, Quality::kReference);
    scene.settings.depth_key = DepthKey::kFloat;  // a million depths in 2 m are not all different floats
    SplatCotangent cotangent = cotangent_of(scene.camera);
    const RenderCounters counters = image_of(scene, cotangent);
    CHECK(counters.visible == kMany);
    CHECK(counters.fragments == 9 * kMany);
    reference::Scene<double> input = reference_scene<double>(scene);
    const reference::Image<double> expected = reference::render(input, reference_pinhole<double>(scene.camera),
                                                                reference_background<double>(scene), scene.settings);
    TapedSplats<float> fast(scene, cotangent);
    fast.tape.forward(fast.rendered.transmittance);
    CHECK(largest_difference(fast.value(fast.rendered.transmittance), expected.transmittance) <= 1e-4);
  }
  SECTION("the pixels stop after a few") {
    SplatScene scene = stack(kMany, 0.5, 7, {3, 3});
    scene.settings.depth_key = DepthKey::kFloat;
    SplatCotangent cotangent = cotangent_of(scene.camera);
    const RenderCounters counters = image_of(scene, cotangent);
    CHECK(counters.pairs == kMany);
    CHECK(counters.fragments < 9 * 200);
    CHECK(counters.reached < 1000);
  }
}

TEST_CASE("the time for Gaussians on one pixel grows with their number, not its square", "[release]") {
  const auto seconds = [](Index n) {
    SplatScene scene = stack(n, 0.004, 7, {8, 8});
    scene.settings.transmittance_stop = 0;
    TapedSplats<float> taped(scene, cotangent_of(scene.camera));
    double least = 1e9;
    with_threads(1, [&] {
      for (int i = 0; i < 3; ++i) {
        taped.tape.write(taped.means);
        const double start = processor_seconds();
        taped.run();
        least = std::min(least, processor_seconds() - start);
      }
    });
    return least;
  };
  const double few = seconds(20000), many = seconds(320000);
  INFO(few << " s, with 16 times as many " << many << " s");
  CHECK(many < 64 * few);  // the square would be 256
}

TEST_CASE("every repeat gives the same bits: on one tape, on new ones, on any number of threads", "[parallel]") {
  const SplatScene scene = random_splats(1200, 61, {97, 65});
  const SplatCotangent cotangent = cotangent_of(scene.camera);
  const auto check = [&]<class S>(S) {
    TapedSplats<S> taped(scene, cotangent);
    taped.run();
    const auto first = all_numbers(taped);
    int different = 0;
    for (int i = 0; i < 20; ++i) {
      with_threads(std::array{1, 2, 3, 8}[static_cast<std::size_t>(i % 4)], [&] {
        for (const Var<S> leaf : taped.leaves()) taped.tape.write(leaf);  // what is up to date would not run again
        if (i % 3 == 0) taped.tape.drop_state();
        taped.run();
        different += all_numbers(taped) == first ? 0 : 1;
        TapedSplats<S> fresh(scene, cotangent);
        fresh.run();
        different += all_numbers(fresh) == first ? 0 : 1;
      });
    }
    CHECK(different == 0);
  };
  check(float());
  check(double());
}

TEST_CASE("Gaussians that move within what they reached before allocate nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: a sanitizer counts its own allocations");
    return;
  }
  const SplatScene scene = random_splats(300, 41, {96, 64});
  const auto check = [&]<class S>(S) {
    for (const int threads : {1, 2}) {
      TapedSplats<S> taped(scene, cotangent_of(scene.camera));
      with_threads(threads, [&] {
        CHECK(steady_allocations([&] {  // a round is a cycle: all are displaced, turned and seen from elsewhere
                for (int i = 0; i < 6; ++i) {
                  const S phase = static_cast<S>(std::sin(1.0471975512 * i));
                  const Array<S> means = taped.tape.write(taped.means), quats = taped.tape.write(taped.quats);
                  for (Index n = 0; n < scene.count(); ++n) {
                    for (Index c = 0; c < 3; ++c)
                      means(n, c) = static_cast<S>(scene.means[static_cast<std::size_t>(3 * n + c)]) +
                                    S(0.1) * phase * static_cast<S>(c - 1);
                    quats(n, 0) = static_cast<S>(scene.quats[static_cast<std::size_t>(4 * n)]) + S(0.2) * phase;
                  }
                  taped.tape.write(taped.xi)(0, 2) = S(0.2) * phase;
                  taped.run();
                }
              }) == 0);
      });
    }
  };
  check(float());
  check(double());
}

}  // namespace render_robust_test
