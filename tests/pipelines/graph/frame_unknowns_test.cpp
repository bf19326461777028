// What a frame's graph looks for of the clip: focal length, sizes, the scene's place, betas.
#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/gradcheck.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/graph/frame_graph.h"
#include "pipelines/input/clip_unknowns.h"
#include "tests/support/loss_terms.h"
#include "tests/support/small_clip.h"

namespace frame_unknowns_test {

using namespace hsi4d;

namespace {

constexpr int kWidth = 24, kHeight = 20;
constexpr Index kBetas = 3;

/// The small clip, its avatar with some directions of shape.
Clip clip_with_shape() {
  Clip clip = test::small_clip(kWidth, kHeight, 400);
  RandomSequence random(31);
  AvatarDirections shape{kBetas, std::vector<double>(clip.avatar.means.size() * kBetas),
                         std::vector<double>(clip.avatar.joints.size() * kBetas)};
  for (double& x : shape.means) x = random.uniform(-0.03, 0.03);
  for (double& x : shape.joints) x = random.uniform(-0.03, 0.03);
  clip.directions = shape;
  return clip;
}

FrameGraphSettings settings_of(const std::vector<std::string>& unknowns, const ColorNet* net = nullptr) {
  FrameGraphSettings settings;
  apply_quality(settings.render, Quality::kReference);
  settings.background = {0.2, 0.4, 0.3};
  settings.object_opacity = true;
  settings.human_opacity = true;
  settings.unknowns = unknowns;
  if (net != nullptr) settings.color_nets = {net, 1};
  return settings;
}

/// A color net that sees from where it is seen.
ColorNet net_of(const Avatar& avatar) {
  ColorNet net = new_color_net(avatar.means, avatar.joint_count(), {4, 6, 2, true, 1});
  RandomSequence random(21);
  for (ColorNet::Layer& layer : net.layers) {
    for (double& w : layer.weights) w = random.uniform(-0.5, 0.5);
  }
  return net;
}

/// Writes some numbers into the leaves of the unknown groups.
ClipUnknowns disturb(Tape<double>& tape, const FrameGraph<double>& graph, const std::vector<std::string>& unknowns) {
  RandomSequence random(41);
  for (const ParameterGroup<double>& group : graph.groups()) {
    if (std::find(unknowns.begin(), unknowns.end(), group.name) == unknowns.end()) continue;
    for (const Var<double> block : group.blocks) {
      const Array<double> numbers = tape.write(block);
      for (Index i = 0; i < numbers.shape.count(); ++i) numbers.data[i] = random.uniform(0.05, 0.2);
    }
  }
  return graph.unknowns();
}

/// The image, opacities, places of points and the mean depth, each weighed by random numbers.
Var<double> loss_of(Tape<double>& tape, const Clip& clip, FrameGraph<double>& graph) {
  graph.give_motion(clip.first, {clip.first});
  const LossInputs<double>& in = graph.loss_inputs();
  const Var<double> body = in.body_points({{0, 17}, {0, 140}}), objects = in.object_points({{0, 0, 3}, {0, 1, 2}});
  Var<double> total;
  std::uint64_t seed = 50;
  for (const Var<double> part : {in.rendered, in.human_opacity, in.object_opacity, in.object_place, in.object_depth,
                                 in.joints, body, objects, in.unknowns}) {
    const Var<double> weights = tape.constant("weights", part.shape());
    RandomSequence random(seed++);
    const Array<double> numbers = tape.write(weights);
    for (Index r = 0; r < numbers.total_rows(); ++r) {
      for (Index c = 0; c < numbers.shape.cols; ++c) numbers.row(r)[c] = random.uniform(-1, 1);
    }
    const Var<double> term = sum(part * weights);
    total = total.tape == nullptr ? term : total + term;
  }
  return total;
}

}  // namespace

TEST_CASE("gradients of what is looked for of a clip are right, one by one and together", "[release]") {
  const Clip clip = clip_with_shape();
  const ColorNet net = net_of(clip.avatar);
  const std::vector<std::string> all = unknown_group_names(Draw::kAll);
  std::vector<std::vector<std::string>> cases = {all};
  for (const std::string& name : all) cases.push_back({name});
  for (const std::vector<std::string>& unknowns : cases) {
    INFO("groups " << unknowns.size() << ", first " << unknowns.front());
    Tape<double> tape;
    FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_of(unknowns, &net));
    graph.set_state(clip.first);
    disturb(tape, graph, unknowns);
    const Var<double> loss = loss_of(tape, clip, graph);
    std::size_t checked = 0;
    for (const ParameterGroup<double>& group : graph.groups()) {
      if (std::find(unknowns.begin(), unknowns.end(), group.name) == unknowns.end()) continue;
      ++checked;
      for (const Var<double> block : group.blocks) tape.unfreeze(block);
    }
    CHECK(checked == unknowns.size());
    GradcheckOptions options;
    options.tolerance = 1e-6;
    options.step = 1e-6;
    options.kink_share = 0.2;
    options.each_node = false;
    const GradcheckReport report = gradcheck(tape, loss, options);
    INFO(report.text());
    CHECK(report.ok());
  }
}

TEST_CASE("a clip with what was found is drawn as the graph that found it") {
  const Clip clip = clip_with_shape();
  const std::vector<std::string> all = unknown_group_names(Draw::kAll);
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_of(all));
  graph.set_state(clip.first);
  const ClipUnknowns found = disturb(tape, graph, all);
  CHECK(found.focal_length > 1.05);
  CHECK(found.object_scales.size() == 2);
  tape.forward(graph.rendered().image);
  const Image expected = to_image(tape.value(graph.rendered().image));

  Clip known = clip;
  apply_unknowns(found, known);
  CHECK(known.camera.fx == Approx(clip.camera.fx * found.focal_length));
  const auto image_of = [](const Clip& drawn) {
    Tape<double> other;
    FrameGraph<double> plain(other, drawn, drawn.first.camera_from_world, settings_of({}));
    plain.set_state(drawn.first);
    other.forward(plain.rendered().image);
    return to_image(other.value(plain.rendered().image));
  };
  const Image drawn = image_of(known), before = image_of(clip);
  double largest = 0, change = 0;
  for (std::size_t i = 0; i < drawn.data().size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(drawn.data()[i] - expected.data()[i])));
    change = std::max(change, std::abs(static_cast<double>(before.data()[i] - expected.data()[i])));
  }
  CHECK(largest < 2e-5);  // Gaussians of a file are floats
  CHECK(change > 0.1);
}

TEST_CASE("what was found twice is found one after the other") {
  const Clip clip = clip_with_shape();
  const ClipUnknowns first = {1.1, 0.9, 0.05, {1.2, 1}, {0.1, 0, 0.2}}, second = {0.95, 1.2, -0.1, {}, {0.3, 0.1, 0}};
  Clip one_by_one = clip, at_once = clip;
  apply_unknowns(first, one_by_one);
  apply_unknowns(second, one_by_one);
  apply_unknowns(compose(first, second), at_once);
  const auto same = [](const auto& a, const auto& b) {
    REQUIRE(a.size() == b.size());
    for (std::size_t i = 0; i < a.size(); ++i) CHECK(a[i] == Approx(b[i]).margin(1e-6));
  };
  CHECK(at_once.camera.fx == Approx(one_by_one.camera.fx));
  CHECK((at_once.first.camera_from_world.translation - one_by_one.first.camera_from_world.translation).norm() < 1e-12);
  same(at_once.scene.means, one_by_one.scene.means);
  same(at_once.scene.log_scales, one_by_one.scene.log_scales);
  same(at_once.objects[0].gaussians.means, one_by_one.objects[0].gaussians.means);
  same(at_once.avatar.means, one_by_one.avatar.means);
  same(at_once.avatar.joints, one_by_one.avatar.joints);
  CHECK(compose({}, first) == first);
  CHECK(compose(first, {}) == first);
}

TEST_CASE("what was found is told by name, and doubted where it is far from what was given") {
  const Clip clip = clip_with_shape();
  const ClipUnknowns found = {1.6, 1, 0.02, {0.5, 1.1}, {}};
  Clip known = clip;
  apply_unknowns(found, known);
  const auto values = unknowns_by_name(found, known);
  REQUIRE(values.size() == 4);
  CHECK(values[0] == std::pair<std::string, double>("focal_length_px", known.camera.fx));
  CHECK(values[1] == std::pair<std::string, double>("object_scale_box", 0.5));
  CHECK(values[3] == std::pair<std::string, double>("scene_height_m", 0.02));
  CHECK(doubtful_unknowns(found, known) == std::vector<std::string>{"focal_length_px, 1.6 times what was given",
                                                                    "object_scale_box, 0.5 times what was given"});
  CHECK(unknowns_by_name({}, clip).empty());
}

}  // namespace frame_unknowns_test
