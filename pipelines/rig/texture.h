// Textures: pictures that are looked up at any place and at any sharpness.
#pragma once

#include <array>
#include <vector>

#include "core/image.h"
#include "pipelines/rig/loaded_mesh.h"

namespace hsi4d {

/// A texture and its halves [Williams 1983: mip maps]; the last has one texel. Colours are as the file has them, not
/// multiplied by alpha; where texels are averaged they are weighted by it.
struct Texture {
  struct Level {
    int width = 0, height = 0;
    Bytes rgba;  ///< [height][width][4], from the top
  };
  std::vector<Level> levels;
  bool has_alpha = false;  ///< a texel can be seen through
};

/// Larger textures are halved until they are within this, pixels.
inline constexpr int kLargestTexture = 4096;

/// @param image  [C,H,W], 1 to 4 channels, at least one pixel
Texture texture_from(const Image& image);

/// Colour and alpha at (u, v): u from the left edge, v up from the bottom edge; bilinear, between two levels.
/// @param texels  width of what is averaged, texels of the largest level; up to 1: that level alone
std::array<float, 4> look_up(const Texture& texture, double u, double v, double texels, TextureWrap wrap_u,
                             TextureWrap wrap_v);

}  // namespace hsi4d
