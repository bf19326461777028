#include "body/procedural_weights.h"

#include <algorithm>
#include <cmath>

#include "body/body_model.h"

namespace hsi4d::detail {

namespace {

using Vector = Vector3<double>;
using Row = std::array<double, kSmplxJoints>;

/// Rounds of averaging along the surface.
constexpr int kAveraging = 5;

/// Joint numbers of the left half, and where they are.
struct Joints {
  int pelvis = 0, hip = 1, spine1 = 3, knee = 4, spine2 = 6, ankle = 7, spine3 = 9, foot = 10, neck = 12, collar = 13,
      head = 15, shoulder = 16, elbow = 18, wrist = 20, jaw = 22;
  std::vector<double> places = procedural_joints();

  Vector operator[](int joint) const { return Vector(places.data() + 3 * joint); }
};

/// How far a point lies beyond a plane through a joint, metres.
double beyond(const Joints& joints, int joint, const Vector& p, const Vector& normal) {
  return dot(Vector(p - joints[joint]), normal);
}

void add_hand(const Joints& joints, const Vector& p, double share, Row& row) {
  const Finger* nearest = &left_fingers().front();
  double distance = 1;
  for (const Finger& finger : left_fingers()) {
    const double d = finger_field(finger, p);
    if (d < distance) distance = d, nearest = &finger;
  }
  const bool thumb = nearest == &left_fingers().back();
  const auto& at = nearest->points;
  const Vector axis = direction_of(Vector(at[3] - at[0])).unit;
  double beyond_first = smoothstep(thumb ? -0.012 : -0.010, thumb ? 0.018 : 0.008, dot(Vector(p - at[0]), axis));
  beyond_first *= 1 - smoothstep(0.004, 0.012, distance);
  const double beyond_second = smoothstep(-0.007, 0.007, dot(Vector(p - at[1]), axis));
  const double beyond_third = smoothstep(-0.006, 0.006, dot(Vector(p - at[2]), axis));
  const auto joint = static_cast<std::size_t>(nearest->first_joint);
  row[static_cast<std::size_t>(joints.wrist)] += share * (1 - beyond_first);
  row[joint] += share * beyond_first * (1 - beyond_second);
  row[joint + 1] += share * beyond_first * beyond_second * (1 - beyond_third);
  row[joint + 2] += share * beyond_first * beyond_second * beyond_third;
}

void add_arm(const Joints& joints, const Vector& p, double share, Row& row) {
  const double elbow = smoothstep(-0.040, 0.040, beyond(joints, joints.elbow, p, {1, 0, 0}));
  const double wrist = smoothstep(-0.025, 0.020, beyond(joints, joints.wrist, p, {1, 0, 0}));
  row[static_cast<std::size_t>(joints.shoulder)] += share * (1 - elbow);
  row[static_cast<std::size_t>(joints.elbow)] += share * elbow * (1 - wrist);
  if (wrist > 0) add_hand(joints, p, share * elbow * wrist, row);
}

void add_leg(const Joints& joints, const Vector& p, double share, Row& row) {
  const double knee = smoothstep(-0.050, 0.050, beyond(joints, joints.knee, p, {0, -1, 0}));
  const double ankle = smoothstep(-0.025, 0.025, beyond(joints, joints.ankle, p, {0, -0.8, 0.6}));
  const double toes = ankle * smoothstep(-0.020, 0.025, beyond(joints, joints.foot, p, {0, 0, 1}));
  row[static_cast<std::size_t>(joints.hip)] += share * (1 - knee);
  row[static_cast<std::size_t>(joints.knee)] += share * knee * (1 - ankle);
  row[static_cast<std::size_t>(joints.ankle)] += share * knee * (ankle - toes);
  row[static_cast<std::size_t>(joints.foot)] += share * knee * toes;
}

void add_head(const Joints& joints, const Vector& p, double share, Row& row) {
  const double head = smoothstep(-0.030, 0.030, beyond(joints, joints.head, p, {0, 0.8, 0.6}));
  const double jaw = smoothstep(0.020, 0.060, p[2]) * (1 - smoothstep(1.530, 1.556, p[1]));
  row[static_cast<std::size_t>(joints.neck)] += share * (1 - head);
  row[static_cast<std::size_t>(joints.head)] += share * head * (1 - jaw);
  row[static_cast<std::size_t>(joints.jaw)] += share * head * jaw;
}

void add_trunk(const Joints& joints, const Vector& p, double share, Row& row) {
  const double collar = smoothstep(0.030, 0.110, p[0]) * smoothstep(1.300, 1.400, p[1]);
  row[static_cast<std::size_t>(joints.collar)] += share * collar;
  double rest = share * (1 - collar);
  for (const int joint : {joints.spine3, joints.spine2, joints.spine1}) {
    const double above = rest * smoothstep(-0.045, 0.045, p[1] - joints[joint][1]);
    row[static_cast<std::size_t>(joint)] += above;
    rest -= above;
  }
  row[static_cast<std::size_t>(joints.pelvis)] += rest;
}

/// Weights at a point of the left half.
Row weights_at(const Joints& joints, const Vector& p) {
  Row row{};
  // The limbs begin at planes through their first joints, tilted as the folds of armpit and groin are.
  const double arm = smoothstep(-0.060, 0.060, beyond(joints, joints.shoulder, p, {0.9, 0.44, 0})) *
                     smoothstep(1.15, 1.25, p[1]) * (1 - smoothstep(1.460, 1.500, p[1]));
  const double leg = smoothstep(-0.060, 0.070, beyond(joints, joints.hip, p, {0.45, -0.89, 0})) *
                     smoothstep(0, 0.060, p[0] + std::max(0.785 - p[1], 0.0)) * (1 - smoothstep(1.0, 1.1, p[1]));
  const double beside = smoothstep(0.060, 0.100, p[0]) * (1 - smoothstep(1.470, 1.500, p[1]));
  const double neck =
      (1 - beside) * smoothstep(-0.025, 0.025, beyond(joints, joints.neck, p, {0, 0.97, 0.24})) * (1 - arm);
  if (arm > 0) add_arm(joints, p, arm, row);
  if (leg > 0) add_leg(joints, p, leg, row);
  if (neck > 0) add_head(joints, p, neck, row);
  add_trunk(joints, p, 1 - arm - leg - neck, row);
  return row;
}

/// The joint of the other side, for each joint.
std::vector<std::size_t> mirrored_joints() {
  const auto& names = smplx_joint_names();
  std::vector<std::size_t> mirror;
  for (const std::string& name : names) {
    std::string other = name;
    if (name.starts_with("left_")) other = "right_" + name.substr(5);
    if (name.starts_with("right_")) other = "left_" + name.substr(6);
    mirror.push_back(static_cast<std::size_t>(smplx_joint(other)));
  }
  return mirror;
}

void average(const VertexNeighbours& around, std::vector<Row>& rows) {
  std::vector<Row> averaged(rows.size());
  for (std::size_t v = 0; v < rows.size(); ++v) {
    const double share = 0.5 / static_cast<double>(around.begin[v + 1] - around.begin[v]);
    for (std::size_t j = 0; j < rows[v].size(); ++j) averaged[v][j] = 0.5 * rows[v][j];
    for (Index i = around.begin[v]; i < around.begin[v + 1]; ++i) {
      const Row& neighbour = rows[static_cast<std::size_t>(around.neighbours[static_cast<std::size_t>(i)])];
      for (std::size_t j = 0; j < neighbour.size(); ++j) averaged[v][j] += share * neighbour[j];
    }
  }
  rows = std::move(averaged);
}

}  // namespace

SparseWeights procedural_weights(const NetMesh& mesh) {
  constexpr std::size_t kKept = 4;
  const Joints joints;
  const std::vector<std::size_t> mirror = mirrored_joints();
  std::vector<Row> rows;
  for (const Vector& p : mesh.vertices) {
    const Row left = weights_at(joints, {std::abs(p[0]), p[1], p[2]});
    Row row = left;
    if (p[0] < 0) {
      for (std::size_t j = 0; j < row.size(); ++j) row[mirror[j]] = left[j];
    }
    rows.push_back(row);
  }
  const VertexNeighbours around = vertex_neighbours(static_cast<Index>(rows.size()), mesh.faces);
  for (int round = 0; round < kAveraging; ++round) average(around, rows);

  SparseWeights weights{static_cast<Index>(rows.size()), kSmplxJoints, kKept, {}, {}};
  for (const Row& row : rows) {
    std::array<std::int32_t, kSmplxJoints> order;
    for (std::size_t j = 0; j < order.size(); ++j) order[j] = static_cast<std::int32_t>(j);
    std::partial_sort(order.begin(), order.begin() + kKept, order.end(), [&](std::int32_t a, std::int32_t b) {
      const double wa = row[static_cast<std::size_t>(a)], wb = row[static_cast<std::size_t>(b)];
      return wa != wb ? wa > wb : a < b;
    });
    double sum = 0;
    for (std::size_t k = 0; k < kKept; ++k) sum += row[static_cast<std::size_t>(order[k])];
    for (std::size_t k = 0; k < kKept; ++k) {
      weights.indices.push_back(order[k]);
      weights.weights.push_back(row[static_cast<std::size_t>(order[k])] / sum);
    }
  }
  return normalized_weights(std::move(weights), "procedural body");
}

}  // namespace hsi4d::detail
