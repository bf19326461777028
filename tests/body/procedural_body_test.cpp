#include "body/procedural_body.h"

#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <set>

#include <catch2/catch.hpp>

#include "body/kinematics.h"

namespace procedural_body_test {

using namespace hsi4d;

namespace {

using Numbers = std::vector<double>;

const BodyModel& body() {
  static const BodyModel made = procedural_body();
  return made;
}

Vector3<double> vertex(const Numbers& vertices, Index v) { return Vector3<double>(vertices.data() + 3 * v); }

Numbers rest_vertices() { return {body().vertices.begin(), body().vertices.end()}; }

Vector3<double> joint(const char* name) { return Vector3<double>(body().joints.data() + 3 * smplx_joint(name)); }

/// Weight of a joint at a vertex.
double weight(Index v, int j) {
  double sum = 0;
  for (Index k = 4 * v; k < 4 * v + 4; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (body().weights.indices[i] == j) sum += body().weights.weights[i];
  }
  return sum;
}

/// The joint with the largest weight.
int dominant(Index v) {
  int best = 0;
  for (int j = 1; j < 55; ++j) {
    if (weight(v, j) > weight(v, best)) best = j;
  }
  return best;
}

bool is_descendant(int j, int ancestor) {
  for (; j >= 0; j = body().parents[static_cast<std::size_t>(j)]) {
    if (j == ancestor) return true;
  }
  return false;
}

/// Poses given joints about an axis, in degrees.
BodyPose pose_of(const std::map<std::string, Vector3<double>>& degrees) {
  BodyPose pose = rest_pose(55);
  for (const auto& [name, w] : degrees) pose.set_rotation(smplx_joint(name), w * (std::numbers::pi / 180));
  return pose;
}

}  // namespace

TEST_CASE("the layout of joints is that of SMPL-X") {
  const auto& names = smplx_joint_names();
  REQUIRE(names.size() == 55);
  CHECK(std::set<std::string>(names.begin(), names.end()).size() == 55);
  CHECK(names[0] == "pelvis");
  CHECK(names[15] == "head");
  CHECK(names[21] == "right_wrist");
  CHECK(names[22] == "jaw");
  CHECK(names[25] == "left_index1");
  CHECK(names[31] == "left_pinky1");
  CHECK(names[34] == "left_ring1");
  CHECK(names[39] == "left_thumb3");
  CHECK(names[40] == "right_index1");
  CHECK(names[54] == "right_thumb3");
  const std::vector<int> parents = {-1, 0,  0,  0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  9,  9,  12, 13, 14, 16,
                                    17, 18, 19, 15, 15, 15, 20, 25, 26, 20, 28, 29, 20, 31, 32, 20, 34, 35, 20,
                                    37, 38, 21, 40, 41, 21, 43, 44, 21, 46, 47, 21, 49, 50, 21, 52, 53};
  CHECK(smplx_parents() == parents);
  CHECK_THROWS_AS(smplx_joint("tail"), InternalError);
}

TEST_CASE("the procedural body's surface is closed, in one piece and of a person's size") {
  const BodyModel& b = body();
  const Numbers v = rest_vertices();
  REQUIRE(b.face_count() > 10000);
  // Each directed edge once, and its opposite too: closed, and one orientation throughout.
  std::set<std::pair<int, int>> edges;
  double volume = 0;
  for (std::size_t f = 0; f < b.faces.size(); f += 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      REQUIRE(b.faces[f + i] >= 0);
      REQUIRE(b.faces[f + i] < b.vertex_count());
      REQUIRE(edges.emplace(b.faces[f + i], b.faces[f + (i + 1) % 3]).second);
    }
    volume += dot(vertex(v, b.faces[f]), cross(vertex(v, b.faces[f + 1]), vertex(v, b.faces[f + 2]))) / 6;
  }
  for (const auto& [from, to] : edges) REQUIRE(edges.contains({to, from}));
  CHECK(b.vertex_count() - static_cast<Index>(edges.size()) / 2 + b.face_count() == 2);  // Euler: a sphere
  CHECK(volume > 0.05);
  CHECK(volume < 0.10);
  double low = 1e9, high = -1e9, reach = 0;
  for (std::size_t i = 0; i < v.size(); i += 3) {
    low = std::min(low, v[i + 1]), high = std::max(high, v[i + 1]), reach = std::max(reach, v[i]);
  }
  CHECK(high - low == Approx(1.72).margin(0.02));
  CHECK(2 * reach == Approx(1.78).margin(0.08));  // the span of the arms is about the height
}

TEST_CASE("the procedural body's links of edges are single loops") {
  const BodyModel& b = body();
  // About every vertex the faces form one fan: as many faces as can be walked in a circle.
  std::vector<std::map<int, int>> next(static_cast<std::size_t>(b.vertex_count()));
  for (std::size_t f = 0; f < b.faces.size(); f += 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      next[static_cast<std::size_t>(b.faces[f + i])][b.faces[f + (i + 1) % 3]] = b.faces[f + (i + 2) % 3];
    }
  }
  for (const auto& fan : next) {
    REQUIRE(fan.size() >= 3);
    std::size_t steps = 0;
    int at = fan.begin()->first;
    do {
      at = fan.at(at);
      ++steps;
    } while (at != fan.begin()->first && steps <= fan.size());
    REQUIRE(steps == fan.size());
  }
}

TEST_CASE("the procedural body is left-right symmetric") {
  const BodyModel& b = body();
  for (int j = 0; j < 55; ++j) {
    const std::string& name = b.joint_names[static_cast<std::size_t>(j)];
    const Vector3<double> here = joint(name.c_str());
    if (name.starts_with("left_")) {
      const Vector3<double> there = joint(("right_" + name.substr(5)).c_str());
      CHECK(here == Vector3<double>(-there[0], there[1], there[2]));
      CHECK(here[0] > 0);
    } else if (!name.starts_with("right_")) {
      CHECK(here[0] == 0);
    }
  }
  double left = 0, right = 0;
  for (std::size_t i = 0; i < b.vertices.size(); i += 3) {
    left = std::max(left, static_cast<double>(b.vertices[i]));
    right = std::min(right, static_cast<double>(b.vertices[i]));
  }
  CHECK(left == Approx(-right).margin(1e-4));
}

TEST_CASE("the joints of the procedural body lie inside it, at plausible places") {
  // Lengths of limbs as shares of the height, within a tenth of it of tables of body segments.
  const auto length = [](const char* a, const char* b) { return (joint(a) - joint(b)).norm(); };
  CHECK(length("left_hip", "left_knee") == Approx(0.245 * 1.72).epsilon(0.1));
  CHECK(length("left_knee", "left_ankle") == Approx(0.246 * 1.72).epsilon(0.1));
  CHECK(length("left_shoulder", "left_elbow") == Approx(0.172 * 1.72).epsilon(0.1));
  CHECK(length("left_elbow", "left_wrist") == Approx(0.146 * 1.72).epsilon(0.1));
  CHECK(joint("pelvis")[1] == Approx(-0.35).margin(1e-12));
  // The winding number about each joint is 1: the solid angles of all faces sum to 4π.
  const Numbers v = rest_vertices();
  for (int j = 0; j < 55; ++j) {
    const Vector3<double> p(body().joints.data() + 3 * j);
    double angle = 0;
    for (std::size_t f = 0; f < body().faces.size(); f += 3) {
      const Vector3<double> a = vertex(v, body().faces[f]) - p, b = vertex(v, body().faces[f + 1]) - p,
                            c = vertex(v, body().faces[f + 2]) - p;
      const double la = a.norm(), lb = b.norm(), lc = c.norm();
      angle += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
    }
    INFO("joint " << body().joint_names[static_cast<std::size_t>(j)]);
    CHECK(angle / (4 * std::numbers::pi) == Approx(1).margin(1e-6));
  }
}

TEST_CASE("the procedural body's weights sum to 1 and every joint but the eyes moves something") {
  const SparseWeights& w = body().weights;
  REQUIRE(w.per_vertex == 4);
  REQUIRE(w.vertices == body().vertex_count());
  std::vector<double> of_joint(55, 0.0);
  for (Index v = 0; v < w.vertices; ++v) {
    double sum = 0;
    for (std::size_t k = static_cast<std::size_t>(4 * v); k < static_cast<std::size_t>(4 * v + 4); ++k) {
      sum += w.weights[k];
      of_joint[static_cast<std::size_t>(w.indices[k])] += w.weights[k];
    }
    REQUIRE(std::fabs(sum - 1) < 1e-12);
  }
  for (std::size_t j = 0; j < 55; ++j) {
    INFO(body().joint_names[j]);
    CHECK((of_joint[j] > 5) == (j != 23 && j != 24));
  }
}

TEST_CASE("weights do not leak between fingers, legs, or arm and trunk") {
  const Numbers rest = rest_vertices();
  for (Index v = 0; v < body().vertex_count(); ++v) {
    const Vector3<double> p = vertex(rest, v);
    const int most = dominant(v);
    for (const char* side : {"left_", "right_"}) {
      const double sign = side[0] == 'l' ? 1 : -1;
      // Nothing on one side belongs to the limbs of the other, but for the crease between the legs.
      if (sign * p[0] < -0.03) {
        for (const char* limb : {"hip", "knee", "shoulder", "collar", "wrist"}) {
          REQUIRE(weight(v, smplx_joint(std::string(side) + limb)) < 0.02);
        }
      }
      for (const char* finger : {"index", "middle", "ring", "pinky", "thumb"}) {
        const int first = smplx_joint(std::string(side) + finger + "1");
        if (most <= first || most > first + 2) continue;  // beyond the finger's first joint
        double own = weight(v, first) + weight(v, first + 1) + weight(v, first + 2);
        REQUIRE(own > 0.97);
      }
      // The flank below the armpit stays with the trunk.
      if (std::fabs(p[0]) < 0.16 && p[1] < joint("spine3")[1]) {
        REQUIRE(weight(v, smplx_joint(std::string(side) + "shoulder")) < 0.01);
      }
    }
  }
}

TEST_CASE("the rest pose of the procedural body is its template") {
  const Numbers rest = rest_vertices();
  const Numbers posed = pose_vertices(body(), rest_pose(55));
  for (std::size_t i = 0; i < rest.size(); ++i) REQUIRE(std::fabs(posed[i] - rest[i]) < 1e-6);
}

TEST_CASE("bending the elbow moves the hand and not the trunk") {
  const Numbers rest = rest_vertices();
  const Numbers posed = pose_vertices(body(), pose_of({{"left_elbow", {0, -90, 0}}}));
  double hand = 1e9, others = 0;
  for (Index v = 0; v < body().vertex_count(); ++v) {
    const double moved = (vertex(posed, v) - vertex(rest, v)).norm();
    if (is_descendant(dominant(v), smplx_joint("left_wrist"))) hand = std::min(hand, moved);
    if (vertex(rest, v)[0] < joint("left_elbow")[0] - 0.12) others = std::max(others, moved);
  }
  CHECK(hand > 0.3);
  CHECK(others < 1e-12);
  // A turn about −y takes the arm from +x to +z, forward.
  const Numbers joints = pose_joints(body(), pose_of({{"left_elbow", {0, -90, 0}}}));
  const Vector3<double> wrist(joints.data() + 3 * smplx_joint("left_wrist"));
  CHECK(wrist[2] > joint("left_elbow")[2] + 0.2);
}

TEST_CASE("no triangle is torn in wide poses of the procedural body") {
  const Numbers rest = rest_vertices();
  const BodyPose pose = pose_of({{"left_shoulder", {0, 0, -70}},
                                 {"right_shoulder", {0, 0, 70}},
                                 {"right_elbow", {0, 90, 0}},
                                 {"left_hip", {-90, 0, 0}},
                                 {"left_knee", {90, 0, 0}},
                                 {"head", {0, 40, 0}}});
  const Numbers posed = pose_vertices(body(), pose);
  double longest = 0;
  Vector3<double> where = Vector3<double>::Zero();
  for (std::size_t f = 0; f < body().faces.size(); f += 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Index a = body().faces[f + i], b = body().faces[f + (i + 1) % 3];
      const double before = (vertex(rest, a) - vertex(rest, b)).norm();
      const double stretch = (vertex(posed, a) - vertex(posed, b)).norm() - before;
      if (stretch > longest) longest = stretch, where = vertex(rest, a);
    }
  }
  INFO("an edge at " << where.transpose() << " grows by " << longest << " m");
  CHECK(longest < 0.05);  // the most is in the groin, where legs part
}

TEST_CASE("the procedural body has the same bits every time") {
  const BodyModel again = procedural_body();
  CHECK(again.vertices == body().vertices);
  CHECK(again.faces == body().faces);
  CHECK(again.joints == body().joints);
  CHECK(again.weights.indices == body().weights.indices);
  CHECK(again.weights.weights == body().weights.weights);
}

}  // namespace procedural_body_test
