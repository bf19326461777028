#include "core/video_probe.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/log.h"
#include "core/process.h"
#include "core/screen_colors.h"
#include "core/text.h"

namespace hsi4d {

namespace {

// Pictures from this size on have BT.709's matrix where a file does not say its own.
constexpr std::int64_t kLinesOf709 = 720, kColumnsOf709 = 1280;

using Facts = std::map<std::string, std::string, std::less<>>;

/// A video of the file.
struct VideoStream {
  Facts facts;
  std::vector<std::optional<std::int64_t>> stamps;  ///< of its frames, in units of time_base
  std::optional<Index> interlaced;                  ///< the first such frame
};

/// ffprobe's standard output. What it says of damage goes elsewhere, and lines stay whole.
std::string probed_lines(const std::string& path) {
  ChildProcess ffprobe(
      {"ffprobe", "-v", "error", "-protocol_whitelist", "file", "-select_streams", "v", "-show_entries",
       "stream=index,pix_fmt,width,height,color_space,color_transfer,color_primaries,"
       "sample_aspect_ratio,field_order,avg_frame_rate,time_base:stream_disposition=attached_pic:"
       "stream_side_data=dv_profile:stream_tags=alpha_mode:frame=stream_index,best_effort_timestamp,interlaced_frame",
       "-of", "compact", ffmpeg_input(path)},
      ChildOutput::kRead);
  std::string lines;
  std::vector<uint8_t> part(1 << 16);
  for (std::size_t count = part.size(); count == part.size();) {
    count = ffprobe.read(part);
    lines.append(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(count));
  }
  try {
    ffprobe.finish();
  } catch (const UserError& error) {
    throw DataError(path + ": is not a video that can be read: " + error.what());
  }
  return lines;
}

/// Of a line "stream|index=0|width=64|...".
Facts facts_of(const std::string& line) {
  Facts facts;
  std::istringstream parts(line);
  for (std::string part; std::getline(parts, part, '|');) {
    const std::size_t equals = part.find('=');
    if (equals != std::string::npos) facts.emplace(part.substr(0, equals), part.substr(equals + 1));
  }
  return facts;
}

std::string fact(const Facts& facts, std::string_view key) {
  const auto found = facts.find(key);
  return found == facts.end() ? "" : found->second;
}

/// Nothing where it is no whole number, "N/A" for one.
std::optional<std::int64_t> whole(const std::string& text) {
  std::int64_t number = 0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), number);
  if (end.ec != std::errc() || end.ptr != text.data() + text.size()) return std::nullopt;
  return number;
}

/// A ratio of two positive numbers, "30/1" or "4:3"; nothing for others.
std::optional<std::pair<std::int64_t, std::int64_t>> ratio(const std::string& text, char sign) {
  const std::size_t at = text.find(sign);
  if (at == std::string::npos) return std::nullopt;
  const auto over = whole(text.substr(0, at)), under = whole(text.substr(at + 1));
  if (!over || !under || *over < 1 || *under < 1) return std::nullopt;
  return std::pair{*over, *under};
}

double quotient(const std::string& text) {
  const auto numbers = ratio(text, '/');
  return numbers ? static_cast<double>(numbers->first) / static_cast<double>(numbers->second) : 0;
}

/// The videos of a file by number, pictures that are attached to it left out.
std::map<std::int64_t, VideoStream> streams_in(const std::string& lines) {
  std::map<std::int64_t, VideoStream> streams;
  std::istringstream text(lines);
  for (std::string line; std::getline(text, line);) {
    Facts facts = facts_of(line);
    if (line.starts_with("stream|")) {
      if (const auto index = whole(fact(facts, "index"))) streams[*index].facts = std::move(facts);
    } else if (line.starts_with("frame|")) {
      const auto index = whole(fact(facts, "stream_index"));
      if (!index) continue;
      VideoStream& stream = streams[*index];
      if (fact(facts, "interlaced_frame") == "1" && !stream.interlaced) stream.interlaced = std::ssize(stream.stamps);
      stream.stamps.push_back(whole(fact(facts, "best_effort_timestamp")));
    }
  }
  std::erase_if(streams, [](const auto& entry) { return fact(entry.second.facts, "disposition:attached_pic") == "1"; });
  return streams;
}

std::string stream_text(std::int64_t number, const VideoStream& stream) {
  return std::to_string(number) + " (" + fact(stream.facts, "width") + "x" + fact(stream.facts, "height") + ", " +
         std::to_string(stream.stamps.size()) + " frames)";
}

/// The first that is more than one picture.
std::pair<std::int64_t, VideoStream> choose_stream(const std::string& path,
                                                   const std::map<std::int64_t, VideoStream>& streams) {
  std::vector<std::int64_t> videos;
  bool has_picture = false;
  for (const auto& [number, stream] : streams) {
    if (stream.stamps.size() > 1) videos.push_back(number);
    has_picture = has_picture || stream.stamps.size() == 1;
  }
  if (videos.empty())
    throw DataError(path + (has_picture ? ": holds one picture and no video" : ": holds no video that can be read"));
  std::vector<std::string> others;
  for (const std::int64_t number : videos) others.push_back(stream_text(number, streams.at(number)));
  const std::string chosen = others.front();
  others.erase(others.begin());
  if (!others.empty())
    log_warning(path + ": holds " + std::to_string(videos.size()) + " videos; stream " + chosen + " is read, not " +
                joined(others));
  return {videos.front(), streams.at(videos.front())};
}

// ---- What cannot be read rightly ----

bool is_unknown(const std::string& value) {
  return value.empty() || value == "unknown" || value == "unspecified" || value == "reserved" || value == "N/A";
}

template <std::size_t N>
bool is_among(const std::string& value, const std::array<std::string_view, N>& words) {
  return std::find(words.begin(), words.end(), value) != words.end();
}

// As ffmpeg calls them.
constexpr std::array<std::string_view, 6> kMatrices = {"bt709", "smpte170m", "bt470bg", "fcc", "smpte240m", "gbr"};

bool has_part(const std::string& text, const std::vector<std::string>& parts) {
  return std::any_of(parts.begin(), parts.end(),
                     [&](const std::string& part) { return text.find(part) != std::string::npos; });
}

bool has_alpha(const std::string& pixels) {
  return has_part(pixels, {"yuva", "vuya", "ayuv", "gbrap", "rgba", "bgra", "argb", "abgr", "ya8", "ya16"});
}

/// Whether colours are made from brightness and two differences, for which a matrix is needed.
bool needs_matrix(const std::string& pixels) {
  return !has_part(pixels, {"rgb", "bgr", "gbr", "gray", "pal8", "mono", "ya8", "ya16"});
}

void check_colors(const std::string& path, const Facts& facts) {
  constexpr const char* kWay = "; allowed are colours of BT.709 or BT.601, which ffmpeg's zscale and tonemap make";
  const std::string transfer = fact(facts, "color_transfer"), matrix = fact(facts, "color_space"),
                    primaries = fact(facts, "color_primaries"), pixels = fact(facts, "pix_fmt");
  if (!is_unknown(transfer) && !has_name(kScreenTransfers, transfer)) {
    const char* name = transfer == "smpte2084" ? " (PQ, HDR)" : transfer == "arib-std-b67" ? " (HLG, HDR)" : "";
    throw DataError(path + ": has the transfer " + transfer + name + kWay);
  }
  const auto is_profile_5 = [](const auto& entry) {
    return entry.first.ends_with("dv_profile") && entry.second == "5";
  };
  if (std::any_of(facts.begin(), facts.end(), is_profile_5))
    throw DataError(path + ": is Dolby Vision of profile 5 (HDR)" + kWay);
  if (!is_unknown(matrix) && !is_among(matrix, kMatrices))
    throw DataError(path + ": has the colour matrix " + matrix + kWay);
  if (!is_unknown(primaries) && !has_name(kScreenPrimaries, primaries))
    throw DataError(path + ": has the primaries " + primaries + kWay);
  const bool has_second_stream = fact(facts, "tag:alpha_mode") == "1";  // WebM
  if (has_alpha(pixels) || has_second_stream)
    throw DataError(path + ": has an alpha channel (" + (has_second_stream ? "alpha_mode 1" : pixels) +
                    "), which is not read; make a video without (ffmpeg's -pix_fmt yuv444p), of masks the alpha as "
                    "grey (-vf alphaextract)");
}

void check_squareness(const std::string& path, const Facts& facts) {
  const std::string aspect = fact(facts, "sample_aspect_ratio");
  const auto numbers = ratio(aspect, ':');
  if (!numbers) return;
  const std::int64_t side = std::max(whole(fact(facts, "width")).value_or(0), whole(fact(facts, "height")).value_or(0));
  const double stretch = static_cast<double>(numbers->first) / static_cast<double>(numbers->second);
  if (std::fabs(stretch - 1) * static_cast<double>(side) <= 1) return;
  throw DataError(path + ": has pixels that are not square (sample aspect ratio " + aspect +
                  "); ffmpeg's -vf scale=iw*sar:ih,setsar=1 makes them so");
}

void check_fields(const std::string& path, const VideoStream& stream) {
  const std::string order = fact(stream.facts, "field_order");
  const bool is_said = order == "tt" || order == "bb" || order == "tb" || order == "bt";
  if (!is_said && !stream.interlaced) return;
  throw DataError(path + ": is interlaced (" +
                  (is_said ? "field order " + order : "frame " + std::to_string(*stream.interlaced)) +
                  "); allowed are whole pictures, which ffmpeg's -vf yadif makes");
}

std::string assumed_matrix(const std::string& path, const Facts& facts) {
  if (!is_unknown(fact(facts, "color_space")) || !needs_matrix(fact(facts, "pix_fmt"))) return "";
  const bool is_large = whole(fact(facts, "height")).value_or(0) >= kLinesOf709 ||
                        whole(fact(facts, "width")).value_or(0) >= kColumnsOf709;
  log_warning(path + ": does not say its colour matrix; " + (is_large ? "BT.709" : "BT.601") +
              " is assumed, as players do for videos " + (is_large ? "from " : "below ") + std::to_string(kLinesOf709) +
              " lines" + (is_large ? " on" : ""));
  return is_large ? "bt709" : "smpte170m";
}

// ---- Times ----

/// Empty where a frame has no time stamp.
FrameTimes times_of(const std::string& path, const VideoStream& stream) {
  FrameTimes times{{}, quotient(fact(stream.facts, "time_base"))};
  for (const std::optional<std::int64_t>& stamp : stream.stamps) {
    if (!stamp || times.tick == 0) return {};
    const double second = static_cast<double>(*stamp - *stream.stamps.front()) * times.tick;
    if (!times.seconds.empty() && second < times.seconds.back())
      throw DataError(path + ": the time stamp of frame " + std::to_string(times.seconds.size()) + ", " +
                      number_text(second) + " s after the first, is before that of the frame ahead of it, " +
                      number_text(times.seconds.back()) + " s");
    times.seconds.push_back(second);
  }
  return times;
}

/// The rate that the file says, unless even time stamps say another.
double rate_of(double said, const FrameTimes& times) {
  if (times.seconds.size() < 2 || times.seconds.back() <= 0 || !are_even(times)) return said;
  const double steps = static_cast<double>(times.seconds.size() - 1);
  return said > 0 && std::fabs(times.seconds.back() * said - steps) < 0.5 ? said : steps / times.seconds.back();
}

}  // namespace

std::string ffmpeg_input(const std::string& path) { return "file:" + path; }

VideoFacts probe_video(const std::string& path) {
  const auto [number, stream] = choose_stream(path, streams_in(probed_lines(path)));
  check_colors(path, stream.facts);
  check_squareness(path, stream.facts);
  check_fields(path, stream);
  VideoFacts facts;
  facts.stream = static_cast<int>(number);
  facts.frames = std::ssize(stream.stamps);
  facts.times = times_of(path, stream);
  facts.frame_rate = rate_of(quotient(fact(stream.facts, "avg_frame_rate")), facts.times);
  facts.set_matrix = assumed_matrix(path, stream.facts);
  return facts;
}

}  // namespace hsi4d
