#include "body/procedural_directions.h"

#include <cmath>
#include <numbers>
#include <string>

#include <catch2/catch.hpp>

#include "body/kinematics.h"
#include "body/procedural_body.h"
#include "body/procedural_shape.h"
#include "body/smplx_body.h"
#include "core/random.h"
#include "tests/support/measures.h"

namespace procedural_directions_test {

using namespace hsi4d;

namespace {

using Numbers = std::vector<double>;
using Vector = Vector3<double>;

const SmplxModel& model() {
  static const SmplxModel made = procedural_smplx();
  return made;
}

/// One beta alone.
Numbers only(Index beta, double value) {
  Numbers betas(10, 0.0);
  betas[static_cast<std::size_t>(beta)] = value;
  return betas;
}

Index direction(const std::string& name) {
  for (std::size_t k = 0; k < detail::kProceduralShapes.size(); ++k) {
    if (name == detail::kProceduralShapes[k]) return static_cast<Index>(k);
  }
  FAIL(name);
  return 0;
}

Vector joint(const BodyModel& body, const char* name) { return Vector(body.joints.data() + 3 * smplx_joint(name)); }
Vector vertex(const BodyModel& body, Index v) {
  return Vector(body.vertices[3 * v], body.vertices[3 * v + 1], body.vertices[3 * v + 2]);
}

struct Size {
  double low = 1e9, high = -1e9;
  double length() const { return high - low; }
};
/// What vertices near a height span along an axis.
Size span_at(const BodyModel& body, double y, int axis, double half_width) {
  Size size;
  for (Index v = 0; v < body.vertex_count(); ++v) {
    const Vector p = vertex(body, v);
    if (std::abs(p[1] - y) > 0.01 || std::abs(p[0]) > half_width) continue;
    size = {std::min(size.low, p[axis]), std::max(size.high, p[axis])};
  }
  return size;
}

double height(const BodyModel& body) {
  Size size;
  for (Index v = 0; v < body.vertex_count(); ++v) {
    size = {std::min(size.low, vertex(body, v)[1]), std::max(size.high, vertex(body, v)[1])};
  }
  return size.length();
}

double top(const BodyModel& body) {
  double high = -1e9;
  for (Index v = 0; v < body.vertex_count(); ++v) high = std::max(high, vertex(body, v)[1]);
  return high;
}

double volume(const BodyModel& body) {
  double sum = 0;
  for (std::size_t f = 0; f < body.faces.size(); f += 3) {
    sum +=
        dot(vertex(body, body.faces[f]), cross(vertex(body, body.faces[f + 1]), vertex(body, body.faces[f + 2]))) / 6;
  }
  return sum;
}

/// The tip of a finger of a bent hand, the rest of the body in its rest pose.
Vector finger_tip(const std::array<double, 45>& hand, int finger, int side) {
  static const BodyModel body = procedural_body();
  BodyPose pose = rest_pose(55);
  for (int i = 0; i < 15; ++i) pose.set_rotation(25 + 15 * side + i, Vector(hand.data() + 3 * i));
  const PosedJoints posed = pose_skeleton(body, pose);
  Vector tip = detail::left_fingers()[static_cast<std::size_t>(finger)].points[3];
  tip[1] += body.joints[1] - detail::procedural_joints()[1];  // from the floor to the body's origin
  if (side == 1) tip[0] = -tip[0];
  const double* const t = posed.transforms.data() + 12 * (27 + 15 * side + 3 * finger);
  Vector at;
  for (int r = 0; r < 3; ++r) at[r] = t[4 * r] * tip[0] + t[4 * r + 1] * tip[1] + t[4 * r + 2] * tip[2] + t[4 * r + 3];
  return at;
}

}  // namespace

TEST_CASE("the procedural body without betas is its template, also as a SMPL-X model") {
  const BodyModel body = procedural_body(), same = rest_body(model(), Numbers(10, 0.0));
  CHECK(same.vertices == body.vertices);
  CHECK(same.joints == body.joints);
  CHECK(same.faces == body.faces);
  CHECK(model().betas == 10);
  CHECK(procedural_smplx(3).betas == 3);
  CHECK(rest_body(procedural_smplx(3), Numbers{0, 0, 1}).vertices == rest_body(model(), only(2, 1)).vertices);
  CHECK_THROWS_AS(procedural_smplx(11), InternalError);
}

TEST_CASE("the shapes of the procedural body are what their names say") {
  const BodyModel mean = rest_body(model());
  const auto shaped = [](const char* name, double by) { return rest_body(model(), only(direction(name), by)); };
  const double waist = joint(mean, "spine2")[1];
  CHECK(height(shaped("height", 1)) == Approx(1.04 * height(mean)).epsilon(1e-4));
  const BodyModel heavy = shaped("weight", 1);
  CHECK(height(heavy) == Approx(height(mean)).epsilon(0.005));
  CHECK(volume(heavy) / volume(mean) == Approx(1.18).margin(0.03));  // a fifth more mass
  CHECK(span_at(heavy, waist, 0, 0.25).length() > 1.06 * span_at(mean, waist, 0, 0.25).length());
  const BodyModel legs = shaped("leg length", 1);
  const double leg = joint(mean, "left_hip")[1] - joint(mean, "left_ankle")[1];
  CHECK(height(legs) - height(mean) == Approx(0.04 * leg).epsilon(0.02));
  for (const char* name : {"pelvis", "left_hip", "head", "left_wrist"}) CHECK(joint(legs, name) == joint(mean, name));
  const BodyModel arms = shaped("arm length", 1);
  CHECK(joint(arms, "left_wrist")[0] - joint(mean, "left_wrist")[0] ==
        Approx(0.04 * (joint(mean, "left_wrist")[0] - joint(mean, "left_shoulder")[0])));
  CHECK(joint(shaped("torso length", 1), "head")[1] > joint(mean, "head")[1] + 0.01);
  CHECK(joint(shaped("shoulder width", 1), "left_shoulder")[0] > joint(mean, "left_shoulder")[0] + 0.008);
  CHECK(joint(shaped("hip width", 1), "left_hip")[0] > joint(mean, "left_hip")[0] + 0.005);
  const BodyModel belly = shaped("belly", 1);
  const double navel = joint(mean, "spine1")[1] + 0.05;
  CHECK(span_at(belly, navel, 2, 0.2).length() > 1.1 * span_at(mean, navel, 2, 0.2).length());
  const double crown = top(mean) - joint(mean, "head")[1];
  CHECK(height(shaped("head size", 1)) - height(mean) == Approx(0.04 * crown).epsilon(0.02));
  const BodyModel large = shaped("size of hands and feet", 1);
  CHECK(joint(large, "left_middle3")[0] > joint(mean, "left_middle3")[0] + 0.006);
}

namespace {

/// Faces whose normal looks the other way than in the mean shape.
int turned_faces(const BodyModel& body, const BodyModel& mean) {
  int turned = 0;
  for (std::size_t f = 0; f < body.faces.size(); f += 3) {
    const auto normal = [&](const BodyModel& b) {
      const Vector a = vertex(b, b.faces[f]);
      return cross(Vector(vertex(b, b.faces[f + 1]) - a), Vector(vertex(b, b.faces[f + 2]) - a));
    };
    turned += dot(normal(body), normal(mean)) > 0 ? 0 : 1;
  }
  return turned;
}

/// The betas as far out in their direction as procedural_shape_fault and the range allow.
Numbers farthest(Numbers betas) {
  double low = 0, high = 0;
  for (const double beta : betas) high = std::max(high, std::abs(beta));
  high = 10 / high;
  const auto scaled = [&](double by) {
    Numbers result = betas;
    for (double& beta : result) beta *= by;
    return result;
  };
  if (procedural_shape_fault(scaled(high)).empty()) return scaled(high);
  for (int i = 0; i < 40; ++i) {
    const double middle = (low + high) / 2;
    (procedural_shape_fault(scaled(middle)).empty() ? low : high) = middle;
  }
  return scaled(low);
}

}  // namespace

TEST_CASE("shapes that would fold the procedural body's surface over are faults, those that are left turn few faces") {
  CHECK(procedural_shape_fault({}).empty());
  CHECK(procedural_shape_fault(Numbers(10, 1.0)).empty());
  CHECK(procedural_shape_fault(only(direction("belly"), -3)).empty());
  CHECK(procedural_shape_fault(only(direction("belly"), -10)) ==
        "makes spine1 0.4 times as wide as the mean body's; allowed: 0.5 to 2");
  CHECK(procedural_shape_fault(Numbers(10, 10.0)) ==
        "makes pelvis 3.3 times as wide as the mean body's; allowed: 0.5 to 2");
  CHECK_THROWS_AS(procedural_shape_fault(Numbers(11)), InternalError);
  const BodyModel mean = rest_body(model());
  CHECK(turned_faces(rest_body(model(), only(direction("belly"), -10)), mean) > 300);
  std::vector<Numbers> directions;
  for (Index k = 0; k < 10; ++k) {
    for (const double by : {-1.0, 1.0}) directions.push_back(only(k, by));
  }
  const Random random(3, random_stream("test.shapes"));
  for (std::uint64_t i = 0; i < 30; ++i) {
    Numbers betas(10);
    for (std::uint64_t k = 0; k < 10; ++k) betas[k] = 2 * random.uniform(10 * i + k) - 1;
    directions.push_back(betas);
  }
  for (const Numbers& direction_of_betas : directions) {
    const Numbers betas = farthest(direction_of_betas);
    const BodyModel body = rest_body(model(), betas);
    CHECK(turned_faces(body, mean) <= 187);  // of 37,420; at the seams of bones that differ most
    CHECK(volume(body) > 0.01);
  }
}

TEST_CASE("no shape turns the procedural body's surface over, or parts its halves") {
  const BodyModel mean = rest_body(model());
  for (Index k = 0; k < 10; ++k) {
    for (const double by : {-3.0, 3.0}) {
      INFO(detail::kProceduralShapes[static_cast<std::size_t>(k)] << " " << by);
      const BodyModel body = rest_body(model(), only(k, by));
      double left = 0, right = 0;
      CHECK(turned_faces(body, mean) == 0);
      for (Index v = 0; v < body.vertex_count(); ++v) {
        left = std::max(left, vertex(body, v)[0]);
        right = std::max(right, -vertex(body, v)[0]);
      }
      CHECK(left == Approx(right).margin(1e-4));
      CHECK(joint(body, "left_knee")[0] == -joint(body, "right_knee")[0]);
      CHECK(volume(body) > 0.03);
    }
  }
}

TEST_CASE("joints follow a shape with the surface about them") {
  // The winding number about each joint stays 1.
  for (const double by : {-2.0, 2.0}) {
    Numbers betas(10, 0.0);
    for (std::size_t k = 0; k < 10; ++k) betas[k] = k % 2 == 0 ? by : -by;
    const BodyModel body = rest_body(model(), betas);
    for (int j = 0; j < 55; ++j) {
      const Vector p(body.joints.data() + 3 * j);
      double angle = 0;
      for (std::size_t f = 0; f < body.faces.size(); f += 3) {
        const Vector a = vertex(body, body.faces[f]) - p, b = vertex(body, body.faces[f + 1]) - p,
                     c = vertex(body, body.faces[f + 2]) - p;
        const double la = a.norm(), lb = b.norm(), lc = c.norm();
        angle += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
      }
      INFO("joint " << body.joint_names[static_cast<std::size_t>(j)]);
      CHECK(angle / (4 * std::numbers::pi) == Approx(1).margin(1e-6));
    }
  }
}

TEST_CASE("a closed hand is a fist, and the right hand mirrors the left") {
  const Vector wrist = joint(procedural_body(), "left_wrist");
  const auto rest = detail::hand_pose_of({}, 0), closed = detail::hand_pose_of(detail::kClosedHand, 0);
  for (int finger = 0; finger < 4; ++finger) {
    INFO(finger);
    const double reach = (finger_tip(rest, finger, 0) - wrist).norm();
    const Vector tip = finger_tip(closed, finger, 0);
    const auto& base = detail::left_fingers()[static_cast<std::size_t>(finger)].points[0];
    CHECK((tip - wrist).norm() < 0.7 * reach);
    CHECK(tip[0] < base[0] + 0.01);   // back over the palm,
    CHECK(tip[1] < wrist[1] - 0.01);  // and below it
    CHECK(tip[1] > wrist[1] - 0.05);
  }
  // The thumb's tip lies on the middle finger: their axes are two radii apart, there or thereabouts.
  const Vector thumb = finger_tip(closed, 4, 0), middle = finger_tip(closed, 1, 0);
  CHECK((thumb - middle).norm() < 0.05);
  CHECK(thumb[1] < middle[1]);
  const auto right = detail::hand_pose_of(detail::kClosedHand, 1);
  for (int finger = 0; finger < 5; ++finger) {
    const Vector l = finger_tip(closed, finger, 0), r = finger_tip(right, finger, 1);
    CHECK((l - Vector(-r[0], r[1], r[2])).norm() < 1e-9);
  }
}

TEST_CASE("hands of the procedural model: relaxed at 0, a fist at 1") {
  for (int side = 0; side < 2; ++side) {
    const SmplxHand& hand = model().hands[static_cast<std::size_t>(side)];
    REQUIRE(hand.component_count() == 3);
    const auto relaxed = detail::hand_pose_of(detail::kRelaxedHand, side);
    const auto closed = detail::hand_pose_of(detail::kClosedHand, side);
    for (std::size_t i = 0; i < 45; ++i) {
      CHECK(hand.mean[i] == relaxed[i]);
      CHECK(hand.mean[i] + hand.components[i] == Approx(closed[i]).margin(1e-15));
    }
  }
}

TEST_CASE("the procedural model goes through the taped body as its shaped rest does through the plain one") {
  Numbers betas = {1, -0.5, 0.3, 0, 0.8, -1, 0.2, 0.5, -0.4, 1};
  const BodyModel body = rest_body(model(), betas);
  const SmplxBody<double> prepared(model(), {});
  Tape<double> tape;
  SmplxParameters<double> p;
  p.betas = tape.parameter("betas", shape_of(1, 10));
  p.body_pose = tape.parameter("body_pose", shape_of(21, 3));
  p.left_hand_pose = tape.parameter("hand", shape_of(1, 3));
  const PosedSmplx<double> posed = pose_smplx(tape, prepared, p);
  tape.set(p.betas, betas);
  Numbers turns(63);
  for (std::size_t i = 0; i < turns.size(); ++i) turns[i] = 0.3 * std::sin(static_cast<double>(3 * i));
  tape.set(p.body_pose, turns);
  tape.set(p.left_hand_pose, Numbers{1, 0, 0});
  tape.forward(posed.vertices);
  BodyPose pose = rest_pose(55);
  for (int j = 0; j < 21; ++j) pose.set_rotation(1 + j, Vector(turns.data() + 3 * j));
  const auto closed = detail::hand_pose_of(detail::kClosedHand, 0),
             relaxed = detail::hand_pose_of(detail::kRelaxedHand, 1);
  for (int i = 0; i < 15; ++i) {
    pose.set_rotation(25 + i, Vector(closed.data() + 3 * i));
    pose.set_rotation(40 + i, Vector(relaxed.data() + 3 * i));
  }
  const Numbers wanted = pose_vertices(body, pose);
  const auto found = tape.value(posed.vertices);
  double worst = 0;
  for (Index v = 0; v < body.vertex_count(); ++v) {
    for (Index i = 0; i < 3; ++i) {
      worst = test::larger(worst, std::abs(found(v, i) - wanted[static_cast<std::size_t>(3 * v + i)]));
    }
  }
  CHECK(worst < 1e-6);  // rest_body has floats
}

}  // namespace procedural_directions_test
