// The seeds of a sweep over the benchmark's stand-ins are other videos, not the same one optimised anew.
#include <cmath>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/sweep/plan.h"
#include "pipelines/synthetic/dataset.h"
#include "tests/support/temporary_folder.h"

namespace instance_seeds_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr std::size_t kFrames = 3;

/// A dataset, wholly in memory.
struct Video {
  Clip clip;
  std::vector<ClipFrame> frames;

  const std::vector<SceneState>& truth() const { return *clip.truth; }
  Vector3<double> eye(std::size_t frame) const { return inverse(truth()[frame].camera_from_world).translation; }
  /// Numbers of the body's joints, without the root's.
  std::vector<double> pose(const BodyPose& body) const { return {body.axis_angle.begin() + 3, body.axis_angle.end()}; }
};

/// Two seeds of an instance, as a sweep makes them, small.
std::vector<Video> two_seeds(const TemporaryFolder& here, const std::string& instance) {
  const std::string folder = std::string(HSI4D_SOURCE_DIR) + "/configs/anyinteraction/";
  const nlohmann::json set = {{"synthetic.frames", kFrames},       {"synthetic.size_px", 64},
                              {"synthetic.supersample", 1},        {"synthetic.video", "png"},
                              {"synthetic.scene_gaussians", 3000}, {"synthetic.avatar_gaussians", 800},
                              {"synthetic.object_gaussians", 300}, {"synthetic.light.shadow", 0}};
  // Whoever has the instance's data has it elsewhere.
  const nlohmann::json clip = {{"config", folder + instance + ".json"}, {"set", {{"instance.folder", "not_here"}}}};
  here.write(
      instance + "_sweep.json",
      nlohmann::json{
          {"name", "seeds"}, {"base", folder + "base.json"}, {"clips", {{instance, clip}}}, {"seeds", 2}, {"set", set}}
          .dump());
  const std::vector<LossDescription> losses = descriptions_of(loss_terms());
  std::vector<Video> videos;
  for (const SweepRun& run : plan_sweep(instance + "_sweep.json", losses).runs) {
    const RunConfig config = load_run_config(here.write(instance + run.seed + ".json", run.config), {}, losses);
    const std::string dataset = instance + run.seed;
    write_dataset(config.synthetic, video_render_settings(), dataset);
    Video video{read_clip(dataset_inputs(dataset)), {}};
    for (Index t = 0; t < video.clip.frames(); ++t) video.frames.push_back(read_frame(video.clip, t));
    videos.push_back(std::move(video));
  }
  return videos;
}

double mean_difference(const Image& a, const Image& b) {
  REQUIRE(a.data().size() == b.data().size());
  double sum = 0;
  for (std::size_t i = 0; i < a.data().size(); ++i) sum += std::fabs(static_cast<double>(a.data()[i] - b.data()[i]));
  return sum / static_cast<double>(a.data().size());
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(squares);
}

std::vector<double> minus(std::vector<double> a, const std::vector<double>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
  return a;
}

/// Mean colour of the pixels that show the human.
Vector3<double> human_color(const ClipFrame& frame) {
  Vector3<double> sum = Vector3<double>::Zero();
  double pixels = 0;
  const std::size_t plane = frame.human_mask.data().size();
  for (std::size_t i = 0; i < plane; ++i) {
    if (frame.human_mask.data()[i] < 0.9F) continue;
    for (int c = 0; c < 3; ++c)
      sum[c] += static_cast<double>(frame.target.data()[static_cast<std::size_t>(c) * plane + i]);
    pixels += 1;
  }
  REQUIRE(pixels > 20);
  return sum / pixels;
}

}  // namespace

TEST_CASE("seeds of an instance are videos of other frames, timing, camera, clothes and noise", "[release]") {
  const TemporaryFolder here;
  for (const std::string instance : {"garden_vase", "gym_treadmill"}) {
    INFO(instance);
    const std::vector<Video> videos = two_seeds(here, instance);
    REQUIRE(videos.size() == 2);
    const Video &one = videos[0], &other = videos[1];
    REQUIRE(one.frames.size() == kFrames);
    for (std::size_t t = 0; t < kFrames; ++t) {
      INFO("frame " << t);
      CHECK(mean_difference(one.frames[t].target, other.frames[t].target) > 0.02);
      CHECK((one.eye(t) - other.eye(t)).norm() > 0.02);
    }
    // The motion is at another point of its course, and goes on at another speed.
    const auto step = [](const Video& v) {
      return minus(v.pose(v.truth()[kFrames - 1].body), v.pose(v.truth()[0].body));
    };
    CHECK(distance(one.pose(one.truth()[0].body), other.pose(other.truth()[0].body)) > 0.01);
    CHECK(distance(step(one), step(other)) > 0.01);
    // The camera drifts another way.
    CHECK(((one.eye(kFrames - 1) - one.eye(0)) - (other.eye(kFrames - 1) - other.eye(0))).norm() > 1e-3);
    // The estimator is wrong in other ways, by as much.
    const auto noise = [](const Video& v) { return minus(v.pose(v.clip.estimate[1]), v.pose(v.truth()[1].body)); };
    const std::vector<double> none(noise(one).size());
    CHECK(distance(noise(one), none) > 0.3);
    CHECK(distance(noise(one), noise(other)) > 0.3);
    CHECK(distance(noise(one), none) < 2 * distance(noise(other), none));
    CHECK(distance(noise(other), none) < 2 * distance(noise(one), none));
    CHECK((human_color(one.frames[0]) - human_color(other.frames[0])).norm() > 0.02);
  }
}

}  // namespace instance_seeds_test
