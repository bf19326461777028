#include "body/kinematics.h"

#include <algorithm>

#include "core/parallel.h"
#include "core/rotation.h"

namespace hsi4d {

namespace {

constexpr Index kFrameGrain = 4;  // chains of 55 joints take microseconds

using Vector = Vector3<double>;
using Matrix = Matrix3<double>;

template <class S>
Vector vector_at(const S* x) {
  return {static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2])};
}

template <class S>
Matrix matrix_at(const S* x) {
  Matrix m;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) m(r, c) = static_cast<double>(x[3 * r + c]);
  }
  return m;
}

/// Rotation and position of a joint, or their cotangents: plain numbers, which buffers hold.
struct Pose {
  double rotation_rows[9];
  double position_numbers[3];

  auto rotation() { return Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation_rows); }
  auto rotation() const { return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rotation_rows); }
  auto position() { return Eigen::Map<Vector>(position_numbers); }
  auto position() const { return Eigen::Map<const Vector>(position_numbers); }
};

/// p_j, R_j of all joints.
template <class S>
void run_chain(std::span<const int> parents, const double* rest, const S* rotations, Pose* poses) {
  poses[0].rotation() = matrix_at(rotations);
  poses[0].position() = vector_at(rest);
  for (std::size_t j = 1; j < parents.size(); ++j) {
    const auto q = static_cast<std::size_t>(parents[j]);
    const Vector bone = vector_at(rest + 3 * j) - vector_at(rest + 3 * q);
    poses[j].rotation().noalias() = poses[q].rotation() * matrix_at(rotations + 9 * j);
    poses[j].position() = poses[q].position() + poses[q].rotation() * bone;
  }
}

/// A_j and the joint, each rounded to S once.
template <class S>
void put_joint(const Pose& pose, const Vector& rest, const Vector& transl, S* transform, S* joint) {
  const Vector offset = (pose.position() - pose.rotation() * rest) + transl;
  const Vector place = pose.position() + transl;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) transform[4 * r + c] = static_cast<S>(pose.rotation_rows[3 * r + c]);
    transform[4 * r + 3] = static_cast<S>(offset[r]);
    joint[r] = static_cast<S>(place[r]);
  }
}

template <class S>
struct KinematicChain {
  static constexpr const char* kName = "kinematic_chain";
  std::vector<int> parents;
  std::vector<double> rest;  // of the last forward, where it is input 2
  Buffer<Pose> poses = {};   // R_j and p_j of each frame, which the adjoint needs

  Index joints() const { return static_cast<Index>(parents.size()); }
  Index saved_bytes() const { return poses.capacity_bytes(); }

  void forward(NodeIo<S>& io) {
    if (io.inputs() == 3) {
      for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = static_cast<double>(io.in(2).data[i]);
    }
    const Index frames = io.in(1).shape.rows;
    poses.resize(frames * joints());
    parallel_for(frames, kFrameGrain, [&](Index begin, Index end) {
      for (Index t = begin; t < end; ++t) forward_frame(io, t);
    });
  }

  void forward_frame(NodeIo<S>& io, Index t) {
    const Vector transl = vector_at(io.in(1).row(t));
    const Index first = t * joints();
    run_chain(parents, rest.data(), io.in(0).row(first), &poses[first]);
    for (Index j = 0; j < joints(); ++j) {
      put_joint(poses[first + j], vector_at(rest.data() + 3 * j), transl, io.out(0).row(first + j),
                io.out(1).row(first + j));
    }
  }

  /// Cotangents of R_j and p_j as the outputs of a frame, whose first row is `first`, give them.
  void seed(NodeIo<S>& io, Index first, Pose* d) const {
    const ConstArray<S> d_transforms = io.d_out(0), d_joints = io.d_out(1);
    for (Index j = 0; j < joints(); ++j) {
      d[j] = {};
      if (d_transforms) {
        const S* g = d_transforms.row(first + j);
        const Vector d_offset(static_cast<double>(g[3]), static_cast<double>(g[7]), static_cast<double>(g[11]));
        const Vector r = vector_at(rest.data() + 3 * j);
        for (int row = 0; row < 3; ++row) {
          for (int c = 0; c < 3; ++c) {
            d[j].rotation_rows[3 * row + c] = static_cast<double>(g[4 * row + c]) - d_offset[row] * r[c];
          }
        }
        d[j].position() = d_offset;
      }
      if (d_joints) d[j].position() += vector_at(d_joints.row(first + j));
    }
  }

  /// Adds d_r_j += R_qᵀ d_p_j − R_jᵀ g_j and d_r_q −= R_qᵀ d_p_j of a frame, of whole cotangents d_p.
  void add_rest_adjoint(NodeIo<S>& io, Index first, const Pose* d, double* d_rest) const {
    const auto at = [&](Index j) { return Eigen::Map<Vector>(d_rest + 3 * j); };
    for (Index j = 0; j < joints(); ++j) {
      const Index q = j == 0 ? 0 : parents[static_cast<std::size_t>(j)];
      const Vector along =
          j == 0 ? Vector(d[0].position()) : Vector(poses[first + q].rotation().transpose() * d[j].position());
      at(j) += along;
      if (j > 0) at(q) -= along;
      if (!io.d_out(0)) continue;
      const S* g = io.d_out(0).row(first + j);
      const Vector d_offset(static_cast<double>(g[3]), static_cast<double>(g[7]), static_cast<double>(g[11]));
      at(j) -= poses[first + j].rotation().transpose() * d_offset;
    }
  }

  void backward(NodeIo<S>& io) {
    const Index frames = io.in(1).shape.rows;
    Pose* d = io.template scratch<Pose>(frames * joints()).data();
    parallel_for(frames, kFrameGrain, [&](Index begin, Index end) {
      for (Index t = begin; t < end; ++t) backward_frame(io, t, d + t * joints());
    });
    if (io.inputs() != 3 || !io.wants(2)) return;
    double* d_rest = io.template scratch<double>(3 * joints()).data();
    std::fill(d_rest, d_rest + 3 * joints(), 0.0);
    for (Index t = 0; t < frames; ++t) add_rest_adjoint(io, t * joints(), d + t * joints(), d_rest);
    for (Index i = 0; i < 3 * joints(); ++i) io.d_in(2).data[i] += static_cast<S>(d_rest[i]);
  }

  /// d becomes the whole cotangents of R_j and p_j of a frame.
  void backward_frame(NodeIo<S>& io, Index t, Pose* d) {
    const Index first = t * joints();
    seed(io, first, d);
    if (io.wants(1)) {
      Vector d_transl = Vector::Zero();
      for (Index j = 0; j < joints(); ++j) d_transl += d[j].position();
      for (int i = 0; i < 3; ++i) io.d_in(1).row(t)[i] += static_cast<S>(d_transl[i]);
    }
    const bool wants_rest = io.inputs() == 3 && io.wants(2);
    if (!io.wants(0) && !wants_rest) return;
    const Pose* pose = &poses[first];
    for (Index j = joints(); j-- > 0;) {  // children before parents
      const bool root = j == 0;
      const Index q = root ? 0 : parents[static_cast<std::size_t>(j)];
      if (io.wants(0)) {
        const Matrix d_local = root ? d[j].rotation() : Matrix(pose[q].rotation().transpose() * d[j].rotation());
        S* d_rotation = io.d_in(0).row(first + j);
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) d_rotation[3 * r + c] += static_cast<S>(d_local(r, c));
        }
      }
      if (root) continue;
      const Vector bone = vector_at(rest.data() + 3 * j) - vector_at(rest.data() + 3 * q);
      const Matrix local = matrix_at(io.in(0).row(first + j));
      d[q].rotation() += d[j].rotation() * local.transpose() + d[j].position() * bone.transpose();
      d[q].position() += d[j].position();
    }
  }
};

void check_skeleton(std::span<const int> parents, std::span<const double> rest_joints) {
  HSI4D_CHECK_EQ(rest_joints.size(), 3 * parents.size());
  const std::string fault = tree_fault(parents);
  HSI4D_CHECK(fault.empty(), fault);
}

}  // namespace

template <class S>
PosedSkeleton<S> kinematic_chain(Var<S> rotations, Var<S> transl, std::vector<int> parents,
                                 std::vector<double> rest_joints, Source where) {
  check_skeleton(parents, rest_joints);
  const Index frames = transl.shape().rows, rows = frames * static_cast<Index>(parents.size());
  HSI4D_CHECK_EQ(rotations.shape(), shape_of(rows, 9));
  HSI4D_CHECK_EQ(transl.shape(), shape_of(frames, 3));
  Tape<S>& tape = rotations.owner();
  const Var<S> transforms =
      tape.record(KinematicChain<S>{std::move(parents), std::move(rest_joints)}, std::array{rotations, transl},
                  std::array{shape_of(rows, 12), shape_of(rows, 3)}, where);
  return {transforms, tape.output(transforms, 1)};
}

template <class S>
PosedSkeleton<S> kinematic_chain(Var<S> rotations, Var<S> transl, std::vector<int> parents, Var<S> rest_joints,
                                 Source where) {
  std::vector<double> rest(3 * parents.size());
  check_skeleton(parents, rest);
  const Index frames = transl.shape().rows, joints = static_cast<Index>(parents.size()), rows = frames * joints;
  HSI4D_CHECK_EQ(rotations.shape(), shape_of(rows, 9));
  HSI4D_CHECK_EQ(transl.shape(), shape_of(frames, 3));
  HSI4D_CHECK_EQ(rest_joints.shape(), shape_of(joints, 3));
  Tape<S>& tape = rotations.owner();
  const Var<S> transforms =
      tape.record(KinematicChain<S>{std::move(parents), std::move(rest)}, std::array{rotations, transl, rest_joints},
                  std::array{shape_of(rows, 12), shape_of(rows, 3)}, where);
  return {transforms, tape.output(transforms, 1)};
}

PosedJoints pose_skeleton(std::span<const int> parents, std::span<const double> rest_joints, const BodyPose& pose) {
  check_skeleton(parents, rest_joints);
  HSI4D_CHECK_EQ(pose.axis_angle.size(), 3 * parents.size());
  std::vector<double> rotations(9 * parents.size());
  for (std::size_t j = 0; j < parents.size(); ++j) {
    const Matrix r = so3_exp(pose.rotation_of(static_cast<Index>(j)));
    for (int row = 0; row < 3; ++row) {
      for (int c = 0; c < 3; ++c) rotations[9 * j + static_cast<std::size_t>(3 * row + c)] = r(row, c);
    }
  }
  std::vector<Pose> poses(parents.size());
  run_chain(parents, rest_joints.data(), rotations.data(), poses.data());
  PosedJoints posed{std::vector<double>(12 * parents.size()), std::vector<double>(3 * parents.size())};
  for (std::size_t j = 0; j < parents.size(); ++j) {
    put_joint(poses[j], vector_at(rest_joints.data() + 3 * j), pose.transl, posed.transforms.data() + 12 * j,
              posed.joints.data() + 3 * j);
  }
  return posed;
}

PosedJoints pose_skeleton(const BodyModel& body, const BodyPose& pose) {
  return pose_skeleton(body.parents, body.joints, pose);
}

std::vector<double> pose_joints(std::span<const int> parents, std::span<const double> rest_joints,
                                const BodyPose& pose) {
  return pose_skeleton(parents, rest_joints, pose).joints;
}

std::vector<double> pose_joints(const BodyModel& body, const BodyPose& pose) {
  return pose_joints(body.parents, body.joints, pose);
}

#define HSI4D_INSTANTIATE(S)                                                                                \
  template PosedSkeleton<S> kinematic_chain(Var<S>, Var<S>, std::vector<int>, std::vector<double>, Source); \
  template PosedSkeleton<S> kinematic_chain(Var<S>, Var<S>, std::vector<int>, Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
