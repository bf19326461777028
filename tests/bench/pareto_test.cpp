#include "bench/pareto.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/file.h"
#include "pipelines/draw/reference_render.h"
#include "splat/files/io_ply.h"
#include "splat/files/splat_file.h"
#include "tests/bench/rows.h"
#include "tests/support/temporary_folder.h"

namespace pareto_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

std::vector<ParetoSetting> settings_named(const std::vector<std::string>& names) {
  std::vector<ParetoSetting> chosen;
  for (const ParetoSetting& setting : pareto_settings())
    if (std::find(names.begin(), names.end(), setting.name()) != names.end()) chosen.push_back(setting);
  return chosen;
}

ParetoRow made_up(const std::string& scene, const std::string& value, double time, double rms, double gradient) {
  ParetoRow row{.scene = scene, .knob = "alpha_min", .value = value};
  row.time_ratio = time;
  row.image.rms = rms;
  row.gradients[3].relative_l2 = gradient;
  return row;
}

}  // namespace

TEST_CASE("the front is what nothing beats in both time and error") {
  const std::vector<TimeAndError> points = {{2, 0.1},   {1, 0.5}, {3, 0.1}, {1, 0.6},
                                            {1.5, 0.5}, {2, 0.1}, {4, 0},   {0.5, 9}};
  CHECK(pareto_front(points) == std::vector<std::size_t>{7, 1, 0, 6});
  CHECK(pareto_front({}).empty());
  CHECK(pareto_front({{1, 1}, {1, 1}}) == std::vector<std::size_t>{0});
}

TEST_CASE("a point is a setting over the scenes that are not extreme") {
  std::vector<ParetoRow> rows = {made_up("a", "x", 1, 1e-3, 0.1), made_up("b", "x", 4, 4e-3, 0.4),
                                 made_up("c", "x", 2, 2e-3, 0.2), made_up("a", "y", 3, 0, 0),
                                 made_up("d", "x", 100, 1, 1),    made_up("a", "z", 0.5, 1, 1)};
  rows[4].is_extreme = true;
  rows[5].model = ParetoModel::kUncapped;
  const std::vector<ParetoPoint> points = pareto_points(rows);
  REQUIRE(points.size() == 2);
  CHECK(points[0].name() == "alpha_min x");
  CHECK(points[0].time_ratio == Approx(2));
  CHECK(points[0].image_rms == 2e-3);
  CHECK(points[0].worst_image_rms == 4e-3);
  CHECK(points[0].gradient == 0.2);
  CHECK(points[0].worst_gradient == 0.4);
  CHECK(points[1].time_ratio == Approx(3));
  REQUIRE(pareto_points(rows, "b").size() == 1);
  CHECK(pareto_points(rows, "b")[0].time_ratio == Approx(4));
}

TEST_CASE("errors of known differences") {
  const std::vector<double> truth = {0, 1, 0, 1}, image = {0, 1, 0.5, 0.9};
  const ImageError error = image_error(image, truth);
  CHECK(error.rms == Approx(std::sqrt(0.26 / 4)));
  CHECK(error.max == Approx(0.5));
  CHECK(error.p999 == Approx(0.1));  // of four numbers the third
  CHECK(error.bias == Approx(0.1));
  CHECK(error.psnr_db().value() == Approx(-10 * std::log10(0.065)));
  CHECK_FALSE(image_error(truth, truth).psnr_db());
  CHECK_THROWS_AS(image_error(truth, std::vector<double>{1}), InternalError);

  const std::vector<double> t = {3, 4}, longer = {6, 8}, across = {-4, 3}, opposite = {-3, -4}, zero = {0, 0};
  CHECK(gradient_error(longer, t).relative_l2 == Approx(1));
  CHECK(gradient_error(longer, t).one_minus_cosine == Approx(0).margin(1e-15));
  CHECK(gradient_error(longer, t).bias == Approx(1));
  CHECK(gradient_error(across, t).relative_l2 == Approx(std::sqrt(2.0)));
  CHECK(gradient_error(across, t).one_minus_cosine == Approx(1));
  CHECK(gradient_error(across, t).bias == Approx(-1));
  CHECK(gradient_error(opposite, t).one_minus_cosine == Approx(2));
  CHECK(gradient_error(zero, t).relative_l2 == Approx(1));
  CHECK(std::isinf(gradient_error(t, zero).relative_l2));
  CHECK(gradient_error(zero, zero).relative_l2 == 0);
  const std::vector<double> near = {3, 4 + 1e-9};  // 1 − cos is far below what 1 − x can hold
  CHECK(gradient_error(near, t).one_minus_cosine == Approx(0.5 * std::pow(0.6e-9 / 5, 2)).epsilon(1e-3));
}

TEST_CASE("a class of gradients that is rounding alone has no error") {
  SceneGradients truth, other;
  truth.means = other.means = {3, 4};
  truth.quats = {1e-14, 0};
  other.quats = {0, -1e-6};
  CHECK(gradient_errors(other, truth)[1].relative_l2 == 0);
  other.quats = {0, -1e-3};  // more than rounding
  CHECK(gradient_errors(other, truth)[1].relative_l2 == Approx(1e11));
  truth.quats = {1e-9, 0};  // small, and there
  other.quats = {2e-9, 0};
  CHECK(gradient_errors(other, truth)[1].relative_l2 == Approx(1));
  other.quats = {};
  CHECK_THROWS_AS(gradient_errors(other, truth), InternalError);
}

TEST_CASE("the default comes first and no setting occurs twice") {
  const std::vector<ParetoSetting>& all = pareto_settings();
  CHECK(all.front().name() == "quality default");
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) CHECK(all[i].name() != all[k].name());
  const std::vector<std::string> knobs = pareto_knobs();
  CHECK(knobs.size() == 12);
  CHECK(pareto_scene_names().size() == 8);
}

TEST_CASE("the brute-force renderer has no error against itself") {
  const ParetoScene scene = pareto_scene("avatar_in_scene", 0.1);
  REQUIRE(scene.camera.width == 13);
  REQUIRE(scene.gaussians.count() == 35);
  SceneView view;
  view.camera = scene.camera;
  view.settings.alpha_min = view.settings.transmittance_stop = 0;
  view.precision = Precision::kReference;
  // The cotangent of the squared difference from a grey image: two ways to the same numbers.
  const std::vector<double> grey(3 * 13 * 13, 0.5);
  const SceneGradients one = scene_gradients(scene.gaussians, view, grey);
  std::vector<double> cotangent(grey.size());
  for (std::size_t i = 0; i < grey.size(); ++i)
    cotangent[i] = 2 * (one.rendered.image[i] - grey[i]) / static_cast<double>(grey.size());
  const SceneGradients other =
      adjoint_reference(scene.gaussians, view, [&cotangent](SceneGradients&) { return cotangent; });
  CHECK(image_error(other.rendered.image, one.rendered.image).max == 0);
  CHECK(*std::max_element(one.rendered.image.begin(), one.rendered.image.end()) > 0.1);
  for (const GradientError& error : gradient_errors(other, one)) CHECK(error.relative_l2 == 0);
  const auto too_few = [](SceneGradients&) { return std::vector<double>(3); };
  CHECK_THROWS_AS(adjoint_reference(scene.gaussians, view, too_few), InternalError);
}

TEST_CASE("every scene is drawn with fewer errors the fewer cuts there are") {
  const std::vector<ParetoSetting> settings =
      settings_named({"quality default", "quality fast", "quality accurate", "quality reference", "precision double",
                      "transmittance_stop 1e-2 inclusive"});
  REQUIRE(settings.size() == 6);
  ParetoBench bench{{}, settings, 1, 1};
  for (const std::string& name : pareto_scene_names())
    bench.scenes.push_back(pareto_scene(name, name == "stack" ? 0.05 : 0.2));
  Index told = 0;
  const std::vector<ParetoRow> rows = measure_pareto(bench, [&told](const ParetoRow&) { ++told; });
  CHECK(told == pareto_row_count(bench));
  CHECK(told == 6 * 6 + 2 * 4);
  for (const ParetoRow& row : rows) {
    INFO(row.scene << ", " << row.name());
    CHECK(row.is_extreme == (row.scene == "empty" || row.scene == "stack"));
    CHECK(row.repeats == 1);
    CHECK(row.forward.least_s > 0);
    CHECK(row.time_ratio > 0);
    if (row.scene == "empty") {
      CHECK(row.image.max == 0);
      CHECK(row.worst_gradient() == 0);
      continue;
    }
    CHECK(row.fragments > 0);
    CHECK(row.pairs > 0);
    if (row.value == "reference") CHECK((row.image.max < 1e-4 && row.worst_gradient() < 1e-3));
    if (row.value == "fast" && row.scene != "stack") CHECK(row.image.max > 1e-4);
  }
  CHECK(rows.front().time_ratio == 1);

  std::istringstream lines(pareto_json(rows));
  std::size_t objects = 0;
  for (std::string line; std::getline(lines, line); ++objects) {
    const nlohmann::json object = nlohmann::json::parse(line);
    check_bench_row(object);
    CHECK(object["gradients"].size() == kGradientClasses.size());
    CHECK(object["name"] == "pareto/" + rows[objects].scene + "/" + rows[objects].knob + " " + rows[objects].value);
    CHECK(object["threads"] == 1);
    const double median_ms = object["median_ms"];
    CHECK(median_ms == Approx(object["forward_ms"].get<double>() + object["backward_ms"].get<double>()));
    CHECK(object.contains("mfragments_per_s"));
    CHECK(object.contains("psnr_db") == (object["image_rms"] > 0));
  }
  CHECK(objects == rows.size());

  std::istringstream csv(pareto_csv(rows));
  std::string head, line;
  std::getline(csv, head);
  const auto commas = std::count(head.begin(), head.end(), ',');
  CHECK(commas == 24 + 18 + 4 + 2 * std::ssize(kTrackedErrors));  // a render's, its gradients', a reconstruction's
  for (objects = 0; std::getline(csv, line); ++objects)
    CHECK(std::count(line.begin(), line.end(), ',') == commas + std::count(line.begin(), line.end(), '"') / 2);
  CHECK(objects == rows.size());

  CHECK_THAT(pareto_table(rows), Contains("needles: 40 Gaussians, 676 pixels\n") && Contains("quality accurate"));
  CHECK_THAT(pareto_front_table(rows), Contains("front, all scenes") && Contains("front, avatar_in_scene\n"));
  const std::string svg = pareto_svg(rows);
  CHECK_THAT(svg, Contains("<svg xmlns=") && Contains("image, RMS, avatar_in_scene") && Contains("class=\"name\"") &&
                      Contains(">accurate</text>") && !Contains("nothing to plot"));
  CHECK_THAT(pareto_front_svg(rows), Contains("image, RMS, avatar_in_scene") &&
                                         Contains("gradient, relative L2, worst class, avatar_in_scene") &&
                                         Contains(">default</text>") && !Contains("median of all scenes"));
}

namespace {

/// Reconstructions with the default and with `fast`, for both budgets.
std::vector<TrackedPoint> made_up_tracking() {
  std::vector<TrackedPoint> points;
  for (const bool is_fixed_time : {false, true}) {
    TrackedPoint point{.knob = "quality", .value = "default", .iterations = 68, .seeds = 5};
    point.is_fixed_time = is_fixed_time;
    point.joints_mm = {13.43, 5.3};
    points.push_back(point);
    point.value = "fast";
    point.cost_ratio = 0.9;
    point.joints_mm = {is_fixed_time ? 40 : 12.2, 5.25};
    points.push_back(point);
  }
  return points;
}

std::size_t occurrences(const std::string& text, const std::string& word) {
  std::size_t count = 0;
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++count;
  return count;
}

/// Part i of a line of CSV that has no comma in a text.
std::string field(const std::string& line, std::size_t i) {
  std::size_t from = 0;
  for (; i > 0; --i) from = line.find(',', from) + 1;
  return line.substr(from, line.find(',', from) - from);
}

}  // namespace

TEST_CASE("a table of numbers has reconstructions below renders, under the same head") {
  const std::vector<TrackedPoint> tracked = made_up_tracking();
  std::istringstream csv(pareto_csv({made_up("a", "x", 1, 1e-3, 0.1)}, tracked));
  std::vector<std::string> lines;
  for (std::string line; std::getline(csv, line);) lines.push_back(line);
  REQUIRE(lines.size() == 2 + tracked.size());
  const auto count_of = [](const std::string& line) { return std::count(line.begin(), line.end(), ','); };
  for (const std::string& line : lines) CHECK(count_of(line) == count_of(lines[0]));
  const auto named = [&](const std::string& line, const std::string& column) {
    for (std::size_t i = 0; i <= static_cast<std::size_t>(count_of(lines[0])); ++i)
      if (field(lines[0], i) == column) return field(line, i);
    return "no column " + column;
  };
  CHECK(named(lines[1], "scene") == "a");
  CHECK(named(lines[1], "tracking").empty());
  CHECK(named(lines[1], "mpjpe_mm_mean").empty());
  CHECK(named(lines[3], "scene").empty());
  CHECK(named(lines[3], "time_ratio").empty());
  CHECK(named(lines[3], "value") == "fast");
  CHECK(named(lines[3], "tracking") == "steps");
  CHECK(named(lines[3], "iterations") == "68");
  CHECK(named(lines[3], "seeds") == "5");
  CHECK(named(lines[3], "cost_ratio") == "0.9");
  CHECK(named(lines[3], "mpjpe_mm_mean") == "12.2");
  CHECK(named(lines[3], "mpjpe_mm_deviation") == "5.25");
  CHECK(named(lines[5], "tracking") == "time");
  CHECK(named(lines[5], "mpjpe_mm_mean") == "40.0");
}

TEST_CASE("a picture has what errors come to below them: means and their spread, by both budgets") {
  const std::vector<ParetoRow> rows = {made_up("a", "x", 1, 1e-3, 0.1), made_up("a", "y", 2, 1e-4, 0.01)};
  const std::string without = pareto_svg(rows), svg = pareto_svg(rows, made_up_tracking());
  CHECK_THAT(without, !Contains("reconstruction"));
  CHECK_THAT(svg, Contains("errors of a reconstruction, mean and standard deviation of 5 seeds") &&
                      Contains(">joints beside the pelvis, mm, after as many steps</text>") &&
                      Contains(">joints beside the pelvis, mm, after as long as the default</text>") &&
                      Contains("<title>fast: 12.20 +- 5.25 mm</title>") &&
                      Contains("<title>default: 13.43 +- 5.30 mm</title>"));
  CHECK(occurrences(svg, "<svg class=\"plot\"") == occurrences(without, "<svg class=\"plot\"") + 8);
  // Side by side on one axis: the left one, whose errors are below 20, reaches as far.
  const std::size_t left = svg.find("aria-label=\"joints beside the pelvis, mm, after as many steps"),
                    right = svg.find("aria-label=\"joints beside the pelvis, mm, after as long");
  REQUIRE((left != std::string::npos && right != std::string::npos));
  CHECK_THAT(svg.substr(left, svg.find("</svg>", left) - left), Contains(">40</text>"));
  CHECK_THAT(svg.substr(right, svg.find("</svg>", right) - right), Contains(">40</text>"));
}

namespace {

/// That the preset `accurate` keeps what it promises.
void check_accurate(const std::vector<ParetoScene>& scenes) {
  ParetoBench bench{scenes, settings_named({"quality accurate"}), 1, 2};
  for (const ParetoRow& row : measure_pareto(bench)) {
    INFO(row.scene << ": " << row.image.psnr_db().value_or(1000) << " dB, gradient " << row.worst_gradient());
    CHECK(row.image.rms <= 1e-5);  // 100 dB
    CHECK(row.worst_gradient() <= 1e-3);
  }
}

}  // namespace

TEST_CASE("accurate has 100 dB and gradients to 1e-3 in every scene that is not extreme", "[full]") {
  std::vector<ParetoScene> scenes;
  for (const std::string& name : pareto_scene_names()) {
    scenes.push_back(pareto_scene(name));
    if (scenes.back().is_extreme) scenes.pop_back();
  }
  REQUIRE(scenes.size() == 6);
  check_accurate(scenes);
}

TEST_CASE("accurate has 100 dB and gradients to 1e-3 in a scene of the benchmark") {
  check_accurate({pareto_scene("avatar_in_scene", 0.4)});
}

TEST_CASE("instruction sets and threads change times alone") {
  std::vector<ParetoSetting> settings = settings_named({"quality default", "threads 2"});
  std::vector<Isa> sets;
  for (const ParetoSetting& setting : pareto_settings()) {
    if (setting.knob != "isa") continue;
    settings.push_back(setting);
    sets.push_back(setting.isa.value());
  }
  REQUIRE(sets.front() == Isa::kBaseline);
  REQUIRE(sets.back() == best_isa());
  const std::vector<ParetoRow> rows = measure_pareto({{pareto_scene("avatar_in_scene", 0.3)}, settings, 1, 1});
  CHECK(best_isa() == sets.back());
  REQUIRE(rows.size() == 2 + sets.size());
  const ParetoRow& usual = rows.front();
  CHECK((usual.isa == best_isa() && usual.threads == 1));
  CHECK((rows[1].name() == "threads 2" && rows[1].threads == 2 && rows[1].isa == best_isa()));
  CHECK(rows[1].image.rms == usual.image.rms);  // the same bits
  CHECK(rows[1].worst_gradient() == usual.worst_gradient());
  for (std::size_t i = 0; i < sets.size(); ++i) {
    const ParetoRow& row = rows[2 + i];
    CHECK((row.knob == "isa" && row.value == isa_name(sets[i]) && row.isa == sets[i] && row.threads == 1));
    CHECK(row.fragments == usual.fragments);
    CHECK(row.image.rms == Approx(usual.image.rms).epsilon(1e-3));
    CHECK(row.worst_gradient() == Approx(usual.worst_gradient()).epsilon(1e-3));
  }
  CHECK(pareto_json(rows).find("\"isa\":\"baseline\"") != std::string::npos);
  std::vector<ParetoPoint> points = pareto_points(rows);
  REQUIRE(points.size() == rows.size());
  for (ParetoPoint& point : points)
    if (is_machine_knob(point.knob)) point.time_ratio = 0.1;
  CHECK(pareto_front(points, &ParetoPoint::image_rms) == std::vector<std::size_t>{0});
}

TEST_CASE("the cap is compared with no cap") {
  ParetoScene scene = pareto_scene("opaque", 0.2);
  for (float& logit : scene.gaussians.opacity_logits) logit = 9;  // 0.9999
  for (float& log_scale : scene.gaussians.log_scales) log_scale += 1;
  const ParetoBench bench{{scene}, settings_named({"alpha_cap 0.99", "alpha_cap 1"}), 1, 1};
  const std::vector<ParetoRow> rows = measure_pareto(bench);
  REQUIRE(rows.size() == 2);
  CHECK(rows[0].model == ParetoModel::kUncapped);
  CHECK(rows[0].image.rms > 1.2 * rows[1].image.rms);
  CHECK(pareto_points(rows).empty());
}

TEST_CASE("scenes of the benchmark are files, or all that a folder has") {
  const TemporaryFolder here;
  Gaussians g;
  g.means = {0, 0, 0};
  g.quats = {1, 0, 0, 0};
  g.log_scales = {-1, -1, -1};
  g.opacity_logits = {1};
  g.sh = {0.5f, 0, 0};
  for (const char* name : {"b/two.ply", "b/one, or more.ply", "b/c/two.ply"}) write_ply(name, g);
  write_text_file("b/notes.txt", "none");
  const auto names_of = [](const std::vector<std::string>& paths) {
    std::vector<std::string> names;
    for (const ParetoScene& scene : pareto_scenes_of(paths)) {
      CHECK(scene.gaussians.count() == 1);
      names.push_back(scene.name);
    }
    return names;
  };
  CHECK(names_of({}).empty());
  CHECK(names_of({"b"}) == std::vector<std::string>{"one, or more.ply", "two.ply"});
  CHECK(names_of({"b/c", "b"}) == std::vector<std::string>{"two.ply", "one, or more.ply", "b/two.ply"});
  write_text_file("d/notes.txt", "none");
  CHECK_THROWS_WITH(pareto_scenes_of({"d"}),
                    "d: has no files of Gaussians; they are read from " + splat_formats_text());
  CHECK_THROWS_AS(pareto_scenes_of({"none.ply"}), UserError);
  ParetoRow row = made_up("one, or more.ply", "x", 1, 1e-3, 0.1);
  CHECK_THAT(pareto_csv({row}), Contains("\n\"one, or more.ply\",alpha_min,x,own,"));
}

TEST_CASE("an unknown scene of the benchmark is told with what is known") {
  CHECK_THROWS_WITH(pareto_scene("needle"),
                    "hsi4d bench pareto: no workload \"needle\"; known: sparse, dense, opaque, needles, "
                    "avatar_close_up, avatar_in_scene, empty, stack; did you mean \"needles\"?");
}

}  // namespace pareto_test
