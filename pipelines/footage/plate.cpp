#include "pipelines/footage/plate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "core/check.h"
#include "core/parallel.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/draw/image_of_scene.h"
#include "splat/sh_basis.h"

namespace hsi4d {

namespace {

constexpr Index kMostFrames = 48;
constexpr double kMostUnrest = 0.5;   // pixels
constexpr double kLeastSlope = 0.04;  // of an edge, a pixel

// ---- The median ----

struct PlateFrame {
  Image image;  // [3,H,W]
  Image shown;  // [1,H,W], 1 where it is the background's
};

std::vector<PlateFrame> read_plate_frames(const ClipVideo& video, const Camera& size) {
  const Index all = video.frames.count(), count = std::min(all, kMostFrames);
  std::vector<PlateFrame> frames;
  for (Index i = 0; i < count; ++i) {
    ClipFrame read = read_frame(video, size, i * all / count);
    Image shown = background_of(read);
    frames.push_back({std::move(read.target), std::move(shown)});
  }
  return frames;
}

float median(std::vector<float>& values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return (*std::max_element(values.begin(), middle) + *middle) / 2;
}

/// The plate where it is seen; `seen` is 1 there.
void take_medians(const std::vector<PlateFrame>& frames, Image& plate, Image& seen) {
  parallel_for(plate.height(), 1, [&](Index begin, Index end) {
    std::vector<float> values;
    for (int y = static_cast<int>(begin); y < end; ++y) {
      for (int x = 0; x < plate.width(); ++x) {
        for (int c = 0; c < 3; ++c) {
          values.clear();
          for (const PlateFrame& frame : frames) {
            if (frame.shown(0, y, x) != 0) values.push_back(frame.image(c, y, x));
          }
          if (values.empty()) break;
          plate(c, y, x) = median(values);
          seen(0, y, x) = 1;
        }
      }
    }
  });
}

/// Fills what is not seen from what is around it: means of seen pixels, at half the size where there are none.
/// [Gortler et al. 1996, pull and push]
void fill_holes(Image& plate, const Image& seen) {
  const int width = plate.width(), height = plate.height();
  if (width == 1 && height == 1) return;
  const int half_width = (width + 1) / 2, half_height = (height + 1) / 2;
  Image half(3, half_height, half_width), half_seen(1, half_height, half_width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (seen(0, y, x) == 0) continue;
      half_seen(0, y / 2, x / 2) += 1;
      for (int c = 0; c < 3; ++c) half(c, y / 2, x / 2) += plate(c, y, x);
    }
  }
  for (int y = 0; y < half_height; ++y) {
    for (int x = 0; x < half_width; ++x) {
      const float count = half_seen(0, y, x);
      for (int c = 0; c < 3 && count > 0; ++c) half(c, y, x) /= count;
    }
  }
  fill_holes(half, half_seen);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (seen(0, y, x) != 0) continue;  // else from the four halves around its centre
      const int y0 = y / 2, x0 = x / 2;
      const int y1 = std::clamp(y0 + (y % 2 == 0 ? -1 : 1), 0, half_height - 1),
                x1 = std::clamp(x0 + (x % 2 == 0 ? -1 : 1), 0, half_width - 1);
      for (int c = 0; c < 3; ++c)
        plate(c, y, x) = (9 * half(c, y0, x0) + 3 * half(c, y0, x1) + 3 * half(c, y1, x0) + half(c, y1, x1)) / 16;
    }
  }
}

double grey(const Image& image, int y, int x) {
  return (static_cast<double>(image(0, y, x)) + static_cast<double>(image(1, y, x)) +
          static_cast<double>(image(2, y, x))) /
         3;
}

/// As Plate::unrest_px, of one frame: difference from the plate over slope, at the frame's edges. Nothing where it has
/// none.
std::optional<float> unrest_of(const PlateFrame& frame, const Image& plate, const Image& seen) {
  const Image& image = frame.image;
  std::vector<float> distances;
  for (int y = 1; y + 1 < plate.height(); ++y) {
    for (int x = 1; x + 1 < plate.width(); ++x) {
      if (frame.shown(0, y, x) == 0 || seen(0, y, x) == 0) continue;
      const double slope =
          std::hypot(grey(image, y, x + 1) - grey(image, y, x - 1), grey(image, y + 1, x) - grey(image, y - 1, x)) / 2;
      if (slope < kLeastSlope) continue;
      distances.push_back(static_cast<float>(std::abs(grey(image, y, x) - grey(plate, y, x)) / slope));
    }
  }
  return distances.empty() ? std::optional<float>() : median(distances);
}

double unrest_of(const std::vector<PlateFrame>& frames, const Image& plate, const Image& seen) {
  std::vector<float> all;
  for (const PlateFrame& frame : frames) {
    if (const std::optional<float> of_frame = unrest_of(frame, plate, seen)) all.push_back(*of_frame);
  }
  if (all.empty()) return 0;
  std::sort(all.begin(), all.end());
  return static_cast<double>(all[(all.size() - 1) * 9 / 10]);
}

// ---- Its Gaussians ----

/// A point of ground or wall that a pixel shows.
struct PlatePoint {
  Vector3<double> place, normal;
};

class PlateSurfaces {
 public:
  PlateSurfaces(const Camera& camera, double wall_distance)
      : camera_(camera), center_(camera_center_world(camera)), wall_distance_(wall_distance) {
    const Vector3<double> forward = camera.camera_from_world.rotation.row(2).transpose();
    across_ = Vector3<double>(forward[0], forward[1], 0);
    if (across_.norm() < 1e-6) across_ = Vector3<double>::UnitY();  // straight down: a wall that nothing reaches
    across_.normalize();
  }

  PlatePoint at(double u, double v) const {
    const Vector3<double> ray =
        camera_.camera_from_world.rotation.transpose() * unproject_pixel(camera_, Vector2<double>(u, v), 1.0);
    const double ahead = ray.dot(across_);
    const std::optional<double> to_wall =
        ahead > kLeastAhead ? std::optional(wall_distance_ / ahead) : std::optional<double>();
    if (ray[2] < 0 && (!to_wall || -center_[2] / ray[2] < *to_wall))
      return {center_ - center_[2] / ray[2] * ray, Vector3<double>::UnitZ()};
    if (to_wall) return {center_ + *to_wall * ray, across_};
    return {center_ + wall_distance_ * ray,
            camera_.camera_from_world.rotation.row(2).transpose()};  // behind the zenith
  }

 private:
  static constexpr double kLeastAhead = 0.05;  // of a ray: flatter ones would meet the wall far above the camera
  const Camera& camera_;
  Vector3<double> center_, across_;
  double wall_distance_;
};

/// Axes and log scales of a disc in the plane that is round in the image, `radius` pixels wide.
///
/// With J the derivative of the pixel by the place and B = [e1 e2] of the plane, Σ = r² B (BᵀJᵀJB)⁻¹ Bᵀ gives
/// J Σ Jᵀ = r² I.
void shape_disc(const Camera& camera, const PlatePoint& point, double radius, float* quat, float* log_scales) {
  const Vector3<double> p = transform_point(camera.camera_from_world, point.place);
  Eigen::Matrix<double, 2, 3> from_camera;
  from_camera << camera.fx / p[2], 0, -camera.fx * p[0] / (p[2] * p[2]),  //
      0, camera.fy / p[2], -camera.fy * p[1] / (p[2] * p[2]);
  const Vector3<double> e1 = point.normal.unitOrthogonal(), e2 = point.normal.cross(e1);
  Eigen::Matrix<double, 3, 2> plane;
  plane << e1, e2;
  const Eigen::Matrix2d a = from_camera * camera.camera_from_world.rotation * plane;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(a.transpose() * a);
  const Vector3<double> first = (plane * solver.eigenvectors().col(0)).normalized();
  Matrix3<double> axes;
  axes << first, point.normal.cross(first), point.normal;
  const Eigen::Quaterniond q(axes);
  constexpr double kFlatness = 0.02;
  const double wide = radius / std::sqrt(solver.eigenvalues()[0]), narrow = radius / std::sqrt(solver.eigenvalues()[1]);
  const std::array<double, 4> quats = {q.w(), q.x(), q.y(), q.z()};
  const std::array<double, 3> scales = {wide, narrow, kFlatness * narrow};
  for (std::size_t i = 0; i < 4; ++i) quat[i] = static_cast<float>(quats[i]);
  for (std::size_t i = 0; i < 3; ++i) log_scales[i] = static_cast<float>(std::log(scales[i]));
}

/// The mean of a cell of the image, which may lie outside; then of the nearest pixels.
Vector3<double> cell_mean(const Image& image, int left, int top, int size) {
  Vector3<double> sum = Vector3<double>::Zero();
  for (int y = top; y < top + size; ++y) {
    for (int x = left; x < left + size; ++x) {
      const int row = std::clamp(y, 0, image.height() - 1), column = std::clamp(x, 0, image.width() - 1);
      for (int c = 0; c < 3; ++c) sum[c] += static_cast<double>(image(c, row, column));
    }
  }
  return sum / (size * size);
}

/// Cells of the image and around it, each with a Gaussian in its middle.
class PlateCells {
 public:
  /// @param around  pixels, at least one cell: the Gaussians of that ring reach in
  PlateCells(const Image& plate, int size, int around)
      : size_(size), ring_(std::max(1, around / size)), columns_(count(plate.width())), rows_(count(plate.height())) {}

  std::size_t count() const { return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_); }
  int left(std::size_t cell) const { return (static_cast<int>(cell) % columns_ - ring_) * size_; }
  int top(std::size_t cell) const { return (static_cast<int>(cell) / columns_ - ring_) * size_; }
  /// The nearest cell that reaches the image: those of the innermost ring do.
  std::size_t nearest_inside(std::size_t cell) const {
    const auto held = [this](int at, int all) { return std::clamp(at, ring_ - 1, all - ring_); };
    const int column = held(static_cast<int>(cell) % columns_, columns_),
              row = held(static_cast<int>(cell) / columns_, rows_);
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  }

 private:
  int count(int pixels) const { return (pixels + size_ - 1) / size_ + 2 * ring_; }
  int size_, ring_, columns_, rows_;
};

/// Adds to every Gaussian's colour what the render lacks of the plate in its cell; further out it is that of the
/// nearest of these.
void correct_colors(const Image& plate, const Image& rendered, const PlateCells& cells, int size, Gaussians& g) {
  Image missing = plate;
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < plate.height(); ++y) {
      for (int x = 0; x < plate.width(); ++x) missing(c, y, x) -= rendered(c, y, x);
    }
  }
  constexpr auto kMost = static_cast<float>(0.5 / kShC0);  // colours are 0 to 1
  for (std::size_t i = 0; i < cells.count(); ++i) {
    if (cells.nearest_inside(i) != i) continue;
    const Vector3<double> step = cell_mean(missing, cells.left(i), cells.top(i), size) / kShC0;
    for (std::size_t c = 0; c < 3; ++c) {
      float& number = g.sh[3 * i + c];
      number = std::clamp(number + static_cast<float>(step[static_cast<Index>(c)]), -kMost, kMost);
    }
  }
  for (std::size_t i = 0; i < cells.count(); ++i)
    std::copy_n(g.sh.begin() + static_cast<std::ptrdiff_t>(3 * cells.nearest_inside(i)), 3,
                g.sh.begin() + static_cast<std::ptrdiff_t>(3 * i));
}

}  // namespace

Plate plate_of(const ClipVideo& video, const Camera& size) {
  std::vector<PlateFrame> frames = read_plate_frames(video, size);
  Plate plate{Image(3, size.height, size.width)};
  Image seen(1, size.height, size.width);
  take_medians(frames, plate.image, seen);
  plate.unrest_px = unrest_of(frames, plate.image, seen);
  plate.is_still = plate.unrest_px <= kMostUnrest;
  if (!plate.is_still) {
    seen = frames.front().shown;
    plate.image = std::move(frames.front().image);
  }
  Index count = 0;
  for (int y = 0; y < size.height; ++y) count += std::count(seen.row(0, y), seen.row(0, y) + size.width, 1.0F);
  if (count == 0)
    throw DataError(video.masks.front().path().string() + ": covers every pixel in " +
                    (plate.is_still ? "all frames" : "frame 0") + "; there is no background");
  plate.seen = static_cast<double>(count) / (static_cast<double>(size.width) * size.height);
  fill_holes(plate.image, seen);
  return plate;
}

Gaussians scene_of_plate(const Image& plate, const Camera& camera, const PlateScene& scene,
                         const RenderSettings& settings) {
  constexpr double kRadius = 0.6;  // of a Gaussian over their spacing: wider blurs, narrower leaves gaps
  constexpr float kOpaque = 4.6F;  // logit of 0.99
  constexpr int kCorrections = 12;
  HSI4D_CHECK(plate.width() == camera.width && plate.height() == camera.height, "the plate is as large as the image");
  HSI4D_CHECK(camera_center_world(camera)[2] > 0, "the camera is above the ground");
  const PlateSurfaces surfaces(camera, scene.wall_distance);
  const int size = scene.spacing_px;
  const PlateCells cells(plate, size, static_cast<int>(scene.margin * std::max(plate.width(), plate.height())));
  const std::size_t n = cells.count();
  Gaussians g;
  g.means.resize(3 * n);
  g.quats.resize(4 * n);
  g.log_scales.resize(3 * n);
  g.sh.resize(3 * n);
  g.opacity_logits.assign(n, kOpaque);
  const double half = size / 2.0;
  for (std::size_t i = 0; i < n; ++i) {
    const PlatePoint point = surfaces.at(cells.left(i) + half, cells.top(i) + half);
    const Vector3<double> color = cell_mean(plate, cells.left(i), cells.top(i), size);
    for (Index k = 0; k < 3; ++k) {
      const std::size_t at = 3 * i + static_cast<std::size_t>(k);
      g.means[at] = static_cast<float>(point.place[k]);
      g.sh[at] = static_cast<float>((color[k] - 0.5) / kShC0);
    }
    shape_disc(camera, point, kRadius * size, g.quats.data() + 4 * i, g.log_scales.data() + 3 * i);
  }
  SceneView view;
  view.camera = camera;
  view.settings = settings;
  for (int step = 0; step < kCorrections; ++step)
    correct_colors(plate, render_picture({g, {}}, view).image, cells, size, g);
  return g;
}

}  // namespace hsi4d
