// An avatar learnt from pictures: the look of Gaussians on a body, from images of it in known poses.
//
// All views share one tape. Between two iterations the next view's camera, pose and picture are written into its
// leaves: the camera as the update ξ = Log(T_view T_first⁻¹) of the first one and its four intrinsics. A stage
// (optim/stage.h) moves what its settings name:
//
//   colors, opacity_logits, log_scales, quats, means    numbers of the avatar's Gaussians in the rest pose
//   offsets                                             a smooth field of offsets along the normal (offsets.h)
//   color_net, avatar_features                          of its color net, if it has one
//
// The loss `look` holds Gaussians to what the fit begins with. Colours stay from 0 to 1, or where the color net can see
// them (kLeastColor), so that what is measured is what a file of the avatar shows.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "body/avatar.h"
#include "core/config_value.h"
#include "core/observer.h"
#include "optim/loss_term.h"
#include "optim/stage.h"
#include "pipelines/config/body_settings.h"
#include "pipelines/config/color_net_settings.h"
#include "pipelines/input/view_set.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// A config of `hsi4d avatar fit`.
struct AvatarFitSettings {
  std::filesystem::path file;    ///< the config itself, for messages
  std::filesystem::path views;   ///< views.json of the set; empty: not given yet
  std::filesystem::path avatar;  ///< where it starts; empty: new Gaussians on the body
  std::int64_t seed = 0;         ///< of new Gaussians, a new network, and the order of the views
  int threads = 0;               ///< 0: one a core
  Index gaussians = 20000;       ///< of a new avatar
  std::array<double, 3> background = {0.5, 0.5, 0.5};
  int mask_inset_px = 0;             ///< pixels this near to what is not the human do not count for colours
  std::vector<double> held_cameras;  ///< views of these cameras are not learnt from, but measured
  std::vector<double> held_frames;   ///< nor those of these frames
  BodySettings body;
  ColorNetSettings color_net{.use = ColorNetUse::kOn};
  RenderSettings render;
  StageSettings stage;
};

/// Describes a config: every setting with its range.
/// @param losses  terms that the stage may name
void describe(ConfigFields& fields, AvatarFitSettings& settings, const std::vector<LossDescription>& losses);

/// Reads a config of `hsi4d avatar fit`, and prepares its losses. Throws UserError with all of its problems, or that it
/// is a config of `hsi4d run`.
AvatarFitSettings load_avatar_fit(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                  const std::vector<LossDescription>& losses);

/// As above of a tree that load_config made of `file`, telling its problems beside those found before.
/// @param asks_views  whether it is a problem that it names no views
AvatarFitSettings read_avatar_fit(const ConfigValue& tree, const std::filesystem::path& file,
                                  const std::vector<LossDescription>& losses, ConfigProblems& problems,
                                  bool asks_views = true);

/// Its text with every setting, defaults included.
std::string resolved_avatar_fit(const AvatarFitSettings& settings, const std::vector<LossDescription>& losses);

/// The JSON Schema (draft 2020-12) of such configs, and all of their settings.
std::string avatar_fit_schema(const std::vector<LossDescription>& losses);
std::vector<ConfigSetting> avatar_fit_settings(const std::vector<LossDescription>& losses);

/// Names of the groups that its stage may move.
std::vector<std::string> avatar_fit_groups();

/// How well views are shown.
struct ViewScore {
  Index views = 0;
  double psnr_db = 0;                        ///< mean over views, of whole pictures
  std::optional<double> psnr_foreground_db;  ///< weighted by masks; mean over the views that have one and show somebody
  std::optional<double> silhouette_iou;      ///< of what is drawn with the mask; mean over the same views
};

/// What a fit has learnt.
struct AvatarFitResult {
  Avatar avatar;      ///< as its file will be
  StageResult stage;  ///< of the last view that was seen
  ViewScore before;   ///< of the avatar that the fit began with, over the views that were learnt from
  ViewScore learnt;   ///< of that avatar, over the views that were learnt from
  ViewScore held;     ///< and over those that were held back
};

/// Whether a view is held back.
bool is_held(const AvatarFitSettings& settings, const PosedView& view);

/// The avatar that a fit starts from: that of its file, or Gaussians on the body, grey, with the color net that the
/// settings ask for. Throws as read_avatar, rest_body.
Avatar first_avatar(const AvatarFitSettings& settings);

/// Learns an avatar. A function of the arguments alone, for any number of threads.
///
/// @param first  where it starts
/// @param terms  that the stage may name; those that read the image, the human's opacity or the look have their inputs
/// Throws UserError: a held camera or frame of no view, cameras of different sizes, no view to learn from, poses of
/// another skeleton; DataError for images as view_image; as run_stage; Interrupted.
AvatarFitResult fit_avatar(const AvatarFitSettings& settings, const Avatar& first, const ViewSet& set,
                           std::span<const LossTerm> terms, const Observer& observer = {});

}  // namespace hsi4d
