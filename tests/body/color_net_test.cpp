#include "body/color_net.h"

#include <cmath>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "autodiff/rotations.h"
#include "core/random.h"
#include "tests/support/operator_check.h"

namespace color_net_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr Index kJoints = 24;

std::vector<float> random_means(Index rows) {
  std::vector<float> means;
  RandomSequence random(5);
  for (Index i = 0; i < 3 * rows; ++i) means.push_back(static_cast<float>(random.uniform(-1, 1)));
  return means;
}

/// A network whose every number is something.
ColorNet some_net(Index rows, const ColorNetShape& shape = {5, 7, 2, true, 3}) {
  ColorNet net = new_color_net(random_means(rows), kJoints, shape);
  RandomSequence random(6);
  for (ColorNet::Layer& layer : net.layers) {
    for (double& w : layer.weights) w = static_cast<float>(random.uniform(-0.4, 0.4));
    for (double& b : layer.bias) b = static_cast<float>(random.uniform(-0.4, 0.4));
  }
  return net;
}

/// Colours of a pose.
template <class S>
std::vector<double> colors_of(const ColorNet& net, const std::vector<double>& own, double bend) {
  Tape<S> tape;
  const ColorNetVars<S> vars = color_net_leaves(tape, net);
  const Var<S> pose = tape.constant("pose", shape_of(kJoints, 3));
  for (Index i = 0; i < 3 * kJoints; ++i) tape.write(pose).data[i] = static_cast<S>(bend * std::sin(double(i)));
  const Var<S> colors = tape.constant("colors", shape_of(net.rows, 3));
  tape.set(colors, std::vector<S>(own.begin(), own.end()));
  const Var<S> directions = net.view_direction ? tape.constant("directions", shape_of(net.rows, 3)) : Var<S>{};
  const Var<S> rgb = color_net(vars, colors, pose_code(rotations_from_axis_angle(pose), net.code_joints), directions);
  tape.forward(rgb);
  return {tape.value(rgb).data, tape.value(rgb).data + 3 * net.rows};
}

std::string message_of(const std::function<void()>& f) {
  try {
    f();
  } catch (const DataError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("a new color net changes no colour, in any pose") {
  constexpr Index kRows = 300;
  std::vector<double> own;
  RandomSequence random(1);
  for (Index i = 0; i < 3 * kRows; ++i) own.push_back(static_cast<float>(random.uniform(kLeastColor, 1 - kLeastColor)));
  const ColorNet net = new_color_net(random_means(kRows), kJoints, {16, 32, 2, true, 0});
  for (const double bend : {0.0, 0.8}) {
    const std::vector<double> exact = colors_of<double>(net, own, bend), fast = colors_of<float>(net, own, bend);
    for (std::size_t i = 0; i < own.size(); ++i) {
      CHECK(std::fabs(exact[i] - own[i]) < 1e-15);
      CHECK(std::fabs(fast[i] - own[i]) < 4e-7);
    }
  }
}

TEST_CASE("colours at the ends of the range are held a quarter of a step inside") {
  const ColorNet net = new_color_net(random_means(2), kJoints, {});
  const std::vector<double> rgb = colors_of<double>(net, {0, 1, -3, 7, 0.5, kLeastColor / 2}, 0.4);
  const std::vector<double> expected = {kLeastColor, 1 - kLeastColor, kLeastColor, 1 - kLeastColor, 0.5, kLeastColor};
  for (std::size_t i = 0; i < expected.size(); ++i) CHECK(std::fabs(rgb[i] - expected[i]) < 1e-14);
}

TEST_CASE("a color net is a function of its seed, and its features are waves over the body") {
  const std::vector<float> means = random_means(50);
  const ColorNet net = new_color_net(means, kJoints, {});
  CHECK(net == new_color_net(means, kJoints, {}));
  CHECK_FALSE(net == new_color_net(means, kJoints, {16, 32, 2, false, 1}));
  CHECK(net.layers.size() == 3);
  CHECK(net.layers[0].inputs == 16 + 9 * 21);
  CHECK(net.code_joints.front() == 1);
  CHECK(net.code_joints.back() == 21);
  for (std::size_t n = 0; n < 50; ++n) {
    for (std::size_t k = 0; k < 8; ++k) {  // sine and cosine of the same phase
      CHECK(std::fabs(std::hypot(net.features[16 * n + 2 * k], net.features[16 * n + 2 * k + 1]) - 1) < 1e-6);
    }
  }
  CHECK(new_color_net(means, 10, {}).code_joints.size() == 9);  // a skeleton of fewer joints
  CHECK(new_color_net(means, 1, {3, 4, 0, false, 0}).layers.size() == 1);
}

TEST_CASE("the pose code is zero in the rest pose and passes the operator checks") {
  const std::vector<int> joints = {1, 3};
  Tape<double> tape;
  const Var<double> rest = tape.constant("rest", shape_of(4, 3));
  const Var<double> code = pose_code(rotations_from_axis_angle(rest), joints);
  tape.forward(code);
  for (Index i = 0; i < 18; ++i) CHECK(tape.value(code).data[i] == 0);
  check_operator("pose_code", {{"rotations", shape_of(4, 9)}},
                 [&joints](const auto& in) { return pose_code(in[0], joints); });
}

TEST_CASE("the color net passes the operator checks, colours, pose, directions and network") {
  constexpr Index kRows = 12;
  const ColorNet net = some_net(kRows);
  std::vector<OperatorInput> inputs = {{"colors", shape_of(kRows, 3), 0.02, 0.98},
                                       {"pose", shape_of(kJoints, 3)},
                                       {"directions", shape_of(kRows, 3)},
                                       {"features", shape_of(kRows, net.features_per_row), -1, 1, net.features}};
  for (const ColorNet::Layer& layer : net.layers) {
    inputs.push_back({"weights", shape_of(layer.inputs, layer.outputs), -1, 1, layer.weights});
    inputs.push_back({"bias", shape_of(1, layer.outputs), -1, 1, layer.bias});
  }
  OperatorCheck options;
  options.entries = 24;
  check_operator(
      "color_net", inputs,
      [&net](const auto& in) {
        using V = std::decay_t<decltype(in[0])>;
        using S = std::conditional_t<std::is_same_v<V, Var<float>>, float, double>;
        ColorNetVars<S> vars{in[3], {}};
        for (std::size_t i = 4; i < in.size(); i += 2) vars.layers.push_back({in[i], in[i + 1]});
        return color_net(vars, in[0], pose_code(rotations_from_axis_angle(in[1]), net.code_joints), in[2]);
      },
      options);
}

TEST_CASE("a color net survives its leaves, with the bits of the tape's precision") {
  const ColorNet net = some_net(20);
  Tape<float> tape;
  const ColorNetVars<float> vars = color_net_leaves(tape, net);
  ColorNet read = new_color_net(random_means(20), kJoints, {5, 7, 2, true, 9});
  read_features(vars, read);
  CHECK(read.features == net.features);
  CHECK_FALSE(read.layers == net.layers);
  read_layers(vars, read);
  CHECK(read == net);
}

TEST_CASE("a color net survives its file") {
  for (const bool view_direction : {false, true}) {
    const ColorNet net = some_net(20, {5, 7, 2, view_direction, 3});
    SafetensorsWriter writer("test", 1);
    add_color_net(net, writer);
    const Safetensors file = Safetensors::decode(writer.encode(), "net.safetensors");
    const std::optional<ColorNet> read = color_net_of(file, 20, kJoints);
    REQUIRE(read.has_value());
    CHECK(*read == net);
  }
  CHECK_FALSE(color_net_of(Safetensors::decode(SafetensorsWriter("test", 1).encode(), "none"), 20, kJoints));
}

TEST_CASE("what does not fit in a color net's file is told") {
  const ColorNet net = some_net(20);
  const auto read = [](const ColorNet& of, Index rows, Index joints) {
    SafetensorsWriter writer("test", 1);
    add_color_net(of, writer);
    const Bytes bytes = writer.encode();
    return message_of([&] { color_net_of(Safetensors::decode(bytes, "net"), rows, joints); });
  };
  CHECK(read(net, 20, kJoints) == "no error");
  CHECK(read(net, 21, kJoints).find("color_net/features") != std::string::npos);
  CHECK(read(net, 20, 21).find("is 21; allowed: joints 0 to 20, ascending") != std::string::npos);
  ColorNet bad = net;
  bad.layers[1].bias[2] = std::nan("");
  CHECK(read(bad, 20, kJoints).find("color_net/bias1") != std::string::npos);
  CHECK(read(bad, 20, kJoints).find("number 2 is not finite") != std::string::npos);

  const auto written = [&net](std::int64_t inputs, std::int64_t last) {
    SafetensorsWriter writer("test", 1);
    writer.add<float>("color_net/features", {20, 5}, std::vector<float>(100));
    writer.add<std::int32_t>("color_net/code_joints", {1}, std::vector<std::int32_t>{2});
    writer.add<float>("color_net/weights0", {inputs, last},
                      std::vector<float>(static_cast<std::size_t>(inputs * last)));
    writer.add<float>("color_net/bias0", {last}, std::vector<float>(static_cast<std::size_t>(last)));
    const Bytes bytes = writer.encode();
    return message_of([&] { color_net_of(Safetensors::decode(bytes, "net"), net.rows, kJoints); });
  };
  CHECK(written(14, 3) == "no error");
  CHECK(written(17, 3) == "no error");
  CHECK(written(15, 3).find("has 15 rows; allowed: 14, or 3 more with a direction of view") != std::string::npos);
  CHECK(written(14, 0).find("color_net/weights0': has no columns; a layer gives at least one number") !=
        std::string::npos);
  CHECK(written(14, 4).find("the last layer gives 4 numbers; allowed: 3") != std::string::npos);
}

TEST_CASE("a file with more layers than a color net can have, or without one in between, is refused") {
  const auto read = [](const std::vector<int>& layers) {
    SafetensorsWriter writer("test", 1);
    writer.add<float>("color_net/features", {20, 3}, std::vector<float>(60));
    writer.add<std::int32_t>("color_net/code_joints", {0}, std::vector<std::int32_t>{});
    for (const int l : layers) {
      writer.add<float>("color_net/weights" + std::to_string(l), {3, 3}, std::vector<float>(9));
      writer.add<float>("color_net/bias" + std::to_string(l), {3}, std::vector<float>(3));
    }
    const Bytes bytes = writer.encode();
    return message_of([&] {
      const auto net = color_net_of(Safetensors::decode(bytes, "net"), 20, kJoints);
      CHECK(net->layers.size() == layers.size());
    });
  };
  CHECK(read({0, 1, 2, 3, 4, 5, 6, 7}) == "no error");
  CHECK(read({0, 1, 2, 3, 4, 5, 6, 7, 8}) ==
        "net: array 'color_net/weights8': is of no layer of the network, which ends with 'color_net/bias7'; allowed: "
        "layers 0 to 7 without a gap");
  CHECK(
      read({0, 1, 3}).find("'color_net/weights3': is of no layer of the network, which ends with 'color_net/bias1'") !=
      std::string::npos);
  CHECK(read({1}).find("color_net/weights0") != std::string::npos);
}

TEST_CASE("a colour at an end of the range has a gradient, so that it can come back") {
  const ColorNet net = new_color_net(random_means(2), kJoints, {});
  Tape<float> tape;
  const Var<float> colors = tape.parameter("colors", shape_of(2, 3));
  tape.set(colors, {static_cast<float>(kLeastColor), static_cast<float>(kLargestColor), 0.5F, 0, 1, 0.25F});
  const Var<float> pose = tape.constant("pose", shape_of(kJoints, 3));
  const Var<float> loss = sum(
      color_net(color_net_leaves(tape, net), colors, pose_code(rotations_from_axis_angle(pose), net.code_joints), {}));
  tape.forward(loss);
  tape.backward(loss);
  const ConstArray<float> gradient = tape.gradient(colors);
  for (Index i = 0; i < 3; ++i) CHECK(gradient.data[i] == Approx(1).epsilon(1e-4));
  CHECK(gradient.data[3] == 0);  // beyond it there is none
  CHECK(gradient.data[4] == 0);
  CHECK(gradient.data[5] == Approx(1).epsilon(1e-4));
}

}  // namespace color_net_test
