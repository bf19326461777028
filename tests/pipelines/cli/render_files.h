// A small scene on disk, with what `hsi4d render` and `hsi4d gradients` read and write, for their tests.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/npz.h"
#include "pipelines/cli/gradients_command.h"
#include "pipelines/cli/render_command.h"
#include "splat/files/io_ply.h"
#include "tests/support/temporary_folder.h"

namespace hsi4d::test {

inline constexpr int kWidth = 37, kHeight = 23;
inline constexpr Index kCount = 9;
inline constexpr std::size_t kRejected = 3;  // the row that has a mean without meaning
inline constexpr std::array<const char*, 3> kWords = {"float", "double", "reference"};

inline Camera test_camera() {
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
inline Gaussians test_gaussians(unsigned seed = 5) {
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

inline Gaussians without_row(Gaussians g, std::size_t row) {
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

inline cli::RenderOptions render_options(const std::string& out, const std::string& precision = "reference") {
  cli::RenderOptions options;
  options.shared.scene = "scene.ply";
  options.shared.camera = "camera.json";
  options.shared.precision = precision;
  options.shared.background = "0.1,0.2,0.3";
  options.out = out;
  return options;
}

inline cli::GradientsOptions gradients_options(const std::string& out, const std::string& precision = "reference") {
  cli::GradientsOptions options;
  options.shared = render_options(out, precision).shared;
  options.target = "target.npz";
  options.out = out;
  return options;
}

inline std::vector<double> numbers(const std::string& file, const std::string& name) {
  return Npz::read(file).array(name).as<double>();
}

inline double relative_difference(const std::vector<double>& a, const std::vector<double>& b) {
  REQUIRE(a.size() == b.size());
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return std::sqrt(difference / size);
}

inline std::string fault(const std::function<void()>& action) {
  try {
    action();
  } catch (const UserError& error) {
    return error.what();
  } catch (const DataError& error) {
    return error.what();
  }
  return "no fault";
}

}  // namespace hsi4d::test
