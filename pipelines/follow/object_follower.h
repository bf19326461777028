// The masks of objects through a video, from those in its first frame: by colours, optical flow and graph cuts.
#pragma once

#include <vector>

#include "core/image.h"
#include "pipelines/follow/color_model.h"
#include "pipelines/follow/plane_motion.h"

namespace hsi4d {

/// Of pictures that can be looked at, pixels: optical flow needs them.
inline constexpr int kLeastFollowSide = 16;

/// What became of an object in a frame.
enum class Followed {
  kSeen,
  kDoubtful,  ///< a mask is there, and its score is low
  kHidden,    ///< nothing is seen of it, or it is not found
};

/// The mask of an object in a frame.
struct FollowedMask {
  Image mask;  ///< [1,H,W] share of each pixel, of the frame's size
  Followed state = Followed::kSeen;
  double score = 1;  ///< 0 to 1
};

/// What is known of an object, at the size at which it is looked at.
struct FollowedObject {
  Image mask;                             ///< [1,h,w] 0 or 1: what is seen of it
  Image presence;                         ///< [1,h,w] 0 to 1: where it is, seen or hidden
  ColorModel first_colors, first_around;  ///< of the first frame
  ColorModel colors;                      ///< of late
  double area = 0;                        ///< of its largest mask of late, pixels
  int hidden_for = 0;                     ///< frames
};

/// Follows objects.
///
///   1. Dense flow between the frame before and this one, there and back.
///   2. Where the object is expected: its last mask, carried along by the flow and by its common motion; and the part
///      of it that was hidden, by the latter.
///   3. Odds of a pixel: of its colour among the object's (of the first frame and of late) and those around it (of this
///      frame and of the first), and of its distance from the border of what is expected. Where the human's mask does
///      not cover the object in the first frame, what it covers later is rather not the object.
///      What looks as the background did when it was last seen there, the camera's motion taken away, is rather that.
///   4. The labels with the least sum of odds and of borders, which cost less where colours change.   [Boykov and Jolly
///      2001; Rother et al. 2004]
///
/// An object of which hardly anything is left is hidden. From then on what has its colours is sought near where it was,
/// farther away with each frame. The score tells how far colours, motion and the size of the mask agree.
/// Results have the same bits for any number of threads.
class ObjectFollower {
 public:
  /// @param frame  [3,H,W], the first; kLeastFollowSide high and wide or more, when reduced too
  /// @param masks  [1,H,W] of each object in it, one at least; some pixel above ½
  /// @param human  [1,H,W] of the human; empty: not known
  /// @param longest_side_px  of the pictures that are looked at; larger ones are reduced
  ObjectFollower(const Image& frame, const std::vector<Image>& masks, const Image& human, int longest_side_px);

  /// The masks in the next frame, of the same size. No pixel is in two of them.
  std::vector<FollowedMask> next(const Image& frame, const Image& human);

 private:
  int longest_side_px_;
  Image frame_;                // the last one, reduced
  Image plate_, plate_known_;  // the background as it was last seen, carried along by the camera's motion; 1: it was
  Image background_;           // 1 where it is seen in the last frame
  std::vector<FollowedObject> objects_;
  std::vector<bool> human_is_apart_;  // by object: the human's mask leaves it out in the first frame
};

}  // namespace hsi4d
