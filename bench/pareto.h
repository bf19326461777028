// `hsi4d bench pareto`: run time against error of the renderer, setting by setting.
//
// Every scene is drawn, and a fixed random cotangent taken back, under every setting: times beside the default's,
// errors beside the brute-force renderer in double without a cut (alpha_min 0, transmittance_stop 0). What no other
// setting beats in both time and error is the front.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/simd.h"
#include "pipelines/draw/image_of_scene.h"
#include "splat/gaussians.h"

namespace hsi4d {

// --- what is measured ------------------------------------------------------------------------------------------------

/// Gaussians and a camera that sees them, or does not.
struct ParetoScene {
  std::string name;
  Gaussians gaussians;
  Camera camera;
  bool is_extreme = false;  ///< nothing to see, or everything on one spot: presets alone, and in no front
};

/// The names of the made-up scenes.
std::vector<std::string> pareto_scene_names();

/// A made-up scene: the same bits every time.
/// @param size  1: as it is measured; less: so much smaller image sides, and Gaussians by its square
/// Throws UserError naming the known ones for another name.
ParetoScene pareto_scene(const std::string& name, double size = 1);

/// The Gaussians of a file, seen from obliquely above (z up) at 1.3 times the extent of most of them. Of more than
/// kMostParetoGaussians so many are kept, and enlarged to cover as much. It has the file's name, without folders.
/// Throws as read_splats, and UserError when the file has no Gaussians.
ParetoScene pareto_scene_of(const std::string& file);

/// The scenes of files; of a folder, of all files of Gaussians in it by their endings, in the order of their names. Two
/// files of one name are told apart by their paths. Throws UserError for a folder without any, and as pareto_scene_of.
std::vector<ParetoScene> pareto_scenes_of(const std::vector<std::string>& paths);

inline constexpr Index kMostParetoGaussians = 8000;

/// The model whose numbers a setting's are compared with: its own without cuts, or the one without a cap of alpha too.
enum class ParetoModel { kOwn, kUncapped };

/// The renderer with one or a few knobs turned.
struct ParetoSetting {
  std::string knob;   ///< "alpha_min"; "quality" for presets, "product" for more than one knob
  std::string value;  ///< "1/512"; "default" is what times are told of
  RenderSettings settings;
  Precision precision = Precision::kFloat;  ///< never kReference
  ParetoModel model = ParetoModel::kOwn;
  std::optional<Isa> isa = {};  ///< none: the processor's best
  int threads = 0;              ///< 0: those of the bench

  std::string name() const { return knob + " " + value; }
};

/// Whether a knob is what the machine gives, an instruction set or threads: no choice between time and error, so that
/// it has rows and dots and no place in a front.
bool is_machine_knob(const std::string& knob);

/// All settings, the default first. Instruction sets are those that the processor has.
const std::vector<ParetoSetting>& pareto_settings();

/// The knobs of these settings, each once.
std::vector<std::string> pareto_knobs();

// --- errors ----------------------------------------------------------------------------------------------------------

/// Of an image whose white is 1. All 0 where there is no difference, and of an image without pixels.
struct ImageError {
  double rms = 0, max = 0, p999 = 0;
  double bias = 0;  ///< mean of the signed difference

  /// −20 log₁₀ rms; none where there is no difference.
  std::optional<double> psnr_db() const;
};

/// Of a class of derivatives: g against the true t. All 0 where both are 0.
struct GradientError {
  double relative_l2 = 0;       ///< |g − t| / |t|
  double one_minus_cosine = 0;  ///< 1 − g·t / (|g| |t|)
  double bias = 0;              ///< (g − t)·t / |t|²: how much too long along the truth
};

/// In the order in which errors are told.
inline constexpr std::array<const char*, 6> kGradientClasses = {"means",          "quats", "log_scales",
                                                                "opacity_logits", "sh",    "camera"};

using GradientErrors = std::array<GradientError, kGradientClasses.size()>;

/// Throws InternalError when the two have different counts of numbers, as all of these.
ImageError image_error(std::span<const double> image, std::span<const double> truth);
GradientError gradient_error(std::span<const double> gradient, std::span<const double> truth);
/// No error in a class that truly has no derivatives but for rounding (quaternions of balls), and none in float either.
GradientErrors gradient_errors(const SceneGradients& gradients, const SceneGradients& truth);

// --- measurements ----------------------------------------------------------------------------------------------------

/// Seconds of repeated runs.
struct RunTimes {
  double median_s = 0, least_s = 0;
};

/// One scene under one setting.
struct ParetoRow {
  std::string scene;
  bool is_extreme = false;
  std::string knob, value;
  ParetoModel model = ParetoModel::kOwn;
  Index gaussians = 0, pixels = 0, fragments = 0, pairs = 0;
  Isa isa = Isa::kBaseline;
  int threads = 1, repeats = 0;
  RunTimes forward = {}, backward = {};  ///< of a kept tape: from the numbers to the image, and back to them
  RunTimes both = {};                    ///< of one after the other
  double forward_ratio = 1;              ///< of medians, to the default's that ran in turns with it
  double backward_ratio = 1;             ///< likewise
  double time_ratio = 1;                 ///< of forward and backward together
  ImageError image = {};
  GradientErrors gradients = {};

  std::string name() const { return knob + " " + value; }
  bool is_preset() const { return knob == "quality"; }
  /// Millions of fragments a second, forward and backward, by the median.
  double mfragments_per_s() const;
  /// The largest relative L2 of the classes.
  double worst_gradient() const;
};

struct ParetoBench {
  std::vector<ParetoScene> scenes;
  std::vector<ParetoSetting> settings;
  int repeats = 9;
  int threads = 1;
};

/// How many rows measure_pareto makes.
Index pareto_row_count(const ParetoBench& bench);

/// Measures. On one thread times are those that the processor gave, on more those of the clock.
/// @param told  after every row; may be empty
std::vector<ParetoRow> measure_pareto(const ParetoBench& bench, const std::function<void(const ParetoRow&)>& told = {});

// --- reconstructions -------------------------------------------------------------------------------------------------

/// What a setting's errors come to in a reconstruction, over all seeds (bench_pareto_tracking.h). Standard deviations
/// are those of a sample; 0 of one.
struct TrackedPoint {
  std::string knob, value;
  bool is_fixed_time = false;  ///< as many iterations as take as long as the default's; else as many as the default's
  double cost_ratio = 1;       ///< processor time of a frame's iterations, to the default's, at as many of them
  Index iterations = 0;        ///< a frame, of all stages
  Index seeds = 0;
  struct Spread {
    double mean = 0, deviation = 0;
  };
  Spread joints_mm = {}, world_mm = {}, object_cm = {}, camera_cm = {},
         camera_deg = {};  ///< errors of the last stage, means over the frames

  std::string name() const { return knob + " " + value; }
  bool is_preset() const { return knob == "quality"; }
  /// In JSON and CSV.
  const char* budget() const { return is_fixed_time ? "time" : "steps"; }
};

/// An error of reconstructions by its name in summary.json, JSON and CSV.
struct TrackedError {
  const char* metric;
  TrackedPoint::Spread TrackedPoint::*place;
};
inline constexpr std::array<TrackedError, 5> kTrackedErrors = {{{"mpjpe_mm", &TrackedPoint::joints_mm},
                                                                {"world_mpjpe_mm", &TrackedPoint::world_mm},
                                                                {"object_translation_cm", &TrackedPoint::object_cm},
                                                                {"camera_translation_cm", &TrackedPoint::camera_cm},
                                                                {"camera_rotation_deg", &TrackedPoint::camera_deg}}};

// --- the front -------------------------------------------------------------------------------------------------------

/// Something that takes time and has an error.
struct TimeAndError {
  double time = 0, error = 0;
};

/// Which of the points no other one beats: that is as fast and as good, and better in one of the two. Ascending in
/// time; of equal points the first.
std::vector<std::size_t> pareto_front(const std::vector<TimeAndError>& points);

/// A setting over the scenes that have it, extreme ones left out.
struct ParetoPoint {
  std::string knob, value;
  double time_ratio = 1;                      ///< geometric mean
  double image_rms = 0, worst_image_rms = 0;  ///< median and largest
  double gradient = 0, worst_gradient = 0;    ///< of ParetoRow::worst_gradient()

  std::string name() const { return knob + " " + value; }
  bool is_preset() const { return knob == "quality"; }
};

/// The settings of the rows in their order, those that are compared with another model than their own left out.
/// @param scene  of this one alone; empty: all
std::vector<ParetoPoint> pareto_points(const std::vector<ParetoRow>& rows, const std::string& scene = "");

/// The front of the points by one of their errors, without those of is_machine_knob.
std::vector<std::size_t> pareto_front(const std::vector<ParetoPoint>& points, double ParetoPoint::*error);

// --- text ------------------------------------------------------------------------------------------------------------

/// A table a scene.
std::string pareto_table(const std::vector<ParetoRow>& rows);
/// Fronts over all scenes and of avatar_in_scene, by image and by gradient; presets beside them.
std::string pareto_front_table(const std::vector<ParetoRow>& rows);
/// A head line, a line a row and one a reconstructed setting and budget, which have no scene. No PSNR where there is no
/// difference.
std::string pareto_csv(const std::vector<ParetoRow>& rows, const std::vector<TrackedPoint>& tracked = {});
/// One JSON object a line.
std::string pareto_json(const std::vector<ParetoRow>& rows);
/// Time against each error, a column for all scenes and one for avatar_in_scene, as an SVG file: dots by knob, the
/// front as a line, presets named. Below, where settings were reconstructed with, time against the pose's errors, a
/// column for as many steps and one for as much time: means, with a standard deviation to either side.
std::string pareto_svg(const std::vector<ParetoRow>& rows, const std::vector<TrackedPoint>& tracked = {});

/// Two of its panels: the errors of image and gradient of the scene by which settings are chosen.
std::string pareto_front_svg(const std::vector<ParetoRow>& rows);

}  // namespace hsi4d
