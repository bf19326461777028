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
#include "core/mask_image.h"
#include "core/text.h"
#include "pipelines/photos/colmap.h"
#include "pipelines/photos/inria_cameras.h"

namespace hsi4d {

namespace fs = std::filesystem;

namespace {

constexpr const char* kPictureEndings[] = {".png",  ".jpg", ".jpeg", ".PNG",  ".JPG",
                                           ".JPEG", ".exr", ".tif",  ".tiff", ".webp"};

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

/// Gives every image the mask and the depths of its name. Returns what is wrong.
std::vector<std::string> look_for_files(const Source& source, std::vector<PosedImage>& images) {
  std::vector<std::string> no_mask, no_depth, problems;
  for (PosedImage& image : images) {
    if (!source.masks.empty() && image.mask.empty()) {
      image.mask = beside_picture(source.masks, image.name);
      if (image.mask.empty()) no_mask.push_back(image.name);
    }
    if (!source.depths.empty() && image.depth.empty()) {
      image.depth = beside_picture(source.depths, image.name);
      if (image.depth.empty()) no_depth.push_back(image.name);
    }
  }
  const auto add = [&](const std::vector<std::string>& names, const std::string& what, const fs::path& folder) {
    if (names.empty()) return;
    problems.push_back(source.file.string() + ": " + std::to_string(names.size()) + " of " +
                       std::to_string(images.size()) + " pictures have no " + what + " in " + folder.string() + ": " +
                       few_names(names));
  };
  add(no_mask, "mask", source.masks);
  add(no_depth, "depth", source.depths);
  return problems;
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
  std::set<std::string> seen;
  std::vector<std::string> twice;
  for (const PosedImage& image : images) {
    if (!seen.insert(image.name).second) twice.push_back(image.name);
  }
  if (twice.empty()) return {};
  return {file.string() + ": two cameras are of one picture: " + few_names(twice)};
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
  for (const auto& more : {look_for_named(source.file, set.images), look_for_files(source, set.images)})
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

/// The camera of an entry that gives its field of view alone: of the picture's size, looking through its centre.
void complete_intrinsics(PosedImage& image, double angle_x, const fs::path& folder) {
  const fs::path file = picture_at(folder / image.name);
  if (file.empty()) return;  // told with the others
  const Image picture = read_image(file.string());
  Camera& camera = image.camera;
  camera.width = picture.width();
  camera.height = picture.height();
  camera.fx = camera.fy = 0.5 * camera.width / std::tan(0.5 * angle_x);
  camera.cx = 0.5 * camera.width;
  camera.cy = 0.5 * camera.height;
  check_camera(camera, image.name);
}

PosedImages read_transforms_images(const fs::path& file, const fs::path& pictures) {
  PosedImages set{file, {}, {}};
  const fs::path folder = pictures.empty() ? file.parent_path() : pictures;
  for (const PictureCamera& one : read_photo_cameras(file.string())) {
    if (one.picture.empty()) throw UserError(file.string() + ": an entry has no file_path; which picture is it of?");
    PosedImage image{one.picture, {}, one.mask, one.depth, one.camera, one.lens};
    if (one.angle_x > 0) complete_intrinsics(image, one.angle_x, folder);
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

void check_size(const Image& image, const Camera& camera, const fs::path& file, const char* what) {
  if (image.width() == camera.width && image.height() == camera.height) return;
  throw DataError(file.string() + ": " + what + " of " + std::to_string(image.width()) + " x " +
                  std::to_string(image.height()) + " pixels; its camera has " + std::to_string(camera.width) + " x " +
                  std::to_string(camera.height));
}

/// Camera z of a depth image. Files of whole numbers count units, EXR has the world's.
Image read_depth(const fs::path& file, double unit) {
  const bool is_float = file.extension() == ".exr";
  constexpr float kSixteenBits = 65535;
  Image depth = take_channels(read_image(file.string()), 0, 1);
  for (float& z : depth.data()) {
    if (!is_float) z = static_cast<float>(std::round(z * kSixteenBits) * unit);
    if (!std::isfinite(z) || z < 0)
      throw DataError(file.string() + ": a depth of " + number_text(z) +
                      "; allowed: 0 where it is not known, or above");
  }
  return depth;
}

Image product(Image a, const Image& b) {
  for (int y = 0; y < a.height(); ++y) {
    for (int x = 0; x < a.width(); ++x) a(0, y, x) *= b(0, y, x);
  }
  return a;
}

/// The nearest number of another size: depths across an edge have no mean.
Image nearest(const Image& image, int height, int width) {
  Image result(image.channels(), height, width);
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const int row = static_cast<int>((y + 0.5) * image.height() / height);
        const int col = static_cast<int>((x + 0.5) * image.width() / width);
        result(c, y, x) = image(c, row, col);
      }
    }
  }
  return result;
}

void straighten(const Lens& lens, Photo& photo) {
  if (lens.is_straight()) return;
  StraightImage straight = straightened(photo.color, photo.camera, lens);
  photo.color = std::move(straight.image);
  photo.weight = std::move(straight.seen);
  if (!photo.alpha.empty()) photo.alpha = straightened(photo.alpha, photo.camera, lens).image;
  if (!photo.depth.empty()) photo.depth = product(straightened(photo.depth, photo.camera, lens).image, photo.weight);
}

void reduce(int longest_side, Photo& photo) {
  if (longest_side == 0 || std::max(photo.camera.width, photo.camera.height) <= longest_side) return;
  photo.camera = reduced_camera(photo.camera, longest_side);
  const int height = photo.camera.height, width = photo.camera.width;
  photo.color = resize_area(photo.color, height, width);
  for (Image* image : {&photo.alpha, &photo.weight}) {
    if (!image->empty()) *image = resize_area(*image, height, width);
  }
  if (!photo.depth.empty()) photo.depth = nearest(photo.depth, height, width);
}

}  // namespace

PosedImages read_posed_images(const fs::path& path, const fs::path& pictures) {
  if (fs::is_directory(path)) {
    const fs::path model = colmap_folder(path);
    if (!model.empty()) return read_colmap_images(path, model, pictures);
    for (const char* name : {"transforms.json", "transforms_train.json"}) {
      if (fs::is_regular_file(path / name)) return read_transforms_images(path / name, pictures);
    }
    throw UserError(path.string() +
                    ": no cameras are there; looked for: cameras and images of COLMAP (.bin or .txt; here, in sparse/0 "
                    "and in sparse), transforms.json");
  }
  const std::string text = read_text_file(path.string());
  if (is_inria_cameras(text)) return read_inria_images(path, text, pictures);
  return read_transforms_images(path, pictures);
}

Photo read_photo(const PosedImage& posed, const PhotoRules& rules) {
  Photo photo;
  photo.camera = posed.camera;
  const Image read = read_image(posed.image.string());
  check_size(read, posed.camera, posed.image, "a picture");
  const bool has_alpha = read.channels() == 2 || read.channels() == 4;
  photo.color = take_channels(read, 0, read.channels() - (has_alpha ? 1 : 0));
  if (photo.color.channels() == 1) {
    Image color(3, read.height(), read.width());
    for (int c = 0; c < 3; ++c) std::copy_n(photo.color.row(0, 0), photo.color.plane_stride(), color.row(c, 0));
    photo.color = std::move(color);
  }
  if (has_alpha) photo.alpha = take_channels(read, read.channels() - 1, 1);
  if (!posed.mask.empty()) {
    Image mask = read_mask_image(posed.mask.string());
    check_size(mask, posed.camera, posed.mask, "a mask");
    photo.alpha = photo.alpha.empty() ? std::move(mask) : product(std::move(photo.alpha), mask);
  }
  if (!posed.depth.empty()) {
    photo.depth = read_depth(posed.depth, rules.depth_unit);
    check_size(photo.depth, posed.camera, posed.depth, "depths");
  }
  straighten(posed.lens, photo);
  reduce(rules.longest_side, photo);
  return photo;
}

}  // namespace hsi4d
