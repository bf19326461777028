#include "pipelines/evaluate/baseline_export.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "body/kinematics.h"
#include "body/motion_edit.h"
#include "body/pose_layout.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/npz.h"
#include "core/parallel.h"
#include "core/rotation.h"
#include "optim/object_centres.h"
#include "pipelines/evaluate/prompt.h"
#include "pipelines/record/folder.h"
#include "pipelines/record/results.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;
using Point = Vector3<double>;

constexpr const char* kSceneName = "scene";
constexpr Index kBlock = 8;            // voxels
constexpr Index kWaypointFrames = 30;  // of CHOIS: one a second
constexpr double kLingoRate = 10;      // frames a second that LINGO makes
constexpr Index kLingoWindow = 16, kLingoOverlap = 2;
constexpr std::size_t kChoisBetas = 16;

/// The motion at 30 frames a second, with where its joints are.
struct Exported {
  Motion motion;                            // of a body of SMPL-X
  std::vector<std::vector<double>> joints;  // [T][J,3], of the body that it is measured on
  std::vector<std::string> names;           // of objects
  std::vector<SceneState> states;           // their poses
  std::string text;
};

Point joint_of(const std::vector<double>& joints, Index j) { return Point(joints.data() + 3 * j); }

/// x, z, −y of z up are x, y, z of y up: (x, y, z) → (x, z, −y).
Point y_up(const Point& place) { return {place[0], place[2], -place[1]}; }

/// For a body of SMPL-X: of the person's shape where it has one, else of the mean one, with the pelvis where it is.
Motion for_smplx(const Motion& motion) {
  const bool has_shape = std::any_of(motion.betas.begin(), motion.betas.end(), [](double beta) { return beta != 0; });
  return motion.pelvis_rest && !has_shape ? for_body(motion, kSmplxName, kSmplxPelvis) : motion;
}

Exported exported(const MotionInScene& in, const std::string& input) {
  Exported out;
  out.motion = resampled(in.track.motion, kExportedRate);
  for (const BodyPose& pose : out.motion.poses)
    out.joints.push_back(pose_joints(in.skeleton.parents, in.skeleton.joints, pose));
  out.motion = for_smplx(out.motion);
  out.names = in.track.objects;
  out.states = object_states(in.track, kExportedRate, std::ssize(out.motion.poses));
  out.text = run_prompt(input);
  return out;
}

// ---- Numbers and places as JSON ----

ConfigValue point_json(const Point& place) {
  std::vector<ConfigValue> numbers;
  for (int i = 0; i < 3; ++i) numbers.push_back(ConfigValue::make_number(place[i]));
  return ConfigValue::make_array(std::move(numbers));
}

ConfigValue xyz_json(const Point& place) {
  ConfigValue object = ConfigValue::make_object();
  for (int i = 0; i < 3; ++i)
    object.add(std::array{"x", "y", "z"}[static_cast<std::size_t>(i)], ConfigValue::make_number(place[i]));
  return object;
}

// ---- Files ----

/// The state of frame 0, by the names of smplx, with the joints; and the pelvis's and the objects' ways.
void write_trajectory(const fs::path& folder, const Exported& out) {
  NpzWriter file;
  const auto frames = static_cast<std::int64_t>(out.joints.size());
  std::vector<double> pelvis;
  for (const std::vector<double>& joints : out.joints) pelvis.insert(pelvis.end(), joints.begin(), joints.begin() + 3);
  file.add<double>("pelvis", {frames, 3}, pelvis);
  file.add_scalar("frame_rate", kExportedRate);
  const BodyPose& first = out.motion.poses.front();
  const auto part = [&first](std::size_t joint, std::size_t count) {
    const auto begin = first.axis_angle.begin() + static_cast<std::ptrdiff_t>(3 * joint);
    return std::vector<double>(begin, begin + static_cast<std::ptrdiff_t>(3 * count));
  };
  file.add<double>("initial/transl", {3}, {first.transl[0], first.transl[1], first.transl[2]});
  file.add<double>("initial/global_orient", {3}, part(0, 1));
  file.add<double>("initial/body_pose", {63}, part(1, 21));
  file.add<double>("initial/left_hand_pose", {45}, part(25, 15));
  file.add<double>("initial/right_hand_pose", {45}, part(40, 15));
  file.add<double>("initial/betas", {std::ssize(out.motion.betas)}, out.motion.betas);
  file.add<double>("initial/joints", {std::ssize(out.joints.front()) / 3, 3}, out.joints.front());
  for (std::size_t o = 0; o < out.names.size() && !out.states.empty(); ++o) {
    std::vector<double> rotations, places;
    for (const SceneState& state : out.states) {
      const Matrix3<double> rotation = so3_exp(state.objects[o].rotation);
      for (int r = 0; r < 3; ++r) rotations.insert(rotations.end(), {rotation(r, 0), rotation(r, 1), rotation(r, 2)});
      places.insert(places.end(), state.objects[o].translation.data(), state.objects[o].translation.data() + 3);
    }
    file.add<double>(out.names[o] + "/rotation_matrix", {frames, 3, 3}, rotations);
    file.add<double>(out.names[o] + "/translation", {frames, 3}, places);
  }
  file.write((folder / "trajectory.npz").string());
}

/// The first frame in which a hand touches an object, and the first joint of that hand's index finger there.
struct FirstTouch {
  Index frame = -1;
  Point place = Point::Zero();  // metres, z up
};

FirstTouch first_touch(const MotionInScene& in, const Exported& out) {
  if (in.objects.empty() || out.states.empty()) return {};
  std::vector<const Gaussians*> objects;
  for (const Gaussians& object : in.objects) objects.push_back(&object);
  const ObjectCentres centres(objects);
  for (std::size_t t = 0; t < out.joints.size(); ++t) {
    const std::vector<Rigid<double>> poses = rigids_of(out.states[t].objects);
    for (const char* const side : {"left", "right"}) {
      const std::string name = side;
      for (const std::string& joint : {name + "_wrist", name + "_index1", name + "_middle1"}) {
        if (centres.nearest(joint_of(out.joints[t], smplx_joint(joint)), poses, kContactDistance))
          return {static_cast<Index>(t), joint_of(out.joints[t], smplx_joint(name + "_index1"))};
      }
    }
  }
  return {};
}

void write_trumans(const fs::path& folder, const Exported& out) {
  ConfigValue points = ConfigValue::make_array();
  for (const std::vector<double>& joints : out.joints) {
    const Point pelvis = joint_of(joints, 0);
    points.items.push_back(xyz_json(y_up({pelvis[0], pelvis[1], 0})));
  }
  write_text_file((folder / "trajectory.json").string(), to_json(points));
}

void write_lingo(const fs::path& folder, const MotionInScene& in, const Exported& out) {
  const FirstTouch touch = first_touch(in, out);
  ConfigValue segment = ConfigValue::make_object();
  segment.add("scene_name", ConfigValue::make_string(kSceneName));
  segment.add("text", ConfigValue::make_string(out.text));
  segment.add("start_location", point_json(y_up(joint_of(out.joints.front(), 0))));
  segment.add("end_location", point_json(y_up(joint_of(out.joints.back(), 0))));
  segment.add("hand_location", point_json(y_up(touch.place)));
  const double seconds = static_cast<double>(out.joints.size() - 1) / kExportedRate;
  const double windows = (seconds * kLingoRate + 1 - kLingoOverlap) / (kLingoWindow - kLingoOverlap);
  segment.add("episode_num", ConfigValue::make_integer(std::max<std::int64_t>(1, std::llround(std::ceil(windows)))));
  segment.add("seg_num", ConfigValue::make_integer(1));
  write_text_file((folder / "input.json").string(), to_json(ConfigValue::make_array({std::move(segment)})));
}

std::vector<double> object_points(const Gaussians& object) {
  return std::vector<double>(object.means.begin(), object.means.end());
}

/// A file an object: the whole sequence by CHOIS's names, of which it takes the first frame and the waypoints.
void write_chois(const fs::path& folder, const MotionInScene& in, const Exported& out) {
  const auto frames = static_cast<std::int64_t>(out.joints.size());
  for (std::size_t o = 0; o < out.names.size() && !out.states.empty(); ++o) {
    NpzWriter file;
    std::vector<double> trans, root, body, rotations, places, waypoints;
    std::vector<std::int64_t> waypoint_frames;
    for (std::int64_t t = 0; t < frames; ++t) {
      const auto at = static_cast<std::size_t>(t);
      const BodyPose& pose = out.motion.poses[at];
      trans.insert(trans.end(), pose.transl.data(), pose.transl.data() + 3);
      root.insert(root.end(), pose.axis_angle.begin(), pose.axis_angle.begin() + 3);
      body.insert(body.end(), pose.axis_angle.begin() + 3, pose.axis_angle.begin() + 66);
      const Matrix3<double> rotation = so3_exp(out.states[at].objects[o].rotation);
      for (int r = 0; r < 3; ++r) rotations.insert(rotations.end(), {rotation(r, 0), rotation(r, 1), rotation(r, 2)});
      const Point& place = out.states[at].objects[o].translation;
      places.insert(places.end(), place.data(), place.data() + 3);
      if (t % kWaypointFrames != 0 && t + 1 != frames) continue;
      waypoint_frames.push_back(t);
      waypoints.insert(waypoints.end(), place.data(), place.data() + 3);
    }
    std::vector<double> betas = out.motion.betas;
    betas.resize(kChoisBetas);
    file.add<double>("trans", {frames, 3}, trans);
    file.add<double>("root_orient", {frames, 3}, root);
    file.add<double>("pose_body", {frames, 63}, body);
    file.add<double>("betas", {1, static_cast<std::int64_t>(kChoisBetas)}, betas);
    file.add_text("gender", out.motion.gender);
    file.add<double>("obj_rot_mat", {frames, 3, 3}, rotations);
    file.add<double>("obj_com_pos", {frames, 3}, places);
    file.add<std::int64_t>("waypoint_frames", {std::ssize(waypoint_frames)}, waypoint_frames);
    file.add<double>("waypoints", {std::ssize(waypoint_frames), 3}, waypoints);
    if (o < in.objects.size())
      file.add<double>("object_points", {in.objects[o].count(), 3}, object_points(in.objects[o]));
    file.add_scalar("mocap_frame_rate", kExportedRate);
    file.add_text("text", out.text);
    file.write((folder / (out.names[o] + ".npz")).string());
  }
}

void write_voxels(const fs::path& path, const Solid& solid, const VoxelBox& box) {
  const std::vector<std::uint8_t> voxels = voxels_in(solid.distance, box);
  write_file(path.string(), encode_npy(std::array<std::int64_t, 3>{box.cells[0], box.cells[1], box.cells[2]},
                                       std::span<const std::uint8_t>(voxels)));
}

/// Tells a way that leaves the grids of TRUMANS or LINGO.
void warn_of_leaving(const std::string& input, const Exported& out, const VoxelBox& box, const char* name) {
  for (std::size_t t = 0; t < out.joints.size(); ++t) {
    const Point pelvis = y_up(joint_of(out.joints[t], 0));
    if ((pelvis.array() >= box.low.array()).all() && (pelvis.array() <= box.high.array()).all()) continue;
    log_warning(input + ": in frame " + std::to_string(t) + " the pelvis is outside of the box that " + name +
                " takes for the scene, which stands about the world's origin");
    return;
  }
}

/// A block of voxels.
struct Block {
  std::array<Index, 3> begin{}, end{};
};

/// Fills what of a grid is solid, block by block.
class VoxelFiller {
 public:
  VoxelFiller(const SignedDistance& distance, const VoxelBox& box, std::vector<std::uint8_t>& voxels)
      : distance_(distance), box_(box), voxels_(voxels) {
    for (int a = 0; a < 3; ++a)
      edge_[a] = (box.high[a] - box.low[a]) / static_cast<double>(box.cells[static_cast<std::size_t>(a)]);
  }

  /// A block is cut in halves along its axes until one distance tells of the centres of all its voxels.
  void fill(const Block& block) const {
    Point middle, radius;
    for (int a = 0; a < 3; ++a) {
      const auto axis = static_cast<std::size_t>(a);
      middle[a] = box_.low[a] + 0.5 * static_cast<double>(block.begin[axis] + block.end[axis]) * edge_[a];
      radius[a] = 0.5 * static_cast<double>(block.end[axis] - block.begin[axis] - 1) * edge_[a];
    }
    const double d = distance_(Point(middle[0], -middle[2], middle[1]));  // from y up: (x, y, z) → (x, −z, y)
    const bool is_one = radius.norm() == 0;
    if (d >= radius.norm() || (is_one && !(d < 0))) return;  // all are free already
    if (is_one || d < -radius.norm()) return set_solid(block);
    for (unsigned half = 0; half < 8; ++half) {
      Block part = block;
      bool is_empty = false;
      for (std::size_t a = 0; a < 3; ++a) {
        const Index cut = (block.begin[a] + block.end[a] + 1) / 2;
        ((half >> a & 1U) != 0 ? part.begin[a] : part.end[a]) = cut;
        is_empty = is_empty || part.begin[a] >= part.end[a];
      }
      if (!is_empty) fill(part);
    }
  }

 private:
  void set_solid(const Block& block) const {
    for (Index i = block.begin[0]; i < block.end[0]; ++i) {
      for (Index j = block.begin[1]; j < block.end[1]; ++j) {
        const auto row = voxels_.begin() + (i * box_.cells[1] + j) * box_.cells[2];
        std::fill(row + block.begin[2], row + block.end[2], std::uint8_t{1});
      }
    }
  }

  const SignedDistance& distance_;
  const VoxelBox& box_;
  std::vector<std::uint8_t>& voxels_;
  Point edge_;
};

}  // namespace

std::vector<std::uint8_t> voxels_in(const SignedDistance& distance, const VoxelBox& box) {
  std::vector<std::uint8_t> voxels(static_cast<std::size_t>(box.cells[0] * box.cells[1] * box.cells[2]), 0);
  std::array<Index, 3> blocks{};
  for (std::size_t a = 0; a < 3; ++a) blocks[a] = (box.cells[a] + kBlock - 1) / kBlock;
  const VoxelFiller filler(distance, box, voxels);
  parallel_for(blocks[0] * blocks[1] * blocks[2], 1, [&](Index first, Index last) {
    for (Index number = first; number < last; ++number) {
      const std::array<Index, 3> at = {number / (blocks[1] * blocks[2]), number / blocks[2] % blocks[1],
                                       number % blocks[2]};
      Block block;
      for (std::size_t a = 0; a < 3; ++a) {
        block.begin[a] = at[a] * kBlock;
        block.end[a] = std::min(block.begin[a] + kBlock, box.cells[a]);
      }
      filler.fill(block);
    }
  });
  return voxels;
}

std::string export_for_baselines(const EvaluationSettings& settings, const std::string& input,
                                 const std::string& folder) {
  const MotionInScene in = motion_in_scene(settings, input);
  const Exported out = exported(in, input);
  const fs::path base = folder;
  write_motion((base / "motion.npz").string(), out.motion);
  if (!out.names.empty() && !out.states.empty())
    write_object_tracks((base / "objects.npz").string(), out.names, out.states);
  write_trajectory(base, out);
  write_trumans(base / "trumans", out);
  write_lingo(base / "lingo", in, out);
  write_chois(base / "chois", in, out);
  std::string grids = "no grids, as nothing says what is solid";
  if (in.solid.distance) {
    warn_of_leaving(input, out, kTrumansBox, "TRUMANS");
    write_voxels(base / "trumans" / "Scene" / (std::string(kSceneName) + ".npy"), in.solid, kTrumansBox);
    write_voxels(base / "lingo" / "Scene_vis" / (std::string(kSceneName) + ".npy"), in.solid, kLingoBox);
    grids = "grids of " + in.solid.source;
  }
  return folder + ": " + std::to_string(out.joints.size()) + " frames at 30 a second, for TRUMANS, LINGO and CHOIS; " +
         grids;
}

}  // namespace hsi4d
