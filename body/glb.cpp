#include "body/glb.h"

#include <array>
#include <cmath>
#include <limits>
#include <sstream>
#include <tiny_gltf.h>

#include "body/surface_index.h"
#include "core/quaternion.h"

namespace hsi4d {

namespace {

constexpr int kFloat = TINYGLTF_COMPONENT_TYPE_FLOAT;

/// A file that is being put together: its one buffer, and accessors into it.
class Parts {
 public:
  tinygltf::Model model;

  Parts() { model.buffers.emplace_back(); }

  /// Numbers as a new accessor.
  /// @param target  what a vertex buffer is for; 0: neither vertices nor indices
  template <class T>
  int add(const std::vector<T>& numbers, int component, int type, int target, bool with_bounds = false) {
    std::vector<unsigned char>& bytes = model.buffers[0].data;
    while (bytes.size() % 4 != 0) bytes.push_back(0);
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = bytes.size();
    view.byteLength = numbers.size() * sizeof(T);
    view.target = target;
    const auto* first = reinterpret_cast<const unsigned char*>(numbers.data());
    bytes.insert(bytes.end(), first, first + view.byteLength);
    model.bufferViews.push_back(view);
    const auto width = static_cast<std::size_t>(tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type)));
    tinygltf::Accessor accessor;
    accessor.bufferView = static_cast<int>(model.bufferViews.size()) - 1;
    accessor.componentType = component;
    accessor.type = type;
    accessor.count = numbers.size() / width;
    if (with_bounds) add_bounds(numbers, width, accessor);
    model.accessors.push_back(accessor);
    return static_cast<int>(model.accessors.size()) - 1;
  }

 private:
  template <class T>
  static void add_bounds(const std::vector<T>& numbers, std::size_t width, tinygltf::Accessor& accessor) {
    for (std::size_t c = 0; c < width; ++c) {
      T low = numbers[c], high = numbers[c];
      for (std::size_t i = c; i < numbers.size(); i += width) {
        low = std::min(low, numbers[i]);
        high = std::max(high, numbers[i]);
      }
      accessor.minValues.push_back(static_cast<double>(low));
      accessor.maxValues.push_back(static_cast<double>(high));
    }
  }
};

/// Unit normals of vertices; up where there are none.
std::vector<float> normals_of(const BodyModel& body) {
  std::vector<float> numbers;
  for (const Vector3<double>& normal : vertex_normals(body)) {
    const Vector3<double> unit = normal.isZero(0) ? Vector3<double>(Vector3<double>::UnitY()) : normal;
    for (int i = 0; i < 3; ++i) numbers.push_back(static_cast<float>(unit[i]));
  }
  return numbers;
}

/// Joints and weights of every vertex, four each: floats that sum to 1 as exactly as floats do, joint 0 where unused.
struct FourWeights {
  std::vector<std::uint8_t> joints;
  std::vector<float> weights;
};

FourWeights four_weights(const SparseWeights& sparse) {
  constexpr std::size_t kWeights = 4;
  FourWeights four;
  const auto count = static_cast<std::size_t>(sparse.per_vertex);
  HSI4D_CHECK(count <= kWeights, std::to_string(count) + " weights a vertex; a file takes 4");
  for (std::size_t v = 0; v < static_cast<std::size_t>(sparse.vertices); ++v) {
    std::array<std::uint8_t, kWeights> joints{};
    std::array<float, kWeights> weights{};
    float rest = 1;
    std::size_t largest = 0;
    for (std::size_t k = 0; k < count; ++k) {
      weights[k] = static_cast<float>(sparse.weights[count * v + k]);
      if (weights[k] > 0) joints[k] = static_cast<std::uint8_t>(sparse.indices[count * v + k]);
      if (weights[k] > weights[largest]) largest = k;
    }
    for (std::size_t k = 0; k < kWeights; ++k) rest -= k == largest ? 0 : weights[k];
    weights[largest] = rest;
    four.joints.insert(four.joints.end(), joints.begin(), joints.end());
    four.weights.insert(four.weights.end(), weights.begin(), weights.end());
  }
  return four;
}

Vector3<double> rest_of(const BodyModel& body, std::size_t joint) {
  const double* x = body.joints.data() + 3 * joint;
  return {x[0], x[1], x[2]};
}

/// Unit quaternions x, y, z, w of a joint over time, each on the side of the one before it.
std::vector<float> local_rotations_of(const Motion& motion, Index joint) {
  std::vector<float> numbers;
  Vector4<double> before(1, 0, 0, 0);
  for (const BodyPose& pose : motion.poses) {
    Vector4<double> q = quaternion_exp(pose.rotation_of(joint));
    if (dot(q, before) < 0) q = -q;
    before = q;
    for (const int i : {1, 2, 3, 0}) numbers.push_back(static_cast<float>(q[i]));
  }
  return numbers;
}

bool is_still(const Motion& motion, Index joint) {
  for (const BodyPose& pose : motion.poses) {
    if (pose.rotation_of(joint) != motion.poses[0].rotation_of(joint)) return false;
  }
  return true;
}

int add_mesh(Parts& parts, const BodyModel& body) {
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.attributes["POSITION"] =
      parts.add(body.vertices, kFloat, TINYGLTF_TYPE_VEC3, TINYGLTF_TARGET_ARRAY_BUFFER, true);
  primitive.attributes["NORMAL"] =
      parts.add(normals_of(body), kFloat, TINYGLTF_TYPE_VEC3, TINYGLTF_TARGET_ARRAY_BUFFER);
  const FourWeights four = four_weights(body.weights);
  primitive.attributes["JOINTS_0"] =
      parts.add(four.joints, TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER);
  primitive.attributes["WEIGHTS_0"] = parts.add(four.weights, kFloat, TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER);
  const std::vector<std::uint32_t> indices(body.faces.begin(), body.faces.end());
  primitive.indices = parts.add(indices, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR,
                                TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  tinygltf::Material material;
  material.name = "body";
  material.pbrMetallicRoughness.baseColorFactor = {0.72, 0.68, 0.64, 1};
  material.pbrMetallicRoughness.metallicFactor = 0;
  material.pbrMetallicRoughness.roughnessFactor = 0.8;
  parts.model.materials.push_back(material);
  primitive.material = 0;
  tinygltf::Mesh mesh;
  mesh.name = "body";
  mesh.primitives.push_back(primitive);
  parts.model.meshes.push_back(mesh);
  return 0;
}

/// Nodes 0 ("world") and 1 + j, in the first frame's pose.
void add_skeleton(Parts& parts, const BodyModel& body, const Motion& motion) {
  tinygltf::Node world;
  world.name = "world";
  world.rotation = {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)};  // x by −90°: z up to y up
  world.children = {1};
  parts.model.nodes.push_back(world);
  const BodyPose& first = motion.poses[0];
  for (std::size_t j = 0; j < body.parents.size(); ++j) {
    tinygltf::Node node;
    node.name = body.joint_names[j];
    const Vector3<double> from =
        j == 0 ? Vector3<double>(-first.transl) : rest_of(body, static_cast<std::size_t>(body.parents[j]));
    const Vector3<double> place = rest_of(body, j) - from;
    node.translation = {place[0], place[1], place[2]};
    const Vector4<double> q = quaternion_exp(first.rotation_of(static_cast<Index>(j)));
    node.rotation = {q[1], q[2], q[3], q[0]};
    parts.model.nodes.push_back(node);
    if (j > 0)
      parts.model.nodes[static_cast<std::size_t>(1 + body.parents[j])].children.push_back(1 + static_cast<int>(j));
  }
}

int add_skin(Parts& parts, const BodyModel& body) {
  tinygltf::Skin skin;
  skin.name = "body";
  skin.skeleton = 0;
  std::vector<float> inverses;
  for (std::size_t j = 0; j < body.parents.size(); ++j) {
    skin.joints.push_back(1 + static_cast<int>(j));
    const Vector3<double> r = rest_of(body, j);
    inverses.insert(inverses.end(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});  // by columns
    for (int i = 0; i < 3; ++i) inverses.push_back(static_cast<float>(-r[i]));
    inverses.push_back(1);
  }
  skin.inverseBindMatrices = parts.add(inverses, kFloat, TINYGLTF_TYPE_MAT4, 0);
  parts.model.skins.push_back(skin);
  return 0;
}

void add_animation(Parts& parts, const BodyModel& body, const Motion& motion) {
  tinygltf::Animation animation;
  animation.name = "motion";
  std::vector<float> times, places;
  for (std::size_t t = 0; t < motion.poses.size(); ++t) {
    times.push_back(static_cast<float>(static_cast<double>(t) / motion.frame_rate));
    const Vector3<double> place = rest_of(body, 0) + motion.poses[t].transl;
    for (int i = 0; i < 3; ++i) places.push_back(static_cast<float>(place[i]));
  }
  const int input = parts.add(times, kFloat, TINYGLTF_TYPE_SCALAR, 0, true);
  const auto add_channel = [&](std::size_t joint, const char* path, int output) {
    tinygltf::AnimationSampler sampler;
    sampler.input = input;
    sampler.output = output;
    animation.samplers.push_back(sampler);
    tinygltf::AnimationChannel channel;
    channel.sampler = static_cast<int>(animation.samplers.size()) - 1;
    channel.target_node = 1 + static_cast<int>(joint);
    channel.target_path = path;
    animation.channels.push_back(channel);
  };
  add_channel(0, "translation", parts.add(places, kFloat, TINYGLTF_TYPE_VEC3, 0));
  for (std::size_t j = 0; j < body.parents.size(); ++j) {
    const auto joint = static_cast<Index>(j);
    if (is_still(motion, joint)) continue;
    add_channel(j, "rotation", parts.add(local_rotations_of(motion, joint), kFloat, TINYGLTF_TYPE_VEC4, 0));
  }
  parts.model.animations.push_back(animation);
}

}  // namespace

Bytes encode_glb(const BodyModel& body, const Motion& motion) {
  HSI4D_CHECK(!motion.poses.empty(), "a motion without frames");
  HSI4D_CHECK(body.face_count() > 0, "a body without faces");
  HSI4D_CHECK(motion.frame_rate > 0 && std::isfinite(motion.frame_rate), std::to_string(motion.frame_rate) + " Hz");
  HSI4D_CHECK(body.joint_count() <= 1 + std::numeric_limits<std::uint8_t>::max(),
              std::to_string(body.joint_count()) + " joints; a file takes 256");
  for (const BodyPose& pose : motion.poses) HSI4D_CHECK_EQ(pose.joints(), body.joint_count());
  Parts parts;
  parts.model.asset.version = "2.0";
  parts.model.asset.generator = "hsi4d";
  tinygltf::Node mesh;
  mesh.name = "body";
  mesh.mesh = add_mesh(parts, body);
  add_skeleton(parts, body, motion);
  mesh.skin = add_skin(parts, body);
  add_animation(parts, body, motion);
  parts.model.nodes.push_back(mesh);
  tinygltf::Scene scene;
  scene.nodes = {0, static_cast<int>(parts.model.nodes.size()) - 1};
  parts.model.scenes.push_back(scene);
  parts.model.defaultScene = 0;
  std::ostringstream stream;
  tinygltf::TinyGLTF writer;
  const bool is_written = writer.WriteGltfSceneToStream(&parts.model, stream, false, true);
  HSI4D_CHECK(is_written, "tinygltf does not write the file");
  const std::string text = stream.str();
  return {text.begin(), text.end()};
}

void write_glb(const std::string& path, const BodyModel& body, const Motion& motion) {
  write_file(path, encode_glb(body, motion));
}

}  // namespace hsi4d
