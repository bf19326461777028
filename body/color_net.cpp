#include "body/color_net.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "body/pose_layout.h"
#include "core/finite_numbers.h"
#include "core/gather.h"
#include "core/random.h"

namespace hsi4d {

namespace {

constexpr const char* kPrefix = "color_net/";
constexpr const char* kNetFormat = "hsi4d color net";  // of a file of its own
constexpr int kVersion = 1;

/// Waves over the places of the rest pose.
std::vector<double> first_features(std::span<const float> means, const ColorNetShape& shape) {
  const Random random(shape.seed, random_stream("color_net.features"));
  const Index rows = static_cast<Index>(means.size()) / 3, waves = (shape.features + 1) / 2;
  std::vector<double> features(static_cast<std::size_t>(rows * shape.features));
  for (Index k = 0; k < waves; ++k) {
    const Vector4<double> q = random.rotation(static_cast<std::uint64_t>(k));
    const double share = waves == 1 ? 0 : static_cast<double>(k) / static_cast<double>(waves - 1);
    const double frequency = kLowestFrequency * std::pow(kHighestFrequency / kLowestFrequency, share);
    // The first column of the rotation: a direction, all equally likely.
    const Vector3<double> wave = 2 * std::numbers::pi * frequency *
                                 Vector3<double>(1 - 2 * (q[2] * q[2] + q[3] * q[3]), 2 * (q[1] * q[2] + q[0] * q[3]),
                                                 2 * (q[1] * q[3] - q[0] * q[2]));
    for (Index n = 0; n < rows; ++n) {
      const double phase = wave.dot(Vector3<float>(means.data() + 3 * n).cast<double>());
      double* f = features.data() + n * shape.features;
      f[2 * k] = std::sin(phase);
      if (2 * k + 1 < shape.features) f[2 * k + 1] = std::cos(phase);
    }
  }
  return features;
}

template <class S>
Var<S> leaf(Tape<S>& tape, const std::string& name, Index rows, Index cols, const std::vector<double>& numbers) {
  const Var<S> var = tape.parameter(name, shape_of(rows, cols));
  const Array<S> array = tape.write(var);
  std::transform(numbers.begin(), numbers.end(), array.data, [](double x) { return static_cast<S>(x); });
  return var;
}

template <class S>
void read(Var<S> var, std::vector<double>& numbers) {
  const ConstArray<S> array = var.owner().value(var);
  HSI4D_CHECK_EQ(array.shape.count(), static_cast<Index>(numbers.size()));
  std::transform(array.data, array.data + numbers.size(), numbers.begin(), [](S x) { return static_cast<double>(x); });
}

std::string array_name(const char* what) { return std::string(kPrefix) + what; }
std::string layer_name(const char* what, std::size_t layer) { return array_name(what) + std::to_string(layer); }

void add_floats(SafetensorsWriter& file, const std::string& name, std::initializer_list<std::int64_t> shape,
                const std::vector<double>& numbers) {
  std::vector<float> rounded(numbers.size());
  std::transform(numbers.begin(), numbers.end(), rounded.begin(), [](double x) { return static_cast<float>(x); });
  file.add<float>(name, shape, rounded);
}

/// What float32 keeps of an array; those of double are rounded.
std::vector<double> rounded_numbers(const NpyArray& array, std::initializer_list<std::int64_t> shape) {
  const std::vector<float> numbers = finite_numbers<float>(array, shape);
  return {numbers.begin(), numbers.end()};
}

std::vector<int> code_joints_of(const Safetensors& file, Index joints) {
  const NpyArray& array = file.array(array_name("code_joints"));
  const std::vector<std::int32_t> found = array.require_shape({-1}).as<std::int32_t>();
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (found[i] >= 0 && found[i] < joints && (i == 0 || found[i] > found[i - 1])) continue;
    throw DataError(array.source() + ": number " + std::to_string(i) + " is " + std::to_string(found[i]) +
                    "; allowed: joints 0 to " + std::to_string(joints - 1) + ", ascending");
  }
  return {found.begin(), found.end()};
}

/// @param inputs  outputs of the layer before; −1: any number
ColorNet::Layer layer_of(const Safetensors& file, std::size_t number, Index inputs) {
  const NpyArray& weights = file.array(layer_name("weights", number));
  ColorNet::Layer layer;
  layer.weights = rounded_numbers(weights, {inputs, -1});
  layer.inputs = weights.shape()[0];
  layer.outputs = weights.shape()[1];
  if (layer.outputs < 1) throw DataError(weights.source() + ": has no columns; a layer gives at least one number");
  layer.bias = rounded_numbers(file.array(layer_name("bias", number)), {layer.outputs});
  return layer;
}

/// Throws DataError for weights or a bias of another layer than the first `layers`.
void check_all_read(const Safetensors& file, std::size_t layers) {
  std::vector<std::string> read;
  for (std::size_t l = 0; l < layers; ++l) {
    for (const char* what : {"weights", "bias"}) read.push_back(layer_name(what, l));
  }
  for (const std::string& name : file.names()) {
    const bool is_of_layer = name.starts_with(array_name("weights")) || name.starts_with(array_name("bias"));
    if (!is_of_layer || std::find(read.begin(), read.end(), name) != read.end()) continue;
    throw DataError(file.array(name).source() + ": is of no layer of the network, which ends with '" + read.back() +
                    "'; allowed: layers 0 to " + std::to_string(kMostMlpLayers - 1) + " without a gap");
  }
}

}  // namespace

ColorNet new_color_net(std::span<const float> means, Index joints, const ColorNetShape& shape) {
  HSI4D_CHECK(shape.features >= 1 && shape.hidden_width >= 1, "a color net needs features and a hidden width");
  HSI4D_CHECK(shape.hidden_layers >= 0 && shape.hidden_layers < kMostMlpLayers,
              std::to_string(shape.hidden_layers) + " hidden layers");
  ColorNet net;
  net.rows = static_cast<Index>(means.size()) / 3;
  net.features_per_row = shape.features;
  net.features = first_features(means, shape);
  net.view_direction = shape.view_direction;
  for (int j = 1; j <= std::min(kBodyJoints - 1, joints - 1); ++j) net.code_joints.push_back(j);
  const Random random(shape.seed, random_stream("color_net.weights"));
  std::uint64_t at = 0;
  Index inputs = shape.features + (shape.view_direction ? 3 : 0) + net.code_size();
  // What a row brings is of size 1 or so; the code is small, and comes on top.
  Index of_row = inputs - net.code_size();
  for (Index l = 0; l <= shape.hidden_layers; ++l) {
    const bool is_last = l == shape.hidden_layers;
    const Index outputs = is_last ? 3 : shape.hidden_width;
    ColorNet::Layer layer{inputs, outputs, std::vector<double>(static_cast<std::size_t>(inputs * outputs)),
                          std::vector<double>(static_cast<std::size_t>(outputs))};
    const double size = is_last ? 0 : std::sqrt(2 / static_cast<double>(of_row));  // [He et al. 2015, eq. 10]
    for (double& w : layer.weights) w = static_cast<float>(size * random.normal(at++));
    net.layers.push_back(std::move(layer));
    inputs = of_row = outputs;
  }
  for (double& f : net.features) f = static_cast<float>(f);  // a file keeps them as they are
  return net;
}

ColorNet selected(const ColorNet& net, std::span<const Index> rows) {
  ColorNet out = net;
  out.rows = std::ssize(rows);
  out.features = gathered(net.features, rows, net.features_per_row);
  return out;
}

void check_sizes(const ColorNet& net) {
  HSI4D_CHECK(!net.layers.empty() && std::ssize(net.layers) <= kMostMlpLayers,
              std::to_string(net.layers.size()) + " layers");
  HSI4D_CHECK_EQ(static_cast<Index>(net.features.size()), net.rows * net.features_per_row);
  Index inputs = net.features_per_row + (net.view_direction ? 3 : 0) + net.code_size();
  for (const ColorNet::Layer& layer : net.layers) {
    HSI4D_CHECK_EQ(layer.inputs, inputs);
    HSI4D_CHECK(layer.outputs >= 1, "a layer gives no number");
    HSI4D_CHECK_EQ(static_cast<Index>(layer.weights.size()), layer.inputs * layer.outputs);
    HSI4D_CHECK_EQ(static_cast<Index>(layer.bias.size()), layer.outputs);
    inputs = layer.outputs;
  }
  HSI4D_CHECK_EQ(inputs, Index{3});
}

template <class S>
ColorNetVars<S> color_net_leaves(Tape<S>& tape, const ColorNet& net) {
  check_sizes(net);
  ColorNetVars<S> vars;
  vars.features = leaf(tape, "avatar_features", net.rows, net.features_per_row, net.features);
  for (std::size_t l = 0; l < net.layers.size(); ++l) {
    const ColorNet::Layer& layer = net.layers[l];
    vars.layers.push_back({leaf(tape, layer_name("weights", l), layer.inputs, layer.outputs, layer.weights),
                           leaf(tape, layer_name("bias", l), 1, layer.outputs, layer.bias)});
  }
  return vars;
}

template <class S>
void read_features(const ColorNetVars<S>& vars, ColorNet& net) {
  read(vars.features, net.features);
}

template <class S>
void read_layers(const ColorNetVars<S>& vars, ColorNet& net) {
  HSI4D_CHECK_EQ(vars.layers.size(), net.layers.size());
  for (std::size_t l = 0; l < net.layers.size(); ++l) {
    read(vars.layers[l].weights, net.layers[l].weights);
    read(vars.layers[l].bias, net.layers[l].bias);
  }
}

template <class S>
Var<S> pose_code(Var<S> rotations, std::span<const int> joints, Source where) {
  std::vector<std::uint32_t> rows;
  for (const int j : joints) rows.push_back(static_cast<std::uint32_t>(j));
  const auto count = static_cast<Index>(rows.size());
  const Var<S> identity = rotations.owner().constant("identity", shape_of(1, 9), where);
  rotations.owner().set(identity, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  const Var<S> chosen = gather_rows(rotations, std::move(rows), where);
  return reshape(chosen - Operand<S>(identity, where), 1, 9 * count, where);
}

template <class S>
Var<S> color_net(const ColorNetVars<S>& net, Var<S> colors, Var<S> code, Var<S> directions, Source where) {
  const Var<S> held = clamp(colors, kLeastColor, kLargestColor, where);
  const Var<S> logits = log(held, where) - log(Number<S>(1, where) - held, where);
  return mlp<S>({net.features, directions, code, logits}, net.layers, MlpOutput::kSigmoid, where);
}

void add_color_net(const ColorNet& net, SafetensorsWriter& file) {
  check_sizes(net);
  add_floats(file, array_name("features"), {net.rows, net.features_per_row}, net.features);
  for (std::size_t l = 0; l < net.layers.size(); ++l) {
    const ColorNet::Layer& layer = net.layers[l];
    add_floats(file, layer_name("weights", l), {layer.inputs, layer.outputs}, layer.weights);
    add_floats(file, layer_name("bias", l), {layer.outputs}, layer.bias);
  }
  file.add<std::int32_t>(array_name("code_joints"), {std::ssize(net.code_joints)},
                         std::vector<std::int32_t>(net.code_joints.begin(), net.code_joints.end()));
}

void write_color_net(const std::string& path, const ColorNet& net) {
  SafetensorsWriter file(kNetFormat, kVersion);
  add_color_net(net, file);
  file.write(path);
}

std::optional<ColorNet> color_net_of(const Safetensors& file, Index rows, Index joints) {
  const std::string features = array_name("features");
  if (!file.has(features)) return {};
  ColorNet net;
  net.rows = rows;
  net.features = rounded_numbers(file.array(features), {rows, -1});
  net.features_per_row = file.array(features).shape()[1];
  net.code_joints = code_joints_of(file, joints);
  for (std::size_t l = 0; l < kMostMlpLayers && file.has(layer_name("weights", l)); ++l) {
    net.layers.push_back(layer_of(file, l, l == 0 ? -1 : net.layers.back().outputs));
  }
  const NpyArray& first = file.array(layer_name("weights", 0));  // absent: this is told
  check_all_read(file, net.layers.size());
  const Index without_direction = net.features_per_row + net.code_size();
  net.view_direction = net.layers.front().inputs == without_direction + 3;
  if (!net.view_direction && net.layers.front().inputs != without_direction) {
    throw DataError(first.source() + ": has " + std::to_string(net.layers.front().inputs) +
                    " rows; allowed: " + std::to_string(without_direction) + ", or 3 more with a direction of view");
  }
  if (net.features_per_row < 1) throw DataError(file.array(features).source() + ": has no columns");
  if (net.layers.back().outputs != 3) {
    throw DataError(file.array(layer_name("weights", net.layers.size() - 1)).source() + ": the last layer gives " +
                    std::to_string(net.layers.back().outputs) + " numbers; allowed: 3");
  }
  return net;
}

ColorNet read_color_net(const std::string& path, Index rows, Index joints) {
  const Safetensors file = Safetensors::read(path);
  file.require_format(kNetFormat, kVersion);
  const NpyArray& features = file.array(array_name("features"));  // absent: this is told
  const std::vector<std::int64_t>& shape = features.shape();
  if (!shape.empty() && shape[0] != rows) {
    throw DataError(features.source() + ": has features of " + std::to_string(shape[0]) +
                    " Gaussians; the avatar has " + std::to_string(rows) +
                    ": the network is of another avatar, or of another run's");
  }
  return *color_net_of(file, rows, joints);
}

#define HSI4D_INSTANTIATE(S)                                            \
  template ColorNetVars<S> color_net_leaves(Tape<S>&, const ColorNet&); \
  template void read_features(const ColorNetVars<S>&, ColorNet&);       \
  template void read_layers(const ColorNetVars<S>&, ColorNet&);         \
  template Var<S> pose_code(Var<S>, std::span<const int>, Source);      \
  template Var<S> color_net(const ColorNetVars<S>&, Var<S>, Var<S>, Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
