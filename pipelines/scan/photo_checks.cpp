#include "pipelines/scan/photo_checks.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "core/check.h"
#include "core/log.h"
#include "core/memory.h"
#include "core/text.h"
#include "pipelines/scan/fit.h"
#include "pipelines/scan/start.h"

namespace hsi4d {

namespace fs = std::filesystem;

namespace {

std::string size_text(const Camera& camera) {
  return std::to_string(camera.width) + " x " + std::to_string(camera.height);
}

void check_one_size(const ScanSettings& settings, const PosedImages& set) {
  const PosedImage& first = set.images.front();
  const Camera wanted = photo_camera(first, settings.photos.rules);
  for (const PosedImage& image : set.images) {
    const Camera camera = photo_camera(image, settings.photos.rules);
    if (camera.width == wanted.width && camera.height == wanted.height) continue;
    throw UserError(set.file.string() + ": " + first.name + " has " + size_text(wanted) + " pixels, " + image.name +
                    " has " + size_text(camera) + "; allowed: one size");
  }
}

/// Colour, alpha, weight and depth of all pictures, as floats.
void check_memory(const ScanSettings& settings, const PosedImages& set) {
  double numbers = 0;
  for (const PosedImage& image : set.images) {
    const Camera camera = photo_camera(image, settings.photos.rules);
    const int planes = 4 + (image.mask.empty() && image.lens.is_straight() ? 0 : 1) + (image.depth.empty() ? 0 : 1);
    numbers += static_cast<double>(planes) * camera.width * camera.height;
  }
  const double asked = numbers * sizeof(float) / kBytesPerMb, there = available_memory_mb();
  if (there == 0 || asked < there) return;
  throw UserError(set.file.string() + ": " + std::to_string(set.images.size()) + " pictures of " +
                  size_text(photo_camera(set.images.front(), settings.photos.rules)) + " pixels take " +
                  rounded(asked, 3) + " MB; " + rounded(there, 3) + " MB are there. /photos/longest_side reduces them");
}

/// The widest angle between lines from cameras to what they look at, degrees.
double widest_angle(const std::vector<Vector3<double>>& ways) {
  double widest = 0;
  for (const Vector3<double>& a : ways) {
    for (const Vector3<double>& b : ways) widest = std::max(widest, std::atan2(a.cross(b).norm(), a.dot(b)));
  }
  return widest * 180 / std::numbers::pi;
}

void check_places(const PosedImages& set) {
  constexpr double kOnePlace = 1e-6;  // of the distance to what is looked at
  constexpr double kOneSide = 5;      // degrees
  std::vector<Camera> cameras;
  for (const PosedImage& image : set.images) cameras.push_back(image.camera);
  const Vector3<double> target = looked_at(cameras), first = camera_center_world(cameras.front());
  std::vector<Vector3<double>> ways;
  double spread = 0, distance = 0;
  for (const Camera& camera : cameras) {
    const Vector3<double> center = camera_center_world(camera);
    ways.push_back(center - target);
    spread = std::max(spread, (center - first).norm());
    distance = std::max(distance, ways.back().norm());
  }
  if (!(spread > kOnePlace * std::max(distance, kOnePlace)))
    throw UserError(set.file.string() + ": " + std::to_string(cameras.size()) +
                    (cameras.size() == 1 ? " picture tells" : " pictures from one place tell") +
                    " nothing of depth; allowed: pictures from several places");
  const double degrees = widest_angle(ways);
  if (degrees < kOneSide)
    log_warning(set.file.string() + ": all pictures are taken from one side, within " + rounded(degrees, 2) +
                " degrees: depths will be guessed, and other sides stay empty");
}

void check_some_learnt(const ScanSettings& settings, const PosedImages& set) {
  const std::vector<bool> held = held_photos(settings.photos, set.images.size());
  if (std::find(held.begin(), held.end(), false) != held.end()) return;
  throw UserError(settings.file.string() + ": /photos/hold_every: " + std::to_string(settings.photos.hold_every) +
                  " holds back all of " + std::to_string(held.size()) +
                  " pictures; allowed: 0 for none, or 2 and more");
}

/// Whether an image that is there is 0 everywhere.
bool is_black(const Image& image) {
  const std::span<const float> numbers = image.data();
  return !image.empty() && std::all_of(numbers.begin(), numbers.end(), [](float x) { return x == 0; });
}

/// The median of some numbers; 0 of none.
float median(std::vector<float> numbers) {
  if (numbers.empty()) return 0;
  const auto middle = numbers.begin() + std::ssize(numbers) / 2;
  std::nth_element(numbers.begin(), middle, numbers.end());
  return *middle;
}

/// Median of the depths that are known; 0: none is.
float median_depth(const Photo& photo) {
  const std::span<const float> all = photo.depth.data();
  std::vector<float> known;
  std::copy_if(all.begin(), all.end(), std::back_inserter(known), [](float z) { return z > 0; });
  return median(std::move(known));
}

/// A camera within a wall or a thing sees the inside of its surface, far nearer than what most cameras see.
void tell_inside(const PosedImages& set, const std::vector<Photo>& photos) {
  constexpr float kInside = 0.02F;  // of the median of all pictures' median depths
  std::vector<float> depths, known;
  for (const Photo& photo : photos) depths.push_back(photo.depth.empty() ? 0 : median_depth(photo));
  std::copy_if(depths.begin(), depths.end(), std::back_inserter(known), [](float z) { return z > 0; });
  const float usual = median(std::move(known));
  std::vector<std::string> inside;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    if (depths[i] > 0 && depths[i] < kInside * usual) inside.push_back(set.images[i].name);
  }
  if (inside.empty()) return;
  log_warning(set.file.string() + ": half of what " + std::to_string(inside.size()) + " of " +
              std::to_string(photos.size()) + " pictures show is nearer than " + rounded(kInside * usual, 2) +
              ", the median of all is " + rounded(usual, 2) + ": cameras in a wall? " + few_names(inside));
}

std::string size_of(const fs::path& file) { return file.empty() ? "-" : std::to_string(fs::file_size(file)); }

}  // namespace

void check_photo_cameras(const ScanSettings& settings, const PosedImages& set) {
  check_some_learnt(settings, set);
  check_one_size(settings, set);
  check_places(set);
  check_memory(settings, set);
}

void check_what_counts(const ScanSettings& settings, const PosedImages& set, const std::vector<Photo>& photos) {
  std::vector<std::string> empty;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    if (is_black(photos[i].alpha) || is_black(photos[i].weight)) empty.push_back(set.images[i].name);
  }
  const std::string text =
      set.file.string() + ": " + std::to_string(empty.size()) + " of " + std::to_string(photos.size()) + " pictures ";
  if (empty.size() == photos.size())
    throw UserError(text + "show nothing that counts: masks or alpha are black everywhere. White is what counts");
  if (!empty.empty()) log_warning(text + "show nothing that counts, by mask or alpha: " + few_names(empty));
  const bool any_depth =
      std::any_of(photos.begin(), photos.end(), [](const Photo& photo) { return !photo.depth.empty(); });
  if (reads_depths(settings.stage) && !any_depth)
    log_info(set.file.string() + ": has no depths; losses that read them are off");
  tell_inside(set, photos);
  if (settings.kind != ScanKind::kObject) return;
  const auto without =
      std::count_if(photos.begin(), photos.end(), [](const Photo& photo) { return photo.alpha.empty(); });
  if (without > 0)
    log_warning(set.file.string() + ": " + std::to_string(without) + " of " + std::to_string(photos.size()) +
                " pictures have neither alpha nor mask: what is behind the object becomes a part of it");
}

std::string photo_identity(const PosedImages& set) {
  std::string text;
  for (const PosedImage& image : set.images) {
    text += image.name + " " + size_of(image.image) + " " + size_of(image.mask) + " " + size_of(image.depth);
    const Camera& c = image.camera;
    for (const double number :
         {c.fx, c.fy, c.cx, c.cy, image.lens.k1, image.lens.k2, image.lens.k3, image.lens.p1, image.lens.p2})
      text += " " + number_text(number);
    const Matrix4<double> matrix = matrix_from_rigid(c.camera_from_world);
    for (Index i = 0; i < 12; ++i) text += " " + number_text(matrix(i / 4, i % 4));
    text += "\n";
  }
  return text;
}

}  // namespace hsi4d
