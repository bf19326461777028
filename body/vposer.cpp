#include "body/vposer.h"

#include <algorithm>
#include <cmath>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "body/file_contents.h"
#include "core/file.h"
#include "core/finite_numbers.h"
#include "core/npz.h"
#include "core/safetensors.h"

namespace hsi4d {

namespace {

constexpr Index kPoseNumbers = 3 * kBodyPoseJoints;
constexpr Index kColumnNumbers = 6 * kBodyPoseJoints;
constexpr double kSlope = 0.01;
constexpr double kVarianceFloor = 1e-5;

/// The arrays of a network by the names of the checkpoint. File: Npz or Safetensors.
template <class File>
class Weights {
 public:
  explicit Weights(const File& file)
      : file_(file), prefix_(file.has("vp_model.decoder_net.0.weight") ? "vp_model." : "") {}

  /// Numbers of an array of this shape (−1: any length). Throws DataError.
  std::vector<double> numbers(const std::string& name, std::initializer_list<std::int64_t> shape) const {
    return finite_numbers<double>(file_.array(prefix_ + name), shape);
  }

  /// A map to as many outputs as its bias has.
  LinearWeights linear(const std::string& name, Index inputs) const {
    LinearWeights map;
    map.bias = numbers(name + ".bias", {-1});
    if (map.bias.empty()) throw DataError(file_.array(prefix_ + name + ".bias").source() + ": holds no number");
    map.weight = numbers(name + ".weight", {static_cast<std::int64_t>(map.bias.size()), inputs});
    return map;
  }

  LinearWeights linear(const std::string& name, Index inputs, Index outputs) const {
    return {numbers(name + ".weight", {outputs, inputs}), numbers(name + ".bias", {outputs})};
  }

  /// The factors and what is added, of a normalisation that has its statistics.
  LinearWeights normalization(const std::string& name, Index count) const {
    LinearWeights map{numbers(name + ".weight", {count}), numbers(name + ".bias", {count})};
    const std::vector<double> mean = numbers(name + ".running_mean", {count});
    const std::vector<double> variance = numbers(name + ".running_var", {count});
    for (std::size_t i = 0; i < mean.size(); ++i) {
      if (variance[i] < 0) {
        throw DataError(file_.array(prefix_ + name + ".running_var").source() + ": number " + std::to_string(i) +
                        " is below 0; it is a variance");
      }
      map.weight[i] /= std::sqrt(variance[i] + kVarianceFloor);
      map.bias[i] -= map.weight[i] * mean[i];
    }
    return map;
  }

 private:
  const File& file_;
  std::string prefix_;
};

/// x → B (A x).
LinearWeights product(const LinearWeights& b, const LinearWeights& a) {
  const std::size_t outputs = b.bias.size(), middle = a.bias.size(), inputs = a.weight.size() / middle;
  LinearWeights map{std::vector<double>(outputs * inputs), b.bias};
  for (std::size_t o = 0; o < outputs; ++o) {
    for (std::size_t m = 0; m < middle; ++m) {
      const double by = b.weight[o * middle + m];
      map.bias[o] += by * a.bias[m];
      for (std::size_t i = 0; i < inputs; ++i) map.weight[o * inputs + i] += by * a.weight[m * inputs + i];
    }
  }
  return map;
}

/// x → A (s x + t), number by number in the brackets.
LinearWeights after_normalization(LinearWeights a, const LinearWeights& normalization) {
  const std::size_t inputs = normalization.bias.size();
  for (std::size_t o = 0; o < a.bias.size(); ++o) {
    for (std::size_t i = 0; i < inputs; ++i) {
      a.bias[o] += a.weight[o * inputs + i] * normalization.bias[i];
      a.weight[o * inputs + i] *= normalization.weight[i];
    }
  }
  return a;
}

/// The checkpoint's columns lie by rows of a 3×2 matrix; ours one after the other.
LinearWeights with_columns_in_turn(const LinearWeights& map) {
  constexpr std::size_t kFrom[6] = {0, 2, 4, 1, 3, 5};
  const std::size_t inputs = map.weight.size() / map.bias.size();
  LinearWeights result = map;
  for (std::size_t row = 0; row < map.bias.size(); ++row) {
    const std::size_t from = 6 * (row / 6) + kFrom[row % 6];
    result.bias[row] = map.bias[from];
    const auto begin = map.weight.begin() + static_cast<std::ptrdiff_t>(from * inputs);
    std::copy(begin, begin + static_cast<std::ptrdiff_t>(inputs),
              result.weight.begin() + static_cast<std::ptrdiff_t>(row * inputs));
  }
  return result;
}

Index outputs_of(const LinearWeights& map) { return static_cast<Index>(map.bias.size()); }

template <class File>
VposerWeights weights_of(const File& file) {
  const Weights<File> in(file);
  VposerWeights w;
  w.source = file.source();
  const LinearWeights first = in.linear("encoder_net.2", kPoseNumbers);
  const LinearWeights second = in.linear("encoder_net.6", outputs_of(first));
  const LinearWeights third = in.linear("encoder_net.7", outputs_of(second));
  const LinearWeights mean = in.linear("encoder_net.8.mu", outputs_of(third));
  w.latents = outputs_of(mean);
  w.encoder[0] = after_normalization(first, in.normalization("encoder_net.1", kPoseNumbers));
  w.encoder[1] =
      after_normalization(product(product(mean, third), second), in.normalization("encoder_net.4", outputs_of(first)));
  w.decoder[0] = in.linear("decoder_net.0", w.latents);
  w.decoder[1] = in.linear("decoder_net.3", outputs_of(w.decoder[0]));
  w.decoder[2] = with_columns_in_turn(in.linear("decoder_net.5", outputs_of(w.decoder[1]), kColumnNumbers));
  return w;
}

}  // namespace

VposerWeights read_vposer(const std::string& path) { return decode_vposer(read_file(path), path); }

VposerWeights decode_vposer(std::span<const std::uint8_t> file, const std::string& name) {
  if (looks_like_safetensors(file.first(std::min<std::size_t>(file.size(), 9)))) {
    return weights_of(Safetensors::decode(file, name));
  }
  const Npz archive = Npz::decode(file, name);
  refuse_other_contents(archive, {"the weights of VPoser"});
  return weights_of(archive);
}

template <class S>
Vposer<S>::Vposer(const VposerWeights& weights) {
  for (std::size_t i = 0; i < 3; ++i) decoder[i] = FrozenLinear<S>(weights.decoder[i].weight, weights.decoder[i].bias);
  for (std::size_t i = 0; i < 2; ++i) encoder[i] = FrozenLinear<S>(weights.encoder[i].weight, weights.encoder[i].bias);
}

template <class S>
Var<S> vposer_decode(const Vposer<S>& vposer, Var<S> latents, Source where) {
  const Index frames = latents.shape().rows;
  const Var<S> first = leaky_relu(frozen_linear(vposer.decoder[0], latents, where), kSlope, where);
  const Var<S> second = leaky_relu(frozen_linear(vposer.decoder[1], first, where), kSlope, where);
  const Var<S> columns = frozen_linear(vposer.decoder[2], second, where);
  return rotations_from_6d(reshape(columns, kBodyPoseJoints * frames, 6, where), where);
}

template <class S>
Var<S> vposer_encode(const Vposer<S>& vposer, Var<S> axis_angle, Source where) {
  const Index frames = axis_angle.shape().rows / kBodyPoseJoints;
  HSI4D_CHECK_EQ(axis_angle.shape(), shape_of(kBodyPoseJoints * frames, 3));
  const Var<S> pose = reshape(axis_angle, frames, kPoseNumbers, where);
  const Var<S> first = leaky_relu(frozen_linear(vposer.encoder[0], pose, where), kSlope, where);
  return frozen_linear(vposer.encoder[1], first, where);
}

#define HSI4D_INSTANTIATE(S)                                       \
  template struct Vposer<S>;                                       \
  template Var<S> vposer_decode(const Vposer<S>&, Var<S>, Source); \
  template Var<S> vposer_encode(const Vposer<S>&, Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
