#include "splat/files/io_splat.h"

#include <bit>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "tests/support/splat_files.h"

namespace io_splat_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Message;

namespace {

Bytes row(const std::array<float, 6>& numbers, const std::array<std::uint8_t, 8>& bytes) {
  Bytes file;
  for (const float number : numbers) {
    const auto raw = std::bit_cast<std::array<std::uint8_t, 4>>(number);
    file.insert(file.end(), raw.begin(), raw.end());
  }
  file.insert(file.end(), bytes.begin(), bytes.end());
  return file;
}

const std::array<std::uint8_t, 8> kBytes = {0, 128, 255, 51, 192, 64, 128, 0};

}  // namespace

TEST_CASE("a .splat row is read field by field") {
  const SplatFile file = decode_splat(row({1, -2, 3, 1, 0.5F, 0.25F}, kBytes), "a.splat");
  const Gaussians& g = file.gaussians;
  CHECK(file.report.format == ".splat");
  CHECK(file.report.rows == 1);
  CHECK(g.sh_degree == 0);
  CHECK(g.means == std::vector<float>{1, -2, 3});
  CHECK(g.log_scales == std::vector<float>{0, std::log(0.5F), std::log(0.25F)});
  CHECK(g.quats == std::vector<float>{0.5F, -0.5F, 0, -1});
  CHECK(g.opacity_logits[0] == Approx(std::log(0.25)));  // 51/255 = 0.2
  CHECK(g.sh[0] == Approx(-0.5 / 0.28209479177387814));
  CHECK(g.sh[1] == Approx((128 / 255.0 - 0.5) / 0.28209479177387814));
  CHECK(g.sh[2] == Approx(0.5 / 0.28209479177387814));
}

TEST_CASE("a .splat row is written field by field") {
  Gaussians g;
  g.origin_world = {10, 0, 0};
  g.means = {1, -2, 3};
  g.quats = {2, -2, 0, -2.82842712F};  // half of it, a half, 0, the root of a half
  g.log_scales = {0, std::log(0.5F), -20};
  g.opacity_logits = {std::log(0.25F)};
  g.sh = {-1.7724538F, 0.0069508F, 10};
  const EncodedSplats encoded = encode_splat(g);
  const Bytes expected = row({11, -2, 3, 1, 0.5F, std::exp(-20.0F)}, {0, 128, 255, 51, 192, 64, 128, 37});
  CHECK(encoded.bytes == expected);
  CHECK(counts_text(encoded.losses) == "colours held within 0 to 1: 1");
}

TEST_CASE("Gaussians come back from .splat within its rounding, the second time exactly") {
  const Gaussians g = plain_gaussians(500, 2);
  const EncodedSplats encoded = encode_splat(g);
  CHECK(counts_text(encoded.losses) == "Gaussians without their harmonics of degree 1 and more: 500");
  const SplatFile file = decode_splat(encoded.bytes, "a.splat");
  CHECK(file.report.rejected == 0);
  CHECK(file.report.repairs.empty());
  CHECK(file.gaussians.means == g.means);
  CHECK(largest_difference(file.gaussians.log_scales, g.log_scales) < 1e-6);
  CHECK(largest_opacity_difference(file.gaussians, g) < 1 / 510.0 + 1e-7);
  CHECK(largest_difference(file.gaussians.sh, dc_of(g)) * 0.28209479177387814 < 1 / 510.0 + 1e-7);
  CHECK(largest_angle(file.gaussians, g) < 0.016);  // 4 components, 1/256 each: at most 2 · 2/256
  const EncodedSplats again = encode_splat(file.gaussians);
  CHECK(again.losses.empty());
  const SplatFile second = decode_splat(again.bytes, "a.splat");
  CHECK(second.gaussians.opacity_logits == file.gaussians.opacity_logits);
  CHECK(second.gaussians.sh == file.gaussians.sh);
}

TEST_CASE("every opacity of a .splat file keeps its level, and its logit moves") {
  for (int level = 0; level < 256; ++level) {
    const float logit = opacity_logit(static_cast<std::uint8_t>(level));
    CHECK(std::fabs(logit) < 7);
    CHECK(opacity_level(logit) == level);
    CHECK(std::fabs(opacity_of(logit) - level / 255.0) <= 0.25 / 255 + 1e-7);
  }
  CHECK(opacity_level(std::numeric_limits<float>::infinity()) == 255);
  CHECK(opacity_level(-std::numeric_limits<float>::infinity()) == 0);
  CHECK(opacity_level(-200) == 0);
}

TEST_CASE("rows of a .splat file that cannot be used are left out, others repaired, all counted") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
  Bytes file;
  const auto add = [&file](const Bytes& more) { file.insert(file.end(), more.begin(), more.end()); };
  add(row({nan, 0, 0, 1, 1, 1}, kBytes));
  add(row({0, 0, -infinite, 1, 1, 1}, kBytes));
  add(row({0, 0, 0, -1, 1, 1}, kBytes));
  add(row({0, 0, 0, 1, infinite, 1}, kBytes));
  add(row({0, 0, 0, 1, 1, 1}, {0, 0, 0, 0, 128, 128, 128, 128}));
  add(row({7, 0, 0, 0, 1e-42F, 3e38F}, kBytes));
  const SplatFile read = decode_splat(file, "a.splat");
  CHECK(summary_text(read.report) ==
        "5 of 6 Gaussians are left out (a mean that is not finite: 2, a scale that is not finite: 2, a quaternion that "
        "is zero: 1); log-scales held within ±20: 3");
  CHECK(read.report.row_of == std::vector<Index>{5});
  CHECK(read.gaussians.log_scales == std::vector<float>{-20, -20, 20});
}

TEST_CASE("a .splat file of a wrong size and Gaussians that cannot be written are refused") {
  CHECK(decode_splat({}, "a.splat").gaussians.count() == 0);
  const Bytes whole = row({0, 0, 0, 1, 1, 1}, kBytes);
  for (std::size_t size = 1; size < whole.size(); ++size)
    CHECK_THROWS_AS(decode_splat(std::span(whole).first(size), "a.splat"), DataError);
  CHECK_THROWS_MATCHES(decode_splat(Bytes(33), "a.splat"), DataError,
                       Message("a.splat: a .splat file has 32 bytes for each Gaussian; this one has 33 bytes, 1 too "
                               "many: it was cut short, or it is no .splat file"));
  Gaussians g = plain_gaussians(3, 1);
  g.sh[2 * 12 + 5] = std::numeric_limits<float>::infinity();
  CHECK_THROWS_MATCHES(encode_splat(g), UserError,
                       Message("Gaussian 2 has a colour that is not finite, which a .splat file cannot hold"));
  g = plain_gaussians(3, 1);
  g.opacity_logits[1] = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_MATCHES(encode_splat(g), UserError,
                       Message("Gaussian 1 has an opacity that is no number, which a .splat file cannot hold"));
}

}  // namespace io_splat_test
