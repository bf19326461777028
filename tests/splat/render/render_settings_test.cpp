#include "splat/render_settings.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/config_file.h"

namespace render_settings_test {

using namespace hsi4d;

namespace {

RenderSettings read(const std::string& text) {
  RenderSettings settings;
  ConfigFields fields;
  describe(fields, settings);
  ConfigProblems problems;
  read_config(load_config_text(text, "render.json", "", {}, problems), fields, problems);
  problems.throw_if_any();
  return settings;
}

std::string written(RenderSettings settings) {
  ConfigFields fields;
  describe(fields, settings);
  return to_json(write_config(fields));
}

}  // namespace

TEST_CASE("the default quality is what the struct holds") {
  RenderSettings applied;
  apply_quality(applied, Quality::kFast);
  apply_quality(applied, Quality::kDefault);
  CHECK(written(applied) == written(RenderSettings{}));
  CHECK(written(read("{}")) == written(RenderSettings{}));
}

TEST_CASE("quality presets hold their bounds") {
  const RenderSettings fast = read(R"({"quality": "fast"})");
  CHECK(fast.transmittance_stop > RenderSettings{}.transmittance_stop);
  const RenderSettings accurate = read(R"({"quality": "accurate"})");
  CHECK(accurate.alpha_min <= 2e-6);
  CHECK(accurate.transmittance_stop <= 1e-7);
  const RenderSettings reference = read(R"({"quality": "reference"})");
  CHECK(reference.alpha_cap == 1);
  CHECK(reference.alpha_min == 0);
  CHECK(reference.transmittance_stop == 0);
  CHECK(reference.depth_key == DepthKey::kDouble);
  // All presets but the reference take the quick form of the block kernel. Those for speed have a cap below 1 too, so
  // that what stands still behind is composited once (static_layer.h). The backward pass divides by nothing and needs
  // neither cap nor stop.
  CHECK(static_cast<float>(accurate.transmittance_stop) >= kExactBelowStop);
  CHECK(static_cast<float>(accurate.alpha_min) >= kExactBelowAlpha);
  CHECK(reference.alpha_min < static_cast<double>(kExactBelowAlpha));
  for (const RenderSettings& s : {fast, RenderSettings{}}) {
    CHECK(s.alpha_cap <= 1.0 - 1.0 / 4096);
    CHECK(s.transmittance_stop >= static_cast<double>(kExactBelowStop));
    CHECK(s.alpha_min >= static_cast<double>(kExactBelowAlpha));
    CHECK(s.blur >= static_cast<double>(kExactBelowBlur));
    CHECK(s.stop_rule == StopRule::kInclusive);
  }
}

TEST_CASE("compatibility presets hold the other renderers' constants") {
  const RenderSettings gsplat = read(R"({"compatibility": "gsplat"})");
  CHECK(gsplat.alpha_cap == 0.99);
  CHECK(gsplat.alpha_min == 1.0 / 255);
  CHECK(gsplat.transmittance_stop == 1e-4);
  CHECK(gsplat.stop_rule == StopRule::kExclusive);
  CHECK(gsplat.stop_when == StopWhen::kAtOrBelow);
  CHECK(gsplat.cap_gradient == CapGradient::kZero);
  CHECK(gsplat.footprint == Footprint::kExact);
  CHECK(gsplat.blur == 0.3);
  CHECK(gsplat.near == 0.01);
  CHECK(gsplat.frustum_clamp == 1.3);
  const RenderSettings inria = read(R"({"compatibility": "inria"})");
  CHECK(inria.near == 0.2);
  CHECK(inria.stop_rule == StopRule::kExclusive);
  CHECK(inria.stop_when == StopWhen::kBelow);
  CHECK(inria.cap_gradient == CapGradient::kPass);
  CHECK(inria.footprint == Footprint::kSquare3Sigma);
  CHECK(inria.alpha_cap == 0.99);
}

TEST_CASE("an explicitly written key wins against a preset, wherever it stands") {
  CHECK(read(R"({"alpha_min": 0.001, "quality": "accurate"})").alpha_min == 0.001);
  CHECK(read(R"({"quality": "accurate", "alpha_min": 0.001})").transmittance_stop == 1e-7);
  CHECK(read(R"({"near": 0.5, "compatibility": "inria"})").near == 0.5);
}

TEST_CASE("every preset survives being written and read") {
  for (const char* text :
       {R"({"quality": "fast"})", R"({"quality": "accurate", "blur": 0.1})", R"({"quality": "reference"})",
        R"({"compatibility": "gsplat"})", R"({"compatibility": "inria", "near": 0.3})"}) {
    const std::string once = written(read(text));
    CHECK(written(read(once)) == once);
  }
}

TEST_CASE("settings that contradict each other are refused") {
  CHECK_THROWS_WITH(read(R"({"quality": "fast", "compatibility": "gsplat"})"),
                    "render.json:1: /quality: quality and compatibility set the same keys; write one of the two");
  CHECK_THROWS_WITH(read(R"({"alpha_cap": 0.5, "alpha_min": 0.5})"),
                    "render.json:1: /alpha_min: alpha_min must be below alpha_cap, or nothing is drawn");
}

}  // namespace render_settings_test
