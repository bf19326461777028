#include "body/smplx_file.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "body/file_contents.h"
#include "body/pose_layout.h"
#include "body/surface_index.h"
#include "core/npz.h"
#include "core/text.h"

namespace hsi4d {

namespace {

/// Columns of `shapedirs`: shape first, expression from `expression_begin` on.
struct ShapeColumns {
  Index betas, expression_begin, expressions;
};

/// Of a file with so many joints: SMPL and SMPL-H have no expression.
ShapeColumns shape_columns(Index columns, Index joints) {
  constexpr Index kShapeSpace = 300, kExpressionSpace = 100, kOldSpace = 10;
  if (joints != kSmplxJoints) return {columns, columns, 0};
  if (columns >= kShapeSpace + kExpressionSpace) return {kShapeSpace, kShapeSpace, kExpressionSpace};
  const Index betas = std::min(columns, kOldSpace);
  return {betas, betas, std::min(columns - betas, kOldSpace)};
}

std::string place_of(const NpyArray& array, Index number) {
  std::string text;
  const auto& shape = array.shape();
  for (std::size_t axis = shape.size(); axis-- > 0;) {
    text = std::to_string(number % shape[axis]) + (text.empty() ? "" : ",") + text;
    number /= shape[axis];
  }
  return "[" + text + "]";
}

/// The numbers of an array of this shape (−1: any length), none beyond kLargestBodyNumber.
std::vector<double> checked_numbers(const Npz& file, const char* name, std::initializer_list<int64_t> shape) {
  const NpyArray& array = file.array(name);
  std::vector<double> numbers = array.require_shape(shape).as<double>();
  const auto bad =
      std::find_if(numbers.begin(), numbers.end(), [](double x) { return !(std::abs(x) <= kLargestBodyNumber); });
  if (bad == numbers.end()) return numbers;
  throw DataError(array.source() + ": number " + place_of(array, bad - numbers.begin()) + " is " + number_text(*bad) +
                  "; allowed: " + kBodyNumbersText);
}

/// Columns [first, first + count) of rows of `width` numbers.
std::vector<double> columns_of(const std::vector<double>& rows, Index width, Index first, Index count) {
  std::vector<double> result;
  result.reserve(width == 0 ? 0 : rows.size() / static_cast<std::size_t>(width) * static_cast<std::size_t>(count));
  for (auto row = rows.begin(); row < rows.end(); row += width) {
    result.insert(result.end(), row + first, row + first + count);
  }
  return result;
}

/// Arrays of Python objects are passed over, but not where they hold something that is needed.
bool has_readable(const Npz& file, const char* name) {
  for (const Npz::Skipped& member : file.skipped()) {
    if (member.name == name) file.array(name);  // throws, saying why
  }
  return file.has(name);
}

void check_count(const NpyArray& array, const char* what, Index wanted, Index there) {
  HSI4D_CHECK(wanted >= 0, std::to_string(wanted) + " " + what);
  if (wanted <= there) return;
  throw DataError(array.source() + ": has shape " + shape_text(array.shape()) + ", which holds " +
                  std::to_string(there) + " " + what + "; " + std::to_string(wanted) + " were asked for");
}

void read_shape(const Npz& file, const SmplxFileOptions& options, SmplxModel& model) {
  const NpyArray& array = file.array("shapedirs");
  const Index columns = array.require_shape({model.vertex_count(), 3, -1}).shape()[2];
  const ShapeColumns there = shape_columns(columns, model.joint_count());
  check_count(array, "betas", options.betas, there.betas);
  check_count(array, "expressions", options.expressions, there.expressions);
  model.betas = options.betas;
  model.expressions = options.expressions;
  model.betas_in_file = there.betas;
  model.expressions_in_file = there.expressions;
  if (columns == 0) return;
  const std::vector<double> directions = checked_numbers(file, "shapedirs", {model.vertex_count(), 3, columns});
  model.shape = columns_of(directions, columns, 0, options.betas);
  model.expression = columns_of(directions, columns, there.expression_begin, options.expressions);
}

/// [J,3] or [3J,n] of the regressor [J,V] and vertices [V,3] or directions [3V,n].
std::vector<double> regressed(const std::vector<double>& regressor, Index vertices, const std::vector<double>& numbers,
                              Index width) {
  const Index joints = static_cast<Index>(regressor.size()) / vertices;
  std::vector<double> result(static_cast<std::size_t>(3 * joints * width));
  for (Index j = 0; j < joints; ++j) {
    double* to = result.data() + 3 * j * width;
    for (Index v = 0; v < vertices; ++v) {
      const double by = regressor[static_cast<std::size_t>(j * vertices + v)];
      if (by == 0) continue;
      const double* from = numbers.data() + 3 * v * width;
      for (Index i = 0; i < 3 * width; ++i) to[i] += by * from[i];
    }
  }
  return result;
}

/// Columns of J_shapedirs, `joints` × 3 rows of `width` numbers; those that it has not are zero.
std::vector<double> joint_columns(const std::vector<double>& rows, Index joints, Index width, Index first,
                                  Index count) {
  std::vector<double> result(static_cast<std::size_t>(3 * joints * count));
  for (Index row = 0; row < 3 * joints; ++row) {
    for (Index c = 0; c < count && first + c < width; ++c) {
      result[static_cast<std::size_t>(row * count + c)] = rows[static_cast<std::size_t>(row * width + first + c)];
    }
  }
  return result;
}

void read_rest_joints(const Npz& file, SmplxModel& model) {
  const Index joints = model.joint_count();
  if (has_readable(file, "J_template") && has_readable(file, "J_shapedirs")) {
    model.joints = checked_numbers(file, "J_template", {joints, 3});
    const NpyArray& array = file.array("J_shapedirs");
    const Index width = array.require_shape({joints, 3, -1}).shape()[2];
    const std::vector<double> rows = checked_numbers(file, "J_shapedirs", {joints, 3, width});
    model.joint_shape = joint_columns(rows, joints, width, 0, model.betas);
    model.joint_expression = joint_columns(rows, joints, width, model.betas_in_file, model.expressions);
    return;
  }
  const std::vector<double> regressor = checked_numbers(file, "J_regressor", {joints, model.vertex_count()});
  model.joints = regressed(regressor, model.vertex_count(), model.vertices, 1);
  model.joint_shape = regressed(regressor, model.vertex_count(), model.shape, model.betas);
  model.joint_expression = regressed(regressor, model.vertex_count(), model.expression, model.expressions);
}

void read_tree(const Npz& file, SmplxModel& model) {
  const NpyArray& array = file.array("kintree_table");
  const Index joints = array.require_shape({2, -1}).shape()[1];
  if (joints != kSmplxJoints && joints != kSmplhJoints && joints != kSmplJoints)
    throw DataError(array.source() + ": has shape " + shape_text(array.shape()) +
                    "; allowed: [2,55] (SMPL-X), [2,52] (SMPL-H), [2,24] (SMPL)");
  // 2³²−1 and 2⁶⁴−1 are −1 of unsigned numbers.
  const bool is_wide = array.kind() == NpyKind::unsigned_integer;
  const auto numbers = is_wide ? std::vector<std::int64_t>{} : array.as<std::int64_t>();
  const auto wide = is_wide ? array.as<std::uint64_t>() : std::vector<std::uint64_t>{};
  for (std::size_t j = 0; j < static_cast<std::size_t>(joints); ++j) {
    const bool is_root = is_wide ? wide[j] >= std::numeric_limits<std::uint32_t>::max()
                                 : numbers[j] == -1 || numbers[j] == std::numeric_limits<std::uint32_t>::max();
    const std::int64_t parent = is_root ? -1 : is_wide ? static_cast<std::int64_t>(wide[j]) : numbers[j];
    if (parent < -1 || parent >= joints) {
      throw DataError(array.source() + ": the parent of joint " + std::to_string(j) + " is " + std::to_string(parent) +
                      "; allowed: 0 to " + std::to_string(joints - 1) + ", or -1 (4294967295) for the root");
    }
    model.parents.push_back(static_cast<int>(parent));
  }
  const std::string fault = tree_fault(model.parents);
  if (!fault.empty()) throw DataError(array.source() + ": " + fault);
}

void read_faces(const Npz& file, SmplxModel& model) {
  const NpyArray& array = file.array("f");
  const auto numbers = array.require_shape({-1, 3}).as<std::int64_t>();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] < 0 || numbers[i] >= model.vertex_count()) {
      throw DataError(array.source() + ": face " + std::to_string(i / 3) + " names vertex " +
                      std::to_string(numbers[i]) + "; allowed: 0 to " + std::to_string(model.vertex_count() - 1));
    }
    model.faces.push_back(static_cast<std::int32_t>(numbers[i]));
  }
}

void read_skin_weights(const Npz& file, SmplxModel& model) {
  const NpyArray& array = file.array("weights");
  const Index joints = model.joint_count();
  model.weights = {model.vertex_count(), joints, array.require_shape({model.vertex_count(), joints}).as<double>()};
  model.rescaled_weights = repair_weights(model.weights, array.source());
}

SmplxHand read_hand(const Npz& file, const char* mean, const char* components) {
  SmplxHand hand{std::vector<double>(static_cast<std::size_t>(kHandNumbers)), {}};
  if (has_readable(file, mean)) hand.mean = checked_numbers(file, mean, {kHandNumbers});
  if (has_readable(file, components)) hand.components = checked_numbers(file, components, {-1, kHandNumbers});
  return hand;
}

/// How the joints of SMPL or SMPL-H are those of SMPL-X.
struct JointMap {
  std::vector<Index> to;    // of each joint of the file, the one that moves what it moves
  std::vector<Index> from;  // of each joint of SMPL-X, the one of the file that says where it is
  Index turned = 0;         // the first so many of the file are turned by poses
};

JointMap joint_map(Index joints) {
  JointMap map{std::vector<Index>(static_cast<std::size_t>(joints)), std::vector<Index>(kSmplxJoints, -1), 0};
  for (const PoseRun& run : smplx_runs(joints)) {
    for (Index i = 0; i < run.joints; ++i) {
      map.to[static_cast<std::size_t>(run.from + i)] = run.to + i;
      map.from[static_cast<std::size_t>(run.to + i)] = run.from + i;
    }
    map.turned = run.from + run.joints;
  }
  for (Index hand = 0; map.turned + hand < joints; ++hand) {  // SMPL's hands go with the wrists, and fingers are there
    const Index joint = map.turned + hand;
    map.to[static_cast<std::size_t>(joint)] = smplx_joint(hand == 0 ? "left_wrist" : "right_wrist");
    std::fill_n(map.from.begin() + kFirstHandJoint + hand * kHandJoints, kHandJoints, joint);
  }
  for (std::size_t j = 1; j < map.from.size(); ++j) {  // jaw and eyes are at the head
    if (map.from[j] < 0) map.from[j] = map.from[static_cast<std::size_t>(smplx_parents()[j])];
  }
  return map;
}

/// Groups of `width` numbers, one for each joint of SMPL-X, of those of the file's.
std::vector<double> of_smplx_joints(const std::vector<double>& numbers, const JointMap& map, Index width) {
  std::vector<double> result;
  for (const Index joint : map.from) {
    const auto first = numbers.begin() + joint * width;
    result.insert(result.end(), first, first + width);
  }
  return result;
}

/// A model of SMPL or SMPL-H with the joints of SMPL-X. @param tree  what messages call the file's joints
void take_smplx_joints(const std::string& tree, SmplxModel& model) {
  const Index joints = model.joint_count();
  const JointMap map = joint_map(joints);
  for (Index j = 1; j < joints; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const bool is_turned = j < map.turned;
    const Index is = map.to[static_cast<std::size_t>(model.parents[at])];
    const Index wanted = is_turned ? smplx_parents()[static_cast<std::size_t>(map.to[at])] : map.to[at];
    if (is != wanted)
      throw DataError(tree + ": the parent of joint " + std::to_string(j) + " is " + std::to_string(model.parents[at]) +
                      "; allowed: " + std::to_string(map.from[static_cast<std::size_t>(wanted)]) +
                      ", as in SMPL and SMPL-H");
  }
  model.parents = smplx_parents();
  model.joints = of_smplx_joints(model.joints, map, 3);
  model.joint_shape = of_smplx_joints(model.joint_shape, map, 3 * model.betas);
  model.joint_expression = of_smplx_joints(model.joint_expression, map, 3 * model.expressions);
  DenseWeights weights{model.vertex_count(), kSmplxJoints, {}};
  weights.weights.resize(static_cast<std::size_t>(weights.vertices * kSmplxJoints));
  for (std::size_t i = 0; i < model.weights.weights.size(); ++i) {
    const auto row = i / static_cast<std::size_t>(joints), joint = i % static_cast<std::size_t>(joints);
    weights.weights[row * kSmplxJoints + static_cast<std::size_t>(map.to[joint])] += model.weights.weights[i];
  }
  model.weights = std::move(weights);
  if (model.correctives.empty()) return;
  const auto width = static_cast<std::size_t>(9 * (joints - 1)), wide = std::size_t{9 * (kSmplxJoints - 1)};
  const std::size_t rows = model.correctives.size() / width;
  std::vector<double> correctives(rows * wide);
  for (std::size_t row = 0; row < rows; ++row) {
    for (Index j = 1; j < map.turned; ++j)
      std::copy_n(model.correctives.begin() + static_cast<Index>(row * width) + 9 * (j - 1), 9,
                  correctives.begin() + static_cast<Index>(row * wide) + 9 * (map.to[static_cast<std::size_t>(j)] - 1));
  }
  model.correctives = std::move(correctives);
}

SmplxModel model_of(const Npz& file, const SmplxFileOptions& options) {
  SmplxModel model;
  model.source = file.source();
  refuse_other_contents(file, {"a body model"});
  for (const Npz::Skipped& member : file.skipped()) model.unread.push_back(member.name);
  model.vertices = checked_numbers(file, "v_template", {-1, 3});
  if (model.vertices.empty()) throw DataError(file.array("v_template").source() + ": holds no vertex");
  read_faces(file, model);
  read_tree(file, model);
  read_skin_weights(file, model);
  read_shape(file, options, model);
  read_rest_joints(file, model);
  if (options.correctives && has_readable(file, "posedirs")) {
    model.correctives = checked_numbers(file, "posedirs", {model.vertex_count(), 3, 9 * (model.joint_count() - 1)});
  }
  model.hands = {read_hand(file, "hands_meanl", "hands_componentsl"),
                 read_hand(file, "hands_meanr", "hands_componentsr")};
  if (model.joint_count() != kSmplxJoints) take_smplx_joints(file.array("kintree_table").source(), model);
  return model;
}

}  // namespace

SmplxModel read_smplx(const std::string& path, const SmplxFileOptions& options) {
  return model_of(Npz::read(path), options);
}

SmplxModel decode_smplx(std::span<const std::uint8_t> file, const std::string& name, const SmplxFileOptions& options) {
  return model_of(Npz::decode(file, name), options);
}

BodyModel rest_body(const SmplxModel& model, std::span<const double> betas) {
  HSI4D_CHECK(betas.empty() || static_cast<Index>(betas.size()) == model.betas,
              std::to_string(betas.size()) + " betas; the model has " + std::to_string(model.betas));
  const auto shaped = [&](const std::vector<double>& rest, const std::vector<double>& directions) {
    std::vector<double> points = rest;
    for (std::size_t row = 0; row < points.size(); ++row) {
      for (std::size_t b = 0; b < betas.size(); ++b) points[row] += directions[row * betas.size() + b] * betas[b];
    }
    return points;
  };
  BodyModel body;
  body.name = model.name;
  const std::vector<double> vertices = shaped(model.vertices, model.shape);
  body.vertices.assign(vertices.begin(), vertices.end());
  body.faces = model.faces;
  body.joint_names = smplx_joint_names();
  body.parents = model.parents;
  body.joints = shaped(model.joints, model.joint_shape);
  body.weights = largest_weights(model.weights, 4, model.source + ": array 'weights'");
  double area = 0;
  for (std::int32_t face = 0; face < body.face_count(); ++face) {
    const std::array<Vector3<double>, 3> corners = face_corners(body, face);
    const Vector3<double> a = corners[1] - corners[0], b = corners[2] - corners[0];
    area += cross(a, b).norm() / 2;
  }
  if (!(area > 0))
    throw DataError(model.source + ": array 'f': " + std::to_string(body.face_count()) +
                    " faces without area; allowed: a surface");
  return body;
}

}  // namespace hsi4d
