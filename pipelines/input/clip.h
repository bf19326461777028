// What a reconstruction reads: scene, objects, avatar, the video's frames and masks, the state of frame 0.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "body/avatar_directions.h"
#include "core/camera.h"
#include "core/image.h"
#include "core/lens.h"
#include "optim/annotated_contact.h"
#include "optim/solid/mesh_distance.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/config/masks.h"
#include "pipelines/input/depth_maps.h"
#include "pipelines/input/frame_source.h"
#include "pipelines/input/keypoints.h"
#include "pipelines/input/point_tracks.h"
#include "pipelines/input/scene_setup.h"

namespace hsi4d {

/// A file that a run reads.
struct ClipFile {
  std::string name;  ///< what it is, wherever it lies: "/data/scene", "frames/0001.png"
  std::filesystem::path path;
};

/// Pictures of the clip.
struct ClipVideo {
  FrameSource frames;
  std::vector<MaskSource> masks;  ///< of the human, then of each object, then of the people beside the first one
  std::size_t others = 0;         ///< how many these are
  Lens lens = {};                 ///< through which it was filmed
  Camera camera = {};             ///< whose intrinsics the lens goes with, where it bends
};

/// A person in the clip.
struct ClipPerson {
  std::string name = kHumanMasks;  ///< of the folder of masks
  Avatar avatar;
  std::optional<BodyModel> body;       ///< that the avatar was made on, where a loss asks for it
  std::vector<BodyPose> estimate;      ///< estimated poses by frame; empty: none
  std::optional<double> foot_range;    ///< of the estimate (lower_foot_range), metres; none without one
  std::optional<Keypoints> keypoints;  ///< of data.keypoints
  std::vector<double> betas;           ///< of the person, as the motion file says; empty: not known
  std::string gender = "neutral";      ///< of the body model, likewise
};

/// All that stays the same over the clip, whose own person is the first. Frames are read one by one (read_frame).
struct Clip : ClipPerson {
  Gaussians scene;
  std::vector<ClipObject> objects;
  std::vector<ClipPerson> others;                         ///< of data.people, in their order
  std::optional<AvatarDirections> directions;             ///< how the avatar follows betas, where a stage moves them
  Camera camera;                                          ///< of frame 0; size and intrinsics of all frames
  SceneState first;                                       ///< state of frame 0, given; poses are of the avatars' bodies
  std::vector<std::vector<ObjectPose>> object_estimate;   ///< estimated poses [frame][object]; empty: none
  std::optional<PointTracks> tracks;                      ///< of data.tracks
  std::optional<DepthMaps> depth_maps;                    ///< of data.depth_maps
  std::optional<std::vector<AnnotatedContact>> contacts;  ///< of data.contacts
  double frame_rate = 10;                                 ///< frames a second
  std::vector<std::string> frame_files;                   ///< names of the frames, in order
  std::shared_ptr<const ClipVideo> video;                 ///< what read_frame reads
  std::optional<std::vector<SceneState>> truth;
  std::shared_ptr<const MeshDistance> surface;  ///< of data.surface; null: not known
  std::string surface_file;
  std::vector<std::string> antialiased;  ///< files that say that their Gaussians were trained with antialiasing
  std::vector<ClipFile> files;           ///< read for it, but for the truth, which no result depends on

  Index frames() const { return static_cast<Index>(frame_files.size()); }
  std::size_t people() const { return 1 + others.size(); }
  ClipPerson& person(std::size_t p) { return p == 0 ? *this : others.at(p - 1); }
  const ClipPerson& person(std::size_t p) const { return p == 0 ? *this : others.at(p - 1); }
};

/// One frame of the video.
struct ClipFrame {
  Image target;                      ///< [3,H,W]
  Image human_mask;                  ///< [1,H,W] coverage
  std::vector<Image> object_masks;   ///< [1,H,W] coverage, by object
  std::vector<Image> other_masks{};  ///< [1,H,W] coverage, of the people beside the first one
  DepthMap depth_map = {};           ///< empty where there is none
  Image seen = {};                   ///< [1,H,W] 1, or 0 where a lens shows nothing of the frame; empty: 1 everywhere

  const Image& person_mask(std::size_t p) const { return p == 0 ? human_mask : other_masks.at(p - 1); }
};

/// Opens the frames and masks that `data` names, those of data.people too. What masks lack or have too much is told in
/// the log. Throws as FrameSource and MaskSource; DataError for masks with names that are not those of frames.
/// @param objects  names, in order
ClipVideo open_video(const DataSettings& data, const std::vector<std::string>& objects);

/// Reads everything but the frames. Throws UserError or DataError naming the file: missing, damaged, sizes that do not
/// fit each other.
Clip read_clip(const DataSettings& data);

/// As read_clip, of a scene that is read. data.initial is of no meaning.
Clip make_clip(const DataSettings& data, SceneSetup setup);

/// The clip as filmed through this lens: frames and masks are straightened as they are read, and keypoints here. Of a
/// clip without a lens.
void set_lens(const Lens& lens, Clip& clip);

/// Reads every frame and mask once, so that what is wrong with the last one shows before the first is worked on.
/// A human or an object that some masks after frame 0 show nothing of is told in the log, each with its frames, and so
/// are depth maps that say nothing. Throws as read_frame; DataError where no depth map says anything.
/// @param losses  those of the run that such masks switch off
void check_frames(const DataSettings& data, const Clip& clip, const LossesOverMasks& losses);

/// Whether a frame becomes an image of the camera: as large, or larger and of the same shape but for the rounding of
/// sizes.
bool fits_camera(const Image& frame, const Camera& camera);

/// Reads frame `index`, its masks and its depth map, and reduces larger ones to the camera's size. A mask that has no
/// file counts as empty. Throws as read_clip; a number that is not finite too, with its row and column.
ClipFrame read_frame(const Clip& clip, Index index);

/// As above, before there is a clip: without a depth map.
/// @param size  of the result
ClipFrame read_frame(const ClipVideo& video, const Camera& size, Index index);

/// The files of a frame: the image, the masks of human and objects, which may be missing, the depth map. None of those
/// that are in videos.
std::vector<ClipFile> frame_files(const DataSettings& data, const Clip& clip, Index index);

/// Frames in words: "3", "2-4, 9".
/// @param frames  ascending
std::string frame_ranges(const std::vector<Index>& frames);

}  // namespace hsi4d
