#include "pipelines/rig/mesh_photos.h"

#include <algorithm>

#include "core/log.h"
#include "core/parallel.h"
#include "core/text.h"
#include "pipelines/photos/photo_set.h"

namespace hsi4d {

namespace {

/// Colours and alpha as one image.
Image with_alpha(const MeshPicture& picture) {
  Image image(4, picture.color.height(), picture.color.width());
  for (int c = 0; c < 4; ++c) {
    const Image& from = c < 3 ? picture.color : picture.alpha;
    std::copy_n(from.row(c < 3 ? c : 0, 0), from.plane_stride(), image.row(c, 0));
  }
  return image;
}

bool shows_all(const MeshPicture& picture) {
  for (int y = 0; y < picture.alpha.height(); ++y) {
    const float* const row = picture.alpha.row(0, y);
    if (std::any_of(row, row + picture.alpha.width(), [](float x) { return x < 1; })) return false;
  }
  return true;
}

std::string size_text(const TexturedMesh& mesh) {
  const Vector3<double> size = mesh.high - mesh.low;
  return rounded(size[0], 3) + " x " + rounded(size[1], 3) + " x " + rounded(size[2], 3) + " m";
}

}  // namespace

MeshPhotos prepare_mesh_photos(const std::string& path, const RigSettings& settings, bool is_object,
                               std::uint64_t seed) {
  MeshPhotos photos;
  photos.mesh = std::make_unique<CastMesh>(read_textured_mesh(path));
  const TexturedMesh& mesh = photos.mesh->mesh();
  log_info(path + ": " + std::to_string(mesh.faces.size()) + " faces, " + std::to_string(mesh.textures.size()) +
           " textures, " + size_text(mesh));
  photos.rig = is_object ? rig_around(mesh, settings) : rig_inside(*photos.mesh, settings, seed, path);
  const Index asked = settings.count > 0 ? settings.count : kPicturesOfScene;
  if (!is_object) log_info(path + ": " + rig_text(photos.rig));
  if (!is_object && std::ssize(photos.rig.cameras) < asked)
    log_warning(path + ": only " + std::to_string(photos.rig.cameras.size()) + " of " + std::to_string(asked) +
                " views were found; is it a scene in metres, z up, its faces' fronts inside?");
  photos.light = settings.light;
  photos.has_alpha = is_object;
  return photos;
}

void write_mesh_photos(const MeshPhotos& photos, const std::filesystem::path& folder, const Observer& observer) {
  FolderInMaking out(folder);
  const std::vector<Camera>& cameras = photos.rig.cameras;
  Progress shown("pictures", std::ssize(cameras), observer.progress, observer.progress_interval);
  const Index at_once = 2 * thread_count();
  for (Index first = 0; first < std::ssize(cameras); first += at_once) {
    if (observer.wants_stop()) throw Interrupted("interrupted while pictures were made; nothing is left of them");
    const Index count = std::min(at_once, std::ssize(cameras) - first);
    parallel_for(count, 1, [&](Index begin, Index end) {
      for (Index k = first + begin; k < first + end; ++k) {
        const MeshPicture picture = mesh_picture(*photos.mesh, cameras[static_cast<std::size_t>(k)], photos.light);
        write_photo(out, k, photos.has_alpha || !shows_all(picture) ? with_alpha(picture) : picture.color,
                    picture.depth);
      }
    });
    shown.step(count);
  }
  write_photo_cameras(out, cameras);
  out.commit();
}

}  // namespace hsi4d
