#include "splat/render/render.h"

#include <cmath>
#include <limits>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "core/parallel.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/operator_check.h"
#include "tests/support/taped_splats.h"

namespace render_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

template <class S>
std::vector<double> image_of(TapedSplats<S>& taped) {
  taped.tape.forward(taped.rendered.image);
  return taped.value(taped.rendered.image);
}

SplatScene smooth_scene(Index n, const SceneSize& size) {
  SplatScene scene = random_splats(n, 17, size);
  apply_quality(scene.settings, Quality::kReference);
  return scene;
}

std::vector<double> wide(const std::vector<float>& numbers) { return {numbers.begin(), numbers.end()}; }

}  // namespace

TEST_CASE("the renderer passes the operator checks, all outputs at once", "[parallel][isa]") {
  const SplatScene scene = smooth_scene(12, {19, 17});
  const Index n = scene.count();
  SplatView view{scene.camera, Vector3<double>::Zero(), scene.settings};
  view.settings.blur = 30;  // wide enough that the depth has a gradient in every pixel
  RenderRequest request;
  request.depth = request.depth_moments = true;
  request.groups = {{0, 5}, {3, 12}, {4, 4}};
  const std::vector<OperatorInput> inputs = {{"means", shape_of(n, 3), 0, 1, wide(scene.means)},
                                             {"quats", shape_of(n, 4), 0, 1, wide(scene.quats)},
                                             {"log_scales", shape_of(n, 3), 0, 1, wide(scene.log_scales)},
                                             {"opacities", shape_of(n, 1), 0.2, 0.9},
                                             {"colors", shape_of(n, 3), 0, 1},
                                             {"xi", shape_of(1, 6), -0.05, 0.05},
                                             {"background", shape_of(1, 3), 0, 1}};
  OperatorCheck options;
  options.entries = 8;
  options.step = 1e-3;  // at 2e-3 the differences are off by 8e-8 themselves
  options.kink_share = 0.2;
  check_operator(
      "render", inputs,
      [&](const auto& in) {
        const auto out = render({in[0], gaussian_axes(in[1], in[2]), in[3], in[4]}, in[5], in[6], view, request);
        const auto first = slice_planes(out.depth_moments, 0, 1), second = slice_planes(out.depth_moments, 1, 1);
        return out.image * 0.7 + out.transmittance * 0.3 + out.depth + out.group_opacity +
               (first * 0.4 - second * 0.1);  // broadcast to 3 planes
      },
      options);
}

TEST_CASE("colours with a camera update pass the operator checks through the renderer [B19]") {
  const SplatScene scene = smooth_scene(10, {17, 11});
  const Index n = scene.count();
  SplatView view{scene.camera, Vector3<double>::Zero(), scene.settings};
  OperatorCheck options;
  options.entries = 8;
  options.kink_share = 0.3;  // colours at 0
  check_operator(
      "render of harmonics",
      {{"means", shape_of(n, 3), 0, 1, wide(scene.means)},
       {"sh", shape_of(n, 48), 0, 1, wide(scene.sh)},
       {"xi", shape_of(1, 6), -0.05, 0.05}},
      [&](const auto& in) {
        auto& tape = in[0].owner();
        using S = std::remove_reference_t<decltype(*tape.write(in[0]).data)>;
        const auto constant = [&](const char* name, const Shape& shape, const std::vector<double>& x) {
          const auto var = tape.constant(name, shape);
          tape.set(var, std::vector<S>(x.begin(), x.end()));
          return var;
        };
        const auto axes = gaussian_axes(constant("q", shape_of(n, 4), wide(scene.quats)),
                                        constant("l", shape_of(n, 3), wide(scene.log_scales)));
        const auto opacities = constant("o", shape_of(n, 1), std::vector<double>(static_cast<std::size_t>(n), 0.6));
        const auto background = constant("b", shape_of(1, 3), {0.1, 0.2, 0.3});
        return render({in[0], axes, opacities, sh_colors(in[1], in[0], in[2], view)}, in[2], background, view).image;
      },
      options);
}

TEST_CASE("intrinsics and any linear map pass the operator checks through the renderer", "[isa]") {
  SplatScene scene = smooth_scene(12, {19, 17});
  scene.settings.frustum_clamp = 0.6;  // some ratios are held
  const Index n = scene.count();
  const SplatView view{scene.camera, Vector3<double>::Zero(), scene.settings};
  const Camera& c = scene.camera;
  OperatorCheck options;
  options.entries = 12;
  options.kink_share = 0.2;
  check_operator(
      "render by intrinsics and transforms",
      {{"means", shape_of(n, 3), 0, 1, wide(scene.means)},
       {"axes", shape_of(n, 9), -0.3, 0.3},
       {"transforms", shape_of(n, 12), -1, 1},
       {"opacities", shape_of(n, 1), 0.2, 0.9},
       {"colors", shape_of(n, 3), 0, 1},
       {"xi", shape_of(1, 6), -0.05, 0.05},
       {"background", shape_of(1, 3), 0, 1},
       {"intrinsics", shape_of(1, 4), 0, 0, {1.1 * c.fx, 0.9 * c.fy, c.cx + 1.5, c.cy - 0.5}}},
      [&](const auto& in) {
        const auto out = render({in[0], transform_axes(in[2], in[1]), in[3], in[4]}, in[5], in[6], view, {}, in[7]);
        return out.image * 0.7 + out.transmittance * 0.3;
      },
      options);
}

TEST_CASE("an image without Gaussians is the background, exactly [B11]") {
  for (const int width : {1, 15, 16, 17}) {
    for (const int height : {1, 15, 16, 17}) {
      SplatScene empty, behind;
      empty.camera = plain_camera({width, height});
      empty.background = {0.1f, 0.7f, 0.3f};
      behind = empty;
      behind.add({0, 0, -2}, 0.3, 1, {0.2, 0.3, 0.4});
      for (const SplatScene& scene : {empty, behind}) {
        RenderRequest request;
        request.depth = true;
        request.groups = {{0, scene.count()}};
        TapedSplats<float> taped(scene, cotangent_of(scene.camera, 1, true), request);
        taped.run();
        const auto image = taped.value(taped.rendered.image);
        for (std::size_t i = 0; i < image.size(); ++i) {
          CHECK(image[i] == static_cast<double>(scene.background[i * 3 / image.size()]));
        }
        for (const double x : taped.value(taped.rendered.depth)) CHECK(x == 0);
        for (const double x : taped.value(taped.rendered.group_opacity)) CHECK(x == 0);
        for (const NamedNumbers& g : taped.gradients()) {
          if (g.name == "background") continue;
          CHECK(std::all_of(g.numbers.begin(), g.numbers.end(), [](double x) { return x == 0; }));
        }
      }
    }
  }
}

TEST_CASE("far from the world's origin the image is the same in float [A10]") {
  SplatScene scene = random_splats(60, 23, {96, 64});
  const SplatCotangent cotangent = cotangent_of(scene.camera);
  TapedSplats<float> here(scene, cotangent);
  here.run();
  for (const double far : {1e2, 1e4, 1e6}) {
    const Vector3<double> offset(far, -far, 0.5 * far);
    SplatScene moved = scene;
    moved.camera.camera_from_world.translation -= scene.camera.camera_from_world.rotation * offset;
    TapedSplats<float> there(moved, cotangent, {}, {}, offset);
    there.run();
    INFO("offset " << far);
    CHECK(largest_difference(there.value(there.rendered.image), here.value(here.rendered.image)) < 1e-4);
    for (const ClassError& e : gradient_errors(there.gradients(), here.gradients())) CHECK(e.all < 1e-3);
  }
}

TEST_CASE("the render of a crop is the crop of the render [A3]") {
  SplatScene scene = smooth_scene(40, {48, 32});
  scene.settings.frustum_clamp = 100;  // the limits of the Jacobian depend on the image; here they hold nothing
  TapedSplats<double> whole(scene, cotangent_of(scene.camera));
  const std::vector<double> image = image_of(whole);
  SplatScene part = scene;
  part.camera = cropped(scene.camera, 11, 7, 21, 19);
  TapedSplats<double> crop(part, cotangent_of(part.camera));
  const std::vector<double> window = image_of(crop);
  double worst = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t r = 0; r < 19; ++r) {
      for (std::size_t c = 0; c < 21; ++c) {
        worst = larger(worst, std::abs(window[(k * 19 + r) * 21 + c] - image[(k * 32 + r + 7) * 48 + c + 11]));
      }
    }
  }
  CHECK(worst < 1e-12);
}

TEST_CASE("the render with a camera update is that of the moved camera") {
  SplatScene scene = random_splats(40, 29, {48, 32});
  const std::vector<double> xi = {0.05, -0.1, 0.2, 0.1, -0.05, 0.08};
  TapedSplats<double> updated(scene, cotangent_of(scene.camera));
  updated.tape.set(updated.xi, xi);
  SplatScene moved = scene;
  moved.camera.camera_from_world = se3_update(Vector6<double>(xi.data()), scene.camera.camera_from_world);
  TapedSplats<double> direct(moved, cotangent_of(scene.camera));
  CHECK(largest_difference(image_of(updated), image_of(direct)) <= 1e-11);
}

TEST_CASE("depth has finite gradients at any opacity and distance [B14]") {
  for (const double opacity : {0., 1e-30, 1e-8, 1e-4, 0.5, 1.}) {
    for (const double z : {2.5, 30., 1e3}) {
      SplatScene scene;
      scene.camera = plain_camera({17, 17});
      apply_quality(scene.settings, Quality::kReference);
      const double logit = opacity <= 0   ? -std::numeric_limits<double>::infinity()
                           : opacity >= 1 ? std::numeric_limits<double>::infinity()
                                          : std::log(opacity / (1 - opacity));
      scene.add({0, 0, z}, 0.08 * z, logit, {0.5, 0.5, 0.5});
      scene.add({0.05 * z, 0, 1.1 * z}, 0.1 * z, logit, {0.2, 0.7, 0.4});
      RenderRequest request;
      request.depth = true;
      INFO("opacity " << opacity << ", z " << z);
      const auto check = [&]<class S>(S) {
        TapedSplats<S> taped(scene, cotangent_of(scene.camera, 0, true), request);
        taped.run();
        for (const double depth : taped.value(taped.rendered.depth)) {
          CHECK((depth == 0 || (depth >= z * (1 - 1e-5) && depth <= 1.1 * z * (1 + 1e-5))));
        }
        for (const NamedNumbers& g : taped.gradients()) {
          INFO("gradient of " << g.name);
          CHECK(std::all_of(g.numbers.begin(), g.numbers.end(), [](double x) { return std::isfinite(x); }));
        }
      };
      check(float());
      check(double());
    }
  }
}

TEST_CASE("a weight too small to divide by passes no gradient of the depth, one above it does [B14]") {
  for (const double factor : {0.9, 1.1}) {
    SplatScene scene;
    scene.camera = plain_camera({1, 1});
    apply_quality(scene.settings, Quality::kReference);
    scene.add({0, 0, 2.5}, 1, std::log(factor * kLeastDepthWeight), {0.5, 0.5, 0.5});
    RenderRequest request;
    request.depth = true;
    SplatCotangent depth_alone;
    depth_alone.depth = {1};
    depth_alone.image = {0, 0, 0};
    TapedSplats<double> taped(scene, depth_alone, request);
    taped.run();
    CHECK(taped.value(taped.rendered.depth)[0] == Approx(2.5));
    CHECK(taped.gradient(taped.means)[2] == Approx(factor < 1 ? 0.0 : 1.0));
  }
}

TEST_CASE("moments of the depth are what colours z and z² give, whatever else is asked for") {
  const SplatScene scene = smooth_scene(30, {19, 17});
  const Index n = scene.count();
  const SplatView view{scene.camera, Vector3<double>::Zero(), scene.settings};
  Tape<double> tape;
  const auto constant = [&](const char* name, Index cols, const std::vector<double>& numbers) {
    const Var<double> var = tape.constant(name, shape_of(std::ssize(numbers) / cols, cols));
    tape.set(var, numbers);
    return var;
  };
  std::vector<double> powers;
  for (Index i = 0; i < n; ++i) {
    const Vector3<float> mean(scene.means.data() + 3 * i);
    const double z = transform_point(scene.camera.camera_from_world, Vector3<double>(mean.cast<double>())).z();
    powers.insert(powers.end(), {z, z * z, 1});
  }
  const Var<double> axes = gaussian_axes(constant("q", 4, wide(scene.quats)), constant("l", 3, wide(scene.log_scales)));
  const SplatInputs<double> splats = {constant("m", 3, wide(scene.means)), axes,
                                      constant("o", 1, std::vector<double>(static_cast<std::size_t>(n), 0.6)),
                                      constant("c", 3, powers)};
  const Var<double> xi = constant("xi", 6, std::vector<double>(6, 0)), black = constant("b", 3, {0, 0, 0});
  for (const int asked : {0, 1, 2, 3}) {
    RenderRequest request;
    request.depth_moments = true;
    request.depth = asked % 2 == 1;
    if (asked > 1) request.groups = {{0, n}, {0, 0}};
    const Rendered<double> out = render(splats, xi, black, view, request);
    const Var<double> moments = out.depth_moments;
    REQUIRE(moments.shape().planes == 2);
    CHECK(out.depth.tape == (asked % 2 == 1 ? &tape : nullptr));
    for (const Var<double> var : {out.image, moments, out.transmittance}) tape.forward(var);
    if (asked > 1) tape.forward(out.group_opacity);
    const ConstArray<double> image = tape.value(out.image), m = tape.value(moments);
    for (Index y = 0; y < 17; ++y) {
      for (Index x = 0; x < 19; ++x) {
        CHECK(m(0, y, x) == Approx(image(0, y, x)).margin(1e-12));
        CHECK(m(1, y, x) == Approx(image(1, y, x)).margin(1e-12));
        if (asked > 1) CHECK(tape.value(out.group_opacity)(0, y, x) == Approx(image(2, y, x)).margin(1e-12));
      }
    }
  }
}

TEST_CASE("opacities pass the operator checks, and a logit that is NaN has gradient 0 [B15]") {
  check_operator("gaussian_opacities", {{"logits", shape_of(37, 1), -9, 9}},
                 [](const auto& in) { return gaussian_opacities(in[0]); });
  Tape<float> tape;
  const Var<float> logits = tape.parameter("logits", shape_of(4, 1));
  const float inf = std::numeric_limits<float>::infinity();
  tape.set(logits, std::vector<float>{std::nanf(""), inf, -inf, 20});
  const Var<float> opacities = gaussian_opacities(logits);
  tape.forward(opacities);
  tape.backward(opacities, std::vector<float>(4, 1));
  const ConstArray<float> o = tape.value(opacities), d = tape.gradient(logits);
  CHECK((std::isnan(o(0, 0)) && o(1, 0) == 1 && o(2, 0) == 0));
  CHECK((d(0, 0) == 0 && d(1, 0) == 0 && d(2, 0) == 0));
  CHECK(d(3, 0) == Approx(std::exp(-20.)));
}

TEST_CASE("broken numbers leave no trace in float: finite image, finite gradients [A4, A5]") {
  for (const SettingsVariant& variant : settings_variants()) {
    SplatScene scene = broken_numbers(13, {48, 32});
    variant.apply(scene.settings);
    TapedSplats<float> taped(scene, cotangent_of(scene.camera));
    taped.run();
    INFO(variant.name);
    for (const double x : taped.value(taped.rendered.image)) CHECK(std::isfinite(x));
    for (const NamedNumbers& g : taped.gradients()) {
      for (std::size_t i = 0; i < g.numbers.size(); ++i) {
        CHECK(std::isfinite(g.numbers[i]));
        if (g.name == "opacity_logits" && std::isnan(scene.opacity_logits[i])) CHECK(g.numbers[i] == 0);
      }
    }
  }
}

TEST_CASE("counters tell what was done, and fall with it") {
  SplatScene scene = random_splats(200, 37, {96, 64});
  TapedSplats<float> taped(scene, cotangent_of(scene.camera));
  image_of(taped);
  const RenderCounters all = *taped.rendered.counters;
  CHECK(all.tiles == 24);
  CHECK((all.visible > 100 && all.visible <= 200));
  CHECK(all.pairs >= all.visible);
  CHECK(all.fragments > all.pairs);
  scene.settings.alpha_min = 0.1;
  TapedSplats<float> fewer(scene, cotangent_of(scene.camera));
  image_of(fewer);
  CHECK(fewer.rendered.counters->pairs < all.pairs);
  CHECK(fewer.rendered.counters->fragments < all.fragments);
  scene.camera.camera_from_world.translation[2] -= 100;
  TapedSplats<float> away(scene, cotangent_of(scene.camera));
  image_of(away);
  CHECK(away.rendered.counters->visible == 0);
}

TEST_CASE("the signature tells order, visibility and stops") {
  SplatScene scene = stack(6, 0.5, 3, {17, 17});
  TapedSplats<double> taped(scene, cotangent_of(scene.camera));
  const auto signature = [&] {
    taped.tape.forward(taped.loss);
    return taped.tape.signature(taped.loss);
  };
  const std::uint64_t first = signature();
  CHECK(signature() == first);
  const auto set_depth = [&](double z) { taped.tape.write(taped.means)(0, 2) = z; };
  const double z = taped.tape.value(taped.means)(0, 2);
  set_depth(z + 1e-9);
  CHECK(signature() == first);
  set_depth(z < 3 ? 5 : 1);
  CHECK(signature() != first);
  set_depth(-1);
  CHECK(signature() != first);
  set_depth(z);
  CHECK(signature() == first);
}

TEST_CASE("a steady iteration of the renderer allocates nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: a sanitizer counts its own allocations");
    return;
  }
  SplatScene scene = random_splats(300, 41, {96, 64});
  RenderRequest request;
  request.depth = true;
  request.groups = {{0, 100}};
  for (const int threads : {1, 2}) {
    TapedSplats<float> taped(scene, cotangent_of(scene.camera, 1, true), request);
    with_threads(threads, [&] {
      CHECK(steady_allocations([&] {
              for (int i = 0; i < 5; ++i) {
                taped.tape.write(taped.means)(0, 0) += i % 2 == 0 ? 1e-3f : -1e-3f;
                taped.tape.write(taped.log_scales);
                taped.run();
              }
            }) == 0);
    });
  }
}

TEST_CASE("the same image comes from a tape after any detour") {
  SplatScene scene = random_splats(100, 43, {48, 32});
  TapedSplats<float> taped(scene, cotangent_of(scene.camera));
  taped.run();
  const auto image = taped.value(taped.rendered.image), d = taped.gradient(taped.means);
  const std::vector<float> away(scene.means.size(), 0.1f);
  taped.tape.set(taped.means, away);
  taped.run();
  taped.tape.set(taped.means, scene.means);
  taped.run();
  CHECK(taped.value(taped.rendered.image) == image);
  CHECK(taped.gradient(taped.means) == d);
}

TEST_CASE("what is not wanted has no adjoint, and the rest is the same") {
  SplatScene scene = random_splats(60, 47, {48, 32});
  TapedSplats<float> all(scene, cotangent_of(scene.camera)), camera_alone(scene, cotangent_of(scene.camera));
  all.run();
  for (const auto var : {camera_alone.means, camera_alone.quats, camera_alone.log_scales, camera_alone.opacity_logits,
                         camera_alone.sh, camera_alone.background}) {
    camera_alone.tape.freeze(var);
  }
  camera_alone.run();
  CHECK(camera_alone.gradient(camera_alone.xi) == all.gradient(all.xi));
  CHECK_FALSE(camera_alone.tape.has_gradient(camera_alone.means));
}

TEST_CASE("groups out of range are refused") {
  SplatScene scene = random_splats(10, 53);
  RenderRequest request;
  request.groups = {{3, 11}};
  CHECK_THROWS_WITH(TapedSplats<float>(scene, cotangent_of(scene.camera), request),
                    Catch::Contains("group [3, 11) of 10 Gaussians"));
}

}  // namespace render_test
