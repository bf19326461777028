#include "pipelines/run/place_uncertainty.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <tuple>

#include <Eigen/Geometry>

#include "autodiff/curvature.h"
#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "optim/information.h"
#include "optim/metrics.h"
#include "optim/stage_loss.h"
#include "pipelines/config/parameter_groups.h"

namespace hsi4d {

namespace {

/// Squares to the foreground's side, √ of its pixels.
constexpr double kSquares = 8;
/// A residual is no surer than what 8 bits leave.
constexpr double kLeastVariance = 1.0 / (255 * 255 * 12);
/// A pixel belongs to the foreground from this share on.
constexpr float kShown = 0.5F;
/// A silhouette's pixel is at its edge where it is neither empty nor full by more than this, or differs by it.
constexpr double kEdge = 0.02;

constexpr std::array<LossInput, 4> kPixelInputs = {LossInput::kImage, LossInput::kHumanOpacity,
                                                   LossInput::kObjectOpacity, LossInput::kDepthMap};

bool reads_pixels(const LossSettings& loss) {
  return std::any_of(kPixelInputs.begin(), kPixelInputs.end(),
                     [&loss](LossInput input) { return needs_input(loss, input); });
}

bool some_need(const StageSettings& stage, LossInput input) {
  return std::any_of(stage.losses.begin(), stage.losses.end(),
                     [input](const auto& entry) { return needs_input(entry.second, input); });
}

// ---- What residuals say ----

struct Noise {
  double count = 0;     ///< numbers that were looked at
  double absolute = 0;  ///< mean |r|
  double square = 0;    ///< mean r²
  double together = 0;  ///< v
};

/// @param counts  whether a number of the images counts, by plane, row and column
template <class S, class Counts>
Noise noise_of(const ConstArray<S>& a, const ConstArray<S>& b, Index side, const Counts& counts) {
  const Shape& shape = a.shape;
  const Index across = (shape.cols + side - 1) / side;
  Noise noise;
  std::vector<double> sums(static_cast<std::size_t>(across));
  for (Index plane = 0; plane < shape.planes; ++plane) {
    for (Index top = 0; top < shape.rows; top += side) {
      std::fill(sums.begin(), sums.end(), 0.0);
      for (Index y = top; y < std::min(top + side, shape.rows); ++y) {
        for (Index x = 0; x < shape.cols; ++x) {
          if (!counts(plane, y, x)) continue;
          const double r = static_cast<double>(a(plane, y, x)) - static_cast<double>(b(plane, y, x));
          noise.count += 1;
          noise.absolute += std::abs(r);
          noise.square += r * r;
          sums[static_cast<std::size_t>(x / side)] += r;
        }
      }
      for (const double sum : sums) noise.together += sum * sum;
    }
  }
  if (noise.count == 0) return noise;
  noise.absolute /= noise.count;
  noise.square = std::max(noise.square / noise.count, kLeastVariance);
  noise.together = std::max(noise.together / noise.count, kLeastVariance);
  return noise;
}

// ---- From parameters to places ----

bool is_rotation(const std::string& group) {
  return group == kObjectOrientGroup ||
         std::any_of(kJointGroups.begin(), kJointGroups.end(),
                     [&group](const JointGroup& joints) { return group == joints.name; });
}

template <class S>
class Estimate {
 public:
  Estimate(Tape<S>& tape, const StageTask& task, const std::vector<ParameterGroup<S>>& available,
           const LossInputs<S>& inputs, const Image& foreground)
      : tape_(tape),
        stage_(task.config.stages[task.stage].second),
        inputs_(inputs),
        foreground_(foreground),
        groups_(named_groups(stage_, available, task.config.stages[task.stage].first)) {
    for (const ParameterGroup<S>& group : available) set_frozen(tape, group, true);
    const std::vector<std::string> movable = state_group_names(Draw::kAll);
    for (const OptimizerGroup<S>& group : groups_) {
      const std::string& name = group.parameters.name;
      const bool is_pose = name != kColorNetGroup && name != kFeaturesGroup && name != kObjectLightGroup &&
                           std::find(movable.begin(), movable.end(), name) != movable.end();
      if (!is_pose) continue;
      set_frozen(tape, group.parameters, false);
      for (const Var<S> block : group.parameters.blocks) add_leaf(block, is_rotation(name));
    }
    const std::span<const float> shares = foreground.data();
    const auto shown = std::count_if(shares.begin(), shares.end(), [](float share) { return share >= kShown; });
    has_foreground_ = shown > 0;
    const Shape& image = inputs.rendered.shape();
    const double pixels = static_cast<double>(has_foreground_ ? shown : image.rows * image.cols);
    side_ = std::max<Index>(1, static_cast<Index>(std::lround(std::sqrt(pixels) / kSquares)));
    record(task);
  }

  PlaceSigmas sigmas(const std::vector<Var<S>>& objects, const Matrix3<double>& camera_from_world) {
    Curvature<S> curvature(tape_, total_, leaves_);
    tape_.forward(total_);
    tape_.backward(total_);
    const Information information(steps_.transpose() * curvature.compute() * steps_);
    PlaceSigmas sigmas;
    sigmas.joints = joint_sigmas(information, inputs_.joints, camera_from_world);
    for (const LossInputs<S>& other : inputs_.others)
      sigmas.others.push_back(joint_sigmas(information, other.joints, camera_from_world));
    for (const Var<S> place : objects) {
      tape_.forward(place);
      sigmas.objects.push_back(sigma(information, place, 0, 0, camera_from_world));
    }
    return sigmas;
  }

 private:
  void add_leaf(Var<S> leaf, bool is_rotation) {
    const Shape shape = leaf.shape();
    const ConstArray<S> values = tape_.value(leaf);
    const Index row = steps_.rows(), col = steps_.cols();
    const bool is_six = is_rotation && shape.cols == 6;
    const Index steps = is_six ? 3 : shape.cols;
    steps_.conservativeResize(row + shape.count(), col + shape.rows * steps);
    steps_.bottomRows(shape.count()).setZero();
    steps_.rightCols(shape.rows * steps).setZero();
    for (Index r = 0; r < shape.rows; ++r) {
      auto block = steps_.block(row + r * shape.cols, col + r * steps, shape.cols, steps);
      if (!is_six) {
        block.setIdentity();
        continue;
      }
      for (Index axis = 0; axis < 3; ++axis) {  // both columns turn about it
        for (Index k = 0; k < 6; k += 3) {
          Vector3<double> column;
          for (Index i = 0; i < 3; ++i) column[i] = static_cast<double>(values(r, k + i));
          block.col(axis).segment(k, 3) = Vector3<double>::Unit(axis).cross(column);
        }
      }
    }
    leaves_.push_back(leaf);
  }

  /// The likelihood.
  void record(const StageTask& task) {
    const RecordedLoss<S> loss = record_loss(stage_, task.losses, inputs_, task.config.stages[task.stage].first);
    double priors = 0;
    if (some_need(stage_, LossInput::kImage)) {
      const Noise noise = image_noise();
      const Var<S> squares = inputs_.given(inputs_.weight) ? l2(inputs_.rendered, inputs_.target, inputs_.weight)
                                                           : l2(inputs_.rendered, inputs_.target);
      const auto count = static_cast<double>(inputs_.rendered.shape().count());
      add(squares, noise.count == 0 ? 0 : count / (2 * noise.together));
      if (noise.count > 0)
        priors = count * noise.square / (noise.together * noise.absolute * weight_of(LossInput::kImage));
    }
    std::vector<std::tuple<LossInput, Var<S>, Var<S>, Var<S>>> silhouettes = {
        {LossInput::kHumanOpacity, inputs_.human_opacity, inputs_.human_mask, inputs_.human_seen},
        {LossInput::kObjectOpacity, inputs_.object_opacity, inputs_.object_masks, inputs_.object_seen}};
    for (const LossInputs<S>& other : inputs_.others)
      silhouettes.emplace_back(LossInput::kHumanOpacity, other.human_opacity, other.human_mask, other.human_seen);
    for (const auto& [input, opacity, masks, seen] : silhouettes) {
      if (!some_need(stage_, input) || !inputs_.given(opacity)) continue;
      const Noise noise = edge_noise(opacity, masks, seen);
      if (noise.count == 0) continue;
      const double factor = static_cast<double>(opacity.shape().count()) / (2 * noise.together);
      add(l2(opacity, masks, seen), factor);
      if (priors == 0) priors = factor / weight_of(input);
    }
    for (std::size_t k = 0; k < loss.terms.size(); ++k) {
      const LossSettings& term = *find_entry(stage_.losses, loss.values[k].name);
      if (!reads_pixels(term) && priors > 0) add(loss.terms[k], priors * term.weight);
    }
  }

  void add(Var<S> term, double factor) {
    const Var<S> weighted = term * factor;
    total_ = total_.tape == nullptr ? weighted : total_ + weighted;
  }

  double weight_of(LossInput input) const {
    double weight = 0;
    for (const auto& [name, loss] : stage_.losses) weight += needs_input(loss, input) ? loss.weight : 0;
    return weight;
  }

  /// Of the foreground, or of the whole image where the frame has no masks, where pixels count.
  Noise image_noise() {
    tape_.forward(inputs_.rendered);
    ConstArray<S> weight;
    if (inputs_.given(inputs_.weight)) weight = tape_.value(inputs_.weight);
    return noise_of<S>(tape_.value(inputs_.rendered), tape_.value(inputs_.target), side_, [&](Index, Index y, Index x) {
      const bool is_shown = !has_foreground_ || foreground_(0, static_cast<int>(y), static_cast<int>(x)) >= kShown;
      return is_shown && (!weight || weight(0, y, x) > S(0));
    });
  }

  Noise edge_noise(Var<S> opacity, Var<S> masks, Var<S> seen) {
    tape_.forward(opacity);
    const ConstArray<S> a = tape_.value(opacity), b = tape_.value(masks), is_seen = tape_.value(seen);
    return noise_of<S>(a, b, side_, [&](Index plane, Index y, Index x) {
      const auto is_partial = [](S share) { return share > S(kEdge) && share < S(1 - kEdge); };
      return is_seen.data[plane] > S(0) && (is_partial(a(plane, y, x)) || is_partial(b(plane, y, x)) ||
                                            std::abs(a(plane, y, x) - b(plane, y, x)) > S(kEdge));
    });
  }

  /// Of the place in three columns of a row, by backward runs.
  Eigen::MatrixXd jacobian(Var<S> places, Index row, Index col) {
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(3, steps_.rows());
    std::vector<S> cotangent(static_cast<std::size_t>(places.shape().count()), S(0));
    for (Index axis = 0; axis < 3; ++axis) {
      S& one = cotangent[static_cast<std::size_t>(row * places.shape().cols + col + axis)];
      one = 1;
      tape_.backward(places, std::span<const S>(cotangent));
      one = 0;
      Index at = 0;
      for (const Var<S> leaf : leaves_) {
        const Index count = leaf.shape().count();
        if (tape_.has_gradient(leaf)) {
          const ConstArray<S> gradient = tape_.gradient(leaf);
          for (Index i = 0; i < count; ++i)
            jacobian(axis, at + i) = static_cast<double>(gradient.row(i / leaf.shape().cols)[i % leaf.shape().cols]);
        }
        at += count;
      }
    }
    return jacobian;
  }

  /// Of the frame at hand, the last row.
  std::vector<PlaceSigma> joint_sigmas(const Information& information, Var<S> joints,
                                       const Matrix3<double>& camera_from_world) {
    std::vector<PlaceSigma> sigmas;
    tape_.forward(joints);
    for (Index j = 0; j < kMetricJoints; ++j)
      sigmas.push_back(sigma(information, joints, joints.shape().rows - 1, 3 * j, camera_from_world));
    return sigmas;
  }

  PlaceSigma sigma(const Information& information, Var<S> places, Index row, Index col,
                   const Matrix3<double>& camera_from_world) {
    const Eigen::MatrixXd rows = camera_from_world * (jacobian(places, row, col) * steps_);
    const Eigen::VectorXd sigmas = kSigmaFactor * information.sigmas(rows);
    return {std::sqrt((sigmas[0] * sigmas[0] + sigmas[1] * sigmas[1]) / 2), sigmas[2]};
  }

  Tape<S>& tape_;
  const StageSettings& stage_;
  const LossInputs<S>& inputs_;
  const Image& foreground_;
  std::vector<OptimizerGroup<S>> groups_;
  std::vector<Var<S>> leaves_;
  Eigen::MatrixXd steps_;  // from small turns and ways to the leaves' numbers
  bool has_foreground_ = false;
  Index side_ = 1;  // of squares, pixels
  Var<S> total_;
};

}  // namespace

template <class S>
PlaceSigmas place_sigmas(Tape<S>& tape, const StageTask& task, const std::vector<ParameterGroup<S>>& available,
                         const LossInputs<S>& inputs, const std::vector<Var<S>>& objects, const Image& foreground,
                         const Matrix3<double>& camera_from_world) {
  struct Restored {
    TapeGuard<S> guard;
    ~Restored() { guard.restore(); }
  } restored{{tape, available}};
  return Estimate<S>(tape, task, available, inputs, foreground).sigmas(objects, camera_from_world);
}

template PlaceSigmas place_sigmas(Tape<float>&, const StageTask&, const std::vector<ParameterGroup<float>>&,
                                  const LossInputs<float>&, const std::vector<Var<float>>&, const Image&,
                                  const Matrix3<double>&);
template PlaceSigmas place_sigmas(Tape<double>&, const StageTask&, const std::vector<ParameterGroup<double>>&,
                                  const LossInputs<double>&, const std::vector<Var<double>>&, const Image&,
                                  const Matrix3<double>&);

}  // namespace hsi4d
