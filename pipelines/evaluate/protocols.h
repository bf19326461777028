// The protocols of public benchmarks, on what `hsi4d evaluate` compares.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/config.h"
#include "pipelines/evaluate/evaluated_body.h"
#include "pipelines/evaluate/tracks.h"
#include "pipelines/metrics/metric_facts.h"

namespace hsi4d {

/// Whose protocol is followed. Those of EMDB-2 and RICH are the same (optim/protocols/world_motion_metrics.h), and so
/// are those of BEHAVE and InterCap (optim/protocols/human_object_metrics.h).
enum class Protocol { kNone, kEmdb2, kRich, kBehave, kInterCap };

inline constexpr std::array<ConfigChoice<Protocol>, 4> kProtocols = {{{Protocol::kEmdb2, "emdb2"},
                                                                      {Protocol::kRich, "rich"},
                                                                      {Protocol::kBehave, "behave"},
                                                                      {Protocol::kInterCap, "intercap"}}};

/// Whether a protocol measures the person's way through the world, or the person with objects.
bool is_of_world(Protocol protocol);
bool is_of_objects(Protocol protocol);

/// A shape that objects have in estimate and truth alike, about the point that their poses act about.
struct ObjectShape {
  std::string source;          ///< "the mesh chair.ply", for people
  std::vector<double> points;  ///< [P,3] metres
  Triangles faces;             ///< of these points; none where only points are known
};

/// What is compared.
struct ProtocolSides {
  const AlignedTracks& tracks;
  const EvaluatedBody &body, &true_body;  ///< with points of the same numbers
  std::vector<ObjectShape> objects = {};  ///< in the order of world_from_object
  std::array<Index, 4> foot_points = {};  ///< toe and heel, left and right, by their numbers
  Index aligned_frames = kAlignedFrames;  ///< that are laid on the truth together
};

/// Metrics, and what was taken for them.
struct ProtocolResult {
  MetricValues values;
  std::vector<std::string> notes;
};

/// `wa_mpjpe_100_mm`, `w_mpjpe_100_mm`, `rte_percent`, `protocol_jitter`, `foot_point_sliding_mm` over all good frames,
/// the first too; frames that are not good are left out and those about them joined, as these protocols do. What there
/// are too few frames for, or no way, or no standing foot, is left out.
/// Throws UserError where no frame of the truth is good; InternalError for numbers of points that are not there.
ProtocolResult world_protocol(const ProtocolSides& sides);

/// `cd_human_cm`, `cd_object_cm`, `cd_both_cm`, `acceleration_human_cm`, `acceleration_object_cm`, over these frames.
/// The human, and all objects together, are compared by points that are drawn from their surfaces where their triangles
/// are known, else by their points. Errors as above, and where there is no object.
ProtocolResult object_protocol(const ProtocolSides& sides);

}  // namespace hsi4d
