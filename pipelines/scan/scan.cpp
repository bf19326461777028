#include "pipelines/scan/scan.h"

#include <algorithm>
#include <chrono>
#include <optional>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "core/text.h"
#include "pipelines/config/config_kind.h"
#include "pipelines/rig/mesh_photos.h"
#include "pipelines/scan/exposure.h"
#include "pipelines/scan/photo_checks.h"
#include "pipelines/scan/report.h"
#include "pipelines/scan/scan_graph.h"
#include "pipelines/scan/start.h"
#include "splat/files/splat_file.h"

namespace hsi4d {

namespace fs = std::filesystem;

namespace {

constexpr const char* kConfig = "config.json";
constexpr const char* kCheckpoint = "checkpoint.npz";
constexpr const char* kPictures = "pictures";
constexpr const char* kSummary = "summary.json";

std::vector<Photo> read_photos(const PosedImages& set, const PhotoRules& rules) {
  std::vector<Photo> photos(set.images.size());
  parallel_for(std::ssize(photos), 1, [&](Index begin, Index end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
      photos[i] = read_photo(set.images[i], rules);
  });
  return photos;
}

std::vector<Camera> cameras_of(const std::vector<Photo>& photos) {
  std::vector<Camera> cameras;
  for (const Photo& photo : photos) cameras.push_back(photo.camera);
  return cameras;
}

/// Pictures of a mesh are taken once, into the folder; nothing is begun before cameras are found.
PosedImages pictures_of(const ScanSettings& settings, const fs::path& folder, const std::string& config,
                        const Observer& observer) {
  const fs::path& path = settings.photos.path;
  if (!is_mesh_file(path.string())) return read_posed_images(path, settings.photos.pictures);
  const fs::path pictures = folder / kPictures;
  if (!fs::exists(pictures)) {
    const MeshPhotos photos =
        prepare_mesh_photos(path.string(), settings.photos.rig, settings.kind == ScanKind::kObject,
                            static_cast<std::uint64_t>(settings.seed));
    write_text_file((folder / kConfig).string(), config);  // from here on it can be resumed
    write_mesh_photos(photos, pictures, observer);
  }
  return read_posed_images(pictures / "transforms.json");
}

/// What can be wrong with the folder, before anything is read.
void check_folder(const ScanSettings& settings, const fs::path& folder, bool resume, const std::string& config) {
  const fs::path file = folder / kConfig;
  if (!resume) {
    if (fs::exists(folder) && (!fs::is_directory(folder) || !fs::is_empty(folder)))
      throw UserError(folder.string() +
                      ": is not empty; --out names a new or empty folder, or --resume goes on with it");
    return;
  }
  if (!fs::exists(file))
    throw UserError(folder.string() + ": there is nothing to go on with; without --resume it is begun");
  if (read_text_file(file.string()) != config)
    throw UserError(file.string() + ": was begun with other settings than those of " + settings.file.string() +
                    "; go on with the same, or begin in another folder");
  if (!fs::exists(folder / kSummary)) return;
  fs::remove(folder / kCheckpoint);  // where it was killed before that
  throw UserError(folder.string() + ": is done; nothing is left to go on with");
}

ScanState first_state(const ScanSettings& settings, const PosedImages& set, const std::vector<Photo>& photos) {
  ScanState state;
  state.gaussians = first_gaussians(settings, set, photos);
  return state;
}

ScanSummary write_result(const ScanSettings& settings, const PosedImages& set, const std::vector<Photo>& photos,
                         const ScanState& state, const fs::path& folder, double seconds) {
  ScanSummary summary;
  summary.name = fs::weakly_canonical(folder).filename().string();
  summary.gaussians = state.gaussians.count();
  summary.iterations = state.iteration;
  summary.width = photos.front().camera.width;
  summary.height = photos.front().camera.height;
  summary.seconds = seconds;
  summary.curve = state.curve;
  for (const PosedImage& image : set.images) summary.names.push_back(image.name);
  write_splats(scan_result(settings, folder).string(), state.gaussians);
  write_cameras((folder / "cameras.json").string(), cameras_of(photos));
  const Vector3<double> background(settings.background.data());
  summary.pictures = score_scan(settings, photos, state, [&](const ScanPicture& picture, const Image& image) {
    if (!picture.held) return;
    const std::string& name = summary.names[picture.photo];
    write_image((folder / "views" / view_file(picture.photo, name)).string(), image);
    write_image((folder / "views" / photo_file(picture.photo, name)).string(),
                before_color(photos[picture.photo], background));
  });
  summary.learnt = mean_score(summary.pictures, false);
  summary.held = mean_score(summary.pictures, true);
  write_text_file((folder / "report.html").string(), scan_report_page(summary));
  write_text_file((folder / kSummary).string(), scan_summary_json(summary));
  return summary;
}

}  // namespace

bool is_scan_folder(const fs::path& folder) {
  const std::string file = (folder / kConfig).string();
  if (!fs::is_regular_file(file)) return false;
  return config_kind(parse_json_text(read_text_file(file), file)) == ConfigKind::kScan;
}

fs::path scan_result(const ScanSettings& settings, const fs::path& folder) {
  return folder / (settings.kind == ScanKind::kScene ? "scene.ply" : "object.ply");
}

ScanSummary run_scan(const ScanSettings& settings, const fs::path& folder, bool resume, std::span<const LossTerm> terms,
                     const Observer& observer) {
  const std::vector<LossTerm> all(terms.begin(), terms.end());
  const std::string config = resolved_scan(settings, descriptions_of(all));
  check_folder(settings, folder, resume, config);
  const PosedImages set = pictures_of(settings, folder, config, observer);
  check_photo_cameras(settings, set);
  PhotoRules rules = settings.photos.rules;
  rules.masks = settings.kind == ScanKind::kObject ? MaskMeaning::kWanted : MaskMeaning::kCounts;
  const std::vector<Photo> photos = read_photos(set, rules);
  check_what_counts(settings, set, photos);
  const std::string checkpoint = (folder / kCheckpoint).string(), identity = config + photo_identity(set);
  ScanState state =
      resume && fs::exists(checkpoint) ? load_scan_state(checkpoint, identity) : first_state(settings, set, photos);
  write_text_file((folder / kConfig).string(), config);
  const auto begin = std::chrono::steady_clock::now();
  const ScanWatch watch{observer, [&](const ScanState& now) { save_scan_state(checkpoint, now, identity); }};
  fit_scan(settings, photos, extent_of(cameras_of(photos)), terms, watch, state);
  if (state.refused > 0)
    log_warning(std::to_string(state.refused) +
                " rows of gradients were no numbers, or too large; these Gaussians stood still then");
  give_mean_exposure(held_photos(settings.photos, photos.size()), state);
  ScanSummary summary = write_result(settings, set, photos, state, folder, seconds_since(begin));
  fs::remove(checkpoint);
  return summary;
}

}  // namespace hsi4d
