// Rows D: skinning, priors, contacts. Here skinning; the others are in body_robustness.cpp.
#include <array>
#include <cmath>

#include <Eigen/SVD>

#include "autodiff/rotations.h"
#include "body/blend_shapes.h"
#include "body/skinning.h"
#include "core/angles.h"
#include "core/check.h"
#include "core/random.h"
#include "splat/reference/reference.h"
#include "splat/render/render.h"
#include "stress/rotation_measures.h"
#include "stress/rows.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

namespace {

std::vector<double> uniform_numbers(Index count, std::string_view stream) {
  const Random random(1, random_stream(stream));
  std::vector<double> numbers;
  for (Index i = 0; i < count; ++i) numbers.push_back(random.uniform(static_cast<std::uint64_t>(i), -1, 1));
  return numbers;
}

/// Four weights for each vertex that sum to 0.991 to 1.009, as quantised ones do.
SparseWeights rounded_weights(Index vertices, Index joints) {
  RandomSequence random(17, random_stream("stress.D1"));
  SparseWeights w{vertices, joints, 4, {}, {}};
  for (Index v = 0; v < vertices; ++v) {
    std::array<double, 4> row;
    for (double& x : row) x = random.uniform(0.1, 1);
    const double scale = random.uniform(0.991, 1.009) / (row[0] + row[1] + row[2] + row[3]);
    for (const double x : row) {
      w.weights.push_back(x * scale);
      w.indices.push_back(static_cast<std::int32_t>(random.below(static_cast<std::uint64_t>(joints))));
    }
  }
  return w;
}

/// Σ w_k A_k (x, 1) with the weights as they are.
template <class S>
std::vector<S> plain_skinning(const SparseWeights& w, const std::vector<S>& transforms, const std::vector<S>& points) {
  std::vector<S> y(points.size());
  for (std::size_t v = 0; v < static_cast<std::size_t>(w.vertices); ++v) {
    for (std::size_t k = 4 * v; k < 4 * v + 4; ++k) {
      const S weight = static_cast<S>(w.weights[k]);
      const S* a = &transforms[12 * static_cast<std::size_t>(w.indices[k])];
      const S* x = &points[3 * v];
      for (std::size_t i = 0; i < 3; ++i) {
        y[3 * v + i] += weight * (a[4 * i] * x[0] + a[4 * i + 1] * x[1] + a[4 * i + 2] * x[2] + a[4 * i + 3]);
      }
    }
  }
  return y;
}

template <class S>
std::vector<S> skinned(Remedy remedy, const SparseWeights& raw, const std::vector<double>& transforms,
                       const std::vector<double>& points) {
  const std::vector<S> a(transforms.begin(), transforms.end()), x(points.begin(), points.end());
  if (remedy == Remedy::kOff) return plain_skinning(raw, a, x);
  std::vector<S> y(x.size());
  skin_points(SkinWeights<S>(normalized_weights(raw, "weights")), a.data(), x.data(), y.data());
  return y;
}

// --- D2

using Frame = Matrix3<double>;

/// Of two bones that count alike, the first at rest: the second, turned about x.
Frame second_bone(double angle) { return axis_turn(Vector3<double>::UnitX(), angle); }

/// A frame on these bones: the loss Σ c ∘ F', and its gradient by the second bone.
struct BlendedFrame {
  Frame frame;
  double loss = 0;
  Frame d_bone = Frame::Zero();
};

std::vector<double> rows_of(const Frame& a) {
  return {a(0, 0), a(0, 1), a(0, 2), 0, a(1, 0), a(1, 1), a(1, 2), 0, a(2, 0), a(2, 1), a(2, 2), 0};
}

double sum_of_products(const Frame& a, const Frame& b) { return a.cwiseProduct(b).sum(); }

BlendedFrame blended_linearly(const Frame& bone, const Frame& f, const Frame& c) {
  const SkinWeights<double> weights(SparseWeights{1, 2, 2, {0, 1}, {0.5, 0.5}});
  Tape<double> tape;
  const Var<double> a = tape.parameter("transforms", shape_of(2, 12));
  const Var<double> frames = tape.constant("frames", shape_of(1, 9));
  std::vector<double> transforms = rows_of(Frame::Identity());
  const std::vector<double> second = rows_of(bone);
  transforms.insert(transforms.end(), second.begin(), second.end());
  tape.set(a, transforms);
  const auto rows = [](const Frame& m) {
    std::vector<double> numbers;
    for (int i = 0; i < 9; ++i) numbers.push_back(m(i / 3, i % 3));
    return numbers;
  };
  tape.set(frames, rows(f));
  const Var<double> posed = skin_frames(weights, a, tape.constant("points", shape_of(1, 3)), frames).frames;
  tape.forward(posed);
  tape.backward(posed, rows(c));
  BlendedFrame result;
  for (int i = 0; i < 9; ++i) {
    result.frame(i / 3, i % 3) = tape.value(posed).data[i];
    result.d_bone(i / 3, i % 3) = tape.gradient(a)(1, 4 * (i / 3) + i % 3);
  }
  result.loss = sum_of_products(c, result.frame);
  return result;
}

/// With the rotation next to the blend, U Vᵀ of its singular values s, in which d_B = U [(X − Xᵀ)/(s_i + s_j)] Vᵀ with
/// X = Uᵀ d_R V.
BlendedFrame blended_by_rotation(const Frame& bone, const Frame& f, const Frame& c) {
  const Frame blend = 0.5 * (Frame::Identity() + bone);
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(blend, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Frame u = svd.matrixU(), v = svd.matrixV();
  const Frame rotation = u * v.transpose(), x = u.transpose() * (c * f.transpose()) * v;
  Frame inner;
  for (int i = 0; i < 9; ++i) {
    const double sum = svd.singularValues()[i / 3] + svd.singularValues()[i % 3];
    inner(i / 3, i % 3) = i / 3 == i % 3 ? 0 : (x(i / 3, i % 3) - x(i % 3, i / 3)) / sum;
  }
  return {rotation * f, sum_of_products(c, rotation * f), 0.5 * u * inner * v.transpose()};
}

Camera flat_camera() {
  Camera camera;
  camera.width = camera.height = 32;
  camera.fx = camera.fy = 40;
  camera.cx = camera.cy = 16;
  return camera;
}

/// Largest difference of the image of a Gaussian with these axes, 1 m away, to that by brute force under the blend.
double flat_image_error(const Frame& axes, const Frame& bone, int& broken) {
  SplatView view;
  view.camera = flat_camera();
  Tape<float> tape;
  SplatInputs<float> in = {tape.parameter("means", shape_of(1, 3)), tape.parameter("axes", shape_of(1, 9)),
                           tape.constant("opacities", shape_of(1, 1)), tape.constant("colors", shape_of(1, 3))};
  tape.set(in.means, {0, 0, 1});
  Eigen::Matrix<double, 9, 1> rows;
  for (int i = 0; i < 9; ++i) rows[i] = axes(i / 3, i % 3);
  const Eigen::Matrix<float, 9, 1> single = narrow(rows);
  tape.set(in.axes, std::span<const float>(single.data(), 9));
  tape.set(in.opacities, {0.5f});
  tape.set(in.colors, {1, 1, 1});
  const Var<float> image =
      render(in, tape.constant("xi", shape_of(1, 6)), tape.constant("black", shape_of(1, 3)), view).image;
  tape.forward(image);
  tape.backward(image, std::vector<float>(static_cast<std::size_t>(image.shape().count()), 1));
  for (int i = 0; i < 9; ++i) broken += std::isfinite(tape.gradient(in.axes).data[i]) ? 0 : 1;

  reference::Scene<double> scene;
  scene.n = 1;
  scene.means = {0, 0, 0};
  scene.quats = {1, 0, 0, 0};
  scene.log_scales = {std::log(0.2), std::log(0.15), std::log(0.1)};
  scene.opacity_logits = {0};
  scene.sh.assign(3, 0.5 / 0.28209479177387814);  // colour 1
  scene.transforms = rows_of(0.5 * (Frame::Identity() + bone));
  scene.transforms[11] = 1;
  reference::Pinhole<double> camera{32, 32, 40, 40, 16, 16, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
  const reference::Image<double> truth = reference::render(scene, camera, {0, 0, 0}, view.settings);
  double error = 0;
  for (Index p = 0; p < 32 * 32; ++p) {
    const double found = static_cast<double>(tape.value(image)(0, p / 32, p % 32));
    error = larger(error, std::abs(found - truth.color[static_cast<std::size_t>(3 * p)]));
  }
  return error;
}

}  // namespace

/// D1: the rest pose is its template, and a pose moved by a kilometre is the pose, a kilometre away.
std::vector<StressFigure> weight_sums(Remedy remedy) {
  constexpr Index kVertices = 300, kJoints = 5;
  const SparseWeights raw = rounded_weights(kVertices, kJoints);
  const std::vector<double> points = uniform_numbers(3 * kVertices, "stress.D1.points");
  std::vector<double> rest;
  for (Index j = 0; j < kJoints; ++j) rest.insert(rest.end(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
  const std::vector<double> posed = uniform_numbers(12 * kJoints, "stress.D1.pose");
  std::vector<double> moved = posed;
  for (std::size_t i = 3; i < moved.size(); i += 4) moved[i] += 1000;
  const std::vector<float> at_rest = skinned<float>(remedy, raw, rest, points);
  const std::vector<double> here = skinned<double>(remedy, raw, posed, points);
  const std::vector<double> there = skinned<double>(remedy, raw, moved, points);
  double template_error = 0, drift = 0, accepted = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    template_error = larger(template_error, std::abs(static_cast<double>(at_rest[i]) - points[i]));
    drift = larger(drift, std::abs(there[i] - here[i] - 1000));
  }
  SparseWeights wrong = raw;
  for (std::size_t k = 0; k < 4; ++k) wrong.weights[k] *= 0.97;
  try {
    skinned<double>(remedy, wrong, rest, points);
    ++accepted;
  } catch (const DataError&) {
  }
  return {{"rest pose off its template, m", template_error, 1e-6},
          {"pose moved by 1 km off itself, m", drift, 1e-5},
          {"sums beyond 1 % accepted", accepted, 0}};
}

/// D2: two bones at half a turn, where the blend has rank 1.
std::vector<StressFigure> opposite_bones(Remedy remedy) {
  const auto blended = remedy == Remedy::kOn ? blended_linearly : blended_by_rotation;
  const Frame f = Vector3<double>(0.2, 0.15, 0.1).asDiagonal();
  Frame c;
  const std::vector<double> numbers = uniform_numbers(9, "stress.D2");
  for (int i = 0; i < 9; ++i) c(i / 3, i % 3) = numbers[static_cast<std::size_t>(i)];
  const Frame before = blended(second_bone(kPi - 1e-6), f, c).frame;
  const double jump = largest(Frame(blended(second_bone(kPi + 1e-6), f, c).frame - before)) / 0.2;
  const BlendedFrame at = blended(second_bone(kPi), f, c);
  double gradient = 0;
  for (int i = 0; i < 9; ++i) {
    Frame above = second_bone(kPi), below = above;
    above(i / 3, i % 3) += 1e-4;
    below(i / 3, i % 3) -= 1e-4;
    const double slope = (blended(above, f, c).loss - blended(below, f, c).loss) / 2e-4;
    gradient = larger(gradient, std::abs(at.d_bone(i / 3, i % 3) - slope) / 0.1);
  }
  int broken = 0;
  const double image = flat_image_error(at.frame, second_bone(kPi), broken);
  return {{"jump of axes as a bone turns by 2e-6 rad, share", jump, 3e-6},
          {"gradient off differences, of 0.1 m", gradient, 1e-11},
          {"flat Gaussian's image off brute force", image, 5e-7},
          {"gradients of the image that are not finite", static_cast<double>(broken), 0}};
}

/// D3: R − I of small rotations in float, each entry against its series.
std::vector<StressFigure> small_offsets(Remedy remedy) {
  double error = 0;
  for (const double size : {1e-8, 1e-6, 1e-4, 1e-2}) {
    const Vector3<float> w = narrow(Vector3<double>(0.3 * size, -size, 0.7 * size));
    Tape<float> tape;
    const Var<float> x = leaf(tape, "w", shape_of(1, 3), {w[0], w[1], w[2]});
    const Var<float> offsets =
        remedy == Remedy::kOn ? rotation_offsets_from_axis_angle(x) : rotation_offsets(rotations_from_axis_angle(x));
    tape.forward(offsets);
    const Vector3<double> exact_w = widen(w);
    const Matrix3<double> k = hat(exact_w);
    const long double squared = dot(exact_w, exact_w);
    const Matrix3<double> exact =
        k * static_cast<double>(stumpff_series(1, squared)) + k * k * static_cast<double>(stumpff_series(2, squared));
    for (int i = 0; i < 9; ++i) error = larger(error, relative(tape.value(offsets).data[i], exact(i / 3, i % 3)));
  }
  return {{"relative error of an entry of R - I", error, 1e-6}};
}

}  // namespace hsi4d::stress
