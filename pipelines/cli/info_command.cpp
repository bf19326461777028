#include "pipelines/cli/info_command.h"

#include <algorithm>
#include <vector>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/exr.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "core/suggest.h"
#include "pipelines/cli/text.h"
#include "splat/info.h"
#include "splat/splat_file.h"

namespace hsi4d::cli {
namespace {

std::string distribution_text(const Distribution& d) {
  return short_number(d.smallest) + ", " + short_number(d.percentile_5) + ", " + short_number(d.median) + ", " +
         short_number(d.percentile_95) + ", " + short_number(d.largest);
}

std::string ply_info(const std::string& path) {
  const SplatFile scene = read_splats(path);
  const GaussianStatistics s = statistics_of(scene.gaussians);
  std::string text = path + ": " + std::to_string(s.count) + " Gaussians, spherical harmonics of degree " +
                     std::to_string(s.sh_degree) + "\n";
  const std::string left_out = summary_text(scene.report);
  if (!left_out.empty()) text += "  " + left_out + "\n";
  if (s.count == 0) return text;
  text += "  bounds   ";
  for (int c = 0; c < 3; ++c)
    text += std::string(c > 0 ? ", " : "") + "xyz"[c] + " " + short_number(s.lower_world[c]) + " to " +
            short_number(s.upper_world[c]);
  text += " m\n";
  text += "  opacity  " + distribution_text(s.opacity) + "\n";
  text += "  scale    " + distribution_text(s.scale) + " m\n";
  return text + "  (smallest, 5 %, median, 95 %, largest; scale: standard deviations along all axes)\n";
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

std::string npy_info(const std::string& path) { return path + ": an array\n" + array_line("", read_npy(path)); }

std::string camera_line(const Camera& camera) {
  const Vector3<double> center = camera_center_world(camera);
  return std::to_string(camera.width) + " x " + std::to_string(camera.height) + " pixels, fx " +
         short_number(camera.fx) + ", fy " + short_number(camera.fy) + ", cx " + short_number(camera.cx) + ", cy " +
         short_number(camera.cy) + ", at (" + short_number(center[0]) + ", " + short_number(center[1]) + ", " +
         short_number(center[2]) + ") m\n";
}

std::string camera_info(const std::string& path) {
  const std::vector<Camera> cameras = read_cameras(path);
  std::string text = path + ": " + std::to_string(cameras.size()) + (cameras.size() == 1 ? " camera\n" : " cameras\n");
  for (std::size_t i = 0; i < cameras.size(); ++i) text += "  " + std::to_string(i) + "  " + camera_line(cameras[i]);
  return text;
}

std::string size_text(const Image& image) {
  return std::to_string(image.width()) + " x " + std::to_string(image.height()) + " pixels";
}

std::string image_info(const std::string& path) {
  static const std::vector<std::string> kinds = {"grey", "grey and alpha", "RGB", "RGB and alpha"};
  const Image image = read_image(path);
  const auto channels = static_cast<std::size_t>(image.channels());
  return path + ": " + size_text(image) + ", " + std::to_string(channels) + " channel" + (channels == 1 ? "" : "s") +
         (channels <= kinds.size() ? " (" + kinds[channels - 1] + ")" : "") + "\n";
}

std::string exr_info(const std::string& path) {
  const Layers layers = read_layers(path);
  std::string text = path + ": " + size_text(layers.planes) + ", layers";
  for (const std::string& name : layers.names) text += " " + name;
  return text + "\n";
}

struct Kind {
  const char* ending;
  std::string (*info)(const std::string&);
};
constexpr Kind kKinds[] = {{".ply", ply_info},   {".npz", npz_info},   {".npy", npy_info},    {".json", camera_info},
                           {".png", image_info}, {".jpg", image_info}, {".jpeg", image_info}, {".exr", exr_info}};

}  // namespace

std::string info_command(const std::string& path) {
  const std::string ending = file_ending(path);
  std::vector<std::string> known;
  for (const Kind& kind : kKinds) {
    if (ending == kind.ending) return kind.info(path);
    known.emplace_back(kind.ending);
  }
  throw UserError("hsi4d info: " + path + ": nothing is known of files that end in \"" + ending +
                  "\"; allowed: " + joined(known) + did_you_mean(ending, known));
}

}  // namespace hsi4d::cli
