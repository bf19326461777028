#include "core/npz.h"

#include <filesystem>
#include <iostream>
#include <numeric>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "stress/scratch_folder.h"
#include "tests/support/zip_archive.h"

namespace npz_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Contains;

namespace {

Bytes floats(std::initializer_list<float> values) {
  const int64_t count = std::ssize(values);
  return encode_npy(std::span(&count, 1), std::span<const float>(values.begin(), values.size()));
}

NpzWriter example() {
  NpzWriter writer;
  writer.add<float>("weights", {2, 3}, {1, 2, 3, 4, 5, 6});
  writer.add<int64_t>("kintree_table", {2}, {4294967295, 0});
  writer.add_scalar("mocap_framerate", 59.94);
  writer.add_text("gender", "neutral");
  writer.add_texts("names", std::vector<std::string>{"left hand", "\xc3\xa4"});
  writer.add<double>("empty", {0, 3}, {});
  return writer;
}

std::string error_of(const std::vector<ZipMember>& members) {
  try {
    Npz::decode(archive_of(members, false), "a.npz");
  } catch (const DataError& error) {
    return error.what();
  }
  return "none";
}

std::string member_name(int i) {
  std::string name = "x";
  name += std::to_string(i);
  return name;
}

/// The file if this checkout has it beside it; says so when not.
std::string shared_file(const std::string& name) {
  const std::string path = std::string(HSI4D_SOURCE_DIR) + "/../shared/data/" + name;
  if (std::filesystem::exists(path)) return path;
  WARN("skipped: there is no " << path);
  return "";
}

}  // namespace

TEST_CASE("an archive comes back as it was written") {
  for (const NpzPacking packing : {NpzPacking::stored, NpzPacking::deflated}) {
    const Npz npz = Npz::decode(example().encode(packing), "a.npz");
    CHECK(npz.names() ==
          std::vector<std::string>{"weights", "kintree_table", "mocap_framerate", "gender", "names", "empty"});
    CHECK(npz.skipped().empty());
    CHECK(npz.array("weights").require_shape({-1, 3}).as<double>() == std::vector<double>{1, 2, 3, 4, 5, 6});
    CHECK(npz.array("kintree_table").as<int64_t>() == std::vector<int64_t>{4294967295, 0});
    CHECK(npz.array("mocap_framerate").scalar<double>() == 59.94);
    CHECK(npz.array("gender").text() == "neutral");
    CHECK(npz.array("names").strings() == std::vector<std::string>{"left hand", "\xc3\xa4"});
    CHECK(npz.array("empty").shape() == std::vector<int64_t>{0, 3});
    CHECK(npz.has("weights"));
    CHECK_FALSE(npz.has("weight"));
  }
}

TEST_CASE("asking for an absent array or a wrong shape names file and array") {
  const Npz npz = Npz::decode(example().encode(), "a.npz");
  CHECK_THROWS_WITH(npz.array("weight"),
                    "a.npz: has no array 'weight'; there are: weights, kintree_table, mocap_framerate, gender, names, "
                    "empty");
  CHECK_THROWS_WITH(npz.array("weights").require_shape({-1, 55}),
                    "a.npz: array 'weights': has shape [2,3]; [*,55] is needed");
  CHECK_THROWS_WITH(npz.array("gender").as<float>(),
                    "a.npz: array 'gender': holds text (dtype '<U7'); numbers are needed");
  CHECK_THROWS_WITH(Npz::decode(NpzWriter().encode(), "e.npz").array("x"), "e.npz: has no array 'x'; there are: none");
}

TEST_CASE("equal arrays give equal files, in memory and on disk") {
  const ScratchFolder folder;
  for (const NpzPacking packing : {NpzPacking::stored, NpzPacking::deflated}) {
    example().write(folder / "a.npz", packing);
    CHECK(read_file(folder / "a.npz") == example().encode(packing));
    CHECK(Npz::read(folder / "a.npz").array("weights").size() == 6);
  }
  NpzWriter().write(folder / "empty.npz");
  CHECK(Npz::read(folder / "empty.npz").names().empty());
  CHECK(folder.count() == 2);
  write_text_file(folder / "plain", "");
  CHECK(std::filesystem::status(folder / "a.npz").permissions() ==
        std::filesystem::status(folder / "plain").permissions());
  CHECK_THROWS_WITH(example().write(folder / "plain/a.npz"),
                    Contains("plain/a.npz: cannot be written: Not a directory"));
  CHECK_THROWS_AS(Npz::read(folder / "absent.npz"), UserError);
}

TEST_CASE("stored files are plain zip members dated 1980") {
  ZipMember member{"x.npy", floats({1, 2})};
  NpzWriter writer;
  writer.add<float>("x", {2}, {1, 2});
  const Bytes file = writer.encode();
  const Bytes by_hand = archive_of({member}, false);
  // From the method on, the local headers agree: date, checksum, sizes, name, data.
  REQUIRE(file.size() == by_hand.size());
  CHECK(Bytes(file.begin() + 8, file.begin() + 30 + 5 + 136) ==
        Bytes(by_hand.begin() + 8, by_hand.begin() + 30 + 5 + 136));
}

TEST_CASE("names that cannot be are a bug of the caller") {
  NpzWriter writer;
  writer.add_scalar("x", 1.0);
  CHECK_THROWS_WITH(writer.add_scalar("x", 2.0), Contains("array 'x' is there twice"));
  CHECK_THROWS_WITH(writer.add_text("", "a"), Contains("array name ''"));
  CHECK_THROWS_WITH(writer.add<float>("y", {2, 2}, {1, 2, 3}), Contains("shape [2,2] for 3 values"));
  CHECK(Npz::decode(writer.encode(), "a.npz").array("x").scalar<double>() == 1);
}

TEST_CASE("zip64 archives are read") {
  const std::vector<ZipMember> members = {{.name = "x.npy", .content = floats({1, 2}), .zip64 = true},
                                          {.name = "y.npy", .content = floats({3}), .zip64 = true}};
  for (const bool zip64_end : {false, true}) {
    const Npz npz = Npz::decode(archive_of(members, zip64_end), "a.npz");
    CHECK(npz.array("x").as<float>() == std::vector<float>{1, 2});
    CHECK(npz.array("y").as<float>() == std::vector<float>{3});
  }
}

TEST_CASE("what is not an array is skipped and said") {
  const Npz npz = Npz::decode(
      archive_of({{"joint2num.npy", pickled_npy()}, {"x.npy", floats({1})}, {"readme.txt", {'h', 'i'}}}, false),
      "a.npz");
  CHECK(npz.names() == std::vector<std::string>{"x"});
  REQUIRE(npz.skipped().size() == 2);
  CHECK(npz.skipped()[0].name == "joint2num");
  CHECK(npz.skipped()[0].reason == "holds Python objects (dtype '|O'), which are not unpickled");
  CHECK(npz.skipped()[1].reason == "is no .npy member");
  CHECK_FALSE(npz.has("joint2num"));
  CHECK_THROWS_WITH(npz.array("joint2num"),
                    "a.npz: array 'joint2num': holds Python objects (dtype '|O'), which are not unpickled");
}

TEST_CASE("archives that lie are errors") {
  const Bytes content = floats({1, 2, 3});  // 140 bytes
  CHECK(error_of({{"x.npy", content}, {"x.npy", content}}) == "a.npz: holds 'x.npy' twice");
  CHECK(error_of({{.name = "x.npy", .content = content, .flags = 1}}) ==
        "a.npz: array 'x': is encrypted, which is not read");
  CHECK(error_of({{.name = "x.npy", .content = content, .method = 12}}) ==
        "a.npz: array 'x': is packed by method 12; stored and deflated members are read");
  CHECK_THAT(error_of({{.name = "x.npy", .content = content, .claimed_size = 1 << 30}}),
             Contains("a.npz: array 'x': claims 1073741824 bytes packed as 140 in a file of "));
  CHECK_THAT(error_of({{.name = "x.npy", .content = content, .claimed_size = 1 << 30, .claimed_packed = 1 << 30}}),
             Contains("a.npz: array 'x': claims 1073741824 bytes packed as 1073741824 in a file of "));
  CHECK_THAT(error_of({{.name = "x.npy", .content = content, .method = 8, .claimed_size = 140}}),
             Contains("a.npz: array 'x': cannot be unpacked: "));
  CHECK_THAT(error_of({{.name = "x.npy", .content = content, .claimed_size = 139}}), Contains("a.npz: array 'x': "));
  CHECK(error_of({{"x.npy", Bytes(content.begin(), content.end() - 1)}}) ==
        "a.npz: array 'x': shape [3] of '<f4' needs 12 bytes, but 11 are there (truncated)");
  CHECK(error_of({{"x.npy", {'a'}}}) == "a.npz: array 'x': is not an npy file");
}

TEST_CASE("damage is noticed by the checksum, truncation by the directory") {
  NpzWriter writer;
  writer.add<float>("x", {3}, {1, 2, 3});
  for (const NpzPacking packing : {NpzPacking::stored, NpzPacking::deflated}) {
    Bytes file = writer.encode(packing);
    CHECK_THROWS_WITH(Npz::decode(std::span(file.data(), file.size() / 2), "a.npz"),
                      Contains("a.npz: cannot be read as a zip archive: "));
    file[30 + 5 + (packing == NpzPacking::stored ? 135 : 30)] ^= 1;
    CHECK_THROWS_WITH(Npz::decode(file, "a.npz"), Contains("a.npz: array 'x': cannot be unpacked: "));
  }
  CHECK_THROWS_WITH(Npz::decode({}, "a.npz"), "a.npz: is empty");
  CHECK_THROWS_WITH(Npz::decode(writer.encode(), "a.npz", 100),
                    "a.npz: array 'x': brings the arrays to 140 bytes; at most 100 are read");
}

TEST_CASE("more members than a plain archive can count", "[full]") {
  NpzWriter writer;
  const int count = 66000;
  for (int i = 0; i < count; ++i) writer.add_scalar(member_name(i), i);
  const ScratchFolder folder;
  writer.write(folder / "many.npz");
  const Npz npz = Npz::read(folder / "many.npz");
  REQUIRE(npz.names().size() == count);
  for (int i = 0; i < count; i += 997) CHECK(npz.array(member_name(i)).scalar<int>() == i);
}

TEST_CASE("more bytes than a plain archive can count", "[full]") {
  const int64_t count = (int64_t{1} << 32) + 5;
  const ScratchFolder folder;
  {
    NpzWriter writer;
    std::vector<uint8_t> values(static_cast<size_t>(count));
    values.back() = 7;
    writer.add<uint8_t>("large", {count}, values);
    values = {};
    writer.add_scalar("after", 2.5);
    writer.write(folder / "large.npz", NpzPacking::deflated);
  }
  const Npz npz = Npz::read(folder / "large.npz");
  CHECK(npz.array("large").shape() == std::vector<int64_t>{count});
  CHECK(npz.array("after").scalar<double>() == 2.5);
}

TEST_CASE("a body model file is read") {
  const std::string path = shared_file("bodies/makehuman_smplx_layout.npz");
  if (path.empty()) return;
  const Npz npz = Npz::read(path);
  CHECK(npz.names().size() + npz.skipped().size() == 16);
  const int64_t vertices = npz.array("v_template").shape().at(0);
  CHECK(vertices == 13524);
  npz.array("shapedirs").require_shape({vertices, 3, -1});
  const std::vector<double> weights = npz.array("weights").require_shape({vertices, 55}).as<double>();
  for (int64_t v = 0; v < vertices; v += 100) {
    CHECK(std::accumulate(weights.begin() + v * 55, weights.begin() + (v + 1) * 55, 0.0) == Approx(1).epsilon(1e-6));
  }
  CHECK(npz.array("joint_names").strings().at(0) == "pelvis");
  const std::vector<int64_t> parents = npz.array("kintree_table").require_shape({2, 55}).as<int64_t>();
  CHECK((parents[0] == -1 || parents[0] == 4294967295));
}

TEST_CASE("photographs with cameras are read") {
  const std::string path = shared_file("splats/test_garden.npz");
  if (path.empty()) return;
  const Npz npz = Npz::read(path);
  CHECK(npz.array("Ks").require_shape({3, 3, 3}).as<double>().size() == 27);
  CHECK(npz.array("viewmats").require_shape({3, 4, 4}).as<double>()[15] == 1);
  CHECK(npz.array("height").scalar<int>() == 420);
  CHECK(npz.array("width").scalar<int>() == 648);
}

}  // namespace npz_test
