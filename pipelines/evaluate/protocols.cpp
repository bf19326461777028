#include "pipelines/evaluate/protocols.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/check.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "optim/protocols/human_object_metrics.h"
#include "optim/protocols/world_motion_metrics.h"

namespace hsi4d {

namespace {

constexpr double kSameProtocolRate = 1e-6;

/// The moments that are measured.
std::vector<std::size_t> good_moments(const AlignedTracks& tracks, std::vector<std::string>& notes) {
  std::vector<std::size_t> moments;
  for (std::size_t t = 0; t < tracks.truth.size(); ++t) {
    if (tracks.good[t]) moments.push_back(t);
  }
  if (moments.empty()) throw UserError("hsi4d evaluate: --protocol: no frame of the truth is a good one");
  if (moments.size() < tracks.truth.size())
    notes.push_back(std::to_string(tracks.truth.size() - moments.size()) + " of " +
                    std::to_string(tracks.truth.size()) + " frames are not good ones and are left out");
  return moments;
}

template <class T>
std::vector<T> chosen(const std::vector<T>& all, const std::vector<std::size_t>& moments) {
  std::vector<T> some;
  for (const std::size_t t : moments) some.push_back(all[t]);
  return some;
}

std::vector<std::span<const double>> spans_of(const std::vector<std::vector<double>>& arrays) {
  return {arrays.begin(), arrays.end()};
}

std::vector<std::span<const double>> joint_spans(const std::vector<FrameState>& states,
                                                 const std::vector<std::size_t>& moments) {
  std::vector<std::span<const double>> joints;
  for (const std::size_t t : moments) joints.emplace_back(states[t].joints);
  return joints;
}

double mean_number(const std::vector<double>& numbers) {
  return std::accumulate(numbers.begin(), numbers.end(), 0.0) / static_cast<double>(numbers.size());
}

void note_rate(double rate, ProtocolResult& result) {
  if (std::fabs(rate - kProtocolRate) <= kSameProtocolRate) return;
  result.notes.push_back("the protocol is for " + number_text(kProtocolRate) + " frames a second, this is at " +
                         number_text(rate) +
                         ": its pieces and steps are counted in frames, and last longer or shorter");
}

/// All objects' points in one frame.
std::vector<double> object_points(const std::vector<ObjectShape>& shapes, const FrameState& state) {
  HSI4D_CHECK_EQ(shapes.size(), state.world_from_object.size());
  std::vector<double> points;
  for (std::size_t o = 0; o < shapes.size(); ++o) {
    for (std::size_t i = 0; i < shapes[o].points.size(); i += 3) {
      const Vector3<double> place =
          transform_point(state.world_from_object[o], Vector3<double>(shapes[o].points.data() + i));
      points.insert(points.end(), place.data(), place.data() + 3);
    }
  }
  return points;
}

/// The triangles of all objects; none where one has none.
Triangles object_faces(const std::vector<ObjectShape>& shapes) {
  Triangles faces;
  std::int32_t first = 0;
  for (const ObjectShape& shape : shapes) {
    if (shape.faces.empty()) return {};
    for (const auto& face : shape.faces) faces.push_back({face[0] + first, face[1] + first, face[2] + first});
    first += static_cast<std::int32_t>(shape.points.size() / 3);
  }
  return faces;
}

HumanObjectMotion human_and_objects(const EvaluatedBody& body, const std::vector<SceneState>& states,
                                    const std::vector<FrameState>& frames, const std::vector<ObjectShape>& shapes) {
  HumanObjectMotion motion{.human = body.points(states)};
  for (const FrameState& frame : frames) motion.object.push_back(object_points(shapes, frame));
  return motion;
}

std::string compared_by(const std::string& what, std::size_t points, bool has_faces) {
  return has_faces ? what + " by " + std::to_string(kSurfacePoints) + " points drawn from the surface of " +
                         std::to_string(points) + " vertices"
                   : what + " by " + std::to_string(points) + " points as they are";
}

}  // namespace

bool is_of_world(Protocol protocol) { return protocol == Protocol::kEmdb2 || protocol == Protocol::kRich; }
bool is_of_objects(Protocol protocol) { return protocol == Protocol::kBehave || protocol == Protocol::kInterCap; }

ProtocolResult world_protocol(const ProtocolSides& sides) {
  ProtocolResult result;
  const std::vector<std::size_t> moments = good_moments(sides.tracks, result.notes);
  const auto joints = joint_spans(sides.tracks.estimate, moments), truth = joint_spans(sides.tracks.truth, moments);
  const auto feet = sides.body.points(chosen(sides.tracks.states, moments), sides.foot_points),
             true_feet = sides.true_body.points(chosen(sides.tracks.true_states, moments), sides.foot_points);
  result.values.emplace_back("wa_mpjpe_100_mm",
                             mean_number(piecewise_mpjpe_mm(joints, truth, kPieceFrames, kPieceFrames)));
  result.values.emplace_back("w_mpjpe_100_mm",
                             mean_number(piecewise_mpjpe_mm(joints, truth, kPieceFrames, kFirstFrames)));
  if (const auto errors = root_way_errors_percent(joints, truth))
    result.values.emplace_back("rte_percent", mean_number(*errors));
  if (const auto trembling = jitter(joints, sides.tracks.frame_rate))
    result.values.emplace_back("protocol_jitter", *trembling / kJitterUnit);
  if (const auto step = standing_step_mm(spans_of(feet), spans_of(true_feet)))
    result.values.emplace_back("foot_point_sliding_mm", *step);
  result.notes.push_back(std::to_string(moments.size()) + " frames in pieces of " + std::to_string(kPieceFrames) +
                         ", " + std::to_string(std::min(kMetricJoints, std::ssize(joints[0]) / 3)) + " joints");
  note_rate(sides.tracks.frame_rate, result);
  return result;
}

ProtocolResult object_protocol(const ProtocolSides& sides) {
  if (sides.objects.empty()) throw UserError("hsi4d evaluate: --protocol: there is no object to compare");
  ProtocolResult result;
  const std::vector<std::size_t> moments = good_moments(sides.tracks, result.notes);
  const auto motion_of = [&](const EvaluatedBody& body, const auto& states, const auto& frames) {
    return human_and_objects(body, chosen(states, moments), chosen(frames, moments), sides.objects);
  };
  const HumanObjectMotion estimate = motion_of(sides.body, sides.tracks.states, sides.tracks.estimate),
                          truth = motion_of(sides.true_body, sides.tracks.true_states, sides.tracks.truth);
  const HumanObjectSurfaces surfaces = {sides.body.faces(), object_faces(sides.objects)};
  const HumanObjectErrors errors = human_object_errors(estimate, truth, surfaces, sides.aligned_frames);
  result.values = {
      {"cd_human_cm", errors.cd_human}, {"cd_object_cm", errors.cd_object}, {"cd_both_cm", errors.cd_both}};
  if (errors.acceleration_human) result.values.emplace_back("acceleration_human_cm", *errors.acceleration_human);
  if (errors.acceleration_object) result.values.emplace_back("acceleration_object_cm", *errors.acceleration_object);
  std::vector<std::string> sources;
  for (const ObjectShape& shape : sides.objects) sources.push_back(shape.source);
  result.notes.push_back(compared_by("the human", truth.human[0].size() / 3, !surfaces.human.empty()) + ", " +
                         compared_by("objects", truth.object[0].size() / 3, !surfaces.object.empty()) + " (" +
                         joined(sources) + "), " + std::to_string(sides.aligned_frames) +
                         " frames laid on the truth together");
  note_rate(sides.tracks.frame_rate, result);
  return result;
}

}  // namespace hsi4d
