// Depths of pixels that a frame graph gives to the term depth_map.
#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/gradcheck.h"
#include "core/random.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/graph/frame_graph.h"
#include "tests/support/loss_terms.h"
#include "tests/support/small_clip.h"

namespace frame_depth_test {

using namespace hsi4d;
using test::small_clip;

namespace {

constexpr int kWidth = 16, kHeight = 14;

/// Settings without cuts, so that differences of the loss are smooth.
FrameGraphSettings settings_with_depths(bool depth_map = true) {
  FrameGraphSettings settings;
  apply_quality(settings.render, Quality::kReference);
  settings.depth_map = depth_map;
  return settings;
}

/// What is rendered of a graph, with noise: a map that goes along with it.
DepthMap map_near(const Image& depth) {
  DepthMap map{Image(1, kHeight, kWidth), Image(1, kHeight, kWidth)};
  RandomSequence random(8);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      map.values(0, y, x) = static_cast<float>(1.4 * (static_cast<double>(depth(0, y, x)) - 3) + 0.3 * random.normal());
      map.weights(0, y, x) = static_cast<float>(random.uniform(0.2, 1));
    }
  }
  return map;
}

Image depths_of(const Clip& clip) {
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_depths());
  graph.set_state(clip.first);
  tape.forward(graph.loss_inputs().depth);
  return to_image(tape.value(graph.loss_inputs().depth));
}

}  // namespace

TEST_CASE("depths of pixels are rendered only where a term asks for them, and change no colour", "[frame_graph]") {
  const Clip clip = small_clip(kWidth, kHeight, 60);
  Tape<double> plain_tape, tape;
  FrameGraph<double> plain(plain_tape, clip, clip.first.camera_from_world, settings_with_depths(false));
  CHECK_FALSE(plain.loss_inputs().gives(LossInput::kDepthMap));
  CHECK(plain.rendered().depth.tape == nullptr);
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_depths());
  REQUIRE(graph.loss_inputs().gives(LossInput::kDepthMap));
  for (auto* one : {&plain, &graph}) one->set_state(clip.first);
  plain_tape.forward(plain.rendered().image);
  tape.forward(graph.rendered().image);
  CHECK(to_image(plain_tape.value(plain.rendered().image)) == to_image(tape.value(graph.rendered().image)));
}

TEST_CASE("the gradient of depth_map through a frame is right for what moves", "[frame_graph][release]") {
  const Clip clip = small_clip(kWidth, kHeight, 60);
  const DepthMap map = map_near(depths_of(clip));
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_depths());
  graph.set_state(clip.first);
  FrameTargets targets;
  const Image image(3, kHeight, kWidth);
  targets.image = &image;
  targets.depths = {2, 2};
  targets.depth_map = &map;
  graph.set_targets(targets);
  const char* settings = GENERATE(R"({"kernel": "geman_mcclure", "scale": 0.5})", R"({"kernel": "squared"})");
  const Var<double> loss = test::record_term("depth_map", graph.loss_inputs(), settings);
  for (const ParameterGroup<double>& group : graph.groups()) {
    const bool is_tried = group.name == "transl" || group.name == "object_transl" || group.name == "camera" ||
                          group.name == "global_orient";
    if (!is_tried) continue;
    INFO("group " << group.name);
    for (const Var<double> block : group.blocks) tape.unfreeze(block);
    GradcheckOptions options;
    options.tolerance = 1e-6;
    options.step = 1e-6;
    options.kink_share = 0.2;
    options.each_node = false;
    const GradcheckReport report = gradcheck(tape, loss, options);
    INFO(report.text());
    CHECK(report.ok());
    CHECK(report.entries > 0);
    for (const Var<double> block : group.blocks) tape.freeze(block);
  }
}

TEST_CASE("a frame without a depth map has the term 0, and no pull", "[frame_graph]") {
  const Clip clip = small_clip(kWidth, kHeight, 60);
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_depths());
  graph.set_state(clip.first);
  FrameTargets targets;
  const Image image(3, kHeight, kWidth);
  targets.image = &image;
  targets.depths = {2, 2};
  graph.set_targets(targets);
  const Var<double> loss = test::record_term("depth_map", graph.loss_inputs(), "{}");
  for (const ParameterGroup<double>& group : graph.groups()) {
    if (group.name == "transl") tape.unfreeze(group.blocks.front());
  }
  tape.forward(loss);
  CHECK(tape.value(loss).scalar() == 0);
  tape.backward(loss);
  for (const ParameterGroup<double>& group : graph.groups()) {
    if (group.name != "transl") continue;
    for (Index i = 0; i < 3; ++i) CHECK(tape.gradient(group.blocks.front())(0, i) == 0);
  }
}

}  // namespace frame_depth_test
