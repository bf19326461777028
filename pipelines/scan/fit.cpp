#include "pipelines/scan/fit.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/rotation.h"
#include "core/text.h"
#include "optim/adam.h"
#include "optim/metrics.h"
#include "optim/stage_loss.h"
#include "pipelines/draw/tape_image.h"
#include "pipelines/scan/density.h"
#include "splat/render/covariance.h"
#include "splat/render/opacity.h"
#include "splat/render/render.h"
#include "splat/render/sh.h"

namespace hsi4d {

namespace {

using S = float;

constexpr const char* kStage = "reconstruct";

/// Gaussians on a tape, seen by whichever camera is written into its leaves.
class ScanGraph {
 public:
  /// @param degree  of the harmonics that are used
  ScanGraph(const Gaussians& g, const Camera& camera, const RenderSettings& settings, int degree, bool has_weight)
      : view_{camera, g.origin_world, settings} {
    view_.settings.sh_degree = std::min(degree, settings.sh_degree);
    groups_ = {{"means", {leaf("means", g.means, 3)}},
               {"quats", {leaf("quats", g.quats, 4)}},
               {"log_scales", {leaf("log_scales", g.log_scales, 3)}},
               {"opacity_logits", {leaf("opacity_logits", g.opacity_logits, 1)}},
               {"sh", {leaf("sh", g.sh, 3 * g.sh_coefficients())}}};
    xi_ = tape_.constant("xi", shape_of(1, 6));
    intrinsics_ = tape_.constant("intrinsics", shape_of(1, 4));
    background_ = tape_.constant("background", shape_of(1, 3));
    inputs_.gaussian_opacities = gaussian_opacities(group(3));
    inputs_.gaussian_log_scales = group(2);
    const SplatInputs<S> splats = {group(0), gaussian_axes(group(1), group(2)), inputs_.gaussian_opacities,
                                   sh_colors(group(4), group(0), xi_, view_)};
    inputs_.rendered = render(splats, xi_, background_, view_, {}, intrinsics_).image;
    inputs_.target = tape_.constant("target", inputs_.rendered.shape());
    if (!has_weight) return;
    const Shape& image = inputs_.rendered.shape();
    inputs_.weight = tape_.constant("weight", image_shape<S>(1, image.rows, image.cols));
  }

  void show(const Photo& photo, const Vector3<double>& background) {
    const Camera& camera = photo.camera;
    const Vector6<double> xi = se3_log(compose(camera.camera_from_world, inverse(view_.camera.camera_from_world)));
    const Array<S> xi_array = tape_.write(xi_), background_array = tape_.write(background_);
    for (Index i = 0; i < 6; ++i) xi_array(0, i) = static_cast<S>(xi[i]);
    for (Index i = 0; i < 3; ++i) background_array(0, i) = static_cast<S>(background[i]);
    tape_.set(intrinsics_, std::array<S, 4>{static_cast<S>(camera.fx), static_cast<S>(camera.fy),
                                            static_cast<S>(camera.cx), static_cast<S>(camera.cy)});
    if (photo.alpha.empty()) {
      write_image(inputs_.target, photo.color);  // no copy of it
    } else {
      write_image(inputs_.target, before_color(photo, background));
    }
    if (inputs_.weight.tape == nullptr) return;
    if (photo.weight.empty()) {
      fill(inputs_.weight, S(1));
    } else {
      write_image(inputs_.weight, photo.weight);
    }
  }

  Image picture() {
    tape_.forward(inputs_.rendered);
    return held_image(tape_.value(inputs_.rendered), 0, 3);
  }
  /// Of the last forward run, not clamped, of the pixels that count.
  double psnr() const {
    const ConstArray<S> image = tape_.value(inputs_.rendered), target = tape_.value(inputs_.target);
    const bool has_weight = inputs_.weight.tape != nullptr;
    const Index rows = image.shape.rows, cols = image.shape.cols;
    const auto sum_of = [&](bool of_squares) {
      return parallel_sum(rows, 16, [&](Index begin, Index end) {
        double sum = 0;
        for (Index r = begin; r < end; ++r) {
          const S* const w = has_weight ? tape_.value(inputs_.weight).row(r) : nullptr;
          for (Index plane = 0; plane < image.shape.planes; ++plane) {
            const S *a = image.row(plane * rows + r), *b = target.row(plane * rows + r);
            for (Index c = 0; c < cols; ++c) {
              const double weight = w == nullptr ? 1 : static_cast<double>(w[c]);
              sum += of_squares ? weight * static_cast<double>((a[c] - b[c]) * (a[c] - b[c])) : weight;
            }
          }
        }
        return sum;
      });
    };
    const double weights = has_weight ? sum_of(false) : static_cast<double>(image.shape.count());
    return weights > 0 ? std::min(kLargestPsnrDb, -10 * std::log10(sum_of(true) / weights)) : kLargestPsnrDb;
  }

  /// What the leaves of the first groups hold, back into the Gaussians.
  void read(Gaussians& g, std::size_t groups = kScanGroups) const {
    const std::array<std::vector<float>*, kScanGroups> arrays = {&g.means, &g.quats, &g.log_scales, &g.opacity_logits,
                                                                 &g.sh};
    for (std::size_t i = 0; i < groups; ++i) {
      std::vector<float>* const values = arrays[i];
      const ConstArray<S> leaf = tape_.value(group(i));
      for (Index r = 0; r < leaf.total_rows(); ++r)
        std::copy_n(leaf.row(r), leaf.shape.cols, values->begin() + r * leaf.shape.cols);
    }
  }

  Tape<S>& tape() { return tape_; }
  const LossInputs<S>& inputs() const { return inputs_; }
  const std::vector<ParameterGroup<S>>& groups() const { return groups_; }
  Var<S> group(std::size_t i) const { return groups_[i].blocks.front(); }

 private:
  Var<S> leaf(const char* name, const std::vector<float>& values, Index cols) {
    const Var<S> var = tape_.parameter(name, shape_of(static_cast<Index>(values.size()) / cols, cols));
    tape_.set(var, values);
    return var;
  }

  Tape<S> tape_;
  SplatView view_;
  Var<S> xi_, intrinsics_, background_;
  LossInputs<S> inputs_;
  std::vector<ParameterGroup<S>> groups_;
};

/// The picture of an iteration: all that are learnt from, in an order that is new each time that all were seen.
class PhotoOrder {
 public:
  PhotoOrder(std::vector<std::size_t> photos, std::int64_t seed)
      : photos_(std::move(photos)), random_(static_cast<std::uint64_t>(seed), random_stream("scan.order")) {}

  std::size_t at(Index iteration) {
    const auto count = std::ssize(photos_);
    const Index round = iteration / count;
    if (round != round_) order_ = random_.permutation(static_cast<std::uint64_t>(round * count), count);
    round_ = round;
    return photos_[static_cast<std::size_t>(order_[static_cast<std::size_t>(iteration % count)])];
  }

 private:
  std::vector<std::size_t> photos_;
  Random random_;
  std::vector<Index> order_;
  Index round_ = -1;
};

void check_sizes_of(const std::vector<Photo>& photos) {
  for (const Photo& photo : photos) {
    HSI4D_CHECK_EQ(photo.camera.width, photos.front().camera.width);
    HSI4D_CHECK_EQ(photo.camera.height, photos.front().camera.height);
  }
}

/// What counts of an image, black elsewhere, as the loss sees it.
Image weighted(Image image, const Image& weight) {
  if (weight.empty()) return image;
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) image(c, y, x) *= weight(0, y, x);
    }
  }
  return image;
}

bool any_weight(const std::vector<Photo>& photos) {
  return std::any_of(photos.begin(), photos.end(), [](const Photo& photo) { return !photo.weight.empty(); });
}

/// A fit in the course of its iterations.
class ScanFit {
 public:
  ScanFit(const ScanSettings& settings, const std::vector<Photo>& photos, double extent,
          std::span<const LossTerm> terms, const ScanWatch& watch, ScanState& state)
      : settings_(settings),
        photos_(photos),
        extent_(extent),
        terms_(terms),
        watch_(watch),
        state_(state),
        order_(learnt(), settings.seed),
        first_(bias_corrections(settings.stage.optimizer.beta1, settings.stage.iterations)),
        second_(bias_corrections(settings.stage.optimizer.beta2, settings.stage.iterations)) {
    const auto columns = state.columns();
    column_shares_.assign(static_cast<std::size_t>(columns.back()), static_cast<float>(settings.sh_share));
    std::fill_n(column_shares_.begin(), 3, 1.0F);
    for (std::size_t i = 0; i < kScanGroups; ++i) {
      if (rule_of(i) != nullptr) state.moments[i].resize(state.gaussians.count(), columns[i]);
    }
  }

  void run() {
    Progress progress("reconstruct", settings_.stage.iterations, watch_.observer.progress,
                      watch_.observer.progress_interval);
    progress.skip(state_.iteration);
    while (state_.iteration < settings_.stage.iterations) {
      run_segment(progress);
      if (changes_density_after(settings_.density, state_.iteration - 1))
        change_density(settings_.density, settings_.seed, state_);
      if (state_.iteration % settings_.save_every == 0) save();
      if (state_.iteration < settings_.stage.iterations && watch_.observer.wants_stop()) {
        save();
        throw_interrupted();
      }
    }
    save();
    progress.finish();
  }

 private:
  const ParameterGroupSettings* rule_of(std::size_t group) const {
    return find_entry(settings_.stage.optimize, scan_groups()[group]);
  }

  std::vector<std::size_t> learnt() const {
    const std::vector<bool> held = held_photos(settings_.photos, photos_.size());
    std::vector<std::size_t> result;
    for (std::size_t i = 0; i < held.size(); ++i) {
      if (!held[i]) result.push_back(i);
    }
    if (result.empty()) throw UserError(settings_.photos.path.string() + ": no picture is left to learn from");
    return result;
  }

  int degree_at(Index iteration) const {
    return static_cast<int>(std::min<Index>(settings_.sh_degree, iteration / settings_.sh_every));
  }
  /// Iterations up to which one tape serves.
  bool ends_segment_after(Index iteration) const {
    const Index done = iteration + 1;
    return done == settings_.stage.iterations || done % settings_.save_every == 0 ||
           changes_density_after(settings_.density, iteration) || degree_at(done) != degree_at(iteration);
  }

  void run_segment(Progress& progress) {
    ScanGraph graph(state_.gaussians, photos_.front().camera, settings_.render, degree_at(state_.iteration),
                    any_weight(photos_));
    for (std::size_t i = 0; i < kScanGroups; ++i) set_frozen(graph.tape(), graph.groups()[i], rule_of(i) == nullptr);
    RecordedLoss<S> loss = record_loss(settings_.stage, terms_, graph.inputs(), kStage);
    try {
      while (true) {
        iterate(graph, loss, progress);
        if (ends_segment_after(state_.iteration++)) break;
        stop_if_asked();
      }
    } catch (const Interrupted&) {
      graph.read(state_.gaussians);
      save();
      throw;
    }
    graph.read(state_.gaussians);
  }

  void iterate(ScanGraph& graph, RecordedLoss<S>& loss, Progress& progress) {
    const Index i = state_.iteration;
    const Photo& photo = photos_[order_.at(i)];
    graph.show(photo, photo.alpha.empty() ? Vector3<double>(settings_.background.data()) : background_at(i));
    Tape<S>& tape = graph.tape();
    tape.forward(loss.total);
    loss.read_values();
    const auto value = static_cast<double>(tape.value(loss.total).scalar());
    if (!std::isfinite(value)) throw_not_finite(i, loss.values);
    tape.backward(loss.total);
    const double psnr = graph.psnr();
    for (std::size_t g = 0; g < kScanGroups; ++g) move(graph, g);
    tremble(graph);
    add_to_curve(psnr);
    progress.step_with("PSNR", psnr);
  }

  void move(ScanGraph& graph, std::size_t group) {
    const ParameterGroupSettings* const settings = rule_of(group);
    if (settings == nullptr || !moves_in(*settings, state_.iteration)) return;
    RowAdamRule rule;
    rule.rate = rate_of(group);
    rule.beta1 = settings_.stage.optimizer.beta1;
    rule.beta2 = settings_.stage.optimizer.beta2;
    rule.eps = settings_.stage.optimizer.eps;
    if (group + 1 == kScanGroups) rule.column_shares = column_shares_;
    state_.refused += step_rows(graph.group(group), state_.moments[group], rule, first_, second_).refused;
  }

  double rate_of(std::size_t group) const {
    const double rate = scheduled_rate(*rule_of(group), state_.iteration, settings_.stage.iterations);
    return group == 0 ? rate * extent_ : rate;
  }

  void tremble(ScanGraph& graph) {
    const bool is_on = rule_of(0) != nullptr && moves_in(*rule_of(0), state_.iteration) &&
                       settings_.density.method == DensityMethod::kMcmc && state_.iteration < settings_.density.until;
    if (!is_on) return;
    constexpr std::size_t kShapes = 4;  // all but the harmonics
    graph.read(state_.gaussians, kShapes);
    add_noise(settings_.density, settings_.seed, state_.iteration, rate_of(0), state_.gaussians,
              state_.gaussians.means.data());
    graph.tape().set(graph.group(0), state_.gaussians.means);
  }

  Vector3<double> background_at(Index iteration) const {
    if (!settings_.random_background) return Vector3<double>(settings_.background.data());
    const Random random(static_cast<std::uint64_t>(settings_.seed), random_stream("scan.background"));
    const auto at = static_cast<std::uint64_t>(3 * iteration);
    return {random.uniform(at), random.uniform(at + 1), random.uniform(at + 2)};
  }

  void add_to_curve(double psnr) {
    state_.curve_sum += psnr;
    if ((state_.iteration + 1) % kCurveEvery != 0) return;
    state_.curve.push_back(state_.curve_sum / static_cast<double>(kCurveEvery));
    state_.curve_sum = 0;
  }

  [[noreturn]] void throw_not_finite(Index iteration, const std::vector<LossValue>& values) const {
    std::vector<std::string> texts;
    for (const LossValue& value : values) texts.push_back(value.name + " " + rounded(value.value, 6));
    throw UserError(stage_message(kStage, "given up in iteration " + std::to_string(iteration) +
                                              ": the loss is not finite; terms: " + joined(texts)));
  }

  void stop_if_asked() const {
    if (watch_.observer.wants_stop()) throw_interrupted();
  }
  [[noreturn]] void throw_interrupted() const {
    throw Interrupted("interrupted in iteration " + std::to_string(state_.iteration) + " of " +
                      std::to_string(settings_.stage.iterations) + "; --resume goes on");
  }

  void save() const {
    if (watch_.save) watch_.save(state_);
  }

  const ScanSettings& settings_;
  const std::vector<Photo>& photos_;
  const double extent_;
  std::span<const LossTerm> terms_;
  const ScanWatch& watch_;
  ScanState& state_;
  PhotoOrder order_;
  const std::vector<double> first_, second_;
  std::vector<float> column_shares_;
};

}  // namespace

Image before_color(const Photo& photo, const Vector3<double>& background) {
  Image result = photo.color;
  if (photo.alpha.empty()) return result;
  for (int c = 0; c < 3; ++c) {
    const auto behind = static_cast<float>(background[c]);
    for (int y = 0; y < result.height(); ++y) {
      float* const row = result.row(c, y);
      const float* const alpha = photo.alpha.row(0, y);
      for (int x = 0; x < result.width(); ++x) row[x] = alpha[x] * row[x] + (1 - alpha[x]) * behind;
    }
  }
  return result;
}

std::vector<bool> held_photos(const ScanPhotos& settings, std::size_t count) {
  std::vector<bool> held(count, false);
  for (std::size_t i = 0; settings.hold_every > 0 && i < count; i += static_cast<std::size_t>(settings.hold_every))
    held[i] = true;
  return held;
}

void fit_scan(const ScanSettings& settings, const std::vector<Photo>& photos, double extent,
              std::span<const LossTerm> terms, const ScanWatch& watch, ScanState& state) {
  HSI4D_CHECK(!photos.empty(), "no photos");
  check_sizes_of(photos);
  ScanFit(settings, photos, extent, terms, watch, state).run();
}

std::vector<ScanPicture> score_scan(const ScanSettings& settings, const std::vector<Photo>& photos,
                                    const Gaussians& gaussians,
                                    const std::function<void(const ScanPicture&, const Image&)>& take) {
  check_sizes_of(photos);
  ScanGraph graph(gaussians, photos.front().camera, settings.render, settings.sh_degree, false);
  const Vector3<double> background(settings.background.data());
  const std::vector<bool> held = held_photos(settings.photos, photos.size());
  std::vector<ScanPicture> pictures;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    graph.show(photos[i], background);
    Image image = graph.picture();
    const Image target = before_color(photos[i], background);
    ScanPicture& picture = pictures.emplace_back();
    picture.photo = i;
    picture.held = held[i];
    const Image& weight = photos[i].weight;
    const std::optional<double> psnr = weight.empty() ? psnr_db(image, target) : psnr_db(image, target, weight);
    if (!psnr) {
      pictures.pop_back();  // nothing of it counts
      continue;
    }
    picture.psnr_db = *psnr;
    picture.ssim = image_ssim(weighted(image, weight), weighted(target, weight));
    if (take) take(picture, image);
  }
  return pictures;
}

ScanScore mean_score(const std::vector<ScanPicture>& pictures, bool held) {
  ScanScore score;
  for (const ScanPicture& picture : pictures) {
    if (picture.held != held) continue;
    ++score.pictures;
    score.psnr_db += picture.psnr_db;
    score.ssim += picture.ssim;
  }
  if (score.pictures == 0) return score;
  score.psnr_db /= static_cast<double>(score.pictures);
  score.ssim /= static_cast<double>(score.pictures);
  return score;
}

}  // namespace hsi4d
