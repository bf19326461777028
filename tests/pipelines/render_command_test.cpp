// `hsi4d render` and `hsi4d gradients`: their files and their messages.
#include "pipelines/cli/render_command.h"

#include <cmath>
#include <functional>
#include <random>

#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/exr.h"
#include "core/image_io.h"
#include "core/log.h"
#include "pipelines/cli/gradients_command.h"
#include "splat/io_ply.h"
#include "tests/support/program.h"

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

namespace {

constexpr int kWidth = 37, kHeight = 23;
constexpr Index kCount = 9;
constexpr std::size_t kRejected = 3;  // the row that has a mean without meaning
constexpr std::array<const char*, 3> kWords = {"float", "double", "reference"};

Camera test_camera() {
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  camera.fx = 40;
  camera.fy = 42;
  camera.cx = 18;
  camera.cy = 12.25;
  camera.camera_from_world = look_at({0.4, -3, 0.7}, {0, 0, 0.1});
  return camera;
}

/// Large faint Gaussians in view, of degree 1.
Gaussians test_gaussians(unsigned seed = 5) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> number(-1, 1);
  Gaussians g;
  g.sh_degree = 1;
  for (Index n = 0; n < kCount; ++n) {
    for (int i = 0; i < 3; ++i) g.means.push_back(0.7F * number(random));
    for (int i = 0; i < 4; ++i) g.quats.push_back(number(random));
    for (int i = 0; i < 3; ++i) g.log_scales.push_back(-1.6F + 0.5F * number(random));
    g.opacity_logits.push_back(number(random));
    for (int i = 0; i < 12; ++i) g.sh.push_back(0.4F * number(random));
  }
  return g;
}

Gaussians without_row(Gaussians g, std::size_t row) {
  const auto erase = [row](std::vector<float>& values, std::size_t width) {
    const auto begin = values.begin() + static_cast<std::ptrdiff_t>(row * width);
    values.erase(begin, begin + static_cast<std::ptrdiff_t>(width));
  };
  erase(g.means, 3);
  erase(g.quats, 4);
  erase(g.log_scales, 3);
  erase(g.opacity_logits, 1);
  erase(g.sh, 12);
  return g;
}

/// A folder with scene.ply (one row rejected), clean.ply (the same without that row), camera.json and target.npz.
struct Files {
  TemporaryFolder folder;
  std::vector<double> target;

  Files() {
    Gaussians g = test_gaussians();
    write_ply("clean.ply", without_row(g, kRejected));
    g.means[3 * kRejected] = NAN;
    write_ply("scene.ply", g);
    write_camera("camera.json", test_camera());
    std::mt19937 random(11);
    std::uniform_real_distribution<double> number(0, 1);
    for (int i = 0; i < 3 * kWidth * kHeight; ++i) target.push_back(number(random));
    NpzWriter npz;
    npz.add<double>("image", {kHeight, kWidth, 3}, target);
    npz.write("target.npz");
  }
};

cli::RenderOptions render_options(const std::string& out, const std::string& precision = "reference") {
  cli::RenderOptions options;
  options.shared.scene = "scene.ply";
  options.shared.camera = "camera.json";
  options.shared.precision = precision;
  options.shared.background = "0.1,0.2,0.3";
  options.out = out;
  return options;
}

cli::GradientsOptions gradients_options(const std::string& out, const std::string& precision = "reference") {
  cli::GradientsOptions options;
  options.shared = render_options(out, precision).shared;
  options.target = "target.npz";
  options.out = out;
  return options;
}

std::vector<double> numbers(const std::string& file, const std::string& name) {
  return Npz::read(file).array(name).as<double>();
}

double relative_difference(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return std::sqrt(difference / size);
}

std::string fault(const std::function<void()>& action) {
  try {
    action();
  } catch (const UserError& error) {
    return error.what();
  } catch (const DataError& error) {
    return error.what();
  }
  return "no fault";
}

}  // namespace

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

TEST_CASE("what is wrong with the options is told to the letter") {
  const Files files;
  const auto render_fault = [](const std::function<void(cli::RenderOptions&)>& change) {
    cli::RenderOptions options = render_options("a.npz");
    change(options);
    return fault([&] { cli::render_command(options); });
  };
  using Options = cli::RenderOptions;
  CHECK(render_fault([](Options&) {}) == "no fault");
  CHECK(render_fault([](Options& o) { o.out = "a.jpg"; }) ==
        "hsi4d render: --out: a.jpg does not end as it must; allowed: .png, .exr, .npz");
  CHECK(render_fault([](Options& o) { o.shared.precision = "duoble"; }) ==
        "hsi4d render: --precision: \"duoble\" is no precision; allowed: float, double, reference; did you mean "
        "\"double\"?");
  for (const std::string wrong : {"1,2", "1,2,3,4", "1,2,x", "", "1, 2, 3", "1,2,inf"}) {
    CHECK(render_fault([&](Options& o) { o.shared.background = wrong; }) ==
          "hsi4d render: --background: \"" + wrong +
              "\" is no colour; allowed: three numbers r,g,b, for example 0.5,0.5,0.5");
  }
  CHECK(render_fault([](Options& o) { o.shared.settings = {"render.blurr=1"}; }) ==
        "--set render.blurr=1: /render/blurr: unknown key; did you mean \"blur\"?");
  CHECK(render_fault([](Options& o) {
          o.shared.settings = {"seed=1", "render.near=-1"};
        }) ==
        "2 problems:\n--set seed=1: /seed: unknown key; known here: render\n"
        "--set render.near=-1: /render/near: -1 is out of range; allowed: above 0 and at most 1000");
  CHECK(render_fault([](Options& o) { o.shared.camera_frame = 1; }) ==
        "camera.json: there is no camera 1; allowed: 0 to 0");
  CHECK(render_fault([](Options& o) { o.motion = "m.npz"; }) ==
        "hsi4d render: --motion is given without --avatar; a body needs both, and --frame");
  CHECK(render_fault([](Options& o) { o.avatar = "a.npz"; }) ==
        "hsi4d render: --avatar is given without --motion; a body needs both, and --frame");
  CHECK(render_fault([](Options& o) { o.frame = 2; }) ==
        "hsi4d render: --frame is given without --motion and --avatar");
  CHECK_THAT(render_fault([](Options& o) { o.shared.scene = "missing.ply"; }), StartsWith("missing.ply: "));
  CHECK_THAT(render_fault([](Options& o) { o.objects = {"missing.ply"}; }), StartsWith("missing.ply: "));
  CHECK_THAT(render_fault([](Options& o) { o.shared.camera = "missing.json"; }), StartsWith("missing.json: "));

  cli::GradientsOptions options = gradients_options("g.exr");
  CHECK(fault([&] { cli::gradients_command(options); }) ==
        "hsi4d gradients: --out: g.exr does not end as it must; allowed: .npz");
  options = gradients_options("g.npz");
  options.target = "t.jpg";
  CHECK(fault([&] { cli::gradients_command(options); }) ==
        "hsi4d gradients: --target: t.jpg does not end as it must; allowed: .exr, .png, .npz");
}

TEST_CASE("a file that cannot be written is told before the work is done, and nothing is left behind") {
  const Files files;
  std::filesystem::create_directory("folder.npz");
  for (const std::string out : {"missing/a.npz", "folder.npz"}) {
    INFO(out);
    NpzWriter npz;
    npz.add<double>("image", {1, 1, 3}, {0, 0, 0});
    const std::string message = fault([&] { npz.write(out); });
    CHECK_THAT(message, StartsWith(out + ": cannot be written: "));
    cli::RenderOptions render = render_options(out);
    cli::GradientsOptions gradients = gradients_options(out);
    CHECK(fault([&] { cli::render_command(render); }) == message);
    CHECK(fault([&] { cli::gradients_command(gradients); }) == message);
    render.shared.scene = gradients.shared.scene = "missing.ply";  // which is read later
    CHECK(fault([&] { cli::render_command(render); }) == message);
    CHECK(fault([&] { cli::gradients_command(gradients); }) == message);
  }
  const auto files_here = [] {
    return std::distance(std::filesystem::directory_iterator("."), std::filesystem::directory_iterator());
  };
  const auto before = files_here();
  cli::RenderOptions render = render_options("a.npz");
  render.shared.scene = "missing.ply";
  CHECK_THAT(fault([&] { cli::render_command(render); }), StartsWith("missing.ply: "));
  CHECK(files_here() == before);
}

TEST_CASE("rows that are left out are told") {
  const Files files;
  std::string told;
  const LogSink sink = log_to([&](LogLevel, std::string_view message) { told += message; });
  cli::render_command(render_options("a.npz"));
  CHECK(told == "scene.ply: 1 of 9 Gaussians are left out (a mean that is not finite: 1)");
}

TEST_CASE("render and gradients through the program") {
  const Files files;
  const ProgramResult image =
      run_hsi4d({"render", "--scene", "clean.ply", "--object", "clean.ply", "--object", "clean.ply", "--camera",
                 "camera.json", "--out", "a.npz", "--set", "render.blur=0.5", "--precision", "reference"});
  CHECK(image.status == 0);
  CHECK(image.err.empty());
  CHECK(image.out == "a.npz: 37 x 23 pixels of 24 Gaussians\n");
  const ProgramResult warned = run_hsi4d({"gradients", "--scene", "scene.ply", "--camera", "camera.json", "--target",
                                          "target.npz", "--out", "g.npz", "--background=-1,0.5,1"});
  CHECK(warned.status == 0);
  CHECK(warned.err == "hsi4d: warning: scene.ply: 1 of 9 Gaussians are left out (a mean that is not finite: 1)\n");
  CHECK_THAT(warned.out, StartsWith("g.npz: loss 0."));
  CHECK(Npz::read("g.npz").array("loss").dtype() == "<f8");

  const ProgramResult mistake = run_hsi4d(
      {"render", "--scene", "clean.ply", "--camera", "camera.json", "--out", "b.npz", "--set", "render.quality=fats"});
  CHECK(mistake.status == 2);
  CHECK(mistake.out.empty());
  CHECK(
      mistake.err ==
      "--set render.quality=fats: /render/quality: \"fats\" is not one of the choices; allowed: \"fast\", \"default\", "
      "\"accurate\", \"reference\"; did you mean \"fast\"?\n");
  CHECK(!std::filesystem::exists("b.npz"));
  const ProgramResult missing = run_hsi4d({"render", "--scene", "clean.ply", "--out", "b.npz"});
  CHECK(missing.status == 2);
  CHECK(missing.err == "hsi4d render: --camera is required; `hsi4d render --help` explains its arguments\n");
  const ProgramResult size = run_hsi4d({"gradients", "--scene", "clean.ply", "--camera", "camera.json", "--target",
                                        "a.npz", "--out", "g.npz", "--set", "render.tile=8"});
  CHECK(size.status == 0);
}
