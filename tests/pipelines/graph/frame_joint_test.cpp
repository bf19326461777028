// Objects on joints in a frame's graph: what one number moves.
#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/gradcheck.h"
#include "autodiff/reduce.h"
#include "pipelines/graph/frame_graph.h"
#include "tests/support/small_clip.h"

namespace frame_joint_test {

using namespace hsi4d;

namespace {

constexpr int kWidth = 24, kHeight = 20;

/// The small clip, its ball on a joint: with the scene, or with its box.
Clip clip_with_joint(JointType type, bool has_parent) {
  Clip clip = test::small_clip(kWidth, kHeight, 60);
  JointSettings settings{type, "", {0.3, -0.2, 1}, {0.2, 0.1, -0.3}, {-0.5, 0.4}};
  ObjectJoint joint = object_joint(settings, has_parent ? std::optional<Index>(0) : std::nullopt);
  joint.rest = parent_from_object(joint, clip.first.objects, 1);
  clip.objects[1].joint = joint;
  return clip;
}

FrameGraphSettings settings_of() {
  FrameGraphSettings settings;
  apply_quality(settings.render, Quality::kReference);
  settings.background = {0.2, 0.4, 0.3};
  settings.object_opacity = true;
  return settings;
}

const ParameterGroup<double>& group_of(const FrameGraph<double>& graph, const std::string& name) {
  for (const ParameterGroup<double>& group : graph.groups()) {
    if (group.name == name) return group;
  }
  throw InternalError("no group " + name);
}

/// Image, opacities, places, depths and points, each weighed by random numbers.
Var<double> loss_of(Tape<double>& tape, const Clip& clip, FrameGraph<double>& graph) {
  graph.give_motion(clip.first, {clip.first});
  const LossInputs<double>& in = graph.loss_inputs();
  const Var<double> points = in.object_points({{0, 0, 3}, {0, 1, 2}});
  Var<double> total;
  std::uint64_t seed = 60;
  for (const Var<double> part : {in.rendered, in.object_opacity, in.object_place, in.object_depth, points}) {
    const Var<double> weights = tape.constant("weights", part.shape());
    RandomSequence random(seed++);
    const Array<double> numbers = tape.write(weights);
    for (Index r = 0; r < numbers.total_rows(); ++r) {
      for (Index c = 0; c < numbers.shape.cols; ++c) numbers.row(r)[c] = random.uniform(-1, 1);
    }
    const Var<double> term = sum(part * weights);
    total = total.tape == nullptr ? term : total + term;
  }
  return total;
}

}  // namespace

TEST_CASE("the gradients of a joint, and of its parent's pose through it, are right", "[release]") {
  for (const JointType type : {JointType::kHinge, JointType::kSlide}) {
    for (const bool has_parent : {false, true}) {
      const Clip clip = clip_with_joint(type, has_parent);
      Tape<double> tape;
      FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_of());
      graph.set_state(clip.first);
      REQUIRE(group_of(graph, kObjectJointGroup).blocks.size() == 1);
      CHECK(group_of(graph, kObjectOrientGroup).blocks.size() == 1);  // of the box alone
      tape.write(group_of(graph, kObjectJointGroup).blocks[0])(0, 0) = 0.17;
      const Var<double> loss = loss_of(tape, clip, graph);
      for (const char* name : {kObjectJointGroup, kObjectOrientGroup, kObjectTranslGroup}) {
        INFO(name << ", slide " << (type == JointType::kSlide) << ", parent " << has_parent);
        for (const ParameterGroup<double>& group : graph.groups()) {
          for (const Var<double> block : group.blocks) group.name == name ? tape.unfreeze(block) : tape.freeze(block);
        }
        GradcheckOptions options;
        options.tolerance = 1e-6;
        options.step = 1e-6;
        options.kink_share = 0.2;
        options.each_node = false;
        const GradcheckReport report = gradcheck(tape, loss, options);
        INFO(report.text());
        CHECK(report.ok());
      }
    }
  }
}

TEST_CASE("an object on a joint is drawn where the joint has it, and read back on it") {
  for (const JointType type : {JointType::kHinge, JointType::kSlide}) {
    for (const bool has_parent : {false, true}) {
      const Clip clip = clip_with_joint(type, has_parent);
      const ObjectJoint joint = *clip.objects[1].joint;
      Tape<double> tape;
      FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, settings_of());
      SceneState state = clip.first;
      state.objects[0] = {{0.4, 0.2, -0.1}, {0.3, -0.1, 0.9}};
      state.objects[1] = pose_of(compose(world_from_parent(joint, state.objects), on_joint(joint, 0.31)));
      graph.set_state(state);
      const ParameterGroup<double>& group = group_of(graph, kObjectJointGroup);
      CHECK(tape.value(group.blocks[0]).scalar() == Approx(0.31).epsilon(1e-12));
      REQUIRE(group.range_of(0));
      CHECK(group.range_of(0)->low == -0.5);
      CHECK(group.range_of(0)->high == 0.4);
      const Var<double> place = graph.object_places()[1];
      tape.forward(place);
      for (Index i = 0; i < 3; ++i) CHECK(tape.value(place)(0, i) == Approx(state.objects[1].translation[i]));

      // The same picture as that of a free object there.
      tape.forward(graph.rendered().image);
      const double on_joint_sum = tape.value(graph.rendered().image)(0, 9, 11);
      Clip free_clip = clip;
      free_clip.objects[1].joint.reset();
      Tape<double> free_tape;
      FrameGraph<double> free(free_tape, free_clip, free_clip.first.camera_from_world, settings_of());
      free.set_state(state);
      free_tape.forward(free.rendered().image);
      CHECK(on_joint_sum == Approx(free_tape.value(free.rendered().image)(0, 9, 11)).epsilon(1e-12));

      tape.write(group.blocks[0])(0, 0) = -0.2;
      SceneState read = state;
      graph.read_state({{"camera", {}}}, read);
      CHECK(read.objects[1].translation == state.objects[1].translation);  // it was not to be moved
      graph.read_state({{kObjectJointGroup, {}}}, read);
      const Rigid<double> relative = parent_from_object(joint, read.objects, 1);
      CHECK((relative.rotation - on_joint(joint, -0.2).rotation).norm() < 1e-12);
      CHECK((relative.translation - on_joint(joint, -0.2).translation).norm() < 1e-12);
      CHECK(read.objects[0].translation == state.objects[0].translation);
      // Whoever moves the parent moves what hangs on it.
      if (!has_parent) continue;
      tape.write(group_of(graph, kObjectTranslGroup).blocks[0])(0, 0) += 0.25;
      graph.read_state({{kObjectTranslGroup, {}}}, read);
      CHECK((parent_from_object(joint, read.objects, 1).translation - relative.translation).norm() < 1e-12);
    }
  }
}

}  // namespace frame_joint_test
