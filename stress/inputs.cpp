// Rows G about what a run reads and looks at: videos, the checkpoint that it goes on from, ranges of approximations.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "body/body_model.h"
#include "core/angles.h"
#include "core/check.h"
#include "core/file.h"
#include "core/held_isa.h"
#include "core/log.h"
#include "core/process.h"
#include "core/rotation.h"
#include "core/video.h"
#include "pipelines/draw/view_turn.h"
#include "pipelines/run/checkpoint.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/scratch_folder.h"

namespace hsi4d::stress {

namespace {

// --- G7 --------------------------------------------------------------------------------------------------------------

/// Weights of red and blue in a brightness.
struct ColorMatrix {
  double red, blue;
};
constexpr ColorMatrix kMatrix709{0.2126, 0.0722}, kMatrix601{0.299, 0.114};
constexpr std::array kSomeColor = {200.0, 31.0, 60.0};  // 0 to 255

/// Brightness and the two differences of a colour, 0 to 255 and about 0.
std::array<double, 3> in_matrix(const ColorMatrix& m, const std::array<double, 3>& rgb) {
  const double y = m.red * rgb[0] + (1 - m.red - m.blue) * rgb[1] + m.blue * rgb[2];
  return {y, (rgb[2] - y) / (2 * (1 - m.blue)), (rgb[0] - y) / (2 * (1 - m.red))};
}

/// The way back.
std::array<double, 3> out_of_matrix(const ColorMatrix& m, const std::array<double, 3>& yuv) {
  const double red = yuv[0] + 2 * (1 - m.red) * yuv[2], blue = yuv[0] + 2 * (1 - m.blue) * yuv[1];
  return {red, (yuv[0] - m.red * red - m.blue * blue) / (1 - m.red - m.blue), blue};
}

void run_ffmpeg(std::vector<std::string> words) {
  words.insert(words.begin(), {"ffmpeg", "-v", "error", "-nostdin", "-y"});
  run_process(words);
}

/// Twelve frames of kSomeColor that do not name their matrix, without loss.
void write_untagged(const ScratchFolder& folder, int width, int height, const ColorMatrix& matrix) {
  const std::array<double, 3> yuv = in_matrix(matrix, kSomeColor);
  Bytes planes;
  for (int frame = 0; frame < 12; ++frame) {
    for (std::size_t p = 0; p < 3; ++p) {
      const double number = p == 0 ? 16 + yuv[0] * 219 / 255 : 128 + yuv[p] * 224 / 255;
      planes.insert(planes.end(), static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                    static_cast<uint8_t>(std::lround(number)));
    }
  }
  write_file(folder / "planes.yuv", planes);
  run_ffmpeg({"-f", "rawvideo", "-video_size", std::to_string(width) + "x" + std::to_string(height), "-pixel_format",
              "yuv444p", "-framerate", "30", "-i", folder / "planes.yuv", "-c:v", "libx264", "-qp", "0",
              folder / "untagged.mp4"});
}

/// How far off kSomeColor a colour is, grey levels.
double off_color(const std::array<double, 3>& rgb) {
  double worst = 0;
  for (std::size_t c = 0; c < 3; ++c) worst = larger(worst, std::abs(rgb[c] - kSomeColor[c]));
  return worst;
}

double color_error(const ScratchFolder& folder, int width, int height, const ColorMatrix& matrix) {
  write_untagged(folder, width, height, matrix);
  const Image image = VideoReader(folder / "untagged.mp4").read(1);
  std::array<double, 3> rgb;
  for (int c = 0; c < 3; ++c) rgb[static_cast<std::size_t>(c)] = 255 * static_cast<double>(image(c, 5, 5));
  return off_color(rgb);
}

bool is_refused(const std::string& video) {
  try {
    probe_video(video);
  } catch (const DataError&) {
    return true;
  }
  return false;
}

const std::array<double, 7> kUnevenTimes = {0, 1 / 30.0, 2 / 30.0, 3 / 30.0, 9 / 30.0, 10 / 30.0, 11 / 30.0};

/// Of the video that is there, four that are to be refused, and one of which frames are left out: in one go, as ffmpeg
/// takes long to start.
void write_variants(const ScratchFolder& folder) {
  const std::vector<std::vector<std::string>> variants = {
      {"-color_trc", "smpte2084", "-color_primaries", "bt2020", "-colorspace", "bt2020nc", folder / "refused0.mp4"},
      {"-color_trc", "arib-std-b67", folder / "refused1.mp4"},
      {"-vf", "setsar=4/3", folder / "refused2.mp4"},
      {"-vf", "setfield=tff", "-flags", "+ildct+ilme", folder / "refused3.mp4"},
      {"-vf", "select=not(between(n\\,4\\,8))", "-fps_mode", "vfr", folder / "uneven.mp4"}};
  std::vector<std::string> words = {"-i", folder / "untagged.mp4"};
  for (const std::vector<std::string>& variant : variants) words.insert(words.end(), variant.begin(), variant.end());
  run_ffmpeg(words);
}

}  // namespace

/// G7: files of a few small frames. Without: one matrix for all sizes, times by the mean rate, no look at the tags.
std::vector<StressFigure> videos_as_players_show_them(Remedy remedy) {
  double color = 0, times = 0, read = 0;
  if (remedy == Remedy::kOff) {
    color = off_color(out_of_matrix(kMatrix601, in_matrix(kMatrix709, kSomeColor)));
    for (std::size_t i = 0; i < kUnevenTimes.size(); ++i)
      times = larger(times, std::abs(kUnevenTimes[i] - kUnevenTimes.back() * static_cast<double>(i) / 6));
    read = 4;
  } else {
    const LogSink silence = log_to([](LogLevel, std::string_view) {}, LogLevel::kWarning);
    const ScratchFolder folder;
    color = larger(color_error(folder, 16, 720, kMatrix709), color_error(folder, 64, 48, kMatrix601));
    write_variants(folder);
    times = largest_difference(probe_video(folder / "uneven.mp4").times.seconds,
                               {kUnevenTimes.begin(), kUnevenTimes.end()});
    for (const char* name : {"refused0.mp4", "refused1.mp4", "refused2.mp4", "refused3.mp4"})
      read += is_refused(folder / name) ? 0 : 1;
  }
  return {{"colour of videos that name no matrix, grey levels off", color, 2},
          {"times of an uneven video, seconds off", times, 1.1e-3},
          {"read although PQ, HLG, not square or interlaced, of 4", read, 0}};
}

// --- G8 --------------------------------------------------------------------------------------------------------------

/// G8: what a checkpoint that was written by kernels of each instruction set says of them. Without: nothing.
std::vector<StressFigure> resumed_elsewhere(Remedy remedy) {
  Clip clip;
  clip.camera.width = clip.camera.height = 4;
  clip.first.body = rest_pose(kSmplxJoints);
  clip.frame_files = {"0000.png"};
  const ScratchFolder folder;
  double unnamed = 0;
  for (const Isa isa : {Isa::kBaseline, Isa::kAvx2, Isa::kAvx512}) {
    if (isa > best_isa()) continue;
    {
      const HeldIsa held(isa);
      save_progress(folder / "progress.npz", "{}", first_progress(clip, 1));
    }
    const std::string isa_of_file =
        remedy == Remedy::kOn ? load_progress(folder / "progress.npz", "{}", clip, 1).isa : std::string();
    unnamed += isa_of_file == isa_name(isa) ? 0 : 1;
  }
  return {{"checkpoints that do not name their instruction set", unnamed, 0}};
}

// --- G12 -------------------------------------------------------------------------------------------------------------

/// G12: an object and a joint that are turned against the camera, an object that is moved aside, and a camera that goes
/// around, which approximations suppose not to be. Without: nobody looks.
std::vector<StressFigure> left_ranges(Remedy remedy) {
  Clip clip;
  clip.avatar.parents = {-1, 0};
  clip.avatar.joints = {0, 0, 0, 0, 0.3, 0};
  SceneState before;
  before.camera_from_world.translation = {0, 0, 4};
  before.objects.resize(1);
  before.body = rest_pose(2);
  const auto error_of = [&](const SceneState& after, double degrees) {
    return std::abs((remedy == Remedy::kOn ? view_turn_deg(clip, before, after) : 0) - degrees);
  };
  double turned = 0, around = 0, aside = 0;
  for (const double degrees : {0.0, 2.0, 15.0, 90.0, 170.0}) {
    for (const bool is_object : {true, false}) {
      SceneState after = before;
      (is_object ? after.objects[0].rotation[0] : after.body.axis_angle[0]) = degrees * kDegree;
      turned = larger(turned, error_of(after, degrees));
    }
    SceneState after = before;
    after.camera_from_world.rotation = so3_exp(Vector3<double>(0, degrees * kDegree, 0));
    around = larger(around, error_of(after, degrees));
  }
  for (const double degrees : {2.0, 15.0, 80.0}) {
    SceneState after = before;
    after.objects[0].translation[0] = 4 * std::tan(degrees * kDegree);
    aside = larger(aside, error_of(after, degrees));
  }
  return {{"turns against the camera off what is told, degrees", turned, 1e-9},
          {"ways of the camera around things, likewise", around, 1e-9},
          {"ways of an object aside, likewise", aside, 1e-9}};
}

}  // namespace hsi4d::stress
