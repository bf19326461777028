// `hsi4d render`: its files.
#include "pipelines/cli/render_command.h"

#include <utility>

#include "core/exr.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/rotation.h"
#include "pipelines/input/state.h"
#include "splat/files/transform.h"
#include "tests/pipelines/cli/render_files.h"

namespace render_command_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// What render tells beside the count: brute force does not know how many were drawn.
std::string drawn(const std::string& word, int count) {
  return word == "reference" ? "" : ", " + std::to_string(count) + " of them drawn";
}

}  // namespace

TEST_CASE("render writes image, alpha and depth, in the precision's type") {
  const Files files;
  for (const char* word : kWords) {
    INFO(word);
    CHECK(cli::render_command(render_options("a.npz", word)) ==
          "a.npz: 37 x 23 pixels of 8 Gaussians" + drawn(word, 8) + "\n");
    const Npz npz = Npz::read("a.npz");
    CHECK(npz.names() == std::vector<std::string>{"image", "alpha", "depth"});
    CHECK(npz.array("image").shape() == std::vector<std::int64_t>{kHeight, kWidth, 3});
    CHECK(npz.array("alpha").shape() == std::vector<std::int64_t>{kHeight, kWidth});
    CHECK(npz.array("depth").shape() == std::vector<std::int64_t>{kHeight, kWidth});
    for (const char* name : {"image", "alpha", "depth"})
      CHECK(npz.array(name).dtype() == (std::string(word) == "float" ? "<f4" : "<f8"));
    const std::vector<double> image = numbers("a.npz", "image"), alpha = numbers("a.npz", "alpha"),
                              depth = numbers("a.npz", "depth");
    int empty = 0, covered = 0;
    for (std::size_t i = 0; i < alpha.size(); ++i) {
      if (alpha[i] == 0) {
        ++empty;
        CHECK(depth[i] == 0);
        CHECK(image[3 * i] == Approx(0.1).epsilon(1e-7));
        CHECK(image[3 * i + 2] == Approx(0.3).epsilon(1e-7));
      } else {
        ++covered;
        CHECK(depth[i] > 1.5);
        CHECK(depth[i] < 5);
      }
    }
    CHECK(empty > 20);
    CHECK(covered > 200);
  }
}

TEST_CASE("the three precisions render the same image") {
  const Files files;
  for (const char* word : kWords) cli::render_command(render_options(std::string(word) + ".npz", word));
  for (const char* name : {"image", "alpha", "depth"}) {
    INFO(name);
    CHECK(relative_difference(numbers("double.npz", name), numbers("reference.npz", name)) < 1e-12);
    CHECK(relative_difference(numbers("float.npz", name), numbers("reference.npz", name)) < 3e-6);
  }
}

TEST_CASE("render writes the same image to EXR and PNG") {
  const Files files;
  cli::RenderOptions options = render_options("a.npz", "float");
  options.shared.background = "-0.5,0.25,1.5";
  cli::render_command(options);
  options.out = "a.exr";
  CHECK(cli::render_command(options) == "a.exr: 37 x 23 pixels of 8 Gaussians, 8 of them drawn\n");
  options.out = "traced.exr";  // with depth, which the others are without
  options.pixels = {"3,4"};
  cli::render_command(options);
  CHECK(file_text("traced.exr") == file_text("a.exr"));
  options.pixels.clear();
  options.out = "a.PNG";
  cli::render_command(options);
  const std::vector<double> image = numbers("a.npz", "image");
  CHECK(read_layers("a.exr").names == std::vector<std::string>{"B", "G", "R"});
  const std::vector<float> exr = to_interleaved(read_image("a.exr")), png = to_interleaved(read_image("a.PNG"));
  REQUIRE(exr.size() == image.size());
  REQUIRE(png.size() == image.size());
  for (std::size_t i = 0; i < image.size(); ++i) {
    CHECK(static_cast<double>(exr[i]) == image[i]);
    CHECK(std::fabs(static_cast<double>(png[i]) - std::clamp(image[i], 0.0, 1.0)) <= 0.5001 / 255);
  }
}

TEST_CASE("objects are drawn beside the scene, as they lie in their files") {
  const Files files;
  const Gaussians a = test_gaussians(1), b = test_gaussians(2), c = test_gaussians(3);
  const std::array<const Gaussians*, 3> parts = {&a, &b, &c};
  write_ply("a.ply", a);
  write_ply("b.ply", b);
  write_ply("c.ply", c);
  write_ply("all.ply", concatenated(parts));
  cli::RenderOptions options = render_options("three.npz", "double");
  options.shared.scene = "a.ply";
  options.objects = {"b.ply", "c.ply"};
  CHECK_THAT(cli::render_command(options), Catch::Matchers::StartsWith("three.npz: 37 x 23 pixels of 27 Gaussians, "));
  options.shared.scene = "all.ply";
  options.objects = {};
  options.out = "one.npz";
  cli::render_command(options);
  for (const char* name : {"image", "alpha", "depth"}) CHECK(numbers("three.npz", name) == numbers("one.npz", name));
}

TEST_CASE("objects are drawn where a run's poses put them") {
  const Files files;
  const Gaussians scene = test_gaussians(1), object = test_gaussians(2);
  write_ply("scene.ply", scene);
  std::filesystem::create_directory("objects");
  write_ply("objects/cup.ply", object);
  std::vector<SceneState> frames(3);
  for (SceneState& frame : frames) frame.objects.resize(1);
  frames[2].objects[0] = {{0.3, -0.2, 0.9}, {0.2, 0.1, 3}};
  write_object_tracks("objects.npz", {"cup"}, frames);
  // The same by hand: centred, turned, moved.
  Vector3<double> centroid = Vector3<double>::Zero();
  for (Index i = 0; i < object.count(); ++i)
    centroid += Vector3<float>(object.means.data() + 3 * i).cast<double>() / static_cast<double>(object.count());
  Similarity centring, move;
  centring.translation = -centroid - object.origin_world;
  move.rotation = so3_exp(frames[2].objects[0].rotation);
  move.translation = frames[2].objects[0].translation;
  write_ply("moved.ply", transformed(transformed(object, centring), move));

  cli::RenderOptions options = render_options("posed.npz", "double");
  options.objects = {"objects/cup.ply"};
  options.object_poses = "objects.npz";
  options.frame = 2;
  CHECK_THAT(cli::render_command(options), Catch::Matchers::EndsWith(" of them drawn\n"));
  options.objects = {"moved.ply"};
  options.object_poses = "";
  options.frame = 0;
  options.out = "moved.npz";
  cli::render_command(options);
  for (const char* name : {"image", "alpha", "depth"})
    CHECK(relative_difference(numbers("posed.npz", name), numbers("moved.npz", name)) < 1e-5);
  options.objects = {"objects/cup.ply"};  // elsewhere without its pose
  cli::render_command(options);
  CHECK(relative_difference(numbers("posed.npz", "image"), numbers("moved.npz", "image")) > 1e-2);

  options.object_poses = "objects.npz";
  options.frame = 3;
  CHECK(fault([&] { cli::render_command(options); }) ==
        "hsi4d render: --frame: objects.npz has no frame 3; allowed: 0 to 2");
  options.objects = {"moved.ply"};
  CHECK_THAT(fault([&] { cli::render_command(options); }), Catch::Matchers::Contains("moved/rotation"));
  options.objects = {};
  CHECK_THAT(fault([&] { cli::render_command(options); }), Catch::Matchers::Contains("--objects is given without"));
}

TEST_CASE("a camera that sees nothing is warned of, with the convention") {
  const Files files;
  Camera camera = read_camera("camera.json");
  camera.camera_from_world = look_at({0.4, -3, 0.7}, {0.8, -6, 1.3});  // as one is that has its z axis backwards
  write_camera("camera.json", camera);
  for (const char* word : kWords) {
    INFO(word);
    std::string told;
    const LogSink sink = log_to([&told](LogLevel, std::string_view message) { told += message; });
    CHECK_THAT(cli::render_command(render_options("a.npz", word)),
               Catch::Matchers::Contains("of 8 Gaussians" + drawn(word, 0)));
    CHECK_THAT(
        told,
        Catch::Matchers::EndsWith(
            "no Gaussian is drawn: the camera sees none of 8. Its pose must be camera_from_world in OpenCV's axes (x "
            "right, y down, z forward), in metres"));
    const std::string of_render = std::exchange(told, "");
    CHECK_THAT(cli::render_command(render_options("a.exr", word)),
               Catch::Matchers::Contains("of 8 Gaussians" + drawn(word, 0)));
    CHECK(std::exchange(told, "") == of_render);
    cli::gradients_command(gradients_options("g.npz", word));
    CHECK(told == of_render);
    CHECK(numbers("g.npz", "camera") == std::vector<double>(6));
    write_camera("seeing.json", test_camera());
    told.clear();
    cli::GradientsOptions seeing = gradients_options("g.npz", word);
    seeing.shared.camera = "seeing.json";
    cli::gradients_command(seeing);
    CHECK(told.find("no Gaussian is drawn") == std::string::npos);
  }
}

TEST_CASE("Gaussians that are all too faint are warned of, and not the camera") {
  const Files files;
  Gaussians faint = test_gaussians();
  std::fill(faint.opacity_logits.begin(), faint.opacity_logits.end(), -13.8155106F);  // 1e-6
  write_ply("scene.ply", faint);
  for (const char* word : kWords) {
    INFO(word);
    std::string told;
    const LogSink sink = log_to([&told](LogLevel, std::string_view message) { told = message; });
    cli::render_command(render_options("a.npz", word));
    CHECK(told.find("no Gaussian is drawn: the opacity of all 9 is at most 1e-06, below render.alpha_min, 0.0039") ==
          0);
  }
}

TEST_CASE("a scene without Gaussians is its background") {
  const Files files;
  write_ply("scene.ply", Gaussians{});
  for (const char* word : kWords) {
    INFO(word);
    std::vector<std::string> told;
    const LogSink sink = log_to([&told](LogLevel, std::string_view message) { told.emplace_back(message); });
    CHECK(cli::render_command(render_options("a.npz", word)) ==
          "a.npz: 37 x 23 pixels of 0 Gaussians" + drawn(word, 0) + "\n");
    CHECK(told == std::vector<std::string>{"no Gaussian is drawn: the files hold none"});
    cli::render_command(render_options("a.png", word));
    CHECK(std::exchange(told, {told.back()}) == std::vector<std::string>(2, told.back()));
    const std::vector<double> image = numbers("a.npz", "image"), alpha = numbers("a.npz", "alpha");
    for (std::size_t i = 0; i < image.size(); ++i)
      CHECK(image[i] == Approx(0.1 * static_cast<double>(i % 3 + 1)).epsilon(1e-7));
    for (const double value : alpha) CHECK(value == 0);
    cli::gradients_command(gradients_options("g.npz", word));
    CHECK(told.size() == 2);
    CHECK(told.back() == told.front());
    CHECK(Npz::read("g.npz").array("means").shape() == std::vector<std::int64_t>{0, 3});
    CHECK(numbers("g.npz", "camera") == std::vector<double>(6));
  }
}

}  // namespace render_command_test
