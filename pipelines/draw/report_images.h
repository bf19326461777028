// The images of a report: those of a run's frames/, made small enough for one file.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "core/file.h"

namespace hsi4d {

/// The images of a frame that a report takes, frames/NNNN_KIND.png: the video, the result, what the run was given, and
/// the result from another side. Differences are made of the first two where they are looked at.
inline constexpr std::array<std::string_view, 4> kFrameKinds = {"target", "render", "start", "side"};

/// Every frame but the given one should have these, the first of kFrameKinds; others are not written by every run.
inline constexpr size_t kNeededKinds = 2;

/// A difference image shows differences this many times as large as they are.
inline constexpr int kDifferenceGain = 4;

struct FrameImages {
  int frame = 0;
  std::array<Bytes, kFrameKinds.size()> files;  ///< PNG or JPEG, in the order of kFrameKinds; empty: there is none
};

/// How much the images of a report may take.
struct ImageBudget {
  size_t wanted = 3'600'000;  ///< bytes; more are written as JPEG, of lower quality and fewer pixels the more there are
  size_t most = 24'000'000;   ///< bytes beyond which frames are left out: every second stays, or every third, ...
};

/// Reads the images of a folder, in the order of the frames. Files as they are where that is little enough, which a
/// sample of frames tells.
///
/// @param notes  receives what is missing, no image, or left out, a sentence each
std::vector<FrameImages> read_frame_images(const std::string& folder, std::vector<std::string>& notes,
                                           const ImageBudget& budget = {});

/// Of a PNG or JPEG file: "image/png", "image/jpeg"; empty for others.
std::string_view image_mime(const Bytes& file);

}  // namespace hsi4d
