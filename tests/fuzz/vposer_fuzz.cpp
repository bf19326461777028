// Weights of VPoser: a network of one neuron and one latent.
#include "body/vposer.h"
#include "core/npz.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::vposer_fuzz {

namespace {

Bytes small_vposer() {
  NpzWriter file;
  const auto add = [&](const std::string& name, std::int64_t rows, std::int64_t columns) {
    const std::vector<float> numbers(static_cast<std::size_t>(rows * columns), 0.5F);
    file.add<float>(name + ".weight", {rows, columns}, numbers);
    file.add<float>(name + ".bias", {rows}, std::vector<float>(static_cast<std::size_t>(rows), 0.25F));
  };
  add("encoder_net.2", 1, 63);
  add("encoder_net.6", 1, 1);
  add("encoder_net.7", 1, 1);
  add("encoder_net.8.mu", 1, 1);
  add("decoder_net.0", 1, 1);
  add("decoder_net.3", 1, 1);
  add("decoder_net.5", 126, 1);
  for (const auto& [name, count] : {std::pair{"encoder_net.1.", 63}, std::pair{"encoder_net.4.", 1}}) {
    for (const char* part : {"weight", "bias", "running_mean", "running_var"}) {
      file.add<float>(std::string(name) + part, {count}, std::vector<float>(static_cast<std::size_t>(count), 0.5F));
    }
  }
  return file.encode();
}

}  // namespace

std::vector<Bytes> corpus() { return {list_of(small_vposer()), small_vposer()}; }

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] { decode_vposer(archive_of(file), "fuzz.npz"); });
}

const Target target("vposer", corpus, accepts);

}  // namespace hsi4d::fuzz::vposer_fuzz
