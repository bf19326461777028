// The loss term `penetration`.
#include <cmath>
#include <memory>

#include <catch2/catch.hpp>

#include "autodiff/matrix.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/file.h"
#include "optim/loss_term.h"
#include "stress/scratch_folder.h"
#include "tests/optim/solid/meshes.h"
#include "tests/optim/solid/surface_of_test.h"

namespace penetration_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr Index kRows = 40, kFrames = 3, kStill = 1;

const LossTerm& penetration() {
  for (const LossTerm& term : loss_terms()) {
    if (term.description.name == "penetration") return term;
  }
  throw std::runtime_error("there is no such term");
}

/// A body of some points over a floor, in three frames of which the last two move.
struct Scene {
  Avatar avatar;
  Gaussians floor;
  MotionStart start;

  Scene() {
    avatar.weights.vertices = kRows;
    avatar.weights.joints = 1;
    avatar.weights.per_vertex = 1;
    add_sheet(floor, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, 0.05);
    start.avatar = &avatar;
    start.scene = &floor;
    start.first_camera_center = {0, -3, 1.5};
    start.first_body.joints = {0, 0, 0.9};
    start.still_frames = kStill;
    start.body.resize(kFrames);
  }
};

struct Result {
  double loss = 0;
  std::vector<double> d_z;  // of each asked point
  std::vector<BodyPoint> asked;
};

/// The term where the points of frame t are at height(t, row), in a column of their own.
template <class Height>
Result run_term(const Scene& scene, const std::any& prepared, const Height& height) {
  Tape<double> tape;
  LossInputs<double> inputs;
  inputs.motion = std::shared_ptr<const MotionStart>(&scene.start, [](const MotionStart*) {});
  inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
  Result result;
  Var<double> places;
  inputs.body_points = [&](const std::vector<BodyPoint>& points) {
    result.asked = points;
    places = tape.parameter("places", shape_of(std::ssize(points), 3));
    for (Index p = 0; p < std::ssize(points); ++p) {
      const BodyPoint& point = points[static_cast<std::size_t>(p)];
      double* x = tape.write(places).row(p);
      x[0] = 0.013 + 0.02 * static_cast<double>(point.row);
      x[1] = 0.007;
      x[2] = height(point.frame, point.row);
    }
    return places;
  };
  const Var<double> loss = penetration().record(inputs, prepared);
  REQUIRE(loss.tape != nullptr);
  tape.forward(loss);
  tape.backward(loss);
  result.loss = tape.value(loss).scalar();
  for (Index p = 0; p < std::ssize(result.asked); ++p) result.d_z.push_back(tape.gradient(places)(p, 2));
  return result;
}

std::any prepared(const std::string& settings) {
  LossSettings chosen = default_settings(penetration().description);
  ConfigFields fields;
  describe(fields, chosen);
  ConfigProblems problems;
  read_config(load_config_text(settings, "a.json", "", {}, problems), fields, problems);
  problems.throw_if_any();
  return prepared_loss(chosen.term->prepare, chosen.own);
}

}  // namespace

TEST_CASE("penetration is the mean square of the depth below the floor that Gaussians show") {
  const Scene scene;
  const auto height = [](Index frame, Index row) { return frame == 1 && row < 10 ? -0.05 : 0.3; };
  const Result result = run_term(scene, prepared("{}"), height);
  CHECK(result.asked.size() == 2 * kRows);
  CHECK(result.loss == Approx(0.0025 * 10 / (2 * kRows)).epsilon(1e-4));
  for (std::size_t p = 0; p < result.asked.size(); ++p) {
    const bool inside = result.asked[p].frame == 1 && result.asked[p].row < 10;
    CHECK(result.d_z[p] == Approx(inside ? -2 * 0.05 / (2 * kRows) : 0).epsilon(1e-4));
  }
}

TEST_CASE("penetration keeps a margin, and counts no more points than are asked for") {
  const Scene scene;
  const auto height = [](Index, Index) { return 0.02; };
  CHECK(run_term(scene, prepared("{}"), height).loss == 0);
  const Result result = run_term(scene, prepared(R"({"margin": 0.05, "points": 7})"), height);
  CHECK(result.loss == Approx(0.0009).epsilon(1e-4));
  REQUIRE(result.asked.size() == 14);
  CHECK(result.asked[0].row == 0);
  CHECK(result.asked[6].row == 6 * kRows / 7);
  CHECK(result.asked[7].frame == 2);
}

TEST_CASE("penetration by a mesh, which may be of any size and far from the scene") {
  const ScratchFolder folder;
  const std::string path = std::string(folder.path()) + "/" + "box.ply";
  write_mesh(path, box_mesh({-2, -2, -0.5}, {2, 2, 0.25}));
  const std::any solid = prepared(R"({"mesh": ")" + path + R"("})");
  Scene scene;
  scene.start.scene = nullptr;
  CHECK(run_term(scene, solid, [](Index, Index) { return 0.15; }).loss == Approx(0.01).epsilon(1e-4));
  CHECK(run_term(scene, solid, [](Index, Index) { return 1e4; }).loss == 0);
  CHECK(run_term(scene, solid, [](Index, Index) { return 0.15; }).loss == Approx(0.01).epsilon(1e-4));
}

TEST_CASE("penetration reads its mesh when it is prepared, and says what is wrong with it") {
  const ScratchFolder folder;
  const std::string path = std::string(folder.path()) + "/" + "empty.obj";
  write_text_file(path, "v 0 0 0\n");
  CHECK_THROWS_WITH(prepared(R"({"mesh": ")" + path + R"("})"), path + ": the mesh has no faces");
}

TEST_CASE("penetration without anything that tells what is solid is an error, and without a scene it is off") {
  Scene scene;
  for (float& logit : scene.floor.opacity_logits) logit = -1;
  const std::any none = prepared("{}");
  CHECK_THROWS_WITH(run_term(scene, none, [](Index, Index) { return 0; }),
                    "loss penetration: of the scene's 1600 Gaussians 0 are opaque and flat, and the first camera and "
                    "body see none of these, so nothing tells what is solid; a \"mesh\" does");
  scene.start.scene = nullptr;
  Tape<double> tape;
  LossInputs<double> inputs;
  inputs.motion = std::shared_ptr<const MotionStart>(&scene.start, [](const MotionStart*) {});
  inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
  CHECK(penetration().record(inputs, none).tape == nullptr);
}

TEST_CASE("penetration follows the scene that it is given, though it keeps what it made of the last one") {
  Scene scene;
  const std::any solid = prepared("{}");
  const auto height = [](Index, Index) { return -0.05; };
  const double first = run_term(scene, solid, height).loss;
  CHECK(run_term(scene, solid, height).loss == first);
  for (std::size_t i = 2; i < scene.floor.means.size(); i += 3) scene.floor.means[i] += 0.03f;
  CHECK(run_term(scene, solid, height).loss == Approx(0.0064).epsilon(1e-3));
}

}  // namespace penetration_test
