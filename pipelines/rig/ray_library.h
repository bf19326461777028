// What this project takes from Embree, as a library of its own that is loaded when the first pictures of a mesh are
// made: where rays meet triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "core/types.h"

namespace hsi4d {

/// A half-line. `threshold` is for the filter.
struct MeshRay {
  std::array<float, 3> origin, direction;
  float threshold = 0.5F;
};

/// Whether a ray stops at a point of a face: (1 − u − v) a + u b + v c. Called by several threads at once.
using RayFilter = bool (*)(const void* context, std::int32_t face, float u, float v, float threshold);

/// Triangles that rays are cast at. `opaque` faces come first; the filter is asked of the others.
struct RayTarget {
  std::span<const std::array<float, 3>> places;
  std::span<const std::array<std::int32_t, 3>> faces;
  Index opaque = 0;
  RayFilter filter = nullptr;
  const void* context = nullptr;
};

struct RayScene;

/// The library's functions.
struct RayLibrary {
  /// Prepares triangles for rays; null, and the reason in `error`, where that fails. The same for any number of
  /// threads.
  RayScene* (*make_scene)(const RayTarget& target, std::string& error);
  void (*free_scene)(RayScene* scene);
  /// The first face that each ray meets, -1: none. For several threads at once.
  void (*cast)(const RayScene& scene, std::span<const MeshRay> rays, std::span<std::int32_t> faces);
};

/// The library; the first call loads it. Throws InternalError telling where it was sought.
const RayLibrary& ray_library();

}  // namespace hsi4d
