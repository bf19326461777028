#include "pipelines/photos/colmap.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <functional>
#include <map>
#include <optional>
#include <string_view>

#include "core/check.h"
#include "core/file.h"
#include "core/quaternion.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {

namespace fs = std::filesystem;

namespace {

constexpr std::int64_t kLargestSide = 65536;  // pixels
constexpr std::int64_t kMaxFile = std::int64_t{16} << 30;

/// COLMAP's numbers of its camera models, from 0.
struct Model {
  const char* name;
  std::size_t parameters;  // 0: not read
};
constexpr std::array<Model, 11> kModels = {{{"SIMPLE_PINHOLE", 3},
                                            {"PINHOLE", 4},
                                            {"SIMPLE_RADIAL", 4},
                                            {"RADIAL", 5},
                                            {"OPENCV", 8},
                                            {"OPENCV_FISHEYE", 0},
                                            {"FULL_OPENCV", 0},
                                            {"FOV", 0},
                                            {"SIMPLE_RADIAL_FISHEYE", 0},
                                            {"RADIAL_FISHEYE", 0},
                                            {"THIN_PRISM_FISHEYE", 0}}};

UserError refused_model(const std::string& where, const std::string& name) {
  return UserError(where + ": the camera model " + name +
                   " is not read; allowed: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV (COLMAP's "
                   "image_undistorter makes pinholes of all)");
}

/// A camera without a pose.
struct Intrinsics {
  Camera camera;
  Lens lens;
};
using IntrinsicsById = std::map<std::int64_t, Intrinsics>;

Intrinsics intrinsics_of(std::size_t model, std::int64_t width, std::int64_t height, const std::vector<double>& p,
                         const std::string& where) {
  if (width < 1 || width > kLargestSide || height < 1 || height > kLargestSide)
    throw DataError(where + ": " + std::to_string(width) + " x " + std::to_string(height) + " pixels; allowed: 1 to " +
                    std::to_string(kLargestSide));
  Intrinsics result;
  const bool one_focal = model == 0 || model == 2 || model == 3;
  const std::size_t after = one_focal ? 1 : 2;  // the principal point, then the lens
  result.camera.width = static_cast<int>(width);
  result.camera.height = static_cast<int>(height);
  result.camera.fx = p[0];
  result.camera.fy = one_focal ? p[0] : p[1];
  result.camera.cx = p[after];
  result.camera.cy = p[after + 1];
  const auto lens = [&](std::size_t i) { return after + 2 + i < p.size() ? p[after + 2 + i] : 0.0; };
  result.lens = {.k1 = lens(0), .k2 = lens(1), .p1 = lens(2), .p2 = lens(3)};
  const bool is_finite = std::all_of(p.begin(), p.end(), [](double x) { return std::isfinite(x); });
  if (!is_finite || !(result.camera.fx > 0) || !(result.camera.fy > 0))
    throw DataError(where + ": the focal length is " + number_text(result.camera.fx) +
                    ", or a parameter is not finite; allowed: finite, focal lengths above 0");
  return result;
}

PosedImage image_of(const std::array<double, 7>& pose, std::int64_t camera, std::string name,
                    const IntrinsicsById& cameras, const std::string& where) {
  const auto found = cameras.find(camera);
  if (found == cameras.end())
    throw DataError(where + ": is of camera " + std::to_string(camera) + ", which the cameras' file does not have");
  constexpr double kLengthTolerance = 0.01;  // of files that are written in few digits
  const Vector4<double> quaternion(pose[0], pose[1], pose[2], pose[3]);
  const bool is_finite = std::all_of(pose.begin(), pose.end(), [](double x) { return std::isfinite(x); });
  if (!is_finite || !(std::abs(quaternion.norm() - 1) < kLengthTolerance))
    throw DataError(where +
                    ": its pose is not finite, or no rotation; allowed: a quaternion of length 1, a translation");
  PosedImage image;
  image.name = std::move(name);
  if (image.name.empty()) throw DataError(where + ": has no name");
  image.camera = found->second.camera;
  image.lens = found->second.lens;
  image.camera.camera_from_world = {quaternion_to_matrix(Vector4<double>(quaternion.normalized())),
                                    Vector3<double>(pose[4], pose[5], pose[6])};
  check_camera(image.camera, where);
  return image;
}

ColoredPoint point_of(const Vector3<double>& place, const std::array<std::int64_t, 3>& rgb, const std::string& where) {
  if (!place.allFinite()) throw DataError(where + ": its place is not finite");
  ColoredPoint point{place};
  for (std::size_t c = 0; c < 3; ++c) {
    if (rgb[c] < 0 || rgb[c] > 255)
      throw DataError(where + ": the colour " + std::to_string(rgb[c]) + " is out of range; allowed: 0 to 255");
    point.color[c] = static_cast<float>(rgb[c]) / 255;
  }
  return point;
}

void add_camera(IntrinsicsById& cameras, std::int64_t id, Intrinsics intrinsics, const std::string& where) {
  if (!cameras.emplace(id, std::move(intrinsics)).second)
    throw DataError(where + ": there are two cameras " + std::to_string(id));
}

// --- binary ----------------------------------------------------------------------------------------------------------

/// Little-endian numbers, one after the other.
class BinaryReader {
 public:
  explicit BinaryReader(const NamedBytes& file) : file_(file) {}

  template <class T>
  T read() {
    need(sizeof(T));
    T value;
    std::memcpy(&value, file_.bytes.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  std::string read_text() {
    const auto rest = file_.bytes.subspan(at_);
    const auto end = std::find(rest.begin(), rest.end(), std::uint8_t{0});
    if (end == rest.end()) fail("a name does not end");
    std::string text(rest.begin(), end);
    at_ += text.size() + 1;
    return text;
  }
  /// @param least  bytes of each
  std::uint64_t read_count(std::size_t least) {
    const auto count = read<std::uint64_t>();
    if (count > (file_.bytes.size() - at_) / least)
      fail("says that " + std::to_string(count) + " follow, more than the file has bytes for");
    return count;
  }
  void skip(std::uint64_t bytes) {
    need(bytes);
    at_ += bytes;
  }
  void check_end() const {
    if (at_ != file_.bytes.size())
      fail(std::to_string(file_.bytes.size() - at_) + " bytes follow after the last entry");
  }
  std::string where() const { return file_.name + ": byte " + std::to_string(at_); }

 private:
  [[noreturn]] void fail(const std::string& text) const { throw DataError(where() + ": " + text); }
  void need(std::uint64_t bytes) const {
    if (bytes > file_.bytes.size() - at_) fail("the file ends here, in the middle of an entry");
  }

  const NamedBytes& file_;
  std::size_t at_ = 0;
};

IntrinsicsById binary_cameras(const NamedBytes& file) {
  BinaryReader reader(file);
  IntrinsicsById cameras;
  const std::uint64_t count = reader.read_count(24 + 3 * sizeof(double));
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string where = reader.where();
    const auto id = reader.read<std::int32_t>();
    const auto model = static_cast<std::size_t>(reader.read<std::uint32_t>());
    if (model >= kModels.size()) throw refused_model(where, "number " + std::to_string(model));
    if (kModels[model].parameters == 0) throw refused_model(where, kModels[model].name);
    const auto width = static_cast<std::int64_t>(reader.read<std::uint64_t>());
    const auto height = static_cast<std::int64_t>(reader.read<std::uint64_t>());
    std::vector<double> parameters(kModels[model].parameters);
    for (double& parameter : parameters) parameter = reader.read<double>();
    add_camera(cameras, id, intrinsics_of(model, width, height, parameters, where), where);
  }
  reader.check_end();
  return cameras;
}

std::vector<PosedImage> binary_images(const NamedBytes& file, const IntrinsicsById& cameras) {
  constexpr std::uint64_t kObservation = 24;  // bytes: x, y, the point's number
  BinaryReader reader(file);
  std::vector<PosedImage> images;
  const std::uint64_t count = reader.read_count(4 + 7 * sizeof(double) + 4 + 1 + 8);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string where = reader.where();
    reader.read<std::int32_t>();
    std::array<double, 7> pose{};
    for (double& number : pose) number = reader.read<double>();
    const auto camera = reader.read<std::int32_t>();
    std::string name = reader.read_text();
    reader.skip(kObservation * reader.read_count(kObservation));
    images.push_back(image_of(pose, camera, std::move(name), cameras, where));
  }
  reader.check_end();
  return images;
}

std::vector<ColoredPoint> binary_points(const NamedBytes& file) {
  constexpr std::uint64_t kTrackEntry = 8;  // bytes: image, observation
  BinaryReader reader(file);
  std::vector<ColoredPoint> points;
  const std::uint64_t count = reader.read_count(8 + 3 * sizeof(double) + 3 + 8 + 8);
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string where = reader.where();
    reader.read<std::uint64_t>();
    Vector3<double> place;
    for (int k = 0; k < 3; ++k) place[k] = reader.read<double>();
    std::array<std::int64_t, 3> rgb{};
    for (std::int64_t& channel : rgb) channel = reader.read<std::uint8_t>();
    reader.read<double>();  // its error
    reader.skip(kTrackEntry * reader.read_count(kTrackEntry));
    points.push_back(point_of(place, rgb, where));
  }
  reader.check_end();
  return points;
}

// --- text ------------------------------------------------------------------------------------------------------------

/// Lines of a file, without comments.
class TextLines {
 public:
  explicit TextLines(const NamedBytes& file)
      : name_(file.name), text_(reinterpret_cast<const char*>(file.bytes.data()), file.bytes.size()) {}

  /// The next line that is no comment. @param may_be_blank  else blank lines are passed over
  std::optional<std::string_view> next(bool may_be_blank = false) {
    while (at_ < text_.size()) {
      const std::size_t end = std::min(text_.find('\n', at_), text_.size());
      std::string_view line = text_.substr(at_, end - at_);
      at_ = end + 1;
      ++number_;
      if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
      if (line.starts_with('#')) continue;
      if (may_be_blank || line.find_first_not_of(" \t") != std::string_view::npos) return line;
    }
    return std::nullopt;
  }
  std::string where() const { return name_ + ":" + std::to_string(number_); }

 private:
  std::string name_;
  std::string_view text_;
  std::size_t at_ = 0, number_ = 0;
};

/// Words of one line, read one after the other.
class Words {
 public:
  Words(std::string_view line, std::string where) : line_(line), where_(std::move(where)) {}

  std::string_view word() {
    const std::size_t begin = std::min(line_.find_first_not_of(" \t"), line_.size());
    const std::size_t end = std::min(line_.find_first_of(" \t", begin), line_.size());
    if (begin == end) throw DataError(where_ + ": the line ends too early");
    const std::string_view word = line_.substr(begin, end - begin);
    line_.remove_prefix(end);
    return word;
  }
  template <class T>
  T number() {
    const std::string_view text = word();
    T value{};
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
    if (end.ec != std::errc() || end.ptr != text.data() + text.size())
      throw DataError(where_ + ": " + with_escapes(std::string(text)) + " is no number that is read here");
    return value;
  }
  bool is_empty() const { return line_.find_first_not_of(" \t") == std::string_view::npos; }
  /// What is left, without blanks around it.
  std::string rest() {
    const std::size_t begin = std::min(line_.find_first_not_of(" \t"), line_.size());
    const std::size_t last = line_.find_last_not_of(" \t");
    return last == std::string_view::npos ? "" : std::string(line_.substr(begin, last + 1 - begin));
  }
  const std::string& where() const { return where_; }

 private:
  std::string_view line_;
  std::string where_;
};

IntrinsicsById text_cameras(const NamedBytes& file) {
  TextLines lines(file);
  IntrinsicsById cameras;
  while (const auto line = lines.next()) {
    Words words(*line, lines.where());
    const auto id = words.number<std::int64_t>();
    const std::string_view name = words.word();
    const auto model = std::find_if(kModels.begin(), kModels.end(), [&](const Model& one) { return name == one.name; });
    if (model == kModels.end() || model->parameters == 0)
      throw refused_model(words.where(), with_escapes(std::string(name)));
    const auto width = words.number<std::int64_t>(), height = words.number<std::int64_t>();
    std::vector<double> parameters(model->parameters);
    for (double& parameter : parameters) parameter = words.number<double>();
    if (!words.is_empty())
      throw DataError(words.where() + ": more than the " + std::to_string(model->parameters) + " parameters of " +
                      model->name);
    add_camera(
        cameras, id,
        intrinsics_of(static_cast<std::size_t>(model - kModels.begin()), width, height, parameters, words.where()),
        words.where());
  }
  return cameras;
}

/// The line behind that of an image: x, y and the point's number, again and again, or nothing. In a file without these
/// lines every other image would be passed over.
void check_observations(TextLines& lines) {
  const auto line = lines.next(true);
  if (!line) return;
  Words words(*line, lines.where());
  int count = 0;
  for (; !words.is_empty(); ++count) words.word();
  if (count % 3 != 0)
    throw DataError(lines.where() +
                    ": is no line of observations, of three numbers each (it may be blank); each image "
                    "has one behind its own line");
}

std::vector<PosedImage> text_images(const NamedBytes& file, const IntrinsicsById& cameras) {
  TextLines lines(file);
  std::vector<PosedImage> images;
  while (const auto line = lines.next()) {
    Words words(*line, lines.where());
    words.number<std::int64_t>();
    std::array<double, 7> pose{};
    for (double& number : pose) number = words.number<double>();
    const auto camera = words.number<std::int64_t>();
    images.push_back(image_of(pose, camera, words.rest(), cameras, words.where()));
    check_observations(lines);
  }
  return images;
}

std::vector<ColoredPoint> text_points(const NamedBytes& file) {
  TextLines lines(file);
  std::vector<ColoredPoint> points;
  while (const auto line = lines.next()) {
    Words words(*line, lines.where());
    words.number<std::uint64_t>();
    Vector3<double> place;
    for (int k = 0; k < 3; ++k) place[k] = words.number<double>();
    std::array<std::int64_t, 3> rgb{};
    for (std::int64_t& channel : rgb) channel = words.number<std::int64_t>();
    points.push_back(point_of(place, rgb, words.where()));
  }
  return points;
}

bool is_binary(const NamedBytes& file) { return file.name.ends_with(".bin"); }

/// The ending of a folder's model, of cameras and images alike; empty: there is none.
std::string model_ending(const fs::path& folder) {
  for (const char* ending : {".bin", ".txt"}) {
    if (fs::is_regular_file(folder / (std::string("cameras") + ending)) &&
        fs::is_regular_file(folder / (std::string("images") + ending)))
      return ending;
  }
  return "";
}

}  // namespace

fs::path colmap_folder(const fs::path& folder) {
  for (const fs::path& place : {folder, folder / "sparse" / "0", folder / "sparse"}) {
    if (!model_ending(place).empty()) return place;
  }
  return {};
}

ColmapModel read_colmap(const fs::path& folder) {
  const std::string ending = model_ending(folder);
  const fs::path cameras = folder / ("cameras" + ending), images = folder / ("images" + ending),
                 points = folder / ("points3D" + ending);
  const Bytes camera_bytes = read_file(cameras.string(), kMaxFile), image_bytes = read_file(images.string(), kMaxFile);
  const bool has_points = fs::is_regular_file(points);
  const Bytes point_bytes = has_points ? read_file(points.string(), kMaxFile) : Bytes();
  return decode_colmap({cameras.string(), camera_bytes}, {images.string(), image_bytes},
                       {has_points ? points.string() : "", point_bytes});
}

ColmapModel decode_colmap(const NamedBytes& cameras, const NamedBytes& images, const NamedBytes& points) {
  const IntrinsicsById by_id = is_binary(cameras) ? binary_cameras(cameras) : text_cameras(cameras);
  ColmapModel model;
  model.images = is_binary(images) ? binary_images(images, by_id) : text_images(images, by_id);
  if (!points.name.empty()) model.points = is_binary(points) ? binary_points(points) : text_points(points);
  return model;
}

}  // namespace hsi4d
