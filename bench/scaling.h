// `hsi4d bench scaling`: how the time of an iteration grows with the size of what is reconstructed.
//
// One frame of a generated clip is made in memory, and the stages of the config that draw a frame run on it as a run
// runs them: the scene of N Gaussians, the human of A, the image of S², on so many threads. Along each axis one of the
// four changes and the others are the config's.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"

namespace hsi4d {

/// Something that costs time. A point of it is a config with another value of one setting.
struct ScalingAxis {
  std::string name;             ///< "scene", as the command line has it
  std::string setting;          ///< "synthetic.scene_gaussians"
  std::string label;            ///< "Gaussians of the scene"
  std::vector<Index> values{};  ///< ascending
};

/// Every axis with the values that it has unless others are asked for.
const std::vector<ScalingAxis>& scaling_axes();

/// The axes that words like "scene" or "scene=1000,2000" ask for; no words: all. Throws UserError for another name, for
/// what is no list of whole numbers, and for an axis named twice.
std::vector<ScalingAxis> chosen_axes(const std::vector<std::string>& words);

/// A stage of one point; times in milliseconds, medians of the iterations after the first kWarmIterations, of all
/// rounds.
struct ScalingCost {
  std::string stage;
  bool moves_camera = false;  ///< every tile is composited, and all that stands is projected anew
  bool draws_all = false;     ///< human and objects too
  double ms = 0, min_ms = 0;
  double processor_ms = 0;  ///< of all threads: what others do on the machine counts little
  double first_ms = 0;      ///< of the very first iteration, the least of all rounds
  double prepare_ms = 0, forward_ms = 0, backward_ms = 0;  ///< of `composite`: up to its lists; pixels; their adjoint
  Index channels = 0, tiles = 0, pairs = 0, fragments = 0;
  Index repeats = 0;  ///< iterations that were measured

  /// What is not compositing: projection, colours, posing, losses, steps.
  double other_ms() const { return ms - prepare_ms - forward_ms - backward_ms; }
};

/// Iterations before those that are measured: what stands is built in the first, memory is touched in both.
inline constexpr int kWarmIterations = 2;

/// How often all points are measured one after the other, so that a machine that gets slower or busier does so for all.
inline constexpr int kScalingRounds = 3;

/// One config that was measured.
struct ScalingPoint {
  Index value = 0;
  int threads = 1;
  Index scene_gaussians = 0, avatar_gaussians = 0, object_gaussians = 0;  ///< that were made
  Index pixels = 0;
  std::vector<ScalingCost> stages;
  Index peak_memory_bytes = 0;  ///< of the process until then
};

/// Measures each stage that draws a frame, in frame 1 of the generated clip, from frame 0's state; groups that move
/// later than others move from the beginning on.
/// @param configs   with the section `synthetic` and the same stages; config.threads 0: one a core
/// @param repeats   iterations that are measured, of all rounds, or a few more
/// @param measured  called kScalingRounds times a config
/// @return          a point a config; without values
/// Throws as run_stage; UserError when no stage draws a frame.
std::vector<ScalingPoint> measure_scaling(const std::vector<RunConfig>& configs, const std::vector<LossTerm>& losses,
                                          int repeats, const std::function<void()>& measured = {});

/// How a count or a time grows along an axis: like value^exponent.
struct ScalingFit {
  std::string stage, quantity;     ///< "camera"; "least ms", "processor ms", "pairs" or "fragments"
  std::optional<double> expected;  ///< where it was thought about
  std::optional<double> fitted;    ///< least squares of the logarithms; none of fewer than two values, or of zeros
  double scale = 0;                ///< fitted: quantity = scale · value^fitted
  std::string reason;              ///< for what was expected
};

/// The exponents of every stage along an axis.
std::vector<ScalingFit> scaling_fits(const ScalingAxis& axis, const std::vector<ScalingPoint>& points);

/// An axis that was measured.
struct ScalingResult {
  ScalingAxis axis;
  std::vector<ScalingPoint> points;
};

/// A table an axis: a line a stage and value, then the exponents.
std::string scaling_table(const std::vector<ScalingResult>& results);

/// The same as one JSON object a line: {"name", "axis", "value", "stage", "median_ms", ...}, then {"axis", "stage",
/// "quantity", "expected", "fitted"}.
std::string scaling_json(const std::vector<ScalingResult>& results);

/// Processor time over the values, over threads the least time, both on logarithmic scales, a panel an axis, as an SVG
/// file: what was measured as dots, the fit as a line, the expected growth dashed through the middle of the dots.
std::string scaling_svg(const std::vector<ScalingResult>& results, const std::string& title);

}  // namespace hsi4d
