#include "pipelines/input/frame_source.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <set>

#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/mask_image.h"
#include "core/png.h"
#include "core/text.h"
#include "core/video.h"

namespace hsi4d {

namespace detail {

struct OpenVideo {
  explicit OpenVideo(const std::filesystem::path& path) : reader(path.string()) {}

  Image read(Index frame) {
    const std::lock_guard lock(mutex);
    return reader.read(frame);
  }

  std::mutex mutex;
  VideoReader reader;
};

}  // namespace detail

namespace {

namespace fs = std::filesystem;

constexpr Index kFewestFrames = 2;
/// Frames that a clip has at most for each of its video, where one stands for the pauses after it. Screen recordings of
/// something that stands still come near to it; beyond, a time stamp is wrong.
constexpr double kMostRepeats = 10;

bool is_number(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// A name as the text before the digits that it ends with, and these: "frame_0012.png" is "frame_" and "0012".
std::pair<std::string, std::string> split_number(const std::string& name) {
  const std::string stem = fs::path(name).stem().string();
  const std::size_t last = stem.find_last_not_of("0123456789");
  const std::size_t begin = last == std::string::npos ? 0 : last + 1;
  return {stem.substr(0, begin), stem.substr(begin)};
}

/// Refuses 8.png, 9.png, 10.png, and frame_9.png, frame_10.png: in the order of their names 10 comes first.
void check_numbering(const std::vector<std::string>& names, const fs::path& folder) {
  const auto is_numbered = [&names](const std::string& name) {
    const auto [text, digits] = split_number(name);
    return !digits.empty() && text == split_number(names.front()).first;
  };
  if (!std::all_of(names.begin(), names.end(), is_numbered)) return;
  for (const std::string& name : names) {
    if (name.size() == names.front().size()) continue;
    throw DataError(
        folder.string() + ": \"" + names.front() + "\" and \"" + name +
        "\" have different numbers of digits; frames are taken in the order of their names, so fill up with zeros");
  }
}

/// Logs, checkpoints and reports hold the names.
void check_characters(const std::vector<std::string>& names, const fs::path& folder) {
  for (const std::string& name : names) {
    if (is_plain_text(name)) continue;
    throw UserError(folder.string() + ": the name \"" + with_escapes(name) +
                    "\" is not UTF-8 text without control characters; rename the frame, and its masks with it");
  }
}

/// The number of digits; none where there are none, or many.
std::optional<Index> number_of(const std::string& digits) {
  constexpr std::size_t kMostDigits = 15;
  if (digits.size() > kMostDigits || !is_number(digits)) return std::nullopt;
  return std::stoll(digits);
}

/// Frames count as equally far apart in time; where their numbers are not, one is missing.
void warn_of_gaps(const std::vector<std::string>& names, const fs::path& folder) {
  std::optional<Index> least;
  std::size_t widest = 0;
  Index widest_step = 0;
  for (std::size_t i = 1; i < names.size(); ++i) {
    const auto [text_before, digits_before] = split_number(names[i - 1]);
    const auto [text, digits] = split_number(names[i]);
    const std::optional<Index> before = number_of(digits_before), here = number_of(digits);
    if (!before || !here || text_before != text) return;
    const Index step = *here - *before;
    if (!least || step < *least) least = step;
    if (step <= widest_step) continue;
    widest_step = step;
    widest = i;
  }
  if (least && widest_step > *least)
    log_warning(folder.string() + ": \"" + names[widest - 1] + "\" is followed by \"" + names[widest] +
                "\"; frames count as equally far apart in time, so one seems to be missing");
}

/// Colours are taken for sRGB's; the first frame tells of all.
void warn_of_profile(const fs::path& frame) {
  constexpr std::int64_t kMostHead = 1 << 16;  // bytes; a profile's name stands near the beginning
  const std::string profile = wide_profile(read_file_start(frame.string(), kMostHead));
  if (!profile.empty())
    log_warning(frame.string() + ": has the colour profile \"" + with_escapes(profile) +
                "\", which is passed over: colours are taken for sRGB's");
}

/// What else is in a folder that may have been meant for frames: "its 12 .jpg files are not read".
std::string unread_text(const std::map<std::string, Index>& count_of_ending) {
  std::string text;
  for (const auto& [ending, count] : count_of_ending)
    text += (text.empty() ? "its " : ", ") + std::to_string(count) + " " + ending;
  return text.empty() ? "" : text + " files are not read";
}

/// The .png files of a folder, but for hidden ones, in the order of their names.
std::vector<std::string> png_names(const fs::path& folder) {
  std::vector<std::string> names;
  std::map<std::string, Index> others;  // by ending
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (is_hidden(entry.path().string())) continue;
    const std::string ending = entry.path().extension().string();
    if (ending == ".png") names.push_back(entry.path().filename().string());
    if (ending != ".png" && !ending.empty() && is_plain_text(ending)) ++others[ending];
  }
  if (error) throw UserError(folder.string() + ": cannot be listed as a folder of frames: " + error.message());
  std::sort(names.begin(), names.end());
  check_characters(names, folder);
  check_numbering(names, folder);
  const std::string unread = unread_text(others);
  if (std::ssize(names) < kFewestFrames) {
    throw UserError(folder.string() + ": holds " + std::to_string(names.size()) +
                    " .png files; a clip needs at least 2 frames" + (unread.empty() ? "" : "; " + unread));
  }
  if (!unread.empty()) log_warning(folder.string() + ": " + unread);
  warn_of_gaps(names, folder);
  return names;
}

/// Numbers of the frames of `count` that are kept.
std::vector<Index> kept_frames(Index count, double video, double kept) {
  std::vector<Index> numbers;
  const double step = kept > 0 ? video / kept : 1;
  for (Index t = 0;; ++t) {
    const auto number = static_cast<Index>(std::llround(static_cast<double>(t) * step));
    if (number >= count) return numbers;
    numbers.push_back(number);
  }
}

/// The rate of the video, where frames are to be chosen by it.
double rate_of_video(const fs::path& path, double of_file, const FrameRates& rates) {
  const double video = rates.video > 0 ? rates.video : of_file;
  if (rates.kept > 0 && video == 0)
    throw UserError(path.string() + ": does not say how many frames a second it has, so that " +
                    number_text(rates.kept) + " of them cannot be kept; " + rates.video_word + " says it");
  return video;
}

/// @param video  frames a second, where they follow each other as usual
void check_kept_rate(const fs::path& path, double video, const FrameRates& rates) {
  if (rates.kept > video * (1 + 1e-9))
    throw UserError(path.string() + ": has " + rounded(video, 8) + " frames a second; " + rates.kept_word + ", " +
                    number_text(rates.kept) + ", cannot be more");
}

/// "but frame 4 comes 0.2333 s after frame 3", as the frames before do not.
std::string gap_text(const FrameTimes& times) {
  const TimeStep widest = widest_step(times);
  return "follow each other after " + rounded(usual_step(times), 4) + " s, but frame " +
         std::to_string(widest.before + 1) + " comes " + rounded(widest.seconds, 4) + " s after frame " +
         std::to_string(widest.before);
}

/// The frames of a video that are nearest to the moments of the kept rate, where they are not equally far apart in
/// time.
std::vector<Index> frames_by_time(const fs::path& path, const FrameTimes& times, const FrameRates& rates) {
  const double kept = rates.kept;
  if (kept == 0)
    throw UserError(path.string() + ": its frames " + gap_text(times) + "; set " + rates.kept_word +
                    ", for which the nearest ones in time are taken, or " + rates.video_word +
                    ", if they are equally far apart in truth");
  check_kept_rate(path, 1 / usual_step(times), rates);
  const double count = std::floor(times.seconds.back() * kept) + 1,
               most = kMostRepeats * static_cast<double>(times.seconds.size());
  if (count > most)
    throw DataError(path.string() + ": its frames " + gap_text(times) + ", so that " + number_text(kept) +
                    " a second would make " + rounded(count, 6) + " of its " + std::to_string(times.seconds.size()) +
                    "; allowed: at most " + rounded(most, 6) + ". Cut the video there, or set " + rates.video_word +
                    " if its frames are equally far apart in truth");
  const std::vector<Index> numbers = nearest_frames(times, kept);
  Index repeated = 0;
  for (std::size_t t = 1; t < numbers.size(); ++t) repeated += numbers[t] == numbers[t - 1] ? 1 : 0;
  log_warning(path.string() + ": its frames " + gap_text(times) + "; the nearest in time are taken" +
              (repeated == 0 ? ""
                             : ", one ahead of it again for " + std::to_string(repeated) + " of " +
                                   std::to_string(numbers.size())));
  return numbers;
}

/// The video called `name` in a folder; empty: there is none. Throws UserError where there are two.
fs::path video_in(const fs::path& folder, const std::string& name) {
  fs::path video;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().stem() != name || !is_video_name(entry.path().string())) continue;
    if (!video.empty())
      throw UserError(video.string() + ", " + entry.path().string() + ": both hold masks of \"" + name +
                      "\"; remove one");
    video = entry.path();
  }
  return video;
}

/// Of a folder, or a video without time stamps.
FrameTimes even_times(Index count, double rate) {
  FrameTimes times;
  for (Index i = 0; rate > 0 && i < count; ++i) times.seconds.push_back(static_cast<double>(i) / rate);
  return times;
}

/// How far from a frame's moment another may be and still be of it, seconds.
double reach_of_frames(const FrameTimes& times) { return usual_step(times) / 2; }

/// Whether a moment, in seconds, is near enough to that of a frame to be of it.
bool is_within(const FrameTimes& times, Index frame, double moment, double most) {
  return std::fabs(times.seconds[static_cast<std::size_t>(frame)] - moment) <= most;
}

std::string moment_text(const FrameTimes& times, Index frame) {
  return "frame " + std::to_string(frame) + " at " + rounded(times.seconds[static_cast<std::size_t>(frame)], 4) + " s";
}

std::string frame_of(const fs::path& video, Index number) {
  return video.string() + ": frame " + std::to_string(number);
}

}  // namespace

FrameSource::FrameSource(const fs::path& path, const FrameRates& rates) : path_(path) {
  std::vector<std::string> files;
  if (fs::is_directory(path)) {
    files = png_names(path);
    warn_of_profile(path / files.front());
  } else if (is_video_name(path.string())) {
    video_ = std::make_shared<detail::OpenVideo>(path);
  } else {
    throw UserError(path.string() + ": is neither a folder of frames nor a video (" + video_endings() + ")");
  }
  video_count_ = video_ ? video_->reader.frames() : std::ssize(files);
  video_rate_ = rate_of_video(path, video_ ? video_->reader.frame_rate() : 0, rates);
  is_uneven_ = video_ && rates.video == 0 && !are_even(video_->reader.times());
  if (is_uneven_) {
    numbers_ = frames_by_time(path, video_->reader.times(), rates);
  } else {
    if (rates.kept > 0) check_kept_rate(path, video_rate_, rates);
    numbers_ = kept_frames(video_count_, video_rate_, rates.kept);
  }
  frame_rate_ = rates.kept > 0 ? rates.kept : video_rate_;
  if (video_) times_ = video_->reader.times();
  if (times_.seconds.empty()) times_ = even_times(video_count_, video_rate_);
  for (const Index number : numbers_)
    names_.push_back(video_ ? four_digits(number) + ".png" : files[static_cast<std::size_t>(number)]);
  if (std::ssize(numbers_) < kFewestFrames)
    throw UserError(path.string() + ": gives " + std::to_string(numbers_.size()) + " of its " +
                    std::to_string(video_count_) + " frames; a clip needs at least 2");
}

bool FrameSource::has_name(const std::string& name) const {
  if (!video_) return fs::exists(path_ / name);
  const std::optional<Index> number = number_of(fs::path(name).stem().string());
  return number && *number < video_count_ && name == four_digits(*number) + ".png";
}

std::string FrameSource::place(Index frame) const {
  return video_ ? frame_of(path_, number(frame)) : (path_ / names_[static_cast<std::size_t>(frame)]).string();
}

double FrameSource::time(Index frame) const {
  if (is_uneven_) return video_->reader.times().seconds[static_cast<std::size_t>(number(frame))];
  return static_cast<double>(number(frame)) / video_rate_;
}

Image FrameSource::read(Index frame) const {
  if (video_) return video_->read(number(frame));
  Image image = read_image(place(frame));
  check_opaque(image, place(frame), "a frame");
  return image;
}

MaskSource::MaskSource(const fs::path& folder, const std::string& name) : path_(folder / name) {
  const fs::path video = video_in(folder, name);
  if (fs::is_directory(path_)) {
    if (!video.empty())
      throw UserError(path_.string() + ", " + video.string() + ": both hold masks of \"" + name + "\"; remove one");
    return;
  }
  if (video.empty())
    throw DataError(path_.string() + ": there is no such folder of masks, nor a video \"" + name + ".mp4\"");
  path_ = video;
  video_ = std::make_shared<detail::OpenVideo>(video);
}

Index MaskSource::missing(const FrameSource& frames) const {
  if (!video_) {
    Index missing = 0;
    for (Index t = 0; t < frames.count(); ++t) missing += fs::exists(file(frames, t)) ? 0 : 1;
    return missing;
  }
  const Index count = video_->reader.frames();
  if (count == frames.video_count()) return 0;
  const FrameTimes &masks = video_->reader.times(), &times = frames.times();
  if (goes_by_number(frames))
    throw DataError(path_.string() + ": has " + std::to_string(count) + " frames, the video has " +
                    std::to_string(frames.video_count()) +
                    "; allowed: as many, as times by which masks could be found are not known of both");
  const double most = reach_of_frames(times);
  for (Index t = 0; t < frames.count(); ++t) {
    const Index frame = frames.number(t), nearest = number(frames, t);
    if (is_within(masks, nearest, times.seconds[static_cast<std::size_t>(frame)], most)) continue;
    throw DataError(path_.string() + ": has no mask for the video's " + moment_text(times, frame) +
                    "; the nearest is its " + moment_text(masks, nearest) + ", allowed: within " + rounded(most, 4) +
                    " s, or as many frames as the video, " + std::to_string(frames.video_count()));
  }
  return 0;
}

std::string MaskSource::other_times(const FrameSource& frames) const {
  if (!video_ || video_->reader.frames() != frames.video_count()) return "";
  const FrameTimes &masks = video_->reader.times(), &times = frames.times();
  if (masks.seconds.empty() || times.seconds.empty()) return "";
  const double most = reach_of_frames(times);
  for (Index i = 0; i < frames.video_count(); ++i) {
    if (is_within(masks, i, times.seconds[static_cast<std::size_t>(i)], most)) continue;
    return path_.string() + ": its " + moment_text(masks, i) + " is taken for the video's " + moment_text(times, i) +
           ", as both have " + std::to_string(frames.video_count()) + " frames";
  }
  return "";
}

bool MaskSource::goes_by_number(const FrameSource& frames) const {
  return video_->reader.frames() == frames.video_count() || video_->reader.times().seconds.empty() ||
         frames.times().seconds.empty();
}

Index MaskSource::number(const FrameSource& frames, Index frame) const {
  const Index number = frames.number(frame);
  if (goes_by_number(frames)) return number;
  return nearest_frame(video_->reader.times(), frames.times().seconds[static_cast<std::size_t>(number)]);
}

MaskSource::Count MaskSource::count(const FrameSource& frames) const {
  Count count;
  if (video_) {
    count.all = video_->reader.frames();
    if (goes_by_number(frames)) return count;
    const FrameTimes& masks = video_->reader.times();
    const double most = reach_of_frames(frames.times());
    std::set<Index> used;
    for (const double moment : frames.times().seconds) {
      const Index nearest = nearest_frame(masks, moment);
      if (is_within(masks, nearest, moment, most)) used.insert(nearest);
    }
    count.unused = count.all - std::ssize(used);
    return count;
  }
  std::error_code ignored;  // single masks that cannot be read are told when they are
  for (const fs::directory_entry& entry : fs::directory_iterator(path_, ignored)) {
    if (is_hidden(entry.path().string())) continue;
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".png") {
      count.others.push_back(name);
      continue;
    }
    ++count.all;
    count.unused += frames.has_name(name) ? 0 : 1;
  }
  std::sort(count.others.begin(), count.others.end());
  return count;
}

fs::path MaskSource::file(const FrameSource& frames, Index frame) const {
  return video_ ? fs::path() : path_ / frames.names()[static_cast<std::size_t>(frame)];
}

std::string MaskSource::place(const FrameSource& frames, Index frame) const {
  return video_ ? frame_of(path_, number(frames, frame)) : file(frames, frame).string();
}

Image MaskSource::read(const FrameSource& frames, Index frame) const {
  if (!video_ && !fs::exists(file(frames, frame))) return {};
  const std::string name = place(frames, frame);
  return video_ ? mask_of(video_->read(number(frames, frame)), name) : read_mask_image(name);
}

}  // namespace hsi4d
