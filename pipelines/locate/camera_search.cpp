#include "pipelines/locate/camera_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/ssim.h"
#include "autodiff/weighted_image.h"
#include "core/angles.h"
#include "core/check.h"
#include "core/progress.h"
#include "core/random.h"
#include "core/rotation.h"
#include "optim/metrics.h"
#include "optim/quasi_newton.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/draw/posed_splats.h"
#include "pipelines/draw/tape_image.h"
#include "pipelines/graph/camera_increment.h"
#include "splat/render/reachable.h"

namespace hsi4d {

namespace {

using S = float;

constexpr int kSmallestSide = 48;  // pixels of the first picture, at least
constexpr double kSsimShare = 0.5;
constexpr double kFirstRate = 0.01;  // of BFGS in the smallest picture: metres and radians; half in the next one
constexpr int kIterations = 25, kLastIterations = 40;
constexpr int kMostLastFits = 4;  // BFGS goes no further than kLongestUnitWay: where it went far it begins anew
constexpr double kSamePlace_m = 0.03, kSameTurn_deg = 1;  // within which two ends are one
constexpr std::array<Index, 3> kGoingOn = {12, 4, 2};     // cameras that are fitted in each picture, then 1
constexpr Index kStartsOfAFit = 32;  // of many starts one of so many is fitted in the first picture

/// A picture of one size.
struct Level {
  Image color, weight;
  int side = 0;
};

/// How far a camera may go from that of its graph.
struct Way {
  double numbers = 0;      ///< of each of the six, metres and radians
  double zoom = 0;         ///< of the focal length's logarithm
  CameraReach reach = {};  ///< and of starts beside it
};

/// Pixels that count wholly, 1; others 0.
Image whole_pixels(Image weight) {
  for (float& value : weight.data()) value = value > 0.999F ? 1.0F : 0.0F;
  return weight;
}

Level level_of(const Camera& full, const Image& color, const Image& weight, int side) {
  const Camera camera = reduced_camera(full, side);
  Level level{resize_area(color, camera.height, camera.width), {}, side};
  if (!weight.empty()) level.weight = whole_pixels(resize_area(weight, camera.height, camera.width));
  return level;
}

int largest_side(const Camera& full, const CameraSearch& search) {
  return std::min(search.longest_side, std::max(full.width, full.height));
}

std::vector<Level> levels_of(const Camera& full, const Image& color, const Image& weight, const CameraSearch& search) {
  std::vector<Level> levels;
  for (int side = largest_side(full, search); levels.empty() || side >= kSmallestSide; side /= 2)
    levels.push_back(level_of(full, color, weight, side));
  std::reverse(levels.begin(), levels.end());
  return levels;
}

/// A camera, and how well it shows the picture.
struct Candidate {
  Camera camera;  ///< of the guess's size
  double loss = 0;
};

/// The scene on a tape as a camera sees it that may move, and its difference from a picture.
class CameraGraph {
 public:
  CameraGraph(const Gaussians& scene, const Camera& camera, const Level& level, const CameraSearch& search,
              const Way& way)
      : view_{reduced_camera(camera, level.side), scene.origin_world, search.render}, full_(camera) {
    xi_from_update_ = camera_from_increment(CameraIncrement::kScene, view_.camera, scene);
    update_ = tape_.parameter("camera", shape_of(1, 6));
    zoom_ = tape_.parameter("focal_logarithm", shape_of(1, 1));
    fill(update_, S(0));
    fill(zoom_, S(0));
    if (!search.moves_focal) tape_.freeze(zoom_);
    const Matrix6<double> transposed = xi_from_update_;  // column-major, so its memory is the transpose
    const Var<S> xi = matmul(update_, constant("update_from_xi", shape_of(6, 6), transposed.data()));
    const std::array<double, 4> focal = {view_.camera.fx, view_.camera.fy, 0, 0};
    const std::array<double, 4> centre = {0, 0, view_.camera.cx, view_.camera.cy};
    const Var<S> intrinsics = matmul(exp(zoom_), constant("focal", shape_of(1, 4), focal.data())) +
                              constant("centre", shape_of(1, 4), centre.data());
    const Var<S> background = constant("background", shape_of(1, 3), search.background.data());
    rendered_ =
        render(standing_splats(leaves(seen(scene, way)), xi, view_), xi, background, view_, {}, intrinsics).image;
    record_loss(level);
  }

  /// The loss of another camera, which differs from that of the graph in its pose alone.
  double loss_of(const Camera& camera) {
    const Vector6<double> xi = se3_log(compose(camera.camera_from_world, inverse(view_.camera.camera_from_world)));
    const Vector6<double> update = xi_from_update_.partialPivLu().solve(xi);
    const Array<S> numbers = tape_.write(update_);
    for (Index i = 0; i < 6; ++i) numbers(0, i) = static_cast<S>(update[i]);
    tape_.freeze(update_);  // no gradient is prepared
    tape_.forward(loss_);
    return value();
  }

  /// The best camera near that of the graph.
  Candidate fit(double rate, int iterations, const CameraSearch& search) {
    ParameterGroupSettings settings;
    settings.lr = rate;
    std::vector<OptimizerGroup<S>> groups = {{{"camera", {update_}}, settings}};
    if (search.moves_focal) groups.push_back({{"focal", {zoom_}}, settings});
    QuasiNewton<S> optimizer(tape_, groups);
    for (int i = 0; i < iterations && !optimizer.is_done(); ++i) {
      tape_.forward(loss_);
      tape_.backward(loss_);
      optimizer.step(i, iterations, value());
    }
    tape_.forward(loss_);
    return {camera(), value()};
  }

  Image picture() {
    tape_.forward(rendered_);
    return held_image(tape_.value(rendered_), 0, 3);
  }

 private:
  Var<S> constant(const char* name, const Shape& shape, const auto* values) {
    const Var<S> var = tape_.constant(name, shape);
    const Array<S> array = tape_.write(var);
    for (Index r = 0; r < array.total_rows(); ++r) {
      for (Index c = 0; c < shape.cols; ++c) array.row(r)[c] = static_cast<S>(values[r * shape.cols + c]);
    }
    return var;
  }

  /// What some camera within the way may see; one Gaussian where that is nothing.
  Gaussians seen(const Gaussians& scene, const Way& way) const {
    const Vector6<double> furthest = xi_from_update_.cwiseAbs() * Vector6<double>::Constant(way.numbers);
    SplatView widest = view_;
    widest.camera.fx *= std::exp(-way.zoom);
    widest.camera.fy *= std::exp(-way.zoom);
    std::vector<Index> rows = reachable_rows(
        scene, widest,
        {way.reach.translation + furthest.head<3>().norm(), way.reach.rotation + furthest.tail<3>().norm()});
    if (rows.empty() && scene.count() > 0) rows.push_back(0);
    return selected(scene, rows);
  }

  GaussianVars<S> leaves(const Gaussians& g) {
    const Index n = g.count();
    return {constant("means", shape_of(n, 3), g.means.data()), constant("quats", shape_of(n, 4), g.quats.data()),
            constant("log_scales", shape_of(n, 3), g.log_scales.data()),
            constant("opacity_logits", shape_of(n, 1), g.opacity_logits.data()),
            constant("sh", shape_of(n, 3 * g.sh_coefficients()), g.sh.data())};
  }

  void record_loss(const Level& level) {
    Var<S> target = tape_.constant("target", rendered_.shape()), seen = rendered_;
    write_image(target, level.color);
    if (!level.weight.empty()) {
      const Var<S> weight = tape_.constant("weight", image_shape<S>(1, view_.camera.height, view_.camera.width));
      write_image(weight, level.weight);
      target = weighted_image(target, weight);
      seen = weighted_image(seen, weight);
    }
    loss_ = l1(seen, target) * (1 - kSsimShare) + d_ssim(seen, target) * kSsimShare;
  }

  double value() const { return static_cast<double>(tape_.value(loss_).scalar()); }

  Camera camera() const {
    Vector6<double> update;
    for (Index i = 0; i < 6; ++i) update[i] = static_cast<double>(tape_.value(update_)(0, i));
    Camera result = full_;
    result.camera_from_world = se3_update(Vector6<double>(xi_from_update_ * update), view_.camera.camera_from_world);
    const double zoom = std::exp(static_cast<double>(tape_.value(zoom_).scalar()));
    result.fx *= zoom;
    result.fy *= zoom;
    return result;
  }

  Tape<S> tape_;
  SplatView view_;
  Camera full_;
  Matrix6<double> xi_from_update_;
  Var<S> update_, zoom_, rendered_, loss_;
};

/// The best first; of equals the one that came first.
void sort_by_loss(std::vector<Candidate>& candidates) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.loss < b.loss; });
}

bool are_same(const Camera& a, const Camera& b) {
  const PoseError error = camera_error(a.camera_from_world, b.camera_from_world);
  return error.translation_cm < kSamePlace_m * kCentimetres && error.rotation_deg < kSameTurn_deg;
}

/// Those of sorted candidates that end nowhere near a better one.
std::vector<Candidate> different(const std::vector<Candidate>& candidates) {
  std::vector<Candidate> result;
  for (const Candidate& candidate : candidates) {
    const auto is_same = [&](const Candidate& better) { return are_same(better.camera, candidate.camera); };
    if (std::none_of(result.begin(), result.end(), is_same)) result.push_back(candidate);
  }
  return result;
}

/// A point evenly in the unit ball.
Vector3<double> in_ball(const Random& random, std::uint64_t index) {
  const auto [x, y] = random.normal_pair(3 * index);
  const Vector3<double> direction(x, y, random.normal(3 * index + 1));
  return direction.normalized() * std::cbrt(random.uniform(3 * index + 2));
}

/// Looks for the camera, step by step.
class Search {
 public:
  Search(const Gaussians& scene, const Camera& guess, const CameraSearch& search, const Observer& observer,
         std::vector<Level> levels)
      : scene_(scene),
        guess_(guess),
        search_(search),
        observer_(observer),
        levels_(std::move(levels)),
        progress_("locate", steps(), observer.progress, observer.progress_interval) {}

  FoundCamera run() {
    std::vector<Candidate> candidates = tried_starts();
    FoundCamera found;
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      candidates.resize(std::min(candidates.size(), static_cast<std::size_t>(going_on(i))));
      for (Candidate& candidate : candidates) candidate = fitted(candidate.camera, i);
      sort_by_loss(candidates);
      if (i == 0) count_agreeing(candidates, found);
      candidates = different(candidates);
    }
    const double loss_of_guess = CameraGraph(scene_, guess_, levels_.back(), search_, {}).loss_of(guess_);
    found.camera = candidates.front().loss < loss_of_guess ? candidates.front().camera : guess_;
    progress_.finish();
    return found;
  }

 private:
  static constexpr std::int64_t kStepsOfFit = 8;  // about as long as that many starts

  Index going_on(std::size_t level) const {
    if (level == 0) return std::max(kGoingOn.front(), search_.starts / kStartsOfAFit);
    return level < kGoingOn.size() ? kGoingOn.at(level) : 1;
  }

  std::int64_t steps() const {
    std::int64_t fits = 0;
    for (std::size_t i = 0; i < levels_.size(); ++i) fits += going_on(i);
    return search_.starts + kStepsOfFit * fits;
  }

  void stop_if_asked() const {
    if (observer_.wants_stop()) throw Interrupted("interrupted; nothing is written");
  }

  Way way_of_starts() const {
    // ρ = J⁻¹ t with |J⁻¹| = (φ/2)/sin(φ/2), at most π/2
    return {0, 0, {std::numbers::pi / 2 * search_.spread_m, search_.spread_deg * kDegree}};
  }

  std::vector<Candidate> tried_starts() {
    std::vector<Candidate> candidates;
    const std::vector<Camera> starts = spread_cameras(guess_, search_.starts, search_.spread_m, search_.spread_deg);
    CameraGraph graph(scene_, guess_, levels_.front(), search_, way_of_starts());
    for (const Camera& camera : starts) {
      stop_if_asked();
      candidates.push_back({camera, graph.loss_of(camera)});
      progress_.step();
    }
    sort_by_loss(candidates);
    return candidates;
  }

  Candidate fitted(const Camera& camera, std::size_t level) {
    stop_if_asked();
    const bool is_last = level + 1 == levels_.size();
    const double rate = kFirstRate * levels_.front().side / levels_[level].side, way = kLongestUnitWay * rate;
    Candidate result{camera, 0};
    for (int fit = 0; fit < (is_last ? kMostLastFits : 1); ++fit) {
      const Camera before = result.camera;
      result = CameraGraph(scene_, before, levels_[level], search_, {way, search_.moves_focal ? way : 0})
                   .fit(rate, is_last ? kLastIterations : kIterations, search_);
      if (camera_error(before.camera_from_world, result.camera.camera_from_world).translation_cm <
          kCentimetres * way / 4)
        break;
    }
    progress_.step(kStepsOfFit);
    return result;
  }

  static void count_agreeing(const std::vector<Candidate>& candidates, FoundCamera& found) {
    found.tried = std::ssize(candidates);
    found.agreeing = std::count_if(candidates.begin(), candidates.end(), [&](const Candidate& candidate) {
      return are_same(candidate.camera, candidates.front().camera);
    });
  }

  const Gaussians& scene_;
  const Camera& guess_;
  const CameraSearch& search_;
  const Observer& observer_;
  const std::vector<Level> levels_;
  Progress progress_;
};

void check_levels(const std::vector<Level>& levels) {
  const std::span<const float> numbers = levels.front().weight.data();
  if (!numbers.empty() && std::none_of(numbers.begin(), numbers.end(), [](float value) { return value > 0; }))
    throw UserError("the masks leave nothing of the picture to compare at " + std::to_string(levels.front().side) +
                    " pixels");
}

}  // namespace

std::vector<Camera> spread_cameras(const Camera& guess, Index count, double metres, double degrees) {
  const Random ways(0, random_stream("locate.ways")), turns(0, random_stream("locate.turns"));
  const Vector3<double> center = camera_center_world(guess);
  std::vector<Camera> cameras = {guess};
  for (Index i = 1; i < count; ++i) {
    const auto at = static_cast<std::uint64_t>(i);
    Camera camera = guess;
    Rigid<double>& pose = camera.camera_from_world;
    pose.rotation = so3_exp(Vector3<double>(degrees * kDegree * in_ball(turns, at))) * pose.rotation;
    pose.translation = -(pose.rotation * (center + metres * in_ball(ways, at)));
    cameras.push_back(camera);
  }
  return cameras;
}

FoundCamera find_camera(const Gaussians& scene, const Camera& guess, const Image& color, const Image& weight,
                        const CameraSearch& search, const Observer& observer) {
  check_sizes(scene);
  HSI4D_CHECK(search.starts > 0, "no starts");
  std::vector<Level> levels = levels_of(guess, color, weight, search);
  check_levels(levels);
  return Search(scene, guess, search, observer, std::move(levels)).run();
}

ComparedCamera compare_camera(const Gaussians& scene, const Camera& camera, const Image& color, const Image& weight,
                              const CameraSearch& search) {
  check_sizes(scene);
  const Level level = level_of(camera, color, weight, largest_side(camera, search));
  ComparedCamera result{level.color, CameraGraph(scene, camera, level, search, {}).picture(), level.weight};
  result.psnr_db = level.weight.empty() ? psnr_db(result.render, level.color)
                                        : psnr_db(result.render, level.color, level.weight).value_or(0);
  return result;
}

Image comparison_image(const ComparedCamera& compared) {
  const Image difference = difference_image(compared.picture, compared.render);
  const int width = difference.width();
  Image result(3, difference.height(), 3 * width);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < result.height(); ++y) {
      float* const row = result.row(c, y);
      std::copy_n(compared.picture.row(c, y), width, row);
      std::copy_n(compared.render.row(c, y), width, row + width);
      for (int x = 0; x < width; ++x)
        row[2 * width + x] =
            compared.weight.empty() ? difference(c, y, x) : compared.weight(0, y, x) * difference(c, y, x);
    }
  }
  return result;
}

}  // namespace hsi4d
