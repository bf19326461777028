#include "pipelines/config/body_settings.h"

#include <catch2/catch.hpp>

#include "body/avatar.h"
#include "body/procedural_body.h"
#include "core/file.h"
#include "pipelines/input/body_files.h"
#include "pipelines/synthetic/dataset.h"
#include "tests/support/procedural_file.h"
#include "tests/support/smplx_reference.h"
#include "tests/support/temporary_folder.h"

namespace body_settings_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("the body of a config is the procedural one, or read from its file") {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / "body.npz").string();
  const SmplxArrays arrays = random_smplx({.vertices = 30, .correctives = false});
  smplx_writer(arrays).write(file);
  CHECK(rest_body(BodySettings{}).vertices == procedural_body().vertices);
  CHECK(body_model_of(BodySettings{}).betas == 10);
  BodySettings settings;
  settings.kind = BodyKind::kSmplx;
  settings.path = file;
  settings.betas = 3;
  const SmplxModel model = body_model_of(settings);
  CHECK(model.betas == 3);
  CHECK(rest_body(settings).vertices == std::vector<float>(arrays.v_template.begin(), arrays.v_template.end()));
  settings.betas = 11;
  CHECK_THROWS_WITH(body_model_of(settings), Catch::Contains("which holds 10 betas; 11 were asked for"));
}

TEST_CASE("synth makes the avatar of the body that a config names") {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / "body.npz").string();
  procedural_file().write(file);
  BodySettings body;
  body.kind = BodyKind::kSmplx;
  body.path = file;
  body.betas = 0;
  SyntheticSettings settings;
  settings.frames = 1;
  settings.size_px = 32;
  settings.scene_gaussians = 700;
  settings.avatar_gaussians = 500;
  settings.object_gaussians = 60;
  write_dataset(settings, video_render_settings(), folder.path() / "named", {}, ConfigValue::make_object(), body);
  write_dataset(settings, video_render_settings(), folder.path() / "plain");
  const auto avatar_of = [&](const char* name) {
    return read_avatar((folder.path() / name / "avatar.safetensors").string());
  };
  const Avatar named = avatar_of("named"), plain = avatar_of("plain");
  CHECK(named.means == plain.means);
  CHECK(named.weights.indices == plain.weights.indices);
  for (std::size_t i = 0; i < named.joints.size(); ++i) CHECK(named.joints[i] == plain.joints[i]);
  const auto text_of = [&](const char* name) {
    return read_text_file((folder.path() / name / "synthetic.json").string());
  };
  CHECK(text_of("plain") == synthetic_settings_json(settings));
  CHECK(text_of("named") == synthetic_settings_json(settings, body));
  CHECK_THAT(text_of("named"), Catch::Contains("body.npz"));
  body.betas = 1;
  CHECK_THROWS_WITH(
      write_dataset(settings, video_render_settings(), folder.path() / "wrong", {}, ConfigValue::make_object(), body),
      Catch::Contains("which holds 0 betas; 1 were asked for"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "wrong"));
}

TEST_CASE("a config shapes the body") {
  BodySettings settings;
  settings.shape = {2, 0, -1};
  std::vector<double> betas(10, 0.0);
  betas[0] = 2, betas[2] = -1;
  CHECK(rest_body(settings).vertices == rest_body(procedural_smplx(), betas).vertices);
  CHECK(rest_body(settings).vertices != procedural_body().vertices);
  settings.betas = 3;
  CHECK(rest_body(settings).joints == rest_body(procedural_smplx(), betas).joints);
}

}  // namespace body_settings_test
