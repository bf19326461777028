#include "pipelines/evaluate/evaluated_body.h"

#include <algorithm>

#include "body/motion_edit.h"
#include "body/pose_layout.h"
#include "body/smplx_sequence.h"
#include "core/check.h"
#include "core/text.h"
#include "optim/motion_start.h"
#include "pipelines/input/body_files.h"
#include "pipelines/metrics/penetration.h"

namespace hsi4d {

namespace {

/// Frames that are posed at once: their vertices are in memory together.
constexpr std::size_t kPosedTogether = 64;

/// The parameters of poses, whose hands are whole.
SmplxSequence sequence_of(std::span<const SceneState> states, const std::vector<double>& betas) {
  SmplxSequence sequence;
  sequence.source = "the motion";
  sequence.frames = std::ssize(states);
  const auto add = [&](SmplxTrack& track, std::size_t first, std::size_t joints) {
    track.width = static_cast<Index>(3 * joints);
    track.rows = sequence.frames;
    for (const SceneState& state : states) {
      const auto begin = state.body.axis_angle.begin() + static_cast<std::ptrdiff_t>(3 * first);
      track.numbers.insert(track.numbers.end(), begin, begin + static_cast<std::ptrdiff_t>(3 * joints));
    }
  };
  add(sequence.global_orient, 0, 1);
  add(sequence.body_pose, 1, 21);
  add(sequence.jaw_pose, 22, 1);
  add(sequence.leye_pose, 23, 1);
  add(sequence.reye_pose, 24, 1);
  add(sequence.left_hand_pose, 25, 15);
  add(sequence.right_hand_pose, 40, 15);
  sequence.transl.width = 3;
  sequence.transl.rows = sequence.frames;
  for (const SceneState& state : states)
    sequence.transl.numbers.insert(sequence.transl.numbers.end(), state.body.transl.data(),
                                   state.body.transl.data() + 3);
  if (!betas.empty()) sequence.betas = {betas, std::ssize(betas), 1};
  return sequence;
}

std::vector<double> chosen_points(std::span<const double> all, std::span<const Index> rows) {
  std::vector<double> points;
  for (const Index row : rows) {
    const auto place = all.subspan(static_cast<std::size_t>(3 * row), 3);
    points.insert(points.end(), place.begin(), place.end());
  }
  return points;
}

bool is_left_foot(Index joint) { return joint == smplx_joint("left_ankle") || joint == smplx_joint("left_foot"); }
bool is_right_foot(Index joint) { return joint == smplx_joint("right_ankle") || joint == smplx_joint("right_foot"); }

}  // namespace

EvaluatedBody EvaluatedBody::of_avatar(const std::string& file, Track& track) {
  EvaluatedBody body;
  body.avatar_ = read_avatar(file);
  track.motion = for_body(track.motion, *body.avatar_);
  turn_z_up(track);
  body.skeleton_ = {body.avatar_->parents, body.avatar_->joints};
  return body;
}

EvaluatedBody EvaluatedBody::of_model(const std::string& file, Track& track) {
  EvaluatedBody body;
  const Index betas = read_model_for(file, track.name, track.motion.betas).betas;
  body.model_ = std::make_shared<const SmplxModel>(read_smplx(file, {.betas = betas, .expressions = 0}));
  body.betas_.assign(track.motion.betas.begin(), track.motion.betas.begin() + betas);
  const BodyModel rest = rest_body(*body.model_, body.betas_);
  track.motion = for_body(track.motion, rest);
  turn_z_up(track);
  body.skeleton_ = {rest.parents, rest.joints};
  return body;
}

template <class F>
std::vector<std::vector<double>> EvaluatedBody::of_vertices(const std::vector<SceneState>& states, const F& of) const {
  std::vector<std::vector<double>> points;
  for (std::size_t first = 0; first < states.size(); first += kPosedTogether) {
    const std::size_t count = std::min(kPosedTogether, states.size() - first);
    const SmplxFrames<double> posed = pose_frames<double>(
        *model_, sequence_of(std::span(states).subspan(first, count), betas_), SmplxHands::kFull, true);
    const std::size_t numbers = posed.vertices.size() / count;
    for (std::size_t t = 0; t < count; ++t)
      points.push_back(of(std::span(posed.vertices).subspan(t * numbers, numbers)));
  }
  return points;
}

std::vector<std::vector<double>> EvaluatedBody::points(const std::vector<SceneState>& states) const {
  if (!avatar_)
    return of_vertices(states, [](std::span<const double> all) { return std::vector<double>(all.begin(), all.end()); });
  std::vector<std::vector<double>> points;
  for (const SceneState& state : states) points.push_back(measured_points(*avatar_, state.body));
  return points;
}

Triangles EvaluatedBody::faces() const {
  Triangles faces;
  if (avatar_) return faces;
  for (std::size_t i = 0; i < model_->faces.size(); i += 3)
    faces.push_back({model_->faces[i], model_->faces[i + 1], model_->faces[i + 2]});
  return faces;
}

Index EvaluatedBody::point_count() const { return avatar_ ? avatar_->weights.vertices : model_->vertex_count(); }

std::vector<std::vector<double>> EvaluatedBody::points(const std::vector<SceneState>& states,
                                                       std::span<const Index> rows) const {
  for (const Index row : rows) HSI4D_CHECK(row >= 0 && row < point_count(), "there is no point " + std::to_string(row));
  if (!avatar_) return of_vertices(states, [rows](std::span<const double> all) { return chosen_points(all, rows); });
  std::vector<std::vector<double>> points;
  for (const SceneState& state : states) points.push_back(posed_gaussians(*avatar_, state.body, rows));
  return points;
}

FootPoints EvaluatedBody::foot_points() const {
  if (!avatar_ && model_->vertex_count() == kSmplxVertices) return {kSmplxFeet, "the big toes and heels of SMPL-X"};
  const BodyModel rest = avatar_ ? BodyModel() : rest_body(*model_, betas_);
  const RestPoints points =
      avatar_ ? RestPoints{&avatar_->means, &avatar_->weights} : RestPoints{&rest.vertices, &rest.weights};
  FootPoints feet;
  const std::array parts = {rows_of_joints(*points.weights, is_left_foot),
                            rows_of_joints(*points.weights, is_right_foot)};
  for (std::size_t side = 0; side < 2; ++side) {
    if (parts[side].empty())
      throw UserError("hsi4d evaluate: --protocol: no point of the body follows its " +
                      std::string(side == 0 ? "left" : "right") + " foot; --foot-points names four");
    const auto forward = [&points](Index row) { return (*points.places)[static_cast<std::size_t>(3 * row + 2)]; };
    const auto [heel, toe] = std::minmax_element(parts[side].begin(), parts[side].end(),
                                                 [&](Index a, Index b) { return forward(a) < forward(b); });
    feet.rows[2 * side] = *toe;
    feet.rows[2 * side + 1] = *heel;
  }
  feet.words = "the foremost and hindmost points of its feet";
  return feet;
}

}  // namespace hsi4d
