// The loss terms that look at the motion over several frames.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <set>

#include "core/parallel.h"
#include "core/rotation.h"
#include "core/text.h"
#include "tests/support/loss_terms.h"
#include "tests/support/operator_check.h"
#include "tests/support/test_motion.h"

namespace motion_losses_test {

using namespace hsi4d;
using namespace hsi4d::test;

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
  const auto loss = record_term(name, inputs, settings);
  REQUIRE(loss.tape != nullptr);
  tape.forward(loss);
  return tape.value(loss).scalar();
}

double no_joint(Index, Index) { return 0; }

/// Points of objects, a leaf each time, where they were when the stage began.
std::function<Var<double>(const std::vector<ObjectPoint>&)> points_at_start(Tape<double>& tape,
                                                                            const MotionStart& start) {
  return [&tape, &start](const std::vector<ObjectPoint>& points) {
    const Var<double> var = tape.parameter("object", shape_of(std::ssize(points), 3));
    for (Index i = 0; i < std::ssize(points); ++i)
      std::copy_n(start.place(points[static_cast<std::size_t>(i)]).data(), 3, tape.write(var).row(i));
    return var;
  };
}

}  // namespace

TEST_CASE("fit is the mean over the moving frames of the squared distances of 22 joints") {
  const auto moved = [](Index t, Index) { return t >= kStill ? 0.1 : 0; };
  CHECK(motion_loss("fit", "{}", moved) == Approx(66 * 0.01).epsilon(1e-13));
  CHECK(motion_loss("fit", R"({"joints": "mean"})", moved) == Approx(0.01).epsilon(1e-13));
}

TEST_CASE("smooth is the mean over adjacent frames of the squared differences of the order that is asked for") {
  const auto speeding = [](Index t, Index c) { return c < 3 ? 0.1 * static_cast<double>(t * t) : 0; };
  // Steps 0.1 (between frames that stand), 0.3, 0.5, 0.7; their changes 0.2; the changes of these 0.
  CHECK(motion_loss("smooth", "{}", speeding) == Approx(3 * (0.09 + 0.25 + 0.49) / 3).epsilon(1e-13));
  CHECK(motion_loss("smooth", R"({"frames": "sum"})", speeding) == Approx(3 * (0.09 + 0.25 + 0.49)).epsilon(1e-13));
  CHECK(motion_loss("smooth", R"({"order": 2})", speeding) == Approx(3 * 0.04).epsilon(1e-13));
  CHECK(std::fabs(motion_loss("smooth", R"({"order": 3})", speeding)) < 1e-28);
}

TEST_CASE("object_smooth is the mean square of the differences of what lies furthest on the objects") {
  // Objects stand, but for steps of 1 cm a frame of the first: places that are off by x in frame t, of all points.
  const auto loss_of = [](const std::string& settings, const std::function<double(Index frame)>& x) {
    Tape<double> tape;
    LossInputs<double> inputs;
    inputs.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
    std::set<std::pair<Index, Index>> chosen;
    inputs.object_points = [&](const std::vector<ObjectPoint>& points) {
      const Var<double> var = tape.parameter("object", shape_of(std::ssize(points), 3));
      for (Index i = 0; i < std::ssize(points); ++i) {
        const ObjectPoint& p = points[static_cast<std::size_t>(i)];
        chosen.insert({p.object, p.row});
        const Vector3<double> place = motion_of_test().start.place(p) + Vector3<double>(0, x(p.frame), 0);
        std::copy_n(place.data(), 3, tape.write(var).row(i));
      }
      return var;
    };
    const Var<double> loss = record_term("object_smooth", inputs, settings);
    REQUIRE(loss.tape != nullptr);
    tape.forward(loss);
    for (const auto& [object, row] : chosen) {  // each is the first or last along some axis
      const std::vector<float>& means = motion_of_test().objects[static_cast<std::size_t>(object)].means;
      bool is_outermost = false;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        int below = 0, above = 0;
        for (std::size_t n = axis; n < means.size(); n += 3) {
          below += means[n] < means[3 * static_cast<std::size_t>(row) + axis] ? 1 : 0;
          above += means[n] > means[3 * static_cast<std::size_t>(row) + axis] ? 1 : 0;
        }
        is_outermost |= below == 0 || above == 0;
      }
      CHECK(is_outermost);
    }
    return tape.value(loss).scalar();
  };
  const auto none = [](Index) { return 0.0; };
  const auto kick = [](Index t) { return t == 3 ? 0.1 : 0; };
  // By default changes of steps, of frames 0 to 4: none of the even motion, 0, 0.1, −0.2 of a kick in frame 3.
  CHECK(loss_of("{}", none) < 1e-15);
  CHECK(loss_of("{}", kick) == Approx((0.01 + 0.04) / 3).epsilon(1e-6));
  // Steps between frames 1 and 4: 1 cm of the first object of two, and 0.1 twice.
  CHECK(loss_of(R"({"order": 1})", none) == Approx(1e-4 / 2).epsilon(1e-6));
  CHECK(loss_of(R"({"order": 1})", kick) == Approx(1e-4 / 2 + 2 * 0.01 / 3).epsilon(1e-6));
  // Of what is free, 12 m/s² at 10 frames a second is 0.12 a frame and frame.
  CHECK(loss_of(R"({"free": 12})", kick) == Approx((0.04 - 0.0144) / 3).epsilon(1e-6));
  // Changes of changes of steps, of frames 0 to 4: of a kick 0.1 and −0.3.
  CHECK(loss_of(R"({"order": 3})", kick) == Approx((0.01 + 0.09) / 2).epsilon(1e-6));
}

TEST_CASE("object_smooth sees the objects in frames that follow") {
  // The object goes 1 cm a frame and stops: the step from the last frame that moves is 0, then it is 3 cm.
  MotionOfTest test;
  const auto loss_of = [&](int after, const std::string& settings) {
    test.start.world_from_object.resize(kFrames);
    for (int k = 0; k < after; ++k) {
      test.start.world_from_object.push_back(test.start.world_from_object[kFrames - 1]);
      test.start.world_from_object.back()[0].translation[0] += k == 0 ? 0 : 0.03;
    }
    Tape<double> tape;
    LossInputs<double> inputs;
    inputs.motion = std::shared_ptr<const MotionStart>(&test.start, [](const MotionStart*) {});
    inputs.object_points = points_at_start(tape, test.start);
    const Var<double> loss = record_term("object_smooth", inputs, settings);
    tape.forward(loss);
    return tape.value(loss).scalar();
  };
  // Of two objects one moves. Changes of steps: none; with frames that follow −1 cm, then 3 cm, of 4 and of 5.
  CHECK(loss_of(0, "{}") < 1e-15);
  CHECK(loss_of(1, "{}") == Approx(1e-4 / 2 / 4).epsilon(1e-6));
  CHECK(loss_of(2, "{}") == Approx((1e-4 + 9e-4) / 2 / 5).epsilon(1e-6));
  CHECK(loss_of(3, "{}") == Approx((1e-4 + 9e-4) / 2 / 5).epsilon(1e-6));  // no further than differences reach
  CHECK(loss_of(2, R"({"order": 1})") == Approx(3e-4 / 2 / 4).epsilon(1e-6));
}

TEST_CASE("contact pairs hands with the nearest Gaussian of an object, by plain search") {
  const MotionOfTest& test = motion_of_test();
  const bool of_vertices = GENERATE(false, true);
  const BodySet of = of_vertices ? BodySet::kVertices : BodySet::kGaussians;
  for (const double distance : {0.02, 0.03, 10.0}) {
    double expected = 0;
    for (Index t = kStill; t < kFrames; ++t) {
      double sum = 0;
      Index pairs = 0;
      for (Index row = 0; row < (of_vertices ? kVertexRows : kBodyRows); ++row) {
        if (!is_hand_joint(row % kSmplxJoints)) continue;
        const Vector3<double> hand = test.start.place(BodyPoint{t, row, of});
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
    const std::string settings = std::string(R"({"points": ")") + (of_vertices ? "vertices" : "gaussians") +
                                 R"(", "distance": )" + std::to_string(distance) + "}";
    const double loss =
        motion_loss("contact", settings, no_joint, [&](const BodyPoint& p) { return test.start.place(p); });
    CHECK(loss == Approx(expected).epsilon(1e-12));
  }
}

TEST_CASE("grip is how far wrists move on what they hold, as the object carries and turns them") {
  // Wrists go along a screw, and what they hold turns with it; the right one slips by 2 cm in frame 3 and stays there.
  MotionOfTest test;
  const auto screw = [](Index t) {
    const double at = static_cast<double>(t);
    return Rigid<double>{so3_exp(Vector3<double>(0.1 * at, -0.2 * at, 0.3 * at)), {0.05 * at, 0.02 * at, 0}};
  };
  std::array<Vector3<double>, 2> held = {Vector3<double>(0.02, 0.01, 0), Vector3<double>(-0.01, 0, 0.02)};
  const auto wrist_at = [&](Index t, std::size_t hand, bool slips) -> Vector3<double> {
    const Vector3<double> slip(0, slips && hand == 1 && t >= 3 ? 0.02 : 0, 0);
    return transform_point(screw(t), Vector3<double>(held[hand] + slip));
  };
  for (Index t = 0; t < kFrames; ++t) {
    const auto frame = static_cast<std::size_t>(t);
    test.start.world_from_object[frame][0] = screw(t);
    PosedJoints& body = test.start.body[frame];
    std::fill(body.joints.begin(), body.joints.end(), 9);  // nothing else is near
    for (std::size_t hand = 0; hand < 2; ++hand)
      std::copy_n(wrist_at(t, hand, false).data(), 3, body.joints.begin() + 3 * kWristJoints[hand]);
  }
  const auto loss_of = [&](const std::string& settings, bool slips) {
    Tape<double> tape;
    LossInputs<double> inputs;
    inputs.motion = std::shared_ptr<const MotionStart>(&test.start, [](const MotionStart*) {});
    inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
    for (Index t = 0; t < kFrames; ++t) {
      for (std::size_t hand = 0; hand < 2; ++hand)
        std::copy_n(wrist_at(t, hand, slips).data(), 3, tape.write(inputs.joints).row(t) + 3 * kWristJoints[hand]);
    }
    inputs.object_points = points_at_start(tape, test.start);
    const Var<double> loss = record_term("grip", inputs, settings);
    tape.forward(loss);
    return tape.value(loss).scalar();
  };
  CHECK(loss_of("{}", false) < 1e-15);
  constexpr double kSlip2 = 4e-4, kScale2 = 9e-4;
  CHECK(loss_of("{}", true) == Approx(kScale2 * kSlip2 / (kScale2 + kSlip2) / 3).epsilon(1e-5));
  CHECK(loss_of(R"({"scale": 10})", true) == Approx(kSlip2 / 3).epsilon(1e-4));
  // The left hand holds nothing once it is off in both frames; the right one does where it is near in one of two.
  for (std::size_t t = 0; t < kFrames; ++t) {
    test.start.body[t].joints[static_cast<std::size_t>(3 * kWristJoints[0])] += 1;
    if (t >= 3) test.start.body[t].joints[static_cast<std::size_t>(3 * kWristJoints[1])] += 1;
  }
  CHECK(loss_of(R"({"scale": 10})", true) == Approx(kSlip2 / 3).epsilon(1e-4));
  CHECK(loss_of(R"({"distance": 0.001})", true) == 0);
}

TEST_CASE("annotated_contact draws parts of the body to what they are said to touch, by plain search") {
  const MotionOfTest& test = motion_of_test();
  const auto part = [&test](const AnnotatedContact& contact) {
    std::vector<BodyPoint> points;
    for (Index row = 0; row < kVertexRows; ++row) {  // of a vertex the first joint weighs most
      const Index joint = row % kSmplxJoints;
      if (std::count(contact.joints.begin(), contact.joints.end(), joint) > 0)
        points.push_back({contact.frame, row, BodySet::kVertices});
    }
    return points;
  };
  std::vector<double> of_frame(kFrames), counts(kFrames);
  for (const AnnotatedContact& contact : *test.start.contacts) {
    std::vector<Vector3<double>> touched;
    const auto frame = static_cast<std::size_t>(contact.frame);
    if (!contact.object) {
      touched = {*contact.place};
    } else if (contact.place) {
      const auto& pose = test.start.world_from_object[frame][static_cast<std::size_t>(*contact.object)];
      touched = {transform_point(pose, *contact.place)};
    } else {
      for (Index g = 0; g < kObjectRows; ++g)
        touched.push_back(test.start.place(ObjectPoint{contact.frame, *contact.object, g}));
    }
    double least = 1e9;
    for (const BodyPoint& point : part(contact)) {
      for (const Vector3<double>& place : touched) least = std::min(least, (test.start.place(point) - place).norm());
    }
    of_frame[frame] += contact.weight * least * least;
    counts[frame] += 1;
  }
  double expected = 0;
  for (std::size_t t = kStill; t < kFrames; ++t)
    expected += counts[t] == 0 ? 0 : of_frame[t] / counts[t] / static_cast<double>(kFrames - kStill);
  CHECK(expected > 1);  // the second object is 3 m away
  const double loss =
      motion_loss("annotated_contact", "{}", no_joint, [&](const BodyPoint& p) { return test.start.place(p); });
  CHECK(loss == Approx(expected).epsilon(1e-12));
}

TEST_CASE("annotated_contact looks for the nearest points anew, and is 0 where nothing is said") {
  MotionStart start = motion_of_test().start;
  start.contacts = {{.frame = kStill, .joints = {}, .vertex = 7, .place = Vector3<double>(0.1, 0.2, 0.3)}};
  const auto loss_of = [&start](const Vector3<double>& place, std::vector<LossNote>& notes) {
    Tape<double> tape;
    LossInputs<double> inputs;
    inputs.motion = std::shared_ptr<const MotionStart>(&start, [](const MotionStart*) {});
    inputs.notes = &notes;
    inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
    inputs.body_points = [&](const std::vector<BodyPoint>& points) {
      REQUIRE(points.size() == 1);
      CHECK(points[0].row == 7);
      CHECK(points[0].of == BodySet::kVertices);
      const Var<double> var = tape.parameter("body", shape_of(1, 3));
      std::copy_n(place.data(), 3, tape.write(var).row(0));
      return var;
    };
    const Var<double> loss = record_term("annotated_contact", inputs, "{}");
    REQUIRE(loss.tape != nullptr);
    tape.forward(loss);
    tape.backward(loss);
    return tape.value(loss).scalar();
  };
  std::vector<LossNote> notes;
  CHECK(loss_of({0.1, 0.2, 0.3}, notes) == 0);
  CHECK(loss_of({0.4, 0.2, 0.7}, notes) == Approx(0.25 / static_cast<double>(kFrames - kStill)));
  REQUIRE(notes.size() == 2);
  const double away = (start.place(BodyPoint{kStill, 7, BodySet::kVertices}) - Vector3<double>(0.1, 0.2, 0.3)).norm();
  CHECK(notes[0].text == "1 contact, " + rounded(1000 * away, 3) + " mm apart");
  CHECK_FALSE(notes[0].is_idle);
  start.contacts->clear();
  CHECK(loss_of({0, 0, 0}, notes) == 0);
  CHECK(notes.size() == 2);
  start.contacts.reset();  // nobody annotated any: the term is off
  LossInputs<double> inputs;
  Tape<double> tape;
  inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
  inputs.motion = std::shared_ptr<const MotionStart>(&start, [](const MotionStart*) {});
  CHECK(record_term("annotated_contact", inputs, "{}").tape == nullptr);
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

TEST_CASE("contact is zero where no hand is near an object, and tells in how many frames one is") {
  CHECK(motion_loss("contact", R"({"distance": 1e-9})", no_joint) == 0);
  const auto note = [](const MotionStart& motion, const std::string& settings) {
    std::vector<LossNote> notes;
    Tape<double> tape;
    LossInputs<double> inputs;
    inputs.motion = std::shared_ptr<const MotionStart>(&motion, [](const MotionStart*) {});
    inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
    inputs.notes = &notes;
    inputs.body_points = [&](const auto& points) { return tape.parameter("hands", shape_of(std::ssize(points), 3)); };
    inputs.object_points = [&](const auto& points) { return tape.parameter("them", shape_of(std::ssize(points), 3)); };
    REQUIRE(record_term("contact", inputs, settings).tape != nullptr);
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].term == "contact");
    return std::pair{notes[0].text, notes[0].is_idle};
  };
  MotionOfTest apart;
  for (auto& pose : apart.start.world_from_object[3]) pose.translation[2] += 5;  // one of the three that move
  CHECK(note(apart.start, "{}") ==
        std::pair<std::string, bool>{"hands are within 0.05 m of an object's Gaussian in 2 of 3 frames", false});
  CHECK(note(apart.start, R"({"distance": 1e-9})") ==
        std::pair<std::string, bool>{"no hand is within 1e-09 m of an object's Gaussian in any of 3 frames", true});
}

TEST_CASE("of an avatar that was made on another body contact draws the Gaussians in place of vertices") {
  MotionOfTest without;
  without.start.mesh = nullptr;
  for (const MotionOfTest* test : {static_cast<const MotionOfTest*>(&without), &motion_of_test()}) {
    Tape<double> tape;
    LossInputs<double> inputs;
    inputs.motion = std::shared_ptr<const MotionStart>(&test->start, [](const MotionStart*) {});
    inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
    std::vector<BodyPoint> hands;
    inputs.body_points = [&](const std::vector<BodyPoint>& points) {
      hands = points;
      return tape.parameter("hands", shape_of(std::ssize(points), 3));
    };
    inputs.object_points = [&](const auto& points) { return tape.parameter("them", shape_of(std::ssize(points), 3)); };
    REQUIRE(record_term("contact", inputs, R"({"distance": 10})").tape != nullptr);
    REQUIRE_FALSE(hands.empty());
    for (const BodyPoint& hand : hands) CHECK(hand.of == (test == &without ? BodySet::kGaussians : BodySet::kVertices));
  }
}

TEST_CASE("ground is the squared change of the height of the lowest points of the feet") {
  const MotionOfTest& test = motion_of_test();
  const auto lifted = [&](const BodyPoint& p) -> Vector3<double> {
    return test.start.place(p) + Vector3<double>(0.5, 0, p.frame == kStill ? 0.3 : 0);
  };
  CHECK(motion_loss("ground", R"({"points": 2})", no_joint, lifted) == Approx(0.09 / 3).epsilon(1e-12));
  CHECK(motion_loss("ground", R"({"points": 2, "level_within": 0.3})", no_joint, lifted) > 0);  // nothing is estimated
}

TEST_CASE("ground is off where the estimate's feet go up and down") {
  MotionOfTest test;
  for (const double range : {0.29, 0.31}) {
    test.start.foot_range = range;
    Tape<double> tape;
    LossInputs<double> inputs;
    inputs.motion = std::shared_ptr<const MotionStart>(&test.start, [](const MotionStart*) {});
    inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
    std::vector<LossNote> notes;
    inputs.notes = &notes;
    bool is_asked = false;
    inputs.body_points = [&](const std::vector<BodyPoint>& points) {
      is_asked = true;
      return tape.parameter("feet", shape_of(std::ssize(points), 3));
    };
    const Var<double> loss = record_term("ground", inputs, R"({"level_within": 0.3})");
    CHECK(is_asked == (range < 0.3));
    is_asked = false;
    record_term("ground", inputs, "{}");
    CHECK(is_asked);  // by itself it is on
    if (range < 0.3) notes.clear();
    tape.forward(loss);
    tape.backward(loss);
    if (range < 0.3) continue;
    CHECK(tape.value(loss).scalar() == 0);
    REQUIRE(notes.size() == 1);
    CHECK(notes[0].text ==
          "the lower foot goes up and down by 0.31 m in the estimated poses, and level_within is 0.3 m");
    CHECK((notes[0].is_idle && notes[0].is_of_clip));
  }
}

TEST_CASE("foot_sliding counts feet that stood when the stage began") {
  // Joints stood at z = 0 and went 1 cm a frame, 0.1 m/s at 10 frames a second.
  const auto sliding = [](Index t, Index c) { return c == 3 * 7 + 1 || c == 3 * 9 ? 0.1 * static_cast<double>(t) : 0; };
  CHECK(motion_loss("foot_sliding", "{}", sliding) == Approx(0.01).epsilon(1e-12));  // joint 9 is no foot
  CHECK(motion_loss("foot_sliding", R"({"speed": 0.05})", sliding) == 0);
}

}  // namespace motion_losses_test
