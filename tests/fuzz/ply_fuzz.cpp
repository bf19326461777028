// PLY files of Gaussians in INRIA's layout. What is taken is whole (check_scene).
#include <string>
#include <string_view>

#include "splat/files/io_ply.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/splat_scene.h"

namespace hsi4d::fuzz::ply_fuzz {
namespace {

Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

constexpr std::string_view kAscii = R"(ply
format ascii 1.0
comment made by hand
element camera 1
property list uchar int view
property float fx
element vertex 2
property double x
property double y
property double z
property uchar red
property list uchar float extra
property float opacity
property float scale_0
property float scale_1
property float scale_2
property float rot_0
property float rot_1
property float rot_2
property float rot_3
property float f_dc_0
property float f_dc_1
property float f_dc_2
end_header
3 1 2 3 50.5
0 1 2 255 2 1 2 0.5 -3 -3 -3 1 0 0 0 0.1 0.2 0.3
0 1 -2e-3 0 0 inf -3 -30 -3 1 0 0 +1 0.1 0.2 nan
)";

}  // namespace

std::vector<Bytes> corpus() {
  return {encode_ply(two_gaussians(0)), encode_ply(two_gaussians(1)), encode_ply(two_gaussians(3)), bytes_of(kAscii)};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] { check_scene(decode_ply(file, "fuzz.ply")); });
}

const Target target("ply", corpus, accepts);

}  // namespace hsi4d::fuzz::ply_fuzz
