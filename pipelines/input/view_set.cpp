#include "pipelines/input/view_set.h"

#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/mask_image.h"
#include "core/size_text.h"
#include "pipelines/input/body_files.h"
#include "pipelines/photos/alignment.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

/// views.json as it is written.
struct ViewSetFile {
  std::string format;
  int version = kViewSetVersion;
  fs::path motion, cameras;
  std::vector<PosedView> views;
  fs::path photos, alignment;
  Index frame = 0;
  int longest_side = 0;
};

/// What a file says twice, or not at all; "": neither.
std::string fault_of_pictures(const ViewSetFile& s) {
  if (s.photos.empty()) return s.views.empty() ? "there is no view, and /photos names no pictures" : "";
  return s.views.empty() && s.cameras.empty()
             ? ""
             : "photographs have cameras of their own; allowed: /cameras and /views, or /photos";
}

void describe(ConfigFields& f, PosedView& v) {
  f.path("image", v.image, {.must_exist = true, .may_be_empty = false}, "A picture").required();
  f.path("mask", v.mask, {.must_exist = true}, "The share of each pixel that shows the human");
  f.integer("camera", v.camera, {.min = 0}, "Its camera, from 0").required();
  f.integer("frame", v.frame, {.min = 0}, "The frame of the motion that it shows, from 0").required();
}

void describe(ConfigFields& f, ViewSetFile& s) {
  f.string("format", s.format, "\"hsi4d views\"").required();
  f.integer("version", s.version, {.min = 1, .max = kViewSetVersion}, "Version of the format").required();
  f.path("motion", s.motion, {.must_exist = true, .may_be_empty = false}, "Poses").required();
  f.path("cameras", s.cameras, {.must_exist = true}, "Cameras");
  f.list("views", s.views, "Pictures", [](ConfigFields& inner, PosedView& view) { describe(inner, view); });
  f.path("photos", s.photos, {.must_exist = true}, "Photographs with cameras, in place of cameras and views");
  f.path("alignment", s.alignment, {.must_exist = true},
         "alignment.json of hsi4d align, from their world to the motion's");
  f.integer("frame", s.frame, {.min = 0}, "The frame of the motion that photographs show");
  f.integer("longest_side", s.longest_side, {.min = 0, .max = 100000}, "Of photographs, px; 0: as they are");
  f.rule({"format"}, [&s] { return s.format == "hsi4d views" ? "" : "is not \"hsi4d views\""; });
  f.rule({"views", "photos"}, [&s] { return fault_of_pictures(s); });
  const std::string alone = "is of photographs; there is no /photos";
  f.rule({"frame", "photos"}, [&s, alone] { return s.photos.empty() && s.frame != 0 ? alone : ""; });
  f.rule({"alignment", "photos"}, [&s, alone] { return s.photos.empty() && !s.alignment.empty() ? alone : ""; });
  f.rule({"longest_side", "photos"}, [&s, alone] { return s.photos.empty() && s.longest_side != 0 ? alone : ""; });
  f.rule({"cameras", "photos"}, [&s] { return s.photos.empty() && s.cameras.empty() ? "not given" : ""; });
}

/// Throws UserError unless camera and frame of every view are there.
void check_numbers(const ViewSet& set) {
  const auto check = [&](std::size_t view, const char* what, Index number, std::size_t count) {
    if (number < static_cast<Index>(count)) return;
    const std::string where = set.photos.empty() ? "/views/" + std::to_string(view) + "/" : "/";
    throw UserError(set.file.string() + ": " + where + what + ": " + std::to_string(number) + "; there are " +
                    std::to_string(count) + ", counted from 0");
  };
  for (std::size_t v = 0; v < set.views.size(); ++v) {
    check(v, "camera", set.views[v].camera, set.cameras.size());
    check(v, "frame", set.views[v].frame, set.motion.poses.size());
  }
}

/// The image, unless it has another size than its camera.
Image sized(Image image, const fs::path& file, const Camera& camera) {
  if (image.width() == camera.width && image.height() == camera.height) return image;
  throw DataError(file.string() + ": is " + size_text(image) + " pixels; its camera has " + size_text(camera));
}

ViewImage image_of_frame(const ClipVideo& video, const PosedView& view, const Camera& camera) {
  ClipFrame frame = read_frame(video, camera, view.frame);
  return {std::move(frame.target), std::move(frame.human_mask)};
}

ViewImage image_of_file(const PosedView& view, const Camera& camera) {
  const Image image = sized(read_image(view.image.string()), view.image, camera);
  if (image.channels() < 3) throw DataError(view.image.string() + ": is grey; a picture has three channels");
  ViewImage result{take_channels(image, 0, 3), {}};
  if (!view.mask.empty()) {
    result.mask = sized(read_mask_image(view.mask.string()), view.mask, camera);
  } else if (image.channels() == 4) {
    result.mask = take_channels(image, 3, 1);
  }
  return result;
}

ViewImage image_of_photo(const PosedImage& posed, const PhotoRules& rules) {
  Photo photo = read_photo(posed, rules);
  return {std::move(photo.color), std::move(photo.alpha), std::move(photo.weight)};
}

/// Every photograph becomes a view of the same frame.
void add_photos(const ViewSetFile& read, ViewSet& set) {
  PosedImages found = read_posed_images(read.photos);
  set.photos = std::move(found.images);
  set.cameras_file = found.file;
  set.photo_rules.longest_side = read.longest_side;
  Similarity to_motion;
  if (!read.alignment.empty())
    to_motion = decode_alignment(read_text_file(read.alignment.string()), read.alignment.string());
  for (PosedImage& photo : set.photos) {
    photo.depth.clear();  // nobody asks for it
    photo.camera = moved_camera(photo.camera, to_motion);
    set.views.push_back({photo.image, photo.mask, std::ssize(set.cameras), read.frame});
    set.cameras.push_back(photo_camera(photo, set.photo_rules));
  }
}

}  // namespace

std::vector<fs::path> ViewSet::files() const {
  std::vector<fs::path> all = {file, motion_file, cameras_file};
  if (video) all.push_back(video->frames.file());
  for (const PosedView& view : views) {
    if (!view.image.empty()) all.push_back(view.image);
    if (!view.mask.empty()) all.push_back(view.mask);
  }
  return all;
}

ViewSet read_view_set(const fs::path& file) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, {}, problems);
  const ViewSetFile read = read_settings<ViewSetFile>(tree, problems);
  ViewSet set;
  set.file = file;
  set.motion = read_motion_with_warnings(read.motion.string());
  set.motion_file = read.motion;
  if (read.photos.empty()) {
    set.cameras = read_cameras(read.cameras.string());
    set.views = read.views;
    set.cameras_file = read.cameras;
  } else {
    add_photos(read, set);
  }
  check_begins_with_frame_0(set.motion, read.motion.string(),
                            "views count its poses from 0 (\"frame\"), so one that begins there is needed");
  check_numbers(set);
  return set;
}

std::string view_set_json(const std::string& motion, const std::string& cameras, const std::vector<PosedView>& views) {
  ConfigValue root = ConfigValue::make_object();
  root.add("format", ConfigValue::make_string("hsi4d views"));
  root.add("version", ConfigValue::make_number(static_cast<double>(kViewSetVersion)));
  root.add("motion", ConfigValue::make_string(motion));
  root.add("cameras", ConfigValue::make_string(cameras));
  std::vector<ConfigValue> list;
  for (const PosedView& view : views) {
    ConfigValue entry = ConfigValue::make_object();
    entry.add("image", ConfigValue::make_string(view.image.generic_string()));
    if (!view.mask.empty()) entry.add("mask", ConfigValue::make_string(view.mask.generic_string()));
    entry.add("camera", ConfigValue::make_number(static_cast<double>(view.camera)));
    entry.add("frame", ConfigValue::make_number(static_cast<double>(view.frame)));
    list.push_back(std::move(entry));
  }
  root.add("views", ConfigValue::make_array(std::move(list)));
  return to_json(root);
}

ViewImage view_image(const ViewSet& set, const PosedView& view, const Vector3<double>& background) {
  const auto number = static_cast<std::size_t>(view.camera);
  const Camera& camera = set.cameras[number];
  ViewImage result = set.video             ? image_of_frame(*set.video, view, camera)
                     : !set.photos.empty() ? image_of_photo(set.photos[number], set.photo_rules)
                                           : image_of_file(view, camera);
  if (result.mask.empty()) return result;
  for (int c = 0; c < 3; ++c) {
    const auto behind = static_cast<float>(background[c]);
    for (int y = 0; y < result.color.height(); ++y) {
      const float* const share = result.mask.row(0, y);
      float* const color = result.color.row(c, y);
      for (int x = 0; x < result.color.width(); ++x) color[x] = share[x] * color[x] + (1 - share[x]) * behind;
    }
  }
  return result;
}

}  // namespace hsi4d
