// `hsi4d render`: its files.
#include "pipelines/cli/render_command.h"

#include "core/exr.h"
#include "core/image_io.h"
#include "tests/pipelines/cli/render_files.h"

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("render writes image, alpha and depth, in the precision's type") {
  const Files files;
  for (const char* word : kWords) {
    INFO(word);
    CHECK(cli::render_command(render_options("a.npz", word)) == "a.npz: 37 x 23 pixels of 8 Gaussians\n");
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
  CHECK(cli::render_command(options) == "a.exr: 37 x 23 pixels of 8 Gaussians\n");
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
  CHECK(cli::render_command(options) == "three.npz: 37 x 23 pixels of 27 Gaussians\n");
  options.shared.scene = "all.ply";
  options.objects = {};
  options.out = "one.npz";
  cli::render_command(options);
  for (const char* name : {"image", "alpha", "depth"}) CHECK(numbers("three.npz", name) == numbers("one.npz", name));
}

TEST_CASE("a scene without Gaussians is its background") {
  const Files files;
  write_ply("scene.ply", Gaussians{});
  for (const char* word : kWords) {
    INFO(word);
    CHECK(cli::render_command(render_options("a.npz", word)) == "a.npz: 37 x 23 pixels of 0 Gaussians\n");
    const std::vector<double> image = numbers("a.npz", "image"), alpha = numbers("a.npz", "alpha");
    for (std::size_t i = 0; i < image.size(); ++i)
      CHECK(image[i] == Approx(0.1 * static_cast<double>(i % 3 + 1)).epsilon(1e-7));
    for (const double value : alpha) CHECK(value == 0);
    cli::gradients_command(gradients_options("g.npz", word));
    CHECK(Npz::read("g.npz").array("means").shape() == std::vector<std::int64_t>{0, 3});
    CHECK(numbers("g.npz", "camera") == std::vector<double>(6));
  }
}
