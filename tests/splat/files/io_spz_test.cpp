#include "splat/files/io_spz.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/compression.h"
#include "splat/sh_basis.h"
#include "tests/support/measures.h"
#include "tests/support/splat_files.h"

namespace io_spz_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// A .spz file as bytes of its parts, one Gaussian.
struct Written {
  int version = 3;
  std::uint32_t count = 1;
  int degree = 0, bits = 12, flags = 0;
  Bytes positions = {0, 0x10, 0, 0, 0xe0, 0xff, 1, 0, 0};  // 1, −2, 1/4096 in the file's axes
  Bytes opacities = {51};
  Bytes colors = {0, 128, 255};
  Bytes scales = {0, 160, 255};
  Bytes rotations = {0, 0, 0, 0xc0};  // w is the largest, the others are 0
  Bytes harmonics;
  Bytes extensions;

  std::vector<Bytes> parts() const { return {positions, opacities, colors, scales, rotations, harmonics}; }

  Bytes plain() const {
    Bytes file = {'N', 'G', 'S', 'P'};
    append_uint(file, static_cast<std::uint64_t>(version), 4);
    append_uint(file, count, 4);
    for (const int byte : {degree, bits, flags, 0}) file.push_back(static_cast<std::uint8_t>(byte));
    for (const Bytes& part : parts()) file.insert(file.end(), part.begin(), part.end());
    file.insert(file.end(), extensions.begin(), extensions.end());
    return file;
  }

  Bytes gzip() const { return compress_gzip(plain()); }

  Bytes frames() const {
    Bytes file = {'N', 'G', 'S', 'P', 4, 0, 0, 0};
    append_uint(file, count, 4);
    std::uint64_t number = 0;
    for (const Bytes& part : parts()) number += part.empty() ? 0 : 1;
    for (const int byte : {degree, bits, flags}) file.push_back(static_cast<std::uint8_t>(byte));
    append_uint(file, number, 1);
    append_uint(file, 32 + extensions.size(), 4);
    file.resize(32);
    file.insert(file.end(), extensions.begin(), extensions.end());
    Bytes packed;
    for (const Bytes& part : parts()) {
      if (part.empty()) continue;
      const Bytes frame = compress_zstd(part);
      append_uint(file, frame.size(), 8);
      append_uint(file, part.size(), 8);
      packed.insert(packed.end(), frame.begin(), frame.end());
    }
    file.insert(file.end(), packed.begin(), packed.end());
    return file;
  }
};

std::string fault(const Bytes& file) {
  try {
    decode_spz(file, "a.spz");
  } catch (const DataError& error) {
    return error.what();
  }
  return "no fault";
}

double shown(const Gaussians& g, Index n, int channel, const Vector3<double>& r) {
  std::array<double, 16> basis{};
  sh_basis(g.sh_degree, r[0], r[1], r[2], basis.data());
  double sum = 0;
  for (int k = 0; k < g.sh_coefficients(); ++k)
    sum += basis[static_cast<std::size_t>(k)] *
           static_cast<double>(g.sh[static_cast<std::size_t>(3 * (n * g.sh_coefficients() + k) + channel)]);
  return sum;
}

}  // namespace

TEST_CASE("a .spz file is read byte by byte, packed in each way") {
  Written w;
  for (const Bytes& file : {w.plain(), w.gzip(), w.frames()}) {
    const SplatFile read = decode_spz(file, "a.spz");
    const Gaussians& g = read.gaussians;
    REQUIRE(g.count() == 1);
    CHECK(g.means == std::vector<float>{1, 2, -1.0F / 4096});  // y and z point the other way
    CHECK(g.log_scales == std::vector<float>{-10, 0, 5.9375F});
    CHECK(g.quats == std::vector<float>{1, 0, 0, 0});
    CHECK(g.opacity_logits[0] == Approx(std::log(0.25)));
    CHECK(g.sh[0] == Approx(-0.5 / 0.15));
    CHECK(g.sh[1] == Approx((128 / 255.0 - 0.5) / 0.15));
    CHECK(g.sh[2] == Approx(0.5 / 0.15));
    CHECK(read.report.notes.empty());
  }
  CHECK(decode_spz(w.gzip(), "a").report.format == ".spz version 3");
  CHECK(decode_spz(w.frames(), "a").report.format == ".spz version 4");
}

TEST_CASE("positions of .spz are 24-bit numbers with a sign") {
  Written w;
  w.bits = 0;
  w.positions = {0xff, 0xff, 0x7f, 0, 0, 0x80, 0xff, 0xff, 0xff};
  CHECK(decode_spz(w.plain(), "a").gaussians.means == std::vector<float>{8388607, 8388608, 1});
  w.version = 1;  // half floats, and rotations of three bytes
  w.positions = {0, 0x3c, 0, 0xc0, 1, 0};
  w.rotations = {127, 127, 127};
  CHECK(decode_spz(w.plain(), "a").gaussians.means == std::vector<float>{1, 2, -5.9604645e-8F});
  w.positions = {0, 0x7c, 0, 0, 0, 0};
  CHECK(summary_text(decode_spz(w.plain(), "a").report) ==
        "1 of 1 Gaussians are left out (a mean that is not finite: 1)");
}

TEST_CASE("rotations of .spz") {
  Written w;
  w.version = 2;
  w.rotations = {255, 0, 0};  // beyond a unit quaternion: w is 0
  Gaussians g = decode_spz(w.plain(), "a").gaussians;
  CHECK(g.quats == std::vector<float>{0, 1, 1, 1});  // of the file's 1, −1, −1: y and z change sign
  w.rotations = {204, 51, 102};                      // 0.6, −0.6, −0.2
  g = decode_spz(w.plain(), "a").gaussians;
  CHECK(g.quats[0] == Approx(std::sqrt(0.24)));
  CHECK(g.quats[1] == Approx(0.6));
  CHECK(g.quats[2] == Approx(0.6));
  CHECK(g.quats[3] == Approx(0.2));
  w.version = 3;
  // the largest is x (0); y −½√2, z 0, w ¼√2 to a level of 511
  const std::uint32_t bits = 0U << 30 | (512U | 511U) << 20 | 0U << 10 | 256U;
  w.rotations.clear();
  append_uint(w.rotations, bits, 4);
  g = decode_spz(w.plain(), "a").gaussians;
  const double y = -std::numbers::sqrt2 / 2, turn = 256 / (511 * std::numbers::sqrt2);
  CHECK(g.quats[0] == Approx(turn));
  CHECK(g.quats[1] == Approx(std::sqrt(1 - y * y - turn * turn)));
  CHECK(g.quats[2] == Approx(-y));
  CHECK(g.quats[3] == 0);
}

TEST_CASE("harmonics of .spz go coefficient by coefficient and change sign with the axes") {
  Written w;
  w.degree = 1;
  w.harmonics = {0, 64, 192, 160, 160, 160, 224, 32, 128};
  const Gaussians g = decode_spz(w.gzip(), "a").gaussians;
  CHECK(g.sh_degree == 1);
  CHECK(std::vector<float>(g.sh.begin() + 3, g.sh.end()) ==
        std::vector<float>{1, 0.5F, -0.5F, -0.25F, -0.25F, -0.25F, 0.75F, -0.75F, 0});
  // A harmonic in the file's axes shows along r what the Gaussian shows along r with y and z turned round.
  for (int degree = 1; degree <= 3; ++degree) {
    w.degree = degree;
    Gaussians raw;
    raw.sh_degree = degree;
    raw.means = {0, 0, 0}, raw.quats = {1, 0, 0, 0}, raw.log_scales = {0, 0, 0}, raw.opacity_logits = {0};
    raw.sh = {0, 0, 0};
    w.colors = {128, 128, 128};
    w.harmonics.clear();
    for (int i = 0; i < 3 * (raw.sh_coefficients() - 1); ++i) {
      w.harmonics.push_back(static_cast<std::uint8_t>(37 * i + 11));
      raw.sh.push_back(static_cast<float>((w.harmonics.back() - 128) / 128.0));
    }
    Gaussians read = decode_spz(w.gzip(), "a").gaussians;
    for (std::size_t c = 0; c < 3; ++c) read.sh[c] = 0;
    for (int i = 0; i < 20; ++i) {
      const Vector3<double> r = Vector3<double>(std::sin(i), std::cos(2.0 * i), std::sin(3.0 * i + 1)).normalized();
      CHECK(shown(read, 0, 1, r) == Approx(shown(raw, 0, 1, {r[0], -r[1], -r[2]})).margin(1e-6));
    }
  }
}

TEST_CASE("harmonics of degree 4 are left out and counted") {
  Written w;
  w.degree = 4;
  w.harmonics.assign(72, 192);
  const SplatFile read = decode_spz(w.frames(), "a");
  CHECK(read.gaussians.sh_degree == 3);
  CHECK(read.gaussians.sh.size() == 48);
  CHECK(summary_text(read.report) == "Gaussians without their harmonics of degree 4: 1");
  w.degree = 5;
  CHECK(fault(w.plain()) == "a.spz: spherical harmonics of degree 5; allowed: 0 to 4");
}

TEST_CASE("extensions of .spz: axes are heeded, others passed over, what changes numbers refused") {
  const auto record = [](std::uint32_t type, const Bytes& content) {
    Bytes bytes;
    append_uint(bytes, type, 4);
    append_uint(bytes, content.size(), 4);
    bytes.insert(bytes.end(), content.begin(), content.end());
    return bytes;
  };
  Written w;
  w.flags = 3;
  w.extensions = record(0xADBE0002U, Bytes(12));
  for (const Bytes& file : {w.plain(), w.gzip(), w.frames()}) {
    const SplatFile read = decode_spz(file, "a.spz");
    CHECK(read.report.antialiased);
    CHECK(read.report.cautions == std::vector<std::string>{"an extension of type 2914910210 is passed over"});
    CHECK(read.gaussians.means[1] == 2);
  }
  const Bytes axes = record(0xADBE0003U, {6, 0, 0, 0});  // RDF, as ours
  w.extensions.insert(w.extensions.end(), axes.begin(), axes.end());
  for (const Bytes& file : {w.plain(), w.gzip(), w.frames()})
    CHECK(decode_spz(file, "a.spz").gaussians.means == std::vector<float>{1, -2, 1.0F / 4096});
  w.extensions = record(0xADBE0003U, {3, 0, 0, 0});  // LUB: all three the other way, which mirrors
  w.rotations = {127 + 51, 127, 127};
  w.version = 2;
  CHECK(decode_spz(w.gzip(), "a").gaussians.means == std::vector<float>{-1, 2, -1.0F / 4096});
  CHECK(decode_spz(w.gzip(), "a").gaussians.quats[1] == Approx(178 / 127.5 - 1));
  w.extensions = record(0xADBE0003U, {9, 0, 0, 0});
  CHECK(fault(w.gzip()) ==
        "a.spz: the file has axes number 9, which are not read; allowed: 1 to 8, x left or right, y up or down, z "
        "forward or back");
  w.extensions = record(0xADBE0001U, Bytes(10));
  CHECK(fault(w.gzip()) == "a.spz: the file's harmonics are quantised by an extension that is not read");
  w.extensions = {1, 2, 3};
  CHECK(fault(w.gzip()) == "a.spz: the record of an extension 0 bytes into them does not fit: 3 bytes are left");
  w.extensions = record(7, {1, 2});
  w.extensions[4] = 3;
  CHECK(fault(w.plain()) == "a.spz: the record of an extension 0 bytes into them does not fit: 10 bytes are left");
}

TEST_CASE("the flag of antialiasing is written where it is asked for") {
  const Gaussians g = plain_gaussians(3, 1);
  for (const int version : {2, 3, 4}) {
    CHECK(decode_spz(encode_spz(g, {.version = version, .antialiased = true}).bytes, "a.spz").report.antialiased);
    CHECK_FALSE(decode_spz(encode_spz(g, {.version = version}).bytes, "a.spz").report.antialiased);
  }
}

TEST_CASE("steps of positions that are wider than their Gaussian are counted") {
  Gaussians g = plain_gaussians(3, 0);
  g.log_scales = {-1, -5, -9, -5, -5, -5, -1, -1, -9};  // second longest: 6.7 mm, 6.7 mm, 0.37 m
  g.means[0] = 1e5F;                                    // leaves 6 fractional bits, 1.6 cm
  CHECK(encode_spz(g).losses == Counts{{"means in steps wider than their Gaussian", 2}});
}

TEST_CASE("Gaussians come back from .spz within its rounding") {
  for (const int version : {2, 3, 4}) {
    for (const int degree : {0, 1, 2, 3}) {
      INFO("version " << version << ", degree " << degree);
      const Gaussians g = plain_gaussians(300, degree);
      const EncodedSplats encoded = encode_spz(g, {.version = version});
      CHECK(encoded.losses.empty());
      const SplatFile file = decode_spz(encoded.bytes, "a.spz");
      CHECK(file.report.format == ".spz version " + std::to_string(version));
      CHECK(file.report.rejected == 0);
      CHECK(file.report.repairs.empty());
      CHECK(largest_difference(file.gaussians.means, g.means) <= std::ldexp(0.5, -20) + 1.3e-7);
      CHECK(largest_difference(file.gaussians.log_scales, g.log_scales) <= 1 / 32.0 + 1e-6);
      CHECK(largest_opacity_difference(file.gaussians, g) <= 1 / 510.0 + 1e-7);
      CHECK(largest_difference(dc_of(file.gaussians), dc_of(g)) <= 1 / 76.5 + 1e-6);
      CHECK(largest_difference(rest_of(file.gaussians), rest_of(g)) <= 1 / 256.0 + 1e-7);
      CHECK(largest_angle(file.gaussians, g) < (version == 2 ? 0.25 : 0.0049));
      const Bytes again = encode_spz(file.gaussians, {.version = version}).bytes;
      if (version > 2) CHECK(decode_spz(again, "a").gaussians.sh == file.gaussians.sh);
      CHECK(decode_spz(again, "a").gaussians.log_scales == file.gaussians.log_scales);
      CHECK(decode_spz(again, "a").gaussians.opacity_logits == file.gaussians.opacity_logits);
    }
  }
}

TEST_CASE("positions of .spz get the bits that the farthest one leaves") {
  Gaussians g = plain_gaussians(10, 0);
  g.origin_world = {0, 100, 0};
  const Gaussians back = decode_spz(encode_spz(g).bytes, "a").gaussians;
  for (std::size_t i = 0; i < g.means.size(); ++i) {
    const double world = static_cast<double>(g.means[i]) + (i % 3 == 1 ? 100 : 0);
    CHECK(std::fabs(static_cast<double>(back.means[i]) - world) <= std::ldexp(0.5, -16) + 1e-8 * 100);
  }
  CHECK_THROWS_WITH(encode_spz(g, {.fractional_bits = 20}),
                    Contains("m from the origin along an axis; with 20 fractional bits it may be at most 7.99"));
  g.origin_world = {0, 0, 1e8};
  CHECK_THROWS_AS(encode_spz(g), UserError);
}

TEST_CASE("fewer bits of harmonics pack smaller, and zero stays zero") {
  Gaussians g = plain_gaussians(300, 2);
  for (std::size_t i = 0; i < 200; ++i) g.sh[27 * i + 26] = 0;
  const SpzOptions coarse = {.sh1_bits = 5, .sh_rest_bits = 4};
  const Bytes file = encode_spz(g, coarse).bytes;
  CHECK(file.size() < encode_spz(g).bytes.size());
  const Gaussians back = decode_spz(file, "a").gaussians;
  double first = 0, rest = 0;
  for (std::size_t i = 0; i < g.sh.size(); ++i) {
    const double error = std::fabs(static_cast<double>(g.sh[i]) - static_cast<double>(back.sh[i]));
    if (i % 27 >= 12) rest = larger(rest, error);
    if (i % 27 >= 3 && i % 27 < 12) first = larger(first, error);
  }
  CHECK(first <= 1 / 32.0 + 1e-7);
  CHECK(rest <= 1 / 16.0 + 1e-7);
  CHECK(first > 1 / 128.0);
  CHECK(back.sh[26] == 0);
}

TEST_CASE("what .spz cannot hold is held at its ends and counted") {
  Gaussians g = plain_gaussians(2, 1);
  g.log_scales = {-20, 6, -10, 0, 0, 0};
  g.sh[0] = 4;
  g.sh[3] = -1.5F;
  g.sh[9] = 1;  // of x, which keeps its sign
  const EncodedSplats encoded = encode_spz(g);
  CHECK(counts_text(encoded.losses) ==
        "log-scales held within -10 to 5.94: 2, colours held within ±3.33: 1, harmonics held within -1 to 0.992: 2");
  const Gaussians back = decode_spz(encoded.bytes, "a").gaussians;
  CHECK(back.log_scales == std::vector<float>{-10, 5.9375F, -10, 0, 0, 0});
  CHECK_THROWS_WITH(encode_spz(g, {.version = 1}), ".spz: the version to write is 1; allowed: 2 to 4");
  CHECK_THROWS_WITH(encode_spz(g, {.sh1_bits = 9}),
                    ".spz: the number of bits of harmonics of degree 1 is 9; allowed: 1 to 8");
  g.quats[5] = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_WITH(encode_spz(g), "Gaussian 1 has a quaternion that is not finite, which a .spz file cannot hold");
  for (const int version : {2, 3, 4})
    CHECK(decode_spz(encode_spz(Gaussians{}, {.version = version}).bytes, "a").gaussians.count() == 0);
}

TEST_CASE("what is wrong with a .spz file is told") {
  Written w;
  CHECK(fault({}) == "a.spz: this is no .spz file: it has 0 bytes, its header alone has 16");
  Bytes file = w.plain();
  file[0] = 'X';
  CHECK(fault(file) == "a.spz: this is no .spz file: its content does not begin with \"NGSP\"");
  CHECK(fault(compress_gzip(file)) == "a.spz: this is no .spz file: its content does not begin with \"NGSP\"");
  w.version = 5;
  CHECK(fault(w.gzip()) == "a.spz: version 5 of .spz is not known; allowed: 1 to 4");
  w.version = 4;
  CHECK(fault(w.gzip()) == "a.spz: the gzip stream holds a .spz of version 4, which is not packed that way");
  w = {};
  w.bits = 25;
  CHECK(fault(w.gzip()) == "a.spz: 25 fractional bits of positions; allowed: 0 to 24");
  w = {};
  w.count = 4000000000;
  CHECK_THAT(fault(w.gzip()),
             Contains("a.spz: the header names 4000000000 Gaussians, which are 80000000000 bytes; a file of "));
  CHECK_THAT(fault(w.frames()),
             Contains("a.spz: the header names 4000000000 Gaussians, which are 80000000000 bytes; a file of "));
  CHECK(fault(w.plain()) ==
        "a.spz: the header names 4000000000 Gaussians, which are 80000000000 bytes; the file has 20 for them: it was "
        "cut short, or its header is wrong");
  w.count = 2;
  CHECK(fault(w.gzip()) == "a.spz: the gzip stream holds 36 bytes; 56 are needed");
  CHECK(fault(w.frames()) == "a.spz: positions: the table names 9 bytes; 2 Gaussians have 18");
  w = {};
  w.harmonics = {1};
  CHECK(fault(w.gzip()) == "a.spz: the gzip stream holds more than the 36 bytes that are needed");
  CHECK(fault(w.frames()) == "a.spz: the header names 6 frames; 1 Gaussians of degree 0 have 5");
  w = {};
  file = w.frames();
  file[16] = 200;
  CHECK_THAT(fault(file), Contains("a.spz: the table of lengths is said to be at byte 200 of a file of "));
  file[16] = 31;
  CHECK_THAT(fault(file), Contains("a.spz: the table of lengths is said to be at byte 31 of a file of "));
  file = w.frames();
  file[32] = 255;
  CHECK_THAT(fault(file),
             Contains("a.spz: positions: the frame at byte 112 is said to have 255 bytes; the file ends after "));
  file = w.frames();
  file.push_back(0);
  CHECK(fault(file) == "a.spz: 1 bytes are left over after the last frame");
  w.extensions = {1, 2, 3, 4};
  CHECK(fault(w.frames()) == "a.spz: 4 bytes lie before the table of lengths, but the header names no extensions");
}

TEST_CASE("a .spz file that was cut is refused") {
  const Gaussians g = plain_gaussians(5, 1);
  for (const int version : {2, 3, 4}) {
    const Bytes whole = encode_spz(g, {.version = version}).bytes;
    for (std::size_t size = 0; size < whole.size(); ++size)
      CHECK_THROWS_AS(decode_spz(std::span(whole).first(size), "a.spz"), DataError);
  }
}

}  // namespace io_spz_test
