#include "body/glb.h"

#include <cmath>
#include <cstdlib>
#include <cstring>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "body/procedural_body.h"
#include "core/random.h"
#include "core/rotation.h"
#include "tests/support/measures.h"
#include "tests/support/temporary_folder.h"

namespace glb_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Json = nlohmann::json;

namespace {

Motion random_motion(std::size_t frames, std::uint64_t seed) {
  RandomSequence random(seed);
  Motion motion{10, {}};
  for (std::size_t t = 0; t < frames; ++t) {
    BodyPose pose = rest_pose(55);
    for (std::size_t i = 0; i < 75; ++i) pose.axis_angle[i] = 0.5 * random.normal();  // hands are still
    pose.transl = {random.normal(), random.normal(), 1 + random.normal()};
    motion.poses.push_back(pose);
  }
  return motion;
}

std::uint32_t word_at(const Bytes& file, std::size_t at) {
  std::uint32_t word = 0;
  std::memcpy(&word, file.data() + at, 4);
  return word;
}

/// A GLB file taken apart by its specification.
struct Glb {
  Json json;
  Bytes binary;

  explicit Glb(const Bytes& file) {
    REQUIRE(file.size() > 28);
    REQUIRE(word_at(file, 0) == 0x46546C67);
    REQUIRE(word_at(file, 4) == 2);
    REQUIRE(word_at(file, 8) == file.size());
    const std::size_t length = word_at(file, 12);
    REQUIRE(word_at(file, 16) == 0x4E4F534A);
    json = Json::parse(file.begin() + 20, file.begin() + 20 + static_cast<std::ptrdiff_t>(length));
    REQUIRE(word_at(file, 24 + length) == 0x004E4942);
    binary.assign(file.begin() + 28 + static_cast<std::ptrdiff_t>(length), file.end());
    REQUIRE(word_at(file, 20 + length) == binary.size());
  }

  template <class T>
  std::vector<T> numbers(int accessor) const {
    const Json& a = json["accessors"][static_cast<std::size_t>(accessor)];
    const Json& view = json["bufferViews"][a["bufferView"].get<std::size_t>()];
    const std::map<std::string, std::size_t> widths = {{"SCALAR", 1}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
    std::vector<T> result(a["count"].get<std::size_t>() * widths.at(a["type"]));
    REQUIRE(view["byteLength"] == result.size() * sizeof(T));
    std::memcpy(result.data(), binary.data() + view.value("byteOffset", std::size_t{0}), result.size() * sizeof(T));
    return result;
  }
};

struct Place {
  Matrix3<double> turn = Matrix3<double>::Identity();
  Vector3<double> at = Vector3<double>::Zero();
};

Matrix3<double> matrix_of(double x, double y, double z, double w) {
  return quaternion_to_matrix(Vector4<double>(w, x, y, z));
}

/// Places of all nodes at frame t of the animation.
std::vector<Place> places_at(const Glb& glb, std::size_t frame) {
  const Json& nodes = glb.json["nodes"];
  std::vector<Place> local(nodes.size());
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    const auto q = nodes[n].value("rotation", std::vector<double>{0, 0, 0, 1});
    const auto p = nodes[n].value("translation", std::vector<double>{0, 0, 0});
    local[n] = {matrix_of(q[0], q[1], q[2], q[3]), {p[0], p[1], p[2]}};
  }
  const Json& animation = glb.json["animations"][0];
  for (const Json& channel : animation["channels"]) {
    const Json& sampler = animation["samplers"][channel["sampler"].get<std::size_t>()];
    const auto x = glb.numbers<float>(sampler["output"]);
    const auto node = channel["target"]["node"].get<std::size_t>();
    if (channel["target"]["path"] == "translation") {
      local[node].at = Vector3<float>(x.data() + 3 * frame).cast<double>();
    } else {
      const Vector4<double> q = Vector4<float>(x.data() + 4 * frame).cast<double>();
      CHECK(q.norm() == Approx(1).epsilon(1e-6));
      local[node].turn = matrix_of(q[0], q[1], q[2], q[3]);
    }
  }
  std::vector<Place> world = local;
  for (std::size_t n = 0; n < nodes.size(); ++n) {  // parents come first
    for (const Json& c : nodes[n].value("children", Json::array())) {
      const auto child = c.get<std::size_t>();
      REQUIRE(child > n);
      world[child] = {world[n].turn * local[child].turn, world[n].at + world[n].turn * local[child].at};
    }
  }
  return world;
}

}  // namespace

TEST_CASE("a GLB file, skinned as its specification says, is the body in motion, y up") {
  const BodyModel body = procedural_body();
  const Motion motion = random_motion(4, 80);
  const Glb glb(encode_glb(body, motion));
  const Json& primitive = glb.json["meshes"][0]["primitives"][0];
  const auto positions = glb.numbers<float>(primitive["attributes"]["POSITION"]);
  const auto normals = glb.numbers<float>(primitive["attributes"]["NORMAL"]);
  const auto joints = glb.numbers<std::uint8_t>(primitive["attributes"]["JOINTS_0"]);
  const auto weights = glb.numbers<float>(primitive["attributes"]["WEIGHTS_0"]);
  const auto indices = glb.numbers<std::uint32_t>(primitive["indices"]);
  CHECK(positions == body.vertices);
  CHECK(std::equal(indices.begin(), indices.end(), body.faces.begin(), body.faces.end()));
  const Json& skin = glb.json["skins"][0];
  const auto inverses = glb.numbers<float>(skin["inverseBindMatrices"]);
  REQUIRE(skin["joints"].size() == 55);
  for (std::size_t j = 0; j < 55; ++j) {
    CHECK(glb.json["nodes"][skin["joints"][j].get<std::size_t>()]["name"] == body.joint_names[j]);
  }
  const auto times = glb.numbers<float>(glb.json["animations"][0]["samplers"][0]["input"]);
  REQUIRE(times.size() == 4);
  CHECK(times[3] == Approx(0.3));
  CHECK(glb.json["animations"][0]["channels"].size() == 1 + 25);  // the pelvis's place, joints that turn
  for (std::size_t t = 0; t < 4; ++t) {
    const std::vector<Place> places = places_at(glb, t);
    const std::vector<double> expected = pose_vertices(body, motion.poses[t]);
    double largest = 0;
    for (std::size_t v = 0; v < expected.size() / 3; ++v) {
      Vector3<double> x = Vector3<double>::Zero();
      float sum = 0;
      for (std::size_t k = 4 * v; k < 4 * v + 4; ++k) {
        sum += weights[k];
        if (weights[k] == 0) {
          REQUIRE(joints[k] == 0);
          continue;
        }
        const Place& place = places[skin["joints"][joints[k]].get<std::size_t>()];
        const float* inverse = inverses.data() + 16 * joints[k];
        const Vector3<double> rest =
            (Vector3<float>(positions.data() + 3 * v) + Vector3<float>(inverse + 12)).cast<double>();
        x += static_cast<double>(weights[k]) * (place.at + place.turn * rest);
      }
      REQUIRE(sum == Approx(1).margin(1e-7));
      const Vector3<double> y_up(expected[3 * v], expected[3 * v + 2], -expected[3 * v + 1]);
      largest = larger(largest, (x - y_up).norm());
      CHECK(Vector3<float>(normals.data() + 3 * v).norm() == Approx(1).margin(1e-6));
    }
    CHECK(largest < 1e-5);
  }
  CHECK_THROWS_AS(encode_glb(body, Motion{10, {}}), InternalError);
  CHECK_THROWS_AS(encode_glb(body, Motion{10, {rest_pose(22)}}), InternalError);
}

TEST_CASE("quaternions of a GLB file go the shorter way from frame to frame") {
  Motion motion{10, {}};
  for (int t = 0; t < 20; ++t) {
    BodyPose pose = rest_pose(55);
    const double angle = 0.5 * t;  // more than a turn; as files have it, wrapped to half a turn
    pose.set_rotation(0, {0, 0, std::remainder(angle, 6.283185307179586)});
    motion.poses.push_back(pose);
  }
  const Glb glb(encode_glb(procedural_body(), motion));
  const auto q = glb.numbers<float>(glb.json["animations"][0]["samplers"][1]["output"]);
  for (std::size_t t = 1; t < 20; ++t) {
    CHECK(Vector4<float>(q.data() + 4 * t).dot(Vector4<float>(q.data() + 4 * (t - 1))) > 0.9F);
  }
}

TEST_CASE("the Khronos validator finds nothing in a GLB file") {
  const TemporaryFolder folder;
  write_glb("body.glb", procedural_body(), random_motion(6, 81));
  Motion still{30, {rest_pose(55)}};
  write_glb("still.glb", procedural_body(), still);
  folder.write("validate.cjs", R"(
let validator;
try { validator = require('gltf-validator'); } catch (missing) { process.exit(77); }
const fs = require('fs');
(async () => {
  for (const file of ['body.glb', 'still.glb']) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)));
    const { numErrors, numWarnings, numInfos, messages } = report.issues;
    console.log(file, numErrors, numWarnings, numInfos, JSON.stringify(messages.slice(0, 5)));
    if (numErrors + numWarnings + numInfos > 0) process.exitCode = 1;
  }
})();
)");
  const int status = std::system("node validate.cjs > report.txt 2>&1");
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  if (code == 77 || code == 127) {
    WARN("skipped: " << (code == 77 ? "NODE_PATH has no gltf-validator (npm install gltf-validator)"
                                    : "there is no node"));
    return;
  }
  INFO(file_text("report.txt"));
  CHECK(code == 0);
}

}  // namespace glb_test
