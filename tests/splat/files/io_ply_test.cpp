#include "splat/files/io_ply.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <random>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "stress/scratch_folder.h"

namespace io_ply_test {

using namespace hsi4d;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;

namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Gaussians random_gaussians(Index n, int degree) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> number(-2, 2);
  Gaussians g;
  g.sh_degree = degree;
  const auto fill = [&](std::vector<float>& values, Index count) {
    for (Index i = 0; i < count; ++i) values.push_back(number(random));
  };
  fill(g.means, 3 * n);
  fill(g.quats, 4 * n);
  fill(g.log_scales, 3 * n);
  fill(g.opacity_logits, n);
  fill(g.sh, 3 * n * g.sh_coefficients());
  return g;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}

void check_same(const Gaussians& a, const Gaussians& b) {
  CHECK(a.sh_degree == b.sh_degree);
  CHECK(same_bits(a.means, b.means));
  CHECK(same_bits(a.quats, b.quats));
  CHECK(same_bits(a.log_scales, b.log_scales));
  CHECK(same_bits(a.opacity_logits, b.opacity_logits));
  CHECK(same_bits(a.sh, b.sh));
}

const std::vector<std::string>& least_names() {
  static const std::vector<std::string> names = {"x",     "y",     "z",     "scale_0", "scale_1", "scale_2", "rot_0",
                                                 "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0",  "f_dc_1",  "f_dc_2"};
  return names;
}

/// A PLY file of one vertex element, written property by property.
std::string ply_text(const std::string& format, Index rows, const std::vector<std::string>& properties,
                     const std::string& data) {
  std::string text = "ply\nformat " + format + " 1.0\nelement vertex " + std::to_string(rows) + "\n";
  for (const std::string& property : properties) text += "property " + property + "\n";
  return text + "end_header\n" + data;
}

std::vector<std::string> floats(std::vector<std::string> names) {
  for (std::string& name : names) name.insert(0, "float ");
  return names;
}

SplatFile decode(const std::string& text) {
  return decode_ply({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "a.ply");
}

std::string fault(const std::string& text) {
  try {
    decode(text);
  } catch (const DataError& error) {
    return error.what();
  }
  return "no fault";
}

const std::string kRow = "1 2 3 -1 -2 -3 1 0 0 0 0.5 0.1 0.2 0.3\n";

}  // namespace

TEST_CASE("Gaussians are written to PLY and read back bitwise") {
  const ScratchFolder folder;
  for (int degree = 0; degree <= 3; ++degree) {
    Gaussians g = random_gaussians(17, degree);
    g.means[0] = -0.0F;
    g.means[1] = 1e-42F;  // a denormal
    g.sh[0] = 3e38F;
    write_ply(folder / "g.ply", g);
    const SplatFile scene = read_ply(folder / "g.ply");
    check_same(scene.gaussians, g);
    CHECK(scene.gaussians.origin_world == Vector3<double>::Zero());
    CHECK(scene.report.rows == 17);
    CHECK(scene.report.rejected == 0);
    CHECK(scene.report.repairs.empty());
    CHECK(summary_text(scene.report).empty());
    for (Index n = 0; n < 17; ++n) CHECK(scene.report.row_of[static_cast<std::size_t>(n)] == n);
  }
  write_ply(folder / "none.ply", Gaussians{});
  CHECK(read_ply(folder / "none.ply").gaussians.count() == 0);
}

TEST_CASE("Mip-Splatting's filter_3D is fused as its authors do") {
  // By Python: s' = sqrt(exp(s)² + f²); the opacity times sqrt(Π exp(s)² / Π s'²), as a logit.
  std::vector<std::string> names = least_names();
  names.push_back("filter_3D");
  const std::string row = "1 2 3 -1 -2 -3 1 0 0 0 OPACITY 0.1 0.2 0.3 FILTER\n";
  const auto read = [&](const std::string& opacity, const std::string& filter) {
    std::string one = row;
    one.replace(one.find("OPACITY"), 7, opacity).replace(one.find("FILTER"), 6, filter);
    return decode(ply_text("ascii", 1, floats(names), one));
  };
  const SplatFile fused = read("0.5", "0.2");
  CHECK(fused.gaussians.log_scales[0] == Approx(-0.8705276169265054).margin(1e-7));
  CHECK(fused.gaussians.log_scales[1] == Approx(-1.4209424865387899).margin(1e-7));
  CHECK(fused.gaussians.log_scales[2] == Approx(-1.5793756384260749).margin(1e-7));
  CHECK(fused.gaussians.opacity_logits[0] == Approx(-2.5263135130329477).margin(1e-6));
  CHECK(fused.report.antialiased);
  CHECK(fused.report.cautions.empty());
  CHECK(fused.report.notes.size() == 1);
  const SplatFile none = read("0.5", "0");
  CHECK(none.gaussians.log_scales == std::vector<float>{-1, -2, -3});
  CHECK(none.gaussians.opacity_logits == std::vector<float>{0.5F});
  CHECK(read("19", "0.2").gaussians.opacity_logits[0] == Approx(-2.0025271628).margin(1e-5));
  CHECK(read("inf", "0.2").gaussians.opacity_logits[0] == Approx(-2.00252715644).margin(1e-5));
  CHECK(read("-17", "0.2").gaussians.opacity_logits[0] == Approx(-19.1291542946).margin(1e-5));
  CHECK(read("0.5", "nan").report.rejections == Counts{{"a scale that is not finite", 1}});
  CHECK(fault("ply\nformat ascii 1.0\nelement vertex 0\n" +
              [&] {
                std::string text;
                for (const std::string& name : floats(least_names())) text += "property " + name + "\n";
                return text;
              }() +
              "property list uchar float filter_3D\nend_header\n") ==
        "a.ply: property \"filter_3D\" is a list; it must be one number");
}

TEST_CASE("properties and elements that are not known are named") {
  std::vector<std::string> names = least_names();
  for (const char* more : {"nx", "ny", "nz", "segment", "motion_0"}) names.emplace_back(more);
  std::string text = ply_text("ascii", 1, floats(names), kRow.substr(0, kRow.size() - 1) + " 0 0 0 7 0.5\n3\n");
  text.insert(text.find("end_header"), "element color_space 1\nproperty uchar id\n");
  const SplatFile read = decode(text);
  CHECK(read.report.cautions ==
        std::vector<std::string>{"not known, and passed over, though the picture may depend on it: vertex.segment, "
                                 "vertex.motion_0, element color_space"});
  CHECK(read.gaussians.count() == 1);
}

TEST_CASE("means in doubles lose no digit to an origin, and are warned of without one") {
  std::vector<std::string> properties = floats(least_names());
  for (std::size_t c = 0; c < 3; ++c) properties[c].replace(0, 5, "double");
  const std::string rest = " -4 -4 -9 1 0 0 0 0.5 0.1 0.2 0.3\n";
  const std::string text = ply_text("ascii", 2, properties,
                                    "431250.1234567 5411873.7654321 12.5" + rest + "431251.5 5411872.25 11.5" + rest);
  const auto bytes = std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  const SplatFile near = decode_ply(bytes, "a.ply", {431250, 5411873, 0});
  CHECK(near.gaussians.origin_world == Vector3<double>(431250, 5411873, 0));
  CHECK(near.gaussians.means[0] == static_cast<float>(431250.1234567 - 431250));
  CHECK(near.gaussians.means[1] == static_cast<float>(5411873.7654321 - 5411873));
  CHECK(near.gaussians.means[4] == -0.75F);
  CHECK(near.report.cautions.empty());
  // Floats are half a metre apart there; the Gaussians are exp(-4) = 1.8 cm wide.
  CHECK(decode_ply(bytes, "a.ply").report.cautions ==
        std::vector<std::string>{"2 of 2 Gaussians are narrower than the steps, up to 0.5 m, that floats have where "
                                 "their means are; `hsi4d convert --translate -431251,-5411873,-12` brings them near "
                                 "the origin, by the file's own digits"});
}

TEST_CASE("an origin is added to the means that are written") {
  Gaussians g = random_gaussians(1, 0);
  g.means = {0.25F, -1, 3};
  g.origin_world = {100, 0, -1000};
  CHECK(decode_ply(encode_ply(g), "a.ply").gaussians.means == std::vector<float>{100.25F, -1, -997});
}

TEST_CASE("harmonics are in INRIA's order: f_rest_ counts through one channel after the other") {
  std::vector<std::string> names = least_names();
  std::string row = kRow.substr(0, kRow.size() - 1);
  for (int i = 0; i < 24; ++i) {
    names.push_back("f_rest_" + std::to_string(i));
    row += " " + std::to_string(i);
  }
  const Gaussians g = decode(ply_text("ascii", 1, floats(names), row)).gaussians;
  CHECK(g.sh_degree == 2);
  CHECK(g.sh[0] == 0.1F);
  CHECK(g.sh[2] == 0.3F);
  for (int k = 1; k < 9; ++k) {
    for (int c = 0; c < 3; ++c) CHECK(g.sh[static_cast<std::size_t>(3 * k + c)] == static_cast<float>(8 * c + k - 1));
  }
  // And so they are written: f_rest_0 is the first number after f_dc_2 (9 floats into the row).
  const std::vector<std::uint8_t> file = encode_ply(g);
  std::array<float, 62> values{};
  constexpr std::size_t kFloats = 9 + 24 + 8;
  std::memcpy(values.data(), file.data() + file.size() - 4 * kFloats, 4 * kFloats);
  CHECK(values[0] == 1);
  CHECK(values[3] == 0);
  for (std::size_t i = 0; i < 24; ++i) CHECK(values[9 + i] == static_cast<float>(i));
  CHECK(values[33] == 0.5F);  // opacity
  CHECK(values[34] == -1);    // scale_0
  CHECK(values[37] == 1);     // rot_0
}

TEST_CASE("properties may come in any order and type, and others are passed over") {
  const Gaussians expected = decode(ply_text("ascii", 1, floats(least_names()), kRow)).gaussians;
  std::string text =
      "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nobj_info more\r\nelement face 2\r\nproperty list uchar int v\r\n"
      "element vertex 1\r\nproperty list uint float extra\r\nproperty uchar red\r\n";
  for (const char* name : {"rot_3", "rot_2", "rot_1", "rot_0"}) text += "property char " + std::string(name) + "\r\n";
  for (const char* name : {"z", "y", "x"}) text += "property double " + std::string(name) + "\r\n";
  for (const char* name : {"f_dc_2", "f_dc_1", "f_dc_0", "opacity", "scale_2", "scale_1", "scale_0"})
    text += "property float32 " + std::string(name) + "\r\n";
  text +=
      "element end 1\r\nproperty int a\r\nend_header\r\n3 0 1 2\r\n0\r\n2 7 7 255 0 0 0 1 3 2 +1 0.3 0.2 0.1 0.5 -3 -2 "
      "-1\r\n9\r\n";
  check_same(decode(text).gaussians, expected);
}

TEST_CASE("both byte orders are read, every number type") {
  const std::vector<std::string> properties = {
      "double x",   "float y",    "short z",     "char scale_0",  "uchar scale_1",  "ushort scale_2", "int rot_0",
      "uint rot_1", "int8 rot_2", "uint8 rot_3", "int16 opacity", "float64 f_dc_0", "float32 f_dc_1", "uint32 f_dc_2"};
  for (const bool big : {false, true}) {
    std::string data;
    const auto add = [&](auto value) {
      std::array<char, sizeof(value)> raw;
      std::memcpy(raw.data(), &value, sizeof(value));
      if (big) std::reverse(raw.begin(), raw.end());
      data.append(raw.data(), raw.size());
    };
    add(1.5);
    add(2.25F);
    add(std::int16_t{-300});
    add(std::int8_t{-7});
    add(std::uint8_t{3});
    add(std::uint16_t{9});
    add(std::int32_t{-70000});
    add(std::uint32_t{70000});
    add(std::int8_t{-1});
    add(std::uint8_t{255});
    add(std::int16_t{-2});
    add(0.125);
    add(-0.5F);
    add(std::uint32_t{4});
    const Gaussians g =
        decode(ply_text(big ? "binary_big_endian" : "binary_little_endian", 1, properties, data)).gaussians;
    CHECK(g.means == std::vector<float>{1.5F, 2.25F, -300});
    CHECK(g.log_scales == std::vector<float>{-7, 3, 9});
    CHECK(g.quats == std::vector<float>{-70000, 70000, -1, 255});
    CHECK(g.opacity_logits == std::vector<float>{-2});
    CHECK(g.sh == std::vector<float>{0.125F, -0.5F, 4});
  }
}

TEST_CASE("rows that cannot be used are left out and counted, the others know their row") {
  Gaussians g = random_gaussians(12, 1);
  g.means[3 * 1] = kNan;
  g.means[3 * 2 + 2] = -kInf;
  g.log_scales[3 * 3 + 1] = -kInf;
  g.quats[4 * 4 + 3] = kInf;
  for (std::size_t i = 0; i < 4; ++i) g.quats[4 * 5 + i] = 0;
  for (std::size_t i = 0; i < 4; ++i) g.quats[4 * 6 + i] = 1e-45F;
  g.opacity_logits[7] = kNan;
  g.sh[12 * 8 + 11] = kNan;
  g.sh[12 * 9] = kInf;
  g.means[3 * 9] = kInf;  // counts once, under its first reason
  const SplatFile scene = decode_ply(encode_ply(g), "a.ply");
  CHECK(scene.report.rows == 12);
  CHECK(scene.report.rejected == 9);
  CHECK(scene.report.row_of == std::vector<Index>{0, 10, 11});
  CHECK(scene.gaussians.count() == 3);
  check_sizes(scene.gaussians);
  CHECK(scene.gaussians.means[3] == g.means[30]);
  CHECK(scene.gaussians.sh[12 + 5] == g.sh[120 + 5]);
  CHECK(
      summary_text(scene.report) ==
      "9 of 12 Gaussians are left out (a mean that is not finite: 3, a scale that is not finite: 1, a quaternion that "
      "is not finite: 1, a quaternion that is zero: 2, an opacity that is no number: 1, a colour that is not finite: "
      "1)");
}

TEST_CASE("exponents that would overflow are held and counted") {
  Gaussians g = random_gaussians(5, 0);
  g.opacity_logits = {kInf, -kInf, 20, 20.5F, -110};
  g.log_scales[0] = -37;
  g.log_scales[1] = -20;
  g.log_scales[2] = 88;
  const SplatFile scene = decode_ply(encode_ply(g), "a.ply");
  CHECK(scene.gaussians.count() == 5);
  CHECK(scene.gaussians.opacity_logits == std::vector<float>{20, -20, 20, 20, -20});
  CHECK(scene.gaussians.log_scales[0] == -20);
  CHECK(scene.gaussians.log_scales[1] == -20);
  CHECK(scene.gaussians.log_scales[2] == 20);
  CHECK(summary_text(scene.report) == "log-scales held within ±20: 2, opacity logits held within ±20: 4");
  CHECK(scene.report.held_log_scales == std::vector<Index>{0, 2});
  CHECK(scene.report.held_opacity_logits == std::vector<Index>{0, 1, 3, 4});
  g.means[3] = kInf;  // the second row is left out: places are those of what is kept
  CHECK(decode_ply(encode_ply(g), "a.ply").report.held_opacity_logits == std::vector<Index>{0, 2, 3});
}

TEST_CASE("what is wrong with a PLY file is told to the letter") {
  const std::vector<std::string> least = floats(least_names());
  CHECK(fault(ply_text("ascii", 1, least, kRow)) == "no fault");
  CHECK(fault("plywood") == "a.ply: this is no PLY file: it does not begin with a line \"ply\"");
  CHECK(fault("ply\nformat ascii 1.0\n") == "a.ply: the header does not end: there is no \"end_header\"");
  CHECK(fault("ply\nend_header\n") == "a.ply:2: the header has no line \"format\"");
  CHECK(fault(ply_text("binary", 1, least, kRow)) ==
        "a.ply:2: format \"binary\" is not known; allowed: binary_little_endian, binary_big_endian, ascii");
  CHECK(fault("ply\nformat ascii 2.0\nend_header\n") == "a.ply:2: version \"2.0\" of PLY is not known; allowed: 1.0");
  CHECK(fault("ply\nformat ascii 1.0\nelement vertex -1\nend_header\n") ==
        "a.ply:3: \"-1\" is no number of rows; allowed: 0 to 9223372036854775807");
  CHECK(fault("ply\nformat ascii 1.0\nproperty float x\nend_header\n") ==
        "a.ply:3: a property before the first element");
  CHECK(fault("ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\nend_header\n") ==
        "a.ply:4: type \"half\" is not known; allowed: char, uchar, short, ushort, int, uint, float, double");
  CHECK(fault("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float x\nend_header\n") ==
        "a.ply:5: a second property \"x\"");
  CHECK(fault("ply\nformat ascii 1.0\nelement face 1\nproperty float x\nend_header\n1\n") ==
        "a.ply: there is no element \"vertex\"; a file of Gaussians has one");
  CHECK(fault("ply\nformat ascii 1.0\nwhat is this\nend_header\n") ==
        "a.ply:3: \"what is this\" is no line of a PLY header");
  std::vector<std::string> fewer = least;
  fewer.pop_back();
  fewer.erase(fewer.begin());
  CHECK(fault(ply_text("ascii", 1, fewer, kRow)) ==
        "a.ply: element \"vertex\" has no property x, f_dc_2; a file of Gaussians has x, y, z, f_dc_0 to 2, opacity, "
        "scale_0 to 2, rot_0 to 3");
  std::vector<std::string> more = least;
  for (int i = 0; i < 12; ++i) more.push_back("float f_rest_" + std::to_string(i));
  CHECK(fault(ply_text("ascii", 0, more, "")) ==
        "a.ply: there are 12 properties f_rest_; allowed: 0, 9, 24, 45 or 72 (spherical harmonics of degree 0 to 4)");
  more.resize(least.size());
  for (int i = 1; i < 10; ++i) more.push_back("float f_rest_" + std::to_string(i));
  CHECK_THAT(fault(ply_text("ascii", 0, more, "")), Contains("has no property f_rest_0;"));
  std::vector<std::string> listed = least;
  listed[0] = "list uchar float x";
  CHECK(fault(ply_text("ascii", 1, listed, "1 " + kRow)) == "a.ply: property \"x\" is a list; it must be one number");
  CHECK(fault(ply_text("ascii", 1, least, "1 2 3 -1 -2 -3 1 0 0 zero 0.5 0.1 0.2 0.3\n")) ==
        "a.ply: element \"vertex\", row 0 (byte 367): \"zero\" is no number that a double can hold");
  CHECK(fault(ply_text("ascii", 1, least, kRow + "4\n")) ==
        "a.ply: 2 bytes are left over after the last row: the header's counts are wrong, or the file is damaged");
}

TEST_CASE("a file with more or fewer bytes than its header needs is refused before memory is taken") {
  const std::vector<std::uint8_t> whole = encode_ply(random_gaussians(10, 0));
  for (std::size_t size = 0; size < whole.size(); ++size)
    CHECK_THROWS_AS(decode_ply(std::span(whole).first(size), "a.ply"), DataError);
  std::vector<std::uint8_t> longer = whole;
  longer.push_back(0);
  CHECK_THROWS_MATCHES(decode_ply(longer, "a.ply"), DataError,
                       Message("a.ply: 1 bytes are left over after the last row: the header's counts are wrong, or the "
                               "file is damaged"));
  const std::string header = ply_text("binary_little_endian", 2000000000000000000, floats(least_names()), "abc");
  CHECK(fault(header) ==
        "a.ply: element \"vertex\" has 2000000000000000000 rows of 56 bytes, but the file has only 3 bytes for them: "
        "it was cut short, or its header is wrong");
}

TEST_CASE("every byte of a small file flipped gives an error or a checked scene") {
  const std::vector<std::uint8_t> whole = encode_ply(random_gaussians(10, 1));
  int taken = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const int mask : {0xff, 0x80, 0x01}) {
      std::vector<std::uint8_t> damaged = whole;
      damaged[at] = static_cast<std::uint8_t>(damaged[at] ^ mask);
      try {
        const SplatFile scene = decode_ply(damaged, "a.ply");
        check_sizes(scene.gaussians);
        REQUIRE(scene.gaussians.count() + scene.report.rejected == 10);
        ++taken;
      } catch (const DataError&) {
      }
    }
  }
  CHECK(taken > 1000);  // the data's bytes; the header's are refused
}

TEST_CASE("lists that claim more than the file holds are refused") {
  std::vector<std::string> properties = floats(least_names());
  properties.push_back("list uint double big");
  std::string data(14 * 4, '\0');
  data += std::string("\xff\xff\xff\xff", 4);
  CHECK_THAT(fault(ply_text("binary_little_endian", 1, properties, data)),
             Contains("property \"big\" has a list of 4294967295 numbers; the file has 0 bytes left"));
  properties.back() = "list char double big";
  data.resize(14 * 4);
  data += '\xff';
  CHECK_THAT(fault(ply_text("binary_little_endian", 1, properties, data)), Contains("has a list of -1 numbers"));
  properties.back() = "list int float big";
  CHECK_THAT(fault(ply_text("ascii", 1, properties, kRow + "nan")), Contains("has a list of nan numbers"));
  properties.back() = "list float float big";
  CHECK_THAT(fault(ply_text("ascii", 1, properties, kRow + "0")),
             Contains("the length of a list is \"float\"; allowed: a type of whole numbers"));
}

TEST_CASE("what trainers write in comments of how their Gaussians are drawn is read") {
  const std::vector<std::uint8_t> plain = encode_ply(random_gaussians(10, 1));
  const auto report = [&plain](const std::string& comment) {
    std::string text(plain.begin(), plain.end());
    text.insert(text.find("element vertex"), "comment " + comment + "\n");
    return decode_ply(std::vector<std::uint8_t>(text.begin(), text.end()), "a.ply").report;
  };
  CHECK(report("SplatRenderMode: mip").antialiased);
  CHECK(report("antialiased 1").antialiased);
  CHECK_FALSE(report("SplatRenderMode: default").antialiased);
  CHECK(report("").notes.empty());
  CHECK(report("Vertical axis: y").notes == std::vector<std::string>{"its up axis is y, by a comment; here it is z"});
  CHECK(report("Vertical axis: z").notes.empty());
}

TEST_CASE("real scenes are read whole") {
  const std::string folder = std::string(HSI4D_SOURCE_DIR) + "/../shared/data/splats";
  if (!std::filesystem::exists(folder)) {
    WARN("skipped: there is no " << folder);
    return;
  }
  struct Known {
    const char* file;
    Index count;
    int degree;
  };
  for (const Known& known : {Known{"playbot_scene_ground.ply", 104575, 2}, Known{"playbot_object_robot.ply", 20425, 3},
                             Known{"garden_sfm_init.ply", 138766, 0}, Known{"formats/3pts.ply", 3, 3}}) {
    INFO(known.file);
    const SplatFile scene = read_ply(folder + "/" + known.file);
    check_sizes(scene.gaussians);
    CHECK(scene.report.rows == known.count);
    CHECK(scene.gaussians.count() == known.count);
    CHECK(scene.gaussians.sh_degree == known.degree);
    check_same(decode_ply(encode_ply(scene.gaussians), "again").gaussians, scene.gaussians);
    UNSCOPED_INFO(summary_text(scene.report));
  }
}

}  // namespace io_ply_test
