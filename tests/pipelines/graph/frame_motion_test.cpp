// What a frame graph gives to terms over masks and over the body's motion.
#include <algorithm>
#include <cmath>
#include <map>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/gradcheck.h"
#include "autodiff/reduce.h"
#include "core/random.h"
#include "optim/loss_term.h"
#include "pipelines/draw/tape_image.h"
#include "pipelines/graph/frame_graph.h"
#include "tests/support/measures.h"
#include "tests/support/small_clip.h"

namespace frame_motion_test {

using namespace hsi4d;
using test::small_clip;

namespace {

constexpr double kFirstHarmonic = 0.28209479177387814;  // sqrt(1 / 4π)
constexpr int kWidth = 16, kHeight = 14;

/// Settings without cuts, so that differences of the loss are smooth, with a plane for the human.
FrameGraphSettings settings_with_human(RotationParameters rotations = RotationParameters::kSixD) {
  FrameGraphSettings settings;
  apply_quality(settings.render, Quality::kReference);
  settings.rotations = rotations;
  settings.human_opacity = settings.object_opacity = true;
  return settings;
}

/// The clip's first frame after three others, in which body and objects were elsewhere.
std::vector<SceneState> frames_before(const Clip& clip, int count = 3) {
  RandomSequence random(5);
  std::vector<SceneState> frames;
  for (int t = 0; t < count; ++t) {
    SceneState state = clip.first;
    const double back = 0.02 * (count - t);
    state.body.transl -= Vector3<double>(back, 0.5 * back, 0);
    for (double& w : state.body.axis_angle) w += random.uniform(-0.05, 0.05);
    for (ObjectPose& pose : state.objects) pose.translation -= Vector3<double>(back, 0.3 * back, 0.1 * back);
    frames.push_back(state);
  }
  frames.push_back(clip.first);
  return frames;
}

const LossTerm& term_named(const std::string& name) {
  return *std::find_if(loss_terms().begin(), loss_terms().end(),
                       [&](const LossTerm& term) { return term.description.name == name; });
}

template <class S>
const ParameterGroup<S>& group_named(const FrameGraph<S>& graph, const std::string& name) {
  return *std::find_if(graph.groups().begin(), graph.groups().end(),
                       [&](const ParameterGroup<S>& group) { return group.name == name; });
}

Image random_mask(std::uint64_t seed) {
  Image image(1, kHeight, kWidth);
  RandomSequence random(seed);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) image(0, y, x) = static_cast<float>(random.uniform());
  }
  return image;
}

/// The sum of the terms that read masks and motion, each of weight so that none is lost beside the others.
/// @param values  each term's, by name
Var<double> motion_and_mask_loss(const LossInputs<double>& inputs, std::map<std::string, Var<double>>& values) {
  Var<double> total = {};
  for (const auto& [name, weight] : {std::pair{"mask", 1.0},
                                     {"center", 1e-3},
                                     {"fit", 3.0},
                                     {"contact", 10.0},
                                     {"smooth", 2.0},
                                     {"object_smooth", 2.0},
                                     {"ground", 5.0},
                                     {"foot_sliding", 5.0},
                                     {"joint_limits", 1.0}}) {
    INFO(name);
    const Var<double> value = term_named(name).record(inputs);
    REQUIRE(value.tape != nullptr);
    values.emplace(name, value);
    total = total.tape == nullptr ? value * weight : total + value * weight;
  }
  return total;
}

/// White, or black, Gaussians of a class: harmonics of degree 0.
void paint(Tape<double>& tape, Var<double> sh, bool is_white) {
  const Array<double> numbers = tape.write(sh);
  for (Index row = 0; row < numbers.shape.rows; ++row) {
    for (Index i = 0; i < numbers.shape.cols; ++i)
      numbers(row, i) = i < 3 ? (is_white ? 0.5 : -0.5) / kFirstHarmonic : 0;
  }
}

/// Compares the loss's gradients with differences, of one group after the other, which then all move.
void check_gradients(Tape<double>& tape, const FrameGraph<double>& graph, Var<double> loss,
                     std::initializer_list<const char*> groups) {
  for (const char* name : groups) {
    INFO("group " << name);
    for (const Var<double> block : group_named(graph, name).blocks) tape.unfreeze(block);
    GradcheckOptions options;
    options.tolerance = 1e-6;
    options.each_node = false;
    const GradcheckReport report = gradcheck(tape, loss, options);
    INFO(report.text());
    CHECK(report.ok());
  }
}

}  // namespace

TEST_CASE("gradients of terms over masks and motion are right for body and objects", "[frame_graph][release]") {
  const RotationParameters rotations = GENERATE(RotationParameters::kSixD, RotationParameters::kAxisAngle);
  Clip clip = small_clip(kWidth, kHeight, 5000);
  clip.avatar = test::avatar_of_every_joint(clip.avatar, 2);
  clip.first.body.set_rotation(4, Vector3<double>(-0.6, 0, 0));  // a knee beyond its range
  // An object at each hand, so that there is contact with both.
  const PosedJoints body = pose_skeleton(clip.avatar, clip.first.body);
  for (std::size_t o = 0; o < 2; ++o) {
    const std::size_t wrist = 20 + o;
    clip.first.objects[o].translation = Vector3<double>(body.joints.data() + 3 * wrist) + Vector3<double>(0.04, 0, 0);
  }
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_human(rotations));
  graph.set_state(clip.first);
  graph.give_motion(clip.first, frames_before(clip));
  const Image image(3, kHeight, kWidth), human = random_mask(6), first = random_mask(7), second = random_mask(8);
  FrameTargets targets{&image, nullptr, {{14.5, 11.25, 1}, {6.5, 14.5, 1}}, {2.5, 3.5}};
  targets.human_mask = &human;
  targets.object_masks = {&first, &second};
  graph.set_targets(targets);
  std::map<std::string, Var<double>> values;
  const Var<double> loss = motion_and_mask_loss(graph.loss_inputs(), values);
  // Away from the start, so that what is compared with it has a slope.
  for (const ParameterGroup<double>& group : graph.groups()) {
    if (group.name != "transl" && group.name != "body_pose" && group.name != "object_transl") continue;
    for (const Var<double> block : group.blocks) {
      const Array<double> numbers = tape.write(block);
      for (Index i = 0; i < numbers.shape.count(); ++i)
        numbers.data[i] += 0.02 * std::sin(1.7 * static_cast<double>(i) + 1);
    }
  }
  tape.forward(loss);
  for (const auto& [name, value] : values) {
    INFO("term " << name << ": " << tape.value(value).scalar());
    CHECK(tape.value(value).scalar() > 1e-5);
  }
  for (const char* name : {"transl", "global_orient", "body_pose", "object_orient", "object_transl"}) {
    INFO("group " << name);
    const ParameterGroup<double>& group = group_named(graph, name);
    for (const Var<double> block : group.blocks) tape.unfreeze(block);
    GradcheckOptions options;
    options.tolerance = 1e-6;
    // Gaussians must not change places within the differences.
    options.step = std::string(name).starts_with("object") ? 3e-5 : 1e-6;
    options.kink_share = 0.2;
    options.entries = 24;
    options.each_node = false;
    const GradcheckReport report = gradcheck(tape, loss, options);
    INFO(report.text());
    CHECK(report.ok());
    CHECK(report.worst_error <= 1e-6);
    tape.forward(loss);
    tape.backward(loss);
    for (const Var<double> block : group.blocks) {
      const ConstArray<double> gradient = tape.gradient(block);
      double largest = 0;
      for (Index i = 0; i < gradient.shape.count(); ++i) largest = test::larger(largest, std::fabs(gradient.data[i]));
      CHECK(largest > 1e-4);
    }
    for (const Var<double> block : group.blocks) tape.freeze(block);
  }
}

TEST_CASE("keypoints are where the camera sees the joints, with the gradients of differences", "[frame_graph]") {
  Clip clip = small_clip(kWidth, kHeight, 400);
  const auto joint = [](const char* name) { return smplx_joint(name); };
  clip.keypoints = Keypoints{{{{joint("left_wrist"), 1.0}},
                              {{joint("left_hip"), 0.5}, {joint("right_hip"), 0.5}},
                              {{joint("head"), 1.0}},
                              {{joint("right_ankle"), 1.0}}},
                             {{}, {{0.3, 0.4, 1}, {0.5, 0.5, 0.5}, {0.9, 0.1, 0.8}, {1.4, -0.2, 0.1}}},
                             {}};
  FrameGraphSettings settings = settings_with_human();
  settings.keypoints = true;
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings);
  graph.set_state(clip.first);
  graph.give_motion(clip.first, frames_before(clip));
  const Image image(3, kHeight, kWidth), human = random_mask(6);
  FrameTargets targets{&image, nullptr, {{14.5, 11.25, 1}, {6.5, 14.5, 1}}, {2.5, 3.5}};
  targets.human_mask = &human;
  targets.object_masks = {&human, &human};
  targets.keypoints = &clip.keypoints->frames[1];
  graph.set_targets(targets);
  const LossInputs<double>& inputs = graph.loss_inputs();
  const Var<double> loss = term_named("keypoints_2d").record(inputs);
  REQUIRE(loss.tape != nullptr);
  tape.forward(loss);

  const PosedJoints body = pose_skeleton(clip.avatar, clip.first.body);
  for (Index k = 0; k < 4; ++k) {
    INFO("point " << k);
    Vector3<double> place = Vector3<double>::Zero();
    for (const auto& [j, weight] : clip.keypoints->joints[static_cast<std::size_t>(k)])
      place += weight * Vector3<double>(body.joints.data() + 3 * j);
    const Vector3<double> seen =
        clip.first.camera_from_world.rotation * place + clip.first.camera_from_world.translation;
    CHECK(tape.value(inputs.keypoints)(k, 0) ==
          Approx(clip.camera.fx * seen[0] / seen[2] + clip.camera.cx).epsilon(1e-9));
    CHECK(tape.value(inputs.keypoints)(k, 1) ==
          Approx(clip.camera.fy * seen[1] / seen[2] + clip.camera.cy).epsilon(1e-9));
    const Keypoint& found = clip.keypoints->frames[1][static_cast<std::size_t>(k)];
    CHECK(tape.value(inputs.keypoints_target)(k, 0) == Approx(found.x * kWidth));
    CHECK(tape.value(inputs.keypoints_target)(k, 1) == Approx(found.y * kHeight));
    CHECK(tape.value(inputs.keypoints_target)(k, 2) == found.confidence);
  }
  check_gradients(tape, graph, loss, {"camera", "transl", "global_orient", "body_pose"});
  settings.keypoints = false;
  Tape<double> other;
  const FrameGraph<double> without(other, clip, clip.first.camera_from_world, settings);
  CHECK_FALSE(without.loss_inputs().gives(LossInput::kKeypoints));
}

TEST_CASE("bones are in the camera's axes, with the gradients of differences", "[frame_graph]") {
  Clip clip = small_clip(kWidth, kHeight, 400);
  Keypoints keypoints;
  for (const char* name : {"left_shoulder", "right_shoulder", "left_elbow", "left_hip", "right_hip", "left_knee"})
    keypoints.joints.push_back({{smplx_joint(name), 1.0}});
  const Random random(4);
  for (std::uint64_t t = 0; t < 2; ++t) {
    std::vector<Keypoint>& points = keypoints.frames.emplace_back();
    for (std::uint64_t k = 0; k < 6; ++k) {
      const std::uint64_t i = 10 * (6 * t + k);
      points.push_back({0.5, 0.5, k == 2 ? 0.6 : 0.9,
                        Vector3<double>(random.normal(i), random.normal(i + 1), random.normal(i + 2))});
    }
  }
  keypoints.frames[1][5].landmark.reset();
  clip.keypoints = keypoints;
  FrameGraphSettings settings = settings_with_human();
  settings.bones = true;
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings);
  graph.set_state(clip.first);
  const Image image(3, kHeight, kWidth), human = random_mask(6);
  FrameTargets targets{&image, nullptr, {{14.5, 11.25, 1}, {6.5, 14.5, 1}}, {2.5, 3.5}};
  targets.human_mask = &human;
  targets.object_masks = {&human, &human};
  targets.keypoints = &clip.keypoints->frames[1];
  graph.set_targets(targets);
  const LossInputs<double>& inputs = graph.loss_inputs();
  CHECK_FALSE(inputs.gives(LossInput::kKeypoints));
  REQUIRE(inputs.gives(LossInput::kBones));
  REQUIRE(inputs.bones.shape().rows == 5);  // knee, elbow, hips, shoulders, back
  const Var<double> loss = term_named("bone_directions").record(inputs);
  tape.forward(loss);
  const PosedJoints body = pose_skeleton(clip.avatar, clip.first.body);
  const auto joint = [&](const char* name) { return Vector3<double>(body.joints.data() + 3 * smplx_joint(name)); };
  const auto check_bone = [&](Index row, const Vector3<double>& world) {
    const Vector3<double> seen = clip.first.camera_from_world.rotation * world;
    for (Index i = 0; i < 3; ++i) CHECK(tape.value(inputs.bones)(row, i) == Approx(seen[i]).margin(1e-9));
  };
  check_bone(0, joint("left_knee") - joint("left_hip"));
  check_bone(1, joint("left_elbow") - joint("left_shoulder"));
  check_bone(4, (joint("left_shoulder") + joint("right_shoulder") - joint("left_hip") - joint("right_hip")) / 2);
  CHECK(tape.value(inputs.bones_target)(0, 3) == 0);  // the knee's landmark is not known
  CHECK(tape.value(inputs.bones_target)(1, 3) == 0.6);
  const Vector3<double> way = *keypoints.frames[1][2].landmark - *keypoints.frames[1][0].landmark;
  CHECK(tape.value(inputs.bones_target)(1, 0) == Approx(way.normalized()[0]));
  check_gradients(tape, graph, loss, {"camera", "global_orient", "body_pose"});
}

TEST_CASE("an object is drawn to the hand as the hand is to it", "[frame_graph]") {
  Clip clip = small_clip(kWidth, kHeight, 2000);
  const PosedJoints body = pose_skeleton(clip.avatar, clip.first.body);
  clip.first.objects[1].translation = Vector3<double>(body.joints.data() + 3 * 20) + Vector3<double>(0.03, 0, 0);
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_human());
  graph.set_state(clip.first);
  graph.give_motion(clip.first, frames_before(clip));
  const Var<double> loss = term_named("contact").record(graph.loss_inputs());
  const ParameterGroup<double>& objects = group_named(graph, "object_transl");
  const Var<double> hand = group_named(graph, "transl").blocks.front();
  for (const Var<double> block : {hand, objects.blocks[0], objects.blocks[1]}) tape.unfreeze(block);
  tape.forward(loss);
  tape.backward(loss);
  CHECK(tape.value(loss).scalar() > 0);
  double size = 0;
  for (Index c = 0; c < 3; ++c) {  // moving everything together changes nothing
    const double pull = tape.gradient(hand)(0, c);
    size += std::fabs(pull);
    CHECK(tape.gradient(objects.blocks[1])(0, c) == Approx(-pull).margin(1e-12));
    CHECK(tape.gradient(objects.blocks[0])(0, c) == 0);  // far away
  }
  CHECK(size > 1e-3);
}

TEST_CASE("a graph renders the opacities that are asked for, and no other", "[frame_graph]") {
  const Clip clip = small_clip(kWidth, kHeight, 400);
  for (const bool human : {false, true}) {
    for (const bool objects : {false, true}) {
      FrameGraphSettings settings;
      settings.human_opacity = human;
      settings.object_opacity = objects;
      Tape<float> tape;
      FrameGraph<float> graph(tape, clip, clip.first.camera_from_world, settings);
      graph.set_state(clip.first);
      const LossInputs<float>& in = graph.loss_inputs();
      for (const Var<float> input : {in.human_opacity, in.human_mask, in.human_seen}) CHECK(in.given(input) == human);
      for (const Var<float> input : {in.object_opacity, in.object_center_target, in.object_masks, in.object_seen})
        CHECK(in.given(input) == objects);
      CHECK(in.given(in.object_depth));
      tape.forward(graph.rendered().image);
      CHECK(graph.rendered().counters->channels == 3 + (human ? 1 : 0) + (objects ? 2 : 0));
    }
  }
}

TEST_CASE("an opacity that no term reads changes no bit of image, loss and gradients", "[frame_graph]") {
  const Clip clip = small_clip(40, 36, 400, 600);
  Image image(3, 36, 40);
  for (float& value : image.data()) value = 0.5F;
  const auto bits = [&](bool unread) {
    FrameGraphSettings settings;
    settings.human_opacity = settings.object_opacity = unread;
    Tape<float> tape;
    FrameGraph<float> graph(tape, clip, clip.first.camera_from_world, settings);
    graph.set_state(clip.first);
    const Image mask(1, 36, 40);
    FrameTargets targets{&image, nullptr, {{14.5, 11.25, 1}, {6.5, 14.5, 1}}, {2.5, 3.5}, &mask, true, {&mask, &mask}};
    graph.set_targets(targets);
    const Var<float> loss = term_named("photometric").record(graph.loss_inputs());
    for (const ParameterGroup<float>& group : graph.groups()) {
      for (const Var<float> block : group.blocks) tape.unfreeze(block);
    }
    tape.forward(loss);
    tape.backward(loss);
    std::vector<float> numbers = {tape.value(loss).scalar()};
    for (const ParameterGroup<float>& group : graph.groups()) {
      for (const Var<float> block : group.blocks) {
        const ConstArray<float> d = tape.gradient(block);
        numbers.insert(numbers.end(), d.data, d.data + d.shape.count());
      }
    }
    return numbers;
  };
  CHECK(bits(true) == bits(false));
}

TEST_CASE("planes of human and objects are what images show in which nothing else is white", "[frame_graph]") {
  const Clip clip = small_clip(kWidth, kHeight, 400);
  const bool with_human = GENERATE(true, false), with_objects = GENERATE(true, false);
  FrameGraphSettings settings = settings_with_human();
  settings.human_opacity = with_human;
  settings.object_opacity = with_objects;
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings);
  graph.set_state(clip.first);
  const LossInputs<double>& in = graph.loss_inputs();
  const ParameterGroup<double>& objects = group_named(graph, "object_sh");
  REQUIRE(objects.blocks.size() == 2);
  paint(tape, group_named(graph, "scene_sh").blocks.front(), false);
  for (int white = with_objects ? 0 : 2; white < (with_human ? 3 : 2); ++white) {
    INFO("part " << white);
    for (int o = 0; o < 2; ++o) paint(tape, objects.blocks[static_cast<std::size_t>(o)], o == white);
    fill(group_named(graph, "human_colors").blocks.front(), white == 2 ? 1.0 : 0.0);
    const Var<double> plane = white == 2 ? in.human_opacity : in.object_opacity, image = graph.rendered().image;
    const Var<double> both = sum(plane) + sum(image);
    tape.forward(both);
    const ConstArray<double> seen = tape.value(image), planes = tape.value(plane);
    double largest = 0, difference = 0;
    for (Index y = 0; y < kHeight; ++y) {
      for (Index x = 0; x < kWidth; ++x) {
        const double opacity = planes(white == 2 ? 0 : white, y, x);
        largest = test::larger(largest, opacity);
        for (Index c = 0; c < 3; ++c) difference = test::larger(difference, std::fabs(seen(c, y, x) - opacity));
      }
    }
    CHECK(largest > 0.1);
    CHECK(difference < 1e-6);
  }
}

TEST_CASE("points and joints that terms over the motion read are where the states have them", "[frame_graph]") {
  const RotationParameters rotations = GENERATE(RotationParameters::kSixD, RotationParameters::kAxisAngle);
  const Clip clip = small_clip(kWidth, kHeight, 200);
  for (const int before : {1, 3}) {
    const std::vector<SceneState> frames = frames_before(clip, before);
    Tape<double> tape;
    FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_with_human(rotations));
    graph.set_state(clip.first);
    graph.give_motion(clip.first, frames);
    const LossInputs<double>& in = graph.loss_inputs();
    REQUIRE(in.motion != nullptr);
    CHECK(in.motion->still_frames == before);
    CHECK(in.motion->moving_frames() == 1);
    std::vector<BodyPoint> body;
    std::vector<ObjectPoint> objects;
    for (const Index row : {0, 3, 17, 60, 199}) body.push_back({before, row});
    for (const Index row : {0, 2, 5}) {
      objects.push_back({before, 1, row});
      objects.push_back({before, 0, row});
    }
    const Var<double> body_places = in.body_points(body), object_places = in.object_points(objects);
    const Var<double> all = sum(body_places) + sum(object_places) + sum(in.joints);
    tape.forward(all);
    for (std::size_t i = 0; i < body.size(); ++i) {
      const Vector3<double> expected = in.motion->place(body[i]);
      for (Index c = 0; c < 3; ++c)
        CHECK(tape.value(body_places)(static_cast<Index>(i), c) == Approx(expected[c]).margin(1e-9));
    }
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const Vector3<double> expected = in.motion->place(objects[i]);
      for (Index c = 0; c < 3; ++c)
        CHECK(tape.value(object_places)(static_cast<Index>(i), c) == Approx(expected[c]).margin(1e-9));
    }
    REQUIRE(in.joints.shape() == shape_of(before + 1, 66));
    for (std::size_t t = 0; t < frames.size(); ++t) {
      const std::vector<double> joints = pose_joints(clip.avatar, frames[t].body);
      for (Index c = 0; c < 66; ++c) {
        const double expected = joints[static_cast<std::size_t>(c)];
        CHECK(tape.value(in.joints)(static_cast<Index>(t), c) == Approx(expected).margin(1e-9));
        CHECK(tape.value(in.joints_start)(static_cast<Index>(t), c) == expected);
      }
    }
    // What moves follows its leaves: 0.1 m to the right, frames before stand.
    const Var<double> object_transl = group_named(graph, "object_transl").blocks[1];
    tape.write(object_transl)(0, 0) += 0.1;
    tape.write(group_named(graph, "transl").blocks.front())(0, 0) += 0.1;
    tape.forward(all);
    CHECK(tape.value(object_places)(0, 0) == Approx(in.motion->place(objects[0])[0] + 0.1).margin(1e-9));
    CHECK(tape.value(object_places)(1, 0) == Approx(in.motion->place(objects[1])[0]).margin(1e-9));
    CHECK(tape.value(body_places)(4, 0) == Approx(in.motion->place(body[4])[0] + 0.1).margin(1e-9));
    CHECK(tape.value(in.joints)(before, 0) == Approx(tape.value(in.joints_start)(before, 0) + 0.1).margin(1e-9));
    CHECK(tape.value(in.joints)(before - 1, 0) == tape.value(in.joints_start)(before - 1, 0));
  }
}

}  // namespace frame_motion_test
