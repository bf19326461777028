#include "pipelines/run/checkpoint.h"

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>

#include <catch2/catch.hpp>

#include "body/body_model.h"
#include "core/check.h"
#include "core/random.h"
#include "core/simd.h"
#include "optim/checkpoint.h"
#include "tests/support/temporary_folder.h"

namespace checkpoint_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kStages = 2;
const std::string kFile = "progress.npz", kConfig = "{\"seed\": 1}\n";

SceneState random_state(RandomSequence& random) {
  SceneState state;
  const auto draw = [&random] { return Vector3<double>(random.normal(), random.normal(), random.normal()); };
  for (Index i = 0; i < 9; ++i) state.camera_from_world.rotation(i / 3, i % 3) = random.normal();
  state.camera_from_world.translation = draw();
  for (int o = 0; o < 2; ++o) state.objects.push_back({draw(), draw()});
  state.body = rest_pose(kSmplxJoints);
  state.body.transl = draw();
  for (double& x : state.body.axis_angle) x = random.normal();
  return state;
}

/// A clip of three frames and two objects, as far as progress is concerned: no Gaussians.
Clip three_frames() {
  Clip clip;
  clip.camera.width = 24;
  clip.camera.height = 20;
  clip.objects.resize(2);
  clip.first.objects.resize(2);
  clip.first.body = rest_pose(kSmplxJoints);
  clip.first.body.transl = {0.1, 0.2, 1.1};
  clip.frame_files = {"0000.png", "0001.png", "0002.png"};
  return clip;
}

/// Two of three frames done, every number another one, with the values that are easily lost.
RunProgress random_progress(const Clip& clip) {
  RunProgress progress = first_progress(clip, kStages);
  RandomSequence random(5);
  for (auto& stage : progress.after_stage) stage.push_back(random_state(random));
  progress.after_stage[1][1].body.axis_angle[7] = -0.0;
  progress.after_stage[1][1].body.axis_angle[8] = 5e-324;
  progress.totals = {{30, 1, 0.1, 9, 2065, 67984}, {150, 0, 1.0 / 3, 10, 3000, 80000}};
  progress.image_errors.push_back({{"psnr_db", 30.123456789012345},
                                   {"psnr_foreground_db", 20.5},
                                   {"psnr_background_db", 31},
                                   {"ssim", 0.9},
                                   {"silhouette_iou", 0.875}});
  progress.start_errors.push_back({{"psnr_db", 18.5}, {"ssim", 0.25}});
  progress.inputs = "cbf29ce484222325 /data/scene\n- masks/human/0001.png\n";
  progress.covered(0, 3, 4) = 1;
  progress.seconds = 12.345;
  progress.start.frames[1] = {1, 0, 2};
  progress.start.seconds = 0.125;
  progress.colors.curvature["camera"] = {1, -0.0, 0.25, 1.0 / 3};
  return progress;
}

bool same_bits(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }

bool same_bits(const Vector3<double>& a, const Vector3<double>& b) {
  return same_bits(a[0], b[0]) && same_bits(a[1], b[1]) && same_bits(a[2], b[2]);
}

bool same_bits(const SceneState& a, const SceneState& b) {
  bool same = same_bits(a.camera_from_world.translation, b.camera_from_world.translation) &&
              a.objects.size() == b.objects.size() && same_bits(a.body.transl, b.body.transl) &&
              a.body.axis_angle.size() == b.body.axis_angle.size();
  for (Index i = 0; i < 9; ++i) {
    same = same && same_bits(a.camera_from_world.rotation(i / 3, i % 3), b.camera_from_world.rotation(i / 3, i % 3));
  }
  for (std::size_t o = 0; same && o < a.objects.size(); ++o) {
    same = same_bits(a.objects[o].rotation, b.objects[o].rotation) &&
           same_bits(a.objects[o].translation, b.objects[o].translation);
  }
  for (std::size_t i = 0; same && i < a.body.axis_angle.size(); ++i) {
    same = same_bits(a.body.axis_angle[i], b.body.axis_angle[i]);
  }
  return same;
}

std::string loading_error(const Clip& clip, std::size_t stages = kStages, const std::string& config = kConfig) {
  try {
    load_progress(kFile, config, clip, stages);
  } catch (const DataError& error) {
    return error.what();
  }
  return "no error";
}

/// The checkpoint of random_progress with one entry replaced.
void save_with(const Clip& clip, const std::string& name, Checkpoint::Value value) {
  save_progress(kFile, kConfig, random_progress(clip));
  Checkpoint checkpoint = load_checkpoint(kFile, text_hash(kConfig));
  checkpoint.set(name, std::move(value));
  checkpoint.save(kFile, text_hash(kConfig));
}

}  // namespace

TEST_CASE("progress begins with the given frame alone") {
  const Clip clip = three_frames();
  const RunProgress progress = first_progress(clip, kStages);
  CHECK(progress.frames_done() == 1);
  CHECK(RunProgress{}.frames_done() == 0);
  REQUIRE(progress.after_stage.size() == kStages);
  CHECK(same_bits(progress.after_stage[1][0], clip.first));
  CHECK(progress.totals.size() == kStages);
  CHECK(progress.image_errors.size() == 1);
  CHECK(progress.covered.width() == 24);
  CHECK(progress.covered.height() == 20);
}

TEST_CASE("progress survives its checkpoint bit for bit") {
  const TemporaryFolder here;
  const Clip clip = three_frames();
  const RunProgress saved = random_progress(clip);
  save_progress(kFile, kConfig, saved);
  CHECK(std::distance(fs::directory_iterator("."), fs::directory_iterator()) == 1);
  const RunProgress read = load_progress(kFile, kConfig, clip, kStages);
  CHECK(read.frames_done() == 2);
  REQUIRE(read.after_stage.size() == kStages);
  for (std::size_t s = 0; s < kStages; ++s) {
    for (std::size_t t = 0; t < 2; ++t) {
      INFO("stage " << s << ", frame " << t);
      CHECK(same_bits(read.after_stage[s][t], saved.after_stage[s][t]));
    }
    CHECK(read.totals[s].iterations == saved.totals[s].iterations);
    CHECK(read.totals[s].rollbacks == saved.totals[s].rollbacks);
    CHECK(read.totals[s].tiles == saved.totals[s].tiles);
    CHECK(read.totals[s].pairs == saved.totals[s].pairs);
    CHECK(read.totals[s].fragments == saved.totals[s].fragments);
    CHECK(same_bits(read.totals[s].seconds, saved.totals[s].seconds));
  }
  CHECK(read.colors.curvature == saved.colors.curvature);
  CHECK(read.start_errors == saved.start_errors);
  CHECK(read.inputs == saved.inputs);
  CHECK(read.image_errors == saved.image_errors);  // in the same order, which summary.json shows
  CHECK(same_bits(read.seconds, saved.seconds));
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 24; ++x) {
      INFO("pixel " << x << ", " << y);
      CHECK(read.covered(0, y, x) == saved.covered(0, y, x));
    }
  }
}

TEST_CASE("what came after the first pass survives its checkpoint bit for bit") {
  using Scope = StageScope;
  constexpr std::array<Scope, 4> kOver = {Scope::kSequence, Scope::kFrame, Scope::kFrame, Scope::kSequence};
  const TemporaryFolder here;
  const Clip clip = three_frames();
  RunProgress saved = random_progress(clip);
  RandomSequence random(7);
  for (const std::size_t frames : {3, 2, 2}) {
    LaterStage& stage = saved.later.emplace_back();
    for (std::size_t t = 0; t < frames; ++t) stage.states.push_back(random_state(random));
    stage.totals = {static_cast<Index>(random.below(100)), 1, 0.1, 9, 2065, 67984};
  }
  saved.bias = DepthBias{1.003, {0.999, 1}};
  saved.seen = {{1, 1}, {0.25, 0}};
  saved.left_out = {{4, 1, 1, "center", "it is hidden"}};
  save_progress(kFile, kConfig, saved);
  const RunProgress read = load_progress(kFile, kConfig, clip, kStages, {}, 0, kOver);
  REQUIRE(read.later.size() == 3);
  for (std::size_t s = 0; s < 3; ++s) {
    REQUIRE(read.later[s].states.size() == saved.later[s].states.size());
    for (std::size_t t = 0; t < read.later[s].states.size(); ++t)
      CHECK(same_bits(read.later[s].states[t], saved.later[s].states[t]));
    CHECK(read.later[s].totals.iterations == saved.later[s].totals.iterations);
  }
  REQUIRE(read.bias.has_value());
  CHECK(read.bias->human == 1.003);
  CHECK(read.seen == saved.seen);
  CHECK(read.bias->objects == std::vector<double>{0.999, 1});
  CHECK(read.left_out.size() == 1);
}

TEST_CASE("frames that stages after the first pass cannot have done are refused") {
  using Scope = StageScope;
  constexpr std::array<Scope, 4> kOver = {Scope::kSequence, Scope::kFrame, Scope::kFrame, Scope::kSequence};
  const TemporaryFolder here;
  const Clip clip = three_frames();
  const auto error_of = [&](const std::vector<std::size_t>& frames) {
    RunProgress progress = random_progress(clip);
    for (const std::size_t count : frames) progress.later.push_back({std::vector(count, clip.first), {}});
    save_progress(kFile, kConfig, progress);
    try {
      load_progress(kFile, kConfig, clip, kStages, {}, 0, kOver);
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  using Frames = std::vector<std::size_t>;
  for (const Frames& frames : {Frames{}, Frames{3}, Frames{3, 1, 1}, Frames{3, 2, 2}, Frames{3, 3, 3, 3}})
    CHECK(error_of(frames) == "no error");
  for (const Frames& frames : {Frames{2}, Frames{4}, Frames{3, 2}, Frames{3, 3}, Frames{3, 2, 1}, Frames{3, 0, 0},
                               Frames{3, 3, 2}, Frames{3, 2, 2, 3}, Frames{3, 3, 3, 3, 3}})
    CHECK(error_of(frames) ==
          kFile +
              ": \"later/frames\" holds numbers of frames that the 4 stages after the first pass cannot have done in "
              "a clip of 3");
}

TEST_CASE("a checkpoint names its instruction set, and one of a version that did not is read") {
  const TemporaryFolder here;
  const Clip clip = three_frames();
  save_progress(kFile, kConfig, random_progress(clip));
  CHECK(load_progress(kFile, kConfig, clip, kStages).isa == isa_name(best_isa()));
  std::string bytes = file_text(kFile);
  const std::string name = "instruction_set";
  int places = 0;  // of the name in the archive, which has no sum over it
  for (std::size_t at = 0; (at = bytes.find(name, at)) != std::string::npos; ++places)
    bytes.replace(at, name.size(), "something_older");
  CHECK(places == 2);
  here.write(kFile, bytes);
  const RunProgress read = load_progress(kFile, kConfig, clip, kStages);
  CHECK(read.isa.empty());
  CHECK(read.frames_done() == 2);
}

TEST_CASE("frames without a foreground keep that they have none") {
  const TemporaryFolder here;
  const Clip clip = three_frames();
  RunProgress saved = random_progress(clip);
  saved.image_errors[1] = {{"psnr_db", 30}, {"ssim", 0.9}};
  save_progress(kFile, kConfig, saved);
  CHECK(load_progress(kFile, kConfig, clip, kStages).image_errors == saved.image_errors);
}

TEST_CASE("a checkpoint of another run is refused with what differs") {
  const TemporaryFolder here;
  const Clip clip = three_frames();
  save_progress(kFile, kConfig, random_progress(clip));
  CHECK(loading_error(clip) == "no error");
  CHECK_THAT(loading_error(clip, kStages, "{\"seed\": 2}\n"), Contains("progress.npz") && Contains("config"));
  CHECK(
      loading_error(clip, 3) ==
      "progress.npz: \"states\" holds 768 numbers, this clip needs 1152; the inputs have changed since the run began");
  Clip other = three_frames();
  other.objects.pop_back();
  other.first.objects.pop_back();
  CHECK(loading_error(other) ==
        "progress.npz: \"states\" holds 768 numbers, this clip needs 744; the inputs have changed since the run began");
  other = three_frames();
  std::swap(other.camera.width, other.camera.height);
  CHECK(loading_error(other) ==
        "progress.npz: of a video of 24x20 pixels, the camera's image is 20x24; the inputs have changed since the run "
        "began");
  other = three_frames();
  other.frame_files.resize(1);
  CHECK(loading_error(other) == "progress.npz: 2 frames done, the clip has 1");
}

TEST_CASE("a checkpoint with entries that cannot be is refused, whatever they are") {
  const TemporaryFolder here;
  const Clip clip = three_frames();
  const auto error_with = [&clip](const std::string& name, Checkpoint::Value value) {
    save_with(clip, name, std::move(value));
    return loading_error(clip);
  };
  using Integers = std::vector<std::int64_t>;
  using Doubles = std::vector<double>;
  CHECK(error_with("frames", Integers{0}) == "progress.npz: 0 frames done, the clip has 3");
  CHECK(error_with("frames", Integers{-1}) == "progress.npz: -1 frames done, the clip has 3");
  CHECK_THAT(error_with("frames", Integers{3}), Contains("\"states\" holds 768 numbers, this clip needs 1152"));
  CHECK_THAT(error_with("frames", Integers{}), Contains("\"frames\" holds 0 numbers, this clip needs 1"));
  CHECK_THAT(error_with("frames", Doubles{2}), Contains("frames"));
  CHECK_THAT(error_with("counts", Integers{1}), Contains("\"counts\" holds 1 numbers, this clip needs 10"));
  CHECK_THAT(error_with("seconds", Doubles{}), Contains("\"seconds\" holds 0 numbers, this clip needs 3"));
  CHECK(error_with("states", Doubles(768, std::nan(""))) ==
        "progress.npz: \"states\" holds a number that is not finite");
  CHECK_THAT(error_with("size_px", Integers{24}), Contains("\"size_px\" holds 1 numbers, this clip needs 2"));
  CHECK_THAT(error_with("covered", std::vector<float>(481)),
             Contains("\"covered\" holds 481 numbers, this clip needs 480"));
  CHECK_THAT(error_with("image_errors/1/ssim", Doubles{}), Contains("\"image_errors/1/ssim\" holds 0 numbers"));
}

TEST_CASE("groups without a gradient are in a checkpoint, and nothing that is not of the clip") {
  const TemporaryFolder here;
  const Clip clip = three_frames();
  RunProgress progress = random_progress(clip);
  progress.still = {{0, 1, "camera"}, {1, 2, "body_pose"}};
  save_progress(kFile, kConfig, progress);
  const std::vector<StillGroup> read = load_progress(kFile, kConfig, clip, kStages).still;
  REQUIRE(read.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(read[i].stage == progress.still[i].stage);
    CHECK(read[i].frame == progress.still[i].frame);
    CHECK(read[i].group == progress.still[i].group);
  }
  for (const std::string line : {"2 1 camera", "0 3 camera", "0 0 camera", "-1 1 camera", "0 1", "x"}) {
    INFO(line);
    save_with(clip, "still", line + "\n");
    CHECK(loading_error(clip) ==
          kFile + ": \"still\" holds \"" + line + "\", which is no stage, frame and group of this clip");
  }
}

TEST_CASE("stages that left the range of an approximation are in a checkpoint, and nothing that is not of the clip") {
  const TemporaryFolder here;
  const Clip clip = three_frames();
  RunProgress progress = random_progress(clip);
  progress.left_ranges = {{0, 1, "hold_colors"}, {1, 2, "seen_within_deg"}};
  save_progress(kFile, kConfig, progress);
  const std::vector<LeftRange> read = load_progress(kFile, kConfig, clip, kStages).left_ranges;
  REQUIRE(read.size() == 2);
  CHECK((read[0].stage == 0 && read[0].frame == 1 && read[0].setting == "hold_colors"));
  CHECK((read[1].stage == 1 && read[1].frame == 2 && read[1].setting == "seen_within_deg"));
  save_with(clip, "left_ranges", "2 1 hold_colors\n");
  CHECK(loading_error(clip) ==
        kFile + ": \"left_ranges\" holds \"2 1 hold_colors\", which is no stage, frame and setting of this clip");
}

TEST_CASE("what losses left out is in a checkpoint, and nothing that is not of the clip") {
  const TemporaryFolder here;
  const Clip clip = three_frames();
  RunProgress progress = random_progress(clip);
  progress.left_out = {{0, 1, 1, "center", "it is hidden"}, {1, 1, 0, "a term of mine", "100 % off"}};
  save_progress(kFile, kConfig, progress);
  const std::vector<LeftOutInFrame> read = load_progress(kFile, kConfig, clip, kStages).left_out;
  REQUIRE(read.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(read[i].stage == progress.left_out[i].stage);
    CHECK(read[i].frame == progress.left_out[i].frame);
    CHECK(read[i].object == progress.left_out[i].object);
    CHECK(read[i].term == progress.left_out[i].term);
    CHECK(read[i].reason == progress.left_out[i].reason);
  }
  for (const std::string line : {"2 1 0 a\tb", "0 3 0 a\tb", "0 0 0 a\tb", "0 1 2 a\tb", "0 1 -1 a\tb", "x", "0 1 0"}) {
    INFO(line);
    save_with(clip, "left_out", line + "\n");
    CHECK(loading_error(clip) == kFile + ": \"left_out\" holds \"" + line +
                                     "\", which is no stage, frame, object, term and reason of this clip");
  }
}

}  // namespace checkpoint_test
