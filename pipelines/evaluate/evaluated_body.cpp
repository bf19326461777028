#include "pipelines/evaluate/evaluated_body.h"

#include <algorithm>

#include "body/motion_edit.h"
#include "body/pose_layout.h"
#include "body/smplx_sequence.h"
#include "core/check.h"
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

std::vector<std::vector<double>> EvaluatedBody::points(const std::vector<SceneState>& states) const {
  std::vector<std::vector<double>> points;
  if (avatar_) {
    for (const SceneState& state : states) points.push_back(measured_points(*avatar_, state.body));
    return points;
  }
  for (std::size_t first = 0; first < states.size(); first += kPosedTogether) {
    const std::size_t count = std::min(kPosedTogether, states.size() - first);
    const SmplxFrames<double> posed = pose_frames<double>(
        *model_, sequence_of(std::span(states).subspan(first, count), betas_), SmplxHands::kFull, true);
    const std::size_t numbers = posed.vertices.size() / count;
    for (std::size_t t = 0; t < count; ++t) {
      const auto begin = posed.vertices.begin() + static_cast<std::ptrdiff_t>(t * numbers);
      points.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(numbers));
    }
  }
  return points;
}

}  // namespace hsi4d
