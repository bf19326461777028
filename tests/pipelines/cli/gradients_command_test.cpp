// `hsi4d gradients`: its files, and that the numbers in them are right.
#include "pipelines/cli/gradients_command.h"

#include "core/exr.h"
#include "core/image_io.h"
#include "tests/pipelines/cli/render_files.h"

namespace gradients_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

TEST_CASE("gradients come at the file's rows, zero for rejected ones") {
  const Files files;
  for (const char* word : kWords) {
    INFO(word);
    const std::string text = cli::gradients_command(gradients_options("g.npz", word));
    CHECK_THAT(text, StartsWith("g.npz: loss 0."));
    CHECK_THAT(text, Contains(", gradients of 8 Gaussians and the camera\n"));
    const Npz npz = Npz::read("g.npz");
    CHECK(npz.names() == std::vector<std::string>{"loss", "image", "alpha", "means", "quats", "log_scales",
                                                  "opacity_logits", "sh", "camera"});
    const std::string type = std::string(word) == "float" ? "<f4" : "<f8";
    for (const std::string& name : npz.names()) CHECK(npz.array(name).dtype() == (name == "loss" ? "<f8" : type));
    CHECK(npz.array("loss").shape().empty());
    CHECK(npz.array("image").shape() == std::vector<std::int64_t>{kHeight, kWidth, 3});
    CHECK(npz.array("alpha").shape() == std::vector<std::int64_t>{kHeight, kWidth});
    CHECK(npz.array("opacity_logits").shape() == std::vector<std::int64_t>{kCount});
    CHECK(npz.array("sh").shape() == std::vector<std::int64_t>{kCount, 4, 3});
    CHECK(npz.array("camera").shape() == std::vector<std::int64_t>{6});

    cli::GradientsOptions clean = gradients_options("clean.npz", word);
    clean.shared.scene = "clean.ply";
    cli::gradients_command(clean);
    for (const auto& [name, width] : std::vector<std::pair<std::string, std::size_t>>{
             {"means", 3}, {"quats", 4}, {"log_scales", 3}, {"opacity_logits", 1}, {"sh", 12}}) {
      INFO(name);
      std::vector<double> all = numbers("g.npz", name);
      REQUIRE(all.size() == static_cast<std::size_t>(kCount) * width);
      const auto begin = all.begin() + static_cast<std::ptrdiff_t>(kRejected * width);
      const auto end = begin + static_cast<std::ptrdiff_t>(width);
      CHECK(std::all_of(begin, end, [](double value) { return value == 0; }));
      all.erase(begin, end);
      CHECK(all == numbers("clean.npz", name));
      CHECK(std::any_of(all.begin(), all.end(), [](double value) { return value != 0; }));
    }
    CHECK(numbers("g.npz", "camera") == numbers("clean.npz", "camera"));
  }
}

TEST_CASE("numbers that were held at a limit have gradient zero, at the file's rows") {
  const Files files;
  Gaussians g = test_gaussians();
  g.means[3 * kRejected] = NAN;
  g.log_scales[3 * 2 + 1] = -25;
  g.log_scales[3 * 6 + 2] = -20;  // at the limit, and as it is in the file
  g.opacity_logits[5] = INFINITY;
  g.opacity_logits[7] = 20;
  write_ply("scene.ply", g);
  Gaussians inside = g;  // what the reader makes of it
  inside.log_scales[3 * 2 + 1] = -20;
  inside.opacity_logits[5] = 20;
  write_ply("inside.ply", inside);
  for (const char* word : kWords) {
    INFO(word);
    cli::GradientsOptions options = gradients_options("g.npz", word);
    cli::gradients_command(options);
    options.shared.scene = "inside.ply";
    options.out = "inside.npz";
    cli::gradients_command(options);
    const std::vector<double> scales = numbers("g.npz", "log_scales"),
                              inside_scales = numbers("inside.npz", "log_scales");
    const std::vector<double> logits = numbers("g.npz", "opacity_logits"),
                              inside_logits = numbers("inside.npz", "opacity_logits");
    for (std::size_t i = 0; i < scales.size(); ++i) CHECK(scales[i] == (i == 3 * 2 + 1 ? 0 : inside_scales[i]));
    for (std::size_t i = 0; i < logits.size(); ++i) CHECK(logits[i] == (i == 5 ? 0 : inside_logits[i]));
    CHECK(inside_scales[3 * 2 + 1] != 0);
    CHECK(inside_logits[5] != 0);
    CHECK(logits[7] != 0);
    for (const char* name : {"loss", "means", "quats", "sh", "camera"})
      CHECK(numbers("g.npz", name) == numbers("inside.npz", name));
  }
}

TEST_CASE("gradients' loss is the mean squared difference of the image that render writes") {
  const Files files;
  for (const char* word : kWords) {
    INFO(word);
    cli::gradients_command(gradients_options("g.npz", word));
    cli::render_command(render_options("r.npz", word));
    const std::vector<double> image = numbers("g.npz", "image");
    CHECK(image == numbers("r.npz", "image"));
    CHECK(numbers("g.npz", "alpha") == numbers("r.npz", "alpha"));
    double sum = 0;
    for (std::size_t i = 0; i < image.size(); ++i) sum += (image[i] - files.target[i]) * (image[i] - files.target[i]);
    CHECK(numbers("g.npz", "loss")[0] == Approx(sum / static_cast<double>(image.size())).epsilon(1e-12));
  }
}

TEST_CASE("the three precisions give the same gradients") {
  const Files files;
  for (const char* word : kWords) cli::gradients_command(gradients_options(std::string(word) + ".npz", word));
  for (const char* name : {"loss", "means", "quats", "log_scales", "opacity_logits", "sh", "camera"}) {
    INFO(name);
    CHECK(relative_difference(numbers("double.npz", name), numbers("reference.npz", name)) < 1e-10);
    CHECK(relative_difference(numbers("float.npz", name), numbers("reference.npz", name)) < 2e-5);
  }
}

TEST_CASE("gradients agree with differences of the loss") {
  const Files files;
  const std::vector<std::string> no_cut = {"render.quality=reference"};
  cli::GradientsOptions options = gradients_options("g.npz", "double");
  options.shared.scene = "clean.ply";
  options.shared.settings = no_cut;
  cli::gradients_command(options);
  const Npz analytic = Npz::read("g.npz");
  const auto loss = [&] {
    cli::GradientsOptions moved = options;
    moved.out = "moved.npz";
    moved.shared.scene = "moved.ply";
    moved.shared.camera = "moved.json";
    cli::gradients_command(moved);
    return numbers("moved.npz", "loss")[0];
  };
  const Gaussians g = without_row(test_gaussians(), kRejected);
  write_ply("moved.ply", g);
  SECTION("of the Gaussians' numbers, which move by floats") {
    write_camera("moved.json", test_camera());
    const auto slope = [&](std::vector<float> Gaussians::*member, std::size_t i) {
      Gaussians plus = g, minus = g;
      (plus.*member)[i] += 1.0F / 1024;
      (minus.*member)[i] -= 1.0F / 1024;
      const double step = static_cast<double>((plus.*member)[i]) - static_cast<double>((minus.*member)[i]);
      write_ply("moved.ply", plus);
      const double above = loss();
      write_ply("moved.ply", minus);
      return (above - loss()) / step;
    };
    const auto check = [&](const char* name, std::vector<float> Gaussians::*member, std::size_t i) {
      INFO(name << " " << i);
      CHECK(analytic.array(name).as<double>()[i] == Approx(slope(member, i)).epsilon(1e-4).margin(1e-9));
    };
    check("means", &Gaussians::means, 4);
    check("quats", &Gaussians::quats, 9);
    check("log_scales", &Gaussians::log_scales, 2);
    check("opacity_logits", &Gaussians::opacity_logits, 5);
    check("sh", &Gaussians::sh, 25);  // a constant term
    check("sh", &Gaussians::sh, 30);  // a linear one
  }
  SECTION("of the camera") {
    const double step = 1e-5;
    for (int i = 0; i < 6; ++i) {
      INFO(i);
      std::array<double, 2> losses{};
      for (const int side : {0, 1}) {
        Vector6<double> xi = Vector6<double>::Zero();
        xi[i] = side == 0 ? step : -step;
        Camera camera = test_camera();
        camera.camera_from_world = compose(se3_exp(xi), camera.camera_from_world);
        write_camera("moved.json", camera);
        losses[static_cast<std::size_t>(side)] = loss();
      }
      CHECK(analytic.array("camera").as<double>()[static_cast<std::size_t>(i)] ==
            Approx((losses[0] - losses[1]) / (2 * step)).epsilon(1e-6).margin(1e-10));
    }
  }
}

TEST_CASE("harmonics above the degree that is used have gradient zero") {
  const Files files;
  cli::GradientsOptions options = gradients_options("g.npz", "double");
  options.shared.settings = {"render.sh_degree=0"};
  cli::gradients_command(options);
  const std::vector<double> sh = numbers("g.npz", "sh");
  for (std::size_t i = 0; i < sh.size(); ++i) {
    if (i % 12 >= 3) CHECK(sh[i] == 0);
  }
  CHECK(sh[0] != 0);
}

TEST_CASE("targets are read as they are") {
  const TemporaryFolder folder;
  Image image(4, 2, 3);
  for (int y = 0; y < 2; ++y) std::fill_n(image.row(3, y), 3, 1.0F);
  std::vector<double> bytes, words;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) {
      for (int c = 0; c < 3; ++c) {
        const int v = 1 + 41 * c + 77 * y + 13 * x;
        bytes.push_back(v / 255.0);
        words.push_back((v * 251 + 7) / 65535.0);
        image(c, y, x) = static_cast<float>(v) / 255;
      }
    }
  }
  write_image("a.png", image);
  CHECK(cli::read_target("a.png", 2, 3) == bytes);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < 2; ++y) {
      for (int x = 0; x < 3; ++x)
        image(c, y, x) = static_cast<float>(words[static_cast<std::size_t>(9 * y + 3 * x + c)]);
    }
  }
  write_image("b.png", take_channels(image, 0, 3), {.png_bits = 16});
  CHECK(cli::read_target("b.png", 2, 3) == words);
  image(1, 1, 1) = -7;
  write_image("c.exr", image);
  const std::vector<float> exact = to_interleaved(take_channels(image, 0, 3));
  CHECK(cli::read_target("c.exr", 2, 3) == std::vector<double>(exact.begin(), exact.end()));
  NpzWriter npz;
  npz.add<double>("image", {2, 3, 3}, words);
  npz.write("d.npz");
  CHECK(cli::read_target("d.npz", 2, 3) == words);

  CHECK(fault([] { cli::read_target("a.png", 2, 4); }) == "a.png: the image is 3 x 2 pixels; the camera's is 4 x 2");
  CHECK(fault([] { cli::read_target("c.exr", 3, 3); }) == "c.exr: the image is 3 x 2 pixels; the camera's is 3 x 3");
  CHECK(fault([] { cli::read_target("d.npz", 1, 1); }) == "d.npz: the image is 3 x 2 pixels; the camera's is 1 x 1");
  image(3, 1, 2) = 0.5F;
  write_image("glass.png", image);
  CHECK(fault([] { cli::read_target("glass.png", 2, 3); }) ==
        "glass.png: row 1, column 2 has alpha 0.502; a target is opaque");
  write_image("grey.png", Image(1, 2, 3));
  CHECK(fault([] { cli::read_target("grey.png", 2, 3); }) ==
        "grey.png: the image has 1 channel; 3 or 4 are needed: RGB, RGBA");
  NpzWriter flat;
  flat.add<double>("image", {2, 3}, std::vector<double>(6));
  flat.write("flat.npz");
  CHECK(fault([] { cli::read_target("flat.npz", 2, 3); }) ==
        "flat.npz: array 'image': has shape [2,3]; [*,*,3] is needed");
  words[10] = NAN;
  NpzWriter bad;
  bad.add<double>("image", {2, 3, 3}, words);
  bad.write("bad.npz");
  CHECK(fault([] { cli::read_target("bad.npz", 2, 3); }) == "bad.npz: row 1, column 0 of the image is not finite");
}

}  // namespace gradients_command_test
