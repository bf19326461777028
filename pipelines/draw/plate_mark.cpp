#include "pipelines/draw/plate_mark.h"

#include <fstream>
#include <string_view>
#include <vector>

#include "core/file.h"
#include "splat/files/io_ply.h"

namespace hsi4d {

namespace {

constexpr std::string_view kHead = "ply\nformat binary_little_endian 1.0\n", kMark = "comment hsi4d plate\n";

}  // namespace

void write_plate_splats(const std::string& path, const Gaussians& gaussians) {
  std::vector<std::uint8_t> file = encode_ply(gaussians);
  file.insert(file.begin() + std::ssize(kHead), kMark.begin(), kMark.end());
  write_file(path, file);
}

bool is_plate_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string begin(kHead.size() + kMark.size(), '\0');
  file.read(begin.data(), std::ssize(begin));
  return file && begin == std::string(kHead) + std::string(kMark);
}

}  // namespace hsi4d
