// Every pixel with every Gaussian looked at in it, by the compositor's own functions in float: what tiles and culling
// must not change.
#pragma once

#include <array>
#include <vector>

#include "splat/render/splat_records.h"
#include "stress/splat_scene.h"

namespace hsi4d::stress {

/// What is composited of a scene.
struct WalkedPixels {
  std::vector<double> transmittance;  ///< [H,W]
  std::vector<double> image;          ///< [3,H,W], summed in double
  std::vector<double> d_colors;       ///< [N,3] gradient by the colours, likewise
};

class WalkedScene {
 public:
  explicit WalkedScene(const Scene& scene);

  /// @param cotangent  [3,H,W] of the image
  WalkedPixels everything(const std::vector<double>& cotangent) const;
  /// [H,W] where a Gaussian is composited in all pixels of the tiles that its square of three standard deviations
  /// touches, and in no others.
  std::vector<double> transmittance_by_tiles(Index tile) const;
  /// [H,W] with ellipses of so many binary digits.
  std::vector<double> transmittance_of_digits(int bits) const;

 private:
  /// T of every pixel.
  /// @param touches  (record, row, col) whether a Gaussian is looked at
  /// @param visit    (pixel, place in records_, weight) what is composited
  template <class Touches, class Visit>
  std::vector<double> walk(const detail::CompositeRules<float>& rules, const Touches& touches,
                           const Visit& visit) const;
  std::vector<double> transmittance() const;

  Camera camera_;
  RenderSettings settings_;
  std::array<float, 3> background_;
  std::vector<Index> rows_;                          // of the scene, in depth order
  std::vector<detail::SplatRecord<float>> records_;  // of these
  std::vector<double> colors_;                       // [N,3]
};

}  // namespace hsi4d::stress
