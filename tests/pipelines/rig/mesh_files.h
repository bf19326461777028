// Meshes for tests of pictures: as data, and as files of all kinds.
#pragma once

#include <array>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "core/file.h"
#include "core/image_io.h"
#include "core/text.h"
#include "pipelines/rig/textured_mesh.h"

namespace hsi4d::test {

/// Red, green above; blue, yellow below: 8 × 8 texels each.
inline Image quarters() {
  Image image(3, 16, 16);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      const bool right = x >= 8, below = y >= 8;
      image(0, y, x) = right == below ? 1 : 0;
      image(1, y, x) = right ? 1 : 0;
      image(2, y, x) = below && !right ? 1 : 0;
      if (below && !right) image(0, y, x) = 0;
    }
  }
  return image;
}

/// A mesh of quads, z up; each corner has its place in the texture.
struct QuadMesh {
  std::vector<std::array<float, 3>> places;
  std::vector<std::array<float, 2>> uvs;  ///< v up

  /// @param across, up  edges; their cross product is the front
  void add(const Vector3<double>& corner, const Vector3<double>& across, const Vector3<double>& up) {
    for (const auto& [u, v] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
      const Vector3<float> place = (corner + u * across + v * up).cast<float>();
      places.push_back({place[0], place[1], place[2]});
      uvs.push_back({static_cast<float>(u), static_cast<float>(v)});
    }
  }

  /// A box, its fronts outside, or inside.
  void add_box(const Vector3<double>& low, const Vector3<double>& high, bool is_inside_out = false) {
    const Vector3<double> size = high - low, x(size[0], 0, 0), y(0, size[1], 0), z(0, 0, size[2]);
    const auto side = [&](const Vector3<double>& corner, const Vector3<double>& a, const Vector3<double>& b) {
      is_inside_out ? add(corner, b, a) : add(corner, a, b);
    };
    side(low, x, z);
    side(low + x, y, z);
    side(low + x + y, -x, z);
    side(low + y, -y, z);
    side(low + z, x, y);
    side(low + y, x, -y);
  }

  std::vector<std::array<std::int32_t, 3>> faces() const {
    std::vector<std::array<std::int32_t, 3>> all;
    for (std::int32_t first = 0; first < std::ssize(places); first += 4) {
      all.push_back({first, first + 1, first + 2});
      all.push_back({first, first + 2, first + 3});
    }
    return all;
  }
};

/// As an OBJ's reader gives it. @param texture  [C,H,W]; empty: none
inline LoadedMesh loaded(const QuadMesh& quads, const Image& texture) {
  LoadedMesh mesh;
  mesh.materials.emplace_back();
  for (std::size_t v = 0; v < quads.places.size(); ++v) {
    add_vertex(mesh, Vector3<float>(quads.places[v].data()).cast<double>());
    mesh.uvs.back() = quads.uvs[v];
  }
  for (const auto& face : quads.faces()) add_face(mesh, face, 0);
  if (texture.empty()) return mesh;
  mesh.materials[0].texture = 0;
  mesh.textures.push_back({"texture", encode_image("texture.png", texture), true});
  return mesh;
}

inline std::string numbers(std::initializer_list<float> values) {
  std::string text;
  for (const float x : values) text += " " + number_text(x);
  return text;
}

/// NAME.obj, NAME.mtl; the texture is texture.png beside them, which is not written.
inline std::string write_obj(const std::filesystem::path& folder, const QuadMesh& quads) {
  std::string text = "mtllib mesh.mtl\nusemtl painted\n";
  for (const auto& p : quads.places) text += "v" + numbers({p[0], p[1], p[2]}) + "\n";
  for (const auto& t : quads.uvs) text += "vt" + numbers({t[0], t[1]}) + "\n";
  for (const auto& f : quads.faces()) {
    text += "f";
    for (const std::int32_t corner : f) text += " " + std::to_string(corner + 1) + "/" + std::to_string(corner + 1);
    text += "\n";
  }
  write_text_file((folder / "mesh.mtl").string(), "newmtl painted\nKd 0.8 0.8 0.8\nmap_Kd texture.png\n");
  write_text_file((folder / "mesh.obj").string(), text);
  return (folder / "mesh.obj").string();
}

inline std::string write_ply(const std::filesystem::path& folder, const QuadMesh& quads) {
  std::string text = "ply\nformat ascii 1.0\ncomment TextureFile texture.png\nelement vertex " +
                     std::to_string(quads.places.size()) +
                     "\nproperty float x\nproperty float y\nproperty float z\nproperty float s\nproperty float t\n"
                     "element face " +
                     std::to_string(quads.faces().size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  for (std::size_t v = 0; v < quads.places.size(); ++v) {
    const auto& p = quads.places[v];
    text += numbers({p[0], p[1], p[2], quads.uvs[v][0], quads.uvs[v][1]}) + "\n";
  }
  for (const auto& f : quads.faces())
    text += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
  write_text_file((folder / "mesh.ply").string(), text);
  return (folder / "mesh.ply").string();
}

/// A .glb, which is y up, with its texture inside.
/// @param material  the texture's neighbours in glTF: "\"alphaMode\": \"MASK\", " or ""
inline std::string glb_bytes(const QuadMesh& quads, const Image& texture, const std::string& material = "") {
  const auto bytes = [](const auto& values) {
    return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
  };
  std::vector<float> places, uvs;
  for (const auto& p : quads.places) places.insert(places.end(), {p[0], p[2], -p[1]});
  for (const auto& t : quads.uvs) uvs.insert(uvs.end(), {t[0], 1 - t[1]});
  std::array<float, 3> low, high;
  low.fill(1e9F);
  high.fill(-1e9F);
  for (std::size_t i = 0; i < places.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], places[i]);
    high[i % 3] = std::max(high[i % 3], places[i]);
  }
  const std::string blocks[] = {bytes(places), bytes(uvs), bytes(quads.faces()),
                                bytes(encode_image("texture.png", texture))};
  std::string views, data;
  for (const std::string& block : blocks) {
    views += std::string(views.empty() ? "" : ", ") + "{\"buffer\": 0, \"byteOffset\": " + std::to_string(data.size()) +
             ", \"byteLength\": " + std::to_string(block.size()) + "}";
    data += block + std::string((4 - block.size() % 4) % 4, '\0');
  }
  const auto list = [](const std::array<float, 3>& x) {
    return "[" + number_text(x[0]) + ", " + number_text(x[1]) + ", " + number_text(x[2]) + "]";
  };
  const std::string count = std::to_string(quads.places.size());
  std::string json =
      "{\"asset\": {\"version\": \"2.0\"}, \"scene\": 0, \"scenes\": [{\"nodes\": [0]}], \"nodes\": [{\"mesh\": 0}], "
      "\"meshes\": [{\"primitives\": [{\"attributes\": {\"POSITION\": 0, \"TEXCOORD_0\": 1}, \"indices\": 2, "
      "\"material\": 0}]}], \"materials\": [{" +
      material +
      "\"pbrMetallicRoughness\": {\"baseColorTexture\": {\"index\": 0}}}], \"textures\": [{\"source\": 0}], "
      "\"images\": [{\"bufferView\": 3, \"mimeType\": \"image/png\"}], \"accessors\": ["
      "{\"bufferView\": 0, \"componentType\": 5126, \"count\": " +
      count + ", \"type\": \"VEC3\", \"min\": " + list(low) + ", \"max\": " + list(high) +
      "}, {\"bufferView\": 1, \"componentType\": 5126, \"count\": " + count +
      ", \"type\": \"VEC2\"}, {\"bufferView\": 2, \"componentType\": 5125, \"count\": " +
      std::to_string(3 * quads.faces().size()) + ", \"type\": \"SCALAR\"}], \"bufferViews\": [" + views +
      "], \"buffers\": [{\"byteLength\": " + std::to_string(data.size()) + "}]}";
  json += std::string((4 - json.size() % 4) % 4, ' ');
  const auto word = [](std::size_t x) {
    const auto number = static_cast<std::uint32_t>(x);
    return std::string(reinterpret_cast<const char*>(&number), 4);
  };
  return word(0x46546C67) + word(2) + word(28 + json.size() + data.size()) + word(json.size()) + word(0x4E4F534A) +
         json + word(data.size()) + word(0x004E4942) + data;
}

inline std::string write_glb(const std::filesystem::path& folder, const QuadMesh& quads, const Image& texture,
                             const std::string& material = "") {
  write_text_file((folder / "mesh.glb").string(), glb_bytes(quads, texture, material));
  return (folder / "mesh.glb").string();
}

}  // namespace hsi4d::test
