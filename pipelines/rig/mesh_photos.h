// Pictures of a mesh with their cameras and depths: a set for `hsi4d reconstruct`, as `hsi4d synth` writes them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "core/observer.h"
#include "pipelines/rig/camera_rig.h"

namespace hsi4d {

/// What is photographed, and from where.
struct MeshPhotos {
  std::unique_ptr<CastMesh> mesh;
  Rig rig;
  MeshLight light;
  bool has_alpha = false;  ///< pictures have alpha; else only those that show nothing somewhere
};

/// Reads a mesh and finds cameras: around an object, or inside a scene. The log tells sizes, and what is left out.
/// Throws as read_textured_mesh, CastMesh and rig_inside.
MeshPhotos prepare_mesh_photos(const std::string& path, const RigSettings& settings, bool is_object,
                               std::uint64_t seed);

/// Writes transforms.json, images/ and depths/ (pipelines/photos/photo_set.h). The same bytes for any number of
/// threads.
///
/// @param folder  new or empty; it appears when everything in it is complete
/// Throws Interrupted; UserError as write_image.
void write_mesh_photos(const MeshPhotos& photos, const std::filesystem::path& folder, const Observer& observer = {});

}  // namespace hsi4d
