#include "pipelines/body_settings.h"

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "tests/support/smplx_reference.h"
#include "tests/support/temporary_folder.h"

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("the body of a config is the procedural one, or read from its file") {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / "body.npz").string();
  const SmplxArrays arrays = random_smplx({.vertices = 30, .correctives = false});
  smplx_writer(arrays).write(file);
  CHECK(rest_body(BodySettings{}).vertices == procedural_body().vertices);
  CHECK_THROWS_AS(read_smplx_body(BodySettings{}), InternalError);
  BodySettings settings;
  settings.kind = BodyKind::kSmplx;
  settings.path = file;
  settings.betas = 3;
  settings.expressions = 2;
  const SmplxModel model = read_smplx_body(settings);
  CHECK(model.betas == 3);
  CHECK(model.expressions == 2);
  CHECK(rest_body(settings).vertices == std::vector<float>(arrays.v_template.begin(), arrays.v_template.end()));
  CHECK_FALSE(smplx_body_options(settings).flat_hand_mean);
  settings.flat_hand_mean = true;
  CHECK(smplx_body_options(settings).flat_hand_mean);
  settings.betas = 11;
  CHECK_THROWS_WITH(read_smplx_body(settings), Catch::Contains("which holds 10 betas; 11 were asked for"));
}

TEST_CASE("hand components that a file has not are refused") {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / "body.npz").string();
  SmplxArrays arrays = random_smplx({.vertices = 3, .correctives = false});
  arrays.hand_components[1].resize(45 * 6);
  smplx_writer(arrays).write(file);
  BodySettings settings;
  settings.kind = BodyKind::kSmplx;
  settings.path = file;
  settings.hand_components = 7;
  CHECK_NOTHROW(read_smplx_body(settings));
  settings.hands = HandParameters::kPca;
  CHECK_THROWS_WITH(read_smplx_body(settings), settings.path.string() +
                                                   ": has 6 components of a hand; 7 were asked "
                                                   "for (body.hand_components)");
  settings.hand_components = 6;
  CHECK_NOTHROW(read_smplx_body(settings));
}
