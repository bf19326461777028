#include "optim/metrics.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace metrics_test {

using namespace hsi4d;
using Points = std::vector<double>;

namespace {

constexpr double kDegree = std::numbers::pi / 180;

Points random_points(Index count, unsigned seed, double extent = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-extent, extent);
  Points points(static_cast<size_t>(3 * count));
  for (double& x : points) x = place(random);
  return points;
}

/// s R x + t of every point.
Points moved(const Points& points, const Rigid<double>& transform, double scale = 1) {
  Points out(points.size());
  for (size_t j = 0; j < points.size(); j += 3) {
    const Vector3<double> p = Vector3<double>(points[j], points[j + 1], points[j + 2]) * scale;
    const Vector3<double> q = transform_point(transform, p);
    for (size_t i = 0; i < 3; ++i) out[j + i] = q[static_cast<Index>(i)];
  }
  return out;
}

Rigid<double> some_transform() { return {so3_exp(Vector3<double>(0.4, -1.1, 0.7)), Vector3<double>(3, -2, 0.5)}; }

Image filled(int channels, int height, int width, float value) {
  Image image(channels, height, width);
  for (int c = 0; c < channels; ++c)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) image(c, y, x) = value;
  return image;
}

}  // namespace

TEST_CASE("masks are compared where they cover half of a pixel") {
  Image mask(1, 4, 5), truth(1, 4, 5);
  CHECK_FALSE(mask_iou(mask, truth));
  for (int x = 0; x < 4; ++x) truth(0, 1, x) = 1;
  CHECK(*mask_iou(mask, truth) == 0);
  for (int x = 2; x < 5; ++x) mask(0, 1, x) = 0.5F;
  mask(0, 3, 0) = 0.49F;
  CHECK(*mask_iou(mask, truth) == Approx(2.0 / 5));
  CHECK(*mask_iou(truth, truth) == 1);
  CHECK_THROWS_AS(mask_iou(Image(1, 4, 4), truth), InternalError);
}

TEST_CASE("joint errors have the values of a pencil and paper") {
  // Pelvis off by (0.3, 0, 0.4), the second joint by (0.3, 0, 0.4) + (0, 0.06, 0).
  const Points truth = {0, 0, 1, 0, 0, 2};
  const Points joints = {0.3, 0, 1.4, 0.3, 0.06, 2.4};
  CHECK(mpjpe_mm(joints, truth) == Approx(30));
  CHECK(root_translation_mm(joints, truth) == Approx(500));
  CHECK(world_mpjpe_mm(joints, truth) == Approx((500 + 1000 * std::sqrt(0.09 + 0.0036 + 0.16)) / 2));
  const WorldErrorParts plain = world_error_parts(joints, truth, Matrix3<double>::Identity());
  CHECK(plain.image_mm == Approx((300 + 1000 * std::sqrt(0.09 + 0.0036)) / 2));
  CHECK(plain.depth_mm == Approx(400));
  Matrix3<double> along_x;  // a camera that looks along the world's x
  along_x << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const WorldErrorParts turned = world_error_parts(joints, truth, along_x);
  CHECK(turned.depth_mm == Approx(300));
  CHECK(turned.image_mm == Approx((400 + 1000 * std::sqrt(0.0036 + 0.16)) / 2));
}

TEST_CASE("only the joints of the body count") {
  const Points truth = random_points(55, 1);
  Points joints = truth;
  for (size_t i = 3 * kMetricJoints; i < joints.size(); ++i) joints[i] += 10;  // jaw, eyes and fingers
  CHECK(mpjpe_mm(joints, truth) == 0);
  CHECK(world_mpjpe_mm(joints, truth) == 0);
  CHECK(pa_mpjpe_mm(joints, truth) == Approx(0).margin(1e-9));
  joints[3 * kMetricJoints - 1] += 0.022;  // the last that does
  CHECK(mpjpe_mm(joints, truth) == Approx(1));
}

TEST_CASE("moving estimate and truth alike changes no error of the body") {
  const Points truth = random_points(22, 2), joints = random_points(22, 3);
  const Rigid<double> by = some_transform();
  const Points truth_moved = moved(truth, by), joints_moved = moved(joints, by);
  CHECK(mpjpe_mm(joints_moved, truth_moved) == Approx(mpjpe_mm(joints, truth)));
  CHECK(pa_mpjpe_mm(joints_moved, truth_moved) == Approx(pa_mpjpe_mm(joints, truth)));
  CHECK(world_mpjpe_mm(joints_moved, truth_moved) == Approx(world_mpjpe_mm(joints, truth)));
  CHECK(root_translation_mm(joints_moved, truth_moved) == Approx(root_translation_mm(joints, truth)));
  const Matrix3<double> view = so3_exp(Vector3<double>(1, 2, 3));
  const WorldErrorParts before = world_error_parts(joints, truth, view);
  const WorldErrorParts after =
      world_error_parts(joints_moved, truth_moved, Matrix3<double>(view * by.rotation.transpose()));
  CHECK(after.image_mm == Approx(before.image_mm));
  CHECK(after.depth_mm == Approx(before.depth_mm));
}

TEST_CASE("a shift leaves the root-relative error, a turn does not") {
  const Points truth = random_points(22, 4);
  CHECK(mpjpe_mm(moved(truth, {Matrix3<double>::Identity(), Vector3<double>(1, 2, 3)}), truth) ==
        Approx(0).margin(1e-9));
  CHECK(mpjpe_mm(moved(truth, some_transform()), truth) > 100);
}

TEST_CASE("no similarity is an error after Procrustes alignment, at any extent") {
  for (const double extent : {1e-9, 1.0, 1e6}) {
    const Points truth = random_points(22, 5, extent);
    Rigid<double> by = some_transform();
    by.translation *= extent;
    CHECK(pa_mpjpe_mm(moved(truth, by, 0.37), truth) / extent == Approx(0).margin(1e-9));
  }
  const Points truth = random_points(22, 5);
  for (unsigned seed = 10; seed < 20; ++seed) {
    const Points joints = random_points(22, seed);
    CHECK(pa_mpjpe_mm(moved(joints, some_transform(), 2.5), truth) == Approx(pa_mpjpe_mm(joints, truth)));
  }
}

TEST_CASE("the alignment has the scale and rotation of least squares") {
  // x = ±e1, y = ±2 e2 ± a bit: best scale 2, one rotation of 90 degrees; the residual is what is left across.
  const Points joints = {1, 0, 0, -1, 0, 0, 0, 0, 0};
  const Points truth = {0, 2, 0, 0, -2, 0, 0, 0, 0.3};
  // The truth's mean is (0, 0, 0.1); residuals along z: -0.1, -0.1, 0.2.
  CHECK(pa_mpjpe_mm(joints, truth) == Approx(1000 * (0.1 + 0.1 + 0.2) / 3));
}

TEST_CASE("a mirror image is not aligned by a reflection") {
  const Points truth = random_points(22, 8);
  Points mirrored = truth;
  for (size_t j = 0; j < mirrored.size(); j += 3) mirrored[j] = -mirrored[j];
  CHECK(pa_mpjpe_mm(mirrored, truth) > 100);
  // In a plane a half turn does what the mirror does.
  Points flat = truth;
  for (size_t j = 2; j < flat.size(); j += 3) flat[j] = 0;
  Points flat_mirrored = flat;
  for (size_t j = 0; j < flat.size(); j += 3) flat_mirrored[j] = -flat[j];
  CHECK(pa_mpjpe_mm(flat_mirrored, flat) == Approx(0).margin(1e-9));
}

TEST_CASE("degenerate sets have a Procrustes error") {
  const Points truth = {1, 0, 0, 3, 0, 0};
  const Points one_place = {5, 5, 5, 5, 5, 5};
  CHECK(pa_mpjpe_mm(one_place, truth) == Approx(1000));  // put on the mean
  CHECK(pa_mpjpe_mm(truth, one_place) == 0);             // shrunk to a point
  CHECK(pa_mpjpe_mm(one_place, one_place) == 0);
  CHECK(pa_mpjpe_mm(Points{1, 2, 3}, Points{4, 5, 6}) == 0);
  const Points line = {0, 0, 0, 0, 0, 1, 0, 0, 2, 0, 0, 5};
  CHECK(pa_mpjpe_mm(moved(line, some_transform(), 3), line) == Approx(0).margin(1e-9));
  CHECK(pa_mpjpe_mm(Points{0, 0, 0, 0, 0, -1, 0, 0, -2, 0, 0, -5}, line) == Approx(0).margin(1e-9));
}

TEST_CASE("numbers that are not finite give NaN, never a plausible error") {
  const Points truth = random_points(22, 9);
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    Points joints = truth;
    joints[4] = bad;
    CHECK_FALSE(std::isfinite(mpjpe_mm(joints, truth)));
    CHECK_FALSE(std::isfinite(pa_mpjpe_mm(joints, truth)));
    CHECK_FALSE(std::isfinite(pa_mpjpe_mm(truth, joints)));
    CHECK_FALSE(std::isfinite(world_mpjpe_mm(joints, truth)));
    CHECK_FALSE(std::isfinite(rotation_error_deg(Vector3<double>(bad, 0, 0), Vector3<double>(0, 0, 0))));
    Image image = filled(3, 2, 2, 0.5F);
    image(1, 0, 1) = static_cast<float>(bad);
    CHECK_FALSE(psnr_db(image, filled(3, 2, 2, 0.5F)) > 0);
  }
}

TEST_CASE("arrays of different sizes are a bug of the caller") {
  CHECK_THROWS_AS(mpjpe_mm(Points(6), Points(9)), InternalError);
  CHECK_THROWS_AS(world_mpjpe_mm(Points(4), Points(4)), InternalError);
  CHECK_THROWS_AS(pa_mpjpe_mm(Points(), Points()), InternalError);
  CHECK_THROWS_AS(psnr_db(Image(3, 2, 2), Image(3, 2, 3)), InternalError);
  CHECK_THROWS_AS(psnr_db(Image(), Image()), InternalError);
  CHECK_THROWS_AS(psnr_db(Image(3, 2, 2), Image(3, 2, 2), Image(3, 2, 2)), InternalError);
  CHECK_THROWS_AS(image_ssim(Image(3, 2, 2), Image(1, 2, 2)), InternalError);
}

TEST_CASE("the angle between rotations is accurate near 0 and 180 degrees") {
  const Vector3<double> axis = Vector3<double>(1, -2, 0.5).normalized();
  const Matrix3<double> base = so3_exp(Vector3<double>(0.3, 0.2, -2));
  for (const double angle : {0.0, 1e-12, 1e-7, 1e-3, 1.0, 90.0, 179.0, 179.9999, 180.0}) {
    INFO(angle);
    const Matrix3<double> other = base * so3_exp(Vector3<double>(axis * angle * kDegree));
    CHECK(rotation_error_deg(base, other) == Approx(angle).margin(1e-13).epsilon(1e-9));
    CHECK(rotation_error_deg(other, base) == Approx(angle).margin(1e-13).epsilon(1e-9));
  }
  CHECK(rotation_error_deg(Vector3<double>(0, 0, 10 * kDegree), Vector3<double>(0, 0, 350 * kDegree)) == Approx(20));
  CHECK(rotation_error_deg(Vector3<double>(0, 0, 0.5), Vector3<double>(0, 0, 0.5)) == Approx(0).margin(1e-12));
}

TEST_CASE("cameras differ by the distance of their centres and their turn") {
  Rigid<double> truth = {so3_exp(Vector3<double>(0, 0, 1)), Vector3<double>(0.1, 0.2, 4)};
  // Turned about its own centre: R' = D R, t' = D t.
  const Matrix3<double> turn = so3_exp(Vector3<double>(0, 3 * kDegree, 0));
  const PoseError turned = camera_error({turn * truth.rotation, turn * truth.translation}, truth);
  CHECK(turned.translation_cm == Approx(0).margin(1e-12));
  CHECK(turned.rotation_deg == Approx(3));
  // The centre shifted by 5 cm: t' = t − R d.
  const Vector3<double> shift(0.03, 0, 0.04);
  const PoseError shifted = camera_error({truth.rotation, truth.translation - truth.rotation * shift}, truth);
  CHECK(shifted.translation_cm == Approx(5));
  CHECK(shifted.rotation_deg == Approx(0).margin(1e-12));
  const PoseError object = object_error({turn * truth.rotation, truth.translation + shift}, truth);
  CHECK(object.translation_cm == Approx(5));
  CHECK(object.rotation_deg == Approx(3));
}

TEST_CASE("psnr has the values of its formula") {
  const Image half = filled(3, 4, 5, 0.5F);
  CHECK(psnr_db(filled(3, 4, 5, 0.75F), half) == Approx(-10 * std::log10(0.0625)));
  CHECK(psnr_db(half, half) == kLargestPsnrDb);
  CHECK(psnr_db(filled(3, 4, 5, 1.5F), half) == Approx(0).margin(1e-12));  // values are not clamped
  Image one_pixel = half;
  one_pixel(2, 3, 4) = 1;  // one of 60 numbers, the last in memory
  CHECK(psnr_db(one_pixel, half) == Approx(-10 * std::log10(0.25 / 60)));
}

TEST_CASE("psnr under a mask sees what the mask shows") {
  const Image half = filled(3, 4, 5, 0.5F);
  Image other = half;
  other(0, 1, 1) = 0.7F;
  other(1, 2, 2) = std::numeric_limits<float>::infinity();  // hidden
  Image mask(1, 4, 5);
  CHECK_FALSE(psnr_db(other, half, mask).has_value());
  mask(0, 1, 1) = 1;
  CHECK(psnr_db(other, half, mask).value() == Approx(-10 * std::log10(0.04 / 3)).epsilon(1e-6));
  mask(0, 0, 0) = 0.5F;  // as right as can be, with half a pixel's weight
  CHECK(psnr_db(other, half, mask).value() == Approx(-10 * std::log10(0.04 / 4.5)).epsilon(1e-6));
  CHECK(psnr_db(half, half, mask).value() == kLargestPsnrDb);
  CHECK(psnr_db(filled(3, 4, 5, 0.6F), half, filled(1, 4, 5, 0.3F)).value() ==
        Approx(psnr_db(filled(3, 4, 5, 0.6F), half)));
}

TEST_CASE("structural similarity is 1 for equal images and falls with noise") {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> value(0, 1);
  Image image(3, 24, 30);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 30; ++x) image(c, y, x) = value(random);
  CHECK(image_ssim(image, image) == 1);
  Image noisy = image, noisier = image;
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 30; ++x) {
        noisy(c, y, x) += 0.1F * (value(random) - 0.5F);
        noisier(c, y, x) += 0.8F * (value(random) - 0.5F);
      }
  CHECK(image_ssim(noisy, image) < 1);
  CHECK(image_ssim(noisier, image) < image_ssim(noisy, image));
}

TEST_CASE("jitter is the third derivative of the motion") {
  const double rate = 10;
  const auto motion = [](auto place, size_t frames) {
    std::vector<Points> points;
    for (size_t t = 0; t < frames; ++t) points.push_back({place(t), 0, 7, 100 + place(t), 1, 1});
    return points;
  };
  const auto jitter_of = [rate](const std::vector<Points>& frames) {
    const std::vector<std::span<const double>> views(frames.begin(), frames.end());
    return jitter(views, rate);
  };
  // x = t³/2 with t in seconds has the third derivative 3.
  const auto cubic = [rate](size_t t) { return std::pow(static_cast<double>(t) / rate, 3) / 2; };
  CHECK(jitter_of(motion(cubic, 8)).value() == Approx(3));
  const auto parabola = [](size_t t) { return 0.25 * static_cast<double>(t * t); };  // exact in binary
  CHECK(jitter_of(motion(parabola, 5)).value() == 0);
  // One joint stands, the other jumps by 1 in the last of four frames.
  std::vector<Points> jump(4, Points{0, 0, 0, 0, 0, 0});
  jump[3][1] = 1;
  CHECK(jitter_of(jump).value() == Approx(1000.0 / 2));
  CHECK_FALSE(jitter_of(motion(cubic, 3)).has_value());
  std::vector<Points> uneven(4, Points(6));
  uneven[2] = Points(9);
  CHECK_THROWS_AS(jitter_of(uneven), InternalError);
}

}  // namespace metrics_test
