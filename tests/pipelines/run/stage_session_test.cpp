#include "pipelines/run/stage_session.h"

#include <catch2/catch.hpp>

#include "tests/support/tiny_run.h"

namespace stage_session_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

std::unique_ptr<StageInputs> inputs_of(const RunConfig& config, const std::string& stage, Index frame) {
  return std::make_unique<StageInputs>(config, loss_terms(), StageChoice{stage, frame});
}

bool are_same(const SceneState& a, const SceneState& b) {
  bool same = a.camera_from_world.rotation == b.camera_from_world.rotation &&
              a.camera_from_world.translation == b.camera_from_world.translation && a.body.transl == b.body.transl &&
              a.body.axis_angle == b.body.axis_angle && a.objects.size() == b.objects.size();
  for (std::size_t o = 0; same && o < a.objects.size(); ++o)
    same = a.objects[o].rotation == b.objects[o].rotation && a.objects[o].translation == b.objects[o].translation;
  return same;
}

}  // namespace

TEST_CASE("a stage that is stepped has the bits of a run's stage") {
  const RunConfig config = tiny_config();
  const auto inputs = inputs_of(config, "interaction", 2);
  SceneState state = inputs->start;
  ColorState colors = inputs->colors();
  run_frame_stage(inputs->task(), inputs->frame_task(), state, colors, [](const auto&, const auto&) {});
  StageSession<float> session(inputs_of(config, "interaction", 2));
  const SceneState before = session.state();
  while (!session.run().is_done()) {
    session.run().evaluate();
    session.image();
    session.run().step();
  }
  session.run().finish();
  CHECK(are_same(session.state(), state));
  CHECK_FALSE(are_same(session.state(), before));
  CHECK_THROWS_WITH(session.states(), Contains("it is of one frame"));
}

TEST_CASE("parameters are matrices by group, written all or none") {
  const RunConfig config = tiny_config();
  StageSession<float> session(inputs_of(config, "interaction", 1));
  std::vector<GroupNumbers<float>> parameters = session.parameters();
  REQUIRE(parameters.size() == 5);
  CHECK(parameters[0].group == "transl");
  CHECK(parameters[0].rows * parameters[0].cols == 3);
  CHECK(parameters[2].rows == 21);
  CHECK(parameters[2].numbers.size() == 21 * 6);
  session.run().evaluate();
  CHECK(session.gradients()[2].numbers.size() == 21 * 6);
  parameters[0].numbers[1] += 0.25F;
  const float moved = parameters[0].numbers[1];
  parameters[4].group = "object_trasl";
  CHECK_THROWS_WITH(session.set_parameters(parameters),
                    Contains("stage 'interaction, frame 1': it moves no group \"object_trasl\"") &&
                        Contains("did you mean \"object_transl\"?"));
  CHECK(session.parameters()[0].numbers[1] == moved - 0.25F);
  parameters.pop_back();
  session.set_parameters(parameters);
  CHECK(session.parameters()[0].numbers[1] == moved);
  CHECK(session.state().body.transl[1] == static_cast<double>(moved));
  parameters[0].cols = 2;
  CHECK_THROWS_WITH(session.set_parameters(parameters), Contains("transl: an array [1,2]; allowed: [1,3]"));
}

TEST_CASE("states that do not fit the clip are refused") {
  const auto inputs = inputs_of(tiny_config(), "camera", 2);
  std::vector<SceneState> before = inputs->before;
  SceneState start = inputs->start;
  start.body.transl[0] += 1;
  set_states(*inputs, &before, &start);
  CHECK(are_same(inputs->start, start));
  before.pop_back();
  CHECK_THROWS_WITH(set_states(*inputs, &before, nullptr), "before: 1 states; the stage follows 2");
  start.objects.clear();
  CHECK_THROWS_WITH(set_states(*inputs, nullptr, &start), "start: a state of 0 objects; the clip has 1");
}

}  // namespace stage_session_test
