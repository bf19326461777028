// Public protocols end to end: what evaluate() reports against plain measurements of the same joints and points.
#include "pipelines/evaluate/protocols.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "body/motion_edit.h"
#include "body/motion_io.h"
#include "core/check.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "core/text.h"
#include "optim/protocols/world_motion_metrics.h"
#include "pipelines/evaluate/evaluation.h"
#include "pipelines/metrics/penetration.h"
#include "tests/optim/protocols/protocol_reference.h"
#include "tests/optim/solid/meshes.h"
#include "tests/support/procedural_file.h"
#include "tests/support/random_numbers.h"
#include "tests/support/temporary_folder.h"

namespace protocols_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

using Point = Vector3<double>;

constexpr double kRight = std::numbers::pi / 2;

/// Walks, z up, with steps and a turn, and trembles.
Motion walking(std::size_t frames, double frame_rate, std::uint64_t seed, double noise) {
  RandomNumbers random(seed);
  Motion motion;
  motion.frame_rate = frame_rate;
  for (std::size_t t = 0; t < frames; ++t) {
    const double s = static_cast<double>(t) / frame_rate;
    BodyPose pose = rest_pose(kSmplxJoints);
    pose.set_rotation(0, so3_log(Matrix3<double>(so3_exp(Point(0, 0, 0.3 * s)) * so3_exp(Point(kRight, 0, 0)))));
    for (const Index leg : {1, 2}) pose.set_rotation(leg, Point(0.4 * std::sin(6 * s + (leg == 1 ? 0 : 3)), 0, 0));
    for (const Index joint : {3, 4, 5, 7, 8, 16, 17})
      pose.set_rotation(joint, Point(noise * random(), noise * random(), noise * random()));
    pose.transl = {0.2 * s + noise * random(), 0.1 * std::sin(s), 1.2 + noise * random()};
    motion.poses.push_back(pose);
  }
  return motion;
}

/// A motion's file by SMPL-X's names with more arrays.
void write_with_mask(const std::string& path, const Motion& motion, const std::vector<double>& mask,
                     const std::vector<std::int64_t>& shape) {
  NpzWriter file;
  const auto frames = std::ssize(motion.poses);
  std::vector<double> poses, trans;
  for (const BodyPose& pose : motion.poses) {
    poses.insert(poses.end(), pose.axis_angle.begin(), pose.axis_angle.end());
    trans.insert(trans.end(), pose.transl.data(), pose.transl.data() + 3);
  }
  file.add<double>("poses", {frames, 165}, poses);
  file.add<double>("trans", {frames, 3}, trans);
  file.add_scalar("mocap_frame_rate", motion.frame_rate);
  file.add<double>("good_frames_mask", shape, mask);
  file.write(path);
}

double value(const Evaluation& evaluation, const char* name) {
  INFO(name);
  const double* const found = find_metric(evaluation.values, name);
  REQUIRE(found != nullptr);
  return *found;
}

PlainFrames counted_joints(const Evaluation& evaluation) {
  PlainFrames frames;
  for (const std::vector<double>& joints : evaluation.joints) {
    frames.push_back(plain_of(joints));
    frames.back().resize(22);
  }
  return frames;
}

PlainPoints way_of(const PlainFrames& frames) {
  PlainPoints way;
  for (const PlainPoints& frame : frames) way.push_back(frame[0]);
  return way;
}

PlainFrames chosen(const PlainFrames& frames, const std::vector<double>& mask) {
  PlainFrames some;
  for (std::size_t t = 0; t < frames.size(); ++t) {
    if (mask[t] == 1) some.push_back(frames[t]);
  }
  return some;
}

/// Points of a body in every pose of a motion.
PlainFrames points_of(const std::string& model, const Motion& motion, const std::vector<Index>& rows) {
  Track track;
  track.name = "the test's";
  track.motion = motion;
  const EvaluatedBody body = EvaluatedBody::of_model(model, track);
  std::vector<SceneState> states;
  for (const BodyPose& pose : track.motion.poses) {
    SceneState state;
    state.body = pose;
    states.push_back(state);
  }
  PlainFrames frames;
  for (const std::vector<double>& all : body.points(states)) {
    const PlainPoints points = plain_of(all);
    PlainPoints some;
    for (const Index row : rows) some.push_back(points[static_cast<std::size_t>(row)]);
    frames.push_back(rows.empty() ? points : some);
  }
  return frames;
}

void check_close(double number, double wanted) { CHECK(std::fabs(number - wanted) <= 1e-9); }

/// The error of a refusal.
std::string refused(const EvaluationSettings& settings, const std::string& input) {
  try {
    evaluate(settings, input, "");
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

const std::vector<Index> kSomePoints = {100, 900, 1500, 2000};

}  // namespace

TEST_CASE("the protocol of EMDB-2 and RICH is measured of all frames of body and truth") {
  const TemporaryFolder here;
  procedural_file().write("body.npz");
  const Motion truth = walking(130, 30, 1, 0.002), estimate = walking(130, 30, 2, 0.05);
  write_motion("truth.npz", truth);
  write_motion("m.npz", transformed(estimate, {so3_exp(Point(0, 0, 2)), {5, -8, 0.3}}, kSmplxPelvis));
  EvaluationSettings settings;
  settings.truth = "truth.npz";
  settings.body_model = "body.npz";
  settings.protocol = Protocol::kEmdb2;
  settings.foot_points = kSomePoints;
  const Evaluation result = evaluate(settings, "m.npz", "");
  CHECK(result.protocol == "emdb2");
  const PlainFrames own = counted_joints(result), its = counted_joints(evaluate(settings, "truth.npz", ""));
  REQUIRE(own.size() == 130);
  check_close(value(result, "wa_mpjpe_100_mm"), 1000 * plain_mean(plain_piece_errors(own, its, 100, 100)));
  check_close(value(result, "w_mpjpe_100_mm"), 1000 * plain_mean(plain_piece_errors(own, its, 100, 2)));
  check_close(value(result, "rte_percent"), plain_mean(plain_way_errors(way_of(own), way_of(its))));
  CHECK(value(result, "protocol_jitter") == Approx(plain_jitter(own, 30)).epsilon(1e-11));
  CHECK(value(result, "protocol_jitter") == Approx(value(result, "jitter") / 10).epsilon(1e-11));
  const PlainFrames feet = points_of("body.npz", read_motion("m.npz"), kSomePoints),
                    true_feet = points_of("body.npz", truth, kSomePoints);
  check_close(value(result, "foot_point_sliding_mm"), 1000 * plain_mean(plain_standing_steps(feet, true_feet)));
  CHECK_THAT(joined(result.notes, "; "), Contains("protocol emdb2: 130 frames in pieces of 100, 22 joints") &&
                                             !Contains("the protocol is for 30") && !Contains("feet slide by"));
  settings.protocol = Protocol::kRich;
  const Evaluation rich = evaluate(settings, "m.npz", "");
  CHECK(rich.values == result.values);
  CHECK(rich.protocol == "rich");
  settings.protocol = Protocol::kNone;
  const Evaluation plain = evaluate(settings, "m.npz", "");
  CHECK(plain.protocol.empty());
  CHECK(plain.values.size() + 5 == result.values.size());

  SECTION("at another rate its pieces are told to be of frames") {
    settings.protocol = Protocol::kEmdb2;
    settings.frame_rate = 10;
    const Evaluation slow = evaluate(settings, "m.npz", "");
    const PlainFrames slower = counted_joints(slow);
    REQUIRE(slower.size() == 44);
    CHECK(value(slow, "protocol_jitter") == Approx(plain_jitter(slower, 10)).epsilon(1e-11));
    CHECK_THAT(joined(slow.notes, "; "), Contains("the protocol is for 30 frames a second, this is at 10"));
  }
  SECTION("two frames have no jitter, and a truth that stands no way") {
    Motion still = truth;
    still.poses.resize(2);
    still.poses[1] = still.poses[0];
    write_motion("still.npz", still);
    settings.truth = "still.npz";
    settings.protocol = Protocol::kRich;
    const Evaluation two = evaluate(settings, "m.npz", "");
    for (const char* const name : {"rte_percent", "protocol_jitter"}) CHECK(find_metric(two.values, name) == nullptr);
    for (const char* const name : {"w_mpjpe_100_mm", "wa_mpjpe_100_mm", "foot_point_sliding_mm"})
      CHECK(find_metric(two.values, name) != nullptr);
  }
}

TEST_CASE("frames that are not good ones are left out and the others joined") {
  const TemporaryFolder here;
  procedural_file().write("body.npz");
  const Motion truth = walking(24, 30, 1, 0.002);
  write_motion("m.npz", walking(24, 30, 2, 0.05));
  std::vector<double> mask(24, 1);
  for (const std::size_t bad : {0, 5, 6, 13, 23}) mask[bad] = 0;
  write_with_mask("truth.npz", truth, mask, {24});
  EvaluationSettings settings;
  settings.truth = "truth.npz";
  settings.body_model = "body.npz";
  settings.protocol = Protocol::kEmdb2;
  settings.foot_points = kSomePoints;
  const Evaluation result = evaluate(settings, "m.npz", "");
  const PlainFrames own = chosen(counted_joints(result), mask),
                    its = chosen(counted_joints(evaluate(settings, "truth.npz", "")), mask);
  REQUIRE(own.size() == 19);
  check_close(value(result, "w_mpjpe_100_mm"), 1000 * plain_mean(plain_piece_errors(own, its, 100, 2)));
  check_close(value(result, "rte_percent"), plain_mean(plain_way_errors(way_of(own), way_of(its))));
  CHECK(value(result, "protocol_jitter") == Approx(plain_jitter(own, 30)).epsilon(1e-11));
  CHECK_THAT(joined(result.notes, "; "), Contains("protocol emdb2: 5 of 24 frames are not good ones and are left out"));
  // Other metrics look at all frames.
  settings.protocol = Protocol::kNone;
  const double all = value(evaluate(settings, "m.npz", ""), "mpjpe_mm");
  write_motion("plain.npz", truth);
  settings.truth = "plain.npz";
  CHECK(all == value(evaluate(settings, "m.npz", ""), "mpjpe_mm"));
  // Between two frames both must be good.
  settings.protocol = Protocol::kEmdb2;
  settings.truth = "truth.npz";
  settings.frame_rate = 20;
  CHECK_THAT(joined(evaluate(settings, "m.npz", "").notes, "; "), Contains("5 of 16 frames are not good ones"));

  settings.frame_rate = {};
  write_with_mask("truth.npz", truth, std::vector<double>(24, 0), {24});
  CHECK(refused(settings, "m.npz") == "hsi4d evaluate: --protocol: no frame of the truth is a good one");
  mask[3] = 2;
  write_with_mask("truth.npz", truth, mask, {24});
  CHECK(refused(settings, "m.npz") == "truth.npz: array 'good_frames_mask': frame 3 is 2; allowed: 0 and 1");
  write_with_mask("truth.npz", truth, std::vector<double>(23, 1), {23});
  CHECK(refused(settings, "m.npz") == "truth.npz: array 'good_frames_mask': has shape [23]; [24] is needed");
}

TEST_CASE("the feet of a body are its foremost and hindmost points, of SMPL-X its toes and heels") {
  const TemporaryFolder here;
  procedural_file().write("body.npz");
  Track track;
  track.motion = walking(2, 30, 1, 0);
  const EvaluatedBody body = EvaluatedBody::of_model("body.npz", track);
  const BodyModel rest = procedural_body();
  const FootPoints feet = body.foot_points();
  const auto place = [&rest](Index row) { return Vector3<float>(rest.vertices.data() + 3 * row); };
  for (const std::size_t side : {0U, 1U}) {
    const Vector3<float> toe = place(feet.rows[2 * side]), heel = place(feet.rows[2 * side + 1]);
    CHECK(toe[2] - heel[2] > 0.18F);  // metres, forward
    for (const Vector3<float>& one : {toe, heel}) {
      CHECK((side == 0 ? one[0] : -one[0]) > 0.02F);
      CHECK(one[1] < -1.1F);  // low
    }
  }
  CHECK(feet.words == "the foremost and hindmost points of its feet");

  SmplxArrays large = random_smplx({.vertices = kSmplxVertices, .correctives = false});
  smplx_writer(large).write("large.npz");
  track.motion = walking(2, 30, 1, 0);
  const EvaluatedBody smplx = EvaluatedBody::of_model("large.npz", track);
  CHECK(smplx.foot_points().rows == kSmplxFeet);
  CHECK(smplx.point_count() == kSmplxVertices);
  CHECK(smplx.faces().size() == large.f.size() / 3);

  // No point follows a foot.
  SmplxArrays footless = random_smplx({.vertices = 40, .correctives = false});
  for (std::int64_t vertex = 0; vertex < 40; ++vertex) {
    for (std::int64_t joint = 0; joint < 55; ++joint)
      footless.weights[static_cast<std::size_t>(55 * vertex + joint)] = joint == 0 ? 1 : 0;
  }
  smplx_writer(footless).write("footless.npz");
  write_motion("m.npz", walking(3, 30, 1, 0));
  EvaluationSettings settings;
  settings.truth = "m.npz";
  settings.body_model = "footless.npz";
  settings.protocol = Protocol::kRich;
  CHECK(refused(settings, "m.npz") ==
        "hsi4d evaluate: --protocol: no point of the body follows its left foot; --foot-points names four");
  settings.foot_points = {0, 1, 2, 40};
  CHECK(refused(settings, "m.npz") == "hsi4d evaluate: --foot-points: there is no point 40; the body has 0 to 39");
}

TEST_CASE("human and object are measured as on BEHAVE and InterCap") {
  const TemporaryFolder here;
  procedural_file().write("body.npz");
  const TriangleMesh box = box_mesh({-0.2, -0.3, -0.1}, {0.4, 0.3, 0.5});
  write_mesh("box.ply", box);
  const auto scene = [&](const char* path, std::uint64_t seed, double noise) {
    const Motion motion = walking(7, 30, seed, noise);
    RandomNumbers random(seed);
    NpzWriter file;
    std::vector<double> poses, trans, turns, places;
    std::vector<Rigid<double>> objects;
    for (const BodyPose& pose : motion.poses) {
      poses.insert(poses.end(), pose.axis_angle.begin(), pose.axis_angle.end());
      trans.insert(trans.end(), pose.transl.data(), pose.transl.data() + 3);
      const Point turn(noise * random(), 0.4, noise * random()), place = pose.transl + Point(0.4, noise * random(), 0);
      objects.push_back({so3_exp(turn), place});
      turns.insert(turns.end(), turn.data(), turn.data() + 3);
      places.insert(places.end(), place.data(), place.data() + 3);
    }
    file.add<double>("poses", {7, 165}, poses);
    file.add<double>("trans", {7, 3}, trans);
    file.add_scalar("mocap_frame_rate", 30.0);
    file.add<double>("box/rotation", {7, 3}, turns);
    file.add<double>("box/translation", {7, 3}, places);
    file.write(path);
    const Point middle(0.1, 0, 0.2);
    std::array<PlainFrames, 2> sides = {points_of("body.npz", motion, {}), PlainFrames()};
    for (const Rigid<double>& pose : objects) {
      PlainPoints corners;
      for (const Point& vertex : box.vertices) {
        const Point there = transform_point(pose, Point(vertex - middle));
        corners.push_back({there[0], there[1], there[2]});
      }
      sides[1].push_back(corners);
    }
    return sides;
  };
  const auto truth = scene("truth.npz", 1, 0.01), estimate = scene("m.npz", 2, 0.08);
  EvaluationSettings settings;
  settings.truth = "truth.npz";
  settings.body_model = "body.npz";
  settings.object_surfaces = {{"box", "box.ply"}};
  settings.protocol = Protocol::kBehave;
  settings.aligned_frames = 4;
  const Evaluation result = evaluate(settings, "m.npz", "");
  const auto laid = plain_laid(estimate, truth, 4);
  check_close(value(result, "acceleration_human_cm"), 100 * plain_acceleration(laid[0], truth[0], 4));
  check_close(value(result, "acceleration_object_cm"), 100 * plain_acceleration(laid[1], truth[1], 4));
  // Surfaces, by points that are drawn from them.
  const auto mean_distance = [&](std::size_t side) {
    std::vector<double> distances;
    for (std::size_t t = 0; t < 7; ++t) {
      for (std::size_t p = 0; p < laid[side][t].size(); ++p)
        distances.push_back(plain_distance(laid[side][t][p], truth[side][t][p]));
    }
    return 100 * plain_mean(distances);
  };
  CHECK(value(result, "cd_human_cm") > 0.5);
  CHECK(value(result, "cd_human_cm") < 2 * mean_distance(0) + 2);
  CHECK(value(result, "cd_object_cm") < 2 * mean_distance(1) + 2);
  CHECK(value(result, "cd_both_cm") < value(result, "cd_human_cm") + value(result, "cd_object_cm"));
  CHECK_THAT(joined(result.notes, "; "),
             Contains("protocol behave: the human by 10000 points drawn from the surface of ") &&
                 Contains(", objects by 10000 points drawn from the surface of 8 vertices (the mesh box.ply), 4 frames "
                          "laid on the truth together"));
  settings.protocol = Protocol::kInterCap;
  CHECK(evaluate(settings, "m.npz", "").values == result.values);
  const Evaluation same = evaluate(settings, "truth.npz", "");
  CHECK(value(same, "acceleration_object_cm") == Approx(0).margin(1e-9));
  CHECK(value(same, "cd_human_cm") < 2);  // how far drawn points are apart
  CHECK(value(same, "cd_human_cm") > 0.5);

  SECTION("what a protocol lacks is told") {
    settings.object_surfaces.clear();
    CHECK(refused(settings, "m.npz") ==
          "hsi4d evaluate: --protocol: the shape of box is not known; --object-surface box=F or --data says it");
    settings.object_surfaces = {{"box", "box.ply"}};
    settings.truth.clear();
    CHECK(refused(settings, "m.npz") ==
          "hsi4d evaluate: --protocol: m.npz: there is no truth to compare with; --truth names one");
    write_motion("alone.npz", walking(7, 30, 3, 0));
    settings.truth = "alone.npz";
    CHECK(
        refused(settings, "m.npz") ==
        "hsi4d evaluate: --protocol: m.npz: estimate and truth have no object in common, which the protocol measures");
    settings.truth = "truth.npz";
    smplx_writer(random_smplx({.vertices = 60, .correctives = false})).write("other.npz");
    settings.truth_body_model = "other.npz";
    CHECK_THAT(refused(settings, "m.npz"), Contains("--truth-body-model: has 60 vertices, --body-model "));
  }
  SECTION("the truth has its own body where one is named") {
    procedural_file(Point(0, 0, 0)).write("same.npz");
    settings.truth_body_model = "same.npz";
    CHECK(value(evaluate(settings, "m.npz", ""), "acceleration_human_cm") ==
          Approx(value(result, "acceleration_human_cm")).margin(1e-9));
  }
}

}  // namespace protocols_test
