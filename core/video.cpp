#include "core/video.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <utility>

#include "core/check.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr std::array kVideoEndings = {".mp4", ".mov", ".avi", ".mkv", ".webm", ".m4v"};
constexpr int kLargestVideoSide = 16384;    // pixels
constexpr std::size_t kLongestHeader = 40;  // of a PPM, bytes

std::string lower_ending(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

/// "file:" keeps names that begin like options or protocols from being taken for such.
std::string input_of(const std::string& path) { return "file:" + path; }

/// What ffprobe tells of the first video stream, a line "KEY=VALUE" each.
std::string probe(const std::string& path) {
  try {
    return run_process({"ffprobe", "-v", "error", "-protocol_whitelist", "file", "-select_streams", "v:0",
                        "-count_frames", "-show_entries", "stream=avg_frame_rate,nb_read_frames", "-of",
                        "default=noprint_wrappers=1", input_of(path)});
  } catch (const ProgramNotStartedError&) {
    throw;
  } catch (const UserError& error) {
    throw DataError(path + ": is not a video that can be read: " + error.what());
  }
}

std::string fact(const std::string& facts, const std::string& key) {
  std::istringstream lines(facts);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(key + "=")) return line.substr(key.size() + 1);
  }
  return "";
}

/// 0 where it is none.
Index read_whole(const std::string& text) {
  Index number = 0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), number);
  return end.ec == std::errc() && end.ptr == text.data() + text.size() && number > 0 ? number : 0;
}

/// Conversion between RGB and the colours of a video. Without it swscale takes the nearest colour of 4:2:0 for all four
/// pixels and rounds coarsely, which costs 4 to 6 dB (docs/numerics.md).
constexpr const char* kConversion = "accurate_rnd+full_chroma_int+bicubic";

std::vector<std::string> decoder_command(const std::string& path) {
  return {"ffmpeg",      "-nostdin",   "-hide_banner", "-loglevel", "error", "-protocol_whitelist",
          "file",        "-i",         input_of(path), "-map",      "0:v:0", "-fps_mode",
          "passthrough", "-sws_flags", kConversion,    "-pix_fmt",  "rgb24", "-c:v",
          "ppm",         "-f",         "image2pipe",   "pipe:1"};
}

std::vector<std::string> encoder_command(const std::string& path, int width, int height, const VideoFormat& format) {
  const bool is_shared = format.color == VideoColor::kShared;
  return {"ffmpeg", "-nostdin", "-hide_banner", "-loglevel", "error", "-y",
          // what it is given
          "-f", "rawvideo", "-pixel_format", "rgb24", "-video_size",
          std::to_string(width) + "x" + std::to_string(height), "-framerate", number_text(format.frame_rate), "-i",
          "pipe:0",
          // what it makes: one thread, so that the bytes are the same everywhere
          "-vf", is_shared ? "pad=ceil(iw/2)*2:ceil(ih/2)*2" : "null", "-sws_flags", kConversion, "-c:v", "libx264",
          "-threads", "1", "-pix_fmt", is_shared ? "yuv420p" : "yuv444p", "-crf", std::to_string(format.quality),
          "-movflags", "+faststart", "-colorspace", "smpte170m", "-fflags", "+bitexact", "-flags:v", "+bitexact", "-f",
          "mp4", input_of(path)};
}

}  // namespace

VideoReader::VideoReader(const std::string& path) : path_(path) {
  read_file_start(path, 1);  // tells what is wrong with the path
  const std::string facts = probe(path);
  const std::string rate = fact(facts, "avg_frame_rate"), count = fact(facts, "nb_read_frames");
  frames_ = read_whole(count);
  if (frames_ < 1) throw DataError(path + ": holds no video that can be read");
  if (frames_ == 1) throw DataError(path + ": holds one picture and no video");
  const std::size_t slash = rate.find('/');
  if (slash == std::string::npos) return;
  const Index over = read_whole(rate.substr(0, slash)), under = read_whole(rate.substr(slash + 1));
  if (over > 0 && under > 0) frame_rate_ = static_cast<double>(over) / static_cast<double>(under);
}

Image VideoReader::read(Index frame) {
  HSI4D_CHECK(frame >= 0 && frame < frames_, "frame " + std::to_string(frame) + " of " + std::to_string(frames_));
  if (!decoder_ || next_ > frame) {
    decoder_ = std::make_unique<ChildProcess>(decoder_command(path_), ChildOutput::kRead);
    next_ = 0;
  }
  while (next_ < frame) next_frame();
  return next_frame();
}

/// PPM, one after the other: "P6\n<width> <height>\n255\n", then the pixels.
Image VideoReader::next_frame() {
  const auto fail = [this](const std::string& why) {
    std::string text = path_ + ": frame " + std::to_string(next_) + " of " + std::to_string(frames_) + " " + why;
    try {
      const std::string said = std::exchange(decoder_, nullptr)->finish();
      if (!said.empty()) text += ": " + said;
    } catch (const UserError& error) {
      text += ": " + std::string(error.what());
    }
    throw DataError(text);
  };
  std::string header;
  for (uint8_t byte = 0; header.size() < kLongestHeader && std::count(header.begin(), header.end(), '\n') < 3;) {
    if (decoder_->read({&byte, 1}) == 0) fail("cannot be read: the video ends before it");
    header += static_cast<char>(byte);
  }
  int width = 0, height = 0, largest = 0;
  if (std::sscanf(header.c_str(), "P6\n%d %d\n%d\n", &width, &height, &largest) != 3 || largest != 255 || width < 1 ||
      height < 1 || width > kLargestVideoSide || height > kLargestVideoSide)
    fail("has no size from 1x1 to " + std::to_string(kLargestVideoSide) + "x" + std::to_string(kLargestVideoSide) +
         " pixels");
  Bytes pixels(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  if (decoder_->read(pixels) != pixels.size()) fail("cannot be read: the video ends in it");
  ++next_;
  Image image(3, height, width);
  const uint8_t* value = pixels.data();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) image(c, y, x) = static_cast<float>(*value++) / 255.0F;
    }
  }
  return image;
}

bool is_video_name(const std::string& path) {
  return std::find(kVideoEndings.begin(), kVideoEndings.end(), lower_ending(path)) != kVideoEndings.end();
}

std::string video_endings() { return joined(std::vector<std::string>(kVideoEndings.begin(), kVideoEndings.end())); }

VideoWriter::VideoWriter(const std::string& path, int width, int height, const VideoFormat& format)
    : width_(width),
      height_(height),
      file_((lower_ending(path) == ".mp4"
                 ? path
                 : throw UserError(path + ": a video is written as .mp4, not \"" + lower_ending(path) + "\""))),
      ffmpeg_(encoder_command(file_.temporary_path(), width, height, format)),
      frame_(static_cast<std::size_t>(3 * width) * static_cast<std::size_t>(height)) {}

void VideoWriter::add(const Image& frame) {
  HSI4D_CHECK_EQ(frame.channels(), 3);
  HSI4D_CHECK_EQ(frame.width(), width_);
  HSI4D_CHECK_EQ(frame.height(), height_);
  std::size_t at = 0;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      for (int c = 0; c < 3; ++c)
        frame_[at++] = static_cast<uint8_t>(std::lround(std::clamp(frame(c, y, x), 0.0F, 1.0F) * 255.0F));
    }
  }
  if (ffmpeg_.write(frame_)) return;
  throw UserError("ffmpeg: no longer takes frames: " + ffmpeg_.finish());  // unless finish throws what it says
}

void VideoWriter::commit() {
  ffmpeg_.finish();
  file_.commit();
}

}  // namespace hsi4d
