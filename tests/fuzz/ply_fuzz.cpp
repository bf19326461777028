// PLY files of Gaussians. What is taken is whole: sizes fit, numbers are finite and within their limits, every row is
// accounted for.
#include <cmath>
#include <string>
#include <string_view>

#include "splat/io_ply.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz {
namespace {

Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

Gaussians two_gaussians(int degree) {
  Gaussians g;
  g.sh_degree = degree;
  g.means = {0, 1, 2, -3, 4, 5};
  g.quats = {1, 0, 0, 0, 0.5F, -0.5F, 0.5F, 2};
  g.log_scales = {-3, -4, -5, 0, 1, 2};
  g.opacity_logits = {-1, 3};
  for (int i = 0; i < 2 * 3 * g.sh_coefficients(); ++i) g.sh.push_back(static_cast<float>(i) / 16 - 1);
  return g;
}

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

void check_scene(const SplatFile& scene) {
  const Gaussians& g = scene.gaussians;
  check_sizes(g);
  HSI4D_CHECK_EQ(static_cast<Index>(scene.report.row_of.size()), g.count());
  HSI4D_CHECK_EQ(g.count() + scene.report.rejected, scene.report.rows);
  Index rejected = 0;
  for (const auto& [reason, count] : scene.report.rejections) rejected += count;
  HSI4D_CHECK_EQ(rejected, scene.report.rejected);
  for (const auto* values : {&g.means, &g.quats, &g.sh}) {
    for (const float value : *values) HSI4D_CHECK(std::isfinite(value), "a number that is not finite was let through");
  }
  for (const auto* values : {&g.log_scales, &g.opacity_logits}) {
    for (const float value : *values) HSI4D_CHECK(std::fabs(value) <= 20, "a number beyond its limit was let through");
  }
}

}  // namespace

std::vector<Bytes> corpus() {
  return {encode_ply(two_gaussians(0)), encode_ply(two_gaussians(1)), encode_ply(two_gaussians(3)), bytes_of(kAscii)};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] { check_scene(decode_ply(file, "fuzz.ply")); });
}

}  // namespace hsi4d::fuzz
