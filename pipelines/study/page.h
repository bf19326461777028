// The page of a study.
#pragma once

#include <map>
#include <string>

#include "core/file.h"
#include "pipelines/study/key.h"

namespace hsi4d {

/// What becomes of the answers of a person who is at the end.
struct StudyEnd {
  std::string collect;  ///< http:// or https:// address that they are sent to (POST); empty: they are saved as a file
  std::string completion;  ///< code that is then shown, or the address that is then offered; empty: none
};

/// index.html of a study: one file with style and script, which asks the network for nothing but to take the answers.
/// Of A and B it knows nothing: pairs and the videos of a pair are in the order of their ids.
/// @param videos  what is in the page, MP4 by the videos' names; the page looks for others in videos/NAME.mp4
std::string study_page(const StudyKey& key, const StudyEnd& end, const std::map<std::string, Bytes>& videos);

}  // namespace hsi4d
