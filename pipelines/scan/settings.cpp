#include "pipelines/scan/settings.h"

#include "core/config_file.h"
#include "optim/stage.h"
#include "pipelines/config/config_fields.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/config/removed_keys.h"
#include "pipelines/rig/textured_mesh.h"
#include "splat/limits.h"

namespace hsi4d {

namespace {

constexpr int kMostThreads = 1024;
constexpr int kMostIterations = 1000000;
constexpr Index kMostPictures = 10000;
constexpr Index kMostGaussians = 20000000;

constexpr const char* kNoPhotos =
    "not given; pictures whose cameras are known are needed: a folder of COLMAP, a transforms.json, a cameras.json, or "
    "a mesh: "
    ".glb, .obj, .ply. "
    "`hsi4d synth configs/reconstruct/photos.json --out DIR` makes some; then --set photos.path=DIR/transforms.json";

void add_stage_faults(const ConfigValue& tree, const ScanSettings& settings, ConfigProblems& problems) {
  const StageSettings& stage = settings.stage;
  const auto add = [&](const std::string& key, const std::string& text) {
    const std::string pointer = "/stage" + key;
    problems.add(origin_at(tree, pointer), pointer, text);
  };
  if (stage.over != StageScope::kFrame) add("/over", "a reconstruction sees one picture at a time");
  if (stage.draw != Draw::kAll) add("/draw", "a reconstruction draws its Gaussians");
  if (stage.weight != PixelWeight::kAll)
    add("/weight", "all pixels of a picture count that its mask does not leave out");
  if (stage.gradient_shares != 0) add("/gradient_shares", "a reconstruction does not measure them");
  if (stage.optimizer.kind != OptimizerKind::kAdam) add("/optimizer/kind", "a reconstruction moves by adam");
  for (const std::string& idle : idle_settings(stage.optimizer)) add("/optimizer/" + idle, "has no meaning with adam");
  if (stage.optimizer.max_rollbacks != OptimizerSettings{}.max_rollbacks)
    add("/optimizer/max_rollbacks",
        "a reconstruction takes no step back: Gaussians without a usable gradient stand still");
}

void add_loss_faults(const ConfigValue& tree, StageSettings& stage, ConfigProblems& problems) {
  constexpr std::array<LossInput, 3> kInputs = {LossInput::kImage, LossInput::kGaussians, LossInput::kDepths};
  std::vector<LossFault> faults = losses_without_inputs(stage, kInputs, "a reconstruction");
  for (LossFault& fault : prepare_losses(stage)) faults.push_back(std::move(fault));
  for (const LossFault& fault : faults) {
    const std::string pointer = "/stage" + fault.pointer;
    problems.add(origin_at(tree, pointer), pointer, fault.text);
  }
}

}  // namespace

void describe(ConfigFields& f, RigSettings& s) {
  f.integer("count", s.count, {.min = 0, .max = kMostPictures},
            "Pictures; 0: " + std::to_string(kPicturesOfObject) + " of an object, " + std::to_string(kPicturesOfScene) +
                " of a scene");
  f.integer("size", s.size, {.min = 16, .max = kLongestSide}, "Width and height of the pictures, pixels");
  f.integer("supersample", s.light.supersample, {.min = 1, .max = 16}, "Rays along each side of a pixel");
  f.number("shade", s.light.shade, {.min = 0, .max = 1},
           "How much darker a side is that looks away from the sky; 0: the mesh's colours as they are");
  f.number("nearest", s.nearest, {.min = 0, .max = 1e6}, "Scenes: a camera is so far from everything at least, metres");
  f.number("least_seen", s.least_seen, {.min = 0, .max = 1}, "Scenes: a picture shows something in so large a share");
  f.number("most_backs", s.most_backs, {.min = 0, .max = 1},
           "Scenes: share of a picture that may show backs of faces, as from inside a thing");
  f.optional(s.box, [](ConfigFields& inner, std::array<double, 6>& box) {
    inner.numbers("box", box, {}, "Scenes: x, y, z of two corners between which cameras are; null: the mesh's bounds");
  });
}

void describe(ConfigFields& f, ScanPhotos& s) {
  f.path("path", s.path, {.must_exist = true},
         "A folder of COLMAP, a transforms.json or cameras.json; or a mesh: .glb, .obj, .ply");
  f.path("pictures", s.pictures, {.must_exist = true}, "The pictures' folder, where it is not beside the cameras");
  f.integer("longest_side", s.rules.longest_side, {.min = 0, .max = kLongestSide},
            "Larger pictures are reduced to so many pixels; 0: as they are");
  f.number("depth_unit", s.rules.depth_unit, {.above = 0}, "What 1 is in a depth image of whole numbers, metres");
  f.integer("hold_every", s.hold_every, {.min = 0, .max = 100000},
            "One of so many pictures is not learnt from, but measured; 0: none");
  f.object("rig", s.rig, "Pictures of a mesh, where path names one");
  f.rule({"pictures", "path"}, [&s]() -> std::string {
    return !s.pictures.empty() && is_mesh_file(s.path.string()) ? "is not read: path names a mesh" : "";
  });
}

void describe(ConfigFields& f, ScanStart& s) {
  f.choice("from", s.from, kScanStartKinds,
           "What Gaussians begin as; auto: points where there are some, else depths where all pictures have them, else "
           "random places");
  f.path("points", s.points, {.must_exist = true}, "A PLY of points; without: those of the cameras' file");
  f.integer("count", s.count, {.min = 1, .max = kMostGaussians}, "Of depths at most, of random places just so many");
  f.number("voxel", s.voxel, {.min = 1e-6, .max = 1e6}, "Depths: one Gaussian in each cube of this side, metres");
  f.optional(s.box, [](ConfigFields& inner, std::array<double, 6>& box) {
    inner.numbers("box", box, {}, "Random places: x, y, z of two corners; null: by the cameras");
  });
  f.number("opacity", s.opacity, {.above = 0, .below = 1}, "Their opacity");
  f.number("size", s.size, {.above = 0, .max = 10}, "Their size, of the mean distance to three neighbours");
  f.rule({"points", "from"}, [&s]() -> std::string {
    const bool is_idle = s.from == ScanStartKind::kDepth || s.from == ScanStartKind::kRandom;
    return !s.points.empty() && is_idle ? "is not read: from asks for another start" : "";
  });
  f.rule({"box", "from"}, [&s]() -> std::string {
    const bool is_idle = s.from == ScanStartKind::kDepth || s.from == ScanStartKind::kPoints;
    return s.box && is_idle ? "is of random places; from asks for another start" : "";
  });
}

void describe(ConfigFields& f, DensitySettings& s) {
  const IntegerRange iterations = {.min = 0, .max = kMostIterations};
  f.choice(
      "method", s.method, kDensityMethods,
      "mcmc: faint Gaussians move to where others are, new ones come, places tremble; adc: those that move much in "
      "the pictures become two, faint and large ones go; none: all stay");
  f.integer("most", s.most, {.min = 1, .max = kMostGaussians}, "Gaussians at most");
  f.integer("from", s.from, iterations, "First iteration in which the number changes");
  f.integer("until", s.until, iterations, "First in which it no longer does");
  f.integer("every", s.every, {.min = 1, .max = kMostIterations}, "It changes after every n-th iteration");
  f.number("least_opacity", s.least_opacity, {.above = 0, .below = 0.5},
           "Fainter ones move to where others are, or go");
  f.number("growth", s.growth, {.min = 1, .max = 10},
           "mcmc: factor of the number each time, until there are as many as allowed");
  f.number("noise", s.noise, {.min = 0}, "mcmc: how much places of faint ones tremble, in rates of the means");
  f.number("gradient", s.gradient, {.min = 0},
           "adc: mean gradient by places in halves of the picture, above which one becomes two");
  f.number("split_size", s.split_size, {.min = 0},
           "adc: what is larger, of the scene's extent, is split; what is not is doubled");
  f.number("most_size", s.most_size, {.above = 0}, "adc: what is larger, of the extent, goes after the first reset");
  f.integer("reset_every", s.reset_every, {.min = 1, .max = kMostIterations},
            "adc: after so many iterations opacities become at most twice least_opacity");
}

namespace {

std::vector<std::string> moving_groups() {
  std::vector<std::string> names = scan_groups();
  names.emplace_back(kExposures);
  return names;
}

}  // namespace

std::vector<std::string> scan_groups() { return {"means", "quats", "log_scales", "opacity_logits", "sh"}; }

void describe(ConfigFields& f, ScanSettings& s, const std::vector<LossDescription>& losses) {
  f.choice("kind", s.kind, kScanKinds, "What the pictures show: a scene around them, or an object before them");
  f.object("photos", s.photos, "The pictures and their cameras");
  f.object("start", s.start, "Where Gaussians begin");
  f.object("density", s.density, "How their number changes");
  f.integer("seed", s.seed, {.min = 0}, "Seed of the order of pictures, of random places and colours");
  f.integer("threads", s.threads, {.min = 0, .max = kMostThreads},
            "Threads; 0: one a core. Results do not depend on it");
  f.integer("sh_degree", s.sh_degree, {.min = 0, .max = kHighestShDegree}, "Degree of the harmonics");
  f.integer("sh_every", s.sh_every, {.min = 1, .max = kMostIterations},
            "Iterations after which one more degree is used");
  f.number("sh_share", s.sh_share, {.above = 0, .max = 1}, "Share of the rate of sh for harmonics above degree 0");
  f.numbers("background", s.background, {.min = 0, .max = 1}, "Colour behind everything");
  f.boolean("random_background", s.random_background,
            "Another colour behind everything in each iteration, where pictures have alpha or masks");
  f.integer("save_every", s.save_every, {.min = 1, .max = kMostIterations}, "Iterations between checkpoints");
  f.object("render", s.render, "How Gaussians become pixels");
  f.object("stage", s.stage, "What moves, and which losses count; the rate of means is a share of the scene's extent",
           [losses](ConfigFields& inner, StageSettings& stage) { describe(inner, stage, losses); });
  f.rule({"density", "start"}, [&s] {
    const bool is_counted = s.start.from != ScanStartKind::kPoints && s.start.points.empty();
    return s.start.count <= s.density.most || s.density.method == DensityMethod::kNone || !is_counted
               ? ""
               : "most is " + std::to_string(s.density.most) + ", fewer than /start/count, " +
                     std::to_string(s.start.count);
  });
}

ScanSettings load_scan(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                       const std::vector<LossDescription>& losses) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, overrides, problems);
  require_kind(tree, ConfigKind::kScan, file);
  return read_scan(tree, file, losses, problems);
}

ScanSettings read_scan(const ConfigValue& tree, const std::filesystem::path& file,
                       const std::vector<LossDescription>& losses, ConfigProblems& problems, bool asks_photos) {
  ScanSettings settings;
  settings.file = file;
  ConfigFields fields;
  describe(fields, settings, losses);
  read_config(without_removed_keys(tree, problems), fields, problems);
  if (asks_photos && problems.empty() && settings.photos.path.empty())
    problems.add(tree.origin, "/photos/path", kNoPhotos);
  if (problems.empty()) {
    add_stage_faults(tree, settings, problems);
    add_loss_faults(tree, settings.stage, problems);
  }
  problems.throw_if_any();
  check_groups(settings.stage, moving_groups(), file.string() + ": /stage/optimize");
  return settings;
}

std::string resolved_scan(const ScanSettings& settings, const std::vector<LossDescription>& losses) {
  return with_fields(settings, losses, [](const ConfigFields& fields) { return to_json(write_config(fields)); });
}

std::string scan_schema(const std::vector<LossDescription>& losses) {
  return with_fields(ScanSettings{}, losses, [](const ConfigFields& fields) {
    return to_json(config_schema(fields, "hsi4d reconstruct config"));
  });
}

std::vector<ConfigSetting> scan_settings(const std::vector<LossDescription>& losses) {
  return with_fields(ScanSettings{}, losses, [](const ConfigFields& fields) { return list_settings(fields); });
}

}  // namespace hsi4d
