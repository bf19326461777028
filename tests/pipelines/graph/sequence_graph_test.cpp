#include "pipelines/graph/sequence_graph.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/gradcheck.h"
#include "autodiff/reduce.h"
#include "body/motion_edit.h"
#include "body/procedural_body.h"
#include "core/config_file.h"
#include "core/rotation.h"
#include "optim/metrics.h"
#include "optim/stage.h"
#include "tests/support/measures.h"
#include "tests/support/small_clip.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/vposer_checkpoint.h"

namespace sequence_graph_test {

using namespace hsi4d;
using test::small_clip;

namespace {

constexpr int kFrames = 5;

/// A body that walks and bends, objects that are carried.
std::vector<SceneState> some_states(const Clip& clip) {
  RandomSequence random(4);
  std::vector<SceneState> states(kFrames, clip.first);
  for (int t = 1; t < kFrames; ++t) {
    SceneState& state = states[static_cast<std::size_t>(t)];
    state.body.transl += Vector3<double>(0.05 * t, 0.02 * t, 0);
    for (double& w : state.body.axis_angle) w += random.uniform(-0.2, 0.2);
    for (ObjectPose& pose : state.objects) pose.translation += Vector3<double>(0.05 * t, 0.02 * t, 0);
  }
  return states;
}

const LossTerm& term_named(const std::string& name) {
  return *std::find_if(loss_terms().begin(), loss_terms().end(),
                       [&](const LossTerm& term) { return term.description.name == name; });
}

/// The settings of a term that JSON text gives.
std::any own_settings(const std::string& name, const std::string& text) {
  LossSettings settings = default_settings(term_named(name).description);
  ConfigFields fields;
  describe(fields, settings);
  ConfigProblems problems;
  read_config(load_config_text(text, "loss.json", "", {}, problems), fields, problems);
  problems.throw_if_any();
  return settings.own;
}

double largest_joint_distance(const Clip& clip, const SceneState& a, const SceneState& b) {
  const std::vector<double> x = pose_joints(clip.avatar, a.body), y = pose_joints(clip.avatar, b.body);
  double largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) largest = test::larger(largest, std::fabs(x[i] - y[i]));
  return largest;
}

StageSettings moving(const std::vector<std::string>& groups) {
  StageSettings settings;
  settings.over = StageScope::kSequence;
  settings.iterations = 30;
  ParameterGroupSettings group;
  group.lr = 0.01;
  for (const std::string& name : groups) settings.optimize.emplace_back(name, group);
  return settings;
}

}  // namespace

TEST_CASE("a sequence graph has the joints of its states, frame by frame") {
  const Clip clip = small_clip(16, 14, 100);
  const std::vector<SceneState> states = some_states(clip);
  const PosePrior prior = natural_pose_prior();
  for (const PosePrior* const used : {static_cast<const PosePrior*>(nullptr), &prior}) {
    Tape<double> tape;
    const SequenceGraph<double> graph(tape, clip, states, used, RotationParameters::kSixD);
    tape.forward(graph.loss_inputs().joints);
    REQUIRE(graph.loss_inputs().joints.shape() == shape_of(kFrames, 66));
    for (int t = 0; t < kFrames; ++t) {
      const std::vector<double> joints = pose_joints(clip.avatar, states[static_cast<std::size_t>(t)].body);
      for (Index c = 0; c < 66; ++c) {
        CHECK(tape.value(graph.loss_inputs().joints)(t, c) == Approx(joints[static_cast<std::size_t>(c)]).margin(1e-9));
        CHECK(tape.value(graph.loss_inputs().joints_start)(t, c) == joints[static_cast<std::size_t>(c)]);
      }
    }
  }
}

TEST_CASE("fit sees 22 joints of each frame, in paper.json as the mean over their coordinates") {
  const Clip clip = small_clip(16, 14, 100);
  const std::vector<SceneState> states = some_states(clip);
  Tape<double> tape;
  const SequenceGraph<double> graph(tape, clip, states, nullptr, RotationParameters::kAxisAngle);
  const auto transl = std::find_if(graph.groups().begin(), graph.groups().end(),
                                   [](const ParameterGroup<double>& group) { return group.name == kTranslGroup; });
  REQUIRE(transl != graph.groups().end());
  const Array<double> numbers = tape.write(transl->blocks.front());
  for (Index i = 0; i < numbers.shape.count(); ++i) numbers.data[i] += 0.01;  // along all three axes
  const RunConfig paper = load_run_config(HSI4D_SOURCE_DIR "/configs/paper.json", {}, descriptions_of(loss_terms()));
  const StageSettings* const refinement = find_entry(paper.stages, "refinement");
  REQUIRE(refinement != nullptr);
  const LossSettings* const of_paper = find_entry(refinement->losses, "fit");
  REQUIRE(of_paper != nullptr);
  const Var<double> sum = term_named("fit").record(graph.loss_inputs(), own_settings("fit", R"({"joints": "sum"})")),
                    mean = term_named("fit").record(graph.loss_inputs(), of_paper->own);
  tape.forward(sum);
  CHECK(tape.value(sum).scalar() == Approx(22 * 3 * 0.01 * 0.01).epsilon(1e-9));
  tape.forward(mean);
  CHECK(tape.value(mean).scalar() == Approx(0.01 * 0.01).epsilon(1e-9));
}

TEST_CASE("points of body and objects of a sequence are where the states have them") {
  Clip clip = small_clip(16, 14, 100);
  const BodySet of = GENERATE(BodySet::kGaussians, BodySet::kVertices);
  if (of == BodySet::kVertices) clip.body = procedural_body();
  const std::vector<SceneState> states = some_states(clip);
  Tape<double> tape;
  const SequenceGraph<double> graph(tape, clip, states, nullptr, RotationParameters::kAxisAngle);
  std::vector<BodyPoint> body;
  std::vector<ObjectPoint> objects;
  for (Index t = 1; t < kFrames; ++t) {
    body.push_back({t, 7 * t, of});
    objects.push_back({t, t % 2, t});
  }
  const LossInputs<double>& in = graph.loss_inputs();
  const Var<double> body_places = in.body_points(body), object_places = in.object_points(objects);
  tape.forward(body_places);
  for (std::size_t i = 0; i < body.size(); ++i) {
    const Vector3<double> expected = in.motion->place(body[i]), object = in.motion->place(objects[i]);
    for (Index c = 0; c < 3; ++c) {
      CHECK(tape.value(body_places)(static_cast<Index>(i), c) == Approx(expected[c]).margin(1e-12));
      CHECK(tape.value(object_places)(static_cast<Index>(i), c) == object[c]);
    }
  }
}

TEST_CASE("gradients of a sequence are right for every group and term") {
  const RotationParameters rotations = GENERATE(RotationParameters::kSixD, RotationParameters::kAxisAngle);
  Clip clip = small_clip(16, 14, 100);
  if (rotations == RotationParameters::kAxisAngle) clip.body = procedural_body();  // whose vertices contact draws
  const std::vector<SceneState> states = some_states(clip);
  const PosePrior prior = natural_pose_prior();
  Tape<double> tape;
  const SequenceGraph<double> graph(tape, clip, states, &prior, rotations);
  LossInputs<double> inputs = graph.loss_inputs();
  // Away from the start, so that `fit` has a slope.
  for (const ParameterGroup<double>& group : graph.groups()) {
    const Array<double> numbers = tape.write(group.blocks.front());
    for (Index i = 0; i < numbers.shape.count(); ++i) numbers.data[i] += 0.03 * std::sin(1.7 * static_cast<double>(i));
  }
  const std::any& defaults = term_named("contact").description.defaults;
  Var<double> total = term_named("fit").record(inputs, term_named("fit").description.defaults);
  total = total + term_named("smooth").record(inputs, term_named("smooth").description.defaults);
  total = total + term_named("contact").record(inputs, defaults) * 10.0;
  total = total + term_named("ground").record(inputs, term_named("ground").description.defaults);
  // With all feet that are not high up, be they as fast as they may.
  const Var<double> sliding =
      term_named("foot_sliding").record(inputs, own_settings("foot_sliding", R"({"speed": 100})"));
  const Var<double> limits = term_named("joint_limits").record(inputs);
  total = total + sliding + limits;
  tape.forward(total);
  CHECK(tape.value(sliding).scalar() > 1e-4);
  CHECK(tape.value(limits).scalar() > 1e-4);
  const LossDescription& likely = term_named("pose_prior").description;
  total = total + term_named("pose_prior").record(inputs, prepared_loss(likely.prepare, likely.defaults)) * 1e-3;
  for (const ParameterGroup<double>& group : graph.groups()) {
    INFO("group " << group.name);
    tape.unfreeze(group.blocks.front());
    GradcheckOptions options;
    options.tolerance = 1e-6;
    options.each_node = false;
    const GradcheckReport report = gradcheck(tape, total, options);
    INFO(report.text());
    CHECK(report.ok());
    tape.freeze(group.blocks.front());
  }
}

TEST_CASE("only what a stage names comes back, and frame 0 stands") {
  const Clip clip = small_clip(16, 14, 100);
  const std::vector<SceneState> before = some_states(clip);
  const PosePrior prior = natural_pose_prior();
  for (const std::string& name : sequence_group_names()) {
    Tape<double> tape;
    const SequenceGraph<double> graph(tape, clip, before, &prior, RotationParameters::kSixD);
    const StageSettings settings = moving({name});
    for (const ParameterGroup<double>& group : graph.groups()) {
      const Array<double> numbers = tape.write(group.blocks.front());
      for (Index i = 0; i < numbers.shape.count(); ++i) numbers.data[i] += 0.05;
    }
    tape.forward(graph.loss_inputs().joints);
    std::vector<SceneState> after = before;
    graph.read_states(settings.optimize, after);
    for (std::size_t t = 0; t < after.size(); ++t) {
      const BodyPose &a = before[t].body, &b = after[t].body;
      CHECK((a.transl == b.transl) == (t == 0 || name != "transl"));
      CHECK((a.rotation_of(0) == b.rotation_of(0)) == (t == 0 || name != "global_orient"));
      CHECK((a.rotation_of(5) == b.rotation_of(5)) == (t == 0 || name != kPoseLatents));
      for (const Index joint : {22, 30, 54}) CHECK(a.rotation_of(joint) == b.rotation_of(joint));
    }
  }
}

TEST_CASE("a stage over the sequence smooths a motion and stays near it") {
  const Clip clip = small_clip(16, 14, 100);
  std::vector<SceneState> states = some_states(clip);
  const std::vector<SceneState> before = states;
  const auto roughness = [&](const std::vector<SceneState>& of) {
    double sum = 0;
    for (std::size_t t = 0; t + 1 < of.size(); ++t) {
      const std::vector<double> x = pose_joints(clip.avatar, of[t].body), y = pose_joints(clip.avatar, of[t + 1].body);
      for (std::size_t i = 0; i < 66; ++i) sum += (x[i] - y[i]) * (x[i] - y[i]);
    }
    return sum;
  };
  const PosePrior prior = natural_pose_prior();
  Tape<float> tape;
  const SequenceGraph<float> graph(tape, clip, states, &prior, RotationParameters::kSixD);
  StageSettings settings = moving(sequence_group_names());
  settings.losses = {{"fit", default_settings(term_named("fit").description)},
                     {"smooth", default_settings(term_named("smooth").description)}};
  settings.losses[1].second.weight = 0.5;
  run_stage<float>(tape, settings, loss_terms(), graph.loss_inputs(), graph.groups());
  graph.read_states(settings.optimize, states);
  CHECK(roughness(states) < 0.8 * roughness(before));
  for (std::size_t t = 0; t < states.size(); ++t) CHECK(largest_joint_distance(clip, states[t], before[t]) < 0.25);
  CHECK(largest_joint_distance(clip, states[0], before[0]) == 0);
}

TEST_CASE("a stage over the sequence moves the latents of VPoser where its settings name weights") {
  const test::TemporaryFolder here;
  const Bytes bytes = test::random_vposer(40, 32, 9).npz();
  here.write("vposer.npz", std::string(bytes.begin(), bytes.end()));
  const Clip clip = small_clip(16, 14, 100);
  std::vector<SceneState> states = some_states(clip);
  StageSettings settings = moving(sequence_group_names());
  settings.iterations = 8;
  settings.losses = {{"smooth", default_settings(term_named("smooth").description)}};
  settings.pose_weights = "vposer.npz";
  const PosePrior prior = read_pose_prior(settings.pose_weights.string());
  Tape<double> tape;
  const SequenceGraph<double> graph(tape, clip, states, &prior, RotationParameters::kSixD);
  const auto latents = std::find_if(graph.groups().begin(), graph.groups().end(),
                                    [](const ParameterGroup<double>& group) { return group.name == kPoseLatents; });
  REQUIRE(latents != graph.groups().end());
  CHECK(latents->blocks.front().shape() == shape_of(kFrames - 1, 32));
  // They start as the encoder has them, and the joints where the decoder puts them.
  const std::vector<double> encoded =
      prior.encode(std::span<const double>(states[2].body.axis_angle).subspan(3, 3 * kBodyPoseJoints));
  for (Index i = 0; i < 32; ++i)
    CHECK(tape.value(latents->blocks.front())(1, i) == Approx(encoded[static_cast<std::size_t>(i)]).margin(1e-12));
  double first = 0, last = 0;
  run_stage<double>(tape, settings, loss_terms(), graph.loss_inputs(), graph.groups(), [&](const IterationReport& at) {
    if (at.iteration == 0) first = at.loss;
    last = at.loss;
  });
  CHECK(last < first);
  std::vector<SceneState> after = states;
  graph.read_states(settings.optimize, after);
  Tape<double> decoder;
  const Var<double> moved = decoder.parameter("z", shape_of(1, 32));
  std::copy_n(tape.value(latents->blocks.front()).row(1), 32, decoder.write(moved).data);
  const Var<double> rotations = prior.decode(moved);
  decoder.forward(rotations);
  for (Index j = 0; j < kBodyPoseJoints; ++j) {
    const Matrix3<double> joint = so3_exp(after[2].body.rotation_of(j + 1));
    for (Index i = 0; i < 9; ++i) CHECK(joint(i / 3, i % 3) == Approx(decoder.value(rotations)(j, i)).margin(1e-9));
  }
}

}  // namespace sequence_graph_test
