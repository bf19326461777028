// How sure places are: against differences of renders, where something hides, in runs and in their files.
#include "pipelines/run/place_uncertainty.h"

#include <cmath>

#include <Eigen/LU>
#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/npz.h"
#include "core/random.h"
#include "optim/metrics.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/run/recorded_stage.h"
#include "pipelines/run/stage_inputs.h"
#include "tests/support/tiny_run.h"

namespace place_uncertainty_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// The object alone moves, and pixels alone are compared.
const std::vector<std::string> kObjectAlone = {R"(stages.interaction.optimize={"object_transl": {"lr": 0.01}})",
                                               R"(stages.interaction.losses={"photometric": {"ssim_share": 0}})",
                                               R"(render.quality="reference")", "precision=double"};

StageInputs stage_of(const RunConfig& config) { return {config, loss_terms(), {"interaction", 1}}; }

/// Of the places in the stage's start.
PlaceSigmas sigmas_at_start(const StageInputs& inputs) {
  Tape<double> tape;
  const auto [graph, losses] =
      record_frame<double>(tape, inputs.task(), inputs.frame_task(), inputs.start, inputs.colors(), std::nullopt);
  return place_sigmas<double>(tape, inputs.task(), graph->groups(), losses, graph->object_places(),
                              foreground_of(inputs.picture), inputs.start.camera_from_world.rotation);
}

Image drawn(const StageInputs& inputs, const SceneState& state) {
  return render_state(inputs.config, inputs.clip, state, inputs.colors());
}

/// The frame is what the start looks like, with noise of this standard deviation that no pixel shares with another.
void film_with_noise(double deviation, StageInputs& inputs) {
  inputs.picture.target = drawn(inputs, inputs.start);
  RandomSequence random(7);
  Image& image = inputs.picture.target;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) image(c, y, x) += static_cast<float>(deviation * random.normal());
    }
  }
}

/// What pixels say of the object's place in the axes of the camera, by differences of renders.
Matrix3<double> information_by_differences(const StageInputs& inputs, double deviation) {
  constexpr double kStep = 1e-3;
  std::array<std::pair<Image, Image>, 3> images;
  for (int axis = 0; axis < 3; ++axis) {
    SceneState before = inputs.start, after = inputs.start;
    const Vector3<double> step = kStep * inputs.start.camera_from_world.rotation.row(axis).transpose();
    before.objects[0].translation -= step;
    after.objects[0].translation += step;
    images[static_cast<std::size_t>(axis)] = {drawn(inputs, before), drawn(inputs, after)};
  }
  Matrix3<double> information = Matrix3<double>::Zero();
  const Image& size = images[0].first;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < size.height(); ++y) {
      for (int x = 0; x < size.width(); ++x) {
        Vector3<double> rate;
        for (int axis = 0; axis < 3; ++axis) {
          const auto& [before, after] = images[static_cast<std::size_t>(axis)];
          rate[axis] = static_cast<double>(after(c, y, x) - before(c, y, x)) / (2 * kStep);
        }
        information += rate * rate.transpose() / (deviation * deviation);
      }
    }
  }
  return information;
}

/// Out of the view: behind the camera.
void take_out_of_view(SceneState& state) {
  const Matrix3<double>& axes = state.camera_from_world.rotation;
  const Vector3<double> center = -(axes.transpose() * state.camera_from_world.translation);
  state.objects[0].translation = center - 2.0 * axes.row(2).transpose();
}

}  // namespace

TEST_CASE("in depth an object is a little less sure than differences of renders say") {
  StageInputs inputs = stage_of(tiny_config(kObjectAlone));
  constexpr double kNoise = 0.02;
  film_with_noise(kNoise, inputs);
  const double found = sigmas_at_start(inputs).objects.at(0).along;
  const double expected = kSigmaFactor * std::sqrt(information_by_differences(inputs, kNoise).inverse()(2, 2));
  INFO(found << " against " << expected);
  // How the sizes of the Gaussians follow their depth is left out of the curvature.
  CHECK(found > 0.9 * expected);
  CHECK(found < 2.5 * expected);
}

TEST_CASE("what does not move is sure, and twice the noise is half as sure") {
  StageInputs inputs = stage_of(tiny_config(kObjectAlone));
  film_with_noise(0.02, inputs);
  const PlaceSigmas once = sigmas_at_start(inputs);
  CHECK(once.joints == std::vector<PlaceSigma>(static_cast<std::size_t>(kMetricJoints)));
  film_with_noise(0.04, inputs);
  const PlaceSigma twice = sigmas_at_start(inputs).objects[0];
  CHECK(twice.across == Approx(2 * once.objects[0].across).epsilon(1e-3));
  CHECK(twice.along == Approx(2 * once.objects[0].along).epsilon(1e-3));
}

TEST_CASE("noise that neighbours share makes places less sure than noise that they do not") {
  StageInputs inputs = stage_of(tiny_config(kObjectAlone));
  film_with_noise(0.02, inputs);
  const double alone = sigmas_at_start(inputs).objects[0].across;
  inputs.picture.target = drawn(inputs, inputs.start);
  for (float& x : inputs.picture.target.data()) x += 0.02F;
  CHECK(sigmas_at_start(inputs).objects[0].across > 1.5 * alone);
}

TEST_CASE("an object that something hides is less sure, and one that nothing shows is not sure at all") {
  StageInputs inputs = stage_of(tiny_config(kObjectAlone));
  film_with_noise(0.02, inputs);
  const PlaceSigma open = sigmas_at_start(inputs).objects[0];
  // A body's width behind the body, on the line from the camera to its pelvis.
  const Vector3<double> center =
      -(inputs.start.camera_from_world.rotation.transpose() * inputs.start.camera_from_world.translation);
  const Vector3<double> pelvis = Vector3<double>(inputs.clip.avatar.joints.data()) + inputs.start.body.transl;
  inputs.start.objects[0].translation = pelvis + 0.4 * (pelvis - center).normalized();
  film_with_noise(0.02, inputs);
  const PlaceSigma hidden = sigmas_at_start(inputs).objects[0];
  INFO(open.across << " " << hidden.across);
  CHECK(hidden.across > 1.5 * open.across);
  CHECK(hidden.along > 1.5 * open.along);
  take_out_of_view(inputs.start);
  film_with_noise(0.02, inputs);
  const PlaceSigma unseen = sigmas_at_start(inputs).objects[0];
  CHECK(std::isinf(unseen.across));
  CHECK(std::isinf(unseen.along));
}

TEST_CASE("what pixels do not show priors may tell") {
  std::vector<std::string> settings = kObjectAlone;
  settings.push_back(R"(stages.interaction.losses={"photometric": {"ssim_share": 0}, "depth": {"weight": 0.1}})");
  StageInputs inputs = stage_of(tiny_config(settings));
  take_out_of_view(inputs.start);
  film_with_noise(0.02, inputs);
  const PlaceSigma sigma = sigmas_at_start(inputs).objects[0];
  CHECK(std::isinf(sigma.across));
  CHECK(sigma.along > 0);
  CHECK(std::isfinite(sigma.along));
}

TEST_CASE("a run tells how sure places are, and moves as one that does not", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config(), "silent");
  const RunSummary summary = execute_tiny(tiny_config({"uncertainty=true"}), "telling");
  CHECK(read_place_sigmas("silent/motion.npz", "silent/objects.npz", {kTinyObject}).empty());
  CHECK(read_motion("silent/motion.npz").poses.back().axis_angle ==
        read_motion("telling/motion.npz").poses.back().axis_angle);
  CHECK(read_motion("telling/motion.npz").unread.empty());
  const auto sigmas = read_place_sigmas("telling/motion.npz", "telling/objects.npz", {kTinyObject});
  REQUIRE(sigmas.size() == kTinyFrames);
  CHECK(std::isnan(sigmas[0].joints[0].along));
  CHECK(std::isnan(sigmas[0].objects.at(0).across));
  for (std::size_t t = 1; t < sigmas.size(); ++t) {
    REQUIRE(sigmas[t].joints.size() == kMetricJoints);
    for (const PlaceSigma& joint : sigmas[t].joints) {
      CHECK(joint.across > 1e-5);
      CHECK(joint.along > joint.across);
    }
    CHECK(sigmas[t].objects[0].across > 1e-5);
  }
  const double pelvis = sigmas[1].joints[0].along;
  CHECK(pelvis < 0.2);
  for (const char* name : {"sigma_image_mm", "sigma_depth_mm", "object_sigma_image_cm", "object_sigma_depth_cm"})
    CHECK(last_number(summary, name) > 0);
  for (const char* name : {"within_sigma_image", "within_sigma_depth", "object_within_sigma_image"}) {
    CHECK(last_number(summary, name) >= 0);
    CHECK(last_number(summary, name) <= 1);
  }
  CHECK(json_of("telling/summary.json")["per_frame"].back().contains("sigma_depth_mm"));
}

TEST_CASE("how sure places are has the same bits on any number of threads, and after an interruption", "[run]") {
  const TemporaryFolder here;
  const RunConfig config = tiny_config({"uncertainty=true"});
  execute_tiny(config, "whole");
  execute_tiny(config, "threads", 3);
  CHECK(differences("whole", "threads") == std::vector<std::string>());
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "stopped", 1, false, [&] { return ++count == kPerFrame + 3; }), Interrupted);
  execute_tiny(config, "stopped", 2, true);
  CHECK(differences("whole", "stopped") == std::vector<std::string>());
}

TEST_CASE("a run without a stage that compares pixels cannot tell how sure it is") {
  RunConfig config = tiny_config({"uncertainty=true"});
  CHECK(stages_of_sigmas(config) == std::vector<std::size_t>{1});
  config.stages.pop_back();
  const std::vector<RunProblem> problems = run_problems(config, ConfigUse::kStages);
  REQUIRE(problems.size() == 1);
  CHECK(problems[0].pointer == "/uncertainty");
  CHECK_THAT(problems[0].text, Contains("compares images or masks; allowed: false"));
}

TEST_CASE("a damaged file of sigmas is refused", "[run]") {
  const TemporaryFolder here;
  const auto write = [](std::int64_t frames, std::int64_t joints, std::vector<double> numbers) {
    NpzWriter file;
    file.add<double>("trans", {2, 3}, std::vector<double>(6));
    file.add<double>("joint_sigma", {frames, joints, 2}, numbers);
    file.write("m.npz");
  };
  write(2, 22, std::vector<double>(88, 0.5));
  CHECK(read_joint_sigmas("m.npz").size() == 88);
  write(3, 22, std::vector<double>(132, 0.5));
  CHECK_THROWS_WITH(read_joint_sigmas("m.npz"), Contains("allowed: [T,J,2] for the T frames of the file"));
  write(2, 1, {0.1, 0.2, 0.3, -1});
  CHECK_THROWS_WITH(read_joint_sigmas("m.npz"), Contains("number 3 is -1; allowed: 0 or more"));
  write(2, 1, {0.1, 0.2, 0.3, 1});
  CHECK_THROWS_WITH(read_place_sigmas("m.npz", "o.npz", {}), Contains("is not of 22 joints"));
}

}  // namespace place_uncertainty_test
