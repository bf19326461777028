#include "pipelines/config/color_net_settings.h"

namespace hsi4d {

void describe(ConfigFields& f, ColorNetSettings& s) {
  f.choice("use", s.use, kColorNetUses,
           "Network that colours the human by its pose: the avatar's if there is one, that or else a new one, or none");
  f.integer("features", s.features, {.min = 1, .max = 256}, "Features of each Gaussian, in a new network");
  f.integer("hidden_width", s.hidden_width, {.min = 1, .max = 1024}, "Width of its hidden layers");
  f.integer("hidden_layers", s.hidden_layers, {.min = 0, .max = kMostMlpLayers - 1}, "Number of hidden layers");
  f.boolean("view_direction", s.view_direction, "A new network also reads the viewing direction");
  f.boolean("camera_gradient", s.camera_gradient,
            "Colours have a gradient in the camera, through the viewing direction");
}

std::optional<ColorNet> first_color_net(const ColorNetSettings& settings, const Avatar& avatar, std::int64_t seed) {
  if (settings.use == ColorNetUse::kOff) return {};
  if (avatar.color_net || settings.use == ColorNetUse::kAuto) return avatar.color_net;
  ColorNetShape shape;
  shape.features = settings.features;
  shape.hidden_width = settings.hidden_width;
  shape.hidden_layers = settings.hidden_layers;
  shape.view_direction = settings.view_direction;
  shape.seed = static_cast<std::uint64_t>(seed);
  return new_color_net(avatar.means, avatar.joint_count(), shape);
}

}  // namespace hsi4d
