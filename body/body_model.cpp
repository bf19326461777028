#include "body/body_model.h"

#include <algorithm>

#include "body/kinematics.h"

namespace hsi4d {

namespace {

struct NamedJoint {
  const char* name;
  int parent;
};

// The layout of SMPL-X [Pavlakos et al. 2019]; fingers follow below.
constexpr NamedJoint kBody[] = {
    {"pelvis", -1},
    {"left_hip", 0},
    {"right_hip", 0},
    {"spine1", 0},
    {"left_knee", 1},
    {"right_knee", 2},
    {"spine2", 3},
    {"left_ankle", 4},
    {"right_ankle", 5},
    {"spine3", 6},
    {"left_foot", 7},
    {"right_foot", 8},
    {"neck", 9},
    {"left_collar", 9},
    {"right_collar", 9},
    {"head", 12},
    {"left_shoulder", 13},
    {"right_shoulder", 14},
    {"left_elbow", 16},
    {"right_elbow", 17},
    {"left_wrist", 18},
    {"right_wrist", 19},
    {"jaw", 15},
    {"left_eye_smplhf", 15},
    {"right_eye_smplhf", 15},
};
constexpr const char* kFingers[] = {"index", "middle", "pinky", "ring", "thumb"};
constexpr int kWrists[] = {20, 21};

struct Layout {
  std::vector<std::string> names;
  std::vector<int> parents;
};

Layout make_layout() {
  Layout layout;
  for (const NamedJoint& joint : kBody) {
    layout.names.emplace_back(joint.name);
    layout.parents.push_back(joint.parent);
  }
  for (int side = 0; side < 2; ++side) {
    for (const char* finger : kFingers) {
      for (int bone = 1; bone <= 3; ++bone) {
        layout.parents.push_back(bone == 1 ? kWrists[side] : static_cast<int>(layout.names.size()) - 1);
        layout.names.push_back((side == 0 ? "left_" : "right_") + std::string(finger) + std::to_string(bone));
      }
    }
  }
  return layout;
}

const Layout& layout() {
  static const Layout made = make_layout();
  return made;
}

}  // namespace

const std::vector<std::string>& smplx_joint_names() { return layout().names; }

const std::vector<int>& smplx_parents() { return layout().parents; }

int smplx_joint(std::string_view name) {
  const auto& names = smplx_joint_names();
  const auto found = std::find(names.begin(), names.end(), name);
  HSI4D_CHECK(found != names.end(), "no joint is called " + std::string(name));
  return static_cast<int>(found - names.begin());
}

std::string tree_fault(std::span<const int> parents) {
  if (parents.empty()) return "there are no joints";
  if (parents[0] != -1) return "the parent of joint 0 is " + std::to_string(parents[0]) + "; allowed: -1, the root";
  for (std::size_t j = 1; j < parents.size(); ++j) {
    if (parents[j] >= 0 && static_cast<std::size_t>(parents[j]) < j) continue;
    return "the parent of joint " + std::to_string(j) + " is " + std::to_string(parents[j]) + "; allowed: 0 to " +
           std::to_string(j - 1) + ", a joint that comes before it";
  }
  return {};
}

std::vector<double> pose_vertices(const BodyModel& body, const BodyPose& pose) {
  const PosedJoints posed = pose_skeleton(body, pose);
  const std::vector<double> rest(body.vertices.begin(), body.vertices.end());
  std::vector<double> vertices(rest.size());
  skin_points(SkinWeights<double>(body.weights), posed.transforms.data(), rest.data(), vertices.data());
  return vertices;
}

}  // namespace hsi4d
