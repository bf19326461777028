// Gradients of what moves over static layers, against those without layers and against brute force: through colours, a
// background behind them, and a loss on the transmittance.
#include <algorithm>
#include <numeric>

#include <catch2/catch.hpp>

#include "tests/support/isa.h"
#include "tests/support/taped_splats.h"

namespace static_gradients_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Rows of a scene.
SplatScene picked(const SplatScene& scene, const std::vector<std::size_t>& rows) {
  SplatScene result = scene;
  const auto pick = [&](std::vector<float>& numbers) {
    const std::size_t cols = numbers.size() / static_cast<std::size_t>(scene.count());
    std::vector<float> of_rows;
    for (const std::size_t row : rows)
      for (std::size_t c = 0; c < cols; ++c) of_rows.push_back(numbers[row * cols + c]);
    numbers = of_rows;
  };
  for (auto* numbers : {&result.means, &result.quats, &result.log_scales, &result.sh, &result.opacity_logits})
    pick(*numbers);
  return result;
}

/// A scene whose middle layer moves; it stands in front of half of the others and behind half of them.
struct Layered {
  SplatScene still, moving, both;  ///< `both`: those that stand still first

  explicit Layered(const SplatScene& scene) {
    const auto n = static_cast<std::size_t>(scene.count());
    std::vector<std::size_t> order(n);
    std::iota(order.begin(), order.end(), std::size_t(0));
    const auto depth = [&](std::size_t row) {
      const float* const mean = &scene.means[3 * row];
      const Vector3<double> world(static_cast<double>(mean[0]), static_cast<double>(mean[1]),
                                  static_cast<double>(mean[2]));
      return scene.camera.camera_from_world.rotation.row(2).dot(world) + scene.camera.camera_from_world.translation[2];
    };
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return depth(a) < depth(b); });
    const auto begin = order.begin() + static_cast<std::ptrdiff_t>(9 * n / 20);
    std::rotate(begin, begin + static_cast<std::ptrdiff_t>(n / 10), order.end());
    both = picked(scene, order);
    const auto cut = order.end() - static_cast<std::ptrdiff_t>(n / 10);
    still = picked(scene, {order.begin(), cut});
    moving = picked(scene, {cut, order.end()});
  }
};

/// Gradients of what moves, in float.
std::vector<NamedNumbers> gradients_of_moving(const Layered& scene, const SplatCotangent& cotangent, bool layers) {
  Tape<float> tape;
  SplatView view{scene.both.camera, Vector3<double>::Zero(), scene.both.settings};
  view.skip.static_tiles = view.skip.static_layer = layers;
  const Var<float> xi = tape.constant("xi", shape_of(1, 6)), background = tape.constant("background", shape_of(1, 3));
  tape.set(background, scene.both.background);
  std::vector<NamedNumbers> gradients;
  std::vector<Var<float>> leaves;
  const auto inputs = [&](const SplatScene& of) {
    const Index n = of.count();
    leaves = {stress::leaf(tape, "means", shape_of(n, 3), of.means),
              stress::leaf(tape, "quats", shape_of(n, 4), of.quats),
              stress::leaf(tape, "log_scales", shape_of(n, 3), of.log_scales),
              stress::leaf(tape, "opacity_logits", shape_of(n, 1), of.opacity_logits),
              stress::leaf(tape, "sh", shape_of(n, 3 * of.sh_coefficients()), of.sh)};
    return SplatInputs<float>{leaves[0], gaussian_axes(leaves[1], leaves[2]), gaussian_opacities(leaves[3]),
                              sh_colors(leaves[4], leaves[0], xi, view)};
  };
  const SplatInputs<float> still = inputs(scene.still);
  for (const Var<float>& leaf : leaves) tape.freeze(leaf);
  const Rendered<float> rendered = render<float>(still, inputs(scene.moving), xi, background, view);
  const auto term = [&](Var<float> image, const std::vector<double>& weights) {
    const Var<float> weight = tape.constant("cotangent", image.shape());
    stress::set_numbers(tape, weight, weights);
    return sum(image * weight);
  };
  const Var<float> loss = term(rendered.image, cotangent.image) + term(rendered.transmittance, cotangent.transmittance);
  tape.forward(loss);
  tape.backward(loss);
  CHECK((rendered.counters->layers > 0) == layers);
  const char* const names[] = {"means", "quats", "log_scales", "opacity_logits", "sh"};
  for (std::size_t i = 0; i < leaves.size(); ++i) gradients.push_back({names[i], numbers_of(tape.gradient(leaves[i]))});
  return gradients;
}

/// The same by brute force.
std::vector<NamedNumbers> plain_gradients_of_moving(const Layered& scene, const SplatCotangent& cotangent) {
  std::vector<NamedNumbers> gradients = reference_result(scene.both, cotangent).gradients;
  gradients.resize(5);
  for (NamedNumbers& of : gradients) {
    const std::size_t share = of.numbers.size() / static_cast<std::size_t>(scene.both.count());
    of.numbers.erase(of.numbers.begin(), of.numbers.begin() + static_cast<std::ptrdiff_t>(share) * scene.still.count());
  }
  return gradients;
}

}  // namespace

TEST_CASE(
    "gradients over static layers are those without, and brute force's: a background, a loss on what is seen through",
    "[isa]") {
  SplatScene scene = random_splats(400, 51, {96, 64});
  scene.settings.depth_key = DepthKey::kFloat;
  SplatScene uncut = scene;  // where no pixel flips a cut in float
  uncut.settings.alpha_min = 0;
  uncut.settings.transmittance_stop = 0;
  SplatScene crowd = crowded(4500, 52);  // several chunks behind what moves
  crowd.settings = uncut.settings;
  for (const SplatScene* of : {&scene, &uncut, &crowd}) {
    const Layered layered(*of);
    const bool is_cut = of == &scene;
    SplatCotangent both = cotangent_of(of->camera), image = both, through = both;
    std::fill(image.transmittance.begin(), image.transmittance.end(), 0.0);
    std::fill(through.image.begin(), through.image.end(), 0.0);
    for (const SplatCotangent* cotangent : {&both, &image, &through}) {
      INFO(of->name << (is_cut ? ", cut" : ", uncut") << ", a loss on "
                    << (cotangent == &both    ? "both"
                        : cotangent == &image ? "the image"
                                              : "what is seen through"));
      const auto on = gradients_of_moving(layered, *cotangent, true),
                 off = gradients_of_moving(layered, *cotangent, false);
      for (const ClassError& e : gradient_errors(on, off)) {
        INFO(e.name);
        CHECK(e.all <= 1e-5);
        CHECK(e.worst_row <= 1e-4);
      }
      for (const ClassError& e : gradient_errors(on, plain_gradients_of_moving(layered, *cotangent))) {
        INFO(e.name << " against brute force");
        CHECK(e.all <= (is_cut ? 1e-3 : 1e-5));
        CHECK(e.worst_row <= (is_cut ? 1e-1 : 1e-4));
      }
    }
  }
}

}  // namespace static_gradients_test
