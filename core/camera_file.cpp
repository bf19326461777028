#include "core/camera_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>

#include <Eigen/LU>

#include "core/check.h"
#include "core/config.h"
#include "core/config_file.h"
#include "core/config_parse.h"
#include "core/file.h"
#include "core/image.h"
#include "core/log.h"

namespace hsi4d {
namespace {

using Kind = ConfigValue::Kind;
using Numbers16 = std::array<double, 16>;

constexpr std::int64_t kLargestCameraFile = std::int64_t{64} << 20;
constexpr const char* kListFormat = "hsi4d cameras";
constexpr int kListVersion = 1;
constexpr int kLargestSide = ImageLimits{}.max_side;
constexpr const char* kMatrixText = "4 rows of 4 numbers";
constexpr NumberRange kFocal = {.above = 0};

// --- matrices, written as 4 rows of 4 -------------------------------------------------------------------------------

ConfigValue* member_of(ConfigValue& object, std::string_view key) {
  return const_cast<ConfigValue*>(find_member(object, key));
}

/// Adds a problem unless `value` is an array of 4.
bool expect_four(const ConfigValue& value, const char* what, const std::string& pointer, ConfigProblems& problems) {
  if (value.kind == Kind::kArray && value.items.size() == 4) return true;
  const std::string count =
      value.kind == Kind::kArray ? "has length " + std::to_string(value.items.size()) : "is " + kind_name(value);
  problems.add(value.origin, pointer, shown(value) + " " + count + "; allowed: " + what);
  return false;
}

bool expect_number(const ConfigValue& value, const std::string& pointer, ConfigProblems& problems) {
  double number = 0;
  const char* end = value.text.data() + value.text.size();
  const bool is_number = value.kind == Kind::kNumber;
  if (is_number && std::from_chars(value.text.data(), end, number).ec == std::errc() && std::isfinite(number))
    return true;
  problems.add(value.origin, pointer,
               is_number ? shown(value) + " is too large or too near to zero for a 64-bit number"
                         : shown(value) + " is " + kind_name(value) + ", not a number");
  return false;
}

/// The 16 numbers of a value that should be 4 rows of 4; zeros stand for what is reported.
std::vector<ConfigValue> sixteen(const ConfigValue& value, const std::string& pointer, ConfigProblems& problems) {
  std::vector<ConfigValue> flat(16, ConfigValue::make_integer(0));
  if (!expect_four(value, kMatrixText, pointer, problems)) return flat;
  for (std::size_t i = 0; i < 4; ++i) {
    const ConfigValue& row = value.items[i];
    const std::string row_pointer = child_pointer(pointer, std::to_string(i));
    if (!expect_four(row, "4 numbers", row_pointer, problems)) continue;
    for (std::size_t j = 0; j < 4; ++j) {
      if (expect_number(row.items[j], child_pointer(row_pointer, std::to_string(j)), problems))
        flat[4 * i + j] = row.items[j];
    }
  }
  return flat;
}

/// Turns a member that is 4 rows of 4 numbers into one array of 16, which a description can read. Here its faults are
/// told, its absence too, so that the description meets none.
void flatten_matrix(ConfigValue& object, std::string_view key, const std::string& pointer, ConfigProblems& problems) {
  if (object.kind != Kind::kObject) return;
  ConfigValue* value = member_of(object, key);
  if (!value) {
    problems.add(object.origin, pointer,
                 "the key " + json_string(key) + " is missing; allowed: " + std::string(kMatrixText));
    value = &object.add(key, ConfigValue::make_array());
    value->items.resize(16, ConfigValue::make_integer(0));
    return;
  }
  value->items = sixteen(*value, child_pointer(pointer, key), problems);
  value->kind = Kind::kArray;
}

Matrix4<double> matrix_of(const Numbers16& numbers) {
  Matrix4<double> matrix;
  for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = numbers[static_cast<std::size_t>(i)];
  return matrix;
}

/// Runs a check that throws UserError, and adds what it says to the problems.
template <class Check>
void add_failure(const ConfigValue& value, ConfigProblems& problems, Check&& check) {
  try {
    check();
  } catch (const UserError& error) {
    problems.add(value.origin, "", error.what());
  }
}

// --- our own camera --------------------------------------------------------------------------------------------------

struct CameraText {
  Camera camera;
  Numbers16 world_to_camera{};
};

void describe(ConfigFields& f, CameraText& s) {
  Camera& c = s.camera;
  f.integer("width", c.width, {.min = 1, .max = kLargestSide}, "Columns of the image, pixels").required();
  f.integer("height", c.height, {.min = 1, .max = kLargestSide}, "Rows of the image, pixels").required();
  f.number("fx", c.fx, kFocal, "Focal length along x, pixels").required();
  f.number("fy", c.fy, kFocal, "Focal length along y, pixels").required();
  f.number("cx", c.cx, {}, "Principal point from the image's left edge, pixels").required();
  f.number("cy", c.cy, {}, "Principal point from the image's top edge, pixels").required();
  f.numbers("world_to_camera", s.world_to_camera, {}, "Rows of the 4x4 matrix, OpenCV camera axes").required();
}

Camera camera_of(const CameraText& text, const std::string& pointer) {
  Camera camera = text.camera;
  const std::string place = child_pointer(pointer, "world_to_camera");
  camera.camera_from_world = rigid_from_matrix(matrix_of(text.world_to_camera), place);
  check_camera(camera, place);
  return camera;
}

std::vector<Camera> read_single(ConfigValue& tree, ConfigProblems& problems) {
  flatten_matrix(tree, "world_to_camera", "", problems);
  const auto text = read_settings<CameraText>(tree, problems);
  std::vector<Camera> cameras;
  add_failure(*find_member(tree, "world_to_camera"), problems, [&] { cameras.push_back(camera_of(text, "")); });
  return cameras;
}

ConfigValue camera_value(const Camera& camera) {
  ConfigValue value = ConfigValue::make_object();
  value.add("width", ConfigValue::make_integer(camera.width));
  value.add("height", ConfigValue::make_integer(camera.height));
  value.add("fx", ConfigValue::make_number(camera.fx));
  value.add("fy", ConfigValue::make_number(camera.fy));
  value.add("cx", ConfigValue::make_number(camera.cx));
  value.add("cy", ConfigValue::make_number(camera.cy));
  const Matrix4<double> matrix = matrix_from_rigid(camera.camera_from_world);
  ConfigValue rows = ConfigValue::make_array();
  for (int i = 0; i < 4; ++i) {
    ConfigValue row = ConfigValue::make_array();
    for (int j = 0; j < 4; ++j) row.items.push_back(ConfigValue::make_number(matrix(i, j)));
    rows.items.push_back(std::move(row));
  }
  value.add("world_to_camera", std::move(rows));
  return value;
}

// --- a list of them --------------------------------------------------------------------------------------------------

enum class ListFormat { kCameras };
constexpr std::array<ConfigChoice<ListFormat>, 1> kListFormats = {{{ListFormat::kCameras, kListFormat}}};

struct ListText {
  ListFormat format = ListFormat::kCameras;
  int version = 0;
  std::vector<CameraText> cameras;
};

void describe(ConfigFields& f, ListText& s) {
  f.choice("format", s.format, kListFormats, "What the file is").required();
  f.integer("version", s.version, {.min = 1, .max = kListVersion}, "Version of the format").required();
  f.list("cameras", s.cameras, "The cameras, in order").required();
}

std::vector<Camera> read_list(ConfigValue& tree, ConfigProblems& problems) {
  ConfigValue* items = member_of(tree, "cameras");
  for (std::size_t i = 0; items && i < items->items.size(); ++i)
    flatten_matrix(items->items[i], "world_to_camera", "/cameras/" + std::to_string(i), problems);
  const auto text = read_settings<ListText>(tree, problems);
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < text.cameras.size(); ++i) {
    const std::string pointer = "/cameras/" + std::to_string(i);
    add_failure(items->items[i], problems, [&] { cameras.push_back(camera_of(text.cameras[i], pointer)); });
  }
  return cameras;
}

// --- nerfstudio ------------------------------------------------------------------------------------------------------

enum class Model { kPinhole, kSimplePinhole, kOpencv };
constexpr std::array<ConfigChoice<Model>, 3> kModels = {
    {{Model::kPinhole, "PINHOLE"}, {Model::kSimplePinhole, "SIMPLE_PINHOLE"}, {Model::kOpencv, "OPENCV"}}};
constexpr std::array<const char*, 12> kDistortions = {"k1", "k2", "k3", "k4", "k5", "k6",
                                                      "p1", "p2", "s1", "s2", "s3", "s4"};

/// A part of the names by which nerfstudio, instant-ngp and their exporters say that a picture is not of a pinhole.
struct OtherCamera {
  const char* part;
  const char* what;
};
constexpr OtherCamera kOtherCameras[] = {
    {"fisheye", "a fisheye lens"},
    {"ftheta", "a fisheye lens"},
    {"latlong", "a panorama"},
    {"equirect", "a panorama"},
    {"panorama", "a panorama"},
    {"spherical", "a panorama"},
    {"omnidirectional", "a panorama"},
    {"orthographic", "a camera without perspective"},
    {"ortho_scale", "a camera without perspective"},
    {"rolling", "a rolling shutter"},
    {"transform_matrix_start", "a camera that moves within a frame"},
    {"transform_matrix_end", "a camera that moves within a frame"},
    {"skew", "a skewed sensor"},
    {"distort", "a lens distortion"},
    {"from_mitsuba", "other camera axes"},
};
/// Keys whose text names the kind of a camera, beside camera_model, and texts that mean a pinhole.
constexpr const char* kKindKeys[] = {"camera_type", "lens_model", "lens_type", "projection", "projection_type"};
constexpr const char* kPinholeTexts[] = {"pinhole", "simple_pinhole", "perspective", "opencv", "none", ""};

/// Keys whose text says much, and that of another lens or shutter by a part of kOtherCameras.
constexpr const char* kTextKeys[] = {"lens", "lens_name", "shutter", "shutter_type", "camera", "model"};
constexpr const char* kOmnidirectional = "xi";  // Mei's model

/// What of transforms.json is taken: of what is drawn, or of pictures that can be straightened.
enum class Lenses { kNone, kStraightened };

struct NerfCamera {
  Camera camera;
  Model model = Model::kPinhole;
  std::array<double, kDistortions.size()> distortion{};
  double angle_x = 0, angle_y = 0;
  Numbers16 transform_matrix{};
};

void describe_intrinsics(ConfigFields& f, NerfCamera& s) {
  Camera& c = s.camera;
  f.choice("camera_model", s.model, kModels, "Kind of camera");
  f.integer("w", c.width, {.min = 1, .max = kLargestSide}, "Columns of the image, pixels");
  f.integer("h", c.height, {.min = 1, .max = kLargestSide}, "Rows of the image, pixels");
  f.number("fl_x", c.fx, kFocal, "Focal length along x, pixels");
  f.number("fl_y", c.fy, kFocal, "Focal length along y, pixels");
  f.number("cx", c.cx, {}, "Principal point from the image's left edge, pixels");
  f.number("cy", c.cy, {}, "Principal point from the image's top edge, pixels");
  for (std::size_t i = 0; i < kDistortions.size(); ++i)
    f.number(kDistortions[i], s.distortion[i], {}, "Lens distortion; only 0 can be read");
  f.number("camera_angle_x", s.angle_x, {}, "Horizontal field of view, radians");
  f.number("camera_angle_y", s.angle_y, {}, "Vertical field of view, radians");
}

/// Reads the members that are described, and passes over all others.
void read_known(const ConfigValue& object, const ConfigFields& fields, ConfigProblems& problems,
                const std::string& pointer) {
  if (object.kind != Kind::kObject) return read_config(object, fields, problems, pointer);
  ConfigValue known = ConfigValue::make_object();
  known.origin = object.origin;
  for (const ConfigMember& member : object.members) {
    if (fields.find(member.key)) known.members.push_back(member);
  }
  read_config(known, fields, problems, pointer);
}

double distortion_of(const NerfCamera& read, std::string_view name) {
  const auto at = std::find(kDistortions.begin(), kDistortions.end(), name);
  return read.distortion[static_cast<std::size_t>(at - kDistortions.begin())];
}

Lens lens_of(const NerfCamera& read) {
  return {distortion_of(read, "k1"), distortion_of(read, "k2"), distortion_of(read, "k3"), distortion_of(read, "p1"),
          distortion_of(read, "p2")};
}

bool is_of_lens(std::string_view name) {
  return name == "k1" || name == "k2" || name == "k3" || name == "p1" || name == "p2";
}

void refuse_distortion(const ConfigValue& object, const NerfCamera& read, Lenses lenses, const std::string& pointer,
                       ConfigProblems& problems) {
  for (std::size_t i = 0; i < kDistortions.size(); ++i) {
    const ConfigValue* value = find_member(object, kDistortions[i]);
    if (!value || read.distortion[i] == 0) continue;
    if (lenses == Lenses::kStraightened && is_of_lens(kDistortions[i])) continue;
    problems.add(
        value->origin, child_pointer(pointer, kDistortions[i]),
        shown(*value) + " is a lens distortion, which is not rendered: undistort the images first; allowed: 0");
  }
}

/// Whether a member says no, or 0 all through.
bool says_nothing(const ConfigValue& value) {
  const auto is_nothing = [](const ConfigValue& item) { return says_nothing(item); };
  switch (value.kind) {
    case Kind::kNull:
      return true;
    case Kind::kBoolean:
      return !value.boolean;
    case Kind::kNumber:
      return value.text.find_first_of("123456789") >= value.text.find_first_of("eE");  // 0, -0.0, 0e5
    case Kind::kString:
      return value.text.empty() || value.text == "none";
    case Kind::kArray:
      return std::all_of(value.items.begin(), value.items.end(), is_nothing);
    case Kind::kObject:
      return std::all_of(value.members.begin(), value.members.end(),
                         [](const ConfigMember& member) { return says_nothing(member.value); });
  }
  return false;
}

template <std::size_t N>
bool is_one_of(const std::string& text, const char* const (&words)[N]) {
  return std::find(std::begin(words), std::end(words), text) != std::end(words);
}

/// What a part of a text says of the camera that is not drawn; null: nothing.
const char* other_camera_in(const std::string& text) {
  for (const OtherCamera& other : kOtherCameras) {
    if (text.find(other.part) != std::string::npos) return other.what;
  }
  return nullptr;
}

std::string in_lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return text;
}

/// What a member says of the camera that is not drawn; null: nothing.
const char* other_camera(const std::string& key, const ConfigValue& value) {
  const std::string name = in_lower_case(key);
  if (is_one_of(name, kKindKeys) && value.kind == Kind::kString)
    return is_one_of(in_lower_case(value.text), kPinholeTexts) ? nullptr : "a camera that is no pinhole";
  if (is_one_of(name, kTextKeys) && value.kind == Kind::kString) return other_camera_in(in_lower_case(value.text));
  if (says_nothing(value) || name.find("undistort") != std::string::npos) return nullptr;
  return name == kOmnidirectional ? "an omnidirectional camera" : other_camera_in(name);
}

/// Keys that are passed over must not say that the picture is of another lens or shutter.
void refuse_other_cameras(const ConfigValue& object, const std::string& pointer, ConfigProblems& problems) {
  for (const ConfigMember& member : object.members) {
    const char* const what = other_camera(member.key, member.value);
    if (what == nullptr) continue;
    problems.add(member.value.origin, child_pointer(pointer, member.key),
                 shown(member.value) + " says that this is " + what +
                     "; pinhole cameras alone are drawn: undistort the images first");
  }
}

void require_intrinsics(const ConfigValue& top, const ConfigValue& frame, const std::string& pointer,
                        ConfigProblems& problems) {
  for (const char* key : {"w", "h", "fl_x", "fl_y", "cx", "cy"}) {
    if (!find_member(frame, key) && !find_member(top, key))
      problems.add(frame.origin, pointer, std::string(key) + " is missing, here and at the top of the file");
  }
}

/// Whether the field of view stands for intrinsics that neither place gives.
bool has_angle_alone(const ConfigValue& top, const ConfigValue& frame, const NerfCamera& read, Lenses lenses) {
  return lenses == Lenses::kStraightened && read.angle_x > 0 && !find_member(frame, "fl_x") &&
         !find_member(top, "fl_x");
}

/// x_camera = diag(1, −1, −1) (world_from_gl)⁻¹ x_world: OpenGL's camera has y up and z backward.
Camera camera_of(const NerfCamera& read, const std::string& pointer) {
  const std::string place = child_pointer(pointer, "transform_matrix");
  const Rigid<double> world_from_gl = rigid_from_matrix(matrix_of(read.transform_matrix), place);
  Camera camera = read.camera;
  camera.camera_from_world = world_from_gl;
  check_camera(camera, place);  // as the file has it, before it is inverted
  const Matrix3<double> cv_from_gl = Vector3<double>(1, -1, -1).asDiagonal();
  const Matrix3<double> rotation = cv_from_gl * world_from_gl.rotation.inverse();
  camera.camera_from_world = {rotation, -(rotation * world_from_gl.translation)};
  check_camera(camera, place);
  return camera;
}

/// A path that an entry names: of its picture, mask or depths.
std::string read_path(const ConfigValue& frame, const char* key, const std::string& pointer, ConfigProblems& problems) {
  const ConfigValue* const path = find_member(frame, key);
  if (path == nullptr || path->kind == Kind::kNull) return "";
  if (path->kind == Kind::kString) return path->text;
  problems.add(path->origin, child_pointer(pointer, key), shown(*path) + " is " + kind_name(*path) + ", not a string");
  return "";
}

/// As camera_of, of an entry whose intrinsics the picture's size will complete.
Camera incomplete_camera(const NerfCamera& read, const std::string& pointer) {
  NerfCamera whole = read;
  whole.camera.width = whole.camera.height = 1;
  whole.camera.fx = whole.camera.fy = 1;
  Camera camera = read.camera;
  camera.camera_from_world = camera_of(whole, pointer).camera_from_world;
  return camera;
}

void read_frame(const ConfigValue& top, const NerfCamera& globals, Lenses lenses, ConfigValue& frame,
                const std::string& pointer, ConfigProblems& problems, std::vector<PictureCamera>& cameras) {
  const std::size_t before = problems.size();
  flatten_matrix(frame, "transform_matrix", pointer, problems);
  NerfCamera read = globals;
  ConfigFields fields;
  describe_intrinsics(fields, read);
  fields.numbers("transform_matrix", read.transform_matrix, {}, "World from camera, OpenGL camera axes").required();
  read_known(frame, fields, problems, pointer);
  if (problems.size() > before) return;
  const bool has_angle = has_angle_alone(top, frame, read, lenses);
  if (!has_angle) require_intrinsics(top, frame, pointer, problems);
  refuse_distortion(frame, read, lenses, pointer, problems);
  refuse_other_cameras(frame, pointer, problems);
  if (problems.size() > before) return;
  PictureCamera result;
  result.picture = read_path(frame, "file_path", pointer, problems);
  result.mask = read_path(frame, "mask_path", pointer, problems);
  result.depth = read_path(frame, "depth_file_path", pointer, problems);
  result.lens = lens_of(read);
  if (has_angle) {
    result.angle_x = read.angle_x;
    result.angle_y = read.angle_y;
  }
  add_failure(frame, problems, [&] {
    result.camera = has_angle ? incomplete_camera(read, pointer) : camera_of(read, pointer);
    cameras.push_back(result);
  });
}

/// What readers of pictures could want and does not come along.
void tell_of_unread(const ConfigValue& tree, const ConfigValue& frames) {
  const std::string name = tree.origin.source == nullptr ? "" : tree.origin.source->name + ": ";
  if (find_member(tree, "ply_file_path") != nullptr)
    log_warning(name + "the points of \"ply_file_path\" are not read here; /start/points names such a file");
  for (const ConfigValue& frame : frames.items) {
    if (find_member(frame, "depth_path") == nullptr) continue;
    log_warning(name + "depths of \"depth_path\" are not read; allowed: \"depth_file_path\"");
    return;
  }
}

std::vector<PictureCamera> read_transforms(ConfigValue& tree, Lenses lenses, ConfigProblems& problems) {
  NerfCamera globals;
  ConfigFields fields;
  describe_intrinsics(fields, globals);
  read_known(tree, fields, problems, "");
  ConfigValue& frames = *member_of(tree, "frames");
  if (frames.kind != Kind::kArray)
    problems.add(frames.origin, "/frames", shown(frames) + " is " + kind_name(frames) + ", not an array");
  problems.throw_if_any();
  refuse_distortion(tree, globals, lenses, "", problems);
  refuse_other_cameras(tree, "", problems);
  if (lenses == Lenses::kStraightened) tell_of_unread(tree, frames);
  std::vector<PictureCamera> cameras;
  for (std::size_t i = 0; i < frames.items.size(); ++i)
    read_frame(tree, globals, lenses, frames.items[i], "/frames/" + std::to_string(i), problems, cameras);
  return cameras;
}

std::vector<PictureCamera> decode(const std::string& text, const std::string& name, Lenses lenses) {
  auto source = std::make_shared<ConfigSource>();
  source->name = name;
  ConfigProblems problems;
  ConfigValue tree;
  if (!parse_config_text(text, source, problems, tree)) problems.throw_if_any();
  if (tree.kind != Kind::kObject)
    problems.add(tree.origin, "", shown(tree) + " is " + kind_name(tree) + "; a file of cameras is an object: {...}");
  problems.throw_if_any();
  const bool is_transforms = find_member(tree, "frames") != nullptr;
  const bool is_list = find_member(tree, "format") || find_member(tree, "cameras");
  std::vector<PictureCamera> cameras;
  if (is_transforms) {
    cameras = read_transforms(tree, lenses, problems);
  } else {
    for (const Camera& camera : is_list ? read_list(tree, problems) : read_single(tree, problems))
      cameras.push_back({camera, ""});
  }
  problems.throw_if_any();
  return cameras;
}

std::vector<Camera> without_pictures(const std::vector<PictureCamera>& cameras) {
  std::vector<Camera> all;
  for (const PictureCamera& one : cameras) all.push_back(one.camera);
  return all;
}

}  // namespace

std::vector<Camera> decode_cameras(const std::string& text, const std::string& name) {
  return without_pictures(decode(text, name, Lenses::kNone));
}

std::vector<PictureCamera> read_picture_cameras(const std::string& path) {
  return decode(read_text_file(path, kLargestCameraFile), path, Lenses::kNone);
}

std::vector<PictureCamera> decode_photo_cameras(const std::string& text, const std::string& name) {
  return decode(text, name, Lenses::kStraightened);
}

std::vector<PictureCamera> read_photo_cameras(const std::string& path) {
  return decode_photo_cameras(read_text_file(path, kLargestCameraFile), path);
}

std::vector<Camera> read_cameras(const std::string& path) { return without_pictures(read_picture_cameras(path)); }

Camera read_camera(const std::string& path, int frame) {
  const std::vector<Camera> cameras = read_cameras(path);
  const int count = static_cast<int>(cameras.size());
  if (frame >= 0 && frame < count) return cameras[static_cast<std::size_t>(frame)];
  throw UserError(path + ": there is no camera " + std::to_string(frame) + "; " +
                  (count == 0 ? "the file has none" : "allowed: 0 to " + std::to_string(count - 1)));
}

void write_camera(const std::string& path, const Camera& camera) {
  check_camera(camera, path);
  write_text_file(path, to_json(camera_value(camera)));
}

void write_cameras(const std::string& path, std::span<const Camera> cameras) {
  ConfigValue list = ConfigValue::make_array();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    check_camera(cameras[i], path + ": camera " + std::to_string(i));
    list.items.push_back(camera_value(cameras[i]));
  }
  ConfigValue file = ConfigValue::make_object();
  file.add("format", ConfigValue::make_string(kListFormat));
  file.add("version", ConfigValue::make_integer(kListVersion));
  file.add("cameras", std::move(list));
  write_text_file(path, to_json(file));
}

}  // namespace hsi4d
