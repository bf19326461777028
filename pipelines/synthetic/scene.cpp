#include "pipelines/synthetic/scene.h"

#include <array>
#include <cmath>
#include <numbers>

#include "core/check.h"
#include "core/log.h"
#include "core/rotation.h"
#include "pipelines/synthetic/kit.h"
#include "pipelines/synthetic/variation.h"
#include "splat/files/splat_file.h"
#include "splat/files/transform.h"

namespace hsi4d {
namespace {

using detail::SceneKit;
using detail::SceneMaker;

const std::array<SceneMaker, 14> kMakers = {{
    {SyntheticSceneKind::kLivingRoom, "a room with a bookcase, a window, pictures and a rug", detail::make_living_room,
     detail::living_room_light},
    {SyntheticSceneKind::kKitchen, "a tiled kitchen with cupboards, a stove, a sink and shelves", detail::make_kitchen,
     detail::kitchen_light},
    {SyntheticSceneKind::kBedroom, "a bedroom with a bed, a wardrobe, a lamp and a poster", detail::make_bedroom,
     detail::bedroom_light},
    {SyntheticSceneKind::kGarden, "a lawn with a path, flower beds, a hedge and a tree", detail::make_garden,
     detail::garden_light},
    {SyntheticSceneKind::kTerrace, "a paved terrace before a brick house, with planters and a bench",
     detail::make_terrace, detail::terrace_light},
    {SyntheticSceneKind::kGym, "a gym with mirrors, dumbbells, wall bars and treadmills", detail::make_gym,
     detail::gym_light},
    {SyntheticSceneKind::kBar, "a bar with shelves of bottles, a counter, stools and lamps", detail::make_bar,
     detail::bar_light},
    {SyntheticSceneKind::kPlayground, "a playground with a slide, a swing, a seesaw, sand and trees",
     detail::make_playground, detail::playground_light},
    {SyntheticSceneKind::kGreenhouse, "a greenhouse with benches of pots, a bed of flowers and a chair",
     detail::make_greenhouse, detail::greenhouse_light},
    {SyntheticSceneKind::kCafe, "a street cafe with chairs, round tables, a parasol and an awning", detail::make_cafe,
     detail::cafe_light},
    {SyntheticSceneKind::kStore, "a store with shelves full of packages and a fridge", detail::make_store,
     detail::store_light},
    {SyntheticSceneKind::kBicycle, "a park with a bench, a bicycle at its end, a path and trees", detail::make_bicycle,
     detail::bicycle_light},
    {SyntheticSceneKind::kRoom, "a room with a grey sofa, a wide window, a piano and a round rug", detail::make_room,
     detail::room_light},
    {SyntheticSceneKind::kTruck, "a street with a pickup truck before houses", detail::make_truck, detail::truck_light},
}};

const SceneMaker& maker_of(SyntheticSceneKind kind) {
  for (const SceneMaker& maker : kMakers)
    if (maker.kind == kind) return maker;
  throw InternalError("a scene has no maker");
}

/// What the plan asks for, alone.
Gaussians support_alone(Index most, const ScenePlan& plan, std::uint64_t seed) {
  SceneKit kit(plan, seed);
  kit.add_support();
  if (kit.model.sheets() == 0) return {};
  return kit.model.covered(
      std::max(most, kit.model.sheets()), [](const auto&, const auto& normal) { return detail::faced_light(normal); },
      seed);
}

Gaussians made_scene(const SyntheticSettings& settings, const ScenePlan& plan) {
  const auto seed = static_cast<std::uint64_t>(settings.seed);
  const SceneMaker& maker = maker_of(settings.scene);
  SceneKit kit(plan, seed);
  maker.make(kit);
  kit.add_support();
  const Light light = [&](const auto& p, const auto& normal) { return maker.light(plan, p, normal); };
  return kit.model.covered(settings.scene_gaussians, from_another_side(light, settings), seed);
}

}  // namespace

Gaussians synthetic_scene(SyntheticSceneKind kind, Index most, const ScenePlan& plan, std::uint64_t seed) {
  SyntheticSettings settings;
  settings.scene = kind;
  settings.scene_gaussians = most;
  settings.seed = static_cast<std::int64_t>(seed);
  return synthetic_scene(settings, plan);
}

Gaussians synthetic_scene(const SyntheticSettings& settings, const ScenePlan& plan) {
  const auto seed = static_cast<std::uint64_t>(settings.seed);
  if (settings.scene_file.empty()) return made_scene(settings, plan);
  const SplatFile file = read_splats_with_warnings(settings.scene_file.string());
  if (file.report.antialiased)
    log_warning(settings.scene_file.string() +
                ": its Gaussians were trained with antialiasing, which the dataset's files cannot say; "
                "render.antialias=true draws them as they were trained");
  if (file.gaussians.count() == 0)
    throw DataError(settings.scene_file.string() + ": holds no Gaussians that can be used");
  Similarity placed;
  placed.scale = settings.scene_scale;
  placed.rotation = so3_exp(Vector3<double>(0, 0, settings.scene_turn_deg * std::numbers::pi / 180));
  const Vector3<double> middle(plan.middle[0], plan.middle[1], 0);
  placed.translation = middle - placed.rotation * Vector3<double>(settings.scene_place.data());
  Gaussians scene = transformed(file.gaussians, placed);
  for (std::size_t i = 0; i < scene.means.size(); ++i) {  // a dataset's scene is relative to the world's origin
    const double origin = scene.origin_world[static_cast<Eigen::Index>(i % 3)];
    scene.means[i] = static_cast<float>(double(scene.means[i]) + origin);
  }
  scene.origin_world.setZero();
  const Gaussians support = support_alone(settings.scene_gaussians / 10, plan, seed);
  if (support.count() == 0) return scene;
  const std::array<const Gaussians*, 2> parts = {&scene, &support};
  return concatenated(parts);
}

TriangleMesh synthetic_solids(const SyntheticSettings& settings, const ScenePlan& plan) {
  if (!settings.scene_file.empty()) return {};
  SceneKit kit(plan, static_cast<std::uint64_t>(settings.seed));
  maker_of(settings.scene).make(kit);
  kit.add_support();
  constexpr double kHalf = 5, kDeep = 2;  // metres: of the ground
  kit.box({0, 0, -kDeep}, {kHalf, kHalf, kDeep}, detail::plain({0, 0, 0}));
  return kit.model.boxes();
}

const char* scene_summary(SyntheticSceneKind kind) { return maker_of(kind).summary; }

}  // namespace hsi4d
