// L = mean over the points and frames that move of max(0, margin − d(x))², m²: the body stays out of what is solid.
// d is the signed distance of a mesh (optim/solid/mesh_distance.h) or of what the scene's Gaussians show
// (optim/solid/gaussian_surface.h), negative in the solid, by a grid that is sampled where the points come
// (optim/solid/distance_grid.h). The points are Gaussians of the human, the same of every frame, evenly chosen.
//
// Free space is where the clip's first camera is, and where the body's joints are in its first frame: from there the
// scene's Gaussians are told front from back.   [beyond the paper, whose stage 3 has no such term; method.md, §8]
#include <algorithm>
#include <bit>
#include <filesystem>
#include <mutex>

#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "optim/losses/list.h"
#include "optim/solid/distance_grid.h"
#include "optim/solid/gaussian_surface.h"
#include "optim/solid/mesh_distance.h"

namespace hsi4d {

namespace {

/// m² against the photometric loss of a few hundredths: docs/numerics.md.
constexpr double kWeight = 10;

/// That distances may take: 3 KiB a block of 8³ cells near a surface, so 90,000 blocks.
constexpr Index kMostBytes = Index{256} << 20U;

struct PenetrationSettings {
  std::filesystem::path mesh;
  double margin = 0;       // metres
  double thickness = 0.1;  // metres
  double cell = 0.02;      // metres
  Index points = 1000;     // a frame
};

void describe(ConfigFields& fields, PenetrationSettings& settings) {
  fields.path("mesh", settings.mesh, {.must_exist = true},
              "What is solid (.obj, .ply, .glb), metres, world; empty: what the scene's Gaussians show");
  fields.number("margin", settings.margin, {.min = 0, .max = 1}, "Distance to keep from the surface, metres");
  fields.number("thickness", settings.thickness, {.above = 0, .max = 10},
                "Solid depth behind Gaussians and open meshes, metres; what is deeper is free");
  fields.number("cell", settings.cell, {.min = 0.001, .max = 1}, "Cell size of the distance grid, metres");
  fields.integer("points", settings.points, {.min = 1, .max = 1000000},
                 "Gaussians of the human that count in each frame, at most");
}

using GridPointer = std::shared_ptr<DistanceGrid>;

GridPointer grid_of(DistanceGrid::Distance distance, const PenetrationSettings& settings) {
  DistanceGrid::Settings grid;
  grid.cell = settings.cell;
  grid.reach = settings.margin + 2 * settings.cell;  // no farther is a node of a cell that a point within margin is in
  grid.most_bytes = kMostBytes;
  grid.name = "loss penetration";
  return std::make_shared<DistanceGrid>(std::move(distance), std::move(grid));
}

/// Where space is known to be free when the clip begins.
std::vector<Vector3<double>> free_places(const MotionStart& motion) {
  std::vector<Vector3<double>> places = {motion.first_camera_center};
  for (std::size_t i = 0; i + 2 < motion.first_body.joints.size(); i += 3)
    places.emplace_back(motion.first_body.joints.data() + i);
  return places;
}

/// Tells scenes and beginnings apart.
std::uint64_t identity_of(const MotionStart& motion, const std::vector<Vector3<double>>& places) {
  Signature identity;
  const auto add = [&identity](double x) { identity.add(std::bit_cast<std::uint64_t>(x)); };
  for (const Vector3<double>& place : places) {
    for (int i = 0; i < 3; ++i) add(place[i]);
  }
  for (int i = 0; i < 3; ++i) add(motion.scene->origin_world[i]);
  for (const std::vector<float>* numbers :
       {&motion.scene->means, &motion.scene->log_scales, &motion.scene->quats, &motion.scene->opacity_logits}) {
    for (const float x : *numbers) identity.add(std::bit_cast<std::uint32_t>(x));
  }
  return identity.value();
}

/// The grid of the scene that was asked for last: the same for all frames and stages of a run.
class SceneGrid {
 public:
  GridPointer of(const MotionStart& motion, const PenetrationSettings& settings) {
    const std::vector<Vector3<double>> places = free_places(motion);
    const std::uint64_t identity = identity_of(motion, places);
    {
      const std::lock_guard lock(mutex_);
      if (grid_ && identity_ == identity) return grid_;
    }
    const GridPointer grid = made(motion, places, settings);
    const std::lock_guard lock(mutex_);
    grid_ = grid;
    identity_ = identity;
    return grid;
  }

 private:
  static GridPointer made(const MotionStart& motion, const std::vector<Vector3<double>>& places,
                          const PenetrationSettings& settings) {
    const std::vector<SurfaceDisc> discs = surface_discs(*motion.scene);
    std::vector<SurfaceDisc> seen = facing(discs, places);
    if (seen.empty())
      throw DataError("loss penetration: of the scene's " + std::to_string(motion.scene->count()) + " Gaussians " +
                      std::to_string(discs.size()) +
                      " are opaque and flat, and the first camera and body see none of " +
                      "these, so nothing tells what is solid; a \"mesh\" does");
    const auto distance = std::make_shared<const GaussianDistance>(std::move(seen), settings.thickness);
    return grid_of([distance](const Vector3<double>& place) { return distance->at(place); }, settings);
  }

  std::mutex mutex_;
  GridPointer grid_;
  std::uint64_t identity_ = 0;
};

/// What a run keeps: the mesh's grid, or the scene's as soon as there is one.
struct Solid {
  PenetrationSettings settings;
  GridPointer mesh;
  std::shared_ptr<SceneGrid> scene = std::make_shared<SceneGrid>();
};

Solid prepared_solid(const PenetrationSettings& settings) {
  Solid solid{.settings = settings, .mesh = nullptr};
  if (settings.mesh.empty()) return solid;
  const auto distance = read_mesh_distance(settings.mesh.string(), settings.thickness);
  solid.mesh = grid_of([distance](const Vector3<double>& place) { return distance->at(place); }, settings);
  return solid;
}

/// The chosen Gaussians in each frame that moves.
std::vector<BodyPoint> chosen_points(const MotionStart& motion, Index most) {
  const Index rows = motion.avatar->weights.vertices, count = std::min(most, rows);
  std::vector<BodyPoint> points;
  for (Index t = motion.still_frames; t < motion.frames(); ++t) {
    for (Index i = 0; i < count; ++i) points.push_back({t, i * rows / count});
  }
  return points;
}

}  // namespace

LossTerm penetration_loss() {
  LossTerm term =
      needing({LossInput::kMotion},
              make_loss_term<PenetrationSettings>(
                  "penetration", "How deep the body is inside of what is solid",
                  [](const PenetrationSettings& settings) { return prepared_solid(settings); },
                  [](const auto& in, const Solid& solid) {
                    using Value = decltype(in.joints);
                    if (!solid.mesh && in.motion->scene == nullptr) return Value{};
                    const GridPointer grid = solid.mesh ? solid.mesh : solid.scene->of(*in.motion, solid.settings);
                    const Value places = in.body_points(chosen_points(*in.motion, solid.settings.points));
                    const float margin = static_cast<float>(solid.settings.margin);
                    const auto squares = sum_over({sampled_distance(places, grid)},
                                                  [margin](auto d) { return square(max(margin - d, 0.0f)); });
                    return squares * (1 / static_cast<double>(places.shape().rows));
                  }));
  term.description.weight = kWeight;
  return term;
}

}  // namespace hsi4d
