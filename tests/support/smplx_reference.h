// Body models in the layout of SMPL-X files, made up or real, and what a body is in a pose by plain loops in double
// that share no code with the library.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/npz.h"

namespace hsi4d::test {

/// The arrays of a file; J = 55. Empty: not in the file.
struct SmplxArrays {
  std::int64_t vertices = 0, columns = 20;                         ///< V, C of shapedirs
  std::vector<double> v_template;                                  ///< [V,3]
  std::vector<std::int64_t> f;                                     ///< [F,3]
  std::vector<std::int64_t> parents;                               ///< [55], −1 for the root
  std::vector<double> shapedirs;                                   ///< [V,3,C]
  std::vector<double> regressor;                                   ///< [55,V]
  std::vector<double> weights;                                     ///< [V,55]
  std::vector<double> posedirs;                                    ///< [V,3,486]
  std::vector<double> j_template;                                  ///< [55,3]
  std::vector<double> j_shapedirs;                                 ///< [55,3,D]
  std::array<std::vector<double>, 2> hand_means, hand_components;  ///< [45], [45,45]
};

/// How a random model is made.
struct RandomSmplx {
  std::int64_t vertices = 60;
  std::int64_t columns = 20;
  bool correctives = true;
  double corrective_size = 0.005;  ///< metres, largest number of posedirs
  int weights_per_vertex = 4;
  std::uint64_t seed = 1;
};
SmplxArrays random_smplx(const RandomSmplx& options = {});

/// A file of these arrays, which are added in the order of the struct; float64.
NpzWriter smplx_writer(const SmplxArrays& arrays);

/// The body of the data folder, or nothing where it is missing; the path is set in both cases.
std::optional<SmplxArrays> makehuman_arrays(std::string& path);

/// Parameters as the public implementation names them. C: double, or std::complex<double> for derivatives by complex
/// step.
template <class C>
struct SmplxPoseOf {
  std::vector<C> betas, expression;
  std::vector<C> axis_angle;  ///< [55,3], hands as they are: with their mean
  std::array<C, 3> transl{};
};
using SmplxPose = SmplxPoseOf<double>;
/// A random pose; angles up to 2.5 rad.
SmplxPose random_smplx_pose(int betas, int expressions, std::uint64_t seed);

template <class C>
struct SmplxResultOf {
  std::vector<C> vertices;  ///< [V,3]
  std::vector<C> joints;    ///< [55,3]
};
using SmplxResult = SmplxResultOf<double>;
template <class C>
SmplxResultOf<C> reference_smplx(const SmplxArrays& arrays, const SmplxPoseOf<C>& pose);
/// As reference_smplx, where rotations are matrices [55,3,3] and the pose's axis_angle is not looked at.
template <class C>
SmplxResultOf<C> reference_smplx(const SmplxArrays& arrays, const SmplxPoseOf<C>& pose,
                                 const std::vector<std::array<std::array<C, 3>, 3>>& rotations);

/// Rotation matrices [55,3,3] of a pose by Rodrigues' formula.
template <class C>
std::vector<std::array<std::array<C, 3>, 3>> reference_rotations(const SmplxPoseOf<C>& pose);

}  // namespace hsi4d::test
