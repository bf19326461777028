#include "pipelines/input/clip.h"

#include <algorithm>
#include <fstream>

#include <catch2/catch.hpp>

#include "body/motion_edit.h"
#include "body/motion_io.h"
#include "core/check.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/npz.h"
#include "core/video.h"
#include "splat/files/io_ply.h"
#include "splat/files/splat_file.h"
#include "tests/support/tiny_run.h"

namespace clip_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;
namespace fs = std::filesystem;

namespace {

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const UserError& error) {
    return error.what();
  } catch (const DataError& error) {
    return error.what();
  }
  return "no error";
}

Vector3<double> centroid(const Gaussians& g) {
  Vector3<double> sum = Vector3<double>::Zero();
  for (std::size_t i = 0; i < g.means.size(); ++i) sum[Eigen::Index(i % 3)] += static_cast<double>(g.means[i]);
  return sum / static_cast<double>(g.count());
}

}  // namespace

TEST_CASE("a dataset's folder tells its inputs") {
  const TemporaryFolder here;
  const fs::path base = TinyDataset::folder();
  const DataSettings data = dataset_inputs(base);
  CHECK(data.scene == base / "scene.ply");
  CHECK(data.truth == base / "truth");
  REQUIRE(data.objects.size() == 1);
  CHECK(data.objects[0].first == kTinyObject);
  CHECK(data.objects[0].second.gaussians == base / "objects" / "watering_can.ply");
  for (const char* name :
       {"objects/b.ply", "objects/a.ply", "objects/c.spz", "objects/d.splat", "objects/notes.txt", "objects/._a.ply"})
    here.write(std::string("d/") + name, "");
  const DataSettings other = dataset_inputs("d");  // relative, nothing there but objects
  CHECK(other.scene == here.path() / "d" / "scene.ply");
  CHECK(other.truth.empty());
  REQUIRE(other.objects.size() == 4);
  CHECK(other.objects[0].first == "a");
  CHECK(other.objects[1].first == "b");
  CHECK(other.objects[2].first == "c");
  CHECK(other.objects[3].first == "d");
  CHECK(dataset_inputs("nowhere").objects.empty());
}

TEST_CASE("a clip has what the dataset's files have") {
  const DataSettings data = dataset_inputs(TinyDataset::folder());
  const Clip clip = read_clip(data);
  CHECK(clip.frames() == kTinyFrames);
  CHECK(clip.frame_files == std::vector<std::string>{"0000.png", "0001.png", "0002.png", "0003.png"});
  CHECK(clip.camera.width == kTinyPixels);
  CHECK(clip.scene.count() > 1000);
  CHECK(clip.avatar.count() == 500);
  CHECK(clip.frame_rate == 10);
  REQUIRE(clip.objects.size() == 1);
  CHECK(clip.objects[0].name == kTinyObject);
  REQUIRE(clip.estimate.size() == kTinyFrames);
  CHECK(clip.first.body.axis_angle == clip.estimate[0].axis_angle);
  REQUIRE(clip.truth.has_value());
  REQUIRE(clip.truth->size() == kTinyFrames);
  const SceneState& truth = clip.truth->front();  // frame 0 is given exactly
  CHECK(clip.first.body.axis_angle == truth.body.axis_angle);
  CHECK((clip.first.objects[0].translation - truth.objects[0].translation).norm() < 1e-12);
  CHECK(clip.first.camera_from_world.translation == truth.camera_from_world.translation);

  const ClipFrame frame = read_frame(clip, 2);
  CHECK(frame.target.channels() == 3);
  REQUIRE(frame.object_masks.size() == 1);
  CHECK(frame.human_mask.channels() == 1);
  const Image human = read_image((TinyDataset::folder() / "masks/human/0002.png").string());
  for (int y = 0; y < kTinyPixels; ++y) {
    for (int x = 0; x < kTinyPixels; ++x) REQUIRE(frame.human_mask(0, y, x) == human(0, y, x));
  }
}

TEST_CASE("frames and masks are reduced to the camera's size") {
  const Clip whole = read_clip(dataset_inputs(TinyDataset::folder()));
  Clip half = whole;
  half.camera = reduced_camera(whole.camera, kTinyPixels / 2);
  CHECK(half.camera.width == kTinyPixels / 2);
  CHECK(half.camera.height == kTinyPixels / 2);
  const Vector3<double> point(0.3, -0.2, 2.5);  // is seen at the same place of the image
  CHECK((2 * project_point(half.camera, point) - project_point(whole.camera, point)).norm() < 1e-9);
  const ClipFrame fine = read_frame(whole, 2), coarse = read_frame(half, 2);
  CHECK(coarse.object_masks.front().width() == kTinyPixels / 2);
  const auto mean_of_four = [](const Image& image, int c, int y, int x) {
    return (image(c, 2 * y, 2 * x) + image(c, 2 * y, 2 * x + 1) + image(c, 2 * y + 1, 2 * x) +
            image(c, 2 * y + 1, 2 * x + 1)) /
           4;
  };
  for (int y = 0; y < kTinyPixels / 2; ++y) {
    for (int x = 0; x < kTinyPixels / 2; ++x) {
      REQUIRE(coarse.human_mask(0, y, x) == Approx(mean_of_four(fine.human_mask, 0, y, x)).margin(1e-6));
      for (int c = 0; c < 3; ++c)
        REQUIRE(coarse.target(c, y, x) == Approx(mean_of_four(fine.target, c, y, x)).margin(1e-6));
    }
  }
  CHECK(reduced_camera(whole.camera, 10 * kTinyPixels).width == kTinyPixels);  // nothing is enlarged
}

TEST_CASE("scene and objects may be in any format of Gaussians") {
  const CopiedDataset dataset;
  DataSettings data = dataset_inputs(dataset.path);
  const Clip plain = read_clip(data);
  const auto convert = [](fs::path& file, const std::string& ending) {
    const Gaussians g = read_splats(file.string()).gaussians;
    file.replace_extension(ending);
    write_splats(file.string(), g);
  };
  convert(data.scene, ".spz");
  convert(data.objects[0].second.gaussians, ".splat");
  const Clip packed = read_clip(data);
  REQUIRE(packed.scene.count() == plain.scene.count());
  for (std::size_t i = 0; i < plain.scene.means.size(); ++i)
    REQUIRE(static_cast<double>(packed.scene.means[i]) ==
            Approx(static_cast<double>(plain.scene.means[i])).margin(1e-5));
  CHECK(packed.objects[0].gaussians.means == plain.objects[0].gaussians.means);
}

TEST_CASE("objects are about the centroid of their means, wherever their file has them") {
  const CopiedDataset dataset;
  const std::string file = (dataset.path / "objects" / "watering_can.ply").string();
  Gaussians moved = read_ply(file).gaussians;
  for (std::size_t i = 0; i < moved.means.size(); ++i) moved.means[i] += i % 3 == 0 ? 5.0F : -2.0F;
  write_ply(file, moved);
  const Gaussians read = dataset.read().objects[0].gaussians;
  CHECK(centroid(read).norm() < 1e-6);
  CHECK(read.origin_world == Vector3<double>::Zero());
  const Gaussians plain = read_clip(dataset_inputs(TinyDataset::folder())).objects[0].gaussians;
  for (std::size_t i = 0; i < plain.means.size(); ++i) {
    CHECK(static_cast<double>(read.means[i]) == Approx(static_cast<double>(plain.means[i])).margin(2e-6));
  }
}

TEST_CASE("one frame of a motion is no estimate, no truth is no truth") {
  const CopiedDataset dataset;
  const std::string file = (dataset.path / "initial_motion.npz").string();
  Motion motion = read_motion(file);
  motion.poses.resize(1);
  write_motion(file, motion);
  fs::remove_all(dataset.path / "truth");
  const Clip clip = dataset.read();
  CHECK(clip.estimate.empty());
  CHECK_FALSE(clip.truth.has_value());
  CHECK(clip.first.body.axis_angle == motion.poses[0].axis_angle);
}

TEST_CASE("truth and initial motion that begin later than frame 0 are refused") {
  for (const auto& [name, needed] :
       {std::pair{"truth/motion.npz", "a truth is of all frames from 0 on"},
        {"initial_motion.npz", "the exact state of frame 0 is needed (an estimate belongs in data.motion)"}}) {
    const CopiedDataset dataset;
    const std::string file = (dataset.path / name).string();
    Motion motion = read_motion(file);
    motion.first_frame = 2;
    write_motion(file, motion);
    CHECK(message_of([&] { dataset.read(); }) == file + ": begins with frame 2 of its video; " + needed);
  }
}

TEST_CASE("a motion of another body model stands where its file has it, estimate and truth alike") {
  const CopiedDataset dataset;
  const Clip plain = dataset.read();
  std::vector<double> trans, poses;
  for (const BodyPose& pose : plain.estimate) {
    trans.insert(trans.end(), pose.transl.data(), pose.transl.data() + 3);
    poses.insert(poses.end(), pose.axis_angle.begin(), pose.axis_angle.begin() + 72);
  }
  NpzWriter file;
  const Index frames = plain.frames();
  file.add<double>("trans", {frames, 3}, trans);
  file.add<double>("poses", {frames, 72}, poses);
  for (const char* name : {"initial_motion.npz", "truth/motion.npz"}) file.write((dataset.path / name).string());
  const Clip clip = dataset.read();
  for (std::size_t t = 0; t < static_cast<std::size_t>(frames); ++t) {
    const Vector3<double> there = plain.estimate[t].transl + kSmplPelvis;
    CHECK((pelvis_of(pose_joints(clip.avatar, clip.estimate[t])) - there).norm() < 1e-14);
    CHECK((pelvis_of(pose_joints(clip.avatar, (*clip.truth)[t].body)) - there).norm() < 1e-14);
  }
  CHECK(clip.first.body.transl == clip.estimate[0].transl);
}

TEST_CASE("frames may have alpha that is full, masks may have three channels or be missing") {
  const CopiedDataset dataset;
  Image with_alpha(4, kTinyPixels, kTinyPixels), mask(3, kTinyPixels, kTinyPixels);
  for (int y = 0; y < kTinyPixels; ++y) std::fill_n(with_alpha.row(3, y), kTinyPixels, 1.0F);
  with_alpha(0, 1, 2) = 1;
  for (int c = 0; c < 3; ++c) mask(c, 5, 6) = 1;
  const std::string frame_file = (dataset.path / "frames/0001.png").string(),
                    mask_file = (dataset.path / "masks/human/0001.png").string();
  write_image(frame_file, with_alpha);
  write_image(mask_file, mask);
  fs::remove(dataset.path / "masks/watering_can/0001.png");
  const DataSettings data = dataset_inputs(dataset.path);
  const Clip clip = read_clip(data);
  const ClipFrame frame = read_frame(clip, 1);
  CHECK(frame.target.channels() == 3);
  CHECK(frame.target(0, 1, 2) == 1);
  CHECK(frame.human_mask.channels() == 1);
  CHECK(frame.human_mask(0, 5, 6) == 1);
  REQUIRE(frame.object_masks.size() == 1);
  for (int y = 0; y < kTinyPixels; ++y) {
    for (int x = 0; x < kTinyPixels; ++x) REQUIRE(frame.object_masks[0](0, y, x) == 0);
  }
  mask(1, 5, 6) = 0;
  write_image(mask_file, mask);
  CHECK_THAT(message_of([&] { read_frame(clip, 1); }),
             Contains(mask_file + ": is a colour mask: row 5, column 6 is (255, 0, 255)"));
  with_alpha(3, 4, 3) = 0.8F;
  write_image(frame_file, with_alpha);
  CHECK(message_of([&] { read_frame(clip, 1); }) == frame_file + ": row 4, column 3 has alpha 0.8; a frame is opaque");
  write_image(frame_file, Image(1, kTinyPixels, kTinyPixels));
  CHECK_THAT(message_of([&] { read_frame(clip, 1); }), Contains(" with 1 channels; the camera's image is "));
}

TEST_CASE("grey masks that hold labels are told from masks that show nothing") {
  const CopiedDataset dataset;
  Image labels(1, kTinyPixels, kTinyPixels);
  labels(0, 3, 3) = 1.0F / 255;
  const fs::path human = dataset.path / "masks/human";
  for (const char* name : {"0001.png", "0002.png"}) write_image((human / name).string(), labels);
  std::vector<std::string> told;
  const LogSink sink = log_to([&](LogLevel, std::string_view text) { told.emplace_back(text); }, LogLevel::kWarning);
  const DataSettings data = dataset_inputs(dataset.path);
  check_frames(data, read_clip(data), {});
  CHECK(told == std::vector<std::string>{
                    human.string() +
                    ": the human is hidden in frames 1-2: no pixel reaches data.mask_threshold (the largest value is 1 "
                    "of 255: labels are read from images with a palette, grey is the share of the pixel)"});
}

TEST_CASE("grey masks of few greys are told, with the frames") {
  const CopiedDataset dataset;
  Image labels(1, kTinyPixels, kTinyPixels);
  std::fill_n(labels.row(0, 5), kTinyPixels, 100.0F / 255);
  std::fill_n(labels.row(0, 6), kTinyPixels, 200.0F / 255);
  const fs::path object = dataset.path / "masks" / kTinyObject;
  for (const char* name : {"0001.png", "0003.png"}) write_image((object / name).string(), labels);
  std::vector<std::string> told;
  const LogSink sink = log_to([&](LogLevel, std::string_view text) { told.emplace_back(text); }, LogLevel::kWarning);
  const DataSettings data = dataset_inputs(dataset.path);
  check_frames(data, read_clip(data), {});
  CHECK(told == std::vector<std::string>{
                    object.string() +
                    ": holds few greys as labels would, 100, 200 of 255 in frame 1 (alike: 1, 3); they count as shares "
                    "of the pixel, and labels are read from images with a palette"});
}

TEST_CASE("a motion that is a folder is told with what makes a file of it") {
  const CopiedDataset dataset;
  DataSettings data = dataset_inputs(dataset.path);
  data.motion = dataset.path / "smplerx";
  fs::create_directories(data.motion);
  CHECK(message_of([&] { read_clip(data); }) == data.motion.string() +
                                                    ": is a folder; of one of SMPLer-X's results `hsi4d "
                                                    "motion " +
                                                    data.motion.string() + " OUT.npz` makes a motion");
}

TEST_CASE("masks that are missing are warned of, a missing folder is an error") {
  const CopiedDataset dataset;
  std::vector<std::string> messages;
  const LogSink sink = log_to([&](LogLevel level, std::string_view text) {
    messages.push_back(std::string(log_level_name(level)) + " " + std::string(text));
  });
  dataset.read();
  CHECK(messages.empty());
  const fs::path folder = dataset.path / "masks" / "human";
  fs::remove(folder / "0001.png");
  fs::remove(folder / "0003.png");
  dataset.read();
  CHECK(messages == std::vector<std::string>{"warning " + folder.string() +
                                             ": has no mask for 2 of 4 frames; these count as empty"});
  fs::remove_all(folder);
  CHECK(message_of([&] { dataset.read(); }) ==
        folder.string() + ": there is no such folder of masks, nor a video \"" + folder.filename().string() + ".mp4\"");
}

TEST_CASE("masks whose names are not those of frames are refused") {
  const auto message_after = [](const auto& rename) {
    const CopiedDataset dataset;
    rename(dataset.path / "masks" / "human");
    const std::string text = message_of([&] { dataset.read(); }), path = (dataset.path / "masks" / "human").string();
    CHECK(text.starts_with(path));
    return text.substr(std::min(text.size(), path.size()));
  };
  const std::string allowed = "; allowed: a mask has the name of its frame, the first \"0000.png\"";
  const auto later = [](const fs::path& folder) { fs::rename(folder / "0000.png", folder / "0004.png"); };
  CHECK(message_after(later) == ": has no mask for 1 of 4 frames, and 1 of its 4 masks belong to no frame" + allowed);
  const auto renamed = [](const fs::path& folder) {
    for (const char* name : {"0000.png", "0001.png", "0002.png", "0003.png"})
      fs::rename(folder / name, folder / (std::string("frame_") + name));
  };
  CHECK(message_after(renamed) == ": has no mask for 4 of 4 frames, and 4 of its 4 masks belong to no frame" + allowed);
  const auto others = [](const fs::path& folder) {
    for (const char* name : {"0000.png", "0001.png", "0002.png", "0003.png"})
      fs::rename(folder / name, (folder / name).replace_extension("jpg"));
  };
  CHECK(message_after(others) == ": has no mask for 4 of 4 frames, and 0 of its 0 masks belong to no frame" + allowed +
                                     "; what is no .png is not read: 0000.jpg, 0001.jpg, 0002.jpg, 0003.jpg");
}

TEST_CASE("files beside masks and frames that nobody reads are told") {
  const CopiedDataset dataset;
  std::vector<std::string> messages;
  const LogSink sink = log_to([&](LogLevel, std::string_view text) { messages.emplace_back(text); });
  const fs::path masks = dataset.path / "masks" / "human", frames = dataset.path / "frames";
  for (const char* name : {"0000.PNG", "0001.jpg", ".hidden", "notes"}) std::ofstream(masks / name) << "no mask";
  for (const char* name : {"0000.jpg", "0001.jpg", "0000.PNG"}) std::ofstream(frames / name) << "no frame";
  dataset.read();
  CHECK(messages ==
        std::vector<std::string>{frames.string() + ": its 1 .PNG, 2 .jpg files are not read",
                                 masks.string() + ": what is no .png is not read: 0000.PNG, 0001.jpg, notes"});
}

TEST_CASE("masks and poses beyond the video are warned of with both numbers") {
  const CopiedDataset dataset;
  std::vector<std::string> messages;
  const LogSink sink = log_to([&](LogLevel, std::string_view text) { messages.emplace_back(text); });
  const auto told = [&](const DataSettings& data) {
    messages.clear();
    read_clip(data);
    return messages;
  };
  DataSettings data = dataset_inputs(dataset.path);
  const fs::path human = dataset.path / "masks" / "human";
  const std::string of_four = " masks, the video has 4 frames; ",
                    unused = " of the masks belong to no frame and are not used";
  fs::copy_file(human / "0003.png", human / "0004.png");
  fs::copy_file(human / "0003.png", human / "a.png");
  CHECK(told(data) == std::vector<std::string>{human.string() + ": holds 6" + of_four + "2" + unused});

  const auto write_video = [&](const fs::path& path, Index frames) {
    VideoWriter video(path.string(), kTinyPixels, kTinyPixels, {.frame_rate = 10});
    for (Index t = 0; t < frames; ++t) video.add(Image(3, kTinyPixels, kTinyPixels));
    video.commit();
  };
  fs::remove_all(human);
  const fs::path film = dataset.path / "masks/human.mp4";
  write_video(film, 5);
  CHECK(message_of([&] { read_clip(data); }) ==
        film.string() +
            ": has 5 frames, the video has 4; allowed: as many, as times by which masks could be found are "
            "not known of both");
  data.video_rate = 10;
  CHECK(told(data) == std::vector<std::string>{film.string() + ": holds 5" + of_four + "1" + unused});

  // A video of two frames, with four masks and four poses.
  data.video_rate = 0;
  write_video(film, 2);
  write_video(dataset.path / "short.mp4", 2);
  data.frames = dataset.path / "short.mp4";
  data.truth.clear();
  const std::string motion = (dataset.path / "initial_motion.npz").string(),
                    object = (dataset.path / "masks" / kTinyObject).string();
  CHECK(told(data) == std::vector<std::string>{
                          object + ": holds 4 masks, the video has 2 frames; 2" + unused,
                          motion + ": holds 4 poses at 10 a second, the video has 2 frames at 10; poses after its end "
                                   "are not used"});
  Motion shorter = read_motion(motion);
  shorter.poses.resize(3);
  write_motion(motion, shorter);
  CHECK(told(data).size() == 2);
}

TEST_CASE("every frame can be checked at once") {
  const CopiedDataset dataset;
  const DataSettings data = dataset_inputs(dataset.path);
  const Clip clip = read_clip(data);
  CHECK(message_of([&] { check_frames(data, clip, {}); }) == "no error");
  for (const char* name : {"frames/0003.png", "frames/0002.png"})
    std::ofstream(dataset.path / name) << "\x89PNG\r\n\x1a\ntext";
  CHECK_THAT(message_of([&] { check_frames(data, clip, {}); }), Contains((dataset.path / "frames/0002.png").string()));
}

TEST_CASE("frames whose names are not text are refused when the folder is read") {
  for (const auto& [name, shown] : {std::pair{"0003\xff.png", "0003\\xff.png"}, {"00\n03.png", "00\\x0a03.png"}}) {
    const CopiedDataset dataset;
    fs::rename(dataset.path / "frames/0003.png", dataset.path / "frames" / name);
    CHECK_THROWS_AS(dataset.read(), UserError);
    CHECK(message_of([&] { dataset.read(); }) ==
          (dataset.path / "frames").string() + ": the name \"" + shown +
              "\" is not UTF-8 text without control characters; rename the frame, and its masks with it");
  }
  const CopiedDataset dataset;
  for (const fs::path& folder : {fs::path("frames"), fs::path("masks/human"), fs::path("masks") / kTinyObject})
    fs::rename(dataset.path / folder / "0003.png", dataset.path / folder / "0003\xc3\xa4.png");
  CHECK(message_of([&] { dataset.read(); }) == "no error");
}

TEST_CASE("frames whose names sort otherwise than their numbers are refused") {
  const CopiedDataset dataset;
  fs::rename(dataset.path / "frames/0003.png", dataset.path / "frames/10.png");
  CHECK(message_of([&] { dataset.read(); }) ==
        (dataset.path / "frames").string() +
            ": \"0000.png\" and \"10.png\" have different numbers of digits; frames are taken in the order of their "
            "names, so fill up with zeros");
}

TEST_CASE("frames with numbers behind a text are held to the same digits, and their gaps are told") {
  const CopiedDataset dataset;
  const fs::path frames = dataset.path / "frames";
  const std::vector<fs::path> folders = {frames, dataset.path / "masks/human", dataset.path / "masks" / kTinyObject};
  for (const fs::path& folder : folders) {
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
    for (const fs::path& file : files) fs::rename(file, folder / ("shot2_" + file.filename().string()));
  }
  int gaps = 0;
  const LogSink sink = log_to(
      [&gaps](LogLevel, std::string_view message) {
        gaps += message.find("seems to be missing") == std::string_view::npos ? 0 : 1;
      },
      LogLevel::kWarning);
  CHECK(message_of([&] { dataset.read(); }) == "no error");
  CHECK(gaps == 0);
  for (const fs::path& folder : folders) fs::rename(folder / "shot2_0001.png", folder / "shot2_0009.png");
  CHECK(message_of([&] { dataset.read(); }) == "no error");
  CHECK(gaps == 1);
  for (const fs::path& folder : folders) fs::rename(folder / "shot2_0009.png", folder / "shot2_0001.png");
  fs::rename(frames / "shot2_0003.png", frames / "shot2_10.png");
  CHECK(message_of([&] { dataset.read(); }) ==
        frames.string() +
            ": \"shot2_0000.png\" and \"shot2_10.png\" have different numbers of digits; frames are taken in "
            "the order of their names, so fill up with zeros");
  fs::rename(frames / "shot2_10.png", frames / "other.png");  // not all are numbered alike: by name
  CHECK(message_of([&] { dataset.read(); }).find("different numbers") == std::string::npos);
}

TEST_CASE("inputs that are missing or damaged are told by name") {
  const CopiedDataset dataset;
  DataSettings data = dataset_inputs(dataset.path);
  const auto message = [&data] { return message_of([&data] { read_clip(data); }); };
  SECTION("not given") {
    data.scene.clear();
    data.camera.clear();
    CHECK(message() ==
          "/data/scene: not given; a run needs a scene\n/data/camera: not given; a run needs the camera of frame 0");
  }
  SECTION("an object without a name") {
    data.objects[0].first = "";
    CHECK(message() == "/data/objects: an object's name is empty; it names the folder of its masks");
  }
  SECTION("a folder of frames that is a file") {
    data.frames = data.scene;
    CHECK(message() ==
          data.scene.string() + ": is neither a folder of frames nor a video (.mp4, .mov, .avi, .mkv, .webm, .m4v)");
  }
  SECTION("an empty object") {
    Gaussians none = read_ply(data.objects[0].second.gaussians.string()).gaussians;
    none.means.clear();
    none.quats.clear();
    none.log_scales.clear();
    none.opacity_logits.clear();
    none.sh.clear();
    write_ply(data.objects[0].second.gaussians.string(), none);
    CHECK(message() == data.objects[0].second.gaussians.string() + ": holds no Gaussians that can be used");
  }
  SECTION("an avatar of another skeleton") {
    Avatar avatar = read_avatar(data.avatar.string());
    std::fill(avatar.weights.indices.begin(), avatar.weights.indices.end(), 0);
    avatar.weights.joints = 1;
    avatar.parents.resize(1);
    avatar.joints.resize(3);
    avatar.joint_names.resize(1);
    write_avatar(data.avatar.string(), avatar);
    CHECK(message() == data.avatar.string() + ": has 1 joints; a run needs the 55 of SMPL-X");
  }
  SECTION("an unknown key of the state of frame 0") {
    std::ofstream(data.initial) << R"({"motion": "initial_motion.npz", "object": {}})";
    CHECK_THAT(message(), Contains(data.initial.string() + ":1: /object: ") && Contains("\"objects\""));
  }
  SECTION("a pose of two numbers") {
    std::ofstream(data.initial)
        << R"({"motion": "initial_motion.npz", "objects": {"watering_can": {"rotation": [0, 0], "translation": [0, 0, 0]}}})";
    CHECK_THAT(message(), Contains(data.initial.string() + ":1: /objects/watering_can/rotation: "));
  }
  SECTION("no motion") {
    std::ofstream(data.initial) << "{}";
    CHECK_THAT(message(), Contains(data.initial.string()) && Contains("motion"));
  }
  SECTION("a motion that is cut short") {
    const fs::path motion = dataset.path / "initial_motion.npz";
    fs::resize_file(motion, 500);
    CHECK_THAT(message(), Contains(motion.string()));
  }
  SECTION("a frame that is none") {
    const Clip clip = read_clip(data);
    std::ofstream(dataset.path / "frames/0003.png") << "text";
    CHECK_THAT(message_of([&] { read_frame(clip, 3); }), Contains((dataset.path / "frames/0003.png").string()));
    CHECK(message_of([&] { read_frame(clip, 2); }) == "no error");
  }
}

}  // namespace clip_test
