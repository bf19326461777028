#include "body/avatar_shape.h"

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/procedural_body.h"
#include "tests/support/temporary_folder.h"

namespace avatar_shape_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Contains;

namespace {

const Avatar& small_avatar() {
  static const Avatar avatar = surface_avatar(procedural_body(), {.gaussians = 5});
  return avatar;
}

/// Reads the shape of an avatar's file that something is added to.
template <class F>
std::optional<AvatarShape> shape_with(F&& add) {
  SafetensorsWriter file = avatar_file(small_avatar());
  add(file);
  return avatar_shape_of(Safetensors::decode(file.encode(), "a.safetensors"));
}

}  // namespace

TEST_CASE("an avatar's file keeps the shape of its body, and is read as before") {
  const TemporaryFolder folder;
  for (const AvatarShape& shape : {AvatarShape{"procedural", {0.5, -1}, "female"}, AvatarShape{"procedural", {}}}) {
    SafetensorsWriter file = avatar_file(small_avatar());
    add_avatar_shape(shape, file);
    file.write("a.safetensors");
    CHECK(read_avatar_shape("a.safetensors") == shape);
    CHECK(read_avatar("a.safetensors").means == small_avatar().means);
  }
  write_avatar("b.safetensors", small_avatar());
  CHECK_FALSE(read_avatar_shape("b.safetensors").has_value());
}

TEST_CASE("shapes that are none are refused by name") {
  CHECK_THROWS_WITH(shape_with([](auto& f) {
                      f.template add<double>("betas", {2}, {1, 11});
                    }),
                    Contains("betas") && Contains("number 1 is 11; allowed: -10 to 10"));
  CHECK_THROWS_WITH(shape_with([](auto& f) { f.template add<double>("betas", {1, 2}, {1, 1}); }), Contains("betas"));
  CHECK_THROWS_WITH(shape_with([](auto& f) { f.template add<double>("betas", {301}, std::vector<double>(301)); }),
                    Contains("has 301 numbers; allowed: at most 300"));
  CHECK_THROWS_WITH(shape_with([](auto& f) {
                      add_avatar_shape({"procedural", {}, "tall"}, f);
                    }),
                    Contains("a.safetensors: metadata 'gender' is \"tall\"; allowed: neutral, female, male"));
}

}  // namespace avatar_shape_test
