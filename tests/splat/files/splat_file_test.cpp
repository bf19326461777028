#include "splat/files/splat_file.h"

#include <cmath>
#include <filesystem>
#include <set>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/text.h"
#include "splat/files/io_compressed_ply.h"
#include "splat/files/io_ply.h"
#include "splat/files/io_splat.h"
#include "stress/scratch_folder.h"
#include "tests/support/measures.h"
#include "tests/support/splat_files.h"

namespace splat_file_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

const std::string kShared = std::string(HSI4D_SOURCE_DIR) + "/../shared/data/splats/";

bool has_shared() {
  if (std::filesystem::exists(kShared)) return true;
  WARN("skipped: there is no " << kShared);
  return false;
}

std::string fault(const Bytes& file, const std::string& name) {
  try {
    decode_splats(file, name);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no fault";
}

}  // namespace

TEST_CASE("files of Gaussians are written by their ending and known by their content") {
  const ScratchFolder folder;
  const Gaussians g = plain_gaussians(50, 1);
  std::set<std::string> endings, told;
  for (const SplatFormat& format : splat_formats()) {
    INFO(format.ending);
    CHECK(endings.insert(format.ending).second);
    CHECK(has_splat_ending("a" + format.ending));
    const std::string path = folder / ("a" + format.ending);
    const Counts losses = write_splats(path, g);
    CHECK(losses.empty() == (format.sh_degree >= g.sh_degree));
    const SplatFile read = read_splats(path);
    CHECK(read.gaussians.count() == 50);
    CHECK(read.gaussians.sh_degree == written_sh_degree(path, g.sh_degree));
    CHECK(read.report.repairs.empty());
    CHECK(told.insert(read.report.format).second);
    if (!format.magic.empty()) {
      const std::string other = folder / "renamed.bin";
      std::filesystem::rename(path, other);
      CHECK(read_splats(other).report.format == read.report.format);
      CHECK((format.gzip || is_splat_file(other)));
    }
    for (const std::string& magic : format.magic) {
      CHECK((!magic.empty() && magic.size() <= 16));
      write_text_file(folder / "magic.bin", magic);
      CHECK(is_splat_file(folder / "magic.bin"));
    }
  }
  const std::vector<std::pair<std::string, std::string>> others = {{"A.COMPRESSED.PLY", "compressed PLY"},
                                                                   {"b.Spz", ".spz version 3"}};
  for (const auto& [name, format] : others) {
    CHECK(has_splat_ending(name));
    write_splats(folder / name, g);
    CHECK(read_splats(folder / name).report.format == format);
  }
  SplatWriteOptions options;
  options.spz.version = 4;
  write_splats(folder / "a.spz", g, options);
  CHECK(read_splats(folder / "a.spz").report.format == ".spz version 4");
  CHECK(same_numbers(decode_splats(encode_splats("a.ply", g).bytes, "a.ply").gaussians, g));
  CHECK_THROWS_WITH(write_splats(folder / "a.ksplat", g),
                    (folder / "a.ksplat") + ": Gaussians are not written to files of this ending; allowed: " +
                        joined(written_splat_endings()));
  CHECK_FALSE(has_splat_ending("a.png"));
}

TEST_CASE("formats of Gaussians are named in the order of their list") {
  CHECK(joined(splat_endings(), " or ") == ".ply, .splat or .spz");
  CHECK(joined(written_splat_endings()) == ".ply, .compressed.ply, .splat, .spz");
  CHECK(splat_formats_text() == ".ply (INRIA's and compressed), .splat, .spz");
  CHECK(splat_formats_text(" or ", " or ") == ".ply (INRIA's or compressed), .splat or .spz");
  CHECK(splat_type_name() == "F.{ply,splat,spz}");
}

TEST_CASE("a .splat whose first coordinate looks like gzip is still a .splat") {
  Gaussians g = plain_gaussians(2, 0);
  Bytes file = encode_splat(g).bytes;
  file[0] = 0x1f;
  file[1] = 0x8b;
  CHECK(decode_splats(file, "a.splat").report.format == ".splat");
}

TEST_CASE("files that are none of Gaussians are refused by name") {
  CHECK(fault({1, 2, 3}, "a.bin") ==
        "a.bin: is no file of Gaussians that is known; they are read from " + splat_formats_text());
  CHECK(fault({1, 2, 3}, "a.ksplat") == "a.ksplat: .ksplat files are not read; Gaussians are read from " +
                                            splat_formats_text() +
                                            ", into which the tool that wrote it can convert it");
  CHECK(fault({1, 2, 3}, "a.ply") == "a.ply: this is no PLY file: it does not begin with a line \"ply\"");
  CHECK_THAT(fault({1, 2, 3}, "a.spz"), Contains("a.spz: this is no .spz file"));
  CHECK_THAT(fault({1, 2, 3}, "a.splat"), Contains("a.splat: a .splat file has 32 bytes for each Gaussian"));
  CHECK_THAT(fault({}, "a.ply"), Contains("a.ply: this is no PLY file"));
  CHECK_THROWS_AS(read_splats("there/is/none.spz"), UserError);
}

TEST_CASE("the same three Gaussians of other tools' files agree within the formats' rounding") {
  if (!has_shared()) return;
  const Gaussians ply = read_splats(kShared + "formats/3pts.ply").gaussians;
  REQUIRE(ply.count() == 3);
  const SplatFile splat = read_splats(kShared + "formats/3pts.splat");
  CHECK(splat.report.format == ".splat");
  CHECK(splat.gaussians.means == ply.means);
  CHECK(largest_difference(splat.gaussians.log_scales, ply.log_scales) < 1e-5);
  CHECK(largest_opacity_difference(splat.gaussians, ply) < 1 / 255.0);  // that tool cuts, and does not round
  CHECK(largest_difference(splat.gaussians.sh, dc_of(ply)) * 0.28209479177387814 < 1 / 255.0 + 1e-6);
  CHECK(largest_angle(splat.gaussians, ply) < 0.03);
  const SplatFile spz = read_splats(kShared + "formats/3pts.spz");
  CHECK(spz.report.format == ".spz version 3");
  CHECK(largest_difference(spz.gaussians.means, ply.means) < 0.5 / 4096 + 1e-6);
  CHECK(largest_difference(spz.gaussians.log_scales, ply.log_scales) < 1 / 32.0 + 1e-6);
  CHECK(largest_opacity_difference(spz.gaussians, ply) < 1 / 510.0 + 1e-6);
  CHECK(largest_difference(dc_of(spz.gaussians), dc_of(ply)) < 1 / 76.5 + 1e-6);
  CHECK(largest_angle(spz.gaussians, ply) < 0.0049);
  CHECK(spz.gaussians.sh_degree == 3);
  CHECK(largest_difference(rest_of(spz.gaussians), rest_of(ply)) < 8.5 / 128 + 1e-6);  // rounded twice, to 4 bits
}

TEST_CASE("fixtures of other tools are read") {
  if (!has_shared()) return;
  const auto read = [](const std::string& name) { return read_splats(kShared + "formats/" + name); };
  for (const char* name : {"minimal-v3.spz", "minimal-v4.spz"}) {
    const SplatFile file = read(name);
    CHECK(file.gaussians.means == std::vector<float>{-1, 0, -1, 0, 0, -1, -1, 0, 0, 0, 0, 0});
    CHECK(file.gaussians.quats[0] == 1);
    CHECK(file.gaussians.log_scales[0] == -2.3125F);
    CHECK(summary_text(file.report).empty());
  }
  for (const char* name : {"minimal-v2.spz", "minimal-raw.spz"}) {
    const SplatFile file = read(name);
    CHECK(file.report.format == ".spz version 2");
    CHECK(file.gaussians.means == std::vector<float>{-1, 0, 1, 0, 0, 1, -1, 0, 0, 0, 0, 0});
  }
  CHECK(read("minimal.splat").gaussians.count() == 4);
  CHECK_THROWS_WITH(read("minimal.ksplat"), Contains(".ksplat files are not read"));
}

TEST_CASE("fixtures of other tools that were cut are refused at every length") {
  if (!has_shared()) return;
  for (const char* name : {"3pts.ply", "3pts.splat", "3pts.spz", "minimal-v2.spz", "minimal-v3.spz", "minimal-v4.spz",
                           "minimal-raw.spz", "minimal.splat"}) {
    INFO(name);
    const Bytes whole = read_file(kShared + "formats/" + name);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      INFO(size);
      const Bytes part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
      const bool shorter_splat = std::string(name).ends_with(".splat") && size % 32 == 0;  // which has no header
      if (shorter_splat) {
        CHECK(decode_splats(part, name).gaussians.count() == static_cast<Index>(size / 32));
      } else {
        CHECK_THROWS_AS(decode_splats(part, name), DataError);
      }
    }
  }
}

TEST_CASE("real scenes go through every format within its rounding") {
  if (!has_shared()) return;
  for (const char* name : {"playbot_scene_ground.ply", "playbot_object_robot.ply", "garden_sfm_init.ply"}) {
    INFO(name);
    const Gaussians g = read_splats(kShared + name).gaussians;
    double reach = 0;
    for (const float x : g.means) reach = std::max(reach, std::fabs(static_cast<double>(x)));
    const auto held = [&](const std::vector<float>& values, double least, double most) {
      std::vector<float> result = values;
      for (float& x : result) x = std::clamp(x, static_cast<float>(least), static_cast<float>(most));
      return result;
    };
    CHECK(same_numbers(decode_splats(encode_splats("a.ply", g).bytes, "a.ply").gaussians, g));

    for (const int version : {2, 3, 4}) {
      INFO("version " << version);
      const SplatFile spz = decode_spz(encode_spz(g, {.version = version}).bytes, "a.spz");
      REQUIRE(spz.gaussians.count() == g.count());
      CHECK(spz.report.repairs.empty());
      const double step = std::ldexp(1.0, static_cast<int>(std::ceil(std::log2(reach / 8388607))));
      CHECK(largest_difference(spz.gaussians.means, g.means) <= std::max(step, 1e-6) / 2 + 1e-7 * reach);
      CHECK(largest_difference(spz.gaussians.log_scales, held(g.log_scales, -10, 5.9375)) <= 1 / 32.0 + 1e-6);
      CHECK(largest_opacity_difference(spz.gaussians, g) <= 1 / 510.0 + 1e-6);
      CHECK(largest_difference(dc_of(spz.gaussians), held(dc_of(g), -10 / 3.0, 10 / 3.0)) <= 1 / 76.5 + 1e-6);
      CHECK(largest_difference(rest_of(spz.gaussians), held(rest_of(g), -1, 1)) <= 1 / 128.0 + 1e-6);
      CHECK(largest_angle(spz.gaussians, g) < (version == 2 ? 0.25 : 0.0049));
    }

    const SplatFile splat = decode_splat(encode_splat(g).bytes, "a.splat");
    REQUIRE(splat.gaussians.count() == g.count());
    CHECK(splat.gaussians.means == g.means);
    CHECK(largest_difference(splat.gaussians.log_scales, g.log_scales) < 1e-5);
    CHECK(largest_opacity_difference(splat.gaussians, g) <= 1 / 510.0 + 1e-6);
    const double most = 0.5 / 0.28209479177387814;
    CHECK(largest_difference(splat.gaussians.sh, held(dc_of(g), -most, most)) * 0.28209479177387814 <=
          1 / 510.0 + 1e-6);
    CHECK(largest_angle(splat.gaussians, g) < 0.025);

    const SplatFile packed = decode_ply(encode_compressed_ply(g).bytes, "a.compressed.ply");
    REQUIRE(packed.gaussians.count() == g.count());
    const Gaussians expected = selected(g, compressed_ply_order(g));
    for (Index begin = 0; begin < g.count(); begin += 256) {  // each chunk within half a level of its own extent
      const Index end = std::min(g.count(), begin + 256);
      for (Index c = 0; c < 3; ++c) {
        float least = INFINITY, greatest = -INFINITY;
        double error = 0;
        for (Index n = begin; n < end; ++n) {
          const auto i = static_cast<std::size_t>(3 * n + c);
          least = std::min(least, expected.means[i]);
          greatest = std::max(greatest, expected.means[i]);
          error = larger(error, std::fabs(static_cast<double>(expected.means[i]) -
                                          static_cast<double>(packed.gaussians.means[i])));
        }
        const double levels = c == 1 ? 1023 : 2047;
        REQUIRE(error <= static_cast<double>(greatest - least) / levels / 2 + 1e-6 * reach);
      }
    }
    CHECK(largest_opacity_difference(packed.gaussians, expected) <= 1 / 510.0 + 1e-6);
    CHECK(largest_difference(rest_of(packed.gaussians), held(rest_of(expected), -4, 4)) <= 1 / 64.0 + 1e-6);
    CHECK(largest_angle(packed.gaussians, expected) < 0.0049);
  }
}

}  // namespace splat_file_test
