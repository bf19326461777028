// Images of one human in known poses, seen by known cameras: what an avatar is made from.
//
// A folder with a file `views.json`:
//
//   {"format": "hsi4d views", "version": 1, "motion": "motion.npz", "cameras": "cameras.json",
//    "views": [{"image": "images/0000.png", "mask": "masks/0000.png", "camera": 0, "frame": 0}, ...]}
//
// Names are relative to it. A view's camera is one of cameras.json (core/camera_file.h), its frame one of the motion
// (body/motion_io.h). The share of each pixel that shows the human is the picture's alpha (PNG, not premultiplied), or
// the mask (core/mask_image.h); without both the picture has to show the human before the background of the fit.
//
// Of somebody who stands still while photographs are taken, whose cameras another program has found, it names these:
//
//   {"format": "hsi4d views", "version": 1, "motion": "motion.npz", "photos": "colmap", "frame": 0, "longest_side":
//   960}
//
// with `photos` as read_posed_images reads it (pipelines/photos/posed_images.h), in the world of the motion, or in one
// that `alignment`, the alignment.json of `hsi4d align`, takes there.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "body/motion_io.h"
#include "core/camera.h"
#include "core/image.h"
#include "pipelines/input/clip.h"
#include "pipelines/photos/photo.h"

namespace hsi4d {

/// Version of views.json that is written; newer ones are refused.
inline constexpr int kViewSetVersion = 1;

/// One picture: from where it was taken, and of which pose.
struct PosedView {
  std::filesystem::path image;
  std::filesystem::path mask;  ///< empty: the picture's alpha, if it has one
  Index camera = 0;            ///< of the set's cameras
  Index frame = 0;             ///< of the set's motion
};

/// A set of views; its images stay in their files.
struct ViewSet {
  std::filesystem::path file;  ///< views.json itself, or another one that views are of, for messages
  Motion motion;
  std::vector<Camera> cameras;
  std::vector<PosedView> views;
  std::filesystem::path motion_file, cameras_file;
  /// Whose frames and masks of the human the views are, by PosedView::frame, reduced to the camera's size; null: the
  /// pictures are files.
  std::shared_ptr<const ClipVideo> video = {};
  /// The photographs that the views are, by PosedView::camera; empty: pictures are as their cameras take them.
  std::vector<PosedImage> photos = {};
  PhotoRules photo_rules = {.masks = MaskMeaning::kWanted};

  /// All files of the set.
  std::vector<std::filesystem::path> files() const;
};

/// Reads a set. Throws UserError naming file, JSON pointer, value and what is allowed; as read_motion, read_cameras,
/// read_posed_images and decode_alignment.
ViewSet read_view_set(const std::filesystem::path& file);

/// Text of views.json for views whose paths are relative to it already.
std::string view_set_json(const std::string& motion, const std::string& cameras, const std::vector<PosedView>& views);

/// A picture of the set: colours [3,H,W], mask [1,H,W], and the share of each pixel that a straightened photograph
/// shows [1,H,W]. No pixels in a mask that is not there, nor in `weight` where all pixels count.
struct ViewImage {
  Image color, mask, weight = {};
};

/// What a view shows of the human before one colour: mask · image + (1 − mask) · background, and the mask.
/// Throws DataError naming the file when an image or mask has another size than the camera; of a video as read_frame;
/// of a photograph as read_photo.
ViewImage view_image(const ViewSet& set, const PosedView& view, const Vector3<double>& background);

}  // namespace hsi4d
