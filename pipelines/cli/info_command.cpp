#include "pipelines/cli/info_command.h"

#include <algorithm>
#include <filesystem>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/exr.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "core/npz.h"
#include "core/safetensors.h"
#include "core/suggest.h"
#include "core/text.h"
#include "core/video.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/text.h"
#include "pipelines/input/frame_source.h"
#include "splat/files/info.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {
namespace {

std::string distribution_text(const Distribution& d) {
  return short_number(d.smallest) + ", " + short_number(d.percentile_5) + ", " + short_number(d.median) + ", " +
         short_number(d.percentile_95) + ", " + short_number(d.largest);
}

/// "12.3 %", or "0" for none.
std::string share_text(Index count, Index all) {
  return count == 0 ? "0" : short_number(100 * static_cast<double>(count) / static_cast<double>(all)) + " %";
}

std::string histogram_text(const std::string& name, const Histogram& h) {
  constexpr Index kWidest = 40;
  Index all = 0, most = 1;
  for (const Index count : h.counts) all += count, most = std::max(most, count);
  std::string text;
  for (std::size_t i = 0; i < h.counts.size(); ++i) {
    std::string range = short_number(h.edges[i]) + " to " + short_number(h.edges[i + 1]);
    range.resize(std::max<std::size_t>(range.size(), 18), ' ');
    std::string share = share_text(h.counts[i], all);
    share.resize(std::max<std::size_t>(share.size() + 1, 11), ' ');
    const Index width = (h.counts[i] * kWidest + most - 1) / most;  // at least one where there is one
    std::string line = (i == 0 ? name : std::string(name.size(), ' ')) + range + " " + share +
                       std::string(static_cast<std::size_t>(width), '#');
    line.erase(line.find_last_not_of(' ') + 1);
    text += "  " + line + "\n";
  }
  return text;
}

Counts suspicion_counts(const Suspicions& s) {
  Counts found;
  const auto add = [&found](const char* what, Index count) {
    if (count > 0) found.emplace_back(what, count);
  };
  add("at the place of an earlier one", s.duplicates);
  add("fainter than 1/255", s.transparent);
  add("larger than the scene", s.huge);
  add("needles (100 : 1)", s.needles);
  return found;
}

std::string splat_info(const std::string& path) {
  const SplatFile file = read_splats(path);
  const GaussianStatistics s = statistics_of(file.gaussians);
  std::string text = path + ": " + count_text(s.count, "Gaussian") + ", spherical harmonics of degree " +
                     std::to_string(s.sh_degree) + ", " + file.report.format + "\n";
  const std::string faults = summary_text(file.report);
  text += "  faults   " + (faults.empty() ? "none" : faults) + "\n";
  for (const std::string& caution : file.report.cautions) text += "  caution  " + caution + "\n";
  if (file.report.antialiased) text += "  note     trained with antialiasing: render.antialias=true draws it so\n";
  for (const std::string& note : file.report.notes) text += "  note     " + note + "\n";
  if (s.count == 0)
    return text + "  notice   " + (file.report.rows == 0 ? "the file holds no Gaussians" : "no Gaussian is left") +
           "\n";
  return text + statistics_text(s);
}

using Json = nlohmann::ordered_json;

Json json_of(const Distribution& d, const Histogram& h) {
  return {{"smallest", d.smallest}, {"percentile_5", d.percentile_5},
          {"median", d.median},     {"percentile_95", d.percentile_95},
          {"largest", d.largest},   {"histogram", {{"edges", h.edges}, {"counts", h.counts}}}};
}

Json json_of(const Counts& counts) {
  Json object = Json::object();
  for (const auto& [reason, count] : counts) object[reason] = count;
  return object;
}

/// As splat_info, for programs.
std::string splat_json(const std::string& path) {
  const SplatFile file = read_splats(path);
  const SplatReport& report = file.report;
  const GaussianStatistics s = statistics_of(file.gaussians);
  Json json = {
      {"file", path}, {"format", report.format}, {"rows", report.rows}, {"count", s.count}, {"sh_degree", s.sh_degree}};
  json["faults"] = {
      {"rejected", report.rejected}, {"rejections", json_of(report.rejections)}, {"repairs", json_of(report.repairs)}};
  json["cautions"] = report.cautions;
  json["antialiased"] = report.antialiased;
  json["notes"] = report.notes;
  json["suspicious"] = {{"duplicates", s.suspicions.duplicates},
                        {"transparent", s.suspicions.transparent},
                        {"huge", s.suspicions.huge},
                        {"needles", s.suspicions.needles}};
  if (s.count > 0) {
    json["bounds"] = {{"lower", {s.lower_world[0], s.lower_world[1], s.lower_world[2]}},
                      {"upper", {s.upper_world[0], s.upper_world[1], s.upper_world[2]}}};
    json["opacity"] = json_of(s.opacity, s.opacity_histogram);
    json["scale"] = json_of(s.scale, s.scale_histogram);
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string array_line(const std::string& name, const NpyArray& array) {
  return "  " + name + "  " + shape_text(array.shape()) + "  " + array.dtype() + "\n";
}

std::string npz_info(const std::string& path) {
  const Npz npz = Npz::read(path);
  std::string text = path + ": " + std::to_string(npz.names().size()) + " arrays\n";
  for (const std::string& name : npz.names()) text += array_line(name, npz.array(name));
  for (const Npz::Skipped& skipped : npz.skipped())
    text += "  " + skipped.name + "  not read: " + skipped.reason + "\n";
  return text;
}

std::string safetensors_info(const std::string& path) {
  const Safetensors file = Safetensors::read(path);
  std::string text = path + ": " + std::to_string(file.names().size()) + " arrays\n";
  for (const std::string& name : file.names()) text += array_line(name, file.array(name));
  for (const auto& [key, value] : file.metadata()) text += "  " + key + "  " + with_escapes(value) + "\n";
  return text;
}

std::string npy_info(const std::string& path) { return path + ": an array\n" + array_line("", read_npy(path)); }

std::string camera_line(const Camera& camera) {
  const Vector3<double> center = camera_center_world(camera);
  return std::to_string(camera.width) + " x " + std::to_string(camera.height) + " pixels, fx " +
         short_number(camera.fx) + ", fy " + short_number(camera.fy) + ", cx " + short_number(camera.cx) + ", cy " +
         short_number(camera.cy) + ", at (" + short_number(center[0]) + ", " + short_number(center[1]) + ", " +
         short_number(center[2]) + ") m\n";
}

std::string camera_info(const std::string& path) {
  const std::vector<PictureCamera> cameras = read_picture_cameras(path);
  std::string text = path + ": " + std::to_string(cameras.size()) + (cameras.size() == 1 ? " camera\n" : " cameras\n");
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const std::string& picture = cameras[i].picture;
    text += "  " + std::to_string(i) + "  " + (picture.empty() ? "" : with_escapes(picture) + "  ") +
            camera_line(cameras[i].camera);
  }
  return text;
}

/// Whether an object has a member that only files of cameras have.
bool is_of_cameras(const ConfigValue& object) {
  const ConfigValue* const frames = find_member(object, "frames");
  const auto has = [&](const char* key) { return find_member(object, key) != nullptr; };
  return (frames != nullptr && frames->kind == ConfigValue::Kind::kArray) || has("format") || has("cameras") ||
         has("width") || has("world_to_camera");
}

/// Cameras, or of another object the names of its members.
std::string json_info(const std::string& path) {
  const ConfigValue tree = parse_json_text(read_text_file(path), path);
  if (tree.kind != ConfigValue::Kind::kObject || tree.members.empty() || is_of_cameras(tree)) return camera_info(path);
  const bool is_config = find_member(tree, "stages") != nullptr || find_member(tree, "data") != nullptr;
  std::string text = path + ": " + (is_config ? "a config (`hsi4d check` tells its faults)" : "JSON") + " with";
  for (const ConfigMember& member : tree.members) text += " " + with_escapes(member.key);
  return text + "\n";
}

std::string pixels_text(const Image& image) {
  return std::to_string(image.width()) + " x " + std::to_string(image.height()) + " pixels";
}

std::string image_info(const std::string& path) {
  static const std::vector<std::string> kinds = {"grey", "grey and alpha", "RGB", "RGB and alpha"};
  const Image image = read_image(path);
  const auto channels = static_cast<std::size_t>(image.channels());
  return path + ": " + pixels_text(image) + ", " + std::to_string(channels) + " channel" + (channels == 1 ? "" : "s") +
         (channels <= kinds.size() ? " (" + kinds[channels - 1] + ")" : "") + "\n";
}

std::string exr_info(const std::string& path) {
  const Layers layers = read_layers(path);
  std::string text = path + ": " + pixels_text(layers.planes) + ", layers";
  for (const std::string& name : layers.names) text += " " + name;
  return text + "\n";
}

/// Whether a folder holds a .png file: frames.
bool has_frames(const std::string& path) {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(path, error))
    if (entry.path().extension() == ".png") return true;
  return false;
}

struct InfoArguments {
  std::string file;
  bool json = false;
  std::optional<double> video_rate, frame_rate;
};

std::string info_of(const InfoArguments& a) {
  if (!a.json && (is_video_name(a.file) || has_frames(a.file))) return video_info(a.file, a.video_rate, a.frame_rate);
  if (a.video_rate || a.frame_rate)
    throw UserError("hsi4d info: --video-rate and --frame-rate are of a video or a folder of frames");
  return info_command(a.file, a.json);
}

struct Kind {
  const char* ending;
  std::string (*info)(const std::string&);
};
constexpr Kind kOtherKinds[] = {{".npz", npz_info},    {".npy", npy_info},   {".safetensors", safetensors_info},
                                {".json", json_info},  {".png", image_info}, {".jpg", image_info},
                                {".jpeg", image_info}, {".exr", exr_info}};

}  // namespace

std::string statistics_text(const GaussianStatistics& s) {
  std::string text;
  const Counts suspicious = suspicion_counts(s.suspicions);
  if (!suspicious.empty()) text += "  notice   " + counts_text(suspicious) + "\n";
  text += "  bounds   ";
  for (int c = 0; c < 3; ++c)
    text += std::string(c > 0 ? ", " : "") + "xyz"[c] + " " + short_number(s.lower_world[c]) + " to " +
            short_number(s.upper_world[c]);
  text += " m\n";
  text += "  opacity  " + distribution_text(s.opacity) + "\n";
  text += "  scale    " + distribution_text(s.scale) + " m\n";
  text += "  (smallest, 5 %, median, 95 %, largest; scale: standard deviations along all axes)\n";
  text += histogram_text("opacity  ", s.opacity_histogram);
  return text + histogram_text("scale    ", s.scale_histogram);
}

std::vector<std::string> info_endings() {
  std::vector<std::string> endings = splat_endings();
  for (const Kind& kind : kOtherKinds) endings.emplace_back(kind.ending);
  return endings;
}

std::string video_info(const std::string& path, std::optional<double> video_rate, std::optional<double> frame_rate) {
  check_rate(video_rate, "hsi4d info: --video-rate");
  check_rate(frame_rate, "hsi4d info: --frame-rate");
  const FrameSource frames(path, {video_rate.value_or(0), frame_rate.value_or(0), "--video-rate", "--frame-rate"});
  const Image first = frames.read(0);
  const std::string rate = frames.video_rate() > 0 ? rounded(frames.video_rate(), 6) + " a second" : "no rate is known";
  return path + ": " + count_text(frames.video_count(), "frame") + " of " + pixels_text(first) + ", " + rate +
         (frames.count() == frames.video_count() && !frame_rate
              ? ""
              : "; a clip of " + rounded(frames.frame_rate(), 6) + " a second has " +
                    count_text(frames.count(), "frame")) +
         "\n";
}

std::string info_command(const std::string& path, bool json) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw UserError("hsi4d info: " + path +
                    " is a folder without .png frames; allowed: a file, or a folder of frames (`hsi4d report` and "
                    "`hsi4d evaluate` tell of the folder of a run)");
  if (json) {
    if (is_splat_file(path)) return splat_json(path);
    throw UserError("hsi4d info: --json tells of Gaussians; allowed: " + joined(splat_endings()));
  }
  if (is_splat_file(path)) return splat_info(path);
  const std::string ending = file_ending(path);
  for (const Kind& kind : kOtherKinds) {
    if (ending == kind.ending) return kind.info(path);
  }
  const std::vector<std::string> known = info_endings();
  throw UserError("hsi4d info: " + path + ": nothing is known of files that end in \"" + ending +
                  "\"; allowed: " + joined(known) + " and videos: " + video_endings() + did_you_mean(ending, known));
}

void add_info(CLI::App& app, Program& program) {
  InfoArguments& a = program.options<InfoArguments>();
  CLI::App* info =
      app.add_subcommand("info", "Tell what is in a file: Gaussians, arrays, cameras, an image, a video, a config");
  info->add_option("FILE", a.file, "A " + joined(info_endings(), " or ") + " file, a video, or a folder of frames")
      ->required();
  info->add_flag("--json", a.json, "Print one JSON object; for Gaussians");
  info->add_option("--video-rate", a.video_rate, "Of a video: its frames a second; default: as it says")
      ->type_name("HZ");
  info->add_option("--frame-rate", a.frame_rate, "Of a video: the frames a second that a clip keeps; default: all")
      ->type_name("HZ");
  run_when_chosen(*info, program, [&] { return info_of(a); });
}

}  // namespace hsi4d::cli
