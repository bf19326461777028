#include "body/smplx_file.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "tests/support/smplx_reference.h"
#include "tests/support/zip_archive.h"

namespace smplx_file_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

SmplxModel read_back(const SmplxArrays& arrays, const SmplxFileOptions& options = {}) {
  return decode_smplx(smplx_writer(arrays).encode(), "body.npz", options);
}

/// A small model, to be spoilt.
SmplxArrays small() { return random_smplx({.vertices = 3, .corrective_size = 0.01, .seed = 2}); }

/// The members of a small model's file, to be spoilt.
struct Members {
  std::vector<ZipMember> all;

  Members() {
    const Npz whole = Npz::decode(smplx_writer(small()).encode(), "body.npz");
    for (const std::string& name : whole.names()) {
      const NpyArray& array = whole.array(name);
      all.push_back({name + ".npy", array.kind() == NpyKind::floating
                                        ? encode_npy<double>(array.shape(), array.as<double>())
                                        : encode_npy<std::int64_t>(array.shape(), array.as<std::int64_t>())});
    }
  }
  Members& remove(const std::string& name) {
    std::erase_if(all, [&](const ZipMember& member) { return member.name == name + ".npy"; });
    return *this;
  }
  template <class T = double>
  Members& set(const std::string& name, const std::vector<std::int64_t>& shape, const std::vector<T>& numbers) {
    remove(name);
    all.push_back({name + ".npy", encode_npy<T>(shape, numbers)});
    return *this;
  }
  Members& pickle(const std::string& name) {
    remove(name);
    all.push_back({name + ".npy", pickled_npy()});
    return *this;
  }
  SmplxModel read(const SmplxFileOptions& options = {}) const {
    return decode_smplx(archive_of(all, false), "body.npz", options);
  }
  std::string error() const {
    try {
      read();
    } catch (const DataError& error) {
      return error.what();
    }
    return "no error";
  }
};

const double kNan = std::numeric_limits<double>::quiet_NaN();

}  // namespace

TEST_CASE("a file is read as it is written") {
  const SmplxArrays a = random_smplx({.vertices = 20, .seed = 1});
  const SmplxModel m = read_back(a);
  CHECK(m.source == "body.npz");
  CHECK(m.vertices == a.v_template);
  CHECK(m.faces == std::vector<std::int32_t>(a.f.begin(), a.f.end()));
  CHECK(m.parents == smplx_parents());
  CHECK(m.correctives == a.posedirs);
  CHECK(m.weights.weights == a.weights);
  CHECK(m.rescaled_weights == 0);
  CHECK(m.hands[0].mean == a.hand_means[0]);
  CHECK(m.hands[1].components == a.hand_components[1]);
  CHECK(m.hands[1].component_count() == 45);
  CHECK(m.betas == 10);
  CHECK(m.expressions == 10);
  for (std::size_t row = 0; row < 60; ++row) {
    for (std::size_t c = 0; c < 10; ++c) {
      CHECK(m.shape[10 * row + c] == a.shapedirs[20 * row + c]);
      CHECK(m.expression[10 * row + c] == a.shapedirs[20 * row + 10 + c]);
    }
  }
  CHECK(m.unread.empty());
  CHECK(read_back(a, {.correctives = false}).correctives.empty());
}

TEST_CASE("shape and expression are found by the number of directions") {
  const auto counts = [](std::int64_t columns) {
    const SmplxModel m = read_back(random_smplx({.vertices = 4, .columns = columns, .correctives = false}), {0, 0});
    CHECK(m.shape.empty());
    CHECK(m.expression.empty());
    return std::pair(m.betas_in_file, m.expressions_in_file);
  };
  CHECK(counts(400) == std::pair<Index, Index>(300, 100));
  CHECK(counts(20) == std::pair<Index, Index>(10, 10));
  CHECK(counts(16) == std::pair<Index, Index>(10, 6));
  CHECK(counts(10) == std::pair<Index, Index>(10, 0));
  CHECK(counts(7) == std::pair<Index, Index>(7, 0));
  CHECK(counts(399) == std::pair<Index, Index>(10, 10));
  const SmplxArrays a = random_smplx({.vertices = 4, .columns = 400, .correctives = false});
  const SmplxModel m = read_back(a, {.betas = 300, .expressions = 2});
  CHECK(m.shape[299] == a.shapedirs[299]);
  CHECK(m.expression[0] == a.shapedirs[300]);
  CHECK(m.expression[2 * 11 + 1] == a.shapedirs[400 * 11 + 301]);
}

TEST_CASE("more betas or expressions than there are do not fit") {
  const SmplxArrays a = small();
  CHECK_THROWS_WITH(read_back(a, {.betas = 16}),
                    "body.npz: array 'shapedirs': has shape [3,3,20], which holds 10 betas; 16 were asked for");
  CHECK_THROWS_WITH(read_back(a, {.expressions = 11}),
                    "body.npz: array 'shapedirs': has shape [3,3,20], which holds 10 expressions; 11 were asked for");
  CHECK_THROWS_AS(read_back(a, {.betas = 16}), DataError);
}

TEST_CASE("joints that a file names outright are preferred to the regressor's") {
  SmplxArrays a = random_smplx({.vertices = 20, .correctives = false, .seed = 3});
  const SmplxModel regressed = read_back(a);
  Numbers joints(165);
  for (std::size_t i = 0; i < 165; ++i) {
    for (std::size_t v = 0; v < 20; ++v) joints[i] += a.regressor[i / 3 * 20 + v] * a.v_template[3 * v + i % 3];
    CHECK(regressed.joints[i] == Approx(joints[i]).margin(1e-15));
  }
  a.j_template = Numbers(165, 0.25);
  a.j_shapedirs = Numbers(165 * 10, 0.125);
  a.regressor.clear();
  const SmplxModel m = read_back(a, {.betas = 4, .expressions = 3});
  CHECK(m.joints == a.j_template);
  CHECK(m.joint_shape == Numbers(165 * 4, 0.125));
  CHECK(m.joint_expression == Numbers(165 * 3, 0.0));
  a.j_shapedirs.clear();
  CHECK_THROWS_WITH(read_back(a), Catch::Contains("body.npz") && Catch::Contains("J_regressor"));
}

TEST_CASE("arrays of Python objects are passed over, never unpickled") {
  Members members;
  members.pickle("joint2num").pickle("part2num");
  const SmplxModel m = members.read();
  CHECK(m.unread == std::vector<std::string>{"joint2num", "part2num"});
  CHECK(m.vertices == small().v_template);
  for (const char* needed : {"v_template", "f", "weights", "kintree_table", "shapedirs", "J_regressor", "posedirs",
                             "hands_meanl", "hands_componentsr", "J_template"}) {
    CHECK(Members().pickle(needed).error() ==
          "body.npz: array '" + std::string(needed) + "': holds Python objects (dtype '|O'), which are not unpickled");
  }
}

TEST_CASE("arrays that a file need not have") {
  const SmplxModel m = Members().remove("posedirs").remove("hands_meanl").remove("hands_componentsl").read();
  CHECK(m.correctives.empty());
  CHECK(m.hands[0].mean == Numbers(45, 0.0));
  CHECK(m.hands[0].component_count() == 0);
  CHECK(m.hands[1].component_count() == 45);
  CHECK(Members().set("hands_componentsr", {6, 45}, Numbers(270, 0.5)).read().hands[1].component_count() == 6);
}

TEST_CASE("a file without a needed array is refused, naming it") {
  for (const char* name : {"v_template", "f", "weights", "kintree_table", "shapedirs", "J_regressor"}) {
    const std::string error = Members().remove(name).error();
    CHECK_THAT(error, Catch::StartsWith("body.npz: ") && Catch::Contains(name));
  }
}

TEST_CASE("wrong shapes are refused, naming the array") {
  const auto error = [](const char* name, const std::vector<std::int64_t>& shape) {
    std::int64_t count = 1;
    for (const std::int64_t n : shape) count *= n;
    return Members().set(name, shape, Numbers(static_cast<std::size_t>(count), 0.0)).error();
  };
  CHECK(error("v_template", {3, 4}) == "body.npz: array 'v_template': has shape [3,4]; [*,3] is needed");
  CHECK(error("v_template", {0, 3}) == "body.npz: array 'v_template': holds no vertex");
  CHECK(error("f", {1, 4}) == "body.npz: array 'f': has shape [1,4]; [*,3] is needed");
  CHECK(error("weights", {3, 24}) == "body.npz: array 'weights': has shape [3,24]; [3,55] is needed");
  CHECK(error("weights", {4, 55}) == "body.npz: array 'weights': has shape [4,55]; [3,55] is needed");
  CHECK(error("kintree_table", {3, 55}) == "body.npz: array 'kintree_table': has shape [3,55]; [2,*] is needed");
  for (const std::int64_t joints : {0, 22, 25, 54})
    CHECK(error("kintree_table", {2, joints}) == "body.npz: array 'kintree_table': has shape [2," +
                                                     std::to_string(joints) +
                                                     "]; allowed: [2,55] (SMPL-X), [2,52] (SMPL-H), [2,24] (SMPL)");
  CHECK(error("shapedirs", {3, 3}) == "body.npz: array 'shapedirs': has shape [3,3]; [3,3,*] is needed");
  CHECK(error("shapedirs", {3, 3, 0}) ==
        "body.npz: array 'shapedirs': has shape [3,3,0], which holds 0 betas; 10 were asked for");
  CHECK(error("J_regressor", {24, 3}) == "body.npz: array 'J_regressor': has shape [24,3]; [55,3] is needed");
  CHECK(error("posedirs", {3, 3, 207}) == "body.npz: array 'posedirs': has shape [3,3,207]; [3,3,486] is needed");
  CHECK(error("hands_meanl", {1, 45}) == "body.npz: array 'hands_meanl': has shape [1,45]; [45] is needed");
  CHECK(error("hands_componentsl", {45, 12}) ==
        "body.npz: array 'hands_componentsl': has shape [45,12]; [*,45] is needed");
}

namespace {

/// A body of SMPL-X whose jaw, eyes and, without fingers, fingers move nothing, and are where the head and the hands
/// are.
SmplxArrays quiet_arrays(bool has_fingers) {
  SmplxArrays a = random_smplx({.vertices = 30, .columns = 10, .corrective_size = 0.01, .seed = 6});
  for (std::size_t j = 22; j < (has_fingers ? 25u : 55u); ++j) {
    const std::size_t instead = j < 25 ? 15 : j < 40 ? 20 : 21;  // head, wrists
    const std::size_t at = j < 25 ? 15 : j < 40 ? 25 : 40;
    for (std::size_t v = 0; v < 30; ++v) {
      a.weights[55 * v + instead] += a.weights[55 * v + j];
      a.weights[55 * v + j] = 0;
      if (j != at) a.regressor[30 * j + v] = a.regressor[30 * at + v];
    }
    for (std::size_t row = 0; row < 90; ++row) std::fill_n(a.posedirs.begin() + long(486 * row + 9 * (j - 1)), 9, 0.0);
  }
  return a;
}

/// The model of a file with these joints alone. The last two of SMPL, the hands, have half of what the wrists move.
SmplxModel model_of_joints(const SmplxArrays& a, const std::vector<std::size_t>& joints,
                           const std::vector<std::int64_t>& tree) {
  const auto count = static_cast<std::int64_t>(joints.size());
  Numbers weights, regressor, posedirs;
  for (std::size_t v = 0; v < 30; ++v) {
    for (const std::size_t j : joints) {
      const bool shares = count == 24 && (j == 20 || j == 21 || j == 25 || j == 40);
      const std::size_t of = count == 24 && j == 25 ? 20 : count == 24 && j == 40 ? 21 : j;
      weights.push_back(a.weights[55 * v + of] * (shares ? 0.5 : 1));
    }
  }
  for (const std::size_t j : joints) {
    for (std::size_t v = 0; v < 30; ++v) regressor.push_back(a.regressor[30 * j + v]);
  }
  for (std::size_t row = 0; row < 90; ++row) {
    for (std::size_t i = 1; i < joints.size(); ++i) {
      for (std::size_t c = 0; c < 9; ++c) {
        const bool is_hand = count == 24 && i >= 22;  // what its turn corrects has no place
        posedirs.push_back(is_hand ? 0.5 : a.posedirs[486 * row + 9 * (joints[i] - 1) + c]);
      }
    }
  }
  NpzWriter file;
  file.add<double>("v_template", {30, 3}, a.v_template);
  file.add<std::int64_t>("f", {std::int64_t(a.f.size()) / 3, 3}, a.f);
  file.add<std::int64_t>("kintree_table", {2, count}, tree);
  file.add<double>("shapedirs", {30, 3, 10}, a.shapedirs);
  file.add<double>("J_regressor", {count, 30}, regressor);
  file.add<double>("weights", {30, count}, weights);
  file.add<double>("posedirs", {30, 3, 9 * (count - 1)}, posedirs);
  return decode_smplx(file.encode(), "smpl.npz", {.betas = 10, .expressions = 0});
}

}  // namespace

TEST_CASE("SMPL and SMPL-H are the body of SMPL-X whose other joints move nothing") {
  for (const bool has_fingers : {true, false}) {
    INFO((has_fingers ? "SMPL-H" : "SMPL"));
    std::vector<std::size_t> joints;
    for (std::size_t j = 0; j < 22; ++j) joints.push_back(j);
    for (std::size_t j = 25; has_fingers && j < 55; ++j) joints.push_back(j);
    if (!has_fingers) joints.insert(joints.end(), {25, 40});
    const auto count = joints.size();
    std::vector<std::int64_t> tree;
    for (const std::size_t j : joints) {
      const auto parent = std::find(joints.begin(), joints.end(), std::size_t(std::max(0, smplx_parents()[j])));
      tree.push_back(j == 0 ? 4294967295 : parent - joints.begin());
    }
    tree.resize(2 * count);
    const SmplxArrays a = quiet_arrays(has_fingers);
    const SmplxModel expected = read_back(a, {.betas = 10, .expressions = 0});
    const SmplxModel m = model_of_joints(a, joints, tree);
    CHECK(m.parents == expected.parents);
    CHECK(m.joints == expected.joints);
    CHECK(m.joint_shape == expected.joint_shape);
    CHECK(m.weights.weights == expected.weights.weights);
    CHECK(m.correctives == expected.correctives);
    CHECK(m.shape == expected.shape);
    CHECK(m.expressions_in_file == 0);
    CHECK(m.betas_in_file == 10);
    CHECK(rest_body(m).joints == rest_body(expected).joints);

    std::vector<std::int64_t> other = tree;
    other[5] = 1;  // the right knee on the left hip
    CHECK_THROWS_WITH(model_of_joints(a, joints, other),
                      "smpl.npz: array 'kintree_table': the parent of joint 5 is 1; allowed: 2, as in SMPL and SMPL-H");
  }
}

TEST_CASE("numbers that are not finite or huge are refused, naming their place") {
  const SmplxArrays good = small();
  const auto error = [](const SmplxArrays& spoilt) {
    try {
      read_back(spoilt);
    } catch (const DataError& refused) {
      return std::string(refused.what());
    }
    return std::string("no error");
  };
  SmplxArrays a = good;
  a.v_template[5] = kNan;
  CHECK(error(a) == "body.npz: array 'v_template': number [1,2] is nan; allowed: -1e6 to 1e6");
  a = good;
  a.shapedirs[20 * 4 + 7] = -std::numeric_limits<double>::infinity();
  CHECK(error(a) == "body.npz: array 'shapedirs': number [1,1,7] is -inf; allowed: -1e6 to 1e6");
  a = good;
  a.posedirs[486 * 8 + 485] = kNan;
  CHECK(error(a) == "body.npz: array 'posedirs': number [2,2,485] is nan; allowed: -1e6 to 1e6");
  a = good;
  a.regressor[3 * 54] = kNan;
  CHECK(error(a) == "body.npz: array 'J_regressor': number [54,0] is nan; allowed: -1e6 to 1e6");
  a = good;
  a.hand_components[1][46] = 1e300;
  CHECK(error(a) == "body.npz: array 'hands_componentsr': number [1,1] is 1e+300; allowed: -1e6 to 1e6");
  a = good;
  a.weights[55 + 3] = kNan;
  CHECK(error(a) == "body.npz: array 'weights': vertex 1: weight 3 is nan; allowed: 0 to 1");
}

TEST_CASE("D1: weights that do not sum to 1 are repaired and counted, or refused") {
  SmplxArrays a = small();
  for (std::size_t j = 0; j < 55; ++j) a.weights[55 + j] *= 1.009;
  for (std::size_t j = 0; j < 55; ++j) a.weights[110 + j] *= 1 + 4e-7;
  const SmplxModel m = read_back(a);
  CHECK(m.rescaled_weights == 1);
  double sum = 0;
  for (std::size_t j = 0; j < 55; ++j) {
    CHECK(m.weights.weights[j] == a.weights[j]);
    CHECK(m.weights.weights[110 + j] == a.weights[110 + j]);
    sum += m.weights.weights[55 + j];
  }
  CHECK(sum == Approx(1).epsilon(1e-15));
  for (std::size_t j = 0; j < 55; ++j) a.weights[j] *= 0.5;
  CHECK_THROWS_WITH(read_back(a), Catch::StartsWith("body.npz: array 'weights': vertex 0: the weights sum to 0.") &&
                                      Catch::EndsWith("; allowed: 1 within 0.01"));
}

TEST_CASE("parents and faces that name nothing are refused") {
  std::vector<std::int64_t> tree;
  for (const int parent : smplx_parents()) tree.push_back(parent);
  for (std::int64_t j = 0; j < 55; ++j) tree.push_back(j);
  const auto error = [&](std::size_t joint, std::int64_t parent) {
    std::vector<std::int64_t> wrong = tree;
    wrong[joint] = parent;
    return Members().set("kintree_table", {2, 55}, wrong).error();
  };
  for (const std::int64_t root : {std::int64_t{-1}, std::int64_t{4294967295}}) CHECK(error(0, root) == "no error");
  CHECK(error(0, 0) == "body.npz: array 'kintree_table': the parent of joint 0 is 0; allowed: -1, the root");
  CHECK(error(3, 3) ==
        "body.npz: array 'kintree_table': the parent of joint 3 is 3; allowed: 0 to 2, a joint that comes "
        "before it");
  CHECK(error(3, 55) ==
        "body.npz: array 'kintree_table': the parent of joint 3 is 55; allowed: 0 to 54, or -1 "
        "(4294967295) for the root");
  CHECK(Members().set<std::int64_t>("f", {2, 3}, {0, 1, 2, 0, 3, 1}).error() ==
        "body.npz: array 'f': face 1 names vertex 3; allowed: 0 to 2");
  CHECK(Members().set<std::int64_t>("f", {1, 3}, {0, -1, 2}).error() ==
        "body.npz: array 'f': face 0 names vertex -1; allowed: 0 to 2");
}

TEST_CASE("a truncated file is refused at every length, and a missing one") {
  const Bytes file = smplx_writer(random_smplx({.vertices = 1, .correctives = false})).encode();
  for (std::size_t length = 0; length < file.size(); length += 37) {
    CHECK_THROWS_AS(decode_smplx(std::span(file).first(length), "cut.npz"), DataError);
  }
  CHECK_THROWS_AS(read_smplx("nowhere.npz"), UserError);
}

TEST_CASE("the rest body is the shaped template") {
  const SmplxArrays a = random_smplx({.vertices = 30, .correctives = false, .seed = 4});
  const SmplxModel m = read_back(a);
  SmplxPose pose;
  pose.axis_angle.assign(165, 0.0);
  const BodyModel plain = rest_body(m);
  CHECK(plain.vertices == std::vector<float>(a.v_template.begin(), a.v_template.end()));
  CHECK(plain.joint_names == smplx_joint_names());
  CHECK(plain.faces == m.faces);
  CHECK(plain.weights.per_vertex == 4);
  pose.betas = {1, -2, 0.5, 0, 0, 0, 0, 0, 0, 3};
  const SmplxResult expected = reference_smplx(a, pose);
  const BodyModel shaped = rest_body(m, pose.betas);
  for (std::size_t i = 0; i < shaped.vertices.size(); ++i) {
    CHECK(shaped.vertices[i] == Approx(expected.vertices[i]).margin(1e-6));
  }
  for (std::size_t i = 0; i < 165; ++i) CHECK(shaped.joints[i] == Approx(expected.joints[i]).margin(1e-14));
  CHECK_THROWS_AS(rest_body(m, Numbers{1, 2}), InternalError);
}

}  // namespace smplx_file_test
