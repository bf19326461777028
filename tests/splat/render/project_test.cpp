#include "splat/render/project.h"

#include <cmath>
#include <limits>

#include "autodiff/matrix.h"
#include "tests/support/operator_check.h"
#include "tests/support/taped_splats.h"

namespace project_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

SplatView view_of_camera(const Camera& camera) {
  SplatView view;
  view.camera = camera;
  return view;
}

/// Means in pixels, factors and depths side by side.
template <class S>
Var<S> side_by_side(const Projected<S>& p) {
  const std::array parts = {p.means_px, p.factors, p.depths};
  return concat_cols(std::span<const Var<S>>(parts));
}

template <class S>
struct Run {
  Tape<S> tape;
  Var<S> means, axes, xi, all;
  Projected<S> projected;

  Run(const SplatView& view, const std::vector<double>& m, const std::vector<double>& a, const std::vector<double>& x)
      : means(leaf("means", 3, m)), axes(leaf("axes", 9, a)), xi(leaf("xi", 6, x)) {
    projected = project(means, axes, xi, view);
    all = side_by_side(projected);
    tape.forward(all);
  }
  void backward() { tape.backward(all, std::vector<S>(static_cast<std::size_t>(all.shape().count()), S(1))); }
  std::vector<double> value(Var<S> of) { return numbers_of<S>(tape.value(of)); }
  std::vector<double> d(Var<S> of) { return numbers_of<S>(tape.gradient(of)); }

 private:
  Var<S> leaf(const char* name, Index cols, const std::vector<double>& numbers) {
    const Var<S> var = tape.parameter(name, shape_of(static_cast<Index>(numbers.size()) / cols, cols));
    tape.set(var, std::vector<S>(numbers.begin(), numbers.end()));
    return var;
  }
};

const std::vector<double> kNoUpdate(6, 0.0);
const std::vector<double> kAxes = {0.1, 0.02, -0.03, 0.01, 0.2, 0.04, -0.02, 0.05, 0.15};

}  // namespace

TEST_CASE("projection passes the operator checks at any camera update", "[parallel]") {
  Camera camera = tilted_camera({40, 30});
  camera.cx = 25, camera.cy = 8, camera.fy = 50;
  for (const double reach : {0.0, 0.3}) {
    OperatorInput xi{"xi", shape_of(1, 6), -reach, reach};
    check_operator("project", {{"means", shape_of(600, 3), -0.8, 0.8}, {"axes", shape_of(600, 9), -0.2, 0.2}, xi},
                   [&](const auto& in) {
                     SplatView view = view_of_camera(camera);
                     return side_by_side(project(in[0], in[1], in[2], view));
                   });
  }
}

TEST_CASE("projection by hand") {
  Camera camera = plain_camera({40, 30});
  camera.fy = 50;
  Run<double> run(view_of_camera(camera), {0.5, -0.25, 2}, kAxes, kNoUpdate);
  CHECK(largest_difference(run.value(run.projected.means_px), {40 * 0.25 + 20, 50 * -0.125 + 15}) <= 1e-14);
  CHECK(run.value(run.projected.depths) == std::vector<double>{2});
  std::vector<double> factor(6);
  for (std::size_t c = 0; c < 3; ++c) {
    factor[c] = 20 * kAxes[c] - 20 * 0.25 * kAxes[6 + c];
    factor[3 + c] = 25 * kAxes[3 + c] + 25 * 0.125 * kAxes[6 + c];
  }
  CHECK(largest_difference(run.value(run.projected.factors), factor) <= 1e-14);
}

TEST_CASE("x/z and y/z are held in the Jacobian, each side at its own limit, with that branch's gradient [A2]") {
  Camera camera = plain_camera({40, 30});
  camera.cx = 30, camera.cy = 5;
  const double margin_x = 0.3 * 40 / (2 * camera.fx), margin_y = 0.3 * 30 / (2 * camera.fy);
  const double limits[4] = {-camera.cx / camera.fx - margin_x, (40 - camera.cx) / camera.fx + margin_x,
                            -camera.cy / camera.fy - margin_y, (30 - camera.cy) / camera.fy + margin_y};
  std::vector<double> means, axes;
  for (const double times : {0., 0.97, 1.03, 3.}) {
    for (int side = 0; side < 4; ++side) {
      const double z = 2 + 0.3 * side;
      const double at = times * limits[side] * z;
      for (const double x : side < 2 ? std::array{at, 0.1, z} : std::array{0.1, at, z}) {
        means.push_back(static_cast<float>(x));
      }
      for (const double a : kAxes) axes.push_back(static_cast<float>(a));
    }
  }
  const Index n = static_cast<Index>(means.size() / 3);
  check_operator("project beside the view",
                 {{"means", shape_of(n, 3), -1, 1, means},
                  {"axes", shape_of(n, 9), -1, 1, axes},
                  {"xi", shape_of(1, 6), -1, 1, std::vector<double>(6, 0.0)}},
                 [&](const auto& in) { return side_by_side(project(in[0], in[1], in[2], view_of_camera(camera))); },
                 {.tolerance = 1e-9, .kink_share = 0.02});
  // Far beyond the limit the factor is that of the limit, while the mean moves on.
  Run<double> at_limit(view_of_camera(camera), {limits[1] * 2, 0, 2}, kAxes, kNoUpdate);
  Run<double> beyond(view_of_camera(camera), {limits[1] * 6, 0, 2}, kAxes, kNoUpdate);
  CHECK(largest_difference(at_limit.value(at_limit.projected.factors), beyond.value(beyond.projected.factors)) <=
        1e-14);
  CHECK(beyond.value(beyond.projected.means_px)[0] > at_limit.value(at_limit.projected.means_px)[0] + 30);
}

TEST_CASE("the update is a motion of the camera from the left") {
  const Camera camera = tilted_camera({40, 30});
  const std::vector<double> xi = {0.1, -0.2, 0.3, 0.2, 0.1, -0.15};
  Camera moved = camera;
  moved.camera_from_world = se3_update(Vector6<double>(xi.data()), camera.camera_from_world);
  Run<double> a(view_of_camera(camera), {0.2, 0.3, -0.1}, kAxes, xi);
  Run<double> b(view_of_camera(moved), {0.2, 0.3, -0.1}, kAxes, kNoUpdate);
  CHECK(largest_difference(a.value(a.all), b.value(b.all)) <= 1e-12);
}

TEST_CASE("far from the world's origin nothing is lost in float [A10]") {
  const Camera camera = tilted_camera({1000, 750});
  const std::vector<double> mean = {0.25, 0.375, -0.125}, xi = {0.01, -0.02, 0.03, 0.02, 0.01, -0.015};
  Run<float> here(view_of_camera(camera), mean, kAxes, xi);
  here.backward();
  for (const double far : {1e2, 1e3, 1e4, 1e5, 1e6}) {
    const Vector3<double> offset(far, -0.5 * far, 0.25 * far);
    SplatView view = view_of_camera(camera);
    view.origin_world = offset;
    view.camera.camera_from_world.translation -= camera.camera_from_world.rotation * offset;
    Run<float> there(view, mean, kAxes, xi);
    there.backward();
    INFO("offset " << far);
    CHECK(largest_difference(there.value(there.all), here.value(here.all)) <= 1e-4);
    CHECK(relative_l2(there.d(there.means), here.d(here.means)) <= 1e-5);
    CHECK(relative_l2(there.d(there.xi), here.d(here.xi)) <= 1e-5);
  }
}

TEST_CASE("means and depths and their rests make those in double") {
  const Camera camera = tilted_camera({40, 30});
  const std::vector<double> mean = {0.25, 0.375, -0.125};
  Run<float> fast(view_of_camera(camera), mean, kAxes, kNoUpdate);
  Run<double> exact(view_of_camera(camera), mean, kAxes, kNoUpdate);
  const double depth = fast.value(fast.projected.depths)[0], rest = fast.value(fast.projected.depth_low)[0];
  CHECK(rest != 0);
  CHECK(depth + rest == Approx(exact.value(exact.projected.depths)[0]).epsilon(1e-14));
  CHECK(depth == static_cast<double>(static_cast<float>(exact.value(exact.projected.depths)[0])));
  CHECK(exact.value(exact.projected.depth_low)[0] == 0);
  for (std::size_t i = 0; i < 2; ++i) {
    const double px = fast.value(fast.projected.means_px)[i], px_rest = fast.value(fast.projected.means_low)[i];
    CHECK(px_rest != 0);
    CHECK(px + px_rest == Approx(exact.value(exact.projected.means_px)[i]).epsilon(1e-13));
    CHECK(exact.value(exact.projected.means_low)[i] == 0);
  }
}

TEST_CASE("Gaussians that are not drawn are zeros without a gradient") {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  const Camera camera = plain_camera({40, 30});
  const double near = RenderSettings().near;
  struct Case {
    std::vector<double> mean;
    double depth;
  };
  for (const Case& c : {Case{{0, 0, near}, near}, Case{{0.1, 0, -2}, -2}, Case{{0, 0, 0}, 0}, Case{{nan, 0, 2}, 0},
                        Case{{0, inf, 2}, 0}, Case{{0, 0, inf}, 0}}) {
    Run<double> run(view_of_camera(camera), c.mean, kAxes, kNoUpdate);
    run.backward();
    INFO("mean " << c.mean[0] << " " << c.mean[1] << " " << c.mean[2]);
    CHECK(run.value(run.projected.means_px) == std::vector<double>(2, 0.0));
    CHECK(run.value(run.projected.factors) == std::vector<double>(6, 0.0));
    if (std::isfinite(c.mean[0]) && std::isfinite(c.mean[1])) CHECK(run.value(run.projected.depths)[0] == c.depth);
    // Of the cotangents, all 1, that of the depth alone reaches anything, and that only where the point is finite:
    // ∂z/∂m is the camera's third row, ∂z/∂ξ = (0, 0, 1, y, −x, 0).
    const bool has_depth = std::isfinite(c.mean[0]) && std::isfinite(c.mean[1]) && std::isfinite(c.mean[2]);
    const std::vector<double> zeros(6, 0.0);
    CHECK(run.d(run.axes) == std::vector<double>(9, 0.0));
    CHECK(run.d(run.means) == (has_depth ? std::vector<double>{0, 0, 1} : std::vector<double>(3, 0.0)));
    CHECK(run.d(run.xi) == (has_depth ? std::vector<double>{0, 0, 1, c.mean[1], -c.mean[0], 0} : zeros));
  }
  std::vector<double> axes = kAxes;
  axes[4] = nan;
  Run<double> run(view_of_camera(camera), {0, 0, 2}, axes, kNoUpdate);
  run.backward();
  CHECK(run.value(run.projected.factors) == std::vector<double>(6, 0.0));
  CHECK(run.d(run.means) == std::vector<double>{0, 0, 1});  // of the depth
  CHECK(run.d(run.axes) == std::vector<double>(9, 0.0));
}

TEST_CASE("depths have their gradient on both sides of near") {
  const Camera camera = tilted_camera({40, 30});
  const Vector3<double> center = inverse(camera.camera_from_world).translation;
  std::vector<double> means;
  for (const double z : {-3.0, -0.2, 0.005, 2.0}) {
    const Vector3<double> m = center + camera.camera_from_world.rotation.transpose() * Vector3<double>(0.3 * z, 0.1, z);
    means.insert(means.end(), m.data(), m.data() + 3);
  }
  check_operator(
      "depths of what is drawn and what is not",
      {{"means", shape_of(4, 3), 0, 0, means}, {"axes", shape_of(4, 9), -0.2, 0.2}, {"xi", shape_of(1, 6), -0.1, 0.1}},
      [&](const auto& in) { return project(in[0], in[1], in[2], view_of_camera(camera)).depths; });
}

TEST_CASE("any scale at any depth stays finite in float [A4]") {
  Camera camera = plain_camera({1000, 1000});
  for (double z = 1e-6; z < 2e6; z *= 10) {
    for (double scale = 1e-12; scale < 2e12; scale *= 10) {
      for (const double x : {0., 0.3 * z, 1e4}) {
        std::vector<double> axes(9);
        for (std::size_t i = 0; i < 9; ++i) axes[i] = scale * (i % 4 == 0 ? 1 : 0.1);
        Run<float> run(view_of_camera(camera), {x, -x, z}, axes, kNoUpdate);
        run.backward();
        for (const auto& numbers : {run.value(run.all), run.d(run.means), run.d(run.axes), run.d(run.xi)}) {
          CHECK(std::all_of(numbers.begin(), numbers.end(), [](double v) { return std::isfinite(v); }));
        }
      }
    }
  }
}

TEST_CASE("intrinsics on the tape pass the operator checks", "[parallel]") {
  const Camera camera = tilted_camera({40, 30});
  check_operator(
      "project with intrinsics",
      {{"means", shape_of(600, 3), -0.8, 0.8},
       {"axes", shape_of(600, 9), -0.2, 0.2},
       {"xi", shape_of(1, 6), -0.2, 0.2},
       {"intrinsics", shape_of(1, 4), 0, 0, {47, 53, 23, 12}}},
      [&](const auto& in) { return side_by_side(project(in[0], in[1], in[2], view_of_camera(camera), in[3])); });
}

TEST_CASE("intrinsics move the limits of held ratios, with their gradient [A2]") {
  const Camera camera = plain_camera({40, 30});
  std::vector<double> means, axes;  // all beyond a limit: left, right, above, below, and at corners
  for (const double x : {-3., 0.1, 3.}) {
    for (const double y : {-3., -0.2, 3.}) {
      if (x == 0.1 && y == -0.2) continue;
      means.insert(means.end(), {static_cast<float>(2 * x), static_cast<float>(2 * y), 2});
      for (const double a : kAxes) axes.push_back(static_cast<float>(a));
    }
  }
  const Index n = static_cast<Index>(means.size() / 3);
  check_operator("factors of what is held, by intrinsics",
                 {{"means", shape_of(n, 3), 0, 0, means},
                  {"axes", shape_of(n, 9), 0, 0, axes},
                  {"xi", shape_of(1, 6), 0, 0, std::vector<double>(6, 0.0)},
                  {"intrinsics", shape_of(1, 4), 0, 0, {40, 50, 27, 9}}},
                 [&](const auto& in) { return project(in[0], in[1], in[2], view_of_camera(camera), in[3]).factors; },
                 {.tolerance = 1e-9, .kink_share = 0});
}

TEST_CASE("intrinsics on the tape are those of a camera, and are checked in every run") {
  const Camera camera = tilted_camera({40, 30});
  Camera other = camera;
  other.fx = 61, other.fy = 43, other.cx = 11, other.cy = 22;
  Tape<double> tape;
  const auto leaf = [&](const char* name, Index cols, const std::vector<double>& numbers) {
    const Var<double> var = tape.parameter(name, shape_of(1, cols));
    tape.set(var, numbers);
    return var;
  };
  const std::vector<double> mean = {0.2, 0.3, -0.1};
  const Var<double> means = leaf("means", 3, mean), axes = leaf("axes", 9, kAxes), xi = leaf("xi", 6, kNoUpdate);
  const Var<double> intrinsics = leaf("intrinsics", 4, {61, 43, 11, 22});
  const Var<double> all = side_by_side(project(means, axes, xi, view_of_camera(camera), intrinsics));
  tape.forward(all);
  Run<double> expected(view_of_camera(other), mean, kAxes, kNoUpdate);
  CHECK(numbers_of<double>(tape.value(all)) == expected.value(expected.all));
  tape.set(intrinsics, std::vector<double>{61, 0, 11, 22});
  CHECK_THROWS_AS(tape.forward(all), UserError);
  CHECK_THROWS_AS(project(means, axes, xi, view_of_camera(camera), xi), InternalError);
}

}  // namespace project_test
