#include "body/clothing.h"

#include <algorithm>
#include <cmath>

#include "body/procedural_shape.h"

namespace hsi4d::detail {

namespace {

using Vector = Vector3<double>;

// Joints of the SMPL-X layout.
constexpr int kPelvis = 0, kHipLeft = 1, kHipRight = 2, kKneeLeft = 4, kKneeRight = 5, kAnkleLeft = 7, kAnkleRight = 8,
              kFootLeft = 10, kFootRight = 11, kNeckJoint = 12, kHeadJoint = 15, kShoulderLeft = 16,
              kShoulderRight = 17, kElbowLeft = 18, kElbowRight = 19, kWristLeft = 20, kWristRight = 21, kJaw = 22,
              kEyeLeft = 23, kEyeRight = 24;

const Vector kSkin(0.80, 0.60, 0.48);
const Vector kHair(0.20, 0.13, 0.09);
const Vector kEyeWhite(0.86, 0.84, 0.81);
const Vector kIris(0.30, 0.21, 0.13);
const Vector kPupil(0.05, 0.04, 0.04);
const Vector kLashes(0.20, 0.13, 0.10);
const Vector kLidShade(0.66, 0.46, 0.37);
const Vector kLips(0.69, 0.40, 0.36);
const Vector kLipLine(0.40, 0.20, 0.18);
const Vector kShirtDark(0.16, 0.30, 0.56);
const Vector kShirtLight(0.84, 0.82, 0.72);
const Vector kButtons(0.70, 0.20, 0.18);
const Vector kTrousersDark(0.22, 0.24, 0.26);
const Vector kTrousersLight(0.46, 0.44, 0.38);
const Vector kBelt(0.30, 0.17, 0.09);
const Vector kShoes(0.34, 0.12, 0.10);
const Vector kSoles(0.85, 0.84, 0.80);

/// 0 and 1 by turns, `period` metres for both, with soft edges.
double stripes(double x, double period) {
  const double phase = x / period - std::floor(x / period);
  return smoothstep(0.45, 0.55, phase) * (1 - smoothstep(0.90, 1.00, phase));
}

/// From a to b, as far as the contrast goes: halfway without any.
Vector between(const Vector& a, const Vector& b, double share, double contrast) {
  const double s = 0.5 + (share - 0.5) * contrast;
  return a * (1 - s) + b * s;
}

bool is_one_of(int joint, std::initializer_list<int> joints) {
  return std::find(joints.begin(), joints.end(), joint) != joints.end();
}

}  // namespace

Clothing::Clothing(const BodyModel& body, double texture) : joints_(body.joints), texture_(texture) {
  HSI4D_CHECK(body.joint_names == smplx_joint_names(), "the body's joints are not those of SMPL-X");
  double top = body.vertices.empty() ? 0 : static_cast<double>(body.vertices[1]);
  for (std::size_t i = 1; i < body.vertices.size(); i += 3) top = std::max(top, static_cast<double>(body.vertices[i]));
  head_size_ = std::max(top - joint(kHeadJoint)[1], 0.05) / 0.198;
}

Vector3<double> Clothing::color(const Vector& p, int j) const {
  const double y = p[1];
  if (is_one_of(j, {kHeadJoint, kJaw, kEyeLeft, kEyeRight})) return head(p);
  if (j >= kEyeRight || is_one_of(j, {kElbowLeft, kElbowRight, kWristLeft, kWristRight})) return kSkin;
  if (is_one_of(j, {kShoulderLeft, kShoulderRight})) {
    const Vector shoulder = joint(j), arm = joint(j + 2) - shoulder;
    return dot(Vector(p - shoulder), arm) > 0.75 * dot(arm, arm) ? kSkin : shirt(p, true);
  }
  if (is_one_of(j, {kFootLeft, kFootRight, kAnkleLeft, kAnkleRight, kKneeLeft, kKneeRight})) {
    const double ankle = joint(kAnkleLeft)[1];
    if (y < ankle - 0.065) return kSoles;
    return y < ankle + 0.015 ? kShoes : trousers(p);
  }
  if (is_one_of(j, {kHipLeft, kHipRight, kPelvis})) {
    const double above = y - joint(kPelvis)[1];
    if (above < 0.020) return trousers(p);
    return above < 0.055 ? kBelt : shirt(p, false);
  }
  return y > joint(kNeckJoint)[1] + 0.010 ? kSkin : shirt(p, false);
}

// Sizes of the face are those of an adult, metres: the opening of an eye is 30 x 12 mm, an iris 12 mm, a mouth 48 mm
// wide and as far below the eyes as they are apart.

Vector3<double> Clothing::on_face(const Vector& p, const Vector& centre) const {
  return Vector((p - centre) / head_size_);
}

Vector3<double> Clothing::mouth_centre() const {
  const Vector left = joint(kEyeLeft), right = joint(kEyeRight);
  return Vector((left + right) / 2 - Vector(0, 0.062, 0.020) * head_size_);
}

double Clothing::detail(const Vector& p) const {
  double nearest = 1;  // squared distance over that within which it is fine
  for (const int j : {kEyeLeft, kEyeRight}) {
    const Vector off = on_face(p, joint(j));
    if (off[2] > 0) nearest = std::min(nearest, (off[0] * off[0] + off[1] * off[1]) / (0.030 * 0.030));
  }
  const Vector off = on_face(p, mouth_centre());
  if (off[2] > 0) nearest = std::min(nearest, (off[0] * off[0] + 2 * off[1] * off[1]) / (0.036 * 0.036));
  return kFaceDetail - (kFaceDetail - 1) * smoothstep(0.3, 1, nearest);
}

Vector3<double> Clothing::head(const Vector& p) const {
  const Vector from = on_face(p, joint(kHeadJoint));
  if (from[1] > 0.088 + 0.85 * from[2]) return kHair;  // the hairline, from forehead to nape
  for (const int j : {kEyeLeft, kEyeRight}) {
    const Vector off = on_face(p, joint(j));
    const double outward = j == kEyeLeft ? off[0] : -off[0];
    if (off[2] > 0 && std::abs(outward) < 0.030 && std::abs(off[1]) < 0.035) return eye(outward, off[1]);
  }
  const Vector off = on_face(p, mouth_centre());
  return off[2] > 0 && std::abs(off[0]) < 0.030 && std::abs(off[1]) < 0.020 ? mouth(off[0], off[1]) : kSkin;
}

Vector3<double> Clothing::eye(double x, double y) const {
  const double share = x / 0.015, opening = 1 - share * share;  // of the almond, from corner to corner
  const double upper = 0.0066 * opening, lower = -0.0050 * opening;
  const double off = std::sqrt(x * x + (y - 0.0006) * (y - 0.0006));  // from the middle of the iris
  if (opening > 0 && y < upper && y > lower) return off < 0.0024 ? kPupil : off < 0.0060 ? kIris : kEyeWhite;
  if (opening > -0.25 && y >= upper && y < std::max(upper, 0.0) + 0.0020) return kLashes;
  const double brow = 0.0190 - 7 * (x - 0.003) * (x - 0.003);
  if (x > -0.016 && x < 0.023 && std::abs(y - brow) < 0.0026 - 0.05 * std::max(x, 0.0)) return kHair;
  const double lid = std::sqrt(x * x / (0.020 * 0.020) + (y - 0.002) * (y - 0.002) / (0.013 * 0.013));
  return kLidShade + (kSkin - kLidShade) * smoothstep(0.7, 1.1, lid);
}

Vector3<double> Clothing::mouth(double x, double y) const {
  const double share = x / 0.024, full = 1 - share * share;
  if (full <= 0) return kSkin;
  const double bow = 1 - 0.25 * std::exp(-x * x / (0.004 * 0.004));  // of the upper lip
  if (std::abs(y) < 0.0011) return kLipLine;
  return y < 0.0065 * full * bow && y > -0.0090 * full ? kLips : kSkin;
}

Vector3<double> Clothing::shirt(const Vector& p, bool sleeve) const {
  const double waist = joint(kPelvis)[1];
  const double along = sleeve ? std::abs(p[0]) : p[1] - waist;
  const bool front = p[2] > joint(kNeckJoint)[2];
  if (!sleeve && front && std::abs(p[0]) < 0.014) return between(kShirtDark, kButtons, 1, texture_);
  const double cloth = 0.8 * stripes(along, 0.070) + 0.2 * stripes(p[0] + 0.5 * p[2], 0.160);
  return between(kShirtDark, kShirtLight, cloth, texture_);
}

Vector3<double> Clothing::trousers(const Vector& p) const {
  const double across = 0.5 * (stripes(p[0], 0.090) + stripes(p[2], 0.090));
  const double cloth = 0.6 * stripes(p[1], 0.100) + 0.4 * across;
  return between(kTrousersDark, kTrousersLight, cloth, texture_);
}

}  // namespace hsi4d::detail
