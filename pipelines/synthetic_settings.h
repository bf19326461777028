// Settings of synthetic datasets: config section `synthetic`.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "core/config.h"
#include "core/types.h"
#include "pipelines/body_settings.h"

namespace hsi4d {

/// What is carried.
enum class SyntheticObjectKind { kWateringCan, kBox };

inline constexpr std::array<ConfigChoice<SyntheticObjectKind>, 2> kSyntheticObjectKinds = {
    {{SyntheticObjectKind::kWateringCan, "watering_can"}, {SyntheticObjectKind::kBox, "box"}}};

/// What is made.
enum class SyntheticKind { kClip, kViews };

inline constexpr std::array<ConfigChoice<SyntheticKind>, 2> kSyntheticKinds = {
    {{SyntheticKind::kClip, "clip"}, {SyntheticKind::kViews, "views"}}};

/// Fewest Gaussians that the room and the object can be made of: one for each of their surfaces.
inline constexpr Index kFewestRoomGaussians = 700;
inline constexpr Index kFewestObjectGaussians = 60;

/// What a synthetic dataset holds.
struct SyntheticSettings {
  SyntheticKind kind = SyntheticKind::kClip;
  std::int64_t seed = 0;
  Index frames = 8;
  double frame_rate = 10;  ///< frames a second
  int size_px = 256;
  int supersample = 2;
  SyntheticObjectKind object = SyntheticObjectKind::kWateringCan;
  Index scene_gaussians = 12000;
  Index avatar_gaussians = 5000;
  Index object_gaussians = 1500;
  double camera_drift = 1;
  double pose_noise_deg = 8;
  double hand_noise_share = 0.25;
  double root_noise_deg = 2;
  double root_noise_m = 0.02;
  Index views_cameras = 6;  ///< of kind views
  Index views_poses = 4;
};

/// Describes the section: every setting with its range.
void describe(ConfigFields& fields, SyntheticSettings& settings);

/// The settings as JSON text: what a dataset's synthetic.json holds. The body is in it unless it is the default.
std::string synthetic_settings_json(const SyntheticSettings& settings, const BodySettings& body = {});

}  // namespace hsi4d
