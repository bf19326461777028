#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "bench/pareto.h"
#include "bench/topic.h"
#include "bench/workloads.h"
#include "core/check.h"
#include "core/random.h"
#include "core/suggest.h"
#include "core/text.h"
#include "splat/files/splat_file.h"

namespace hsi4d {

namespace {

constexpr int kSide = 128;                      // pixels
constexpr double kShOfConstant = 0.2820947918;  // Y of degree 0
constexpr std::uint64_t kShSeed = 21;

Camera square_camera(int side) {
  Camera camera;
  camera.width = camera.height = side;
  camera.fx = camera.fy = side;
  camera.cx = camera.cy = side / 2.0;
  return camera;
}

void append_logit(Gaussians& g, double opacity) {
  g.opacity_logits.push_back(static_cast<float>(std::log(opacity / (1 - opacity))));
}

/// Harmonics of degree 3 that are `color` in the mean and vary with the direction.
void append_color(Gaussians& g, const Vector3<double>& color, RandomSequence& random) {
  for (int c = 0; c < 3; ++c) g.sh.push_back(static_cast<float>((color[c] - 0.5) / kShOfConstant));
  for (int i = 3; i < 3 * g.sh_coefficients(); ++i) g.sh.push_back(static_cast<float>(0.08 * random.normal()));
}

/// Gaussians all over the view, from 2 to 6 m.
struct Cloud {
  Index count = 0;
  double pixels = 1;                          ///< median standard deviation of the wide axes
  std::array<double, 3> shape = {1, 1, 0.5};  ///< of the axes
  double least_opacity = 0.1, most_opacity = 0.9;
};

Gaussians make_cloud(const Cloud& cloud, const Camera& camera, std::uint64_t seed) {
  Gaussians g;
  g.sh_degree = kHighestShDegree;
  RandomSequence random(seed);
  for (Index n = 0; n < cloud.count; ++n) {
    const double z = random.uniform(2.0, 6.0), wide = 0.52 * camera.width / camera.fx;
    const double size = cloud.pixels * z / camera.fx * std::exp(0.4 * random.normal());
    for (const double place : {random.uniform(-wide, wide) * z, random.uniform(-wide, wide) * z, z})
      g.means.push_back(static_cast<float>(place));
    const Vector4<double> quat = random.rotation();
    for (int i = 0; i < 4; ++i) g.quats.push_back(static_cast<float>(quat[i]));
    for (const double axis : cloud.shape)
      g.log_scales.push_back(static_cast<float>(std::log(size * axis) + 0.2 * random.normal()));
    append_logit(g, random.uniform(cloud.least_opacity, cloud.most_opacity));
    append_color(g, {random.uniform(), random.uniform(), random.uniform()}, random);
  }
  return g;
}

Gaussians gaussians_of(const Workload& w) {
  Gaussians g;
  g.sh_degree = kHighestShDegree;
  g.means = w.means;
  g.quats = w.quats;
  g.log_scales = w.log_scales;
  RandomSequence random(kShSeed);
  for (Index n = 0; n < w.count; ++n) {
    append_logit(g, static_cast<double>(w.opacities[static_cast<std::size_t>(n)]));
    append_color(g, Vector3<float>(w.colors.data() + 3 * n).cast<double>(), random);
  }
  return g;
}

Index scaled(Index count, double size) {
  return std::max<Index>(1, std::lround(static_cast<double>(count) * size * size));
}

ParetoScene cloud_scene(Cloud cloud, double size, std::uint64_t seed) {
  cloud.count = scaled(cloud.count, size);
  const Camera camera = square_camera(static_cast<int>(std::lround(kSide * size)));
  return {"", make_cloud(cloud, camera, seed), camera};
}

// --- scenes ----------------------------------------------------------------------------------------------------------

ParetoScene sparse(double size) { return cloud_scene({.count = 500, .pixels = 1.2}, size, 31); }

ParetoScene dense(double size) {
  return cloud_scene({.count = 2500, .pixels = 6, .least_opacity = 0.02, .most_opacity = 0.3}, size, 32);
}

ParetoScene opaque(double size) {
  return cloud_scene({.count = 1500, .pixels = 6, .least_opacity = 0.9, .most_opacity = 0.9999}, size, 33);
}

ParetoScene needles(double size) {
  return cloud_scene({.count = 1000, .pixels = 25, .shape = {1, 0.01, 0.01}}, size, 34);
}

/// The trunk of the figure fills the image.
ParetoScene avatar_close_up(double size) {
  const Workload w = avatar_workload({static_cast<int>(std::lround(kSide * size)), scaled(2500, size), 0});
  Camera camera = w.view.camera;
  camera.fx = camera.fy = 3.0 * camera.width;
  camera.cy += 0.12 * camera.fy;
  return {"", gaussians_of(w), camera};
}

ParetoScene avatar_in_scene(double size) {
  const Workload w =
      avatar_in_scene_workload({static_cast<int>(std::lround(kSide * size)), scaled(1000, size), scaled(2500, size)});
  return {"", gaussians_of(w), w.view.camera};
}

ParetoScene empty(double size) {
  Gaussians none;
  none.sh_degree = kHighestShDegree;
  return {"", none, square_camera(static_cast<int>(std::lround(kSide * size))), true};
}

/// All on one spot, a pixel wide: the list of a tile is all Gaussians.
ParetoScene stack(double size) {
  constexpr int kStackSide = 8;
  Gaussians g;
  g.sh_degree = 0;
  const Camera camera = square_camera(kStackSide);
  RandomSequence random(35);
  for (Index n = 0; n < scaled(1000000, size); ++n) {
    for (const float place : {0.0f, 0.0f, 3.0f}) g.means.push_back(place);
    for (const float part : {1.0f, 0.2f, 0.1f, 0.3f}) g.quats.push_back(part);
    for (const double pixels : {1.5, 1.0, 0.5})
      g.log_scales.push_back(static_cast<float>(std::log(pixels * 3 / camera.fx)));
    append_logit(g, random.uniform(0.01, 0.05));
    append_color(g, {random.uniform(), random.uniform(), random.uniform()}, random);
  }
  return {"", g, camera, true};
}

struct NamedScene {
  const char* name;
  ParetoScene (*make)(double size);
};
constexpr std::array<NamedScene, 8> kScenes = {{{"sparse", sparse},
                                                {"dense", dense},
                                                {"opaque", opaque},
                                                {"needles", needles},
                                                {"avatar_close_up", avatar_close_up},
                                                {"avatar_in_scene", avatar_in_scene},
                                                {"empty", empty},
                                                {"stack", stack}}};

// --- files -----------------------------------------------------------------------------------------------------------

/// The file, or a folder's files of Gaussians.
std::vector<std::string> splat_files(const std::string& path) {
  namespace fs = std::filesystem;
  if (!fs::is_directory(path)) return {path};
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(path))
    if (entry.is_regular_file() && has_splat_ending(entry.path().string())) files.push_back(entry.path().string());
  if (files.empty()) throw UserError(path + ": has no files of Gaussians; they are read from " + splat_formats_text());
  std::sort(files.begin(), files.end());
  return files;
}

/// The share `part` of the values, sorted, along an axis.
double quantile(const Gaussians& g, int axis, double part) {
  std::vector<float> values;
  for (std::size_t i = static_cast<std::size_t>(axis); i < g.means.size(); i += 3) values.push_back(g.means[i]);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return static_cast<double>(*at) + g.origin_world[axis];
}

}  // namespace

std::vector<std::string> pareto_scene_names() {
  std::vector<std::string> names;
  for (const NamedScene& scene : kScenes) names.emplace_back(scene.name);
  return names;
}

ParetoScene pareto_scene(const std::string& name, double size) {
  ParetoScene scene = cli::chosen_workloads("pareto", {name}, kScenes).front().make(size);
  scene.name = name;
  return scene;
}

ParetoScene pareto_scene_of(const std::string& file) {
  ParetoScene scene;
  scene.name = std::filesystem::path(file).filename().string();
  const Gaussians all = read_splats(file).gaussians;
  if (all.count() == 0) throw UserError(file + ": has no Gaussians, of which hsi4d bench pareto needs one or more");
  std::vector<Index> rows;
  const Index kept = std::min(all.count(), kMostParetoGaussians);
  for (Index n = 0; n < kept; ++n) rows.push_back(n * all.count() / kept);
  scene.gaussians = selected(all, rows);
  const double larger = 0.5 * std::log(static_cast<double>(all.count()) / static_cast<double>(kept));
  for (float& log_scale : scene.gaussians.log_scales) log_scale += static_cast<float>(larger);
  Vector3<double> middle = Vector3<double>::Zero();
  double extent = 0;
  for (int axis = 0; axis < 3; ++axis) {
    middle[axis] = quantile(scene.gaussians, axis, 0.5);
    extent = std::max(extent, quantile(scene.gaussians, axis, 0.9) - quantile(scene.gaussians, axis, 0.1));
  }
  extent = std::max(extent, 1e-3);
  scene.camera = square_camera(kSide);
  scene.camera.camera_from_world = look_at(middle + extent * Vector3<double>(0.5, -1.1, 0.4), middle);
  return scene;
}

std::vector<ParetoScene> pareto_scenes_of(const std::vector<std::string>& paths) {
  std::vector<ParetoScene> scenes;
  for (const std::string& path : paths) {
    for (const std::string& file : splat_files(path)) {
      ParetoScene scene = pareto_scene_of(file);
      const auto has_name = [&scene](const ParetoScene& other) { return other.name == scene.name; };
      if (std::any_of(scenes.begin(), scenes.end(), has_name)) scene.name = file;
      scenes.push_back(std::move(scene));
    }
  }
  return scenes;
}

}  // namespace hsi4d
