#include "pipelines/record/results.h"

#include <cmath>
#include <cstdlib>
#include <numbers>

#include <catch2/catch.hpp>

#include "body/avatar_shape.h"
#include "body/motion_io.h"
#include "core/image_io.h"
#include "core/rotation.h"
#include "core/video.h"
#include "pipelines/input/body_files.h"
#include "splat/files/splat_file.h"
#include "tests/support/tiny_run.h"

namespace results_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// A variable of the environment that has another value while this lives.
class ChangedVariable {
 public:
  ChangedVariable(const char* name, const char* value) : name_(name), before_(std::getenv(name)) {
    setenv(name, value, 1);
  }
  ~ChangedVariable() { setenv(name_, before_.c_str(), 1); }
  ChangedVariable(const ChangedVariable&) = delete;
  ChangedVariable& operator=(const ChangedVariable&) = delete;

 private:
  const char* name_;
  std::string before_;
};

/// Mean difference of a panel of a preview's frame from an image.
double difference_of_panel(const Image& preview, int panel, const Image& image) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x)
        sum += std::fabs(preview(c, y, panel * image.width() + x) - image(c, y, x));
    }
  }
  return sum / (3.0 * image.height() * image.width());
}

Image mean_of(const Image& a, const Image& b) {
  Image mean = a;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) mean(c, y, x) = 0.5F * (a(c, y, x) + b(c, y, x));
    }
  }
  return mean;
}

}  // namespace

TEST_CASE("a camera turned about a pivot sees it at the same place, from another side") {
  const Rigid<double> camera = look_at({3, -2, 1.5}, {0.2, 0.1, 0.9});
  const Vector3<double> pivot(0.3, -0.1, 1);
  const Rigid<double> turned = turned_camera(camera, pivot, std::numbers::pi / 2);
  CHECK((transform_point(turned, pivot) - transform_point(camera, pivot)).norm() < 1e-12);
  const auto center = [](const Rigid<double>& c) -> Vector3<double> {
    return -(c.rotation.transpose() * c.translation);
  };
  const Vector3<double> before = center(camera) - pivot, after = center(turned) - pivot;
  CHECK((after - Vector3<double>(-before[1], before[0], before[2])).norm() < 1e-12);  // counter-clockwise from above
  CHECK((turned.rotation * Vector3<double>(0, 0, 1) - camera.rotation * Vector3<double>(0, 0, 1)).norm() < 1e-12);
}

TEST_CASE("a run leaves its result in forms that other programs take", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config({"log.preview=true"}), "run");
  const RunPaths paths{"run"};
  const Motion motion = read_motion(paths.motion()), dense = read_motion(paths.motion_at_30());
  CHECK(dense.frame_rate == 30);
  REQUIRE(dense.poses.size() == 3 * (motion.poses.size() - 1) + 1);
  for (std::size_t t = 0; t < motion.poses.size(); ++t)
    CHECK((dense.poses[3 * t].transl - motion.poses[t].transl).norm() < 1e-12);
  VideoReader preview(paths.preview());
  CHECK(preview.frames() == kTinyFrames);
  CHECK(preview.frame_rate() == 10);
  const Image frame = preview.read(2);
  CHECK(frame.width() == 4 * kTinyPixels);
  CHECK(frame.height() == kTinyPixels);
  CHECK(std::filesystem::exists(paths.body()));
  CHECK(read_text_file("run/log.txt").find("not written") == std::string::npos);
}

TEST_CASE("the body of another avatar is not written, and the log says so", "[run]") {
  const TemporaryFolder here;
  RunConfig config = tiny_config();
  config.body.shape = {8};  // much taller
  execute_tiny(config, "run");
  CHECK_FALSE(std::filesystem::exists(RunPaths{"run"}.body()));
  CHECK(read_text_file("run/log.txt").find("body.glb is not written: joints of the avatar are ") != std::string::npos);
}

TEST_CASE("a run takes the shape of its body from the avatar, and refuses another one", "[run]") {
  const TemporaryFolder here;
  Avatar tall;
  RunConfig config = tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1"});
  const std::vector<double> betas = {1.5, -0.5};
  BodySettings body;
  body.shape = betas;
  tall = surface_avatar(rest_body(body), {.gaussians = 500});
  SafetensorsWriter file = avatar_file(tall);
  add_avatar_shape({tall.body, betas}, file);
  file.write("tall.safetensors");
  config.data.avatar = "tall.safetensors";
  execute_tiny(config, "run");
  CHECK(std::filesystem::exists(RunPaths{"run"}.body()));
  config.body.shape = {1.5, -0.5, 0};  // the same
  execute_tiny(config, "same");
  config.body.shape = {1.5};
  CHECK_THROWS_WITH(execute_tiny(config, "other"),
                    "/body/shape: is [1.5]; the avatar tall.safetensors was made in the shape [1.5, -0.5]; leave "
                    "body.shape out, or take an avatar of that shape");
  CHECK_FALSE(std::filesystem::exists("other"));
}

TEST_CASE("a preview shows the video, the reconstruction, both, and another side", "[run]") {
  const TemporaryFolder here;
  // A wide pixel filter makes the reconstruction another picture than the video.
  execute_tiny(tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1", "render.blur=3",
                            "log.preview=true"}),
               "run");
  const RunPaths paths{"run"};
  VideoReader preview(paths.preview());
  REQUIRE(preview.frames() == kTinyFrames);
  for (int t = 1; t < kTinyFrames; ++t) {
    const Image frame = preview.read(t);
    const Image target = read_image(paths.frame_image(t, "target")),
                render = read_image(paths.frame_image(t, "render"));
    const Image* const expected[] = {&target, &render};
    for (int panel = 0; panel < 2; ++panel) {
      const double same = difference_of_panel(frame, panel, *expected[panel]);
      const double other = difference_of_panel(frame, panel, *expected[1 - panel]);
      INFO("frame " << t << ", panel " << panel << ": " << same << ", of the other image " << other);
      CHECK(same < 0.03);
      CHECK(other > 2 * same);
    }
    const double both = difference_of_panel(frame, 2, mean_of(target, render)),
                 side = difference_of_panel(frame, 3, render);
    INFO("both " << both << ", another side " << side);
    CHECK(both < 0.03);
    CHECK(side > 0.1);
  }
}

TEST_CASE("beside a scene that ends, another side has the colour of the video", "[run]") {
  const TemporaryFolder here;
  RunConfig config = tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1"});
  const std::vector<Index> first = {0};
  Gaussians dot = selected(read_splats(config.data.scene.string()).gaussians, first);
  dot.log_scales = {-7, -7, -7};
  write_splats("dot.ply", dot);
  config.data.scene = "dot.ply";
  execute_tiny(config, "run");
  const RunPaths paths{"run"};
  const Image video = read_image(paths.frame_image(0, "target")), side = read_image(paths.frame_image(2, "side")),
              front = read_image(paths.frame_image(2, "render"));
  for (int c = 0; c < 3; ++c) {
    double mean = 0;
    for (int y = 0; y < video.height(); ++y) {
      for (int x = 0; x < video.width(); ++x) mean += static_cast<double>(video(c, y, x));
    }
    CHECK(static_cast<double>(side(c, 0, 0)) == Approx(mean / (video.height() * video.width())).margin(0.005));
    CHECK(front(c, 0, 0) == 0);
  }
}

TEST_CASE("without ffmpeg a run is done all the same, and its log says what is not there", "[run]") {
  const TemporaryFolder here;
  const RunConfig config =
      tiny_config({"stages.camera.iterations=1", "stages.interaction.iterations=1", "log.preview=true"});
  {
    const ChangedVariable nowhere("PATH", here.path().c_str());
    execute_tiny(config, "run");
  }
  CHECK(json_of("run/status.json")["state"] == "done");
  CHECK_FALSE(std::filesystem::exists("run/preview.mp4"));
  CHECK(temporaries_in("run").empty());
  for (const char* name : {"motion.npz", "body.glb", "summary.json", "report.html"}) {
    INFO(name);
    CHECK(std::filesystem::exists(std::filesystem::path("run") / name));
  }
  CHECK_THAT(file_text("run/log.txt"),
             Catch::Matchers::Contains(" warning preview.mp4 is not written: ffmpeg: cannot be run: No such file or "
                                       "directory; is it installed, and in PATH?\n"));
  execute_tiny(config, "run", 1, true);  // and with it, later
  CHECK(std::filesystem::exists("run/preview.mp4"));
}

}  // namespace results_test
