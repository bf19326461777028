#include "body/pose_prior.h"

#include <cmath>
#include <numbers>

#include "autodiff/elementwise.h"
#include "autodiff/rotations.h"
#include "body/body_model.h"
#include "body/natural_pose.h"
#include "core/rotation.h"
#include "tests/support/measures.h"
#include "tests/support/operator_check.h"
#include "tests/support/vposer_checkpoint.h"

namespace pose_prior_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr double kDegree = std::numbers::pi / 180;

// --- the network as it is published, layer by layer, in plain loops
// ---------------------------------------------------

Numbers plain_linear(const VposerCheckpoint& c, const std::string& name, const Numbers& x) {
  const Numbers &weight = c[name + ".weight"], &bias = c[name + ".bias"];
  Numbers y = bias;
  for (std::size_t o = 0; o < y.size(); ++o) {
    for (std::size_t i = 0; i < x.size(); ++i) y[o] += weight[o * x.size() + i] * x[i];
  }
  return y;
}

Numbers plain_normalization(const VposerCheckpoint& c, const std::string& name, Numbers x) {
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] =
        (x[i] - c[name + ".running_mean"][i]) / std::sqrt(c[name + ".running_var"][i] + 1e-5) * c[name + ".weight"][i] +
        c[name + ".bias"][i];
  }
  return x;
}

Numbers plain_leaky(Numbers x) {
  for (double& v : x) v = v > 0 ? v : 0.01 * v;
  return x;
}

Numbers plain_encode(const VposerCheckpoint& c, const Numbers& pose) {
  Numbers x = plain_linear(c, "encoder_net.2", plain_normalization(c, "encoder_net.1", pose));
  x = plain_normalization(c, "encoder_net.4", plain_leaky(x));
  return plain_linear(c, "encoder_net.8.mu", plain_linear(c, "encoder_net.7", plain_linear(c, "encoder_net.6", x)));
}

/// [21,9] by rows.
Numbers plain_decode(const VposerCheckpoint& c, const Numbers& z) {
  Numbers x = plain_leaky(plain_linear(c, "decoder_net.0", z));
  x = plain_linear(c, "decoder_net.5", plain_leaky(plain_linear(c, "decoder_net.3", x)));
  Numbers rows;
  for (std::size_t j = 0; j < 21; ++j) {
    const double* m = x.data() + 6 * j;
    double a[3] = {m[0], m[2], m[4]}, b[3] = {m[1], m[3], m[5]};
    const double length = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    for (double& v : a) v /= length;
    const double along = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for (int i = 0; i < 3; ++i) b[i] -= along * a[i];
    const double second = std::sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2]);
    for (double& v : b) v /= second;
    const double third[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    for (int i = 0; i < 3; ++i) rows.insert(rows.end(), {a[i], b[i], third[i]});
  }
  return rows;
}

// ----------------------------------------------------------------------------------------------------------------------

template <class S>
Numbers numbers_of(const ConstArray<S>& array) {
  return {array.data, array.data + array.shape.count()};
}

template <class S>
Numbers decoded(const PosePrior& prior, const Numbers& latents, Index frames) {
  Tape<S> tape;
  const Var<S> z = tape.parameter("z", shape_of(frames, prior.latents()));
  tape.set(z, std::vector<S>(latents.begin(), latents.end()));
  const Var<S> rotations = prior.decode(z);
  tape.forward(rotations);
  return numbers_of(tape.value(rotations));
}

/// Matrices by rows.
Numbers matrices_of(const Numbers& axis_angle) {
  Numbers rows;
  for (std::size_t j = 0; j < axis_angle.size() / 3; ++j) {
    const double* w = axis_angle.data() + 3 * j;
    const Matrix3<double> r = so3_exp(Vector3<double>(w[0], w[1], w[2]));
    for (int i = 0; i < 9; ++i) rows.push_back(r(i / 3, i % 3));
  }
  return rows;
}

std::string message_of(const Bytes& file) {
  try {
    decode_vposer(file, "v.npz");
  } catch (const DataError& error) {
    return error.what();
  }
  return "accepted";
}

double excess_of(const Numbers& axis_angle) {
  Tape<double> tape;
  const auto pose = tape.parameter("pose", shape_of(static_cast<Index>(axis_angle.size() / 3), 3));
  tape.set(pose, axis_angle);
  const auto energy = joint_limit_energy(rotations_from_axis_angle(pose));
  tape.forward(energy);
  return tape.value(energy).scalar();
}

}  // namespace

TEST_CASE("VPoser agrees with the published network in plain loops") {
  for (const auto& [h, d] : {std::pair{48, 8}, std::pair{512, 32}}) {
    const VposerCheckpoint c = random_vposer(h, d, 1);
    const PosePrior prior = vposer_prior(c.weights());
    CHECK(prior.name() == "vposer");
    REQUIRE(prior.latents() == d);
    RandomNumbers random(2);
    constexpr std::size_t kFrames = 6;
    const Numbers z = random.numbers(kFrames * static_cast<std::size_t>(d), 2), pose = random.numbers(63 * kFrames);
    Numbers rotations, latents;
    for (std::size_t t = 0; t < kFrames; ++t) {
      const auto from = z.begin() + static_cast<std::ptrdiff_t>(t) * d;
      const Numbers r = plain_decode(c, {from, from + d});
      rotations.insert(rotations.end(), r.begin(), r.end());
      const auto w = pose.begin() + 63 * static_cast<std::ptrdiff_t>(t);
      const Numbers mean = plain_encode(c, {w, w + 63});
      latents.insert(latents.end(), mean.begin(), mean.end());
    }
    CHECK(largest_difference(decoded<double>(prior, z, kFrames), rotations) <= 1e-11);
    CHECK(largest_difference(decoded<float>(prior, z, kFrames), rotations) <= 2e-4);
    CHECK(largest_difference(prior.encode(std::span<const double>(pose)), latents) <= 1e-10);
    // A frame's bits do not depend on how many frames there are.
    const Numbers one(z.begin() + d, z.begin() + 2 * d);
    const Numbers all = decoded<float>(prior, z, kFrames);
    CHECK(decoded<float>(prior, one, 1) == Numbers(all.begin() + 189, all.begin() + 378));
  }
}

TEST_CASE("VPoser's weights are read from both kinds of files, with the checkpoint's prefix too") {
  const VposerCheckpoint c = random_vposer(20, 5, 3);
  const VposerWeights plain = c.weights(), prefixed = decode_vposer(c.npz("vp_model."), "v.npz"),
                      tensors = decode_vposer(c.safetensors(), "v.safetensors");
  for (const VposerWeights* other : {&prefixed, &tensors}) {
    CHECK(other->latents == 5);
    for (std::size_t i = 0; i < 3; ++i) CHECK(other->decoder[i].weight == plain.decoder[i].weight);
    for (std::size_t i = 0; i < 2; ++i) CHECK(other->encoder[i].weight == plain.encoder[i].weight);
  }
  CHECK_THROWS_AS(read_vposer("nowhere.npz"), UserError);
  CHECK_THROWS_AS(read_pose_prior("nowhere.npz"), UserError);
  CHECK(read_pose_prior("").name() == "natural");
}

TEST_CASE("faults of VPoser's weights are named") {
  const VposerCheckpoint good = random_vposer(20, 5, 4);
  const auto spoilt = [&](const std::string& name, std::vector<std::int64_t> shape, Numbers numbers) {
    VposerCheckpoint c = good;
    c.add(name, std::move(shape), std::move(numbers));
    return message_of(c.npz());
  };
  CHECK(spoilt("decoder_net.3.weight", {20, 19}, Numbers(380)) ==
        "v.npz: array 'decoder_net.3.weight': has shape [20,19]; [20,20] is needed");
  CHECK(spoilt("decoder_net.5.bias", {120}, Numbers(120)) ==
        "v.npz: array 'decoder_net.5.bias': has shape [120]; [126] is needed");
  CHECK(spoilt("encoder_net.8.mu.bias", {0}, {}) == "v.npz: array 'encoder_net.8.mu.bias': holds no number");
  Numbers bad(63, 1.0);
  bad[7] = -1;
  CHECK(spoilt("encoder_net.1.running_var", {63}, bad) ==
        "v.npz: array 'encoder_net.1.running_var': number 7 is below 0; it is a variance");
  bad[7] = NAN;
  CHECK(spoilt("encoder_net.1.running_mean", {63}, bad) ==
        "v.npz: array 'encoder_net.1.running_mean': number 7 is not finite");
  for (const auto& [name, array] : good.arrays) {
    VposerCheckpoint c = good;
    c.arrays.erase(name);
    const bool is_used = name.find("logvar") == std::string::npos && name.find("tracked") == std::string::npos;
    const std::string message = message_of(c.npz());
    CHECK((is_used ? message.find(name) != std::string::npos : message == "accepted"));
  }
  const Bytes file = good.npz();
  for (std::size_t length = 0; length < file.size(); length += 997) {
    CHECK_THROWS_AS(decode_vposer(std::span(file).first(length), "v.npz"), DataError);
  }
}

TEST_CASE("priors pass the operator checks", "[parallel]") {
  const PosePrior vposer = vposer_prior(random_vposer(24, 6, 5).weights()), natural = natural_pose_prior(),
                  shipped = read_pose_prior(std::string(HSI4D_SOURCE_DIR) + "/configs/pose_prior.npz");
  RandomNumbers random(6);
  const Numbers rotations = matrices_of(random.numbers(2 * 63, 1.2));
  for (const PosePrior* prior : {&vposer, &natural, &shipped}) {
    // Latents that are the same for every seed: random weights make some rotation's columns nearly parallel for others.
    const OperatorInput latents{"z", shape_of(2, prior->latents()), 0, 0, random.numbers(2 * prior->latents(), 0.7)};
    const OperatorInput pose{"rotations", shape_of(42, 9), 0, 0, rotations};
    check_operator(prior->name() + " decode", {latents}, [&](const auto& in) { return prior->decode(in[0]); });
    check_operator(prior->name() + " encode", {pose}, [&](const auto& in) { return prior->encode(in[0]); });
    check_operator(prior->name() + " energy", {latents}, [&](const auto& in) { return prior->energy(in[0]); });
  }
}

TEST_CASE("natural poses: latents stand for poses one to one, zeros for the body at ease") {
  const PosePrior prior = natural_pose_prior();
  CHECK(prior.latents() == 63);
  RandomNumbers random(7);
  const Numbers z = random.numbers(5 * 63, 2);
  const Numbers rotations = decoded<double>(prior, z, 5);
  Tape<double> tape;
  const auto r = tape.parameter("r", shape_of(105, 9));
  tape.set(r, rotations);
  const auto back = prior.encode(r);
  tape.forward(back);
  CHECK(largest_difference(numbers_of(tape.value(back)), z) <= 1e-12);
  const Numbers at_ease = decoded<double>(prior, Numbers(63, 0.0), 1);
  Numbers pose;
  for (const NaturalJoint& joint : natural_joints()) {
    for (const double angle : joint.ease) pose.push_back(angle * kDegree);
  }
  CHECK(largest_difference(at_ease, matrices_of(pose)) <= 1e-15);
  const auto energy = prior.energy(prior.encode(r));
  tape.forward(energy);
  double sum = 0;
  for (const double x : z) sum += x * x;
  CHECK(tape.value(energy).scalar() == Approx(sum / 5).epsilon(1e-12));
}

TEST_CASE("the table of natural joints is that of SMPL-X, symmetric, and the body at ease is within its ranges") {
  const auto joints = natural_joints();
  REQUIRE(joints.size() == 21);
  Numbers pose;
  for (std::size_t j = 0; j < 21; ++j) {
    const std::string name = joints[j].name;
    CHECK(name == smplx_joint_names()[j + 1]);
    const Vector3<double> ease = Vector3<double>(joints[j].ease[0], joints[j].ease[1], joints[j].ease[2]) * kDegree;
    const Matrix3<double> r = so3_exp(ease);
    const Vector3<double> angles = twist_and_swing(r, joints[j].twist_axis);
    for (int i = 0; i < 3; ++i) {
      CHECK(joints[j].low[i] * kDegree < angles[i]);
      CHECK(angles[i] < joints[j].high[i] * kDegree);
      CHECK(joints[j].spread[i] > 0);
      pose.push_back(joints[j].ease[i] * kDegree);
    }
    if (!name.starts_with("right_")) continue;
    const NaturalJoint& left = joints[j - 1];
    CHECK(left.name == "left_" + name.substr(6));
    for (int i = 0; i < 3; ++i) {
      CHECK(joints[j].ease[i] == (i == 0 ? left.ease[i] : -left.ease[i]));
      CHECK(joints[j].low[i] == (i == 0 ? left.low[i] : -left.high[i]));
    }
  }
  CHECK(excess_of(pose) == 0);
  CHECK(excess_of(Numbers(63, 0.0)) == 0);  // the rest pose
}

TEST_CASE("ranges have the sides that bodies have") {
  // A joint, the rotation about one axis, a direction of the limb at rest and where that must point to.
  struct Movement {
    const char* joint;
    int axis;
    double degrees;
    Vector3<double> limb, towards;
    bool is_possible;
  };
  const Vector3<double> down(0, -1, 0), up(0, 1, 0), ahead(0, 0, 1), back(0, 0, -1), left(1, 0, 0), right(-1, 0, 0);
  const Movement movements[] = {
      {"left_hip", 0, -100, down, ahead, true},
      {"right_hip", 0, -100, down, ahead, true},
      {"left_hip", 0, 70, down, back, false},
      {"left_hip", 2, 50, down, left, true},
      {"right_hip", 2, -50, down, right, true},
      {"left_hip", 2, -60, down, right, false},
      {"left_knee", 0, 130, down, back, true},
      {"left_knee", 0, -30, down, ahead, false},
      {"spine1", 0, 40, up, ahead, true},
      {"spine1", 0, -50, up, back, false},
      {"left_shoulder", 2, -85, left, down, true},
      {"right_shoulder", 2, 85, right, down, true},
      {"left_shoulder", 1, -100, left, ahead, true},
      {"right_shoulder", 1, 100, right, ahead, true},
      {"left_shoulder", 1, 100, left, back, false},
      {"left_elbow", 1, -130, left, ahead, true},
      {"right_elbow", 1, 130, right, ahead, true},
      {"left_elbow", 1, 40, left, back, false},
      {"right_elbow", 1, -40, right, back, false},
      {"left_wrist", 2, -70, left, down, true},
      {"head", 0, 35, up, ahead, true},
      {"left_ankle", 0, 45, ahead, down, true},
  };
  for (const Movement& m : movements) {
    INFO(m.joint << " by " << m.degrees << " about axis " << m.axis);
    Vector3<double> w = Vector3<double>::Zero();
    w[m.axis] = m.degrees * kDegree;
    CHECK(m.towards.dot(so3_exp(w) * m.limb) > 0.3);
    Numbers pose(63, 0.0);
    for (int i = 0; i < 3; ++i) pose[static_cast<std::size_t>(3 * (smplx_joint(m.joint) - 1) + i)] = w[i];
    CHECK((excess_of(pose) == 0) == m.is_possible);
  }
}

TEST_CASE("a rotation is taken apart into twist and swing") {
  RandomNumbers random(8);
  for (int axis = 0; axis < 3; ++axis) {
    for (int n = 0; n < 200; ++n) {
      Vector3<double> swing(random(), random(), random()), twist = Vector3<double>::Zero();
      swing[axis] = 0;
      swing *= random(0, 3.1) / swing.norm();
      twist[axis] = random(-3.1, 3.1);
      const Vector3<double> angles = twist_and_swing(so3_exp(swing) * so3_exp(twist), axis);
      CHECK(angles[axis] == Approx(twist[axis]).margin(1e-9));
      for (const int other : {(axis + 1) % 3, (axis + 2) % 3})
        CHECK(angles[other] == Approx(swing[other]).margin(1e-9));
    }
    Vector3<double> half = Vector3<double>::Zero();
    half[(axis + 1) % 3] = std::numbers::pi;
    CHECK(std::abs(twist_and_swing(so3_exp(half), axis)[(axis + 1) % 3]) == Approx(std::numbers::pi).margin(1e-9));
  }
}

TEST_CASE("excess beyond ranges passes the operator checks, within them, beyond them, at small swings", "[parallel]") {
  RandomNumbers random(9);
  const auto check = [](const char* name, const Numbers& axis_angle) {
    const auto rows = static_cast<Index>(axis_angle.size() / 3);
    check_operator(name, {{"rotations", shape_of(rows, 9), 0, 0, matrices_of(axis_angle)}},
                   [](const auto& in) { return joint_limit_excess(in[0]); });
  };
  check("some beyond", random.numbers(3 * 63, 1.5));
  Numbers twists = random.numbers(63, 1e-3);  // small swings beside twists that are too large: the series
  for (std::size_t j = 0; j < 21; ++j) twists[3 * j + static_cast<std::size_t>(natural_joints()[j].twist_axis)] = 1.9;
  check("twists", twists);
  for (double& x : twists) x = std::abs(x) < 1 ? 0 : x;
  check("pure twists", twists);
}

// Row D7: joints turned by up to 2π.
TEST_CASE("excess beyond ranges is finite everywhere, at half turns too") {
  Numbers pose;
  for (int j = 0; j < 21; ++j) {
    Vector3<double> w = Vector3<double>::Zero();
    w[j % 3] = std::numbers::pi * (j % 2 == 0 ? 1 : -1);
    pose.insert(pose.end(), {w[0], w[1], w[2]});
  }
  for (const double turn : {1.0, 2.0}) {
    Tape<double> tape;
    const auto x = tape.parameter("pose", shape_of(21, 3));
    Numbers scaled = pose;
    for (double& v : scaled) v *= turn;
    tape.set(x, scaled);
    const auto energy = joint_limit_energy(rotations_from_axis_angle(x));
    tape.forward(energy);
    tape.backward(energy);
    CHECK(std::isfinite(tape.value(energy).scalar()));
    for (const double d : numbers_of(tape.gradient(x))) CHECK(std::isfinite(d));
  }
}

namespace {

/// Energy of latents and its gradient by them.
template <class S>
std::pair<double, Numbers> energy_of(const PosePrior& prior, const Numbers& latents) {
  Tape<S> tape;
  const Var<S> z = tape.parameter("z", shape_of(1, prior.latents()));
  tape.set(z, std::vector<S>(latents.begin(), latents.end()));
  const Var<S> energy = prior.energy(z);
  tape.forward(energy);
  tape.backward(energy);
  return {static_cast<double>(tape.value(energy).scalar()), numbers_of(tape.gradient(z))};
}

}  // namespace

// Row D8: a mixture's likelihood would underflow, a normal distribution's logarithm does not.
TEMPLATE_TEST_CASE("however unlikely a pose is, its energy is finite and leads back to the likely ones", "", float,
                   double) {
  const PosePrior vposer = vposer_prior(random_vposer(24, 6, 5).weights()), natural = natural_pose_prior();
  RandomNumbers random(10);
  for (const PosePrior* prior : {&vposer, &natural}) {
    for (const double far : {1.0, 30.0, 1e3, 1e6}) {
      INFO(prior->name() << ", latents of " << far);
      const Numbers z = random.numbers(static_cast<std::size_t>(prior->latents()), far);
      const auto [energy, gradient] = energy_of<TestType>(*prior, z);
      double squares = 0;
      for (std::size_t i = 0; i < z.size(); ++i) {
        squares += z[i] * z[i];
        CHECK(gradient[i] == Approx(2 * z[i]).epsilon(1e-6));
      }
      CHECK(energy == Approx(squares).epsilon(1e-5));
    }
  }
  // Poses turned by nearly half a turn, and by more, from what is natural.
  for (const double turn : {3.0, 3.14, 4.5, 6.28}) {
    INFO("turned by " << turn);
    Numbers pose(63, 0.0);
    for (std::size_t j = 0; j < 21; ++j) pose[3 * j + j % 3] = turn;
    for (const PosePrior* prior : {&vposer, &natural}) {
      Tape<TestType> tape;
      const auto x = tape.parameter("pose", shape_of(21, 3));
      tape.set(x, std::vector<TestType>(pose.begin(), pose.end()));
      const auto energy = prior->energy(prior->encode(rotations_from_axis_angle(x)));
      tape.forward(energy);
      tape.backward(energy);
      CHECK(std::isfinite(tape.value(energy).scalar()));
      for (const double d : numbers_of(tape.gradient(x))) CHECK(std::isfinite(d));
    }
  }
}

TEST_CASE("descent on the excess leads into the ranges") {
  Numbers pose(63, 0.0);
  pose[9] = -1.2;        // left knee
  pose[3 * 17 + 1] = 1;  // left elbow
  pose[3 * 14] = 1.6;    // head
  Tape<double> tape;
  const auto x = tape.parameter("pose", shape_of(21, 3));
  tape.set(x, pose);
  const auto energy = joint_limit_energy(rotations_from_axis_angle(x));
  for (int i = 0; i < 60; ++i) {
    tape.forward(energy);
    tape.backward(energy);
    const Numbers d = numbers_of(tape.gradient(x));
    for (std::size_t k = 0; k < 63; ++k) tape.write(x).data[k] -= 0.2 * d[k];
  }
  tape.forward(energy);
  CHECK(tape.value(energy).scalar() < 1e-6);
}

}  // namespace pose_prior_test
