#include "optim/loss_term.h"

#include <algorithm>
#include <cmath>

#include "autodiff/difference.h"
#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "core/config_file.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/rotation.h"
#include "tests/optim/surface_of_test.h"
#include "tests/support/operator_check.h"

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

constexpr Index kFrames = 5, kStill = 2, kBodyRows = 60, kObjectRows = 30;

/// A human of a few Gaussians, each on one joint (every joint has one at least), and two objects: the first is at its
/// right hand.
struct MotionOfTest {
  Avatar avatar;
  std::array<Gaussians, 2> objects;
  Gaussians scene;  // a floor
  MotionStart start;

  MotionOfTest() {
    RandomSequence random(5);
    SparseWeights& weights = avatar.weights;
    weights.vertices = kBodyRows;
    weights.joints = kSmplxJoints;
    weights.per_vertex = 1;
    for (Index v = 0; v < kBodyRows; ++v) {
      weights.indices.push_back(static_cast<std::int32_t>(v % kSmplxJoints));
      weights.weights.push_back(1);
      for (int i = 0; i < 3; ++i) avatar.means.push_back(static_cast<float>(random.uniform(-0.04, 0.04)));
    }
    for (std::size_t o = 0; o < objects.size(); ++o) {
      objects[o].opacity_logits.resize(kObjectRows);
      for (Index i = 0; i < 3 * kObjectRows; ++i)
        objects[o].means.push_back(static_cast<float>(random.uniform(-0.03, 0.03)));
      start.objects.push_back(&objects[o]);
    }
    add_sheet(scene, {-1, -1, -0.2}, {2, 0, 0}, {0, 2, 0}, 0.1);
    start.scene = &scene;
    start.first_camera_center = {0, 0, 1.5};
    start.avatar = &avatar;
    start.still_frames = kStill;
    for (Index t = 0; t < kFrames; ++t) {
      start.body.push_back(shifted(0.01 * static_cast<double>(t)));
      start.world_from_object.push_back({{Matrix3<double>::Identity(), {0.01 * static_cast<double>(t), 0, 0}},
                                         {Matrix3<double>::Identity(), {3, 0, 0}}});
    }
    start.first_body = shifted(0);
  }
  /// All joints at the same place.
  static PosedJoints shifted(double x) {
    PosedJoints posed;
    for (Index j = 0; j < kSmplxJoints; ++j) {
      posed.transforms.insert(posed.transforms.end(), {1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0});
      posed.joints.insert(posed.joints.end(), {x, 0, 0});
    }
    return posed;
  }
};

const MotionOfTest& motion_of_test() {
  static const MotionOfTest motion;
  return motion;
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
          {"body_places", shape_of((kFrames - kStill) * kBodyRows, 3)},
          {"object_places", shape_of((kFrames - kStill) * 2 * kObjectRows, 3)}};
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
  inputs.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
  inputs.body_points = [places = in[13]](const std::vector<BodyPoint>& points) {
    std::vector<std::uint32_t> rows;
    for (const BodyPoint& p : points)
      rows.push_back(static_cast<std::uint32_t>((p.frame - kStill) * kBodyRows + p.row));
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
    if (term.description.name == "penetration") check.step = 2e-4;  // within cells of 2 cm
    check_operator(
        term.description.name, all_inputs(), [&](const auto& in) { return term.record(inputs_of(in)); }, check);
  }
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
    no_objects.object_opacity = no_objects.object_center_target = no_objects.object_depth =
        no_objects.object_depth_target = {};
    CHECK(term.record(all).tape != nullptr);
    CHECK((term.record(no_body).tape == nullptr) == (term.description.needs == LossNeeds::kBody));
    CHECK((term.record(no_objects).tape == nullptr) == (term.description.needs == LossNeeds::kObjects));
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

const LossTerm& term_named(const std::string& name) {
  return *std::find_if(loss_terms().begin(), loss_terms().end(),
                       [&](const LossTerm& term) { return term.description.name == name; });
}

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
    const LossTerm& term = term_named("center");
    LossSettings chosen = default_settings(term.description);
    ConfigFields fields;
    describe(fields, chosen);
    ConfigProblems problems;
    read_config(load_config_text(settings, "a.json", "", {}, problems), fields, problems);
    problems.throw_if_any();
    const auto loss = term.record(inputs, chosen.own);
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
  CHECK(objects.value(R"({"unit": "width"})") == Approx((9 + 16 + 4) / 2.0 / (kWidth * kWidth)).epsilon(1e-14));
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

/// The term of the inputs of a sequence in which what moves is off by what the functions say.
double motion_loss(const std::string& name, const std::string& settings,
                   const std::function<double(Index frame, Index column)>& joint,
                   const std::function<Vector3<double>(const BodyPoint&)>& body = {}) {
  Tape<double> tape;
  LossInputs<double> inputs;
  inputs.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
  inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
  inputs.joints_start = tape.constant("joints_start", shape_of(kFrames, 66));
  for (Index t = 0; t < kFrames; ++t) {
    for (Index c = 0; c < 66; ++c) tape.write(inputs.joints)(t, c) = joint(t, c);
  }
  const auto leaf = [&tape](const char* leaf_name, const auto& points, const auto& place) {
    const Var<double> var = tape.parameter(leaf_name, shape_of(std::ssize(points), 3));
    for (Index i = 0; i < std::ssize(points); ++i) {
      const Vector3<double> x = place(points[static_cast<std::size_t>(i)]);
      std::copy_n(x.data(), 3, tape.write(var).row(i));
    }
    return var;
  };
  inputs.body_points = [&](const std::vector<BodyPoint>& points) { return leaf("body", points, body); };
  inputs.object_points = [&](const std::vector<ObjectPoint>& points) {
    return leaf("object", points, [](const ObjectPoint& p) { return motion_of_test().start.place(p); });
  };
  const LossTerm& term = term_named(name);
  LossSettings chosen = default_settings(term.description);
  ConfigFields fields;
  describe(fields, chosen);
  ConfigProblems problems;
  read_config(load_config_text(settings, "a.json", "", {}, problems), fields, problems);
  problems.throw_if_any();
  const auto loss = term.record(inputs, chosen.own);
  REQUIRE(loss.tape != nullptr);
  tape.forward(loss);
  return tape.value(loss).scalar();
}

double no_joint(Index, Index) { return 0; }

}  // namespace

TEST_CASE("fit is the mean over the moving frames of the squared distances of 22 joints") {
  const double loss = motion_loss("fit", "{}", [](Index t, Index) { return t >= kStill ? 0.1 : 0; });
  CHECK(loss == Approx(66 * 0.01).epsilon(1e-13));
}

TEST_CASE("smooth is the mean over adjacent frames of the squared differences of the order that is asked for") {
  const auto speeding = [](Index t, Index c) { return c < 3 ? 0.1 * static_cast<double>(t * t) : 0; };
  // Steps 0.1 (between frames that stand), 0.3, 0.5, 0.7; their changes 0.2; the changes of these 0.
  CHECK(motion_loss("smooth", "{}", speeding) == Approx(3 * (0.09 + 0.25 + 0.49) / 3).epsilon(1e-13));
  CHECK(motion_loss("smooth", R"({"order": 2})", speeding) == Approx(3 * 0.04).epsilon(1e-13));
  CHECK(std::fabs(motion_loss("smooth", R"({"order": 3})", speeding)) < 1e-28);
}

TEST_CASE("contact pairs hands with the nearest Gaussian of an object, by plain search") {
  const MotionOfTest& test = motion_of_test();
  for (const double distance : {0.02, 0.03, 10.0}) {
    double expected = 0;
    for (Index t = kStill; t < kFrames; ++t) {
      double sum = 0;
      Index pairs = 0;
      for (Index row = 0; row < kBodyRows; ++row) {
        if (!is_hand_joint(row % kSmplxJoints)) continue;
        const Vector3<double> hand = test.start.place(BodyPoint{t, row});
        double least = distance;
        for (Index o = 0; o < 2; ++o) {
          for (Index g = 0; g < kObjectRows; ++g)
            least = std::min(least, (test.start.place(ObjectPoint{t, o, g}) - hand).norm());
        }
        if (!(least < distance)) continue;
        sum += least * least;
        ++pairs;
      }
      if (pairs > 0) expected += sum / static_cast<double>(pairs) / static_cast<double>(kFrames - kStill);
    }
    CHECK(expected > 0);
    const double loss = motion_loss("contact", R"({"distance": )" + std::to_string(distance) + "}", no_joint,
                                    [&](const BodyPoint& p) { return test.start.place(p); });
    CHECK(loss == Approx(expected).epsilon(1e-12));
  }
}

TEST_CASE("of Gaussians at the same distance contact takes the same ones each time, the first object's (row D6)") {
  // Every Gaussian of an object twice, and a second object that is in the same place, and has the same.
  MotionOfTest tied;
  for (Gaussians& object : tied.objects) {
    object = motion_of_test().objects[0];
    const std::vector<float> means = object.means;
    object.means.insert(object.means.end(), means.begin(), means.end());
    object.opacity_logits.resize(2 * kObjectRows);
  }
  tied.start.objects = {&tied.objects[0], &tied.objects[1]};
  for (auto& poses : tied.start.world_from_object) poses[1] = poses[0];
  const auto chosen = [&](int threads) {
    std::vector<ObjectPoint> all;
    with_threads(threads, [&] {
      Tape<double> tape;
      LossInputs<double> inputs;
      inputs.motion = std::shared_ptr<const MotionStart>(&tied.start, [](const MotionStart*) {});
      inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
      inputs.body_points = [&](const std::vector<BodyPoint>& points) {
        return tape.parameter("hands", shape_of(std::ssize(points), 3));
      };
      inputs.object_points = [&](const std::vector<ObjectPoint>& points) {
        all = points;
        return tape.parameter("objects", shape_of(std::ssize(points), 3));
      };
      REQUIRE(term_named("contact").record(inputs).tape != nullptr);
    });
    return all;
  };
  const std::vector<ObjectPoint> first = chosen(1);
  REQUIRE(first.size() > 10);
  for (const ObjectPoint& point : first) CHECK(point.object == 0);
  for (const int threads : {1, 2, 3}) {
    const std::vector<ObjectPoint> again = chosen(threads);
    REQUIRE(again.size() == first.size());
    for (std::size_t i = 0; i < first.size(); ++i) {
      CHECK(again[i].frame == first[i].frame);
      CHECK(again[i].object == first[i].object);
      CHECK(again[i].row == first[i].row);
    }
  }
}

TEST_CASE("contact is zero where no hand is near an object") {
  CHECK(motion_loss("contact", R"({"distance": 1e-9})", no_joint) == 0);
}

TEST_CASE("ground is the squared change of the height of the lowest points of the feet") {
  const MotionOfTest& test = motion_of_test();
  const auto lifted = [&](const BodyPoint& p) -> Vector3<double> {
    return test.start.place(p) + Vector3<double>(0.5, 0, p.frame == kStill ? 0.3 : 0);
  };
  CHECK(motion_loss("ground", R"({"points": 2})", no_joint, lifted) == Approx(0.09 / 3).epsilon(1e-12));
}

TEST_CASE("foot_sliding counts feet that stood when the stage began") {
  // Joints stood at z = 0 and went 1 cm a frame, 0.1 m/s at 10 frames a second.
  const auto sliding = [](Index t, Index c) { return c == 3 * 7 + 1 || c == 3 * 9 ? 0.1 * static_cast<double>(t) : 0; };
  CHECK(motion_loss("foot_sliding", "{}", sliding) == Approx(0.01).epsilon(1e-12));  // joint 9 is no foot
  CHECK(motion_loss("foot_sliding", R"({"speed": 0.05})", sliding) == 0);
}

TEST_CASE("mask compares the silhouettes of the human and of each object") {
  Tape<double> tape;
  LossInputs<double> inputs;
  const auto leaf = [&tape](const char* name, Index planes, double value) {
    const Var<double> var = tape.parameter(name, image_shape<double>(planes, 4, 5));
    const Array<double> array = tape.write(var);
    for (Index r = 0; r < array.total_rows(); ++r) std::fill_n(array.row(r), 5, value);
    return var;
  };
  inputs.human_opacity = leaf("human", 1, 0.9);
  inputs.human_mask = leaf("human mask", 1, 0.4);
  const auto value = [&](const char* settings) {
    const LossTerm& term = term_named("mask");
    LossSettings chosen = default_settings(term.description);
    ConfigFields fields;
    describe(fields, chosen);
    ConfigProblems problems;
    read_config(load_config_text(settings, "a.json", "", {}, problems), fields, problems);
    const auto loss = term.record(inputs, chosen.own);
    tape.forward(loss);
    return tape.value(loss).scalar();
  };
  CHECK(value("{}") == Approx(0.25).epsilon(1e-13));
  inputs.object_opacity = leaf("objects", 2, 0.5);
  inputs.object_masks = leaf("object masks", 2, 0.3);
  CHECK(value("{}") == Approx((0.25 + 2 * 0.04) / 3).epsilon(1e-13));
  CHECK(value(R"({"human": false})") == Approx(0.04).epsilon(1e-13));
  CHECK(value(R"({"objects": false})") == Approx(0.25).epsilon(1e-13));
}
