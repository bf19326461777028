// Compressed PLY files of Gaussians, binary and ascii. What is taken is whole (check_scene).
#include <string_view>

#include "splat/files/io_compressed_ply.h"
#include "splat/files/io_ply.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/splat_scene.h"

namespace hsi4d::fuzz::compressed_ply_fuzz {
namespace {

constexpr std::string_view kAscii = R"(ply
format ascii 1.0
element vertex 2
property uint packed_position
property uint packed_rotation
property uint packed_scale
property uint packed_color
element chunk 1
property float min_x
property float min_y
property float min_z
property float max_x
property float max_y
property float max_z
property float min_scale_x
property float min_scale_y
property float min_scale_z
property float max_scale_x
property float max_scale_y
property float max_scale_z
end_header
4294967295 3758096384 0 4278190335
0 1 2 3
0 0 0 1 inf 1 -5 -5 -5 -1 -1 -1
)";

}  // namespace

std::vector<Bytes> corpus() {
  return {encode_compressed_ply(two_gaussians(0)).bytes, encode_compressed_ply(two_gaussians(1)).bytes,
          encode_compressed_ply(Gaussians{}).bytes, Bytes(kAscii.begin(), kAscii.end())};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] { check_scene(decode_ply(file, "fuzz.ply")); });
}

const Target target("compressed_ply", corpus, accepts);

}  // namespace hsi4d::fuzz::compressed_ply_fuzz
