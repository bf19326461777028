// libhsi4d_rays.so: the only file that includes Embree. It links nothing of this project.
#include <bit>
#include <cstring>
#include <embree3/rtcore.h>
#include <limits>
#include <string>

#include "pipelines/rig/ray_library.h"

namespace hsi4d {

struct RayScene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Index opaque = 0;
  RayFilter filter = nullptr;
  const void* context = nullptr;
};

namespace {

constexpr unsigned kPacket = 16;

void filter_hits(const RTCFilterFunctionNArguments* args) {
  const auto& scene = *static_cast<const RayScene*>(args->geometryUserPtr);
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    const auto face = static_cast<std::int32_t>(RTCHitN_primID(args->hit, args->N, i));
    const auto threshold = std::bit_cast<float>(RTCRayN_id(args->ray, args->N, i));
    const float u = RTCHitN_u(args->hit, args->N, i), v = RTCHitN_v(args->hit, args->N, i);
    if (!scene.filter(scene.context, face + static_cast<std::int32_t>(scene.opaque), u, v, threshold))
      args->valid[i] = 0;
  }
}

/// Adds faces [first, end) as geometry `id`.
void add_geometry(RayScene& made, const RayTarget& target, Index first, Index end, unsigned id) {
  if (first == end) return;
  RTCGeometry geometry = rtcNewGeometry(made.device, RTC_GEOMETRY_TYPE_TRIANGLE);
  void* const places =
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, target.places.size());
  void* const faces = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12,
                                              static_cast<std::size_t>(end - first));
  if (places != nullptr && faces != nullptr) {
    std::memcpy(places, target.places.data(), target.places.size_bytes());
    std::memcpy(faces, target.faces.data() + first, 12 * static_cast<std::size_t>(end - first));
    if (first >= target.opaque) {
      rtcSetGeometryUserData(geometry, &made);
      rtcSetGeometryIntersectFilterFunction(geometry, filter_hits);
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(made.scene, geometry, id);
  }
  rtcReleaseGeometry(geometry);
}

void free_scene(RayScene* made) {
  if (made == nullptr) return;
  if (made->scene != nullptr) rtcReleaseScene(made->scene);
  if (made->device != nullptr) rtcReleaseDevice(made->device);
  delete made;
}

RayScene* make_scene(const RayTarget& target, std::string& error) {
  auto* const made = new RayScene;
  made->opaque = target.opaque;
  made->filter = target.filter;
  made->context = target.context;
  // On one thread: several could sort triangles in another order, and of two at one place the first met is drawn.
  made->device = rtcNewDevice("threads=1,set_affinity=0");
  if (made->device != nullptr) {
    made->scene = rtcNewScene(made->device);
    rtcSetSceneFlags(made->scene, RTC_SCENE_FLAG_ROBUST);
    const auto count = static_cast<Index>(target.faces.size());
    add_geometry(*made, target, 0, target.opaque, 0);
    add_geometry(*made, target, target.opaque, count, 1);
    rtcCommitScene(made->scene);
  }
  const RTCError code = rtcGetDeviceError(made->device);
  if (made->device != nullptr && code == RTC_ERROR_NONE) return made;
  error = code == RTC_ERROR_OUT_OF_MEMORY ? "memory is short" : "Embree's error " + std::to_string(code);
  free_scene(made);
  return nullptr;
}

void cast(const RayScene& made, std::span<const MeshRay> rays, std::span<std::int32_t> faces) {
  alignas(64) RTCRayHit16 packet;
  alignas(64) int valid[kPacket];
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    const std::size_t count = std::min<std::size_t>(kPacket, rays.size() - first);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const MeshRay& ray = rays[first + std::min(i, count - 1)];
      valid[i] = i < count ? -1 : 0;
      packet.ray.org_x[i] = ray.origin[0];
      packet.ray.org_y[i] = ray.origin[1];
      packet.ray.org_z[i] = ray.origin[2];
      packet.ray.dir_x[i] = ray.direction[0];
      packet.ray.dir_y[i] = ray.direction[1];
      packet.ray.dir_z[i] = ray.direction[2];
      packet.ray.tnear[i] = 0;
      packet.ray.tfar[i] = std::numeric_limits<float>::infinity();
      packet.ray.time[i] = 0;
      packet.ray.mask[i] = ~0U;
      packet.ray.id[i] = std::bit_cast<unsigned>(ray.threshold);
      packet.ray.flags[i] = 0;
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(valid, made.scene, &context, &packet);
    for (std::size_t i = 0; i < count; ++i) {
      const unsigned geometry = packet.hit.geomID[i];
      const auto face = static_cast<std::int32_t>(packet.hit.primID[i]);
      faces[first + i] = geometry == RTC_INVALID_GEOMETRY_ID ? -1
                         : geometry == 0                     ? face
                                                             : face + static_cast<std::int32_t>(made.opaque);
    }
  }
}

constexpr RayLibrary kLibrary = {make_scene, free_scene, cast};

}  // namespace
}  // namespace hsi4d

extern "C" __attribute__((visibility("default"))) const hsi4d::RayLibrary* hsi4d_ray_library() {
  return &hsi4d::kLibrary;
}
