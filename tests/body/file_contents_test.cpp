#include "body/file_contents.h"

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/motion_io.h"
#include "body/smplx_file.h"
#include "body/vposer.h"

namespace file_contents_test {

using namespace hsi4d;

namespace {

std::vector<std::uint8_t> archive_of(const std::vector<std::string>& names) {
  NpzWriter file;
  for (const std::string& name : names) file.add<double>(name, {1}, std::vector<double>{0});
  return file.encode();
}

std::string contents(const std::vector<std::string>& names) { return contents_of(Npz::decode(archive_of(names), "a")); }

}  // namespace

TEST_CASE("archives are known by their arrays") {
  CHECK(contents({"v_template", "f"}) == "a body model");
  CHECK(contents({"weight_indices", "log_scales", "means"}) == "an avatar");
  CHECK(contents({"trans", "poses", "betas"}) == "a motion");
  CHECK(contents({"transl", "pose_body"}) == "a motion");
  CHECK(contents({"transl", "body_pose"}) == "parameters of smplx");
  CHECK(contents({"vp_model.decoder_net.0.weight"}) == "the weights of VPoser");
  CHECK(contents({"vertices", "joints"}) == "vertices and joints, as hsi4d pose writes them");
  CHECK(contents({"can/rotation", "can/translation"}) == "poses of objects");
  CHECK(contents({"betas"}).empty());
  CHECK(contents({}).empty());
}

TEST_CASE("a file of a body that is given in place of another is told by what it holds") {
  const auto model = archive_of({"v_template"}), motion = archive_of({"poses", "trans"});
  CHECK_THROWS_WITH(decode_motion(model, "a.npz"), "a.npz: holds a body model, not a motion");
  CHECK_THROWS_WITH(decode_smplx(motion, "a.npz"), "a.npz: holds a motion, not a body model");
  CHECK_THROWS_WITH(decode_avatar(motion, "a.npz"), "a.npz: holds a motion, not an avatar");
  CHECK_THROWS_WITH(decode_vposer(model, "a.npz"), "a.npz: holds a body model, not the weights of VPoser");
  const auto avatar = SafetensorsWriter("hsi4d avatar", 2).encode();
  CHECK_THROWS_WITH(decode_motion(avatar, "a"),
                    "a: looks like a .safetensors file (hsi4d avatar), not like a .npz archive");
}

}  // namespace file_contents_test
