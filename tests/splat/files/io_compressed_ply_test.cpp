#include "splat/files/io_compressed_ply.h"

#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "splat/files/io_ply.h"
#include "tests/support/splat_files.h"

namespace io_compressed_ply_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// A compressed PLY in ascii, written by hand.
struct Written {
  std::string bounds =
      "min_x min_y min_z max_x max_y max_z min_scale_x min_scale_y min_scale_z max_scale_x max_scale_y max_scale_z "
      "min_r min_g min_b max_r max_g max_b";
  std::string chunks = "0 10 20 2047 1033 2067 -5 -6 -7 -3 -4 -5 0.1 0.2 0.3 0.9 0.8 0.7\n";
  int chunk_rows = 1;
  std::string vertices;
  int vertex_rows = 0;
  int rest = 0;
  std::string harmonics;
  int harmonic_rows = -1;  // as many as vertices

  std::string text() const {
    std::string t = "ply\nformat ascii 1.0\nelement chunk " + std::to_string(chunk_rows) + "\n";
    std::size_t at = 0;
    while (at < bounds.size()) {
      const std::size_t end = std::min(bounds.find(' ', at), bounds.size());
      t += "property float " + bounds.substr(at, end - at) + "\n";
      at = end + 1;
    }
    t += "element vertex " + std::to_string(vertex_rows) + "\n";
    for (const char* name : {"position", "rotation", "scale", "color"})
      t += "property uint packed_" + std::string(name) + "\n";
    if (rest > 0) t += "element sh " + std::to_string(harmonic_rows < 0 ? vertex_rows : harmonic_rows) + "\n";
    for (int i = 0; i < rest; ++i) t += "property uchar f_rest_" + std::to_string(i) + "\n";
    return t + "end_header\n" + chunks + vertices + harmonics;
  }

  void add(std::uint32_t position, std::uint32_t rotation, std::uint32_t scale, std::uint32_t color) {
    for (const std::uint32_t word : {position, rotation, scale, color}) vertices += std::to_string(word) + " ";
    vertices += "\n";
    ++vertex_rows;
  }
};

SplatFile decode(const std::string& text) {
  return decode_ply({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "a.ply");
}

std::string fault(const Written& written) {
  try {
    decode(written.text());
  } catch (const DataError& error) {
    return error.what();
  }
  return "no fault";
}

constexpr std::uint32_t triple(std::uint32_t x, std::uint32_t y, std::uint32_t z) { return x << 21 | y << 11 | z; }

}  // namespace

TEST_CASE("a compressed PLY is read bit by bit") {
  Written w;
  // x 7 of 2047 levels, y 1023 of 1023, z 2047 of 2047; the largest is y (index 2), w −½√2, x 0 (between levels), z
  // √½·…
  w.add(triple(7, 1023, 2047), 2U << 30 | 0U << 20 | 1023U << 10 | 512U, triple(0, 1023, 2047), 0xff00ff33U);
  w.add(triple(0, 0, 0), 0U << 30 | 512U << 20 | 511U << 10 | 512U, triple(2047, 0, 0), 0x00ff00ffU);
  w.rest = 9;
  w.harmonics = "0 1 2 3 4 5 6 127 255\n128 128 128 128 128 128 128 128 128\n";
  const SplatFile file = decode(w.text());
  const Gaussians& g = file.gaussians;
  CHECK(file.report.format == "compressed PLY");
  REQUIRE(g.count() == 2);
  CHECK(g.sh_degree == 1);
  CHECK(g.means == std::vector<float>{7, 1033, 2067, 0, 10, 20});
  CHECK(g.log_scales == std::vector<float>{-5, -4, -5, -3, -6, -7});
  const double half = std::numbers::sqrt2 / 2, step = std::numbers::sqrt2 / 1023;
  CHECK(g.quats[0] == Approx(-half));
  CHECK(g.quats[1] == Approx(half));
  CHECK(g.quats[2] == Approx(0).margin(1e-3));
  CHECK(g.quats[3] == Approx(0.5 * step));
  CHECK(g.quats[4] == Approx(1).margin(1e-5));
  CHECK(g.quats[5] == Approx(0.5 * step));
  CHECK(g.quats[6] == Approx(-0.5 * step));
  const auto dc = [](double color) { return Approx((color - 0.5) / 0.28209479177387814); };
  CHECK(g.sh[0] == dc(0.9));
  CHECK(g.sh[1] == dc(0.2));
  CHECK(g.sh[2] == dc(0.7));
  CHECK(g.opacity_logits[0] == Approx(std::log(0.25)));
  CHECK(g.opacity_logits[1] == opacity_logit(255));
  // f_rest_ counts through one channel after the other
  CHECK(g.sh[3] == -4);
  CHECK(g.sh[6] == 8 * (1.5F / 256 - 0.5F));
  CHECK(g.sh[4] == 8 * (3.5F / 256 - 0.5F));
  CHECK(g.sh[11] == 4);
  CHECK(g.sh[8] == 8 * (127.5F / 256 - 0.5F));
}

TEST_CASE("without bounds of colours they are from 0 to 1") {
  Written w;
  w.bounds.resize(w.bounds.find(" min_r"));
  w.chunks = "0 0 0 1 1 1 -5 -5 -5 -5 -5 -5\n";
  w.add(0, 0, 0, 0x0080ff80U);
  const Gaussians g = decode(w.text()).gaussians;
  CHECK(g.sh[0] == Approx(-0.5 / 0.28209479177387814));
  CHECK(g.sh[1] == Approx((128 / 255.0 - 0.5) / 0.28209479177387814));
  CHECK(g.sh[2] == Approx(0.5 / 0.28209479177387814));
}

TEST_CASE("the second chunk begins with Gaussian 256") {
  Written w;
  w.chunk_rows = 2;
  w.chunks = "0 0 0 1 1 1 -5 -5 -5 -4 -4 -4 0 0 0 1 1 1\n9 9 9 9 9 9 -5 -5 -5 -4 -4 -4 0 0 0 1 1 1\n";
  for (int i = 0; i < 257; ++i) w.add(0, 0, 0, 0);
  const Gaussians g = decode(w.text()).gaussians;
  CHECK(g.means[3 * 255] == 0);
  CHECK(g.means[3 * 256] == 9);
}

TEST_CASE("what is wrong with a compressed PLY is told") {
  Written w;
  w.add(0, 0, 0, 0);
  CHECK(fault(w) == "no fault");
  Written bad = w;
  bad.chunk_rows = 2;
  bad.chunks += bad.chunks;
  CHECK(fault(bad) == "a.ply: element \"chunk\" has 2 rows; 1 Gaussians in chunks of 256 need 1");
  bad = w;
  bad.bounds.replace(bad.bounds.find("max_y"), 5, "max_q");
  CHECK(fault(bad) == "a.ply: element \"chunk\" has no property max_y; a compressed PLY has it");
  bad = w;
  bad.rest = 9;
  bad.harmonic_rows = 2;
  for (int i = 0; i < 18; ++i) bad.harmonics += "7 ";
  CHECK(fault(bad) == "a.ply: element \"sh\" has 2 rows for 1 Gaussians");
  bad = w;
  bad.rest = 12;
  for (int i = 0; i < 12; ++i) bad.harmonics += "7 ";
  CHECK(fault(bad) ==
        "a.ply: element \"sh\" has 12 properties f_rest_; allowed: 9, 24 or 45 (spherical harmonics of degree 1 to 3)");
  bad = w;
  bad.rest = 9;
  bad.harmonics = "1 1 1 1 1 256 1 1 1\n";
  CHECK(fault(bad) == "a.ply: row 0 has a packed number that is no whole number from 0 to 255");
  for (const char* word : {"-1", "0.5", "4294967296", "nan"}) {
    bad = w;
    bad.vertices = std::string(word) + " 0 0 0\n";
    CHECK(fault(bad) == "a.ply: row 0 has a packed number that is no whole number from 0 to 4294967295");
  }
  std::string text = w.text();
  text.replace(text.find("uint packed_scale"), 17, "float packed_scale");
  CHECK_THROWS_WITH(decode(text), "a.ply: property packed_scale of element \"vertex\" is not of type uint");
  text = w.text();
  text.replace(text.find("element chunk"), 13, "element chump");
  CHECK_THROWS_WITH(decode(text), "a.ply: there is no element \"chunk\"; a compressed PLY has one");
}

TEST_CASE("chunks with bounds that are not finite lose their rows, counted") {
  Written w;
  w.chunks = "0 0 0 inf 1 1 -5 -5 -5 -4 -4 -4 0 0 0 1 1 1\n";
  w.add(triple(2047, 0, 0), 0, 0, 0);
  CHECK(summary_text(decode(w.text()).report) == "1 of 1 Gaussians are left out (a mean that is not finite: 1)");
  w.chunks = "0 0 0 1 1 1 -90 -5 -5 -4 -4 -4 0 0 0 1 1 1\n";
  CHECK(summary_text(decode(w.text()).report) == "log-scales held within ±20: 1");
}

TEST_CASE("Gaussians come back from a compressed PLY within its rounding, in the order that is told") {
  for (const int degree : {0, 1, 3}) {
    const Gaussians g = plain_gaussians(1000, degree);
    const EncodedSplats encoded = encode_compressed_ply(g);
    CHECK(encoded.losses.empty());
    const SplatFile file = decode_ply(encoded.bytes, "a.compressed.ply");
    CHECK(file.report.rejected == 0);
    CHECK(file.report.repairs.empty());
    const Gaussians expected = selected(g, compressed_ply_order(g));
    CHECK(largest_difference(file.gaussians.means, expected.means) < 4.0 / 1023 / 2 + 1e-6);
    CHECK(largest_difference(file.gaussians.log_scales, expected.log_scales) < 5.0 / 1023 / 2 + 1e-6);
    CHECK(largest_opacity_difference(file.gaussians, expected) < 1 / 510.0 + 1e-7);
    CHECK(largest_difference(dc_of(file.gaussians), dc_of(expected)) * 0.28209479177387814 < 1 / 510.0 + 1e-6);
    CHECK(largest_difference(rest_of(file.gaussians), rest_of(expected)) <= 1 / 64.0 + 1e-6);
    CHECK(largest_angle(file.gaussians, expected) < 0.0049);  // the three 0.0007 each, the largest as much in sum
  }
}

TEST_CASE("chunks along the curve are smaller than chunks in any order") {
  const Gaussians g = plain_gaussians(8192, 0);
  const Gaussians back = decode_ply(encode_compressed_ply(g).bytes, "a").gaussians;
  const Gaussians expected = selected(g, compressed_ply_order(g));
  double sum = 0;
  for (std::size_t i = 0; i < g.means.size(); ++i)
    sum += std::fabs(static_cast<double>(back.means[i]) - static_cast<double>(expected.means[i]));
  // A chunk that fills the whole cube of 4 m errs by a quarter of a level in the mean.
  const double anywhere = (2 * 4.0 / 2047 + 4.0 / 1023) / 3 / 4;
  CHECK(sum / static_cast<double>(g.means.size()) < 0.6 * anywhere);
  std::vector<Index> order = compressed_ply_order(g);
  std::sort(order.begin(), order.end());
  for (Index n = 0; n < g.count(); ++n) REQUIRE(order[static_cast<std::size_t>(n)] == n);
}

TEST_CASE("Gaussians at the ends of what a compressed PLY holds") {
  Gaussians g = plain_gaussians(3, 1);
  g.origin_world = {100, 0, 0};
  std::fill(g.means.begin(), g.means.end(), 1.0F);  // a chunk without extent
  g.log_scales[0] = 30;
  g.sh[3] = 5;
  g.sh[4] = -4.5F;
  g.quats = {-1, 0, 0, 0, 0, 0, 0, -3, 0.5F, 0.5F, -0.5F, 0.5F};
  const EncodedSplats encoded = encode_compressed_ply(g);
  CHECK(counts_text(encoded.losses) == "log-scales held within ±20: 1, harmonics held within ±4: 2");
  const Gaussians back = decode_ply(encoded.bytes, "a").gaussians;
  CHECK(back.means == std::vector<float>{101, 1, 1, 101, 1, 1, 101, 1, 1});
  CHECK(back.log_scales[0] == 20);
  CHECK(back.sh[3] == 4);
  CHECK(back.sh[4] == -4);
  CHECK(largest_angle(back, g) < 0.0049);
  CHECK(decode_ply(encode_compressed_ply(Gaussians{}).bytes, "a").gaussians.count() == 0);
  g.means[4] = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_WITH(encode_compressed_ply(g),
                    "Gaussian 1 has a mean that is not finite, which a compressed PLY file cannot hold");
}

TEST_CASE("a compressed PLY that was cut or lengthened is refused") {
  const Bytes whole = encode_compressed_ply(plain_gaussians(5, 1)).bytes;
  for (std::size_t size = 0; size < whole.size(); ++size)
    CHECK_THROWS_AS(decode_ply(std::span(whole).first(size), "a.ply"), DataError);
  Bytes longer = whole;
  longer.push_back(0);
  CHECK_THROWS_AS(decode_ply(longer, "a.ply"), DataError);
}

}  // namespace io_compressed_ply_test
