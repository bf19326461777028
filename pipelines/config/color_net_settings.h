// Config section `color_net`: whether the human's colours follow the pose by a network, and which.
#pragma once

#include <array>
#include <optional>

#include "body/avatar.h"
#include "core/config.h"

namespace hsi4d {

/// Which network a run takes.
enum class ColorNetUse {
  kAuto,  ///< that of the avatar's file, none where it has none
  kOn,    ///< the same, a new one where it has none
  kOff,   ///< none: the avatar's own colours
};

inline constexpr std::array<ConfigChoice<ColorNetUse>, 3> kColorNetUses = {
    {{ColorNetUse::kAuto, "auto"}, {ColorNetUse::kOn, "on"}, {ColorNetUse::kOff, "off"}}};

/// The color net of a run.
struct ColorNetSettings {
  ColorNetUse use = ColorNetUse::kAuto;
  Index features = 16;
  Index hidden_width = 32;
  Index hidden_layers = 2;
  bool view_direction = false;
  bool camera_gradient = false;
};

/// Describes the section: every setting with its range.
void describe(ConfigFields& fields, ColorNetSettings& settings);

/// The network with which a run begins, if it has one.
/// @param seed  of a new one
std::optional<ColorNet> first_color_net(const ColorNetSettings& settings, const Avatar& avatar, std::int64_t seed);

}  // namespace hsi4d
