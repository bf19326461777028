// A smooth union of tubes with elliptic sections (torso, neck, limbs, palms, feet), ellipsoids (head) and round cones
// (fingers). Only + − × / and square roots are used, so that the bits are the same everywhere.
#include "body/procedural_shape.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "body/body_model.h"

namespace hsi4d::detail {

namespace {

using Vector = Vector3<double>;

// --- joints ----------------------------------------------------------------------------------------------------------

struct Place {
  const char* joint;
  double x, y, z;
};

constexpr Place kCentre[] = {
    {"pelvis", 0, 0.945, -0.005}, {"spine1", 0, 1.045, -0.015}, {"spine2", 0, 1.165, -0.020},
    {"spine3", 0, 1.245, -0.018}, {"neck", 0, 1.442, -0.022},   {"head", 0, 1.522, -0.002},
    {"jaw", 0, 1.538, 0.022},
};

constexpr Place kLeft[] = {
    {"hip", 0.088, 0.900, 0.000},    {"knee", 0.098, 0.495, 0.004},    {"ankle", 0.100, 0.085, -0.020},
    {"foot", 0.114, 0.026, 0.105},   {"collar", 0.055, 1.385, -0.014}, {"shoulder", 0.172, 1.396, -0.020},
    {"elbow", 0.445, 1.398, -0.022}, {"wrist", 0.700, 1.399, -0.018},  {"eye_smplhf", 0.032, 1.600, 0.072},
};

Finger make_finger(const char* name, Vector base, Vector direction, std::array<double, 3> lengths,
                   std::array<double, 4> radii) {
  Finger finger{smplx_joint(std::string("left_") + name + "1"), {}, radii};
  direction /= std::sqrt(dot(direction, direction));
  finger.points[0] = base;
  for (std::size_t i = 0; i < 3; ++i) finger.points[i + 1] = finger.points[i] + direction * lengths[i];
  return finger;
}

// --- fields ----------------------------------------------------------------------------------------------------------

/// Smooth minimum, lower than both by a quarter of `k` at most, where they differ by less than k.
double smooth_union(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - h * h * k * 0.25;
}

double smooth_difference(double a, double removed, double k) { return -smooth_union(-a, removed, k); }

/// About the distance to an ellipsoid or ellipse, from the scaled position q = p/r: |q| (|q| − 1) / |p/r²|.
double ellipse_distance(double squared, double squared_slope, double smallest) {
  const double size = std::sqrt(squared);
  if (size < 1e-6) return -smallest;
  return size * (size - 1) / std::sqrt(squared_slope);
}

double ellipsoid(const Vector& p, const Vector& centre, const Vector& radii) {
  double squared = 0, slope = 0;
  for (int i = 0; i < 3; ++i) {
    const double q = (p[i] - centre[i]) / radii[i];
    squared += q * q;
    slope += q * q / (radii[i] * radii[i]);
  }
  return ellipse_distance(squared, slope, radii.minCoeff());
}

double round_cone(const Vector& p, const Vector& a, const Vector& b, double radius_a, double radius_b) {
  const Vector axis = b - a, from = p - a;
  const double t = std::clamp(dot(from, axis) / dot(axis, axis), 0.0, 1.0);
  const Vector off = from - axis * t;
  return std::sqrt(dot(off, off)) - (radius_a + t * (radius_b - radius_a));
}

/// A tube's ellipse at one place along it: centre (u, v) and half-widths; across v they differ on the two sides.
struct Section {
  double along;
  double u, v;
  double half_u, half_v_plus, half_v_minus;
};

/// A cubic on [0, 1] by its coefficients.
struct Cubic {
  double cubed, squared, slope, start;

  double at(double t) const { return ((cubed * t + squared) * t + slope) * t + start; }
};

/// Through the middle two of four values at places x, with the slopes of its neighbours.
Cubic cubic(const double* x, const double* y) {
  const double h = x[2] - x[1];
  const double slope1 = (y[2] - y[0]) / (x[2] - x[0]) * h;
  const double slope2 = (y[3] - y[1]) / (x[3] - x[1]) * h;
  return {2 * (y[1] - y[2]) + slope1 + slope2, 3 * (y[2] - y[1]) - 2 * slope1 - slope2, slope1, y[1]};
}

/// A smooth tube through sections; its ends are flat.
class Tube {
 public:
  explicit Tube(std::span<const Section> sections) : end_(sections.back().along) {
    for (int i = 0; i + 1 < static_cast<int>(sections.size()); ++i) pieces_.push_back(piece(sections, i));
  }

  /// About the distance to it, at place `along` its axis and (u, v) across.
  double distance(double along, double u, double v) const {
    const double inside = std::clamp(along, pieces_.front().begin, end_);
    std::size_t i = 0;
    while (i + 1 < pieces_.size() && pieces_[i + 1].begin < inside) ++i;
    const Piece& piece = pieces_[i];
    const double t = (inside - piece.begin) / piece.length;
    const double off_u = u - piece.u.at(t), off_v = v - piece.v.at(t), half_u = piece.half_u.at(t);
    const double half_v = (off_v > 0 ? piece.half_v_plus : piece.half_v_minus).at(t);
    const double qu = off_u / half_u, qv = off_v / half_v;
    const double across = ellipse_distance(qu * qu + qv * qv, qu * qu / (half_u * half_u) + qv * qv / (half_v * half_v),
                                           std::min(half_u, half_v));
    const double beyond = std::abs(along - inside);
    if (beyond == 0) return across;
    return across <= 0 ? beyond : std::sqrt(across * across + beyond * beyond);
  }

 private:
  /// What is between a section and the next.
  struct Piece {
    double begin, length;
    Cubic u, v, half_u, half_v_plus, half_v_minus;
  };

  static Piece piece(std::span<const Section> sections, int i) {
    const int last = static_cast<int>(sections.size()) - 1;
    double x[4], y[5][4];
    for (int k = 0; k < 4; ++k) {
      // Beyond the ends the outermost section goes on at the same distance.
      const int from = std::clamp(i + k - 1, 0, last);
      const Section& s = sections[static_cast<std::size_t>(from)];
      x[k] = s.along + 0.02 * (i + k - 1 - from);
      y[0][k] = s.u, y[1][k] = s.v, y[2][k] = s.half_u, y[3][k] = s.half_v_plus, y[4][k] = s.half_v_minus;
    }
    return {x[1], x[2] - x[1], cubic(x, y[0]), cubic(x, y[1]), cubic(x, y[2]), cubic(x, y[3]), cubic(x, y[4])};
  }

  std::vector<Piece> pieces_;
  double end_;
};

// --- the tables; `along` is y for torso, neck and leg, x for arm and palm, z for the foot ----------------------------

constexpr Section kTorsoSections[] = {
    // y, x, z, half width, front, back
    {0.800, 0, -0.005, 0.050, 0.045, 0.060}, {0.840, 0, -0.005, 0.115, 0.080, 0.095},
    {0.880, 0, -0.005, 0.155, 0.096, 0.118}, {0.930, 0, -0.007, 0.166, 0.102, 0.118},
    {0.980, 0, -0.010, 0.156, 0.105, 0.100}, {1.040, 0, -0.012, 0.140, 0.104, 0.084},
    {1.100, 0, -0.013, 0.133, 0.102, 0.082}, {1.160, 0, -0.015, 0.138, 0.108, 0.086},
    {1.220, 0, -0.016, 0.149, 0.117, 0.094}, {1.280, 0, -0.018, 0.160, 0.120, 0.102},
    {1.335, 0, -0.020, 0.164, 0.107, 0.104}, {1.385, 0, -0.022, 0.152, 0.082, 0.092},
    {1.420, 0, -0.024, 0.115, 0.062, 0.074}, {1.450, 0, -0.024, 0.072, 0.050, 0.058},
    {1.470, 0, -0.020, 0.040, 0.036, 0.040}, {1.490, 0, -0.016, 0.020, 0.020, 0.020},
};

constexpr Section kNeckSections[] = {
    {1.400, 0, -0.022, 0.058, 0.050, 0.056}, {1.450, 0, -0.018, 0.054, 0.052, 0.056},
    {1.490, 0, -0.012, 0.052, 0.053, 0.056}, {1.530, 0, -0.006, 0.053, 0.052, 0.060},
    {1.580, 0, -0.002, 0.050, 0.045, 0.060},
};

constexpr Section kLegSections[] = {
    {0.040, 0.100, -0.026, 0.020, 0.020, 0.022}, {0.065, 0.100, -0.023, 0.028, 0.032, 0.034},
    {0.090, 0.100, -0.021, 0.033, 0.036, 0.040}, {0.130, 0.100, -0.021, 0.032, 0.033, 0.036},
    {0.200, 0.100, -0.017, 0.037, 0.035, 0.041}, {0.280, 0.100, -0.011, 0.046, 0.041, 0.054},
    {0.350, 0.100, -0.007, 0.052, 0.045, 0.063}, {0.410, 0.099, -0.003, 0.052, 0.048, 0.059},
    {0.460, 0.098, 0.001, 0.050, 0.052, 0.051},  {0.500, 0.098, 0.004, 0.051, 0.056, 0.050},
    {0.560, 0.097, 0.003, 0.056, 0.060, 0.057},  {0.640, 0.095, 0.001, 0.064, 0.070, 0.068},
    {0.720, 0.093, 0.000, 0.072, 0.080, 0.077},  {0.790, 0.092, -0.002, 0.078, 0.086, 0.087},
    {0.850, 0.091, -0.004, 0.080, 0.088, 0.096}, {0.900, 0.084, -0.006, 0.066, 0.076, 0.086},
    {0.940, 0.076, -0.006, 0.040, 0.050, 0.060},
};

constexpr Section kFootSections[] = {
    // z, x, y, half width, up, down
    {-0.078, 0.100, 0.030, 0.020, 0.018, 0.022}, {-0.060, 0.100, 0.034, 0.029, 0.040, 0.034},
    {-0.030, 0.100, 0.036, 0.032, 0.062, 0.036}, {0.010, 0.102, 0.034, 0.034, 0.056, 0.036},
    {0.050, 0.106, 0.028, 0.038, 0.042, 0.032},  {0.090, 0.111, 0.024, 0.043, 0.031, 0.028},
    {0.125, 0.115, 0.021, 0.045, 0.024, 0.024},  {0.155, 0.116, 0.019, 0.040, 0.020, 0.021},
    {0.178, 0.114, 0.017, 0.026, 0.015, 0.017},
};

constexpr Section kArmSections[] = {
    // x, y, z, half height, front, back
    {0.100, 1.375, -0.020, 0.048, 0.046, 0.050}, {0.150, 1.388, -0.020, 0.056, 0.054, 0.056},
    {0.190, 1.394, -0.020, 0.059, 0.056, 0.055}, {0.240, 1.397, -0.021, 0.053, 0.051, 0.050},
    {0.310, 1.398, -0.022, 0.046, 0.049, 0.045}, {0.380, 1.398, -0.022, 0.042, 0.043, 0.042},
    {0.440, 1.398, -0.022, 0.038, 0.038, 0.039}, {0.490, 1.398, -0.021, 0.039, 0.043, 0.041},
    {0.540, 1.398, -0.020, 0.037, 0.042, 0.039}, {0.600, 1.399, -0.019, 0.030, 0.036, 0.034},
    {0.660, 1.399, -0.018, 0.023, 0.030, 0.028}, {0.700, 1.399, -0.018, 0.020, 0.029, 0.026},
    {0.720, 1.399, -0.018, 0.014, 0.022, 0.020}, {0.735, 1.399, -0.018, 0.008, 0.012, 0.012},
};

constexpr Section kPalmSections[] = {
    {0.680, 1.399, -0.018, 0.0120, 0.016, 0.014}, {0.705, 1.399, -0.018, 0.0175, 0.028, 0.026},
    {0.735, 1.399, -0.018, 0.0165, 0.036, 0.033}, {0.765, 1.399, -0.018, 0.0150, 0.040, 0.038},
    {0.785, 1.399, -0.018, 0.0125, 0.040, 0.039}, {0.800, 1.399, -0.018, 0.0090, 0.036, 0.034},
};

const Tube kTorso(kTorsoSections), kNeck(kNeckSections), kLeg(kLegSections), kFoot(kFootSections), kArm(kArmSections),
    kPalm(kPalmSections);

double head(const Vector& p) {  // p.x ≥ 0
  const double skull = ellipsoid(p, {0, 1.628, -0.010}, {0.074, 0.092, 0.096});
  const double face = ellipsoid(p, {0, 1.578, 0.026}, {0.058, 0.084, 0.066});
  const double jaw = ellipsoid(p, {0, 1.520, 0.046}, {0.040, 0.030, 0.040});
  const double nose = round_cone(p, {0, 1.605, 0.082}, {0, 1.570, 0.094}, 0.010, 0.014);
  const double ear = ellipsoid(p, {0.074, 1.590, -0.010}, {0.013, 0.030, 0.019});
  const double eye = ellipsoid(p, {0.032, 1.603, 0.104}, {0.019, 0.012, 0.018});
  double d = smooth_union(skull, face, 0.030);
  d = smooth_union(d, jaw, 0.020);
  d = smooth_difference(d, eye, 0.014);
  d = smooth_union(d, nose, 0.016);
  return smooth_union(d, ear, 0.012);
}

/// No more than a finger's field: it is straight, and widest at its base.
double finger_bound(const Finger& finger, const Vector& p) {
  const Vector to_middle = p - (finger.points[0] + finger.points[3]) * 0.5, along = finger.points[3] - finger.points[0];
  constexpr double kRounding = 1e-9;
  return std::sqrt(dot(to_middle, to_middle)) - std::sqrt(dot(along, along)) * 0.5 - finger.radii[0] - kRounding;
}

double hand(const Vector& p) {
  constexpr double kReach = 0.008;
  const double palm = kPalm.distance(p[0], p[1], p[2]);
  double fingers = 1;
  for (const Finger& finger : left_fingers()) {
    // A finger further away changes no bit of the union.
    if (finger_bound(finger, p) < std::min(fingers, palm + kReach))
      fingers = std::min(fingers, finger_field(finger, p));
  }
  return smooth_union(palm, fingers, kReach);
}

double foot(const Vector& p) {
  const double shape = kFoot.distance(p[2], p[0], p[1]);
  return -smooth_union(-shape, p[1], 0.010);  // flat below
}

}  // namespace

const std::array<Finger, 5>& left_fingers() {
  static const std::array<Finger, 5> fingers = {
      make_finger("index", {0.793, 1.400, 0.0140}, {1, -0.02, 0.13}, {0.042, 0.026, 0.020},
                  {0.0092, 0.0086, 0.0078, 0.0066}),
      make_finger("middle", {0.797, 1.401, -0.0085}, {1, -0.02, 0.00}, {0.046, 0.029, 0.021},
                  {0.0094, 0.0088, 0.0080, 0.0067}),
      make_finger("pinky", {0.779, 1.397, -0.0510}, {1, -0.03, -0.27}, {0.034, 0.020, 0.018},
                  {0.0082, 0.0074, 0.0067, 0.0058}),
      make_finger("ring", {0.791, 1.400, -0.0305}, {1, -0.02, -0.12}, {0.043, 0.027, 0.021},
                  {0.0088, 0.0083, 0.0075, 0.0064}),
      make_finger("thumb", {0.722, 1.388, 0.0080}, {0.72, -0.22, 0.66}, {0.047, 0.033, 0.026},
                  {0.0135, 0.0112, 0.0102, 0.0082}),
  };
  return fingers;
}

double finger_field(const Finger& finger, const Vector3<double>& p) {
  double d = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    d = std::min(d, round_cone(p, finger.points[i], finger.points[i + 1], finger.radii[i], finger.radii[i + 1]));
  }
  return d;
}

std::vector<double> procedural_joints() {
  std::vector<double> joints(static_cast<std::size_t>(3 * kSmplxJoints));
  const auto put = [&](int joint, double x, double y, double z) {
    const std::size_t at = static_cast<std::size_t>(3 * joint);
    joints[at] = x, joints[at + 1] = y, joints[at + 2] = z;
  };
  for (const Place& place : kCentre) put(smplx_joint(place.joint), place.x, place.y, place.z);
  for (const Place& place : kLeft) {
    put(smplx_joint(std::string("left_") + place.joint), place.x, place.y, place.z);
    put(smplx_joint(std::string("right_") + place.joint), -place.x, place.y, place.z);
  }
  for (const Finger& finger : left_fingers()) {
    for (int bone = 0; bone < 3; ++bone) {
      const Vector& p = finger.points[static_cast<std::size_t>(bone)];
      put(finger.first_joint + bone, p[0], p[1], p[2]);
      put(finger.first_joint + bone + 15, -p[0], p[1], p[2]);  // the right hand follows the left one
    }
  }
  return joints;
}

double body_field(const Vector3<double>& point) {
  const Vector p(std::abs(point[0]), point[1], point[2]);
  const double x = p[0], y = p[1];
  // A part is left out where it is further away than any union reaches.
  constexpr double kFar = 0.3;
  double d = y < 0.72 || x > 0.30 ? kFar : kTorso.distance(y, x, p[2]);
  if (y > 1.33 && x < 0.20) d = smooth_union(d, kNeck.distance(y, x, p[2]), 0.030);
  if (y > 1.40 && x < 0.20) d = smooth_union(d, head(p), 0.014);
  if (y > 1.20 && x > 0.02) {
    double arm = x > 0.82 ? kFar : kArm.distance(x, y, p[2]);
    if (x > 0.60) arm = smooth_union(arm, hand(p), 0.012);
    d = smooth_union(d, arm, 0.045);
  }
  if (y < 1.05) {
    double leg = kLeg.distance(y, x, p[2]);
    if (y < 0.20) leg = smooth_union(leg, foot(p), 0.024);
    d = smooth_union(d, leg, 0.030);
  }
  return d;
}

}  // namespace hsi4d::detail
