#include "pipelines/input/frame_cameras.h"

#include <algorithm>
#include <map>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/log.h"
#include "core/text.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

/// "images/frame_0003.jpg" and "frame_0003.png" are of one frame.
std::string name_of_picture(const std::string& path) { return fs::path(path).stem().string(); }

std::vector<std::string> pictures_of(const std::vector<PictureCamera>& cameras) {
  std::vector<std::string> pictures;
  for (const PictureCamera& one : cameras) pictures.push_back(one.picture);
  return pictures;
}

/// Whether the entries name their pictures. Throws DataError where some do.
bool name_pictures(const std::vector<PictureCamera>& cameras, const fs::path& file) {
  const auto names = [](const PictureCamera& one) { return !one.picture.empty(); };
  const auto count = std::count_if(cameras.begin(), cameras.end(), names);
  if (count == 0 || count == std::ssize(cameras)) return count > 0;
  const auto without = std::find_if_not(cameras.begin(), cameras.end(), names);
  throw DataError(file.string() + ": /frames/" + std::to_string(without - cameras.begin()) +
                  " has no file_path, and others have; by it entries are matched to frames");
}

/// The entry of each picture, by its name. Throws DataError for two of one.
std::map<std::string, std::size_t> entries_by_name(const std::vector<PictureCamera>& cameras, const fs::path& file) {
  std::map<std::string, std::size_t> entries;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const auto [entry, is_new] = entries.try_emplace(name_of_picture(cameras[i].picture), i);
    if (!is_new)
      throw DataError(file.string() + ": /frames/" + std::to_string(entry->second) + " and /frames/" +
                      std::to_string(i) + " are both of \"" + with_escapes(entry->first) +
                      "\" by their file_path; a frame has one camera");
  }
  return entries;
}

bool have_one_lens(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy;
}

/// Throws DataError for a zoom: the frames of a clip have one size and focal length.
void check_one_lens(const std::vector<PictureCamera>& cameras, const fs::path& file, const std::string& reason) {
  for (std::size_t i = 1; i < cameras.size(); ++i) {
    if (!have_one_lens(cameras[i].camera, cameras[0].camera))
      throw DataError(file.string() + ": camera " + std::to_string(i) +
                      " has another size, focal length or principal point than camera 0, and " + reason);
  }
}

constexpr const char* kOneLens = "all frames of a clip are drawn with that of frame 0; allowed: one for all";

/// The names of frames without an entry; entries of no frame are warned of.
std::vector<std::string> compare_names(const std::map<std::string, std::size_t>& entries, const FrameSource& frames,
                                       const std::vector<PictureCamera>& cameras, const fs::path& file) {
  std::vector<std::string> without, strangers;
  for (const std::string& name : frames.names()) {
    if (!entries.contains(name_of_picture(name))) without.push_back(name);
  }
  for (const auto& [name, entry] : entries) {
    if (!frames.has_name(name + ".png")) strangers.push_back(cameras[entry].picture);
  }
  if (!strangers.empty())
    log_warning(file.string() + ": entries whose file_path is of no frame are not used: " + few_names(strangers));
  return without;
}

}  // namespace

Camera first_camera(const fs::path& file, const FrameSource& frames) {
  const std::vector<PictureCamera> cameras = read_picture_cameras(file.string());
  if (!name_pictures(cameras, file)) {
    if (cameras.size() == 1) return cameras.front().camera;
    if (cameras.size() > 1)
      log_info(file.string() + ": holds " + std::to_string(cameras.size()) +
               " cameras without names of pictures; the first is that of frame 0, the others are not used");
    check_one_lens(cameras, file, kOneLens);
    return kept_frames(cameras, frames, file.string(), "cameras", ", or 1").front().camera;
  }
  const std::map<std::string, std::size_t> entries = entries_by_name(cameras, file);
  check_one_lens(cameras, file, kOneLens);
  const std::vector<std::string> without = compare_names(entries, frames, cameras, file);
  const auto entry = entries.find(name_of_picture(frames.names().front()));
  if (entry == entries.end())
    throw DataError(file.string() + ": no entry's file_path is of frame 0, \"" + frames.names().front() + "\"; " +
                    (cameras.size() == 1 ? "the one is" : "there are") + " " + few_names(pictures_of(cameras)));
  if (!without.empty()) log_warning(file.string() + ": no entry's file_path is of the frames " + few_names(without));
  if (cameras.size() > 1)
    log_info(file.string() + ": /frames/" + std::to_string(entry->second) + ", \"" +
             with_escapes(cameras[entry->second].picture) + "\", is the camera of frame 0; the others are not used");
  return cameras[entry->second].camera;
}

std::vector<Camera> cameras_of_frames(const fs::path& file, const FrameSource& frames) {
  const std::vector<PictureCamera> cameras = read_picture_cameras(file.string());
  std::vector<Camera> all;
  if (!name_pictures(cameras, file)) {
    for (const PictureCamera& one : kept_frames(cameras, frames, file.string(), "cameras")) all.push_back(one.camera);
    return all;
  }
  const std::map<std::string, std::size_t> entries = entries_by_name(cameras, file);
  const std::vector<std::string> without = compare_names(entries, frames, cameras, file);
  if (!without.empty())
    throw DataError(file.string() + ": no entry's file_path is of the frames " + few_names(without));
  for (const std::string& name : frames.names()) all.push_back(cameras[entries.at(name_of_picture(name))].camera);
  return all;
}

Camera only_camera(const fs::path& file) {
  const std::vector<Camera> cameras = read_cameras(file.string());
  if (cameras.size() == 1) return cameras.front();
  throw DataError(file.string() + ": holds " + std::to_string(cameras.size()) +
                  " cameras, and there are no frames yet that would tell which is that of frame 0; allowed: 1");
}

Camera camera_for_size(const fs::path& file) {
  const std::vector<PictureCamera> cameras = read_picture_cameras(file.string());
  if (cameras.empty()) throw DataError(file.string() + ": holds no camera");
  check_one_lens(cameras, file, "one is to be chosen for both");
  return cameras.front().camera;
}

std::optional<Camera> intrinsics_of(const fs::path& file) {
  if (file.empty()) return {};
  return camera_for_size(file);
}

}  // namespace hsi4d
