#include "body/motion_io.h"

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include <catch2/catch.hpp>

#include "body/body_model.h"
#include "body/pose_layout.h"
#include "core/npz.h"
#include "core/random.h"
#include "stress/scratch_folder.h"
#include "tests/support/zip_archive.h"

namespace motion_io_test {

using namespace hsi4d;
using test::ZipMember, test::archive_of, test::pickled_npy;

namespace {

using Numbers = std::vector<double>;

Motion random_motion(std::size_t frames, std::uint64_t seed) {
  RandomSequence random(seed);
  Motion motion{29.97, {}};
  for (std::size_t t = 0; t < frames; ++t) {
    BodyPose pose = rest_pose(55);
    for (double& x : pose.axis_angle) x = random.normal();
    pose.transl = {random.normal(), random.normal(), random.normal()};
    motion.poses.push_back(pose);
  }
  return motion;
}

/// Numbers 1, 2, 3, … [frames, width].
Numbers counted(std::size_t frames, std::size_t width) {
  Numbers numbers(frames * width);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<double>(i + 1);
  return numbers;
}

/// As counted, in steps that a body's joints may be turned by, radians.
constexpr double kTurn = 1.0 / 256;
Numbers turns(std::size_t frames, std::size_t width) {
  Numbers numbers = counted(frames, width);
  for (double& x : numbers) x *= kTurn;
  return numbers;
}

Motion decoded(const std::function<void(NpzWriter&)>& add) {
  NpzWriter file;
  add(file);
  return decode_motion(file.encode(), "m.npz");
}

std::string message_for(const std::function<void(NpzWriter&)>& add) {
  try {
    decoded(add);
  } catch (const DataError& error) {
    return error.what();
  }
  return "accepted";
}

double angle(const Motion& motion, std::size_t frame, const char* joint, int i) {
  return motion.poses[frame].rotation_of(smplx_joint(joint))[i];
}

}  // namespace

TEST_CASE("motion files round-trip bit for bit") {
  const ScratchFolder folder;
  const Motion motion = random_motion(7, 70);
  write_motion(folder / "m.npz", motion);
  const Motion read = read_motion(folder / "m.npz");
  CHECK(read.frame_rate == motion.frame_rate);
  REQUIRE(read.poses.size() == 7);
  for (std::size_t t = 0; t < 7; ++t) {
    CHECK(std::memcmp(read.poses[t].axis_angle.data(), motion.poses[t].axis_angle.data(), 165 * sizeof(double)) == 0);
    CHECK(read.poses[t].transl == motion.poses[t].transl);
  }
}

TEST_CASE("motion files have the arrays that AMASS has") {
  const ScratchFolder folder;
  const Motion motion = random_motion(3, 71);
  write_motion(folder / "m.npz", motion);
  const Npz file = Npz::read(folder / "m.npz");
  CHECK(file.array("poses").shape() == std::vector<int64_t>{3, 165});
  CHECK(file.array("trans").shape() == std::vector<int64_t>{3, 3});
  CHECK(file.array("betas").as<double>() == Numbers(10, 0.0));
  CHECK(file.array("gender").text() == "neutral");
  CHECK(file.array("surface_model_type").text() == "smplx");
  CHECK(file.array("mocap_frame_rate").scalar<double>() == 29.97);
  CHECK(file.array("mocap_framerate").scalar<double>() == 29.97);
  CHECK(file.array("mocap_time_length").scalar<double>() == 3 / 29.97);
  const std::vector<std::pair<std::string, std::size_t>> parts = {
      {"root_orient", 3}, {"pose_body", 63}, {"pose_jaw", 3}, {"pose_eye", 6}, {"pose_hand", 90}};
  const Numbers poses = file.array("poses").as<double>();
  std::size_t first = 0;
  for (const auto& [name, width] : parts) {
    const Numbers part = file.array(name).require_shape({3, static_cast<int64_t>(width)}).as<double>();
    for (std::size_t t = 0; t < 3; ++t) {
      for (std::size_t i = 0; i < width; ++i) REQUIRE(part[t * width + i] == poses[165 * t + first + i]);
    }
    first += width;
  }
  CHECK(first == 165);
}

TEST_CASE("poses of SMPL-X, SMPL-H and SMPL are mapped") {
  const auto with_poses = [](std::size_t width) {
    return decoded([width](NpzWriter& f) {
      f.add<double>("trans", {2, 3}, counted(2, 3));
      f.add<double>("poses", {2, static_cast<int64_t>(width)}, turns(2, width));
      f.add_scalar("mocap_framerate", 120.0);
    });
  };
  const Motion x = with_poses(165);
  CHECK(x.frame_rate == 120);
  CHECK(x.poses[1].transl == Vector3<double>(4, 5, 6));
  CHECK(x.poses[0].axis_angle == turns(1, 165));
  const Motion h = with_poses(156);
  CHECK(angle(h, 0, "right_wrist", 2) == 66 * kTurn);
  CHECK(angle(h, 0, "jaw", 0) == 0);
  CHECK(angle(h, 0, "right_eye_smplhf", 2) == 0);
  CHECK(angle(h, 0, "left_index1", 0) == 67 * kTurn);
  CHECK(angle(h, 1, "right_thumb3", 2) == 312 * kTurn);
  const Motion smpl = with_poses(72);
  CHECK(angle(smpl, 0, "right_wrist", 2) == 66 * kTurn);
  CHECK(angle(smpl, 1, "pelvis", 0) == 73 * kTurn);
  CHECK(angle(smpl, 0, "left_index1", 0) == 0);
  CHECK(angle(smpl, 1, "jaw", 1) == 0);
}

TEST_CASE("poses in parts are read, missing parts are zero") {
  const Motion motion = decoded([](NpzWriter& f) {
    f.add<float>("transl", {1, 3}, {1, 2, 3});
    f.add<float>("global_orient", {1, 3}, {4, 5, 6});
    f.add<double>("body_pose", {1, 63}, turns(1, 63));
    f.add<double>("pose_hand", {1, 90}, counted(1, 90));
  });
  CHECK(motion.frame_rate == 10);
  CHECK(motion.poses[0].transl == Vector3<double>(1, 2, 3));
  CHECK(angle(motion, 0, "pelvis", 1) == 5);
  CHECK(angle(motion, 0, "left_hip", 0) == kTurn);
  CHECK(angle(motion, 0, "jaw", 0) == 0);
  CHECK(angle(motion, 0, "left_index1", 0) == 1);
  CHECK(angle(motion, 0, "right_index1", 0) == 46);
}

TEST_CASE("shape and gender go along") {
  const ScratchFolder folder;
  Motion motion = random_motion(2, 72);
  motion.betas = Numbers(16, 0.5);
  motion.gender = "female";
  write_motion(folder / "m.npz", motion);
  const Motion read = read_motion(folder / "m.npz");
  CHECK(read.betas == motion.betas);
  CHECK(read.gender == "female");
  motion.betas = {1, 2};
  write_motion(folder / "m.npz", motion);
  CHECK(read_motion(folder / "m.npz").betas == Numbers{1, 2, 0, 0, 0, 0, 0, 0, 0, 0});
  const auto with_betas = [](std::initializer_list<std::int64_t> shape, const Numbers& numbers) {
    return [=, shape = std::vector<std::int64_t>(shape)](NpzWriter& f) {
      f.add<double>("trans", {2, 3}, counted(2, 3));
      f.add<double>("poses", {2, 165}, turns(2, 165));
      f.add<double>("betas", std::span<const std::int64_t>(shape), std::span<const double>(numbers));
    };
  };
  CHECK(decoded(with_betas({2, 2}, {1, 2, 3, 6})).betas == Numbers{2, 4});
  CHECK(decoded(with_betas({1, 3}, {1, 2, 3})).betas == Numbers{1, 2, 3});
  CHECK(decoded(with_betas({0}, {})).betas.empty());
  CHECK(message_for(with_betas({3, 1}, {1, 2, 3})) ==
        "m.npz: array 'betas': has shape [3,1]; allowed: [B], [1,B], [2,B]");
  CHECK(message_for(with_betas({3}, {1, 0, -10.5})) ==
        "m.npz: array 'betas': frame 0, number 2 is -10.5; allowed: -10 to 10");
  CHECK(message_for(with_betas({301}, Numbers(301))) ==
        "m.npz: array 'betas': has 301 numbers of shape; allowed: at most 300");
  CHECK(message_for(with_betas({2}, {1, INFINITY})) == "m.npz: array 'betas': frame 0, number 1 is not finite");
}

TEST_CASE("faults of motion files are named") {
  const auto trans = [](NpzWriter& f) { f.add<double>("trans", {2, 3}, counted(2, 3)); };
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("poses", {2, 72}, counted(2, 72));
        }) == "m.npz: there is no array 'trans'; there is poses");
  CHECK(message_for([&](NpzWriter& f) { trans(f); }) ==
        "m.npz: there is neither 'poses' nor 'root_orient'; there is trans");
  CHECK(message_for([&](NpzWriter& f) {
          trans(f), f.add<double>("poses", {2, 75}, counted(2, 75));
        }) ==
        "m.npz: array 'poses': has shape [2,75]; allowed: [2,165] (SMPL-X), [2,156] (SMPL-H), [2,72] (SMPL), "
        "[2,69] (SMPL), [2,66] (SMPL)");
  CHECK(message_for([&](NpzWriter& f) {
          trans(f), f.add<double>("poses", {3, 72}, counted(3, 72));
        }) ==
        "m.npz: array 'poses': has shape [3,72]; allowed: [2,165] (SMPL-X), [2,156] (SMPL-H), [2,72] (SMPL), "
        "[2,69] (SMPL), [2,66] (SMPL)");
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("trans", {0, 3}, {});
        }) == "m.npz: array 'trans': holds no frame");
  CHECK(message_for([](NpzWriter& f) { f.add<double>("trans", {6}, counted(2, 3)); }) ==
        "m.npz: array 'trans': has shape [6]; [*,3] is needed");
  CHECK(message_for([&](NpzWriter& f) {
          trans(f);
          f.add<double>("root_orient", {2, 3}, counted(2, 3));
          f.add<double>("pose_body", {2, 62}, counted(2, 62));
        }) == "m.npz: array 'pose_body': has shape [2,62]; [2,63] is needed");
  CHECK(message_for([&](NpzWriter& f) {
          trans(f);
          Numbers poses = counted(2, 72);
          poses[72 + 5] = std::numeric_limits<double>::infinity();
          f.add<double>("poses", {2, 72}, poses);
        }) == "m.npz: array 'poses': frame 1, number 5 is not finite");
  CHECK(message_for([&](NpzWriter& f) { trans(f), f.add_scalar("mocap_frame_rate", 0.0); }) ==
        "m.npz: array 'mocap_frame_rate': is 0 frames a second; allowed: 0.01 to 100000");
  CHECK_THROWS_AS(read_motion("no_such_motion.npz"), UserError);
  const ScratchFolder folder;
  CHECK_THROWS_AS(write_motion(folder / "m.npz", Motion{10, {rest_pose(22)}}), InternalError);
  CHECK_THROWS_AS(write_motion(folder / "m.npz", Motion{10, {}}), InternalError);
  CHECK_THROWS_AS(write_motion(folder / "m.npz", Motion{0, {rest_pose(55)}}), InternalError);
  CHECK(folder.count() == 0);
}

TEST_CASE("eyes and hands are also read as the halves that SMPL-X names") {
  const auto with = [](const std::function<void(NpzWriter&)>& add_more) {
    return [add_more](NpzWriter& f) {
      f.add<double>("transl", {2, 3}, counted(2, 3));
      f.add<double>("global_orient", {2, 3}, counted(2, 3));
      f.add<double>("body_pose", {2, 63}, turns(2, 63));
      add_more(f);
    };
  };
  const auto halves = [](NpzWriter& f) {
    f.add<double>("leye_pose", {2, 3}, {1, 2, 3, 4, 5, 6});
    f.add<double>("reye_pose", {2, 3}, {7, 8, 9, 10, 11, 12});
    f.add<double>("left_hand_pose", {2, 45}, counted(2, 45));
    Numbers right = counted(2, 45);
    for (double& x : right) x += 1000;
    f.add<double>("right_hand_pose", {2, 45}, right);
  };
  const Motion motion = decoded(with(halves));
  for (std::size_t t = 0; t < 2; ++t) {
    const Numbers& pose = motion.poses[t].axis_angle;
    for (std::size_t i = 0; i < 3; ++i) {
      CHECK(pose[66 + i] == 0);  // the jaw
      CHECK(pose[69 + i] == static_cast<double>(3 * t + i + 1));
      CHECK(pose[72 + i] == static_cast<double>(3 * t + i + 7));
    }
    for (std::size_t i = 0; i < 45; ++i) {
      CHECK(pose[75 + i] == static_cast<double>(45 * t + i + 1));
      CHECK(pose[120 + i] == static_cast<double>(45 * t + i + 1001));
    }
  }
  SECTION("one half is enough; the other is zero") {
    const Motion left = decoded(with([](NpzWriter& f) { f.add<double>("left_hand_pose", {2, 45}, counted(2, 45)); }));
    CHECK(left.poses[1].axis_angle[75] == 46);
    CHECK(left.poses[1].axis_angle[120] == 0);
    CHECK(left.poses[1].axis_angle[69] == 0);
  }
  SECTION("a whole part wins") {
    const Motion both = decoded(with([halves](NpzWriter& f) {
      halves(f);
      f.add<double>("pose_hand", {2, 90}, Numbers(180, -1));
      f.add<double>("pose_eye", {2, 6}, Numbers(12, -2));
    }));
    for (std::size_t i = 69; i < 165; ++i) CHECK(both.poses[0].axis_angle[i] == (i < 75 ? -2 : -1));
  }
  SECTION("a half of another shape is refused") {
    const auto narrow = with([](NpzWriter& f) { f.add<double>("right_hand_pose", {2, 6}, counted(2, 6)); });
    CHECK(message_for(narrow) == "m.npz: array 'right_hand_pose': has shape [2,6]; [2,45] is needed");
    const auto infinite = with([](NpzWriter& f) { f.add<double>("reye_pose", {2, 3}, {0, 0, 0, 0, INFINITY, 0}); });
    CHECK(message_for(infinite) == "m.npz: array 'reye_pose': frame 1, number 1 is not finite");
  }
}

namespace {

/// Two frames of a model whose rows have that many numbers, with what else is added.
std::function<void(NpzWriter&)> rows_of(std::size_t width, const std::function<void(NpzWriter&)>& add_more) {
  return [=](NpzWriter& f) {
    f.add<double>("trans", {2, 3}, {0.5, -1, 2, 0.25, 3, -4});
    Numbers poses = counted(2, width);
    for (double& x : poses) x *= 1e-3;
    f.add<double>("poses", {2, static_cast<int64_t>(width)}, poses);
    add_more(f);
  };
}

void add_shape(NpzWriter& f) {
  f.add<double>("betas", {3}, {1, 0, -2});
  f.add_text("gender", "male");
}

}  // namespace

TEST_CASE("the pelvis of SMPL-H and SMPL stays where it was, and their shape is left out") {
  const std::vector<std::tuple<std::size_t, std::string, Vector3<double>>> models = {
      {156, "SMPL-H", kSmplhPelvis}, {72, "SMPL", kSmplPelvis}, {69, "SMPL", kSmplPelvis}, {66, "SMPL", kSmplPelvis}};
  for (const auto& [width, name, pelvis] : models) {
    INFO(width);
    const Motion motion = decoded(rows_of(width, add_shape));
    CHECK(motion.converted_from == name);
    CHECK(motion.lost_shape);
    CHECK(motion.betas.empty());
    CHECK(motion.gender == "neutral");
    REQUIRE(motion.pelvis_rest);
    CHECK(*motion.pelvis_rest == kSmplxPelvis);
    const Vector3<double> places[] = {{0.5, -1, 2}, {0.25, 3, -4}};
    for (std::size_t t = 0; t < 2; ++t) {
      CHECK((motion.poses[t].transl + *motion.pelvis_rest - (places[t] + pelvis)).norm() < 1e-14);
      CHECK(motion.poses[t].rotation_of(0)[0] == 1e-3 * static_cast<double>(t * width + 1));
      CHECK(angle(motion, t, "right_wrist", 2) == 1e-3 * static_cast<double>(t * width + 66));
    }
    CHECK_FALSE(decoded(rows_of(width, [](NpzWriter& f) { f.add<double>("betas", {2}, {0, 0}); })).lost_shape);
  }
  const Motion own = decoded(rows_of(165, add_shape));
  CHECK(own.converted_from.empty());
  CHECK_FALSE(own.lost_shape);
  CHECK(own.betas == Numbers{1, 0, -2});
  CHECK(own.gender == "male");
  CHECK_FALSE(own.pelvis_rest);
  CHECK(own.poses[0].transl == Vector3<double>(0.5, -1, 2));
}

TEST_CASE("a motion says of what model it is, and where its pelvis stands") {
  const auto of_type = [](const char* type) {
    return [type](NpzWriter& f) {
      add_shape(f);
      f.add_text("surface_model_type", type);
    };
  };
  CHECK(decoded(rows_of(156, of_type("smplx"))).converted_from.empty());
  CHECK(decoded(rows_of(156, of_type("smplx"))).betas.size() == 3);
  CHECK(decoded(rows_of(156, of_type("SMPL-X"))).converted_from.empty());
  CHECK(decoded(rows_of(156, of_type("smplx_locked_head"))).converted_from.empty());
  CHECK(decoded(rows_of(66, of_type("smpl+h"))).converted_from == "SMPL-H");
  for (const char* other : {"mano", "flame", "star", "a\nb"}) {
    const std::string shown = other[0] == 'a' ? "a\\x0ab" : other;
    CHECK(message_for(rows_of(156, of_type(other))) ==
          "m.npz: array 'surface_model_type': is \"" + shown + "\"; allowed: smplx, smplh, smpl");
  }
  CHECK(decoded(rows_of(66, of_type("smplx"))).converted_from.empty());
  CHECK(decoded(rows_of(66, of_type("smplh"))).converted_from == "SMPL-H");
  CHECK(decoded(rows_of(165, of_type("smplh"))).converted_from.empty());
  const auto parts = [](const char* type) {
    return [type](NpzWriter& f) {
      f.add<double>("trans", {1, 3}, {1, 2, 3});
      f.add<double>("root_orient", {1, 3}, {0, 0, 0});
      f.add<double>("pose_body", {1, 63}, turns(1, 63));
      f.add_text("surface_model_type", type);
    };
  };
  CHECK(decoded(parts("smplx")).poses[0].transl == Vector3<double>(1, 2, 3));
  const Motion moved = decoded(parts("smplh"));
  CHECK((moved.poses[0].transl + kSmplxPelvis - Vector3<double>(1, 2, 3) - kSmplhPelvis).norm() < 1e-14);

  const auto with_pelvis = [](NpzWriter& f) { f.add<double>("pelvis_rest", {3}, {0.25, -0.5, 0.125}); };
  CHECK(*decoded(rows_of(165, with_pelvis)).pelvis_rest == Vector3<double>(0.25, -0.5, 0.125));
  const Motion smpl = decoded(rows_of(72, with_pelvis));
  CHECK((smpl.poses[0].transl + kSmplxPelvis - Vector3<double>(0.75, -1.5, 2.125)).norm() < 1e-14);
  CHECK(message_for(rows_of(165, [](NpzWriter& f) {
          f.add<double>("pelvis_rest", {2}, {1, 2});
        })) == "m.npz: array 'pelvis_rest': has shape [2]; [3] is needed");

  const ScratchFolder folder;
  Motion motion = random_motion(2, 73);
  motion.pelvis_rest = {0.1, -0.35, 1e-3};
  write_motion(folder / "m.npz", motion);
  CHECK(*read_motion(folder / "m.npz").pelvis_rest == *motion.pelvis_rest);
  motion.pelvis_rest.reset();
  write_motion(folder / "m.npz", motion);
  CHECK_FALSE(Npz::read(folder / "m.npz").has("pelvis_rest"));
}

TEST_CASE("a motion says with which frame of its video it begins") {
  const auto with = [](const std::function<void(NpzWriter&)>& more) {
    return [more](NpzWriter& f) {
      f.add<double>("trans", {2, 3}, counted(2, 3)), f.add<double>("poses", {2, 165}, Numbers(330));
      more(f);
    };
  };
  const auto first_of = [&](const std::function<void(NpzWriter&)>& more) {
    NpzWriter file;
    with(more)(file);
    return decode_motion(file.encode(), "m.npz").first_frame;
  };
  CHECK(first_of([](NpzWriter&) {}) == 0);
  CHECK(first_of([](NpzWriter& f) { f.add_scalar("first_frame", 3.0); }) == 3);
  CHECK(first_of([](NpzWriter& f) { f.add<std::int64_t>("frame_ids", {2}, std::vector<std::int64_t>{7, 8}); }) == 7);
  CHECK(message_for(with([](NpzWriter& f) {
          f.add<std::int64_t>("frame_ids", {2}, std::vector<std::int64_t>{7, 9});
        })) ==
        "m.npz: array 'frame_ids': frame 7 is followed by frame 9; allowed: the next one (tools/export_motion.py "
        "fills gaps)");
  CHECK(message_for(with([](NpzWriter& f) {
          f.add<double>("frame_ids", {3}, {1, 2, 3});
        })) == "m.npz: array 'frame_ids': has shape [3]; allowed: [2], a number a frame");
  CHECK(message_for(with([](NpzWriter& f) { f.add_scalar("first_frame", -1.0); })) ==
        "m.npz: array 'first_frame': begins with frame -1; allowed: 0 to 1e7");
}

TEST_CASE("arrays that no reader wants are named, what says a thing again is not") {
  NpzWriter file;
  file.add<double>("trans", {2, 3}, counted(2, 3));
  file.add<double>("poses", {2, 156}, Numbers(312));
  file.add<double>("dmpls", {2, 8}, Numbers(16));
  for (const char* name : {"root_orient", "leye_pose", "obj_trans"}) file.add<double>(name, {2, 3}, Numbers(6));
  file.add_scalar("mocap_frame_rate", 30.0);
  file.add_scalar("mocap_time_length", 0.1);
  file.add_scalar("fps_of_the_camera", 25.0);
  CHECK(decode_motion(file.encode(), "m.npz").unread == std::vector<std::string>{"dmpls", "fps_of_the_camera"});
  const ScratchFolder folder;
  Motion motion;
  motion.poses = {rest_pose(kSmplxJoints)};
  motion.first_frame = 2;
  motion.pelvis_rest = Vector3<double>(0, 0, 0);
  write_motion(folder / "m.npz", motion);
  CHECK(read_motion(folder / "m.npz").unread.empty());
}

TEST_CASE("two rates in a file are refused, naming both") {
  const auto rows = [](double fps) {
    return [fps](NpzWriter& f) {
      f.add<double>("trans", {1, 3}, Numbers(3)), f.add<double>("poses", {1, 165}, Numbers(165));
      f.add_scalar("mocap_frame_rate", 30.0), f.add_scalar("fps", fps);
    };
  };
  CHECK(message_for(rows(25)) ==
        "m.npz: array 'mocap_frame_rate': is 30, 'fps' 25; they say one thing, the frames a second");
  NpzWriter same;
  rows(static_cast<double>(29.9999995F))(same);
  CHECK(decode_motion(same.encode(), "m.npz").frame_rate == 30);
}

TEST_CASE("a file of Python objects is named as one") {
  const std::vector<ZipMember> members = {{"results.npy", pickled_npy()}};
  CHECK_THROWS_WITH(decode_motion(archive_of(members, false), "m.npz"),
                    "m.npz: there is no array 'trans'; not read: results, as it holds Python objects (dtype '|O'), "
                    "which are not unpickled; save an array of numbers for each name");
}

TEST_CASE("numbers of motion files are bounded") {
  const auto with_trans = [](double x) {
    return [x](NpzWriter& f) {
      f.add<double>("trans", {1, 3}, {0, x, 0});
      f.add<double>("poses", {1, 165}, Numbers(165));
    };
  };
  CHECK(message_for(with_trans(1e300)) == "m.npz: array 'trans': frame 0, number 1 is 1e+300; allowed: -1e7 to 1e7");
  CHECK(message_for(with_trans(-1.5e7)) ==
        "m.npz: array 'trans': frame 0, number 1 is -15000000; allowed: -1e7 to 1e7");
  CHECK(decoded(with_trans(1e7)).poses[0].transl[1] == 1e7);
  CHECK(message_for([](NpzWriter& f) {
          f.add<double>("trans", {1, 3}, {0, 0, 0});
          f.add<double>("poses", {1, 72}, Numbers(72, 2e6));
        }) == "m.npz: array 'poses': frame 0, number 0 is 2000000; allowed: -1e6 to 1e6");
  for (const auto& [rate, text] : {std::pair{1e-9, "1e-09"}, {1e6, "1000000"}, {-1.0, "-1"}, {NAN, "nan"}}) {
    const double hertz = rate;
    CHECK(message_for(rows_of(165, [hertz](NpzWriter& f) { f.add_scalar("mocap_framerate", hertz); })) ==
          "m.npz: array 'mocap_framerate': is " + std::string(text) + " frames a second; allowed: 0.01 to 100000");
  }
}

TEST_CASE("angles in degrees are refused, single odd joints are not") {
  const auto turned = [](std::size_t joints, double angle) {
    return [=](NpzWriter& f) {
      Numbers poses(165);
      for (std::size_t joint = 1; joint < 22; ++joint) poses[3 * joint + 1] = joint <= joints ? angle : 0.1;
      f.add<double>("trans", {1, 3}, {0, 0, 0});
      f.add<double>("poses", {1, 165}, poses);
    };
  };
  CHECK(message_for(turned(21, 25)) ==
        "m.npz: half of the joints are turned by 25 or more; angles are radians, and these look like degrees");
  CHECK(decoded(turned(5, 25)).poses[0].axis_angle[4] == 25);
  CHECK(decoded(turned(21, 3.1)).poses[0].axis_angle[4] == 3.1);
}

TEST_CASE("arrays of Python objects are named as such") {
  const auto error_of = [](const std::string& pickled) {
    std::vector<ZipMember> members = {{"trans.npy", encode_npy<double>(std::vector<int64_t>{1, 3}, Numbers(3))},
                                      {"poses.npy", encode_npy<double>(std::vector<int64_t>{1, 165}, Numbers(165))}};
    std::erase_if(members, [&](const ZipMember& member) { return member.name == pickled + ".npy"; });
    members.push_back({pickled + ".npy", pickled_npy()});
    try {
      decode_motion(archive_of(members, false), "m.npz");
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  for (const char* name : {"trans", "poses", "betas", "mocap_frame_rate", "pelvis_rest"}) {
    CHECK(error_of(name) ==
          "m.npz: array '" + std::string(name) + "': holds Python objects (dtype '|O'), which are not unpickled");
  }
  CHECK(error_of("gender") == "accepted");
}

}  // namespace motion_io_test
