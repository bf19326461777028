// Files as VPoser's weights are in, with random numbers in them.
#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "body/vposer.h"
#include "core/npz.h"
#include "core/safetensors.h"
#include "tests/support/random_numbers.h"

namespace hsi4d::test {

/// The arrays of a VPoser checkpoint by name.
struct VposerCheckpoint {
  struct Array {
    std::vector<std::int64_t> shape;
    Numbers numbers;
  };
  std::map<std::string, Array> arrays;

  void add(const std::string& name, std::vector<std::int64_t> shape, Numbers numbers) {
    arrays[name] = {std::move(shape), std::move(numbers)};
  }
  const Numbers& operator[](const std::string& name) const { return arrays.at(name).numbers; }

  Bytes npz(const std::string& prefix = "") const {
    NpzWriter file;
    for (const auto& [name, array] : arrays)
      file.add<double>(prefix + name, std::span<const std::int64_t>(array.shape),
                       std::span<const double>(array.numbers));
    return file.encode();
  }
  Bytes safetensors() const {
    SafetensorsWriter file;
    for (const auto& [name, array] : arrays)
      file.add<double>(name, std::span<const std::int64_t>(array.shape), std::span<const double>(array.numbers));
    return file.encode();
  }
  VposerWeights weights() const { return decode_vposer(npz(), "v.npz"); }
};

/// A network of random numbers, h neurons, d latents (the public one: 512 and 32).
inline VposerCheckpoint random_vposer(std::int64_t h, std::int64_t d, std::uint64_t seed) {
  RandomNumbers random(seed);
  VposerCheckpoint c;
  const auto linear = [&](const std::string& name, std::int64_t out, std::int64_t in) {
    c.add(name + ".weight", {out, in},
          random.numbers(static_cast<std::size_t>(out * in), 1.7 / std::sqrt(static_cast<double>(in))));
    c.add(name + ".bias", {out}, random.numbers(static_cast<std::size_t>(out), 0.3));
  };
  const auto normalization = [&](const std::string& name, std::int64_t n) {
    const auto count = static_cast<std::size_t>(n);
    c.add(name + ".weight", {n}, random.numbers(count));
    c.add(name + ".bias", {n}, random.numbers(count, 0.3));
    c.add(name + ".running_mean", {n}, random.numbers(count, 0.2));
    Numbers variance = random.numbers(count);
    for (double& x : variance) x = x * x;
    c.add(name + ".running_var", {n}, variance);
    c.add(name + ".num_batches_tracked", {}, {7});
  };
  normalization("encoder_net.1", 63);
  linear("encoder_net.2", h, 63);
  normalization("encoder_net.4", h);
  linear("encoder_net.6", h, h);
  linear("encoder_net.7", h, h);
  linear("encoder_net.8.mu", d, h);
  linear("encoder_net.8.logvar", d, h);
  linear("decoder_net.0", h, d);
  linear("decoder_net.3", h, h);
  linear("decoder_net.5", 126, h);
  return c;
}

}  // namespace hsi4d::test
