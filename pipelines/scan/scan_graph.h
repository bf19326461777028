// What a reconstruction renders: Gaussians on a tape, seen by whichever camera is written into its leaves.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "optim/loss_term.h"
#include "optim/parameters.h"
#include "pipelines/photos/photo.h"
#include "pipelines/scan/state.h"
#include "splat/render/render.h"

namespace hsi4d {

/// What a graph has beside colours; what is not asked for costs nothing.
struct ScanExtras {
  bool weight = false;    ///< of pixels
  bool depth = false;     ///< moments of the depth, and what the picture knows of it
  bool exposure = false;  ///< of each picture: pipelines/scan/exposure.h
};

/// The graph. All pictures have the size of one camera.
class ScanGraph {
 public:
  /// Records it.
  /// @param degree  of the harmonics that are used
  ScanGraph(const Gaussians& g, const Camera& camera, const RenderSettings& settings, int degree,
            const ScanExtras& extras = {});

  /// Writes a picture and its camera.
  /// @param background  behind the Gaussians, and behind the picture where it has alpha
  void show(const Photo& photo, const Vector3<double>& background);
  /// Writes a picture's kExposureNumbers; with ScanExtras::exposure alone.
  void set_exposure(std::span<const float> numbers);
  std::vector<float> exposure_numbers() const;

  /// What the Gaussians look like, of what was written.
  Image picture();
  /// Of the last forward run, not clamped, of the pixels that count.
  double psnr() const;
  /// What the leaves of the first groups hold, back into the Gaussians.
  void read(Gaussians& g, std::size_t groups = kScanGroups) const;

  Tape<float>& tape() { return tape_; }
  const LossInputs<float>& inputs() const { return inputs_; }
  /// The groups of Gaussians, in the order of scan_groups().
  const std::vector<ParameterGroup<float>>& groups() const { return groups_; }
  Var<float> group(std::size_t i) const { return groups_[i].blocks.front(); }
  Var<float> means_px() const { return means_px_; }
  /// Six planes of one number: gains of three channels, then offsets.
  Var<float> exposure() const { return exposure_; }

 private:
  Var<float> leaf(const char* name, const std::vector<float>& values, Index cols);
  void record(const SplatInputs<float>& splats, const ScanExtras& extras);

  Tape<float> tape_;
  SplatView view_;
  Var<float> xi_, intrinsics_, background_, background_planes_, means_px_, exposure_;
  LossInputs<float> inputs_;
  std::vector<ParameterGroup<float>> groups_;
};

/// What a picture shows before a colour: alpha · colour + (1 − alpha) · background.
Image before_color(const Photo& photo, const Vector3<double>& background);

}  // namespace hsi4d
