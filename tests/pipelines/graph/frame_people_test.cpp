// Two people on the tapes of a frame and of a sequence: what moves, what terms see, gradients.
#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "optim/stage_gradcheck.h"
#include "optim/stage_loss.h"
#include "pipelines/draw/tape_image.h"
#include "pipelines/graph/frame_graph.h"
#include "pipelines/graph/sequence_graph.h"
#include "tests/support/small_clip.h"

namespace frame_people_test {

using namespace hsi4d;
using test::bent_pose;
using test::small_clip;

namespace {

constexpr int kWidth = 20, kHeight = 18;

/// Points that a detector found in one frame.
Keypoints some_keypoints(double shift) {
  Keypoints keypoints;
  keypoints.frames.emplace_back();
  for (const char* name : {"left_shoulder", "right_shoulder", "left_elbow", "left_hip", "right_hip", "left_knee"}) {
    keypoints.joints.push_back({{smplx_joint(name), 1.0}});
    const double k = static_cast<double>(keypoints.joints.size());
    keypoints.frames[0].push_back({0.3 + shift, 0.1 * k, 0.9, Vector3<double>(std::sin(k + shift), std::cos(k), k)});
  }
  return keypoints;
}

/// A second person stands before the first, who is partly hidden.
Clip two_people() {
  Clip clip = small_clip(kWidth, kHeight, 2500);
  clip.avatar = test::avatar_of_every_joint(clip.avatar, 2);
  ClipPerson& friend_of = clip.others.emplace_back();
  friend_of.name = "friend";
  friend_of.avatar = clip.avatar;
  for (float& color : friend_of.avatar.colors) color = 1 - color;
  clip.keypoints = some_keypoints(0);
  friend_of.keypoints = some_keypoints(0.2);
  clip.first.others = {bent_pose(21)};
  clip.first.others[0].transl += Vector3<double>(0.35, -0.5, 0);
  return clip;
}

/// One of them alone.
Clip alone(const Clip& clip, std::size_t person) {
  Clip one = clip;
  static_cast<ClipPerson&>(one) = clip.person(person);
  one.others.clear();
  one.first = with_person({clip.first}, person).front();
  return one;
}

FrameGraphSettings settings_with_masks() {
  FrameGraphSettings settings;
  apply_quality(settings.render, Quality::kReference);
  settings.human_opacity = settings.object_opacity = settings.keypoints = settings.bones = true;
  return settings;
}

std::vector<SceneState> frames_before(const Clip& clip) {
  std::vector<SceneState> frames(4, clip.first);
  for (std::size_t t = 0; t < 3; ++t) {
    for (std::size_t p = 0; p < clip.people(); ++p)
      frames[t].person(p).transl -= (3.0 - static_cast<double>(t)) * Vector3<double>(0.02, 0.01, 0.003);
  }
  return frames;
}

Image some_mask(int shift) {
  Image mask(1, kHeight, kWidth);
  for (int y = 3; y < kHeight - 3; ++y) {
    for (int x = 5 + shift; x < 10 + shift; ++x) mask(0, y, x) = 1;
  }
  return mask;
}

struct Masks {
  Image image{3, kHeight, kWidth}, first = some_mask(0), other = some_mask(4), object = some_mask(-2);
};

/// @param person  of a graph of one: which of the two it is
void give_targets(FrameGraph<double>& graph, const Clip& clip, const Masks& masks, std::size_t person = 0) {
  FrameTargets targets{&masks.image, nullptr, {{14.5, 11.25, 1}, {6.5, 14.5, 1}}, {2.5, 3.5}};
  targets.human_mask = person == 0 ? &masks.first : &masks.other;
  targets.object_masks = {&masks.object, &masks.object};
  targets.keypoints = &clip.keypoints->frames[0];
  if (!clip.others.empty()) targets.others = {{&masks.other, true, &clip.others[0].keypoints->frames[0]}};
  graph.set_targets(targets);
}

StageSettings stage_with(std::initializer_list<const char*> losses, std::initializer_list<const char*> groups) {
  StageSettings stage;
  for (const char* name : losses) {
    LossSettings loss;
    loss.weight = 1;
    stage.losses.emplace_back(name, loss);
  }
  for (const char* name : groups) stage.optimize.emplace_back(name, ParameterGroupSettings());
  return stage;
}

void move_leaves(Tape<double>& tape, const std::vector<ParameterGroup<double>>& groups, const std::string& name) {
  for (const ParameterGroup<double>& group : groups) {
    if (group.name != name) continue;
    for (std::size_t b = 0; b < group.blocks.size(); ++b) {
      const Array<double> numbers = tape.write(group.blocks[b]);
      for (Index i = 0; i < numbers.shape.count(); ++i)
        numbers.data[i] += 0.02 * std::sin(1.7 * static_cast<double>(i) + 1 + static_cast<double>(b));
    }
  }
}

/// Values of terms by name, after the people have moved a little.
std::vector<LossValue> values_of(const Clip& clip, const StageSettings& stage, std::size_t person = 0) {
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_masks());
  SceneState state = clip.first;
  graph.set_state(state);
  graph.give_motion(clip.first, frames_before(clip));
  for (std::size_t p = 0; p < clip.people(); ++p) {
    state.person(p).transl += Vector3<double>(0.02, -0.01, 0.03);
    state.person(p).set_rotation(4, Vector3<double>(-0.6, 0, 0));  // a knee beyond its range
  }
  graph.set_state(state);
  const Masks masks;
  give_targets(graph, clip, masks, person);
  RecordedLoss<double> loss = record_loss<double>(stage, loss_terms(), graph.loss_inputs(), "people");
  tape.forward(loss.total);
  loss.read_values();
  return loss.values;
}

}  // namespace

TEST_CASE("terms over bodies are sums over people, each as it is alone", "[frame_graph][people]") {
  const Clip clip = two_people();
  const StageSettings stage = stage_with(
      {"fit", "smooth", "foot_sliding", "ground", "joint_limits", "pose_prior", "object_smooth"}, {"transl"});
  const std::vector<LossValue> both = values_of(clip, stage), first = values_of(alone(clip, 0), stage),
                               other = values_of(alone(clip, 1), stage);
  REQUIRE(both.size() == stage.losses.size());
  for (std::size_t k = 0; k < both.size(); ++k) {
    INFO(both[k].name << ": " << both[k].value << " of both, " << first[k].value << " and " << other[k].value);
    const bool is_of_objects = both[k].name == "object_smooth";
    CHECK(both[k].value == Approx(first[k].value + (is_of_objects ? 0 : other[k].value)).epsilon(1e-12));
    if (!is_of_objects) CHECK(other[k].value > 0);
  }
}

TEST_CASE("the mask loss compares each person with its own mask, what hides it included", "[frame_graph][people]") {
  const Clip clip = two_people();
  StageSettings stage = stage_with({"mask"}, {"transl"});
  const double both = values_of(clip, stage).front().value, first = values_of(alone(clip, 0), stage).front().value,
               other = values_of(alone(clip, 1), stage, 1).front().value;
  // The objects count once. The friend, who hides, is as alone; the first person is not.
  INFO(both << " of both, " << first << " and " << other << " alone");
  CHECK(both > other);
  CHECK(both < first + other);
  CHECK(both != Approx(first).epsilon(1e-3));
}

TEST_CASE("gradients of a frame with two people are right in every block", "[frame_graph][people][release]") {
  Clip clip = two_people();
  const PosedJoints body = pose_skeleton(clip.others[0].avatar, clip.first.others[0]);
  clip.first.objects[0].translation = Vector3<double>(body.joints.data() + 3 * 20) + Vector3<double>(0.04, 0, 0);
  for (const std::vector<const char*>& losses :
       {std::vector{"mask", "fit", "smooth", "contact", "foot_sliding", "ground", "joint_limits"},
        std::vector{"keypoints_2d", "bone_directions"}, std::vector{"photometric"}}) {
    Tape<double> tape;
    FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_masks());
    graph.set_state(clip.first);
    graph.give_motion(clip.first, frames_before(clip));
    const Masks masks;
    give_targets(graph, clip, masks);
    StageSettings stage = stage_with({}, {"transl", "global_orient", "body_pose"});
    if (std::string(losses.front()) != "keypoints_2d") {
      for (const char* name : {"left_hand_pose", "object_transl"})
        stage.optimize.emplace_back(name, ParameterGroupSettings());
    }
    for (const char* name : losses) {
      LossSettings loss;
      loss.weight = 1;
      stage.losses.emplace_back(name, loss);
    }
    StageGradcheckOptions options;
    options.disturbance = 1e-3;
    const StageGradcheck check =
        check_stage_gradient(tape, stage, loss_terms(), graph.loss_inputs(), graph.groups(), "people", options);
    for (const GroupGradcheck& group : check.groups) {
      INFO(losses.front() << ", " << group.group << ": " << group.report.text());
      CHECK(group.report.ok());
    }
    CHECK(check.ok());
    // Both people have a gradient.
    for (const ParameterGroup<double>& group : graph.groups()) {
      if (group.name == "transl") CHECK(group.blocks.size() == 2);
    }
  }
}

TEST_CASE("a frame graph gives back each person's state, and its own colour net", "[frame_graph][people]") {
  const Clip clip = two_people();
  std::vector<ColorNet> nets;
  for (std::size_t p = 0; p < 2; ++p)
    nets.push_back(new_color_net(clip.avatar.means, clip.avatar.joint_count(), {4, 6, 1, false, 1 + p}));
  FrameGraphSettings settings = settings_with_masks();
  settings.color_nets = nets;
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings);
  graph.set_state(clip.first);
  const StageSettings stage = stage_with({}, {"transl", "body_pose", "color_net", "avatar_features"});
  SceneState state = clip.first;
  graph.read_state(stage.optimize, state);
  for (std::size_t p = 0; p < 2; ++p) {
    CHECK(state.person(p).transl == clip.first.person(p).transl);
    for (Index j = 0; j < kSmplxJoints; ++j)
      CHECK((state.person(p).rotation_of(j) - clip.first.person(p).rotation_of(j)).norm() < 1e-12);
  }
  move_leaves(tape, graph.groups(), "transl");
  move_leaves(tape, graph.groups(), "color_net");
  graph.read_state(stage.optimize, state);
  std::vector<ColorNet> after = nets;
  graph.read_color_nets(stage.optimize, after);
  for (std::size_t p = 0; p < 2; ++p) {
    CHECK((state.person(p).transl - clip.first.person(p).transl).norm() > 0.01);
    CHECK_FALSE(after[p].layers[0].weights == nets[p].layers[0].weights);
    CHECK(after[p].features == nets[p].features);
  }
  CHECK_FALSE(after[0].layers[0].weights == after[1].layers[0].weights);
  const Vector3<double> moved = state.others[0].transl;
  graph.set_state(state);
  graph.read_state(stage.optimize, state);
  CHECK(state.others[0].transl == moved);
}

TEST_CASE("a sequence moves both people, with right gradients", "[sequence_graph][people][release]") {
  const Clip clip = two_people();
  std::vector<SceneState> states = frames_before(clip);
  const PosePrior prior = read_pose_prior("");
  Tape<double> tape;
  const SequenceGraph<double> graph(tape, clip, states, &prior, RotationParameters::kSixD);
  const StageSettings stage =
      stage_with({"fit", "smooth", "foot_sliding"}, {"transl", "global_orient", "pose_latents"});
  const StageGradcheck check =
      check_stage_gradient(tape, stage, loss_terms(), graph.loss_inputs(), graph.groups(), "people");
  CHECK(check.ok());
  const std::vector<SceneState> before = states;
  graph.read_states(stage.optimize, states);  // the check has moved all of them
  for (std::size_t p = 0; p < 2; ++p) {
    CHECK(states[0].person(p).transl == before[0].person(p).transl);
    CHECK(states[2].person(p).transl != before[2].person(p).transl);
    CHECK(states[2].person(p).axis_angle != before[2].person(p).axis_angle);
  }
}

TEST_CASE("each person has its own sigmas, and its own places in the frames that follow", "[people]") {
  const Clip clip = two_people();
  const std::vector<SceneState> states = frames_before(clip);
  std::vector<PlaceSigmas> sigmas(states.size(), no_sigmas(clip.objects.size(), 1));
  sigmas[1].joints[3] = {0.01, 0.02};
  sigmas[1].others[0][5] = {0.03, 0.04};
  Tape<double> tape;
  SequenceGraph<double> graph(tape, clip, states, nullptr, RotationParameters::kSixD);
  graph.give_sigmas(states, sigmas);
  const ConstArray<double> first = tape.value(graph.loss_inputs().joints_sigma),
                           other = tape.value(graph.loss_inputs().others[0].joints_sigma),
                           axes = tape.value(graph.loss_inputs().view_axes);
  CHECK(first(1, 6) == 0.01);
  CHECK(first(1, 7) == 0.02);
  CHECK(std::isnan(first(1, 10)));
  CHECK(other(1, 10) == 0.03);
  CHECK(other(1, 11) == 0.04);
  CHECK(std::isnan(other(1, 6)));
  for (Index i = 0; i < 3; ++i) CHECK(axes(1, i) == states[1].camera_from_world.rotation(2, i));

  Tape<double> of_frame;
  FrameGraph<double> frame(of_frame, clip, clip.first.camera_from_world, settings_with_masks());
  frame.set_state(clip.first);
  frame.give_motion(clip.first, frames_before(clip));
  frame.give_motion_after(std::span(states).last(2));
  for (std::size_t p = 0; p < 2; ++p) {
    const LossInputs<double>& inputs = p == 0 ? frame.loss_inputs() : frame.loss_inputs().others[0];
    const ConstArray<double> after = of_frame.value(inputs.joints_after);
    REQUIRE(after.shape.rows == 2);
    const SceneState& last = states.back();
    const std::vector<double> joints = pose_skeleton(clip.person(p).avatar, last.person(p)).joints;
    for (Index i = 0; i < after.shape.cols; ++i) CHECK(after(1, i) == joints[static_cast<std::size_t>(i)]);
    REQUIRE(inputs.motion->frames_with_objects() == inputs.motion->frames() + 2);
    const auto& objects = inputs.motion->world_from_object.back();
    REQUIRE(objects.size() == last.objects.size());
    for (std::size_t o = 0; o < objects.size(); ++o) CHECK(objects[o].translation == last.objects[o].translation);
  }
}

}  // namespace frame_people_test
