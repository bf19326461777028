// Objects that a frame hides: they stay with the person who carried them, or where they lay, until they are seen again.
//
// What pixels and masks do not show has no gradient of its own: it drifts, with what stands before it, or not at all
// while a person walks away with it. So how much of each object a frame shows is known before its stages begin; what is
// hidden goes with its carrier, whatever the stages made of it; what is seen again is looked for among places where it
// may be, by rendering; and what lies between two frames that show it is laid on a smooth path between them.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/color_state.h"
#include "pipelines/input/state.h"
#include "pipelines/run/reconstruct_stage.h"

namespace hsi4d {

/// A frame hides an object of which it shows less than this share.
inline constexpr double kHiddenBelow = 0.25;

/// Intersection over union of an object's silhouette and mask below which it may be elsewhere; below which it is.
inline constexpr double kDoubtfulIou = 0.5, kLostIou = 0.2;

/// What an object goes with while nobody sees it: a joint of the body, or the world.
struct Carrier {
  std::optional<Index> joint;  ///< the chest, or a wrist; none: the world
  std::size_t person = 0;      ///< whose
  bool is_upright = false;     ///< turns with the way that the pelvis looks alone, not as the joint does

  bool operator==(const Carrier&) const = default;
};

/// "stays with the chest", "stays with the left hand of friend", "stays where it was".
std::string carrier_text(const Clip& clip, const Carrier& carrier);

/// How much of each object a frame shows: the pixels of its mask over those that it would cover alone, at most 1; 0
/// for a mask that nowhere reaches the threshold, 1 of an object without masks.
/// @param state  where the objects may be
std::vector<double> seen_shares(const Clip& clip, const ClipFrame& frame, double mask_threshold,
                                const SceneState& state);

/// The same of what is drawn of an object: 0 behind everything.
/// @param picture  of the state, with silhouettes
double drawn_share(const Clip& clip, const StatePicture& picture, std::size_t object, const SceneState& state);

/// Whether the frame is nearer to an image with the object where it is in `state` than to one without it: then it shows
/// the object, whatever a mask says that may be missing.
bool is_shown_at(const RunConfig& config, const Clip& clip, std::size_t object, const ClipFrame& frame,
                 const SceneState& state, const ColorState& colors);

/// Which hands of a person touch an object: left, right.
std::array<bool, 2> touching_hands(const Clip& clip, std::size_t object, std::size_t person, const SceneState& state);

/// The chest of a person whose hand the object touched in the last frame that shows it, if in the last frames that do
/// it moved with the chest at least as well as it stood in the world; of several the one that it moved with best; else
/// the world. Hands themselves are often hidden with what they hold, and then hardly known.
/// @param seen  the frames that show the object, one at least: their states, in order
Carrier carrier_of(const Clip& clip, std::size_t object, const std::vector<const SceneState*>& seen);

/// The pose of an object that goes with its carrier from one state to another.
ObjectPose carried_pose(const Clip& clip, const Carrier& carrier, std::size_t object, const SceneState& from,
                        const SceneState& to);

/// Intersection over union of what is drawn of an object and its mask; nothing where that shows at most a sliver.
/// @param picture  with silhouettes
std::optional<double> object_iou(const StatePicture& picture, const ClipFrame& frame, std::size_t object);

/// A pose in which an object may be seen again.
struct FoundObject {
  ObjectPose pose;
  std::string from;  ///< "as expected", "where it was", or that with ", at its mask"; for the log
};

/// Looks for an object that is seen again: of the poses that it may have the one whose image is nearest to the frame's.
/// Tried are the one that it has in `state`, that of the frame which showed it last, and both moved along the image to
/// the centre of the object's mask, where that shows it.
/// @param last  the state of the frame that showed it last
FoundObject find_object(const RunConfig& config, const Clip& clip, std::size_t object, const ClipFrame& frame,
                        const SceneState& state, const SceneState& last, const ColorState& colors);

}  // namespace hsi4d
