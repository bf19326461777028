#include "core/video.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>
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

/// Conversion between RGB and the colours of a video. Without it swscale takes the nearest colour of 4:2:0 for all four
/// pixels and rounds coarsely, which costs 4 to 6 dB (docs/numerics.md).
constexpr const char* kConversion = "accurate_rnd+full_chroma_int+bicubic";

std::vector<std::string> decoder_command(const std::string& path, const VideoFacts& facts) {
  const std::string stream = "0:" + std::to_string(facts.stream),
                    filter = facts.set_matrix.empty() ? "null" : "setparams=colorspace=" + facts.set_matrix;
  return {"ffmpeg",     "-nostdin",   "-hide_banner",
          "-loglevel",  "error",      "-protocol_whitelist",
          "file",       "-i",         ffmpeg_input(path),
          "-map",       stream,       "-vf",
          filter,       "-fps_mode",  "passthrough",
          "-sws_flags", kConversion,  "-pix_fmt",
          "rgb24",      "-c:v",       "ppm",
          "-f",         "image2pipe", "pipe:1"};
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
          "mp4", ffmpeg_input(path)};
}

}  // namespace

VideoReader::VideoReader(const std::string& path) : path_(path) {
  read_file_start(path, 1);  // tells what is wrong with the path
  facts_ = probe_video(path);
}

Image VideoReader::read(Index frame) {
  HSI4D_CHECK(frame >= 0 && frame < frames(), "frame " + std::to_string(frame) + " of " + std::to_string(frames()));
  const bool is_at_hand = decoder_ && next_ == frame + 1;
  if (!decoder_ || next_ > frame + 1) {
    decoder_ = std::make_unique<ChildProcess>(decoder_command(path_, facts_), ChildOutput::kRead);
    next_ = 0;
  }
  while (!is_at_hand && next_ <= frame) decode_next();
  Image image(3, height_, width_);
  const uint8_t* value = pixels_.data();
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      for (int c = 0; c < 3; ++c) image(c, y, x) = static_cast<float>(*value++) / 255.0F;
    }
  }
  return image;
}

/// PPM, one after the other: "P6\n<width> <height>\n255\n", then the pixels.
void VideoReader::decode_next() {
  const auto fail = [this](const std::string& why) {
    std::string text = path_ + ": frame " + std::to_string(next_) + " of " + std::to_string(frames()) + " " + why;
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
    if (decoder_->read({&byte, 1}) == 0)
      fail("cannot be read: ffprobe counts " + std::to_string(frames()) + " frames, ffmpeg gives " +
           std::to_string(next_));
    header += static_cast<char>(byte);
  }
  int largest = 0;
  if (std::sscanf(header.c_str(), "P6\n%d %d\n%d\n", &width_, &height_, &largest) != 3 || largest != 255 ||
      width_ < 1 || height_ < 1 || width_ > kLargestVideoSide || height_ > kLargestVideoSide)
    fail("has no size from 1x1 to " + std::to_string(kLargestVideoSide) + "x" + std::to_string(kLargestVideoSide) +
         " pixels");
  pixels_.resize(3 * static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  if (decoder_->read(pixels_) != pixels_.size()) fail("cannot be read: the video ends in it");
  ++next_;
  uint8_t more = 0;
  if (next_ == frames() && decoder_->read({&more, 1}) == 1)
    throw DataError(path_ + ": ffprobe counts " + std::to_string(frames()) + " frames, ffmpeg gives more");
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
