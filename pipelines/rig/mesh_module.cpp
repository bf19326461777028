// libhsi4d_meshes.so: the only file that includes Assimp and Embree. It links nothing of this project.
#include <assimp/DefaultLogger.hpp>
#include <assimp/GltfMaterial.h>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/mesh.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <bit>
#include <cstring>
#include <embree3/rtcore.h>
#include <map>

#include "pipelines/rig/mesh_library.h"

namespace hsi4d {

struct RayScene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  Index opaque = 0;
  RayFilter filter = nullptr;
  const void* context = nullptr;
};

namespace {

// --- reading ---------------------------------------------------------------------------------------------------------

constexpr int kDeepestNode = 64;
constexpr std::size_t kMostNotes = 20;

/// Keeps what Assimp complains of.
class NoteStream : public Assimp::LogStream {
 public:
  explicit NoteStream(std::vector<std::string>& notes) : notes_(notes) {}
  void write(const char* message) override {
    std::string text = message;
    while (text.ends_with('\n')) text.pop_back();
    if (notes_.size() < kMostNotes) notes_.push_back(std::move(text));
  }

 private:
  std::vector<std::string>& notes_;
};

/// Listens while it lives.
class Listening {
 public:
  explicit Listening(std::vector<std::string>& notes) {
    Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
    Assimp::DefaultLogger::get()->attachStream(new NoteStream(notes), Assimp::Logger::Warn | Assimp::Logger::Err);
  }
  ~Listening() { Assimp::DefaultLogger::kill(); }
};

TextureWrap wrap_of(const aiMaterial& material, aiTextureType type, const char* key) {
  int mode = aiTextureMapMode_Wrap;
  material.Get(key, type, 0, mode);
  if (mode == aiTextureMapMode_Mirror) return TextureWrap::kMirror;
  return mode == aiTextureMapMode_Wrap ? TextureWrap::kRepeat : TextureWrap::kClamp;
}

class SceneReader {
 public:
  SceneReader(const aiScene& scene, bool is_glb, LoadedMesh& mesh) : scene_(scene), is_glb_(is_glb), mesh_(mesh) {}

  void read() {
    for (unsigned i = 0; i < scene_.mNumMaterials; ++i) add_material(*scene_.mMaterials[i]);
    if (mesh_.materials.empty()) mesh_.materials.emplace_back();
    add_node(*scene_.mRootNode, aiMatrix4x4(), 0);
  }

 private:
  /// The number of a material's picture; -1: it has none.
  int texture_of(const aiMaterial& material, aiTextureType type) {
    aiString path;
    if (material.GetTexture(type, 0, &path) != AI_SUCCESS) return -1;
    const std::string name = path.C_Str();
    const auto [at, is_new] = numbers_.emplace(name, static_cast<int>(mesh_.textures.size()));
    if (is_new) mesh_.textures.push_back(picture_named(name));
    return at->second;
  }

  MeshTexture picture_named(const std::string& name) const {
    MeshTexture texture{name, {}, false};
    const aiTexture* const inside = scene_.GetEmbeddedTexture(name.c_str());
    if (inside == nullptr) return texture;
    texture.is_inside = true;
    texture.file = "texture " + name;
    if (inside->mHeight != 0) return texture;  // bare texels, which these formats do not hold
    const auto* const bytes = reinterpret_cast<const std::uint8_t*>(inside->pcData);
    texture.bytes.assign(bytes, bytes + inside->mWidth);
    return texture;
  }

  void add_material(const aiMaterial& from) {
    MeshMaterial material;
    aiTextureType type = aiTextureType_BASE_COLOR;
    material.texture = texture_of(from, type);
    if (material.texture < 0) material.texture = texture_of(from, type = aiTextureType_DIFFUSE);
    material.opacity_texture = texture_of(from, aiTextureType_OPACITY);
    material.wrap_u = wrap_of(from, type, _AI_MATKEY_MAPPINGMODE_U_BASE);
    material.wrap_v = wrap_of(from, type, _AI_MATKEY_MAPPINGMODE_V_BASE);
    int uv = 0;
    from.Get(_AI_MATKEY_UVWSRC_BASE, type, 0, uv);
    uv_sets_.push_back(uv >= 0 && uv < AI_MAX_NUMBER_OF_TEXTURECOORDS ? uv : 0);
    aiColor4D color(1, 1, 1, 1);
    if (from.Get(AI_MATKEY_BASE_COLOR, color) != AI_SUCCESS) from.Get(AI_MATKEY_COLOR_DIFFUSE, color);
    if (from.GetName() == aiString(AI_DEFAULT_MATERIAL_NAME)) color = aiColor4D(1, 1, 1, 1);  // Assimp's own, a grey
    float opacity = 1;
    if (!is_glb_ && from.Get(AI_MATKEY_OPACITY, opacity) == AI_SUCCESS) color.a = opacity;
    material.color = {color.r, color.g, color.b, color.a};
    set_alpha(from, material);
    mesh_.materials.push_back(material);
  }

  void set_alpha(const aiMaterial& from, MeshMaterial& material) const {
    aiString mode;
    if (is_glb_) {
      if (from.Get(AI_MATKEY_GLTF_ALPHAMODE, mode) != AI_SUCCESS) return;
      if (std::strcmp(mode.C_Str(), "MASK") == 0) material.alpha = MeshAlpha::kMask;
      if (std::strcmp(mode.C_Str(), "BLEND") == 0) material.alpha = MeshAlpha::kBlend;
      from.Get(AI_MATKEY_GLTF_ALPHACUTOFF, material.cutoff);
      return;
    }
    if (material.opacity_texture >= 0 || material.color[3] < 1) material.alpha = MeshAlpha::kBlend;
  }

  void add_node(const aiNode& node, const aiMatrix4x4& parent, int depth) {
    if (depth > kDeepestNode) return;
    const aiMatrix4x4 world = parent * node.mTransformation;
    for (unsigned i = 0; i < node.mNumMeshes; ++i) add_part(*scene_.mMeshes[node.mMeshes[i]], world);
    for (unsigned i = 0; i < node.mNumChildren; ++i) add_node(*node.mChildren[i], world, depth + 1);
  }

  void add_part(const aiMesh& part, const aiMatrix4x4& world) {
    const auto first = static_cast<std::int32_t>(mesh_.places.size());
    const std::size_t material = part.mMaterialIndex < uv_sets_.size() ? part.mMaterialIndex : 0;
    const int uv_set = uv_sets_.empty() ? 0 : uv_sets_[material];
    const aiVector3D* const uvs = part.mTextureCoords[uv_set] ? part.mTextureCoords[uv_set] : part.mTextureCoords[0];
    const aiMatrix3x3 turn(world);
    aiMatrix3x3 normal_turn = turn;
    normal_turn.Inverse().Transpose();
    for (unsigned v = 0; v < part.mNumVertices; ++v) {
      const aiVector3D place = world * part.mVertices[v];
      mesh_.places.push_back({place.x, place.y, place.z});
      aiVector3D normal = part.mNormals != nullptr ? normal_turn * part.mNormals[v] : aiVector3D();
      normal.NormalizeSafe();
      mesh_.normals.push_back({normal.x, normal.y, normal.z});
      const aiVector3D uv = uvs != nullptr ? uvs[v] : aiVector3D();
      mesh_.uvs.push_back({uv.x, uv.y});
      const aiColor4D color = part.mColors[0] != nullptr ? part.mColors[0][v] : aiColor4D(1, 1, 1, 1);
      mesh_.colors.push_back({color.r, color.g, color.b, color.a});
    }
    const bool is_mirrored = turn.Determinant() < 0;
    for (unsigned f = 0; f < part.mNumFaces; ++f) add_face(part.mFaces[f], first, is_mirrored, material);
  }

  void add_face(const aiFace& from, std::int32_t first, bool is_mirrored, std::size_t material) {
    if (from.mNumIndices != 3) return;
    std::array<std::int32_t, 3> face{};
    for (std::size_t k = 0; k < 3; ++k) {
      face[k] = first + static_cast<std::int32_t>(from.mIndices[k]);
      if (face[k] < first || static_cast<std::size_t>(face[k]) >= mesh_.places.size()) return;
    }
    if (is_mirrored) std::swap(face[1], face[2]);
    mesh_.faces.push_back(face);
    mesh_.materials_of_faces.push_back(static_cast<std::int32_t>(material));
  }

  const aiScene& scene_;
  bool is_glb_;
  LoadedMesh& mesh_;
  std::map<std::string, int> numbers_;
  std::vector<int> uv_sets_;
};

std::string read_mesh_file(const std::string& path, LoadedMesh& mesh) try {
  const Listening listening(mesh.notes);
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* const scene =
      importer.ReadFile(path, aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_TransformUVCoords |
                                  aiProcess_ValidateDataStructure);
  if (scene == nullptr || scene->mRootNode == nullptr) return importer.GetErrorString();
  SceneReader(*scene, path.ends_with(".glb") || path.ends_with(".GLB"), mesh).read();
  return "";
} catch (const std::exception& error) {
  return error.what();
}

// --- rays ------------------------------------------------------------------------------------------------------------

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

constexpr MeshLibrary kLibrary = {read_mesh_file, make_scene, free_scene, cast};

}  // namespace
}  // namespace hsi4d

extern "C" __attribute__((visibility("default"))) const hsi4d::MeshLibrary* hsi4d_mesh_library() {
  return &hsi4d::kLibrary;
}
