#include "optim/loss_term.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "core/rotation.h"
#include "tests/optim/solid/surface_of_test.h"
#include "tests/support/loss_terms.h"
#include "tests/support/operator_check.h"
#include "tests/support/test_motion.h"

namespace loss_term_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr Index kHeight = 13, kWidth = 21, kObjects = 3;

/// Matrices by rows, some of joints far beyond their ranges.
std::vector<double> some_rotations() {
  std::vector<double> rows;
  for (int j = 0; j < 21; ++j) {
    const double size = 0.4 + 0.1 * j;
    const Matrix3<double> r = so3_exp(Vector3<double>(size * std::sin(1.0 + j), size * std::cos(2.0 * j), -0.3 * size));
    for (int i = 0; i < 9; ++i) rows.push_back(r(i / 3, i % 3));
  }
  return rows;
}

/// Depths of pixels, metres, and a map that is not far from them.
std::vector<double> some_depths(double scale, double shift, double noise) {
  std::vector<double> depths;
  for (Index i = 0; i < kHeight * kWidth; ++i) {
    const auto at = static_cast<double>(i);
    depths.push_back(scale * (2 + std::sin(0.7 * at)) + shift + noise * std::sin(0.9 * at * at));
  }
  return depths;
}

/// One of every input that a term may read, in the order of inputs_of. The third object is not to be seen in the frame.
std::vector<OperatorInput> all_inputs() {
  // The stride is that of double; float arrays may have the same padding.
  const Shape image = image_shape<double>(3, kHeight, kWidth), mask = image_shape<double>(1, kHeight, kWidth);
  return {{"rendered", image, 0, 1},
          {"target", image, 0, 1},
          {"weight", mask, 0, 1},
          {"object_opacity", image_shape<double>(kObjects, kHeight, kWidth), 0, 1},
          {"object_center_target", shape_of(kObjects, 3), 0, 1, {4.5, 6, 1, 12.25, 3.5, 1, 0, 0, 0}},
          {"object_depth", shape_of(kObjects, 1), 1, 3},
          {"object_depth_target", shape_of(kObjects, 1), 1, 3},
          {"body_rotations", shape_of(21, 9), 0, 0, some_rotations()},
          {"human_opacity", mask, 0, 1},
          {"human_mask", mask, 0, 1},
          {"object_masks", image_shape<double>(kObjects, kHeight, kWidth), 0, 1},
          {"joints", shape_of(kFrames, 66)},
          {"joints_start", shape_of(kFrames, 66)},
          {"body_places", shape_of((kFrames - kStill) * kVertexRows, 3)},
          {"object_places", shape_of((kFrames - kStill) * 2 * kObjectRows, 3)},
          {"human_seen", kScalarShape, 0, 0, {1}},
          {"object_seen", {kObjects, 1, 1, 1}, 0, 0, {1, 1, 0}},
          {"gaussian_opacities", shape_of(9, 1), 0, 1},
          {"gaussian_log_scales", shape_of(9, 3), -4, 0},
          {"depth_moments", image_shape<double>(2, kHeight, kWidth), 0.2, 0.3},
          {"transmittance", mask, 0, 0.5},
          {"depth_target", mask, 1, 2},
          {"keypoints", shape_of(4, 2), 0, 60},
          {"keypoints_target", shape_of(4, 3), 0, 0, {3, 5, 1, 40, 9, 0.5, 22, 31, 0.8, 8, 8, 0.1}},
          {"bones", shape_of(3, 3), 0, 0, {0.1, -0.3, 0.05, 0, 0.4, 0.2, -0.3, 0, 0.1}},
          {"bones_target", shape_of(3, 4), 0, 0, {0, -1, 0, 1, 0, 0.6, 0.8, 0.7, 1, 0, 0, 0.1}},
          {"depth", mask, 0, 0, some_depths(1, 0, 0)},
          {"depth_map", mask, 0, 0, some_depths(1.3, -2.7, 0.5)},
          {"depth_map_weight", mask, 0.2, 1},
          {"tracks", shape_of(4, 2), 0, 20},
          {"tracks_target", shape_of(4, 3), 0, 0, {3, 5, 1, 14, 9, 0.6, 12, 3, 0.8, 8, 8, 0.1}},
          {"unknowns", shape_of(1, 3), -0.2, 0.2},
          {"color_change", shape_of(9, 3), -0.5, 0.5},
          {"shape_change", shape_of(9, 7), -1, 1}};
}

template <class S>
LossInputs<S> inputs_of(const std::vector<Var<S>>& in) {
  LossInputs<S> inputs;
  inputs.rendered = in[0];
  inputs.target = in[1];
  inputs.weight = in[2];
  inputs.object_opacity = in[3];
  inputs.object_center_target = in[4];
  inputs.object_depth = in[5];
  inputs.object_depth_target = in[6];
  inputs.body_rotations = in[7];
  inputs.human_opacity = in[8];
  inputs.human_mask = in[9];
  inputs.object_masks = in[10];
  inputs.joints = in[11];
  inputs.joints_start = in[12];
  inputs.human_seen = in[15];
  inputs.object_seen = in[16];
  inputs.gaussian_opacities = in[17];
  inputs.gaussian_log_scales = in[18];
  inputs.depth_moments = in[19];
  inputs.transmittance = in[20];
  inputs.depth_target = in[21];
  inputs.keypoints = in[22];
  inputs.keypoints_target = in[23];
  inputs.bones = in[24];
  inputs.bones_target = in[25];
  inputs.depth = in[26];
  inputs.depth_map = in[27];
  inputs.depth_map_weight = in[28];
  inputs.tracks = in[29];
  inputs.tracks_target = in[30];
  inputs.unknowns = in[31];
  inputs.color_change = in[32];
  inputs.shape_change = in[33];
  inputs.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
  inputs.body_points = [places = in[13]](const std::vector<BodyPoint>& points) {
    std::vector<std::uint32_t> rows;
    for (const BodyPoint& p : points)
      rows.push_back(static_cast<std::uint32_t>((p.frame - kStill) * kVertexRows + p.row));
    return gather_rows(places, rows);
  };
  inputs.object_points = [places = in[14]](const std::vector<ObjectPoint>& points) {
    std::vector<std::uint32_t> rows;
    for (const ObjectPoint& p : points)
      rows.push_back(static_cast<std::uint32_t>(((p.frame - kStill) * 2 + p.object) * kObjectRows + p.row));
    return gather_rows(places, rows);
  };
  return inputs;
}

}  // namespace

TEST_CASE("every registered loss term passes the gradient check", "[parallel]") {
  REQUIRE_FALSE(loss_terms().empty());
  for (const LossTerm& term : loss_terms()) {
    OperatorCheck check{.entries = 24};
    if (term.description.name == "penetration") {
      check.step = 2e-4;  // within cells of 2 cm, whose borders are kinks
      check.kink_share = 0.25;
    }
    check_operator(
        term.description.name, all_inputs(), [&](const auto& in) { return term.record(inputs_of(in)); }, check);
  }
}

TEST_CASE("keypoints_2d weighs by confidence, and its kernels agree with their formulas") {
  const LossTerm& term = *std::find_if(loss_terms().begin(), loss_terms().end(),
                                       [](const LossTerm& t) { return t.description.name == "keypoints_2d"; });
  const auto value_of = [&term](const std::string& kernel) {
    LossSettings settings = default_settings(term.description);
    ConfigFields fields;
    describe(fields, settings);
    ConfigProblems problems;
    const ConfigValue tree = load_config_text(
        R"({"kernel": ")" + kernel + R"(", "scale_px": 5, "min_confidence": 0.2})", "t.json", "", {}, problems);
    read_config(tree, fields, problems);
    problems.throw_if_any();
    Tape<double> tape;
    LossInputs<double> in;
    in.keypoints = tape.parameter("p", shape_of(3, 2));
    tape.set(in.keypoints, {3, 4, 30, 50, 7, 7});
    in.keypoints_target = tape.parameter("q", shape_of(3, 3));
    tape.set(in.keypoints_target, {0, 0, 0.5, 0, 10, 1, 90, 90, 0.1});  // 5 and 50 px off; the last is not sure enough
    const Var<double> loss = term.record(in, prepared_loss(term.description.prepare, settings.own));
    tape.forward(loss);
    return tape.value(loss).scalar();
  };
  CHECK(value_of("squared") == Approx((0.5 * 25 + 2500) / 3));
  CHECK(value_of("huber") == Approx((0.5 * 25 + 2 * 5 * 50 - 25) / 3));
  CHECK(value_of("geman_mcclure") == Approx((0.5 * 25 * 25 / 50.0 + 25 * 2500 / 2525.0) / 3));
}

TEST_CASE("kernels of terms pass the gradient check", "[parallel]") {
  const std::vector<std::pair<std::string, std::string>> terms = {
      {"photometric", R"("scale": 0.2)"},
      {"mask", R"("scale": 0.4)"},
      {"depth_map", R"("scale": 0.3)"},
      {"depth_map", R"("scale": 0.3, "kind": "disparity")"},
  };
  for (const auto& [name, settings] : terms) {
    for (const char* kernel : {"huber", "geman_mcclure"}) {
      const std::string text = R"({"kernel": ")" + std::string(kernel) + R"(", )" + settings + "}";
      INFO(name << " " << text);
      check_operator(name, all_inputs(), [&](const auto& in) { return record_term(name, inputs_of(in), text); },
                     {.entries = 24});
    }
  }
}

namespace {

/// Images of one row for depth_map: depths that are rendered, what is seen through them, the map and how sure it is.
struct MappedDepths {
  std::vector<double> depth, transmittance, map, weight;

  /// The loss; the gradient by the depths goes into `slopes`.
  double value(const std::string& settings, std::vector<double>* slopes = nullptr) const {
    Tape<double> tape;
    const auto leaf = [&](const char* name, const std::vector<double>& numbers) {
      const Var<double> var = tape.parameter(name, {1, 1, std::ssize(numbers), std::ssize(numbers)});
      tape.set(var, numbers);
      return var;
    };
    LossInputs<double> in;
    in.depth = leaf("depth", depth);
    in.transmittance = leaf("transmittance", transmittance);
    in.depth_map = leaf("map", map);
    in.depth_map_weight = leaf("weight", weight);
    const Var<double> loss = record_term("depth_map", in, settings);
    tape.forward(loss);
    tape.backward(loss);
    if (slopes != nullptr) {
      slopes->clear();
      for (Index i = 0; i < std::ssize(depth); ++i) slopes->push_back(tape.gradient(in.depth)(0, i));
    }
    return tape.value(loss).scalar();
  }
  /// The same by the normal equations of a q + b = p, plainly.
  template <class Kernel>
  double plainly(bool is_disparity, const Kernel& kernel) const {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    const auto each = [&](const auto& use) {
      for (std::size_t i = 0; i < depth.size(); ++i)
        use(weight[i] * (1 - transmittance[i]), depth[i] <= 0 ? 0 : is_disparity ? 1 / depth[i] : depth[i], map[i]);
    };
    each([&](double v, double q, double p) {
      const Eigen::Vector2d row(q, 1);
      normal += v * row * row.transpose();
      right += v * row * p;
    });
    const Eigen::Vector2d found = normal.ldlt().solve(right);
    double sum = 0, total = 0;
    each([&](double v, double q, double p) {
      sum += v * kernel(std::abs(found[0] * q + found[1] - p));
      total += v;
    });
    return sum / total;
  }
};

MappedDepths some_mapped_depths() {
  return {{2, 2.5, 3.1, 4, 2.2, 0, 5, 3.3},
          {0, 0.1, 0, 0.3, 0, 1, 0.05, 0},
          {-1.2, -0.4, 0.1, 1.3, -0.7, 0.9, 0.8, 2.5},
          {1, 0.5, 1, 1, 0, 1, 0.7, 0.9}};
}

}  // namespace

TEST_CASE("depth_map compares with a map after the least squares of scale and shift, by the kernel") {
  const MappedDepths depths = some_mapped_depths();
  MappedDepths turned = depths;
  for (double& p : turned.map) p = -p;
  for (const bool is_disparity : {false, true}) {
    const MappedDepths& given = is_disparity ? turned : depths;
    const auto value = [&](const std::string& kernel) {
      return given.value(R"({"kind": ")" + std::string(is_disparity ? "disparity" : "depth") + R"(", "kernel": ")" +
                         kernel + R"(")" + (kernel == "squared" ? "" : R"(, "scale": 0.4)") + "}");
    };
    const double s = static_cast<double>(0.4F);
    CHECK(value("squared") == Approx(given.plainly(is_disparity, [](double r) { return r * r; })).epsilon(1e-6));
    CHECK(value("huber") == Approx(given.plainly(is_disparity, [s](double r) {
                              return r < s ? r * r : 2 * s * r - s * s;
                            })).epsilon(1e-6));
    CHECK(value("geman_mcclure") ==
          Approx(given.plainly(is_disparity, [s](double r) { return s * s * r * r / (s * s + r * r); })).epsilon(1e-6));
  }
}

TEST_CASE("depth_map knows nothing of the map's scale and shift, nor of the render's") {
  const MappedDepths depths = some_mapped_depths();
  const double value = depths.value("{}");
  CHECK(value > 0.01);
  MappedDepths other = depths;
  for (double& z : other.depth) z = z == 0 ? 0 : 1.7 * z + 0.6;
  CHECK(other.value("{}") == Approx(value).epsilon(1e-6));
  other = depths;
  for (double& p : other.map) p += 3;
  CHECK(other.value("{}") == Approx(value).epsilon(1e-6));
  // A map of the same depths leaves nothing, and pulls nothing.
  for (std::size_t i = 0; i < other.map.size(); ++i) other.map[i] = 0.8 * depths.depth[i] - 2;
  std::vector<double> slopes;
  CHECK(other.value("{}", &slopes) < 1e-12);
  for (const double slope : slopes) CHECK(std::abs(slope) < 1e-7);
  for (std::size_t i = 0; i < other.map.size(); ++i)
    other.map[i] = depths.depth[i] > 0 ? 0.8 / depths.depth[i] - 2 : 7;  // where nothing is seen it may say anything
  CHECK(other.value(R"({"kind": "disparity"})") < 1e-10);
}

TEST_CASE("depth_map pulls nothing where the map says nothing, or the opposite") {
  MappedDepths depths = some_mapped_depths();
  std::vector<double> slopes;
  depths.weight.assign(depths.weight.size(), 0);
  CHECK(depths.value("{}", &slopes) == 0);
  CHECK(slopes == std::vector<double>(slopes.size(), 0));
  depths = some_mapped_depths();
  for (double& p : depths.map) p = -p;
  CHECK(depths.value(R"({"kernel": "squared"})", &slopes) > 0.5);  // all that the map has
  CHECK(slopes == std::vector<double>(slopes.size(), 0));
  CHECK(depths.value(R"({"kind": "disparity"})", &slopes) > 0);
  CHECK(slopes != std::vector<double>(slopes.size(), 0));
  depths.depth.assign(depths.depth.size(), 3);  // a wall
  CHECK(std::isfinite(depths.value("{}", &slopes)));
  for (const double slope : slopes) CHECK(std::isfinite(slope));
}

TEST_CASE("kernels of photometric and mask agree with their formulas") {
  const auto flat = [](double value, const std::string& settings) {
    Tape<double> tape;
    LossInputs<double> in;
    in.rendered = tape.parameter("rendered", image_shape<double>(3, kHeight, kWidth));
    in.target = tape.constant("target", image_shape<double>(3, kHeight, kWidth));
    const Array<double> image = tape.write(in.rendered);
    for (Index r = 0; r < image.total_rows(); ++r) std::fill_n(image.row(r), kWidth, value);
    const Var<double> loss = record_term("photometric", in, settings);
    tape.forward(loss);
    return tape.value(loss).scalar();
  };
  const std::string huber = R"({"kernel": "huber", "scale": 0.125, "ssim_share": 0})",
                    geman = R"({"kernel": "geman_mcclure", "scale": 0.125, "ssim_share": 0})";
  CHECK(flat(0.5, huber) == Approx(0.5 - 0.0625));
  CHECK(flat(-0.0625, huber) == Approx(0.0625 * 0.0625 / 0.25));
  CHECK(flat(0.5, geman) == Approx(0.125 * 0.25 / (0.125 * 0.125 + 0.25)));
  const double structure = flat(0.5, R"({"ssim_share": 1})");
  CHECK(flat(0.5, R"({"kernel": "geman_mcclure", "scale": 0.125, "ssim_share": 0.25})") ==
        Approx(0.75 * flat(0.5, geman) + 0.25 * structure));
  CHECK_THROWS_WITH(flat(0.5, R"({"kernel": "huber", "ssim_share": 1})"),
                    Catch::Contains("there is nothing that a kernel counts: ssim_share is 1"));
  CHECK_THROWS_WITH(flat(0.5, R"({"scale": 0.2})"),
                    Catch::Contains("does nothing with kernel \"absolute\"; allowed: "));
  CHECK(flat(0.5, R"({"scale": 0.1, "ssim_share": 0})") == Approx(0.5));  // the default, as resolved configs have it
}

TEST_CASE("a scale that no kernel reads is refused") {
  for (const char* const name : {"mask", "depth_map"}) {
    INFO(name);
    Tape<double> tape;
    LossInputs<double> in;
    CHECK_THROWS_WITH(record_term(name, in, R"({"kernel": "squared", "scale": 0.2})"),
                      Catch::Contains("/scale: does nothing with kernel \"squared\"; allowed: kernel \"huber\" or "
                                      "\"geman_mcclure\", or no scale"));
  }
}

TEST_CASE("bone_directions does not depend on lengths, and lets go of what points the other way") {
  const LossTerm& term = *std::find_if(loss_terms().begin(), loss_terms().end(),
                                       [](const LossTerm& t) { return t.description.name == "bone_directions"; });
  const auto value_of = [&term](const std::vector<double>& bones, const std::vector<double>& targets) {
    Tape<double> tape;
    LossInputs<double> in;
    in.bones = tape.parameter("b", shape_of(std::ssize(bones) / 3, 3));
    tape.set(in.bones, bones);
    in.bones_target = tape.parameter("t", shape_of(std::ssize(targets) / 4, 4));
    tape.set(in.bones_target, targets);
    const Var<double> loss = term.record(in);
    tape.forward(loss);
    return tape.value(loss).scalar();
  };
  const double right_angle = 2.0 / (1 + 2);  // chord² 2, scale 1
  CHECK(value_of({2, 0, 0}, {0, 1, 0, 1}) == Approx(right_angle));
  CHECK(value_of({0.01, 0, 0}, {0, 1, 0, 1}) == Approx(right_angle));
  CHECK(value_of({0, 3, 0}, {0, 1, 0, 1}) == Approx(0).margin(1e-12));
  CHECK(value_of({0, -3, 0}, {0, 1, 0, 0.5}) == Approx(0.5 * 4 / (1 + 4.0)));
  CHECK(value_of({2, 0, 0, 1, 1, 1}, {0, 1, 0, 1, 0, 0, 1, 0.2}) == Approx(right_angle / 2));  // the other is not sure
  CHECK(value_of({0, 0, 0}, {0, 1, 0, 1}) == Approx(right_angle));  // no direction: as one across
}

TEST_CASE("depth_spread counts known depths alone, and what rounding made less than nothing as nothing") {
  const auto term = std::find_if(loss_terms().begin(), loss_terms().end(),
                                 [](const LossTerm& t) { return t.description.name == "depth_spread"; });
  REQUIRE(term != loss_terms().end());
  Tape<double> tape;
  const auto leaf = [&](const char* name, Index planes, const std::vector<double>& numbers) {
    const Var<double> var = tape.parameter(name, {planes, 1, 2, 2});
    tape.set(var, numbers);
    return var;
  };
  // One Gaussian of weight 0.64 a hundredth behind a depth of 2 m; a pixel whose depth is not known.
  LossInputs<double> in;
  const double z = 2.02, w = 0.64, floor = static_cast<double>(0.002F);
  in.depth_moments = leaf("moments", 2, {w * z, 5, w * z * z, 90});
  in.transmittance = leaf("transmittance", 1, {1 - w, 0.3});
  in.depth_target = leaf("target", 1, {2, 0});
  const Var<double> loss = term->record(in);
  tape.forward(loss);
  CHECK(tape.value(loss).scalar() == Approx((std::hypot(0.8 * 0.01, floor) - floor) / 2).epsilon(1e-6));
  tape.backward(loss);
  CHECK(tape.gradient(in.depth_moments)(0, 0, 0) < 0);
  CHECK(tape.gradient(in.depth_moments)(0, 0, 1) == 0);
  CHECK(tape.gradient(in.transmittance)(0, 1) == 0);
  tape.set(in.depth_moments, {w * 2, 5, w * 4 - 1e-9, 90});
  tape.forward(loss);
  CHECK(std::abs(tape.value(loss).scalar()) < 1e-9);
  tape.backward(loss);
  CHECK(std::isfinite(tape.gradient(in.depth_moments)(0, 0, 0)));
}

TEST_CASE("look is the mean square of what has changed, and pulls all Gaussians alike") {
  Tape<double> tape;
  LossInputs<double> in;
  in.color_change = tape.parameter("colors", shape_of(2, 3));
  in.shape_change = tape.parameter("shape", shape_of(2, 7));
  tape.set(in.color_change, {0.3, 0, 0, 0, 0, 0.4});
  tape.set(in.shape_change, {1, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0});
  const Var<double> loss = record_term("look", in, R"({"shape": 0.1})");
  tape.forward(loss);
  CHECK(tape.value(loss).scalar() == Approx((0.09 + 0.16) / 2 + 0.1 * (1 + 4) / 2).epsilon(1e-14));
  tape.backward(loss);
  CHECK(tape.gradient(in.color_change)(0, 0) == Approx(0.3));
  CHECK(tape.gradient(in.color_change)(1, 2) == Approx(0.4));
  CHECK(tape.gradient(in.color_change)(1, 0) == 0);
}

TEST_CASE("a registered loss term whose inputs are not given is off") {
  for (const LossTerm& term : loss_terms()) {
    INFO(term.description.name);
    CHECK(term.record(LossInputs<double>{}).tape == nullptr);
    CHECK(term.record(LossInputs<float>{}).tape == nullptr);
  }
}

TEST_CASE("a registered loss term says whether it needs the body or objects") {
  for (const LossTerm& term : loss_terms()) {
    INFO(term.description.name);
    std::vector<OperatorInput> given = all_inputs();
    Tape<double> tape;
    std::vector<Var<double>> vars;
    for (const OperatorInput& input : given) vars.push_back(tape.parameter(input.name, input.shape));
    LossInputs<double> all = inputs_of(vars), no_body = all, no_objects = all;
    no_body.body_rotations = no_body.joints = no_body.joints_start = {};
    no_body.motion = nullptr;
    no_objects.object_opacity = no_objects.object_center_target = no_objects.object_place = no_objects.object_depth =
        no_objects.object_depth_target = {};
    CHECK(term.record(all).tape != nullptr);
    const std::vector<LossInput> needs = needs_of(default_settings(term.description));
    const auto needs_one_of = [&needs](const std::vector<LossInput>& some) {
      return std::all_of(needs.begin(), needs.end(),
                         [&some](LossInput need) { return std::find(some.begin(), some.end(), need) != some.end(); });
    };
    CHECK((term.record(no_body).tape == nullptr) ==
          needs_one_of({LossInput::kPose, LossInput::kMotion, LossInput::kObjectMotion, LossInput::kContacts,
                        LossInput::kBodyVertices}));
    CHECK((term.record(no_objects).tape == nullptr) ==
          needs_one_of({LossInput::kObjectDepth, LossInput::kObjectOpacity}));
  }
}

TEST_CASE("registered loss terms have different names and a summary") {
  std::vector<std::string> names;
  for (const LossDescription& loss : descriptions_of(loss_terms())) {
    CHECK(std::find(names.begin(), names.end(), loss.name) == names.end());
    CHECK_FALSE(loss.summary.empty());
    names.push_back(loss.name);
  }
}

namespace {

/// Value of a term where the rendered image is `value` everywhere and the target is black.
double value_of_flat(const std::string& name, double value, bool with_weight) {
  Tape<double> tape;
  LossInputs<double> inputs;
  inputs.rendered = tape.parameter("rendered", image_shape<double>(3, kHeight, kWidth));
  inputs.target = tape.constant("target", image_shape<double>(3, kHeight, kWidth));
  const Array<double> image = tape.write(inputs.rendered);
  for (Index r = 0; r < image.total_rows(); ++r) std::fill_n(image.row(r), kWidth, value);
  if (with_weight) {
    inputs.weight = tape.constant("weight", image_shape<double>(1, kHeight, kWidth));
    std::fill_n(tape.write(inputs.weight).row(4), kWidth, 1.0);  // one row counts
  }
  const auto loss = term_named(name).record(inputs);
  tape.forward(loss);
  return tape.value(loss).scalar();
}

}  // namespace

TEST_CASE("masked_l2 is the mean of squares over all pixels, of those that count") {
  CHECK(value_of_flat("masked_l2", 0.5, false) == Approx(0.25).epsilon(1e-14));
  CHECK(value_of_flat("masked_l2", 0.5, true) == Approx(0.25 / kHeight).epsilon(1e-14));
}

TEST_CASE("photometric is zero for equal images and its L1 share is that of the settings") {
  CHECK(value_of_flat("photometric", 0, false) == 0);
  const double loss = value_of_flat("photometric", 0.5, false);
  CHECK(loss > 0.9 * 0.5);
  CHECK(loss < 0.9 * 0.5 + 0.1);
  const double of_a_row = value_of_flat("photometric", 0.5, true);
  CHECK(of_a_row > 0.9 * 0.5 / kHeight);
  CHECK(of_a_row < loss);
}

namespace {

/// Two objects of a few pixels each on [13,21], and where their masks are.
struct Objects {
  Tape<double> tape;
  LossInputs<double> inputs;

  Objects() {
    inputs.object_opacity = tape.parameter("opacity", image_shape<double>(2, kHeight, kWidth));
    inputs.object_center_target = tape.constant("target", shape_of(2, 3));
    const Array<double> opacity = tape.write(inputs.object_opacity);
    for (const Index j : {4, 5, 6}) opacity(0, 2, j) = 0.9;  // centre (5.5, 2.5)
    opacity(1, 7, 10) = opacity(1, 8, 10) = 1;               // centre (10.5, 8)
    tape.set(inputs.object_center_target, {8.5, 6.5, 1, 10.5, 6, 1});
  }
  double value(const std::string& settings = "{}") {
    const auto loss = record_term("center", inputs, settings);
    tape.forward(loss);
    tape.backward(loss);
    return tape.value(loss).scalar();
  }
  double largest_slope(Index object) const {
    double largest = 0;
    const auto d = tape.gradient(inputs.object_opacity);
    for (Index i = 0; i < kHeight; ++i) {
      for (Index j = 0; j < kWidth; ++j) largest = std::max(largest, std::fabs(d(object, i, j)));
    }
    return largest;
  }
};

}  // namespace

TEST_CASE("center is the mean squared distance of the objects' centres") {
  Objects objects;
  CHECK(objects.value() == Approx((9 + 16 + 4) / 2.0).epsilon(1e-14));
  CHECK(objects.largest_slope(0) > 0);
}

TEST_CASE("center is off for an object that is hidden or not in the frame's mask") {
  Objects objects;
  objects.tape.set(objects.inputs.object_center_target, {8.5, 6.5, 0, 10.5, 6, 1});
  CHECK(objects.value() == Approx(4 / 2.0).epsilon(1e-14));
  CHECK(objects.largest_slope(0) == 0);
  CHECK(objects.largest_slope(1) > 0);
  CHECK(objects.value(R"({"min_opacity": 2.5})") == 0);  // the second has 2 px
  CHECK(objects.largest_slope(1) == 0);
  objects.tape.write(objects.inputs.object_opacity)(1, 7, 10) = 0;  // wholly hidden
  objects.tape.write(objects.inputs.object_opacity)(1, 8, 10) = 0;
  CHECK(objects.value() == 0);
  CHECK(objects.largest_slope(1) == 0);
}

TEST_CASE("center by_share counts an object by how much of it the frame shows") {
  Objects objects;
  objects.value();
  const double slope = objects.largest_slope(0);
  objects.tape.set(objects.inputs.object_center_target, {8.5, 6.5, 0.01, 10.5, 6, 1});
  CHECK(objects.value() ==
        Approx((9 + 16 + 4) / 2.0).epsilon(1e-14));  // without it a sliver counts like a whole object
  CHECK(objects.value(R"({"by_share": true})") == Approx((0.01 * (9 + 16) + 4) / 2.0).epsilon(1e-14));
  CHECK(objects.largest_slope(0) == Approx(0.01 * slope).epsilon(1e-12));
}

TEST_CASE("center that moves the object alone has the same value, and a gradient to its place only") {
  Objects objects;
  const auto value = objects.value();
  CHECK_THROWS(objects.value(R"({"moves": "nothing"})"));
  objects.inputs.object_place = objects.tape.parameter("place", shape_of(2, 2));
  objects.tape.set(objects.inputs.object_place, {5, 3, 30, 7});  // not where the rendered centre is
  CHECK(objects.value(R"({"moves": "object"})") == Approx(value).epsilon(1e-14));
  CHECK_FALSE(objects.tape.has_gradient(objects.inputs.object_opacity));  // none is computed
  const auto slope = objects.tape.gradient(objects.inputs.object_place);
  CHECK(slope(0, 0) == Approx(5.5 - 8.5));
  CHECK(slope(0, 1) == Approx(2.5 - 6.5));
  CHECK(slope(1, 0) == Approx(0).margin(1e-14));
  CHECK(slope(1, 1) == Approx(8.0 - 6));
  std::vector<LeftOut> left_out;
  objects.inputs.left_out = &left_out;
  objects.tape.write(objects.inputs.object_opacity)(1, 7, 10) = 0;  // wholly hidden: its place is led to the mask
  objects.tape.write(objects.inputs.object_opacity)(1, 8, 10) = 0;
  CHECK(objects.value(R"({"moves": "object"})") == Approx((9 + 16 + 19.5 * 19.5 + 1) / 2.0).epsilon(1e-14));
  CHECK(objects.tape.gradient(objects.inputs.object_place)(1, 0) == Approx(30 - 10.5));
  REQUIRE(left_out.size() == 1);
  CHECK_FALSE(left_out[0].is_left_out(1));
  objects.tape.set(objects.inputs.object_place, {5, 3, 0, 0});  // not before the camera: nothing can lead it
  CHECK(objects.value(R"({"moves": "object"})") == Approx((9 + 16) / 2.0).epsilon(1e-14));
  CHECK(left_out.back().is_left_out(1));
  CHECK_FALSE(left_out.back().is_left_out(0));
  objects.tape.set(objects.inputs.object_place, {5, 3, 30, 7});
  objects.tape.set(objects.inputs.object_center_target,
                   {8.5, 6.5, 1, 10.5, 6, 0});  // the frame does not show it either
  CHECK(objects.value(R"({"moves": "object"})") == Approx((9 + 16) / 2.0).epsilon(1e-14));
  CHECK(objects.tape.gradient(objects.inputs.object_place)(1, 0) == 0);
}

TEST_CASE("center tells which objects the render hides, not those that the frame does not show") {
  Objects objects;
  std::vector<LeftOut> left_out;
  objects.inputs.left_out = &left_out;
  const auto hidden = [&](const std::string& settings = "{}") {
    left_out.clear();
    objects.value(settings);
    REQUIRE(left_out.size() == 1);
    CHECK(left_out[0].term == "center");
    CHECK_FALSE(left_out[0].reason.empty());
    REQUIRE(left_out[0].objects == 2);
    return std::vector<bool>{left_out[0].is_left_out(0), left_out[0].is_left_out(1)};
  };
  CHECK(hidden() == std::vector<bool>{false, false});
  CHECK(hidden(R"({"min_opacity": 2.5})") == std::vector<bool>{false, true});  // the second has 2 px, the first 2.7
  CHECK(hidden(R"({"min_opacity": 3})") == std::vector<bool>{true, true});
  objects.tape.set(objects.inputs.object_center_target, {8.5, 6.5, 0, 10.5, 6, 1});
  CHECK(hidden(R"({"min_opacity": 3})") == std::vector<bool>{false, true});
  objects.tape.write(objects.inputs.object_opacity)(1, 7, 10) = 0;  // what it says is of the last forward run
  objects.tape.write(objects.inputs.object_opacity)(1, 8, 10) = 0;
  CHECK(hidden() == std::vector<bool>{false, true});
}

TEST_CASE("depth is the mean squared difference of the objects' depths") {
  Tape<double> tape;
  LossInputs<double> inputs;
  inputs.object_depth = tape.parameter("depth", shape_of(2, 1));
  inputs.object_depth_target = tape.constant("target", shape_of(2, 1));
  tape.set(inputs.object_depth, {2, 3});
  tape.set(inputs.object_depth_target, {2.5, 2});
  const auto loss = term_named("depth").record(inputs, {});
  tape.forward(loss);
  CHECK(tape.value(loss).scalar() == Approx((0.25 + 1) / 2).epsilon(1e-14));
}

namespace {

/// A stage's inputs with the body's rotations alone, by axis-angle vectors.
double body_loss(const std::string& name, const std::vector<double>& axis_angle) {
  Tape<double> tape;
  LossInputs<double> inputs;
  const auto pose = tape.parameter("pose", shape_of(21, 3));
  tape.set(pose, axis_angle);
  inputs.body_rotations = rotations_from_axis_angle(pose);
  const auto loss = term_named(name).record(inputs);
  tape.forward(loss);
  return tape.value(loss).scalar();
}

}  // namespace

TEST_CASE("joint_limits is zero within the ranges, and grows with the square beyond them") {
  std::vector<double> pose(63, 0.0);
  CHECK(body_loss("joint_limits", pose) == 0);
  const auto knee = [&](double bend) {
    pose[3 * 3] = bend;
    return body_loss("joint_limits", pose);
  };
  constexpr double kDegree = 3.14159265358979323846 / 180;
  CHECK(knee(150 * kDegree) == 0);
  CHECK(knee(-18 * kDegree) == Approx(100 * kDegree * kDegree).epsilon(1e-10));  // 8 degrees back are allowed
  CHECK(knee(-28 * kDegree) == Approx(400 * kDegree * kDegree).epsilon(1e-10));
}

TEST_CASE("pose_prior prefers a body at ease to one that is not") {
  std::vector<double> pose(63, 0.0), odd = pose;
  odd[3 * 3] = -1.5;                         // a knee bent forward
  odd[3 * 14 + 1] = 2.5;                     // a head turned round
  CHECK(body_loss("pose_prior", pose) > 0);  // arms to the sides are not at ease
  CHECK(body_loss("pose_prior", odd) > 2 * body_loss("pose_prior", pose));
}

namespace {

/// The human's and two objects' silhouettes, each of one value, and masks of another: differences 0.5, 0.2 and 0.4.
struct Silhouettes {
  Tape<double> tape;
  LossInputs<double> inputs;

  Silhouettes() {
    inputs.human_opacity = leaf("human", {0.9});
    inputs.human_mask = leaf("human mask", {0.4});
    inputs.human_seen = tape.constant("human seen", kScalarShape);
    inputs.object_opacity = leaf("objects", {0.5, 0.7});
    inputs.object_masks = leaf("object masks", {0.3, 0.3});
    inputs.object_seen = tape.constant("objects seen", {2, 1, 1, 1});
    see(true, true, true);
  }
  void see(bool human, bool first, bool second) {
    tape.set(inputs.human_seen, {human ? 1.0 : 0.0});
    tape.set(inputs.object_seen, {first ? 1.0 : 0.0, second ? 1.0 : 0.0});
  }
  double value(const std::string& settings = "{}") {
    const auto loss = record_term("mask", inputs, settings);
    tape.forward(loss);
    tape.backward(loss);
    return tape.value(loss).scalar();
  }
  /// The gradient of every pixel of a plane, which is the same in all.
  double slope(Var<double> opacity, Index plane) const {
    const auto d = tape.gradient(opacity);
    for (Index i = 0; i < 4; ++i) {
      for (Index j = 0; j < 5; ++j) CHECK(d(plane, i, j) == d(plane, 0, 0));
    }
    return d(plane, 0, 0);
  }
  Var<double> leaf(const char* name, const std::vector<double>& values) {
    const Var<double> var = tape.parameter(name, image_shape<double>(std::ssize(values), 4, 5));
    const Array<double> array = tape.write(var);
    for (Index p = 0; p < std::ssize(values); ++p) {
      for (Index i = 0; i < 4; ++i) std::fill_n(&array(p, i, 0), 5, values[static_cast<std::size_t>(p)]);
    }
    return var;
  }
};

}  // namespace

TEST_CASE("mask compares the silhouettes of the human and of each object") {
  Silhouettes all;
  CHECK(all.value() == Approx((0.25 + 0.04 + 0.16) / 3).epsilon(1e-13));
  CHECK(all.value(R"({"human": false})") == Approx((0.04 + 0.16) / 2).epsilon(1e-13));
  CHECK(all.value(R"({"objects": false})") == Approx(0.25).epsilon(1e-13));
  all.inputs.object_opacity = all.inputs.object_masks = all.inputs.object_seen = {};
  CHECK(all.value() == Approx(0.25).epsilon(1e-13));
}

TEST_CASE("mask by a kernel lets go of pixels far off, and leaves out what the frame does not show") {
  Silhouettes some;
  CHECK(some.value(R"({"kernel": "huber", "scale": 0.25})") == Approx((0.1875 + 0.04 + 0.1375) / 3).epsilon(1e-13));
  CHECK(some.value(R"({"kernel": "geman_mcclure", "scale": 0.5})") ==
        Approx((0.25 * 0.25 / 0.5 + 0.25 * 0.04 / 0.29 + 0.25 * 0.16 / 0.41) / 3).epsilon(1e-13));
  some.see(true, true, false);
  some.tape.write(some.inputs.object_masks)(1, 2, 3) = std::nan("");  // of what is not seen
  CHECK(some.value(R"({"kernel": "huber", "scale": 0.25})") == Approx((0.1875 + 0.04) / 3).epsilon(1e-13));
  CHECK(std::isfinite(some.slope(some.inputs.human_opacity, 0)));
}

TEST_CASE("mask leaves out what the frame does not show, and leaves the others as they are") {
  Silhouettes some;
  const auto slopes = [&some] {
    return std::vector<double>{some.slope(some.inputs.human_opacity, 0), some.slope(some.inputs.object_opacity, 0),
                               some.slope(some.inputs.object_opacity, 1)};
  };
  some.value();
  const std::vector<double> all = slopes();
  CHECK(all[0] == Approx(2 * 0.5 / 20 / 3));
  some.see(true, true, false);
  CHECK(some.value() == Approx((0.25 + 0.04) / 3).epsilon(1e-13));
  CHECK(slopes() == std::vector<double>{all[0], all[1], 0});
  some.see(false, true, true);
  CHECK(some.value() == Approx((0.04 + 0.16) / 3).epsilon(1e-13));
  CHECK(slopes() == std::vector<double>{0, all[1], all[2]});
  some.see(false, false, false);
  CHECK(some.value() == 0);
  CHECK(slopes() == std::vector<double>{0, 0, 0});
}

TEST_CASE("mask tells what the frame does not show, of what counts") {
  Silhouettes some;
  std::vector<LeftOut> left_out;
  some.inputs.left_out = &left_out;
  some.see(false, true, false);
  some.value();
  REQUIRE(left_out.size() == 2);
  for (const LeftOut& entry : left_out) {
    CHECK(entry.term == "mask");
    CHECK(entry.reason.empty());
  }
  CHECK(left_out[0].of_human);
  REQUIRE(left_out[0].objects == 1);
  CHECK(left_out[0].is_left_out(0));
  CHECK_FALSE(left_out[1].of_human);
  REQUIRE(left_out[1].objects == 2);
  CHECK_FALSE(left_out[1].is_left_out(0));
  CHECK(left_out[1].is_left_out(1));
  left_out.clear();
  some.value(R"({"human": false})");
  REQUIRE(left_out.size() == 1);
  CHECK_FALSE(left_out[0].of_human);
}

TEST_CASE("a term needs the opacities that its settings say, while it is on") {
  LossSettings mask = default_settings(term_named("mask").description);
  const auto reads = [](const LossSettings& loss) {
    return std::vector<bool>{needs_input(loss, LossInput::kHumanOpacity), needs_input(loss, LossInput::kObjectOpacity)};
  };
  const auto with = [&mask](const std::string& text) {
    LossSettings changed = mask;
    ConfigFields fields;
    describe(fields, changed);
    ConfigProblems problems;
    read_config(load_config_text(text, "a.json", "", {}, problems), fields, problems);
    problems.throw_if_any();
    return changed;
  };
  CHECK(reads(mask) == std::vector<bool>{true, true});
  CHECK(reads(with(R"({"human": false})")) == std::vector<bool>{false, true});
  CHECK(reads(with(R"({"objects": false})")) == std::vector<bool>{true, false});
  CHECK(reads(with(R"({"weight": 0})")) == std::vector<bool>{false, false});
  CHECK(reads(default_settings(term_named("center").description)) == std::vector<bool>{false, true});
  for (const char* name : {"photometric", "depth", "contact"})
    CHECK(reads(default_settings(term_named(name).description)) == std::vector<bool>{false, false});
}

}  // namespace loss_term_test
