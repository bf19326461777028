#include "body/clothing.h"

#include <algorithm>
#include <cmath>

#include "body/procedural_shape.h"

namespace hsi4d::detail {

namespace {

using Vector = Vector3<double>;

// Joints of the SMPL-X layout.
constexpr int kPelvis = 0, kHipLeft = 1, kHipRight = 2, kKneeLeft = 4, kKneeRight = 5, kAnkleLeft = 7, kAnkleRight = 8,
              kFootLeft = 10, kFootRight = 11, kNeck = 12, kHead = 15, kShoulderLeft = 16, kShoulderRight = 17,
              kElbowLeft = 18, kElbowRight = 19, kWristLeft = 20, kWristRight = 21, kJaw = 22, kEyeLeft = 23,
              kEyeRight = 24;

const Vector kSkin(0.80, 0.60, 0.48);
const Vector kHair(0.20, 0.13, 0.09);
const Vector kEyes(0.16, 0.12, 0.12);
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
  head_size_ = std::max(top - joint(kHead)[1], 0.05) / 0.198;
}

Vector3<double> Clothing::color(const Vector& point, const Vector& normal, int joint) const {
  const double light = 0.90 + 0.10 * normal[1];  // the light from above that clothes in photographs have
  return fabric(point, joint) * light;
}

Vector3<double> Clothing::fabric(const Vector& p, int j) const {
  const double y = p[1];
  if (is_one_of(j, {kHead, kJaw, kEyeLeft, kEyeRight})) return head(p);
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
  return y > joint(kNeck)[1] + 0.010 ? kSkin : shirt(p, false);
}

Vector3<double> Clothing::head(const Vector& p) const {
  const Vector from = (p - joint(kHead)) / head_size_;
  if (from[1] > 0.088 + 0.85 * from[2]) return kHair;  // the hairline, from forehead to nape
  for (const int j : {kEyeLeft, kEyeRight}) {
    const Vector off = p - joint(j);
    if (off[2] > 0 && off[0] * off[0] + off[1] * off[1] < 0.011 * 0.011) return kEyes;
  }
  return kSkin;
}

Vector3<double> Clothing::shirt(const Vector& p, bool sleeve) const {
  const double waist = joint(kPelvis)[1];
  const double along = sleeve ? std::abs(p[0]) : p[1] - waist;
  const bool front = p[2] > joint(kNeck)[2];
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
