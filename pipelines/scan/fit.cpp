#include "pipelines/scan/fit.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/random.h"
#include "core/text.h"
#include "optim/adam.h"
#include "optim/metrics.h"
#include "optim/stage_loss.h"
#include "pipelines/scan/density.h"
#include "pipelines/scan/density_adc.h"
#include "pipelines/scan/exposure.h"
#include "pipelines/scan/scan_graph.h"

namespace hsi4d {

namespace {

using S = float;

constexpr const char* kStage = "reconstruct";

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

/// How exposures move; null: they are not learnt.
const ParameterGroupSettings* exposure_rule(const StageSettings& stage) {
  return find_entry(stage.optimize, std::string(kExposures));
}

/// What the stage's terms read of the pictures.
ScanExtras extras_of(const StageSettings& stage, const std::vector<Photo>& photos) {
  const auto any = [&photos](Image Photo::*plane) {
    return std::any_of(photos.begin(), photos.end(), [plane](const Photo& photo) { return !(photo.*plane).empty(); });
  };
  return {any(&Photo::weight), reads_depths(stage) && any(&Photo::depth), exposure_rule(stage) != nullptr};
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
    if (exposure_rule(settings.stage) == nullptr) return;
    if (state.exposures.empty()) state.exposures.resize(photos.size() * kExposureNumbers);
    HSI4D_CHECK_EQ(state.exposures.size(), photos.size() * kExposureNumbers);
    state.exposure_moments.resize(photos.size());
    for (RowMoments<float>& moments : state.exposure_moments) moments.resize(kExposureNumbers, 1);
  }

  void run() {
    Progress progress("reconstruct", settings_.stage.iterations, watch_.observer.progress,
                      watch_.observer.progress_interval);
    progress.skip(state_.iteration);
    while (state_.iteration < settings_.stage.iterations) {
      run_segment(progress);
      if (changes_density_after(settings_.density, state_.iteration - 1, settings_.stage.iterations))
        change_density(settings_.density, settings_.seed, extent_, state_);
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
           changes_density_after(settings_.density, iteration, settings_.stage.iterations) ||
           degree_at(done) != degree_at(iteration);
  }

  void run_segment(Progress& progress) {
    ScanGraph graph(state_.gaussians, photos_.front().camera, settings_.render, degree_at(state_.iteration),
                    extras_of(settings_.stage, photos_));
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
    const std::size_t shown = order_.at(i);
    const Photo& photo = photos_[shown];
    if (exposure_rule(settings_.stage) != nullptr) graph.set_exposure(exposure_of(state_, shown));
    graph.show(photo, photo.alpha.empty() ? Vector3<double>(settings_.background.data()) : background_at(i));
    Tape<S>& tape = graph.tape();
    tape.forward(loss.total);
    loss.read_values();
    const auto value = static_cast<double>(tape.value(loss.total).scalar());
    if (!std::isfinite(value)) throw_not_finite(i, loss.values);
    tape.backward(loss.total);
    if (counts_gradients(i) && tape.has_gradient(graph.means_px()))
      add_image_gradients(tape.gradient(graph.means_px()), photo.camera, state_);
    const double psnr = graph.psnr();
    for (std::size_t g = 0; g < kScanGroups; ++g) move(graph, g);
    move_exposure(graph, shown);
    tremble(graph);
    add_to_curve(psnr);
    progress.step_with("PSNR", psnr);
  }

  /// Of adaptive density control, as long as it changes anything.
  bool counts_gradients(Index iteration) const {
    return settings_.density.method == DensityMethod::kAdc && iteration < settings_.density.until;
  }

  RowAdamRule rule_with(double rate) const {
    const OptimizerSettings& optimizer = settings_.stage.optimizer;
    return {rate, optimizer.beta1, optimizer.beta2, optimizer.eps};
  }

  void move_exposure(ScanGraph& graph, std::size_t photo) {
    const ParameterGroupSettings* const settings = exposure_rule(settings_.stage);
    if (settings == nullptr || !moves_in(*settings, state_.iteration)) return;
    const double rate = scheduled_rate(*settings, state_.iteration, settings_.stage.iterations);
    state_.refused +=
        step_rows(graph.exposure(), state_.exposure_moments[photo], rule_with(rate), first_, second_).refused;
    std::ranges::copy(graph.exposure_numbers(), exposure_of(state_, photo).begin());
  }

  void move(ScanGraph& graph, std::size_t group) {
    const ParameterGroupSettings* const settings = rule_of(group);
    if (settings == nullptr || !moves_in(*settings, state_.iteration)) return;
    RowAdamRule rule = rule_with(rate_of(group));
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

bool reads_depths(const StageSettings& stage) {
  return std::any_of(stage.losses.begin(), stage.losses.end(),
                     [](const auto& loss) { return needs_input(loss.second, LossInput::kDepths); });
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
                                    const ScanState& state,
                                    const std::function<void(const ScanPicture&, const Image&)>& take) {
  check_sizes_of(photos);
  const bool has_exposures = !state.exposures.empty();
  ScanGraph graph(state.gaussians, photos.front().camera, settings.render, settings.sh_degree,
                  {.exposure = has_exposures});
  const Vector3<double> background(settings.background.data());
  const std::vector<bool> held = held_photos(settings.photos, photos.size());
  std::vector<ScanPicture> pictures;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    graph.show(photos[i], background);
    if (has_exposures) graph.set_exposure(exposure_of(state, i));
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
