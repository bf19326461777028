#include "tests/support/smplx_reference.h"

#include <cmath>
#include <complex>
#include <filesystem>
#include <random>

#include "body/body_model.h"

namespace hsi4d::test {

namespace {

constexpr int kJ = 55, kFeatures = 486;

template <class C>
using Rows3 = std::array<std::array<C, 3>, 3>;
template <class C>
using Rows4 = std::array<std::array<C, 4>, 4>;

std::size_t at(std::int64_t i) { return static_cast<std::size_t>(i); }

/// Rodrigues' formula as textbooks have it; the unit matrix below 1e-150.
template <class C>
Rows3<C> rodrigues(const C* w) {
  using std::abs, std::sqrt, std::cos, std::sin;
  const C angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
  Rows3<C> r = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  if (abs(angle) < 1e-150) return r;
  const C x = w[0] / angle, y = w[1] / angle, z = w[2] / angle;
  const C c = cos(angle), s = sin(angle), v = 2.0 * sin(angle / 2.0) * sin(angle / 2.0);
  r = {{{c + v * x * x, v * x * y - s * z, v * x * z + s * y},
        {v * x * y + s * z, c + v * y * y, v * y * z - s * x},
        {v * x * z - s * y, v * y * z + s * x, c + v * z * z}}};
  return r;
}

template <class C>
Rows4<C> product(const Rows4<C>& a, const Rows4<C>& b) {
  Rows4<C> m{};
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      for (std::size_t k = 0; k < 4; ++k) m[i][j] += a[i][k] * b[k][j];
    }
  }
  return m;
}

template <class C>
Rows4<C> homogeneous(const Rows3<C>& r, C x, C y, C z) {
  return {
      {{r[0][0], r[0][1], r[0][2], x}, {r[1][0], r[1][1], r[1][2], y}, {r[2][0], r[2][1], r[2][2], z}, {0, 0, 0, 1}}};
}

/// Column of shapedirs where expression begins.
std::int64_t expression_begin(std::int64_t columns) { return columns >= 400 ? 300 : 10; }

}  // namespace

SmplxArrays random_smplx(const RandomSmplx& options) {
  std::mt19937_64 random(options.seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto fill = [&](std::int64_t count, double size) {
    std::vector<double> numbers(at(count));
    for (double& x : numbers) x = uniform(-size, size);
    return numbers;
  };
  SmplxArrays a;
  a.vertices = options.vertices;
  a.columns = options.columns;
  a.v_template = fill(3 * a.vertices, 0.8);
  for (std::int64_t i = 0; i + 2 < a.vertices; ++i) {
    for (int k = 0; k < 3; ++k) a.f.push_back(i + k);
  }
  for (const int parent : smplx_parents()) a.parents.push_back(parent);
  a.shapedirs = fill(3 * a.vertices * a.columns, 0.03);
  a.regressor.resize(at(kJ * a.vertices));
  for (std::int64_t j = 0; j < kJ; ++j) {
    double sum = 0;
    for (std::int64_t v = 0; v < a.vertices; ++v)
      sum += a.regressor[at(j * a.vertices + v)] = std::pow(uniform(0, 1), 8);
    for (std::int64_t v = 0; v < a.vertices; ++v) a.regressor[at(j * a.vertices + v)] /= sum;
  }
  a.weights.resize(at(a.vertices * kJ));
  for (std::int64_t v = 0; v < a.vertices; ++v) {
    double sum = 0;
    for (int k = 0; k < options.weights_per_vertex; ++k) {
      const auto joint = static_cast<std::int64_t>(random() % kJ);
      const double weight = uniform(0.05, 1);
      a.weights[at(v * kJ + joint)] += weight;
      sum += weight;
    }
    for (std::int64_t j = 0; j < kJ; ++j) a.weights[at(v * kJ + j)] /= sum;
  }
  if (options.correctives) a.posedirs = fill(3 * a.vertices * kFeatures, options.corrective_size);
  for (std::size_t side = 0; side < 2; ++side) {
    a.hand_means[side] = fill(45, 0.3);
    a.hand_components[side] = fill(45 * 45, 0.3);
  }
  return a;
}

NpzWriter smplx_writer(const SmplxArrays& a) {
  NpzWriter file;
  const std::int64_t v = a.vertices;
  file.add<double>("v_template", {v, 3}, a.v_template);
  file.add<std::int64_t>("f", {static_cast<std::int64_t>(a.f.size()) / 3, 3}, a.f);
  std::vector<std::uint32_t> tree;
  for (const std::int64_t parent : a.parents) tree.push_back(static_cast<std::uint32_t>(parent));
  for (std::uint32_t j = 0; j < kJ; ++j) tree.push_back(j);
  file.add<std::uint32_t>("kintree_table", {2, kJ}, tree);
  file.add<double>("shapedirs", {v, 3, a.columns}, a.shapedirs);
  if (!a.regressor.empty()) file.add<double>("J_regressor", {kJ, v}, a.regressor);
  file.add<double>("weights", {v, kJ}, a.weights);
  if (!a.posedirs.empty()) file.add<double>("posedirs", {v, 3, kFeatures}, a.posedirs);
  if (!a.j_template.empty()) file.add<double>("J_template", {kJ, 3}, a.j_template);
  if (!a.j_shapedirs.empty()) {
    file.add<double>("J_shapedirs", {kJ, 3, static_cast<std::int64_t>(a.j_shapedirs.size()) / (3 * kJ)}, a.j_shapedirs);
  }
  const std::array<std::string, 2> sides = {"l", "r"};
  for (std::size_t side = 0; side < 2; ++side) {
    if (!a.hand_means[side].empty()) file.add<double>("hands_mean" + sides[side], {45}, a.hand_means[side]);
    if (!a.hand_components[side].empty()) {
      file.add<double>("hands_components" + sides[side],
                       {static_cast<std::int64_t>(a.hand_components[side].size()) / 45, 45}, a.hand_components[side]);
    }
  }
  return file;
}

std::optional<SmplxArrays> makehuman_arrays(std::string& path) {
  path = std::string(HSI4D_SOURCE_DIR) + "/../shared/data/bodies/makehuman_smplx_layout.npz";
  if (!std::filesystem::exists(path)) return std::nullopt;
  const Npz file = Npz::read(path);
  SmplxArrays a;
  a.v_template = file.array("v_template").as<double>();
  a.vertices = static_cast<std::int64_t>(a.v_template.size()) / 3;
  a.f = file.array("f").as<std::int64_t>();
  const auto tree = file.array("kintree_table").as<std::int64_t>();
  a.parents.assign(tree.begin(), tree.begin() + kJ);
  a.parents[0] = -1;
  a.shapedirs = file.array("shapedirs").as<double>();
  a.columns = file.array("shapedirs").shape()[2];
  a.regressor = file.array("J_regressor").as<double>();
  a.weights = file.array("weights").as<double>();
  a.j_template = file.array("J_template").as<double>();
  a.j_shapedirs = file.array("J_shapedirs").as<double>();
  a.hand_means = {file.array("hands_meanl").as<double>(), file.array("hands_meanr").as<double>()};
  a.hand_components = {file.array("hands_componentsl").as<double>(), file.array("hands_componentsr").as<double>()};
  return a;
}

SmplxPose random_smplx_pose(int betas, int expressions, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  SmplxPose pose;
  for (int i = 0; i < betas; ++i) pose.betas.push_back(2 * uniform(random));
  for (int i = 0; i < expressions; ++i) pose.expression.push_back(2 * uniform(random));
  for (int j = 0; j < kJ; ++j) {
    for (int i = 0; i < 3; ++i) pose.axis_angle.push_back(1.4 * uniform(random));
  }
  for (double& x : pose.transl) x = 3 * uniform(random);
  return pose;
}

template <class C>
std::vector<std::array<std::array<C, 3>, 3>> reference_rotations(const SmplxPoseOf<C>& pose) {
  std::vector<Rows3<C>> rotations;
  for (std::size_t j = 0; j < kJ; ++j) rotations.push_back(rodrigues(pose.axis_angle.data() + 3 * j));
  return rotations;
}

template <class C>
SmplxResultOf<C> reference_smplx(const SmplxArrays& arrays, const SmplxPoseOf<C>& pose) {
  return reference_smplx(arrays, pose, reference_rotations(pose));
}

template <class C>
SmplxResultOf<C> reference_smplx(const SmplxArrays& a, const SmplxPoseOf<C>& pose,
                                 const std::vector<Rows3<C>>& rotations) {
  const std::int64_t vertices = a.vertices;
  // Shape and expression.
  std::vector<C> shaped(a.v_template.begin(), a.v_template.end());
  for (std::size_t row = 0; row < shaped.size(); ++row) {
    for (std::size_t b = 0; b < pose.betas.size(); ++b)
      shaped[row] += a.shapedirs[row * at(a.columns) + b] * pose.betas[b];
    for (std::size_t e = 0; e < pose.expression.size(); ++e) {
      shaped[row] += a.shapedirs[row * at(a.columns) + at(expression_begin(a.columns)) + e] * pose.expression[e];
    }
  }
  // Joints: of the shaped vertices, or as the file says outright.
  std::vector<C> joints(3 * kJ);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (!a.j_template.empty()) {
      const std::size_t width = a.j_shapedirs.size() / joints.size();
      joints[i] = a.j_template[i];
      for (std::size_t b = 0; b < pose.betas.size(); ++b) joints[i] += a.j_shapedirs[i * width + b] * pose.betas[b];
    } else {
      for (std::int64_t v = 0; v < vertices; ++v) {
        joints[i] += a.regressor[i / 3 * at(vertices) + at(v)] * shaped[at(3 * v) + i % 3];
      }
    }
  }
  // The correctives that follow from the rotations.
  std::vector<C> features;
  for (std::size_t j = 1; j < kJ; ++j) {
    for (std::size_t i = 0; i < 9; ++i) features.push_back(rotations[j][i / 3][i % 3] - (i % 4 == 0 ? 1.0 : 0.0));
  }
  if (!a.posedirs.empty()) {
    for (std::size_t row = 0; row < shaped.size(); ++row) {
      for (std::size_t k = 0; k < kFeatures; ++k) shaped[row] += a.posedirs[row * kFeatures + k] * features[k];
    }
  }
  // The chain, by products of 4×4 matrices.
  std::vector<Rows4<C>> world(kJ), from_rest(kJ);
  SmplxResultOf<C> result;
  for (std::size_t j = 0; j < kJ; ++j) {
    const C* rest = joints.data() + 3 * j;
    const std::int64_t parent = a.parents[j];
    const C zero[3] = {};
    const C* from = parent < 0 ? zero : joints.data() + 3 * parent;
    const Rows4<C> local = homogeneous<C>(rotations[j], rest[0] - from[0], rest[1] - from[1], rest[2] - from[2]);
    world[j] = parent < 0 ? local : product(world[at(parent)], local);
    const Rows3<C> none = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    from_rest[j] = product(world[j], homogeneous<C>(none, -rest[0], -rest[1], -rest[2]));
    for (std::size_t i = 0; i < 3; ++i) result.joints.push_back(world[j][i][3] + pose.transl[i]);
  }
  // Skinning, and the translation.
  for (std::int64_t v = 0; v < vertices; ++v) {
    Rows4<C> blend{};
    for (std::size_t j = 0; j < kJ; ++j) {
      const double weight = a.weights[at(v * kJ) + j];
      if (weight == 0) continue;
      for (std::size_t i = 0; i < 16; ++i) blend[i / 4][i % 4] += weight * from_rest[j][i / 4][i % 4];
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const C* x = shaped.data() + 3 * v;
      result.vertices.push_back(blend[i][0] * x[0] + blend[i][1] * x[1] + blend[i][2] * x[2] + blend[i][3] +
                                pose.transl[i]);
    }
  }
  return result;
}

#define HSI4D_INSTANTIATE(C)                                                                        \
  template std::vector<std::array<std::array<C, 3>, 3>> reference_rotations(const SmplxPoseOf<C>&); \
  template SmplxResultOf<C> reference_smplx(const SmplxArrays&, const SmplxPoseOf<C>&);             \
  template SmplxResultOf<C> reference_smplx(const SmplxArrays&, const SmplxPoseOf<C>&,              \
                                            const std::vector<std::array<std::array<C, 3>, 3>>&);
HSI4D_INSTANTIATE(double)
HSI4D_INSTANTIATE(std::complex<double>)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d::test
