#include "core/file_kind.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/npz.h"
#include "core/safetensors.h"

namespace file_kind_test {

using namespace hsi4d;

namespace {

std::vector<std::uint8_t> bytes_of(const std::string& text) { return {text.begin(), text.end()}; }
std::string kind_of(const std::string& text) { return file_kind(bytes_of(text)); }

}  // namespace

TEST_CASE("files are known by their first bytes") {
  CHECK(kind_of("").empty());
  CHECK(kind_of(std::string("\0\1\2\3", 4)).empty());
  CHECK(kind_of("\x89PNG\r\n\x1a\n") == "a PNG image");
  CHECK(kind_of("glTF\2") == "a .glb model");
  CHECK(kind_of("ply\nformat ascii 1.0\n") == "a .ply file");
  CHECK(kind_of("\x80\4\x95") == "a Python pickle");
  CHECK(kind_of(" {\"a\": 1}") == "JSON");
  CHECK(kind_of("[1]") == "JSON");
  CHECK(kind_of("1, 2\n") == "text");
  CHECK(kind_of("gr\xc3\xbc\xc3\x9f"
                "e an alle, die das lesen") == "text");
  CHECK(file_kind(NpzWriter().encode()) == "a .npz or .zip archive");
  SafetensorsWriter file("some format", 1);
  file.add<float>("a", {1}, std::vector<float>{1});
  CHECK(file_kind(file.encode()) == "a .safetensors file (some format)");
  CHECK(kind_of(std::string("\2\0\0\0\0\0\0\0{}", 10)) == "a .safetensors file");
}

TEST_CASE("a file of another kind is named where an archive, or safetensors, should be") {
  const auto npz = [](const std::vector<std::uint8_t>& file) { return Npz::decode(file, "a"); };
  const auto safetensors = [](const std::vector<std::uint8_t>& file) { return Safetensors::decode(file, "a"); };
  CHECK_THROWS_WITH(npz(SafetensorsWriter("hsi4d avatar", 2).encode()),
                    "a: looks like a .safetensors file (hsi4d avatar), not like a .npz archive");
  CHECK_THROWS_WITH(npz(bytes_of("hello")), "a: looks like text, not like a .npz archive");
  CHECK_THROWS_WITH(npz(bytes_of("glTF\2")), "a: looks like a .glb model, not like a .npz archive");
  CHECK_THROWS_WITH(safetensors(bytes_of("glTF\2\0\0\0\0\0\0")),
                    "a: looks like a .glb model, not like a .safetensors file");
  CHECK_THROWS_WITH(safetensors(NpzWriter().encode()),
                    "a: looks like a .npz or .zip archive, not like a .safetensors file");
}

}  // namespace file_kind_test
