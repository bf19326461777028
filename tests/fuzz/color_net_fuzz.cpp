// Files of a color net alone, of an avatar with one Gaussian and two joints.
#include "body/color_net.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::color_net_fuzz {

namespace {

Scratch& scratch() {
  static Scratch made({ScratchFile{"net.safetensors", {}}});
  return made;
}

Bytes file_of(const ColorNetShape& shape) {
  const std::vector<float> means = {0, 1, 2};
  write_color_net(scratch() / "net.safetensors", new_color_net(means, 2, shape));
  return read_file(scratch() / "net.safetensors");
}

}  // namespace

std::vector<Bytes> corpus() { return {file_of({2, 3, 1, true, 0}), file_of({1, 2, 2, false, 0})}; }

bool accepts(std::span<const uint8_t> file) {
  write_file(scratch() / "net.safetensors", file);
  return is_read([&] { check_sizes(read_color_net(scratch() / "net.safetensors", 1, 2)); });
}

const Target target("color_net", corpus, accepts);

}  // namespace hsi4d::fuzz::color_net_fuzz
