#include "body/motion_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "body/body_model.h"
#include "body/file_contents.h"
#include "body/motion_edit.h"
#include "body/pose_layout.h"
#include "core/npz.h"
#include "core/text.h"

namespace hsi4d {

namespace {

/// Names that an array has in one file or another: of AMASS and smplx, of the data sets of TRUMANS and LINGO (human_*,
/// transl_aligned), of WHAM (*_world).
constexpr const char* kTranslationNames[] = {"trans", "transl", "human_transl", "transl_aligned", "trans_world"};
constexpr const char* kPosesNames[] = {"poses", "pose_world"};
constexpr double kSameRate = 1e-5;  // float against double
constexpr const char* kFrameNames[] = {"frame_ids", "frame_id"};
constexpr const char* kSigmaName = "joint_sigma";
constexpr const char* kRateNames[] = {"mocap_frame_rate", "mocap_framerate", "frame_rate", "fps"};

/// A run of joints that files keep in an array of its own.
struct Part {
  std::array<const char*, 3> names;  // the first is AMASS's and what is written
  std::size_t joint, joints;
  bool needed;
};

constexpr Part kParts[] = {
    {{"root_orient", "global_orient", "human_orient"}, 0, 1, true},
    {{"pose_body", "body_pose", "human_pose"}, 1, kBodyJoints - 1, true},
    {{"pose_jaw", "jaw_pose", nullptr}, 22, 1, false},
    {{"pose_eye", "eye_pose", nullptr}, 23, 2, false},
    {{"pose_hand", "hand_pose", nullptr}, 25, 30, false},
};

/// Halves of a part, as SMPL-X names its parameters. Read where the whole part is not there.
struct Half {
  const char* name;
  std::size_t joint, joints;
};

constexpr Half kHalves[] = {
    {"leye_pose", 23, 1}, {"reye_pose", 24, 1}, {"left_hand_pose", 25, 15}, {"right_hand_pose", 40, 15}};

/// Body models whose motions are read.
enum class Model { kSmplx, kSmplh, kSmpl };

const char* name_of(Model model) {
  return model == Model::kSmplx ? "SMPL-X" : model == Model::kSmplh ? "SMPL-H" : "SMPL";
}

const Vector3<double>& pelvis_of(Model model) {
  return model == Model::kSmplx ? kSmplxPelvis : model == Model::kSmplh ? kSmplhPelvis : kSmplPelvis;
}

/// A length of the rows of `poses`; smplx_runs says what the numbers are.
struct RowLayout {
  int64_t numbers;
  Model model;
  bool may_be_other;  // models share these joints: the file may say that it is of another one
};

constexpr RowLayout kRowLayouts[] = {{165, Model::kSmplx, false},
                                     {156, Model::kSmplh, true},
                                     {72, Model::kSmpl, false},
                                     {69, Model::kSmpl, false},
                                     {66, Model::kSmpl, true}};

struct Rows {
  std::vector<double> numbers;
  std::size_t width;
  double at(std::size_t frame, std::size_t i) const { return numbers[frame * width + i]; }
};

/// How large numbers may be, and what messages call that.
struct Range {
  double largest;
  const char* text;
};
constexpr Range kBodyNumbers{kLargestBodyNumber, kBodyNumbersText}, kPlaces{kLargestPlace, "-1e7 to 1e7"},
    kBetas{kLargestBeta, kBetasText};

void require_in_range(const NpyArray& array, const std::vector<double>& numbers, const Range& range) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (std::abs(numbers[i]) <= range.largest) continue;
    const std::size_t width = static_cast<std::size_t>(array.shape().empty() ? 1 : array.shape().back());
    throw DataError(
        array.source() + ": frame " + std::to_string(i / width) + ", number " + std::to_string(i % width) +
        (std::isfinite(numbers[i]) ? " is " + number_text(numbers[i]) + "; allowed: " + range.text : " is not finite"));
  }
}

Rows rows_of(const NpyArray& array, int64_t frames, int64_t width, const Range& range = kBodyNumbers) {
  Rows rows{array.require_shape({frames, width}).as<double>(), static_cast<std::size_t>(width)};
  require_in_range(array, rows.numbers, range);
  return rows;
}

/// The array of that name, null where there is none. One of Python objects throws, saying why it is not read.
const NpyArray* find(const Npz& file, const char* name) {
  const bool is_skipped = std::any_of(file.skipped().begin(), file.skipped().end(),
                                      [&](const Npz::Skipped& member) { return member.name == name; });
  return file.has(name) || is_skipped ? &file.array(name) : nullptr;
}

/// The first that is there of several names.
const NpyArray* find_first(const Npz& file, std::span<const char* const> names) {
  for (const char* const name : names) {
    const NpyArray* const array = name == nullptr ? nullptr : find(file, name);
    if (array != nullptr) return array;
  }
  return nullptr;
}

/// Why what is looked for may be there and not be read; nothing where all arrays are.
std::string objects_text(const Npz& file) {
  std::vector<std::string> names;
  for (const Npz::Skipped& member : file.skipped()) names.push_back(member.name);
  if (names.empty()) return "";
  return "; not read: " + few_names(names) + ", as it " + file.skipped().front().reason +
         "; save an array of numbers for each name";
}

/// What is there where something is missing.
std::string names_text(const Npz& file) {
  return (file.names().empty() ? "" : "; there is " + few_names(file.names())) + objects_text(file);
}

void put_joints(const Rows& rows, std::size_t from, std::size_t to, std::size_t joints, Motion& motion) {
  for (std::size_t t = 0; t < motion.poses.size(); ++t) {
    for (std::size_t i = 0; i < 3 * joints; ++i) motion.poses[t].axis_angle[3 * to + i] = rows.at(t, 3 * from + i);
  }
}

/// @param named  the model that the file says it is of
/// @return       the model that it is of
Model read_whole_poses(const NpyArray& array, std::optional<Model> named, Motion& motion) {
  const int64_t frames = static_cast<int64_t>(motion.poses.size());
  const auto& shape = array.shape();
  std::string allowed;
  for (const RowLayout& layout : kRowLayouts) {
    if (shape.size() == 2 && shape[0] == frames && shape[1] == layout.numbers) {
      const Rows rows = rows_of(array, frames, layout.numbers);
      for (std::size_t t = 0; t < motion.poses.size(); ++t) {
        const std::span row = std::span(rows.numbers).subspan(t * rows.width, rows.width);
        motion.poses[t].axis_angle = smplx_pose(row, array.source()).axis_angle;
      }
      return layout.may_be_other ? named.value_or(layout.model) : layout.model;
    }
    allowed += (allowed.empty() ? "" : ", ") + shape_text(std::vector<int64_t>{frames, layout.numbers}) + " (" +
               name_of(layout.model) + ")";
  }
  throw DataError(array.source() + ": has shape " + shape_text(shape) + "; allowed: " + allowed);
}

/// [T,3 J], or [T,J,3], which are the same numbers.
Rows rows_of_joints(const NpyArray& array, int64_t frames, int64_t joints) {
  const std::vector<int64_t> by_joint = {frames, joints, 3};
  if (array.shape() != by_joint) return rows_of(array, frames, 3 * joints);
  Rows rows{array.as<double>(), static_cast<std::size_t>(3 * joints)};
  require_in_range(array, rows.numbers, kBodyNumbers);
  return rows;
}

void read_joints(const NpyArray& array, std::size_t first, std::size_t joints, Motion& motion) {
  const Rows rows = rows_of_joints(array, static_cast<int64_t>(motion.poses.size()), static_cast<int64_t>(joints));
  put_joints(rows, 0, first, joints, motion);
}

/// Reads those halves of a part that there are.
void read_halves(const Npz& file, const Part& part, Motion& motion) {
  for (const Half& half : kHalves) {
    const bool is_of_part = half.joint >= part.joint && half.joint < part.joint + part.joints;
    const NpyArray* array = is_of_part ? find(file, half.name) : nullptr;
    if (array != nullptr) read_joints(*array, half.joint, half.joints, motion);
  }
}

void read_parts(const Npz& file, Motion& motion) {
  for (const Part& part : kParts) {
    const NpyArray* array = find_first(file, part.names);
    if (array != nullptr) {
      read_joints(*array, part.joint, part.joints, motion);
    } else if (part.needed) {
      throw DataError(file.source() + ": there is neither 'poses' nor '" + part.names[0] + "'" + names_text(file));
    } else {
      read_halves(file, part, motion);
    }
  }
}

/// Throws DataError for angles in degrees: half of the turned joints of the body are turned by more than half a circle.
void require_radians(const Npz& file, const Motion& motion) {
  std::vector<double> angles;
  for (const BodyPose& pose : motion.poses) {
    for (Index joint = 1; joint < kBodyJoints; ++joint) {
      const double angle = pose.rotation_of(joint).norm();
      if (angle > 0) angles.push_back(angle);
    }
  }
  if (angles.empty()) return;
  const auto middle = angles.begin() + std::ssize(angles) / 2;
  std::nth_element(angles.begin(), middle, angles.end());
  if (*middle <= std::numbers::pi) return;
  throw DataError(file.source() + ": half of the joints are turned by " + rounded(*middle, 3) +
                  " or more; angles are radians, and these look like degrees");
}

/// Throws DataError for names that say different rates.
double read_frame_rate(const Npz& file) {
  const NpyArray* array = find_first(file, kRateNames);
  if (array == nullptr) return Motion{}.frame_rate;
  const double rate = array->scalar<double>();
  for (const char* const name : kRateNames) {
    const NpyArray* const other = find(file, name);
    const double its = other == nullptr ? rate : other->scalar<double>();
    if (std::isfinite(rate) && !(std::abs(its - rate) <= kSameRate * std::abs(rate)))
      throw DataError(array->source() + ": is " + number_text(rate) + ", '" + name + "' " + number_text(its) +
                      "; they say one thing, the frames a second");
  }
  if (!(rate >= kSlowestMotion && rate <= kFastestMotion)) {
    throw DataError(array->source() + ": is " + number_text(rate) +
                    " frames a second; allowed: " + number_text(kSlowestMotion) + " to " + rounded(kFastestMotion, 6));
  }
  return rate;
}

/// The mean over frames of `betas`.
std::vector<double> read_betas(const Npz& file, int64_t frames) {
  const NpyArray* found = find(file, "betas");
  if (found == nullptr) return {};
  const NpyArray& array = *found;
  const auto& shape = array.shape();
  const bool is_row = shape.size() == 1, is_table = shape.size() == 2 && (shape[0] == 1 || shape[0] == frames);
  if (!is_row && !is_table) {
    throw DataError(array.source() + ": has shape " + shape_text(shape) + "; allowed: [B], [1,B], [" +
                    std::to_string(frames) + ",B]");
  }
  if (shape.back() > kMostBetas) {
    throw DataError(array.source() + ": has " + std::to_string(shape.back()) + " numbers of shape; allowed: at most " +
                    std::to_string(kMostBetas));
  }
  const std::vector<double> numbers = array.as<double>();
  require_in_range(array, numbers, kBetas);
  const auto width = static_cast<std::size_t>(shape.back());
  if (width == 0) return {};
  const std::size_t rows = numbers.size() / width;
  std::vector<double> mean(numbers.begin(), numbers.begin() + static_cast<std::ptrdiff_t>(width));
  for (std::size_t i = 0; i < numbers.size() && rows > 1; ++i) {
    mean[i % width] += (numbers[i] - numbers[i % width]) / static_cast<double>(rows);
  }
  return mean;
}

/// The text in an array, where there is one that can be read.
std::optional<std::string> read_text(const Npz& file, const char* name) {
  if (!file.has(name)) return {};
  const NpyArray& array = file.array(name);
  const bool is_text = array.kind() == NpyKind::bytes || array.kind() == NpyKind::unicode;
  return is_text && array.size() == 1 ? std::optional(array.text()) : std::nullopt;
}

/// A model's name as files spell it: "SMPL-X", "smplx_locked_head", "smpl+h".
std::string plain_name(const std::string& text) {
  std::string name;
  for (const char c : text) {
    if (c >= 'A' && c <= 'Z') name += static_cast<char>(c - 'A' + 'a');
    if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9')) name += c;
  }
  return name;
}

/// The model that the file says it is of, if it does. Throws DataError for one that is no whole body.
std::optional<Model> read_model(const Npz& file) {
  const std::optional<std::string> text = read_text(file, "surface_model_type");
  if (!text || text->empty()) return {};
  const std::string name = plain_name(*text);
  if (name.starts_with("smplx")) return Model::kSmplx;
  if (name.starts_with("smplh")) return Model::kSmplh;
  if (name.starts_with("smpl")) return Model::kSmpl;
  throw DataError(file.array("surface_model_type").source() + ": is \"" + with_escapes(*text) +
                  "\"; allowed: smplx, smplh, smpl");
}

std::optional<Vector3<double>> read_pelvis(const Npz& file) {
  const NpyArray* array = find(file, "pelvis_rest");
  if (array == nullptr) return {};
  const std::vector<double> x = array->require_shape({3}).as<double>();
  require_in_range(*array, x, kBodyNumbers);
  return Vector3<double>(x[0], x[1], x[2]);
}

/// Which frame of its video the motion begins with. Throws DataError for frames that do not follow one another.
double read_first_frame(const Npz& file, int64_t frames) {
  constexpr double kLatest = 1e7;
  const NpyArray* array = find(file, "first_frame");
  const NpyArray* const numbers = find_first(file, kFrameNames);
  const NpyArray* const named = array == nullptr ? numbers : array;
  if (named == nullptr) return 0;
  const std::vector<double> ids = array == nullptr ? numbers->as<double>() : std::vector{array->scalar<double>()};
  if (array == nullptr && std::ssize(ids) != frames)
    throw DataError(named->source() + ": has shape " + shape_text(named->shape()) + "; allowed: [" +
                    std::to_string(frames) + "], a number a frame");
  if (!(ids.front() >= 0 && ids.front() <= kLatest))
    throw DataError(named->source() + ": begins with frame " + number_text(ids.front()) + "; allowed: 0 to 1e7");
  for (std::size_t i = 1; i < ids.size(); ++i) {
    if (ids[i] != ids[i - 1] + 1)
      throw DataError(named->source() + ": frame " + number_text(ids[i - 1]) + " is followed by frame " +
                      number_text(ids[i]) + "; allowed: the next one (tools/export_motion.py fills gaps)");
  }
  return ids.front();
}

// What AMASS and write_motion say again in other words.
constexpr const char* kSaidAgain[] = {"mocap_time_length", "num_betas"};
// Poses of the object of CHOIS and OMOMO, which `hsi4d evaluate` reads.
constexpr const char* kOfObjects[] = {"obj_rot_mat", "obj_rot", "obj_com_pos", "window_obj_com_pos", "obj_trans"};
// Of EMDB and BEHAVE, which it reads too: frames that count, and when they were.
constexpr const char* kOfProtocols[] = {"good_frames_mask", "frame_times"};

bool is_among(std::string_view name, std::span<const char* const> names) {
  return std::any_of(names.begin(), names.end(), [&](const char* one) { return one != nullptr && name == one; });
}

bool is_read(const std::string& name) {
  constexpr const char* kSingle[] = {"first_frame", "betas", "gender", "pelvis_rest", "surface_model_type", kSigmaName};
  return is_among(name, kTranslationNames) || is_among(name, kPosesNames) || is_among(name, kFrameNames) ||
         is_among(name, kRateNames) || is_among(name, kSingle) || is_among(name, kSaidAgain) ||
         is_among(name, kOfObjects) || is_among(name, kOfProtocols) ||
         std::any_of(std::begin(kParts), std::end(kParts), [&](const Part& p) { return is_among(name, p.names); }) ||
         std::any_of(std::begin(kHalves), std::end(kHalves), [&](const Half& half) { return name == half.name; });
}

/// Soft tissue (dmpls), markers, faces; and texts that are Python objects.
std::vector<std::string> unread_of(const Npz& file) {
  std::vector<std::string> unread;
  for (const std::string& name : file.names()) {
    if (!is_read(name)) unread.push_back(name);
  }
  for (const Npz::Skipped& member : file.skipped()) unread.push_back(member.name);
  return unread;
}

/// The same movement of the neutral SMPL-X of mean shape: of the other model's shape it knows nothing.
Motion converted(Motion motion, Model model) {
  motion = with_pelvis(motion, motion.pelvis_rest.value_or(pelvis_of(model)), kSmplxPelvis);
  motion.converted_from = name_of(model);
  motion.lost_shape = std::any_of(motion.betas.begin(), motion.betas.end(), [](double beta) { return beta != 0; });
  motion.betas.clear();
  motion.gender = Motion{}.gender;
  return motion;
}

Motion motion_of(const Npz& file) {
  refuse_other_contents(file, {"a motion", "parameters of smplx"});
  const NpyArray* trans = find_first(file, kTranslationNames);
  if (trans == nullptr) throw DataError(file.source() + ": there is no array 'trans'" + names_text(file));
  const int64_t frames = trans->require_shape({-1, 3}).shape()[0];
  if (frames == 0) throw DataError(trans->source() + ": holds no frame");
  const Rows places = rows_of(*trans, frames, 3, kPlaces);
  Motion motion;
  motion.says_frame_rate = find_first(file, kRateNames) != nullptr;
  motion.frame_rate = read_frame_rate(file);
  motion.first_frame = read_first_frame(file, frames);
  motion.betas = read_betas(file, frames);
  motion.gender = read_text(file, "gender").value_or(motion.gender);
  motion.pelvis_rest = read_pelvis(file);
  motion.unread = unread_of(file);
  motion.poses.assign(static_cast<std::size_t>(frames), rest_pose(kSmplxJoints));
  const std::optional<Model> named = read_model(file);
  Model model = named.value_or(Model::kSmplx);
  if (const NpyArray* poses = find_first(file, kPosesNames); poses != nullptr) {
    model = read_whole_poses(*poses, named, motion);
  } else {
    read_parts(file, motion);
  }
  require_radians(file, motion);
  for (std::size_t t = 0; t < motion.poses.size(); ++t) {
    motion.poses[t].transl = {places.at(t, 0), places.at(t, 1), places.at(t, 2)};
  }
  return model == Model::kSmplx ? motion : converted(std::move(motion), model);
}

void add_joints(NpzWriter& file, const char* name, const Motion& motion, std::size_t first, std::size_t joints) {
  std::vector<double> numbers;
  for (const BodyPose& pose : motion.poses) {
    const auto begin = pose.axis_angle.begin() + static_cast<std::ptrdiff_t>(3 * first);
    numbers.insert(numbers.end(), begin, begin + static_cast<std::ptrdiff_t>(3 * joints));
  }
  file.add<double>(name, {static_cast<int64_t>(motion.poses.size()), static_cast<int64_t>(3 * joints)}, numbers);
}

std::vector<double> joint_sigmas_in(const Npz& file) {
  const NpyArray* const array = find(file, kSigmaName);
  if (array == nullptr) return {};
  const NpyArray* const places = find_first(file, kTranslationNames);
  const std::vector<int64_t>& shape = array->shape();
  const bool fits = shape.size() == 3 && shape[1] > 0 && shape[1] <= kSmplxJoints && shape[2] == 2 &&
                    (places == nullptr || places->shape().empty() || places->shape().front() == shape[0]);
  if (!fits)
    throw DataError(array->source() + ": has shape " + shape_text(shape) +
                    "; allowed: [T,J,2] for the T frames of the file, at most " + std::to_string(kSmplxJoints) +
                    " joints");
  std::vector<double> sigmas = array->as<double>();
  const auto bad = std::find_if(sigmas.begin(), sigmas.end(), [](double sigma) { return sigma < 0; });
  if (bad != sigmas.end())
    throw DataError(array->source() + ": number " + std::to_string(bad - sigmas.begin()) + " is " + number_text(*bad) +
                    "; allowed: 0 or more");
  return sigmas;
}

}  // namespace

Motion read_motion(const std::string& path) { return motion_of(Npz::read(path)); }

Motion decode_motion(std::span<const std::uint8_t> file, const std::string& name) {
  return motion_of(Npz::decode(file, name));
}

std::vector<double> read_joint_sigmas(const std::string& path) { return joint_sigmas_in(Npz::read(path)); }

std::vector<double> decode_joint_sigmas(std::span<const std::uint8_t> file, const std::string& name) {
  return joint_sigmas_in(Npz::decode(file, name));
}

void write_motion(const std::string& path, const Motion& motion, const std::vector<double>& joint_sigmas) {
  HSI4D_CHECK(!motion.poses.empty(), "a motion without frames");
  HSI4D_CHECK(motion.frame_rate > 0 && std::isfinite(motion.frame_rate), std::to_string(motion.frame_rate) + " Hz");
  std::vector<double> trans;
  for (const BodyPose& pose : motion.poses) {
    HSI4D_CHECK_EQ(pose.axis_angle.size(), static_cast<std::size_t>(3 * kSmplxJoints));
    for (int i = 0; i < 3; ++i) trans.push_back(pose.transl[i]);
  }
  NpzWriter file;
  const int64_t frames = static_cast<int64_t>(motion.poses.size());
  file.add<double>("trans", {frames, 3}, trans);
  add_joints(file, "poses", motion, 0, static_cast<std::size_t>(kSmplxJoints));
  for (const Part& part : kParts) add_joints(file, part.names[0], motion, part.joint, part.joints);
  std::vector<double> betas = motion.betas;
  betas.resize(std::max<std::size_t>(betas.size(), 10));
  file.add<double>("betas", {static_cast<int64_t>(betas.size())}, betas);
  if (motion.pelvis_rest) {
    const Vector3<double>& pelvis = *motion.pelvis_rest;
    file.add<double>("pelvis_rest", {3}, {pelvis[0], pelvis[1], pelvis[2]});
  }
  if (motion.first_frame != 0) file.add_scalar("first_frame", motion.first_frame);
  if (!joint_sigmas.empty()) {
    const auto joints = static_cast<int64_t>(joint_sigmas.size()) / (2 * frames);
    HSI4D_CHECK_EQ(static_cast<int64_t>(joint_sigmas.size()), 2 * frames * joints);
    file.add<double>(kSigmaName, {frames, joints, 2}, joint_sigmas);
  }
  file.add_text("gender", motion.gender);
  file.add_text("surface_model_type", "smplx");
  file.add_scalar("mocap_frame_rate", motion.frame_rate);
  file.add_scalar("mocap_framerate", motion.frame_rate);
  file.add_scalar("mocap_time_length", static_cast<double>(frames) / motion.frame_rate);
  file.write(path);
}

}  // namespace hsi4d
