#include "pipelines/photos/posed_images.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_parse.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/text.h"
#include "pipelines/photos/colmap.h"
#include "pipelines/photos/inria_cameras.h"

namespace hsi4d {

namespace fs = std::filesystem;

namespace {

constexpr const char* kPictureEndings[] = {".png",  ".jpg", ".jpeg", ".PNG",  ".JPG",
                                           ".JPEG", ".exr", ".tif",  ".tiff", ".webp"};

constexpr const char* kAllowed =
    "a folder with a model of COLMAP (here, in sparse/0 or in sparse) or a transforms.json, a transforms.json, INRIA's "
    "cameras.json";

bool is_picture(const fs::path& file) {
  return std::any_of(std::begin(kPictureEndings), std::end(kPictureEndings),
                     [&](const char* ending) { return file.extension() == ending; });
}

/// The file of that name, or of that name and an ending of pictures; empty: there is none.
fs::path picture_at(const fs::path& path) {
  if (fs::is_regular_file(path)) return path;
  for (const char* ending : kPictureEndings) {
    const fs::path with_ending = path.string() + ending;
    if (fs::is_regular_file(with_ending)) return with_ending;
  }
  return {};
}

/// The mask or depth of a picture in a folder: under its name, its name and an ending, or its name with another ending.
fs::path beside_picture(const fs::path& folder, const std::string& name) {
  const fs::path found = picture_at(folder / name);
  return found.empty() ? picture_at(folder / fs::path(name).replace_extension()) : found;
}

/// What a set was read from, and where its pictures are looked for.
struct Source {
  fs::path file, pictures, masks, depths;  // masks and depths: folders that are there, or empty
};

fs::path folder_if_there(const fs::path& folder) { return fs::is_directory(folder) ? folder : fs::path(); }

/// Gives every image its picture. Cameras without one are left out, which the log tells.
void look_for_pictures(const Source& source, std::vector<PosedImage>& images) {
  std::vector<std::string> missing;
  for (PosedImage& image : images) {
    image.image = picture_at(source.pictures / image.name);
    if (image.image.empty()) missing.push_back(image.name);
  }
  if (missing.empty()) return;
  const std::string text = source.file.string() + ": " + std::to_string(missing.size()) + " of " +
                           std::to_string(images.size()) + " cameras have no picture in " + source.pictures.string();
  if (missing.size() == images.size()) throw UserError(text + ": " + few_names(missing));
  log_warning(text + " and are left out: " + few_names(missing));
  std::erase_if(images, [](const PosedImage& image) { return image.image.empty(); });
}

/// A folder of masks or depths that fits no picture. Returns what is wrong.
std::vector<std::string> fits_none(const fs::path& folder, const std::vector<PosedImage>& images,
                                   fs::path PosedImage::*kind) {
  const auto has = [kind](const PosedImage& image) { return !(image.*kind).empty(); };
  if (folder.empty() || fs::is_empty(folder) || std::any_of(images.begin(), images.end(), has)) return {};
  return {folder.string() + ": no file there has the name of a picture, such as " + images.front().name};
}

/// Gives every image the mask and the depths of its name, where there are folders of them.
void look_for_files(const Source& source, std::vector<PosedImage>& images) {
  for (PosedImage& image : images) {
    if (!source.masks.empty() && image.mask.empty()) image.mask = beside_picture(source.masks, image.name);
    if (!source.depths.empty() && image.depth.empty()) image.depth = beside_picture(source.depths, image.name);
  }
}

/// Masks and depths that entries name themselves.
std::vector<std::string> look_for_named(const fs::path& file, std::vector<PosedImage>& images) {
  std::vector<std::string> problems;
  for (PosedImage& image : images) {
    for (fs::path* path : {&image.mask, &image.depth}) {
      if (path->empty()) continue;
      const fs::path found = picture_at(path->is_absolute() ? *path : file.parent_path() / *path);
      if (found.empty())
        problems.push_back(file.string() + ": " + image.name + " names " + path->string() + ", which is not there");
      *path = found;
    }
  }
  return problems;
}

std::vector<std::string> named_twice(const fs::path& file, const std::vector<PosedImage>& images) {
  std::set<fs::path> seen;
  std::vector<std::string> twice;
  for (const PosedImage& image : images) {
    if (!seen.insert(fs::weakly_canonical(image.image)).second) twice.push_back(image.name);
  }
  if (twice.empty()) return {};
  return {file.string() + ": two cameras are of one picture: " + few_names(twice)};
}

/// Masks, or depths, of some pictures alone: what do the others mean?
std::vector<std::string> only_some(const fs::path& file, const std::vector<PosedImage>& images,
                                   fs::path PosedImage::*kind, const std::string& what) {
  std::vector<std::string> without;
  for (const PosedImage& image : images) {
    if ((image.*kind).empty()) without.push_back(image.name);
  }
  if (without.empty() || without.size() == images.size()) return {};
  return {file.string() + ": " + std::to_string(without.size()) + " of " + std::to_string(images.size()) +
          " pictures have no " + what + ": " + few_names(without) + "; allowed: all have one, or none"};
}

/// Pictures beside those that have a camera.
void tell_left_out(const Source& source, const std::vector<PosedImage>& images) {
  std::set<fs::path> known, folders;
  for (const PosedImage& image : images) {
    known.insert(fs::weakly_canonical(image.image));
    folders.insert(image.image.parent_path());
  }
  std::vector<std::string> left_out;
  for (const fs::path& folder : folders) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      const fs::path& file = entry.path();
      if (!entry.is_regular_file() || !is_picture(file) || is_hidden(file.filename().string())) continue;
      const bool is_other = std::any_of(images.begin(), images.end(), [&](const PosedImage& image) {
        return image.mask == file || image.depth == file;
      });
      if (!is_other && !known.contains(fs::weakly_canonical(file))) left_out.push_back(file.filename().string());
    }
  }
  std::sort(left_out.begin(), left_out.end());
  if (left_out.empty()) return;
  log_warning(source.file.string() + ": " + std::to_string(left_out.size()) +
              " pictures have no camera and are left out: " + few_names(left_out));
}

PosedImages checked(const Source& source, PosedImages set) {
  if (set.images.empty()) throw UserError(source.file.string() + ": holds no camera of a picture");
  look_for_pictures(source, set.images);
  std::vector<std::string> problems = named_twice(source.file, set.images);
  const std::vector<std::string> unnamed = look_for_named(source.file, set.images);
  look_for_files(source, set.images);
  if (!unnamed.empty()) throw UserError(joined(unnamed, "\n"));
  for (const auto& more : {fits_none(source.masks, set.images, &PosedImage::mask),
                           fits_none(source.depths, set.images, &PosedImage::depth),
                           only_some(source.file, set.images, &PosedImage::mask, "mask"),
                           only_some(source.file, set.images, &PosedImage::depth, "depths")})
    problems.insert(problems.end(), more.begin(), more.end());
  if (!problems.empty()) throw UserError(joined(problems, "\n"));
  std::sort(set.images.begin(), set.images.end(),
            [](const PosedImage& a, const PosedImage& b) { return a.name < b.name; });
  tell_left_out(source, set.images);
  return set;
}

PosedImages read_colmap_images(const fs::path& folder, const fs::path& model, const fs::path& pictures) {
  PosedImages set{model, {}, {}};
  ColmapModel read = read_colmap(model);
  set.images = std::move(read.images);
  set.points = std::move(read.points);
  const fs::path images = pictures.empty() ? folder / "images" : pictures;
  return checked({model, images, folder_if_there(folder / "masks"), folder_if_there(folder / "depths")},
                 std::move(set));
}

/// A number of the file, where it has one.
double given_or(double given, double otherwise) { return given != 0 ? given : otherwise; }

/// The camera of an entry that gives a field of view: what the file does not say, the picture's size does.
void complete_intrinsics(PosedImage& image, const PictureCamera& entry, const fs::path& folder) {
  const fs::path file = picture_at(folder / image.name);
  if (file.empty()) return;  // left out
  const Image picture = read_image(file.string());
  Camera& camera = image.camera;
  camera.width = static_cast<int>(given_or(camera.width, picture.width()));
  camera.height = static_cast<int>(given_or(camera.height, picture.height()));
  camera.fx = 0.5 * camera.width / std::tan(0.5 * entry.angle_x);
  const double fy = entry.angle_y > 0 ? 0.5 * camera.height / std::tan(0.5 * entry.angle_y) : camera.fx;
  camera.fy = given_or(camera.fy, fy);
  camera.cx = given_or(camera.cx, 0.5 * camera.width);
  camera.cy = given_or(camera.cy, 0.5 * camera.height);
  check_camera(camera, image.name);
}

PosedImages read_transforms_images(const fs::path& file, const fs::path& pictures) {
  PosedImages set{file, {}, {}};
  const fs::path folder = pictures.empty() ? file.parent_path() : pictures;
  for (const PictureCamera& one : read_photo_cameras(file.string())) {
    if (one.picture.empty())
      throw UserError(file.string() +
                      ": an entry names no picture (file_path), as in a file of cameras alone; allowed: " + kAllowed);
    PosedImage image{one.picture, {}, one.mask, one.depth, one.camera, one.lens};
    if (one.angle_x > 0) complete_intrinsics(image, one, folder);
    set.images.push_back(std::move(image));
  }
  return checked({file, folder, {}, {}}, std::move(set));
}

PosedImages read_inria_images(const fs::path& file, const std::string& text, const fs::path& pictures) {
  PosedImages set{file, decode_inria_cameras(text, file.string()), {}};
  const fs::path beside = file.parent_path() / "images";
  const fs::path folder = !pictures.empty() ? pictures : fs::is_directory(beside) ? beside : file.parent_path();
  return checked({file, folder, {}, {}}, std::move(set));
}

}  // namespace

PosedImages read_posed_images(const fs::path& path, const fs::path& pictures) {
  if (fs::is_directory(path)) {
    const fs::path model = colmap_folder(path);
    if (!model.empty()) return read_colmap_images(path, model, pictures);
    for (const char* name : {"transforms.json", "transforms_train.json"}) {
      if (fs::is_regular_file(path / name)) return read_transforms_images(path / name, pictures);
    }
    throw UserError(path.string() + ": no cameras are there; allowed: " + kAllowed);
  }
  if (is_picture(path)) throw UserError(path.string() + ": is a picture; allowed: " + kAllowed);
  const std::string text = read_text_file(path.string());
  if (is_inria_cameras(text)) return read_inria_images(path, text, pictures);
  return read_transforms_images(path, pictures);
}

}  // namespace hsi4d
