#include "core/safetensors.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::safetensors_fuzz {

std::vector<Bytes> corpus() {
  SafetensorsWriter mixed("hsi4d example", 1);
  mixed.add<float>("weights", {2, 3}, {1, 2, 3, 4, 5, 6});
  mixed.add<std::int32_t>("parents", {2}, {-1, 0});
  mixed.add<double>("empty", {0, 3}, {});
  const std::vector<std::string> names = {"root", "tip"};
  mixed.set_texts("names", names);
  SafetensorsWriter small;
  small.add<uint8_t>("x", {2}, {1, 2});
  return {mixed.encode(), small.encode(), SafetensorsWriter().encode()};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const Safetensors read = Safetensors::decode(file, "fuzz.safetensors");
    for (const std::string& name : read.names()) is_read([&] { read.array(name).as<double>(); });
    is_read([&] { read.texts("names"); });
    is_read([&] { read.require_format("hsi4d example", 1); });
  });
}

const Target target("safetensors", corpus, accepts);

}  // namespace hsi4d::fuzz::safetensors_fuzz
