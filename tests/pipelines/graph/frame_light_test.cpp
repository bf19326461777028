// Light on objects in a frame's graph.
#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/gradcheck.h"
#include "autodiff/reduce.h"
#include "pipelines/graph/frame_graph.h"
#include "tests/support/small_clip.h"

namespace frame_light_test {

using namespace hsi4d;

namespace {

constexpr int kWidth = 24, kHeight = 20;

FrameGraphSettings settings_of(bool object_light) {
  FrameGraphSettings settings;
  apply_quality(settings.render, Quality::kReference);
  settings.background = {0.2, 0.4, 0.3};
  settings.object_light = object_light;
  return settings;
}

/// The sum of its numbers, each times a random one.
Var<double> weighed(Tape<double>& tape, Var<double> x) {
  const Var<double> weights = tape.constant("weights", x.shape());
  RandomSequence random(7);
  const Array<double> numbers = tape.write(weights);
  for (Index r = 0; r < numbers.total_rows(); ++r) {
    for (Index c = 0; c < numbers.shape.cols; ++c) numbers.row(r)[c] = random.uniform(-1, 1);
  }
  return sum(x * weights);
}

std::vector<double> numbers_in(Tape<double>& tape, Var<double> x) {
  tape.forward(x);
  const ConstArray<double> array = tape.value(x);
  std::vector<double> numbers;
  for (Index r = 0; r < array.total_rows(); ++r)
    numbers.insert(numbers.end(), array.row(r), array.row(r) + array.shape.cols);
  return numbers;
}

GradcheckReport checked(Tape<double>& tape, Var<double> loss) {
  GradcheckOptions options;
  options.tolerance = 1e-6;
  options.step = 1e-6;
  options.kink_share = 0.2;
  options.each_node = false;
  return gradcheck(tape, loss, options);
}

}  // namespace

TEST_CASE("a graph without light has no leaf for it, and a light of zeros changes no bit") {
  const Clip clip = test::small_clip(kWidth, kHeight, 60);
  Tape<double> plain_tape, lit_tape;
  FrameGraph<double> plain(plain_tape, clip, clip.first.camera_from_world, settings_of(false));
  FrameGraph<double> lit(lit_tape, clip, clip.first.camera_from_world, settings_of(true));
  plain.set_state(clip.first);
  lit.set_state(clip.first);
  CHECK(numbers_in(plain_tape, plain.rendered().image) == numbers_in(lit_tape, lit.rendered().image));
  const auto blocks = [](const FrameGraph<double>& graph) {
    for (const ParameterGroup<double>& group : graph.groups())
      if (group.name == kObjectLightGroup) return group.blocks.size();
    throw InternalError("there is no group of lights");
  };
  CHECK(blocks(plain) == 0);
  CHECK(blocks(lit) == clip.objects.size());
}

TEST_CASE("lights are written, read back where they may move, and have gradients beside the objects' poses",
          "[release]") {
  const Clip clip = test::small_clip(kWidth, kHeight, 60);
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_of(true));
  SceneState state = clip.first;
  for (std::size_t o = 0; o < clip.objects.size(); ++o) {
    state.lights.push_back({0.1, -0.2, 0.3, 0.4, -0.5, 0.2});
    state.lights.back()[0] += 0.1 * double(o);
  }
  graph.set_state(state);
  SceneState read = clip.first;
  graph.read_state({{"camera", {}}}, read);
  CHECK(read.lights.empty());
  graph.read_state({{kObjectLightGroup, {}}}, read);
  CHECK(read.lights == state.lights);
  const Var<double> loss = weighed(tape, graph.rendered().image);
  for (const char* name : {kObjectLightGroup, kObjectOrientGroup, kObjectTranslGroup}) {
    INFO(name);
    for (const ParameterGroup<double>& group : graph.groups()) {
      for (const Var<double> block : group.blocks) group.name == name ? tape.unfreeze(block) : tape.freeze(block);
    }
    const GradcheckReport report = checked(tape, loss);
    INFO(report.text());
    CHECK(report.ok());
  }
}

}  // namespace frame_light_test
