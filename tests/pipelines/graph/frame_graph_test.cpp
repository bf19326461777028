#include "pipelines/graph/frame_graph.h"

#include <cmath>
#include <cstring>
#include <map>
#include <numbers>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/gradcheck.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "core/rotation.h"
#include "optim/loss_term.h"
#include "pipelines/graph/camera_increment.h"
#include "pipelines/graph/frame_masks.h"
#include "tests/support/loss_terms.h"
#include "tests/support/measures.h"
#include "tests/support/small_clip.h"

namespace frame_graph_test {

using namespace hsi4d;
using test::small_clip;

namespace {

/// A color net whose every number is something, with a direction of view.
ColorNet some_color_net(const Avatar& avatar) {
  ColorNet net = new_color_net(avatar.means, avatar.joint_count(), {4, 6, 2, true, 1});
  RandomSequence random(21);
  for (ColorNet::Layer& layer : net.layers) {
    for (double& w : layer.weights) w = random.uniform(-0.5, 0.5);
    for (double& b : layer.bias) b = random.uniform(-0.5, 0.5);
  }
  return net;
}

/// Settings without cuts, so that differences of the loss are smooth.
FrameGraphSettings smooth_settings(RotationParameters rotations) {
  FrameGraphSettings settings;
  apply_quality(settings.render, Quality::kReference);
  settings.rotations = rotations;
  settings.object_opacity = true;
  settings.background = {0.2, 0.4, 0.3};
  return settings;
}

Image random_image(int channels, int height, int width, std::uint64_t seed) {
  Image image(channels, height, width);
  RandomSequence random(seed);
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) image(c, y, x) = static_cast<float>(random.uniform());
    }
  }
  return image;
}

template <class S>
Var<S> loss_of(const FrameGraph<S>& graph) {
  Var<S> total = {};
  for (const auto& [name, weight] :
       {std::pair{"photometric", 1.0}, {"masked_l2", 0.5}, {"center", 0.01}, {"depth", 0.1}}) {
    for (const LossTerm& term : loss_terms()) {
      if (term.description.name != name) continue;
      const Var<S> value = term.record(graph.loss_inputs(), term.description.defaults) * weight;
      total = total.tape == nullptr ? value : total + value;
    }
  }
  return total;
}

FrameTargets targets_for(const Image& image, const Image& weight) {
  return {&image, &weight, {{14.5, 11.25, 1}, {6.5, 14.5, 1}}, {2.5, 3.5}, nullptr, true, {&weight, &weight}};
}

bool holds_joints(const std::string& group) {
  return group == "global_orient" || group.ends_with("_pose");  // not transl
}

/// The joint of a group whose gradient is smallest: its largest number over the root mean square of the group's. A
/// joint that moves nothing has 0, and a check of its gradient judges nothing.
double smallest_joint_gradient(const Tape<double>& tape, const ParameterGroup<double>& group) {
  const ConstArray<double> gradient = tape.gradient(group.blocks.front());
  double smallest = HUGE_VAL, squares = 0;
  for (Index joint = 0; joint < gradient.shape.rows; ++joint) {
    double largest = 0;
    for (Index i = 0; i < gradient.shape.cols; ++i) {
      largest = std::max(largest, std::abs(gradient(joint, i)));
      squares += gradient(joint, i) * gradient(joint, i);
    }
    smallest = std::min(smallest, largest);
  }
  return smallest / std::sqrt(squares / static_cast<double>(gradient.shape.count()));
}

}  // namespace

TEST_CASE("a frame's graph moves Gaussians and points of the body only where a term asks for them", "[frame_graph]") {
  const Clip clip = small_clip(16, 14, 300);
  Tape<float> tape;
  FrameGraph<float> graph(tape, clip, clip.first.camera_from_world, {});
  graph.set_state(clip.first);
  graph.give_motion(clip.first, {clip.first, clip.first});
  const auto nodes = [&tape](const std::string& name) {
    const std::vector<NodeStatistics> all = tape.statistics();
    return std::count_if(all.begin(), all.end(), [&name](const NodeStatistics& node) { return node.name == name; });
  };
  CHECK(nodes("skin_frames") == 3);  // the human and two objects
  CHECK(nodes("skin_points") == 0);
  CHECK(nodes("blend_shapes") == 0);  // the avatar has its shape
  const Var<float> points = graph.loss_inputs().body_points({{1, 17}, {1, 40}});
  CHECK(points.shape() == shape_of(2, 3));  // and no others
  CHECK(nodes("skin_points") == 1);
}

TEST_CASE("the gradient of the whole chain is right for every parameter", "[frame_graph][release]") {
  const RotationParameters rotations = GENERATE(RotationParameters::kSixD, RotationParameters::kAxisAngle);
  Clip clip = small_clip(16, 14, 5000);
  clip.avatar = test::avatar_of_every_joint(clip.avatar, 2);
  CHECK(clip.avatar.count() > kSmplxJoints);
  CHECK(clip.avatar.count() <= 2 * kSmplxJoints);
  const ColorNet net = some_color_net(clip.avatar);
  FrameGraphSettings settings = smooth_settings(rotations);
  settings.color_nets = {&net, 1};
  settings.object_light = true;
  settings.color_camera_gradient = true;
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings);
  graph.set_state(clip.first);
  const Image image = random_image(3, 14, 16, 3), weight = random_image(1, 14, 16, 4);
  graph.set_targets(targets_for(image, weight));
  const Var<double> loss = loss_of(graph);
  const std::vector<std::string> names = parameter_group_names(Draw::kAll);
  CHECK(graph.groups().size() == names.size());
  for (const ParameterGroup<double>& group : graph.groups()) {
    INFO("group " << group.name);
    CHECK(std::find(names.begin(), names.end(), group.name) != names.end());
    CHECK(group.blocks.empty() == (group.name == kObjectJointGroup));  // the clip's objects are free: frame_joint_test
    if (group.blocks.empty()) continue;
    for (const Var<double> block : group.blocks) tape.unfreeze(block);
    GradcheckOptions options;
    options.tolerance = 1e-6;
    // Gaussians must not change places within the differences, and some groups move many of them.
    const bool moves_body = group.name == "global_orient" || group.name == "body_pose" || group.name == "transl";
    const bool moves_little = group.name.ends_with("hand_pose") || group.name == "jaw_pose";
    options.step = moves_body ? 1e-6 : moves_little ? 3e-4 : 3e-5;
    options.kink_share = 0.2;
    options.entries = holds_joints(group.name) ? 6 * kSmplxJoints : 16;  // all numbers of all joints
    options.each_node = false;
    const GradcheckReport report = gradcheck(tape, loss, options);
    INFO(report.text());
    CHECK(report.ok());
    CHECK(report.worst_error <= 1e-6);
    if (holds_joints(group.name)) {
      CHECK(report.entries == tape.value(group.blocks.front()).shape.count());
      tape.forward(loss);
      tape.backward(loss);
      const bool is_eye = group.name == "leye_pose" || group.name == "reye_pose";  // the body has no eyeballs
      if (!is_eye) CHECK(smallest_joint_gradient(tape, group) > 1e-3);
    }
    for (const Var<double> block : group.blocks) tape.freeze(block);
  }
}

TEST_CASE("axis-angles are taken within half a turn, whatever the state says", "[frame_graph]") {
  const Clip clip = small_clip(16, 14, 100);
  const double turn = 2 * std::numbers::pi;
  SceneState wound = clip.first, plain = clip.first;
  plain.objects[0].rotation = {0, 0, -1e-3};
  wound.objects[0].rotation = {0, 0, turn - 1e-3};
  plain.body.set_rotation(4, Vector3<double>(0.3, 0, 0));
  wound.body.set_rotation(4, Vector3<double>(0.3 - 2 * turn, 0, 0));
  const auto read = [&](const SceneState& state) {
    Tape<double> tape;
    FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, smooth_settings(RotationParameters::kAxisAngle));
    graph.set_state(state);
    std::vector<double> numbers;
    for (const ParameterGroup<double>& group : graph.groups()) {
      const bool is_rotation =
          group.name.ends_with("_orient") || (group.name.ends_with("_pose") && group.name != "transl");
      CHECK(group.are_axis_angles == is_rotation);
      if (!is_rotation) continue;
      for (const Var<double> block : group.blocks) {
        const auto values = tape.value(block);
        for (Index i = 0; i < values.shape.count(); ++i) numbers.push_back(values.data[i]);
      }
    }
    return numbers;
  };
  const std::vector<double> a = read(plain), b = read(wound);
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) CHECK(a[i] == Approx(b[i]).margin(1e-12));
}

TEST_CASE("the camera's gradient is right away from the camera that the graph was recorded with",
          "[frame_graph][release]") {
  const CameraIncrement increment =
      GENERATE(CameraIncrement::kCamera, CameraIncrement::kWorld, CameraIncrement::kScene);
  const Clip clip = small_clip(24, 20, 40);
  Tape<double> tape;
  FrameGraphSettings settings = smooth_settings(RotationParameters::kSixD);
  settings.increment = increment;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings);
  graph.set_state(clip.first);
  const Image image = random_image(3, 20, 24, 3), weight = random_image(1, 20, 24, 4);
  graph.set_targets(targets_for(image, weight));
  const Var<double> camera = graph.groups().front().blocks.front();
  tape.set(camera, {0.03, -0.02, 0.05, 0.04, 0.06, -0.05});
  tape.unfreeze(camera);
  GradcheckOptions options;
  options.tolerance = 1e-6;
  options.step = 3e-5;
  options.each_node = false;
  const GradcheckReport report = gradcheck(tape, loss_of(graph), options);
  INFO(report.text());
  CHECK(report.ok());
}

TEST_CASE("a state survives being written to the leaves and read back", "[frame_graph]") {
  const RotationParameters rotations = GENERATE(RotationParameters::kSixD, RotationParameters::kAxisAngle);
  const Clip clip = small_clip(24, 20, 20);
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, smooth_settings(rotations));
  graph.set_state(clip.first);
  ConfigMap<ParameterGroupSettings> moved;
  for (const std::string& name : parameter_group_names(Draw::kAll)) moved.emplace_back(name, ParameterGroupSettings{});
  SceneState state = clip.first;
  for (double& x : state.body.axis_angle) x = 7;
  state.body.transl.setConstant(7);
  state.objects[1] = {};
  graph.read_state(moved, state);
  CHECK((state.body.transl - clip.first.body.transl).norm() < 1e-12);
  for (std::size_t i = 0; i < state.body.axis_angle.size(); ++i) {
    CHECK(state.body.axis_angle[i] == Approx(clip.first.body.axis_angle[i]).margin(1e-12));
  }
  CHECK((state.objects[1].rotation - clip.first.objects[1].rotation).norm() < 1e-12);
  CHECK((state.objects[1].translation - clip.first.objects[1].translation).norm() < 1e-12);

  const SceneState before = state;
  tape.set(graph.groups().front().blocks.front(), {0.1, 0, 0, 0, 0, 0});
  graph.read_state({}, state);
  CHECK(state.camera_from_world.translation == before.camera_from_world.translation);
  CHECK(state.body.axis_angle == before.body.axis_angle);
}

TEST_CASE("image, loss and every gradient have the same bits for any number of threads", "[frame_graph][parallel]") {
  const Clip clip = small_clip(72, 60, 1800, 1300);  // several chunks (512 rows) of scene, body and all together
  Tape<float> tape;
  const ColorNet net = some_color_net(clip.avatar);
  FrameGraphSettings settings;
  settings.object_light = true;
  settings.object_opacity = true;
  settings.color_nets = {&net, 1};
  settings.color_camera_gradient = true;
  FrameGraph<float> graph(tape, clip, clip.first.camera_from_world, settings);
  graph.set_state(clip.first);
  const Image image = random_image(3, 60, 72, 3), weight = random_image(1, 60, 72, 4);
  const FrameTargets targets = targets_for(image, weight);
  graph.set_targets(targets);
  const Var<float> loss = loss_of(graph);
  for (const ParameterGroup<float>& group : graph.groups()) {
    for (const Var<float> block : group.blocks) tape.unfreeze(block);
  }
  std::vector<float> expected;
  for (const int threads : {1, 2, 3, 8}) {
    std::vector<float> numbers;
    with_threads(threads, [&] {
      for (const ParameterGroup<float>& group : graph.groups()) {  // what is up to date would not run again
        for (const Var<float> block : group.blocks) tape.write(block);
      }
      graph.set_targets(targets);
      tape.drop_state();
      tape.forward(loss);
      tape.backward(loss);
    });
    numbers.push_back(tape.value(loss).scalar());
    const ConstArray<float> rendered = tape.value(graph.rendered().image);
    for (Index r = 0; r < rendered.total_rows(); ++r) {
      numbers.insert(numbers.end(), rendered.row(r), rendered.row(r) + rendered.shape.cols);
    }
    for (const ParameterGroup<float>& group : graph.groups()) {
      for (const Var<float> block : group.blocks) {
        const ConstArray<float> gradient = tape.gradient(block);
        numbers.insert(numbers.end(), gradient.data, gradient.data + gradient.shape.count());
      }
    }
    if (expected.empty()) expected = numbers;
    REQUIRE(numbers.size() == expected.size());
    CHECK(std::memcmp(expected.data(), numbers.data(), numbers.size() * sizeof(float)) == 0);
  }
}

TEST_CASE("gradients through the human's colours are stopped where the settings say so", "[frame_graph]") {
  const Clip clip = small_clip(24, 20, 300);
  const ColorNet net = some_color_net(clip.avatar);
  const Image image = random_image(3, 20, 24, 3), weight = random_image(1, 20, 24, 4);
  const auto gradients = [&](const ColorNet* of, bool camera) {
    FrameGraphSettings settings;
    settings.object_opacity = true;
    if (of != nullptr) settings.color_nets = {of, 1};
    settings.color_camera_gradient = camera;
    Tape<double> tape;
    FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings);
    graph.set_state(clip.first);
    graph.set_targets(targets_for(image, weight));
    const Var<double> loss = loss_of(graph);
    std::map<std::string, std::vector<double>> result;
    for (const ParameterGroup<double>& group : graph.groups()) {
      for (const Var<double> block : group.blocks) tape.unfreeze(block);
    }
    tape.forward(loss);
    tape.backward(loss);
    for (const ParameterGroup<double>& group : graph.groups()) {
      for (const Var<double> block : group.blocks) {
        const ConstArray<double> g = tape.gradient(block);
        auto& numbers = result[group.name];
        numbers.insert(numbers.end(), g.data, g.data + g.shape.count());
      }
    }
    return result;
  };
  auto none = gradients(&net, false), both = gradients(&net, true);
  CHECK(none["camera"] != both["camera"]);
  CHECK(none["body_pose"] == both["body_pose"]);
  for (const char* same : {"color_net", "avatar_features", "human_colors", "scene_sh"}) CHECK(none[same] == both[same]);
  CHECK_FALSE(none["color_net"].empty());
  CHECK(gradients(nullptr, true)["color_net"].empty());
}

TEST_CASE("increments of a camera act in the frame that they name", "[frame_graph]") {
  const Clip clip = small_clip(24, 20, 20);
  Vector6<double> update;
  update << 0.1, -0.2, 0.05, 0.3, -0.1, 0.2;
  const Rigid<double>& before = clip.camera.camera_from_world;
  const auto updated = [&](CameraIncrement increment) {
    return se3_update(Vector6<double>(camera_from_increment(increment, clip.camera, clip.scene) * update), before);
  };
  const Rigid<double> world = updated(CameraIncrement::kWorld), expected = compose(before, se3_exp(update));
  CHECK((world.rotation - expected.rotation).norm() < 1e-12);
  CHECK((world.translation - expected.translation).norm() < 1e-12);
  CHECK((updated(CameraIncrement::kCamera).translation - se3_update(update, before).translation).norm() < 1e-14);
  update.head<3>().setZero();  // a turn alone leaves the pivot, a point on the optical axis, where it is
  const Rigid<double> scene = updated(CameraIncrement::kScene);
  const Matrix6<double> map = camera_from_increment(CameraIncrement::kScene, clip.camera, clip.scene);
  const Vector3<double> pivot(0, 0, map(1, 3));
  const Vector3<double> pivot_world = transform_point(inverse(before), pivot);
  CHECK(pivot[2] > 1);
  CHECK((transform_point(scene, pivot_world) - pivot).norm() < 1e-12);
}

TEST_CASE("the mean depth of an object on the tape is that of the untaped function", "[frame_graph]") {
  const Clip clip = small_clip(24, 20, 20);
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, smooth_settings(RotationParameters::kSixD));
  graph.set_state(clip.first);
  tape.forward(graph.loss_inputs().object_depth);
  for (std::size_t o = 0; o < clip.objects.size(); ++o) {
    const double untaped = mean_depth(clip.objects[o].gaussians, clip.first.objects[o], clip.first.camera_from_world);
    CHECK(tape.value(graph.loss_inputs().object_depth)(static_cast<Index>(o), 0) == Approx(untaped).epsilon(1e-12));
  }
}

TEST_CASE("the place of an object in the image is that of its translation, with the gradient of what moves it",
          "[frame_graph]") {
  const Clip clip = small_clip(24, 20, 20);
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, smooth_settings(RotationParameters::kSixD));
  graph.set_state(clip.first);
  const Var<double> place = graph.loss_inputs().object_place;
  tape.forward(place);
  Camera camera = clip.camera;
  camera.camera_from_world = clip.first.camera_from_world;
  for (std::size_t o = 0; o < clip.objects.size(); ++o) {
    const Vector3<double>& world = clip.first.objects[o].translation;
    const Vector2<double> expected = project_point(camera, transform_point(camera.camera_from_world, world));
    for (Index i = 0; i < 2; ++i)
      CHECK(tape.value(place)(static_cast<Index>(o), i) == Approx(expected[i]).epsilon(1e-12));
  }
  for (const ParameterGroup<double>& group : graph.groups()) {
    INFO(group.name);
    const bool moves = group.name == "camera" || group.name == "object_transl";
    for (const Var<double> block : group.blocks) tape.unfreeze(block);
    const GradcheckReport report = gradcheck(tape, sum(square(place)));
    INFO(report.text());
    CHECK((report.entries > 0) == moves);
    CHECK(report.failures.empty());
    for (const Var<double> block : group.blocks) tape.freeze(block);
  }
}

TEST_CASE("center that moves the object alone pulls neither the human nor the scene", "[frame_graph]") {
  const Clip clip = small_clip(24, 20, 20);
  const auto slopes = [&clip](const std::string& settings) {
    Tape<double> tape;
    FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, smooth_settings(RotationParameters::kSixD));
    graph.set_state(clip.first);
    const Image image = random_image(3, 20, 24, 3), weight = random_image(1, 20, 24, 4);
    graph.set_targets(targets_for(image, weight));
    for (const ParameterGroup<double>& group : graph.groups()) {
      for (const Var<double> block : group.blocks) tape.unfreeze(block);
    }
    const Var<double> loss = test::record_term("center", graph.loss_inputs(), settings);
    tape.forward(loss);
    tape.backward(loss);
    std::map<std::string, double> largest;
    for (const ParameterGroup<double>& group : graph.groups()) {
      double& of_group = largest[group.name];
      for (const Var<double> block : group.blocks) {
        if (!tape.has_gradient(block)) continue;
        const ConstArray<double> d = tape.gradient(block);
        for (Index i = 0; i < d.total_rows(); ++i) {
          for (Index j = 0; j < d.shape.cols; ++j) of_group = test::larger(of_group, std::fabs(d.row(i)[j]));
        }
      }
    }
    return largest;
  };
  const auto all = slopes("{}"), object = slopes(R"({"moves": "object"})");
  CHECK(all.at("transl") > 0);
  CHECK(all.at("human_opacity_logits") > 0);
  for (const auto& [group, slope] : object) {
    INFO(group);
    const bool is_moved = group == "camera" || group == "object_transl";
    CHECK((slope > 0) == is_moved);
  }
}

TEST_CASE("the loss depth has its whole gradient where part of an object is behind the camera", "[frame_graph]") {
  Clip clip = small_clip(24, 20, 20);
  Gaussians& object = clip.objects[0].gaussians;
  object = test::random_gaussians(2, {0, 0, 0}, 1, -2, 3);
  const Rigid<double> world_from_camera = inverse(clip.camera.camera_from_world);
  const Vector3<double> forward = world_from_camera.rotation * Vector3<double>(0, 0, 1);
  for (std::size_t i = 0; i < 3; ++i) {  // 1.5 m before the camera and 0.5 m behind it
    object.means[i] = static_cast<float>(forward[static_cast<Index>(i)]);
    object.means[3 + i] = -object.means[i];
  }
  SceneState state = clip.first;
  state.objects[0] = {Vector3<double>::Zero(), world_from_camera.translation + 0.5 * forward};
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, smooth_settings(RotationParameters::kSixD));
  graph.set_state(state);
  const Image image = random_image(3, 20, 24, 3), weight = random_image(1, 20, 24, 4);
  graph.set_targets(targets_for(image, weight));
  const Var<double> loss = sum(square(graph.loss_inputs().object_depth - graph.loss_inputs().object_depth_target));
  for (const char* name : {"camera", "object_orient", "object_transl", "object_means"}) {
    INFO(name);
    const auto is_it = [&](const ParameterGroup<double>& group) { return group.name == name; };
    const auto group = std::find_if(graph.groups().begin(), graph.groups().end(), is_it);
    for (const Var<double> block : group->blocks) tape.unfreeze(block);
    const GradcheckReport report = gradcheck(tape, loss);
    INFO(report.text());
    CHECK(report.ok());
    if (group->name == "object_transl") {  // d mean z / d transl is the whole third row, not half
      tape.forward(loss);
      tape.backward(loss);
      const double error = tape.value(graph.loss_inputs().object_depth)(0, 0) - 2.5;
      for (Index i = 0; i < 3; ++i) {
        CHECK(tape.gradient(group->blocks[0])(0, i) == Approx(2 * error * forward[i]).margin(1e-12));
      }
    }
    for (const Var<double> block : group->blocks) tape.freeze(block);
  }
}

}  // namespace frame_graph_test
