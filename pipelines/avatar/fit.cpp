#include "pipelines/avatar/fit.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "body/motion_edit.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/rotation.h"
#include "core/size_text.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "pipelines/avatar/offsets.h"
#include "pipelines/draw/posed_splats.h"
#include "pipelines/draw/tape_image.h"
#include "pipelines/input/body_files.h"
#include "splat/render/camera_center.h"

namespace hsi4d {

namespace {

using S = float;

/// Colour of a new avatar, before it has learnt anything.
constexpr float kFirstColor = 0.5F;

constexpr double kLargeMove = 0.01;  // metres that count as 1 in LossInputs::shape_change
constexpr float kSeenFrom = 0.5F;    // of a mask: what it reaches nowhere shows nobody

/// A view in memory.
struct LoadedView {
  Vector6<double> xi;
  std::array<S, 4> intrinsics;
  BodyPose pose;
  ViewImage image;
  Image weight;  ///< [1,H,W] how much a pixel counts; no pixels: all do
  bool is_seen = false;
  bool held = false;
};

/// The least number within `margin` pixels to all sides, those outside of the image left out.
Image inset(const Image& mask, int margin) {
  Image across = mask, result = mask;
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      const float* const row = mask.row(0, y);
      across(0, y, x) = *std::min_element(row + std::max(0, x - margin), row + std::min(mask.width(), x + margin + 1));
    }
  }
  for (int y = 0; y < mask.height(); ++y) {
    for (int i = std::max(0, y - margin); i < std::min(mask.height(), y + margin + 1); ++i) {
      for (int x = 0; x < mask.width(); ++x) result(0, y, x) = std::min(result(0, y, x), across(0, i, x));
    }
  }
  return result;
}

/// How much each pixel of a picture counts: what shows the human, a margin within, and what the lens showed.
Image counted(const ViewImage& picture, int margin) {
  if (picture.mask.empty()) return picture.weight;
  Image result = inset(picture.mask, margin);
  if (picture.weight.empty()) return result;
  for (int y = 0; y < result.height(); ++y) {
    for (int x = 0; x < result.width(); ++x) result(0, y, x) *= picture.weight(0, y, x);
  }
  return result;
}

bool shows_somebody(const Image& mask) {
  for (int y = 0; y < mask.height(); ++y) {
    if (std::any_of(mask.row(0, y), mask.row(0, y) + mask.width(), [](float share) { return share >= kSeenFrom; }))
      return true;
  }
  return false;
}

std::vector<LoadedView> load_views(const AvatarFitSettings& settings, const ViewSet& set, const Avatar& avatar) {
  const Camera& first = set.cameras[static_cast<std::size_t>(set.views.front().camera)];
  const Vector3<double> background(settings.background.data());
  const Motion motion = for_body(set.motion, avatar);
  std::vector<LoadedView> views;
  for (const PosedView& view : set.views) {
    const Camera& camera = set.cameras[static_cast<std::size_t>(view.camera)];
    if (camera.width != first.width || camera.height != first.height) {
      const std::string name =
          set.photos.empty() ? "camera " + std::to_string(view.camera) : view.image.filename().string();
      throw UserError(set.file.string() + ": " + name + " has " + size_text(camera) + " pixels, another " +
                      size_text(first) + "; allowed: one size");
    }
    LoadedView& loaded = views.emplace_back();
    loaded.xi = se3_log(compose(camera.camera_from_world, inverse(first.camera_from_world)));
    loaded.intrinsics = {static_cast<S>(camera.fx), static_cast<S>(camera.fy), static_cast<S>(camera.cx),
                         static_cast<S>(camera.cy)};
    loaded.pose = motion.poses[static_cast<std::size_t>(view.frame)];
    if (loaded.pose.joints() != avatar.joint_count()) {
      throw UserError(set.file.string() + ": poses of " + std::to_string(loaded.pose.joints()) +
                      " joints; the avatar has " + std::to_string(avatar.joint_count()));
    }
    loaded.image = view_image(set, view, background);
    loaded.weight = counted(loaded.image, settings.mask_inset_px);
    loaded.is_seen = !loaded.image.mask.empty() && shows_somebody(loaded.image.mask);
    loaded.held = is_held(settings, view);
  }
  const auto unmasked =
      std::count_if(views.begin(), views.end(), [](const LoadedView& view) { return view.image.mask.empty(); });
  if (unmasked > 0 && !set.photos.empty())
    log_warning(set.file.string() + ": " + std::to_string(unmasked) + " of " + std::to_string(views.size()) +
                " photographs have neither alpha nor mask: what is behind the human becomes a part of it");
  return views;
}

/// The graph of one view of the avatar, whichever is written into its leaves.
class FitGraph {
 public:
  FitGraph(Tape<S>& tape, const Avatar& avatar, const AvatarFitSettings& settings, const Camera& camera)
      : tape_(tape), view_{camera, Vector3<double>::Zero(), settings.render} {
    const Index n = avatar.count();
    human_ = {leaf("means", avatar.means, 3), leaf("quats", avatar.quats, 4), leaf("log_scales", avatar.log_scales, 3),
              leaf("opacity_logits", avatar.opacity_logits, 1), leaf("colors", avatar.colors, 3)};
    HSI4D_CHECK_EQ(human_.means.shape().rows, n);
    // What a file may say, or a network can see.
    groups_.back().range = avatar.color_net ? ParameterRange{kLeastColor, kLargestColor} : ParameterRange{0, 1};
    xi_ = tape.constant("xi", shape_of(1, 6));
    intrinsics_ = tape.constant("intrinsics", shape_of(1, 4));
    rotations_ = tape.constant("rotations", shape_of(avatar.joint_count(), 9));
    transl_ = tape.constant("transl", shape_of(1, 3));
    const Var<S> background = tape.constant("background", shape_of(1, 3));
    for (Index i = 0; i < 3; ++i) {
      tape.write(background)(0, i) = static_cast<S>(settings.background[static_cast<std::size_t>(i)]);
    }
    const HumanColors<S> colors = color_net(avatar);
    GaussianVars<S> placed = human_;
    placed.means = placed_means(avatar, settings.stage);
    const SplatInputs<S> splats =
        skinned_splats(placed, rotations_, transl_, avatar, avatar.color_net ? &colors : nullptr);
    const Rendered<S> rendered = render(splats, xi_, background, view_, {}, intrinsics_);
    inputs_.rendered = rendered.image;
    inputs_.target = tape.constant("target", inputs_.rendered.shape());
    inputs_.weight = tape.constant("weight", rendered.transmittance.shape());
    inputs_.human_opacity = 1 - rendered.transmittance;
    inputs_.human_mask = tape.constant("human_mask", rendered.transmittance.shape());
    inputs_.human_seen = tape.constant("human_seen", kScalarShape);
    record_changes(avatar, placed);
    for (const ParameterGroup<S>& group : groups_) {
      for (const Var<S> var : group.blocks) tape.freeze(var);
    }
  }

  void show(const LoadedView& view) {
    const Array<S> xi = tape_.write(xi_), transl = tape_.write(transl_), rotations = tape_.write(rotations_);
    for (Index i = 0; i < 6; ++i) xi(0, i) = static_cast<S>(view.xi[i]);
    tape_.set(intrinsics_, view.intrinsics);
    for (Index i = 0; i < 3; ++i) transl(0, i) = static_cast<S>(view.pose.transl[i]);
    for (Index j = 0; j < view.pose.joints(); ++j) {
      const Matrix3<double> r = so3_exp(view.pose.rotation_of(j));
      for (Index i = 0; i < 9; ++i) rotations(j, i) = static_cast<S>(r(i / 3, i % 3));
    }
    write_image(inputs_.target, view.image.color);
    if (!view.image.mask.empty()) write_image(inputs_.human_mask, view.image.mask);
    if (!view.weight.empty()) {
      write_image(inputs_.weight, view.weight);
    } else {
      fill(inputs_.weight, S(1));
    }
    fill(inputs_.human_seen, view.is_seen ? S(1) : S(0));
  }

  Image picture() { return drawn(inputs_.rendered); }
  Image silhouette() { return drawn(inputs_.human_opacity); }

  /// What has been learnt, back into the avatar.
  void read(const ConfigMap<ParameterGroupSettings>& moved, Avatar& avatar) {
    const auto read_leaf = [&](const char* group, Var<S> var, std::vector<float>& to) {
      if (find_entry(moved, group) == nullptr) return;
      const ConstArray<S> values = tape_.value(var);
      std::copy_n(values.data, to.size(), to.begin());
    };
    if (LossInputs<S>::given(offsets_)) {
      tape_.forward(means_);
      read_leaf("offsets", means_, avatar.means);
    } else {
      read_leaf("means", human_.means, avatar.means);
    }
    read_leaf("quats", human_.quats, avatar.quats);
    read_leaf("log_scales", human_.log_scales, avatar.log_scales);
    read_leaf("opacity_logits", human_.opacity_logits, avatar.opacity_logits);
    read_leaf("colors", human_.colors, avatar.colors);
    if (!avatar.color_net) return;
    if (find_entry(moved, "color_net") != nullptr) read_layers(net_, *avatar.color_net);
    if (find_entry(moved, "avatar_features") != nullptr) read_features(net_, *avatar.color_net);
  }

  const LossInputs<S>& inputs() const { return inputs_; }
  const std::vector<ParameterGroup<S>>& groups() const { return groups_; }

 private:
  Image drawn(Var<S> image) {
    tape_.forward(image);
    return held_image(tape_.value(image), 0, static_cast<int>(image.shape().planes));
  }

  /// The means, moved by a field where the stage moves one.
  Var<S> placed_means(const Avatar& avatar, const StageSettings& stage) {
    groups_.push_back({"offsets", {}});
    means_ = human_.means;
    if (find_entry(stage.optimize, "offsets") == nullptr) return means_;
    const OffsetField field = offset_field(avatar);
    offsets_ = tape_.parameter("offsets", shape_of(field.controls, 1));
    groups_.back().blocks.push_back(offsets_);
    return means_ = offset_means(field, human_.means, offsets_);
  }

  Var<S> change(const char* name, Var<S> now, const std::vector<float>& first) {
    const Var<S> before = tape_.constant(name, now.shape());
    tape_.set(before, first);
    return now - before;
  }

  void record_changes(const Avatar& first, const GaussianVars<S>& now) {
    inputs_.color_change = change("first_colors", now.colors, first.colors);
    const std::array<Var<S>, 3> shape = {change("first_means", now.means, first.means) * (1 / kLargeMove),
                                         change("first_log_scales", now.log_scales, first.log_scales),
                                         change("first_opacity_logits", now.opacity_logits, first.opacity_logits)};
    inputs_.shape_change = concat_cols(std::span<const Var<S>>(shape));
  }

  Var<S> leaf(const char* name, const std::vector<float>& values, Index cols) {
    const Var<S> var = tape_.parameter(name, shape_of(static_cast<Index>(values.size()) / cols, cols));
    tape_.set(var, values);
    groups_.push_back({name, {var}});
    return var;
  }

  HumanColors<S> color_net(const Avatar& avatar) {
    HumanColors<S> colors;
    groups_.push_back({"color_net", {}});
    groups_.push_back({"avatar_features", {}});
    if (!avatar.color_net) return colors;
    net_ = color_net_leaves(tape_, *avatar.color_net);
    for (const MlpLayer<S>& layer : net_.layers) {
      groups_[groups_.size() - 2].blocks.push_back(layer.weights);
      groups_[groups_.size() - 2].blocks.push_back(layer.bias);
    }
    groups_.back().blocks.push_back(net_.features);
    colors.net = net_;
    colors.code_joints = avatar.color_net->code_joints;
    if (avatar.color_net->view_direction) colors.camera_center = camera_center(xi_, view_);
    return colors;
  }

  Tape<S>& tape_;
  SplatView view_;
  GaussianVars<S> human_;
  ColorNetVars<S> net_;
  Var<S> xi_, intrinsics_, rotations_, transl_;
  Var<S> offsets_, means_;  // offsets_ is empty where the stage moves none
  LossInputs<S> inputs_;
  std::vector<ParameterGroup<S>> groups_;
};

/// Views in an order that is new each time that all were seen.
class ViewOrder {
 public:
  ViewOrder(std::vector<std::size_t> views, std::int64_t seed)
      : views_(std::move(views)), random_(static_cast<std::uint64_t>(seed), random_stream("avatar_fit.order")) {}

  std::size_t next() {
    const std::size_t round = count_ / views_.size(), place = count_ % views_.size();
    ++count_;
    if (place == 0) order_ = random_.permutation(round * views_.size(), static_cast<Index>(views_.size()));
    return views_[static_cast<std::size_t>(order_[place])];
  }

 private:
  std::vector<std::size_t> views_;
  Random random_;
  std::vector<Index> order_;
  std::size_t count_ = 0;
};

/// Throws UserError unless each of the numbers of a setting is that of a view.
void check_held(const AvatarFitSettings& settings, const ViewSet& set, const char* key, const char* what,
                const std::vector<double>& numbers, Index PosedView::*number_of, std::size_t count) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto is_its = [&](const PosedView& view) { return static_cast<double>(view.*number_of) == numbers[i]; };
    if (std::any_of(set.views.begin(), set.views.end(), is_its)) continue;
    throw UserError((settings.file.empty() ? "" : settings.file.string() + ": ") + "/" + key + "/" + std::to_string(i) +
                    ": no view of " + set.file.string() + " is of " + what + " " + number_text(numbers[i]) +
                    "; there are " + std::to_string(count) + ", counted from 0");
  }
}

ViewScore score_of(FitGraph& graph, const std::vector<LoadedView>& views, bool held) {
  ViewScore score;
  Index masked = 0;
  for (const LoadedView& view : views) {
    if (view.held != held) continue;
    graph.show(view);
    const Image picture = graph.picture();
    ++score.views;
    const Image& shown = view.image.weight;  // what the lens showed
    score.psnr_db +=
        shown.empty() ? psnr_db(picture, view.image.color) : psnr_db(picture, view.image.color, shown).value_or(0);
    const std::optional<double> foreground =
        view.is_seen ? psnr_db(picture, view.image.color, view.image.mask) : std::nullopt;
    if (!foreground) continue;
    score.psnr_foreground_db = score.psnr_foreground_db.value_or(0) + *foreground;
    score.silhouette_iou = score.silhouette_iou.value_or(0) + mask_iou(graph.silhouette(), view.image.mask).value_or(0);
    ++masked;
  }
  if (score.views > 0) score.psnr_db /= static_cast<double>(score.views);
  if (score.psnr_foreground_db) *score.psnr_foreground_db /= static_cast<double>(masked);
  if (score.silhouette_iou) *score.silhouette_iou /= static_cast<double>(masked);
  return score;
}

}  // namespace

bool is_held(const AvatarFitSettings& settings, const PosedView& view) {
  const auto has = [](const std::vector<double>& numbers, Index number) {
    return std::find(numbers.begin(), numbers.end(), static_cast<double>(number)) != numbers.end();
  };
  return has(settings.held_cameras, view.camera) || has(settings.held_frames, view.frame);
}

Avatar first_avatar(const AvatarFitSettings& settings) {
  Avatar avatar;
  if (!settings.avatar.empty()) {
    avatar = read_avatar(settings.avatar.string());
  } else {
    AvatarSettings made;
    made.gaussians = settings.gaussians;
    made.seed = static_cast<std::uint64_t>(settings.seed);
    avatar = surface_avatar(rest_body(settings.body), made);
    std::fill(avatar.colors.begin(), avatar.colors.end(), kFirstColor);
  }
  avatar.color_net = first_color_net(settings.color_net, avatar, settings.seed);
  return avatar;
}

AvatarFitResult fit_avatar(const AvatarFitSettings& settings, const Avatar& first, const ViewSet& set,
                           std::span<const LossTerm> terms, const Observer& observer) {
  check_held(settings, set, "held_cameras", "camera", settings.held_cameras, &PosedView::camera, set.cameras.size());
  check_held(settings, set, "held_frames", "frame", settings.held_frames, &PosedView::frame, set.motion.poses.size());
  const std::vector<LoadedView> views = load_views(settings, set, first);
  std::vector<std::size_t> learnt;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!views[v].held) learnt.push_back(v);
  }
  if (learnt.empty()) throw UserError(set.file.string() + ": all views are held back; nothing is left to learn from");
  Tape<S> tape;
  FitGraph graph(tape, first, settings, set.cameras[static_cast<std::size_t>(set.views.front().camera)]);
  AvatarFitResult result;
  result.before = score_of(graph, views, false);
  ViewOrder order(std::move(learnt), settings.seed);
  graph.show(views[order.next()]);
  Progress progress("fit", settings.stage.iterations, observer.progress, observer.progress_interval);
  const auto after = [&](const IterationReport& report) {
    if (observer.wants_stop()) throw Interrupted("interrupted while an avatar was learnt; nothing is left of it");
    progress.step_with("loss", report.loss);
    graph.show(views[order.next()]);
  };
  result.stage = run_stage(tape, settings.stage, terms, graph.inputs(), graph.groups(), after, {"avatar fit"});
  progress.finish();
  result.avatar = first;
  graph.read(settings.stage.optimize, result.avatar);
  result.learnt = score_of(graph, views, false);
  result.held = score_of(graph, views, true);
  return result;
}

}  // namespace hsi4d
