#include "pipelines/metrics/metric_facts.h"

#include <algorithm>
#include <charconv>

namespace hsi4d {
namespace {

const char* arrow_of(const MetricFacts& facts) { return facts.better < 0 ? " ↓" : facts.better > 0 ? " ↑" : ""; }

}  // namespace

const double* find_metric(const MetricValues& values, std::string_view name) {
  for (const auto& [key, value] : values) {
    if (key == name) return &value;
  }
  return nullptr;
}

const std::vector<MetricFacts>& metric_facts() {
  static const std::vector<MetricFacts> facts = {
      {"mpjpe_mm", "MPJPE", "mm", "Mean joint error, both pelvises at the origin", 1, -1},
      {"pa_mpjpe_mm", "PA-MPJPE", "mm", "Mean joint error after the best similarity", 1, -1},
      {"world_mpjpe_mm", "world MPJPE", "mm", "Mean joint error in the world", 1, -1},
      {"world_mpjpe_image_mm", "world, across view", "mm", "Part of the world error across the camera's view", 1, -1},
      {"world_mpjpe_depth_mm", "world, in depth", "mm", "Part of the world error along the camera's axis", 1, -1},
      {"root_translation_mm", "root position", "mm", "Distance of the pelvises", 1, -1},
      {"object_translation_cm", "object position", "cm", "Distance of the objects' centroids", 2, -1},
      {"object_rotation_deg", "object rotation", "°", "Angle between the objects' rotations", 2, -1},
      {"object_add_cm", "object ADD", "cm", "Mean distance of the objects' points", 2, -1},
      {"object_add_s_cm", "object ADD-S", "cm", "The same to the nearest point, which forgives symmetries", 2, -1},
      {"camera_translation_cm", "camera position", "cm", "Distance of the camera centres", 2, -1},
      {"camera_rotation_deg", "camera rotation", "°", "Angle between the cameras' rotations", 3, -1},
      {"psnr_db", "PSNR", "dB", "Peak signal-to-noise ratio, at most 100", 2, 1},
      {"psnr_foreground_db", "PSNR, foreground", "dB", "Peak signal-to-noise ratio of human and objects", 2, 1},
      {"psnr_background_db", "PSNR, background", "dB", "Peak signal-to-noise ratio where neither human nor objects are",
       2, 1},
      {"camera_drift_px", "camera drift", "px", "How far the drawn background is displaced from the video's", 2, -1},
      {"background_change", "background change", "",
       "Share of the background that has another colour than the scene, displacement and exposure apart", 3, -1},
      {"ssim", "SSIM", "", "Structural similarity", 4, 1},
      {"silhouette_iou", "silhouette IoU", "", "Intersection over union of the human's silhouette and mask", 3, 1},
      {"object_iou", "object IoU", "", "The same of the objects that their masks show", 3, 1},
      {"object_seen_share", "objects seen", "", "Share of the objects that their masks show", 3, 0},
      {"keypoints_px", "2D keypoints", "px", "Mean distance of the body in the image from where a detector found it", 1,
       -1},
      {"keypoints_pck", "PCK", "",
       "Share of 2D keypoints that are nearer than 5 % of the longer side of the box around them", 3, 1},
      {"contact_share", "contact", "", "Share of frames in which a hand joint is nearer than 5 cm to an object", 3, 0},
      {"contact_distance_mm", "contact distance", "mm",
       "How far from it the hands' Gaussians that near are, on average", 1, 0},
      {"penetration_share", "penetration", "", "Share of vertices inside something", 4, -1},
      {"penetration_depth_mm", "penetration depth", "mm", "How deep they are inside, on average", 1, -1},
      {"object_penetration_share", "object penetration", "", "Share of vertices inside an object", 4, -1},
      {"object_penetration_depth_mm", "object pen. depth", "mm", "How deep they are inside, on average", 1, -1},
      {"floor_drift_mm", "floor drift", "mm", "How much higher or lower the lowest foot is than in frame 0", 1, -1},
      {"foot_sliding_mm", "foot sliding", "mm", "How far feet that stand slide in 0.1 s", 1, -1},
      {"acceleration_error", "acceleration", "m/s²", "Mean error of the joints' accelerations", 2, -1},
      {"jitter", "jitter", "m/s³", "Mean third derivative of the joints' places", 1, -1},
      {"sigma_image_mm", "joints: sigma across view", "mm",
       "How sure the joints' places are along an axis of the image", 1, 0},
      {"sigma_depth_mm", "joints: sigma in depth", "mm", "How sure they are along the camera's axis", 1, 0},
      {"within_sigma_image", "joints within sigma, across view", "",
       "Share of the joints' errors along an axis of the image that are at most sigma: 0.68 where sigma is right", 3,
       0},
      {"within_sigma_depth", "joints within sigma, in depth", "", "The same along the camera's axis", 3, 0},
      {"object_sigma_image_cm", "objects: sigma across view", "cm",
       "How sure the objects' places are along an axis of the image", 2, 0},
      {"object_sigma_depth_cm", "objects: sigma in depth", "cm", "How sure they are along the camera's axis", 2, 0},
      {"object_within_sigma_image", "objects within sigma, across view", "",
       "Share of the objects' errors along an axis of the image that are at most sigma", 3, 0},
      {"object_within_sigma_depth", "objects within sigma, in depth", "", "The same along the camera's axis", 3, 0},
      {"unsure_share", "unsure places", "", "Share of joints and objects whose sigma is 1 m or more", 3, -1},
      {"wa_mpjpe_100_mm", "WA-MPJPE-100", "mm", "Mean joint error, each 100 frames laid on the truth", 1, -1},
      {"w_mpjpe_100_mm", "W-MPJPE-100", "mm", "The same, the first two of each 100 frames laid on the truth", 1, -1},
      {"rte_percent", "RTE", "%", "Error of the pelvis's way, laid on the truth, over its length", 2, -1},
      {"protocol_jitter", "jitter, protocol", "10 m/s³", "The jitter as EMDB's evaluations tell it", 1, -1},
      {"foot_point_sliding_mm", "foot sliding, four points", "mm",
       "Mean step of toes and heels from frame to frame while those of the truth stand", 1, -1},
      {"cd_human_cm", "CD-human", "cm", "Chamfer distance of the bodies, human and objects laid on the truth", 2, -1},
      {"cd_object_cm", "CD-object", "cm", "Chamfer distance of the objects, laid on the truth alike", 2, -1},
      {"cd_both_cm", "CD-both", "cm", "Chamfer distance of human and objects as one", 2, -1},
      {"acceleration_human_cm", "acceleration, human", "cm/frame²", "Mean error of the body's accelerations", 2, -1},
      {"acceleration_object_cm", "acceleration, object", "cm/frame²", "Mean error of the objects' accelerations", 2,
       -1},
      {"diversity_mm", "diversity", "mm", "Mean distance of joints over all pairs of repetitions", 1, 0},
      {"diversity_pose_mm", "diversity of poses", "mm", "The same with pelvises at the origin", 1, 0},
      {"clip_score", "CLIP score", "", "Agreement of the video with its text: 100 times the mean cosine", 2, 1},
      {"clip_consistency", "CLIP consistency", "", "Likeness of frames 0.1 s apart: 100 times the mean cosine", 2, 1},
  };
  return facts;
}

const MetricFacts* find_metric_facts(std::string_view name) {
  for (const MetricFacts& facts : metric_facts()) {
    if (facts.name == name) return &facts;
  }
  return nullptr;
}

std::string shown_metric(const MetricFacts& facts) {
  return std::string(facts.label) + (facts.unit.empty() ? "" : " [" + std::string(facts.unit) + "]");
}

std::string metric_heading(const MetricFacts& facts) {
  return std::string(facts.label) + (facts.unit.empty() ? "" : ", " + std::string(facts.unit)) + arrow_of(facts);
}

Cell metric_cell(const MetricFacts& facts, const double* value) {
  return value == nullptr ? kNoCell : Cell(*value, facts.decimals);
}

std::vector<Cell> metric_row(const MetricFacts& facts, const std::vector<const MetricValues*>& sources) {
  std::vector<Cell> row = {Cell(shown_metric(facts), "", std::string(facts.summary))};
  row[0].html =
      html_escape(facts.label) + " <span class=\"unit\">" + html_escape(facts.unit) + arrow_of(facts) + "</span>";
  bool is_measured = false;
  for (const MetricValues* const source : sources) {
    const double* const value = find_metric(*source, facts.name);
    is_measured = is_measured || value != nullptr;
    row.push_back(metric_cell(facts, value));
  }
  return is_measured ? row : std::vector<Cell>();
}

void mark_best(int better, const std::vector<Cell*>& cells) {
  std::vector<std::pair<double, Cell*>> shown;
  for (Cell* const cell : cells) {
    double number = 0;
    const char* const text = cell->text.data();
    if (std::from_chars(text, text + cell->text.size(), number).ec == std::errc())
      shown.emplace_back(number * better, cell);
  }
  if (shown.empty()) return;
  const auto [low, high] = std::minmax_element(shown.begin(), shown.end());
  const double best = high->first;
  if (low->first == best) return;
  for (const auto& [value, cell] : shown) {
    if (value == best) cell->mark = "best";
  }
}

}  // namespace hsi4d
