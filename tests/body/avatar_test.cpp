#include "body/avatar.h"

#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/npz.h"
#include "core/quaternion.h"
#include "stress/scratch_folder.h"

namespace avatar_test {

using namespace hsi4d;

namespace {

const BodyModel& body() {
  static const BodyModel made = procedural_body();
  return made;
}

const Avatar& avatar() {
  static const Avatar made = surface_avatar(body(), {.gaussians = 2000});
  return made;
}

Vector3<double> point(const std::vector<float>& numbers, Index i) {
  const float* x = numbers.data() + 3 * i;
  return {static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2])};
}

/// Distance of a point from a triangle's plane, where its foot lies in the triangle; else infinity.
double distance_to_face(const Vector3<double>& p, std::size_t face) {
  const Vector3<double> a = point(body().vertices, body().faces[face]),
                        b = point(body().vertices, body().faces[face + 1]),
                        c = point(body().vertices, body().faces[face + 2]);
  const Vector3<double> n = cross(Vector3<double>(b - a), Vector3<double>(c - a));
  const double squared = dot(n, n);
  const double u = dot(cross(Vector3<double>(c - b), Vector3<double>(p - b)), n) / squared;
  const double v = dot(cross(Vector3<double>(a - c), Vector3<double>(p - c)), n) / squared;
  const double w = 1 - u - v;
  if (std::min({u, v, w}) < -1e-4) return std::numeric_limits<double>::infinity();
  return std::fabs(dot(Vector3<double>(p - a), n)) / std::sqrt(squared);
}

/// A small avatar by hand.
Avatar small_avatar() {
  Avatar a;
  a.means = {0, 0, 0, 1, 2, 3};
  a.quats = {1, 0, 0, 0, 0.5, 0.5, 0.5, 0.5};
  a.log_scales = {-4, -4, -5, -3, -3, -6};
  a.opacity_logits = {2, -1};
  a.colors = {0.5, 0.25, 1, 0, 0.125, 0.75};
  a.weights = {2, 3, 2, {0, 1, 2, 2}, {0.75, 0.25, 1, 0}};
  a.parents = {-1, 0, 1};
  a.joints = {0, 0, 0, 0, 0.5, 0, 0, 1, 0};
  a.joint_names = {"root", "knee", "foot"};
  return a;
}

bool equal(const Avatar& a, const Avatar& b) {
  return a.means == b.means && a.quats == b.quats && a.log_scales == b.log_scales &&
         a.opacity_logits == b.opacity_logits && a.colors == b.colors && a.weights.indices == b.weights.indices &&
         a.weights.weights == b.weights.weights && a.weights.per_vertex == b.weights.per_vertex &&
         a.parents == b.parents && a.joints == b.joints && a.joint_names == b.joint_names;
}

using Members = std::map<std::string, std::function<void(SafetensorsWriter&)>>;

/// The arrays of small_avatar's file, and its joint names.
Members members() {
  static const Avatar a = small_avatar();
  Members m;
  m["means"] = [](SafetensorsWriter& f) { f.add<float>("means", {2, 3}, a.means); };
  m["quats"] = [](SafetensorsWriter& f) { f.add<float>("quats", {2, 4}, a.quats); };
  m["log_scales"] = [](SafetensorsWriter& f) { f.add<float>("log_scales", {2, 3}, a.log_scales); };
  m["opacity_logits"] = [](SafetensorsWriter& f) { f.add<float>("opacity_logits", {2}, a.opacity_logits); };
  m["colors"] = [](SafetensorsWriter& f) { f.add<float>("colors", {2, 3}, a.colors); };
  m["weight_indices"] = [](SafetensorsWriter& f) { f.add<std::int32_t>("weight_indices", {2, 2}, a.weights.indices); };
  m["weights"] = [](SafetensorsWriter& f) { f.add<double>("weights", {2, 2}, a.weights.weights); };
  m["parents"] = [](SafetensorsWriter& f) { f.add<std::int32_t>("parents", {3}, a.parents); };
  m["joints"] = [](SafetensorsWriter& f) { f.add<double>("joints", {3, 3}, a.joints); };
  m["joint_names"] = [](SafetensorsWriter& f) { f.set_texts("joint_names", a.joint_names); };
  return m;
}

/// What is said of small_avatar's file with one member replaced (or left out, when `add` adds nothing).
std::string message_for(const std::string& changed, const std::function<void(SafetensorsWriter&)>& add,
                        SafetensorsWriter file = SafetensorsWriter("hsi4d avatar", kAvatarVersion)) {
  const Members all = members();
  REQUIRE(all.contains(changed));
  for (const auto& [name, write] : all) {
    if (name != changed) write(file);
  }
  add(file);
  try {
    decode_avatar(file.encode(), "a");
  } catch (const DataError& error) {
    return error.what();
  }
  return "accepted";
}

/// small_avatar as version 1 had it, an archive.
NpzWriter first_file(int version = 1) {
  const Avatar a = small_avatar();
  NpzWriter file;
  file.add_text("format", "hsi4d avatar");
  file.add_scalar<std::int32_t>("version", version);
  file.add<float>("means", {2, 3}, a.means);
  file.add<float>("quats", {2, 4}, a.quats);
  file.add<float>("log_scales", {2, 3}, a.log_scales);
  file.add<float>("opacity_logits", {2}, a.opacity_logits);
  file.add<float>("colors", {2, 3}, a.colors);
  file.add<std::int32_t>("weight_indices", {2, 2}, a.weights.indices);
  file.add<double>("weights", {2, 2}, a.weights.weights);
  file.add<std::int32_t>("parents", {3}, a.parents);
  file.add<double>("joints", {3, 3}, a.joints);
  file.add_texts("joint_names", a.joint_names);
  return file;
}

}  // namespace

TEST_CASE("an avatar of a surface has as many Gaussians as asked for, on the surface and facing outwards") {
  const Avatar& a = avatar();
  REQUIRE(a.count() == 2000);
  check_sizes(a);
  CHECK(a.weights.per_vertex == 4);
  CHECK(a.parents == smplx_parents());
  for (Index i = 0; i < a.count(); i += 13) {
    const Vector3<double> p = point(a.means, i);
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t face = 0;
    for (std::size_t f = 0; f < body().faces.size(); f += 3) {
      const double d = distance_to_face(p, f);
      if (d < nearest) nearest = d, face = f;
    }
    CHECK(nearest < 1e-6);
    const float* q = a.quats.data() + 4 * i;
    const Matrix3<double> frame = quaternion_to_matrix(Vector4<double>(q[0], q[1], q[2], q[3]));
    const Vector3<double> corner = point(body().vertices, body().faces[face]);
    const Vector3<double> normal = cross(Vector3<double>(point(body().vertices, body().faces[face + 1]) - corner),
                                         Vector3<double>(point(body().vertices, body().faces[face + 2]) - corner))
                                       .normalized();
    CHECK(dot(Vector3<double>(frame.col(2)), normal) > 0.5);
    const float* s = a.log_scales.data() + 3 * i;
    CHECK(s[0] == s[1]);
    CHECK(s[2] > s[0] + std::log(0.2) - 1e-5);  // thicker where the surface bends
    CHECK(s[2] < s[0]);
  }
}

TEST_CASE("an avatar's Gaussians leave no hole and are not crowded") {
  const Avatar& a = avatar();
  // Every vertex is within reach of a Gaussian: two of its tangent scales at most.
  for (Index v = 0; v < body().vertex_count(); v += 7) {
    const Vector3<double> p = point(body().vertices, v);
    double nearest = 1e9;
    for (Index i = 0; i < a.count(); ++i) {
      nearest =
          std::min(nearest, (point(a.means, i) - p).norm() / std::exp(a.log_scales[static_cast<std::size_t>(3 * i)]));
    }
    REQUIRE(nearest < 1.5);
  }
  // Two on the same side are no nearer than half their distance on average, which is about scale / cover.
  const auto normal = [&](Index i) {
    const float* q = a.quats.data() + 4 * i;
    return Vector3<double>(quaternion_to_matrix(Vector4<double>(q[0], q[1], q[2], q[3])).col(2));
  };
  for (Index i = 0; i < a.count(); i += 3) {
    for (Index k = 0; k < a.count(); ++k) {
      if (k == i || dot(normal(i), normal(k)) <= 0) continue;
      const float scale =
          std::min(a.log_scales[static_cast<std::size_t>(3 * i)], a.log_scales[static_cast<std::size_t>(3 * k)]);
      REQUIRE((point(a.means, i) - point(a.means, k)).norm() > 0.5 * std::exp(scale) / 0.7 / 1.6);
    }
  }
}

TEST_CASE("an avatar follows the body's skin") {
  BodyPose pose = rest_pose(55);
  pose.set_rotation(smplx_joint("left_shoulder"), {0, 0, -1.2});
  pose.transl = {1, 2, 3};
  const std::vector<double> joints = pose_joints(avatar(), pose);
  CHECK(joints == pose_joints(body(), pose));
  const PosedJoints posed = pose_skeleton(avatar(), pose);
  const std::vector<double> rest(avatar().means.begin(), avatar().means.end());
  std::vector<double> means(rest.size());
  skin_points(SkinWeights<double>(avatar().weights), posed.transforms.data(), rest.data(), means.data());
  const std::vector<double> skin = pose_vertices(body(), pose);
  for (Index i = 0; i < avatar().count(); i += 17) {
    double nearest = 1e9;
    for (std::size_t v = 0; v < skin.size(); v += 3) {
      nearest = std::min(nearest, (Vector3<double>(means.data() + 3 * i) - Vector3<double>(skin.data() + v)).norm());
    }
    CHECK(nearest < 0.015);  // within a triangle
  }
}

TEST_CASE("an avatar is dressed") {
  const Avatar& a = avatar();
  std::map<std::string, Vector3<double>> sum;
  std::map<std::string, Index> count;
  for (Index i = 0; i < a.count(); ++i) {
    const std::string& name =
        a.joint_names[static_cast<std::size_t>(a.weights.indices[static_cast<std::size_t>(4 * i)])];
    const Vector3<double> color = point(a.colors, i);
    for (int c = 0; c < 3; ++c) CHECK((color[c] >= 0 && color[c] <= 1));
    if (count[name]++ == 0) sum[name] = Vector3<double>::Zero();
    sum[name] += color;
  }
  const auto mean = [&](const char* name) {
    return Vector3<double>(sum.at(name) / static_cast<double>(count.at(name)));
  };
  CHECK(mean("left_wrist")[0] > mean("left_wrist")[2] + 0.2);  // skin is red before blue
  CHECK(mean("spine2")[2] > mean("spine2")[0]);                // the shirt is blue
  CHECK(mean("left_hip").maxCoeff() < 0.5);                    // the trousers are dark
  CHECK((mean("left_hip") - mean("spine2")).norm() > 0.1);
  // Patterns: the shirt's Gaussians differ, and without texture far less.
  const auto spread = [&](const Avatar& one) {
    double low = 1, high = 0;
    for (Index i = 0; i < one.count(); ++i) {
      if (one.weights.indices[static_cast<std::size_t>(4 * i)] != 6) continue;
      low = std::min(low, point(one.colors, i)[0]), high = std::max(high, point(one.colors, i)[0]);
    }
    return high - low;
  };
  CHECK(spread(a) > 0.4);
  CHECK(spread(surface_avatar(body(), {.gaussians = 2000, .texture = 0})) < 0.15);
}

TEST_CASE("an avatar is a function of the settings, and its seed counts") {
  CHECK(equal(surface_avatar(body(), {.gaussians = 2000}), avatar()));
  CHECK(surface_avatar(body(), {.gaussians = 2000, .seed = 1}).means != avatar().means);
  CHECK(surface_avatar(body(), {.gaussians = 1}).count() == 1);
  CHECK(surface_avatar(body(), {.gaussians = 12345}).count() == 12345);
  CHECK_THROWS_WITH(surface_avatar(body(), {.gaussians = 0}), "avatar: gaussians is 0; allowed: 1 to 5000000");
  CHECK_THROWS_AS(surface_avatar(body(), {.opacity = 1}), UserError);
  CHECK_THROWS_AS(surface_avatar(body(), {.cover = std::nan("")}), UserError);
  CHECK_THROWS_AS(surface_avatar(BodyModel{}), InternalError);
}

TEST_CASE("selected Gaussians of an avatar keep what is theirs") {
  Avatar whole = small_avatar();
  whole.color_net = new_color_net(whole.means, whole.joint_count(), {});
  const std::vector<Index> rows = {1, 0, 1};
  const Avatar part = selected(whole, rows);
  check_sizes(part);
  CHECK(part.parents == whole.parents);
  CHECK(part.color_net->layers == whole.color_net->layers);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto from = static_cast<std::size_t>(rows[i]);
    const auto k = static_cast<std::size_t>(whole.weights.per_vertex);
    const auto f = static_cast<std::size_t>(whole.color_net->features_per_row);
    const auto is_row = [&](const auto& a, const auto& b, std::size_t width) {
      return std::equal(a.begin() + static_cast<std::ptrdiff_t>(i * width),
                        a.begin() + static_cast<std::ptrdiff_t>((i + 1) * width),
                        b.begin() + static_cast<std::ptrdiff_t>(from * width));
    };
    CHECK(is_row(part.means, whole.means, 3));
    CHECK(is_row(part.quats, whole.quats, 4));
    CHECK(is_row(part.log_scales, whole.log_scales, 3));
    CHECK(is_row(part.opacity_logits, whole.opacity_logits, 1));
    CHECK(is_row(part.colors, whole.colors, 3));
    CHECK(is_row(part.weights.indices, whole.weights.indices, k));
    CHECK(is_row(part.weights.weights, whole.weights.weights, k));
    CHECK(is_row(part.color_net->features, whole.color_net->features, f));
  }
  const std::vector<Index> beyond = {whole.count()};
  CHECK_THROWS_AS(selected(whole, beyond), InternalError);
}

TEST_CASE("avatar files round-trip") {
  const ScratchFolder folder;
  const std::string path = folder / "a.safetensors";
  write_avatar(path, small_avatar());
  CHECK(equal(read_avatar(path), small_avatar()));
  write_avatar(path, avatar());
  const Avatar read = read_avatar(path);
  CHECK(read.means == avatar().means);
  CHECK(read.weights.indices == avatar().weights.indices);
  for (std::size_t i = 0; i < read.weights.weights.size(); ++i) {
    REQUIRE(std::fabs(read.weights.weights[i] - avatar().weights.weights[i]) < 1e-15);
  }
  CHECK(folder.count() == 1);
  Avatar broken = small_avatar();
  broken.colors.pop_back();
  CHECK_THROWS_AS(write_avatar(path, broken), InternalError);
  CHECK(read_avatar(path).count() == 2000);
}

TEST_CASE("an avatar's file may hold more than the avatar") {
  SafetensorsWriter file = avatar_file(small_avatar());
  file.add<float>("color_net.weights", {2}, {1, 2});
  file.set_text("trained_on", "a clip");
  CHECK(equal(decode_avatar(file.encode(), "a"), small_avatar()));
}

TEST_CASE("avatar files of version 1 are read, whatever their name") {
  const ScratchFolder folder;
  CHECK(equal(decode_avatar(first_file().encode(), "a.npz"), small_avatar()));
  first_file().write(folder / "a.safetensors");
  CHECK(equal(read_avatar(folder / "a.safetensors"), small_avatar()));
  CHECK_THROWS_WITH(decode_avatar(first_file(2).encode(), "a.npz"),
                    "a.npz: the format's version is 2; allowed in a .npz file: 1");
  CHECK_THROWS_WITH(decode_avatar(NpzWriter().encode(), "a.npz"),
                    "a.npz: there is no array 'format'; this is no avatar");
}

TEST_CASE("faults of avatar files are named") {
  const auto nothing = [](SafetensorsWriter&) {};
  using File = SafetensorsWriter;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  CHECK(message_for("means", [](File& f) { f.add<float>("means", {2, 3}, {0, 0, 0, 1, 2, 3}); }) == "accepted");
  CHECK(message_for("means", nothing).starts_with("a: has no array 'means'; there are: "));
  CHECK(message_for("means", members().at("means"), File("x", 1)) == "a: the format is 'x'; allowed: 'hsi4d avatar'");
  CHECK(message_for("means", members().at("means"), File("hsi4d avatar", 3)) ==
        "a: the format's version is '3'; allowed: 1 to 2 (the file is from a newer program)");
  CHECK(message_for("quats", [](File& f) {
          f.add<float>("quats", {1, 4}, {1, 0, 0, 0});
        }) == "a: array 'quats': has shape [1,4]; [2,4] is needed");
  CHECK(message_for("quats", [](File& f) {
          f.add<float>("quats", {2, 4}, {1, 0, 0, 0, 0, 0, 0, 0});
        }) == "a: array 'quats': row 1 is zero, which is no rotation");
  CHECK(message_for("means", [nan](File& f) {
          f.add<float>("means", {2, 3}, {0, 0, 0, 1, nan, 3});
        }) == "a: array 'means': row 1, number 1 is not finite");
  CHECK(message_for("parents", [](File& f) {
          f.add<std::int32_t>("parents", {3}, {-1, 2, 1});
        }) == "a: array 'parents': the parent of joint 1 is 2; allowed: 0 to 0, a joint that comes before it");
  CHECK(message_for("parents", [](File& f) { f.add<std::int32_t>("parents", {0}, {}); }) ==
        "a: array 'parents': there are no joints");
  CHECK(message_for("joint_names", nothing) == "a: has no metadata 'joint_names'; there is: format, version");
  CHECK(message_for("joint_names", [](File& f) { f.set_text("joint_names", "[\"root\"]"); }) ==
        "a: metadata 'joint_names' has 1 names; 3 are needed, one a joint");
  CHECK(message_for("weights", [](File& f) {
          f.add<double>("weights", {2, 2}, {0.5, 0.25, 1, 0});
        }) == "a: array 'weights': vertex 0: the weights sum to 0.75; allowed: 1 within 0.01");
  CHECK(message_for("weight_indices", [](File& f) {
          f.add<std::int32_t>("weight_indices", {2, 2}, {0, 3, 0, 0});
        }) == "a: array 'weights': vertex 0: joint 3 does not exist; allowed: 0 to 2");
  CHECK(message_for("weight_indices", [](File& f) {
          f.add<std::int32_t>("weight_indices", {2, 9}, std::vector<std::int32_t>(18, 0));
        }) == "a: array 'weight_indices': has shape [2,9]; allowed: 1 to 8 weights a Gaussian");
  CHECK_THROWS_AS(read_avatar("no_such_avatar.safetensors"), UserError);
}

}  // namespace avatar_test
