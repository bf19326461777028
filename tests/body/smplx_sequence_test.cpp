#include "body/smplx_sequence.h"

#include <cmath>
#include <functional>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "tests/support/smplx_reference.h"

namespace smplx_sequence_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

SmplxSequence decoded(const std::function<void(NpzWriter&)>& add) {
  NpzWriter file;
  add(file);
  return decode_smplx_sequence(file.encode(), "p.npz");
}

std::string message_for(const std::function<void(NpzWriter&)>& add) {
  try {
    decoded(add);
  } catch (const DataError& error) {
    return error.what();
  }
  return "accepted";
}

Numbers part(const Numbers& numbers, std::size_t first, std::size_t count) {
  return {numbers.begin() + static_cast<std::ptrdiff_t>(first),
          numbers.begin() + static_cast<std::ptrdiff_t>(first + count)};
}

template <class S>
double largest_difference(const std::vector<S>& a, const Numbers& b, std::size_t frame) {
  double largest = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    const double difference = std::abs(static_cast<double>(a[frame * b.size() + i]) - b[i]);
    largest = difference <= largest ? largest : difference;  // NaN stays
  }
  return largest;
}

}  // namespace

TEST_CASE("parameters are read by frame, or once for all frames") {
  const SmplxSequence s = decoded([](NpzWriter& f) {
    f.add<float>("betas", {1, 4}, {1, 2, 3, 4});
    f.add<double>("transl", {2, 3}, {1, 2, 3, 4, 5, 6});
    f.add<double>("body_pose", {2, 21, 3}, Numbers(126, 0.5));
    f.add<double>("jaw_pose", {3}, {7, 8, 9});
    f.add<double>("left_hand_pose", {2, 6}, Numbers(12, 0.25));
    f.add<double>("right_hand_pose", {2, 15, 3}, Numbers(90, 0.25));
    f.add_text("gender", "female");
    f.add<double>("vertices", {1}, {0});
  });
  CHECK(s.frames == 2);
  CHECK(s.betas.width == 4);
  CHECK(s.betas.at(1)[3] == 4);
  CHECK(s.transl.at(1)[0] == 4);
  CHECK(s.body_pose.width == 63);
  CHECK(s.jaw_pose.at(1)[2] == 9);
  CHECK(s.left_hand_pose.width == 6);
  CHECK(s.right_hand_pose.width == 45);
  CHECK_FALSE(s.global_orient.is_given());
  CHECK(s.passed_over == std::vector<std::string>{"vertices"});
  CHECK(decoded([](NpzWriter& f) { f.add<double>("betas", {10}, Numbers(10, 1)); }).frames == 1);
  const auto hands_of = [](std::int64_t frames) {
    return decoded([frames](NpzWriter& f) {
      f.add<double>("body_pose", {21, 3}, Numbers(63, 0.5));
      f.add<double>("transl", {frames, 3}, Numbers(static_cast<std::size_t>(3 * frames)));
      f.add<double>("left_hand_pose", {15, 3}, Numbers(45, 0.25));
    });
  };
  CHECK(hands_of(1).body_pose.rows == 1);
  CHECK(hands_of(1).left_hand_pose.width == 45);
  CHECK(hands_of(2).left_hand_pose.rows == 1);
  CHECK(hands_of(15).left_hand_pose.width == 3);
  CHECK(hands_of(15).frames == 15);
}

TEST_CASE("faults of parameters are named") {
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("body_pose", {2, 60}, Numbers(120));
        }) == "p.npz: array 'body_pose': has shape [2,60]; allowed: [63], [T,63], [21,3], [T,21,3]");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("body_pose", {3, 21}, Numbers(63));
        }) == "p.npz: array 'body_pose': has shape [3,21]; allowed: [63], [T,63], [21,3], [T,21,3]");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("left_hand_pose", {2, 46}, Numbers(92));
        }) ==
        "p.npz: array 'left_hand_pose': has shape [2,46]; allowed: [n], [T,n] with n of 1 to 45, [15,3], [T,15,3]");
  CHECK(message_for([](NpzWriter& f) { f.add_scalar("transl", 1.0); }) ==
        "p.npz: array 'transl': has shape []; allowed: [3], [T,3]");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("transl", {0, 3}, {});
        }) == "p.npz: array 'transl': holds no frame");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("transl", {3, 3}, Numbers(9));
          f.add<double>("body_pose", {2, 63}, Numbers(126));
        }) == "p.npz: array 'transl': has 3 frames; 'body_pose' has 2; allowed: the same, or 1");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("transl", {2, 3}, {0, 0, 0, 0, 0, std::numeric_limits<double>::quiet_NaN()});
        }) == "p.npz: array 'transl': frame 1, number 2 is nan; allowed: -1e6 to 1e6");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("betas", {2}, {0, 11});
        }) == "p.npz: array 'betas': frame 0, number 1 is 11; allowed: -10 to 10");
  CHECK(message_for([](NpzWriter& f) { f.add<double>("betas", {301}, Numbers(301)); }) ==
        "p.npz: array 'betas': has shape [301]; allowed: [n], [T,n] with n of 1 to 300");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("poses", {2, 3}, Numbers(6));
        }) ==
        "p.npz: holds a motion by the names of AMASS, not parameters by those of smplx; `hsi4d motion` reads it, and "
        "with --body-model shows the body (.glb)");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("v_template", {2, 3}, Numbers(6));
        }) == "p.npz: holds a body model, not parameters of smplx");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("numbers", {2, 3}, Numbers(6));
        }) ==
        "p.npz: holds none of the parameters betas, expression, global_orient, body_pose, jaw_pose, leye_pose, "
        "reye_pose, left_hand_pose, right_hand_pose, transl");
  CHECK_THAT(message_for([](NpzWriter& f) {
               f.add<double>("trans", {2, 3}, Numbers(6));
             }),
             Catch::StartsWith("p.npz: there is no parameter \"trans\"; known: ") &&
                 Catch::EndsWith("; did you mean \"transl\"?"));
  CHECK(message_for([](NpzWriter& f) { f.add_text("transl", "here"); }).starts_with("p.npz: array 'transl': "));
  CHECK_THROWS_AS(read_smplx_sequence("nowhere.npz"), UserError);
}

TEST_CASE("every frame agrees with plain loops, hands in full and by components, both precisions") {
  const SmplxArrays arrays = random_smplx({.vertices = 50, .seed = 50});
  constexpr std::size_t kFrames = 3;
  std::vector<SmplxPose> poses;
  for (std::size_t t = 0; t < kFrames; ++t) poses.push_back(random_smplx_pose(10, 10, 51 + t));
  NpzWriter file;
  const auto add = [&](const char* name, std::size_t first, std::size_t count) {
    Numbers numbers;
    for (const SmplxPose& pose : poses) {
      const Numbers of_frame = part(pose.axis_angle, first, count);
      numbers.insert(numbers.end(), of_frame.begin(), of_frame.end());
    }
    file.add<double>(name, {kFrames, static_cast<std::int64_t>(count)}, numbers);
  };
  const Numbers coefficients = {0.3, -0.8};
  for (SmplxPose& pose : poses) {
    pose.betas = poses[0].betas;
    pose.transl = poses[1].transl;
    // The right hand by two components, to which the model adds its mean; the left in full, without it.
    for (std::size_t i = 0; i < 45; ++i) {
      double& x = pose.axis_angle[120 + i];
      x = arrays.hand_means[1][i];
      for (std::size_t k = 0; k < 2; ++k) x += coefficients[k] * arrays.hand_components[1][45 * k + i];
    }
  }
  file.add<double>("betas", {10}, poses[0].betas);
  Numbers expression;
  for (const SmplxPose& pose : poses)
    expression.insert(expression.end(), pose.expression.begin(), pose.expression.end());
  file.add<double>("expression", {kFrames, 10}, expression);
  add("global_orient", 0, 3);
  add("body_pose", 3, 63);
  add("jaw_pose", 66, 3);
  add("leye_pose", 69, 3);
  add("reye_pose", 72, 3);
  add("left_hand_pose", 75, 45);
  file.add<double>("right_hand_pose", {1, 2}, coefficients);
  file.add<double>("transl", {1, 3}, {poses[1].transl.begin(), poses[1].transl.end()});
  const SmplxSequence sequence = decode_smplx_sequence(file.encode(), "p.npz");
  const SmplxModel model = decode_smplx(smplx_writer(arrays).encode(), "body.npz");
  const SmplxFrames<double> exact = pose_frames<double>(model, sequence);
  const SmplxFrames<float> fast = pose_frames<float>(model, sequence);
  for (std::size_t t = 0; t < kFrames; ++t) {
    SmplxPose pose = poses[t];
    for (std::size_t i = 0; i < 45; ++i) pose.axis_angle[75 + i] += arrays.hand_means[0][i];
    const SmplxResult expected = reference_smplx(arrays, pose);
    CHECK(largest_difference(exact.vertices, expected.vertices, t) <= 1e-9);
    CHECK(largest_difference(exact.joints, expected.joints, t) <= 1e-9);
    CHECK(largest_difference(fast.vertices, expected.vertices, t) <= 1e-5);
    CHECK(largest_difference(fast.joints, expected.joints, t) <= 1e-5);
  }
  // Flat hands: the same numbers without the mean.
  SmplxPose flat = poses[2];
  for (std::size_t i = 0; i < 45; ++i) flat.axis_angle[120 + i] -= arrays.hand_means[1][i];
  const SmplxFrames<double> without = pose_frames<double>(model, sequence, SmplxHands::kByWidth, true);
  CHECK(largest_difference(without.vertices, reference_smplx(arrays, flat).vertices, 2) <= 1e-9);

  CHECK_THROWS_WITH(pose_frames<double>(model, sequence, SmplxHands::kFull),
                    "p.npz: array 'right_hand_pose': has 2 numbers a frame; of a full hand 45 are needed");
  SmplxModel few = model;
  few.hands[1].components.resize(45);
  CHECK_THROWS_WITH(
      pose_frames<double>(few, sequence),
      "p.npz: array 'right_hand_pose': has 2 coefficients a frame; body.npz has 1 components of that hand");
}

TEST_CASE("45 numbers of a hand are coefficients where one says so") {
  const SmplxArrays arrays = random_smplx({.vertices = 30, .seed = 60});
  const SmplxModel model = decode_smplx(smplx_writer(arrays).encode(), "body.npz", {.betas = 0, .expressions = 0});
  SmplxPose pose = random_smplx_pose(0, 0, 61);
  const Numbers coefficients = part(pose.axis_angle, 0, 45);
  pose.axis_angle.assign(165, 0.0);
  pose.transl = {};
  for (std::size_t side = 0; side < 2; ++side) {
    for (std::size_t i = 0; i < 45; ++i) {
      double& x = pose.axis_angle[75 + 45 * side + i];
      x = arrays.hand_means[side][i];
      for (std::size_t k = 0; side == 0 && k < 45; ++k) x += coefficients[k] * arrays.hand_components[0][45 * k + i];
    }
  }
  const SmplxSequence sequence = decoded([&](NpzWriter& f) { f.add<double>("left_hand_pose", {45}, coefficients); });
  const SmplxFrames<double> posed = pose_frames<double>(model, sequence, SmplxHands::kPca);
  CHECK(largest_difference(posed.vertices, reference_smplx(arrays, pose).vertices, 0) <= 1e-9);
}

}  // namespace smplx_sequence_test
