// Metrics: how far an estimate is from the truth. Plain functions in double, without a tape.
//
// A metric's name is the one that summary.json has (the units are part of it). Joints are plain arrays [J,3] in metres,
// world frame, joint 0 the pelvis, in the order of SMPL-X. Body errors are means over the first 22 joints (all of the
// body, no jaw, eyes and fingers), or over all where there are fewer.
//
// A number that is not finite in an input gives NaN; the writer of summary.json refuses it by name. Functions that take
// two arrays throw InternalError where their sizes differ or nothing is left to measure, unless they say otherwise.
#pragma once

#include <optional>
#include <span>

#include "core/image.h"
#include "core/linear.h"
#include "core/rigid.h"
#include "core/types.h"

namespace hsi4d {

/// In a metre: errors are told in these.
inline constexpr double kMillimetres = 1000, kCentimetres = 100;

/// Joints that count: pelvis to wrists.
inline constexpr Index kMetricJoints = 22;

/// Mean joint error with both pelvises at the origin, 1000/J Σ |(x̂ⱼ − x̂₀) − (xⱼ − x₀)|: pose and heading, not place.
///
/// @param joints, truth  [J,3] metres
/// @return               millimetres
double mpjpe_mm(std::span<const double> joints, std::span<const double> truth);

/// Mean joint error after the similarity that fits the estimate to the truth best in least squares: pose alone.
///
///   min over s ≥ 0, R, t of Σ |s R x̂ⱼ + t − xⱼ|²   [Umeyama 1991, eqs. 40-42]
///
/// R is a rotation, never a reflection. Where the estimate is one point, it is put on the truth's mean.
///
/// @param joints, truth  [J,3] metres
/// @return               millimetres
double pa_mpjpe_mm(std::span<const double> joints, std::span<const double> truth);

/// Mean joint error as it is, 1000/J Σ |x̂ⱼ − xⱼ|.
///
/// @param joints, truth  [J,3] metres
/// @return               millimetres
double world_mpjpe_mm(std::span<const double> joints, std::span<const double> truth);

/// The two parts of the world error as a camera sees it, e = R (x̂ⱼ − xⱼ).
struct WorldErrorParts {
  double image_mm = 0;  ///< across the view: 1000/J Σ |(e_x, e_y)|
  double depth_mm = 0;  ///< along the camera's z: 1000/J Σ |e_z|
};

/// @param joints, truth      [J,3] metres
/// @param camera_from_world  rotation of the true camera
WorldErrorParts world_error_parts(std::span<const double> joints, std::span<const double> truth,
                                  const Matrix3<double>& camera_from_world);

/// Distance of the pelvises, in millimetres.
double root_translation_mm(std::span<const double> joints, std::span<const double> truth);

/// Angle of the rotation between two, |log(Aᵀ B)|, as accurate near 0 and 180 as anywhere.
///
/// @return  degrees, 0 to 180
double rotation_error_deg(const Matrix3<double>& a, const Matrix3<double>& b);

/// As above for axis-angle vectors, radians.
double rotation_error_deg(const Vector3<double>& a, const Vector3<double>& b);

/// Errors of a pose in space.
struct PoseError {
  double translation_cm = 0;
  double rotation_deg = 0;
};

/// Distance of the camera centres −Rᵀ t, and angle between the rotations.
///
/// @param camera, truth  camera_from_world
PoseError camera_error(const Rigid<double>& camera, const Rigid<double>& truth);

/// Distance of the translations (of the objects' centroids, where poses act about them), and angle between the
/// rotations.
///
/// @param object, truth  world_from_object
PoseError object_error(const Rigid<double>& object, const Rigid<double>& truth);

/// What images that are (nearly) equal get: the mean squared difference is held at 1e-10, since the logarithm of 0 is
/// no number that JSON or a mean over frames could hold.
inline constexpr double kLargestPsnrDb = 100;

/// Peak signal-to-noise ratio, −10 log10 of the mean squared difference, for values in [0, 1]; at most kLargestPsnrDb.
///
/// @param image, target  [C,H,W]; not clamped
double psnr_db(const Image& image, const Image& target);

/// As above over a part of the image: Σ w d² / (C Σ w).
///
/// @param weight  [1,H,W], each ≥ 0; a mask, soft or hard
/// @return        nothing where the weights are all zero
std::optional<double> psnr_db(const Image& image, const Image& target, const Image& weight);

/// Intersection over union of what two masks cover from ½ on.
///
/// @param mask, truth  [1,H,W]
/// @return             nothing where `truth` covers nothing
std::optional<double> mask_iou(const Image& mask, const Image& truth);

/// Mean structural similarity, of all channels and pixels (autodiff/ssim.h), for values in [0, 1].
///
/// @param image, target  [C,H,W]
double image_ssim(const Image& image, const Image& target);

/// Mean size of the third difference of the joints' places times rate³: how much a motion trembles.
///
///   1/(J (T−3)) Σ_t Σ_j |x_{t+3} − 3 x_{t+2} + 3 x_{t+1} − x_t| · rate³
///
/// @param joints  [T][J,3] metres, each frame the same J
/// @param rate    frames a second
/// @return        m/s³; nothing for fewer than four frames
std::optional<double> jitter(std::span<const std::span<const double>> joints, double rate);

}  // namespace hsi4d
