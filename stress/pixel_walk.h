// T of every pixel with every Gaussian looked at in each of them, by the compositor's own functions in float: what
// tiles and culling must not change.
#pragma once

#include <vector>

#include "splat/splat_records.h"
#include "stress/splat_scene.h"

namespace hsi4d::stress {

class WalkedScene {
 public:
  explicit WalkedScene(const Scene& scene);

  /// [H,W] as composited.
  std::vector<double> transmittance() const;
  /// [H,W] where a Gaussian is composited in all pixels of the tiles that its square of three standard deviations
  /// touches, and in no others.
  std::vector<double> transmittance_by_tiles(Index tile) const;
  /// [H,W] with ellipses of so many binary digits.
  std::vector<double> transmittance_of_digits(int bits) const;

 private:
  template <class Touches>
  std::vector<double> walk(const detail::CompositeRules<float>& rules, const Touches& touches) const;

  Camera camera_;
  RenderSettings settings_;
  std::vector<detail::SplatRecord<float>> records_;  // in depth order
};

}  // namespace hsi4d::stress
