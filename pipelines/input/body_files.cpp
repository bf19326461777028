#include "pipelines/input/body_files.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "body/avatar_shape.h"
#include "body/motion_edit.h"
#include "body/pose_layout.h"
#include "body/procedural_body.h"
#include "body/smplx_file.h"
#include "core/check.h"
#include "core/log.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr double kSameJoints = 0.01;  // metres that joints of the same body may be apart

const char* name_of(BodyKind kind) { return kind == BodyKind::kProcedural ? kProceduralName : kSmplxName; }

/// Those beyond the end of one are 0.
bool are_same_betas(std::vector<double> a, std::vector<double> b) {
  a.resize(std::max(a.size(), b.size()));
  b.resize(a.size());
  return a == b;
}

std::string numbers_text(const std::vector<double>& numbers) {
  std::vector<std::string> texts;
  for (const double x : numbers) texts.push_back(number_text(x));
  return "[" + joined(texts) + "]";
}

}  // namespace

void warn_of_repairs(const SmplxModel& model) {
  if (model.rescaled_weights == 0) return;
  log_warning(model.source +
              ": vertices whose skinning weights are divided by their sum: " + std::to_string(model.rescaled_weights));
}

void warn_of_excess(const std::string& file, const std::string& name, std::span<const double> numbers, Index width,
                    const SmplxModel& model, Index there) {
  if (width <= there) return;
  bool is_zero = true;
  for (std::size_t i = 0; i < numbers.size(); ++i)
    is_zero = is_zero && (static_cast<Index>(i) % width < there || numbers[i] == 0);
  if (is_zero) return;
  log_warning(file + ": array '" + name + "': has " + std::to_string(width) + " numbers a frame; " + model.source +
              " has " + std::to_string(there) + ", and the others are left out");
}

SmplxModel read_model_for(const std::string& path, const std::string& motion, const std::vector<double>& betas) {
  const SmplxModel bare = read_smplx(path, {.betas = 0, .expressions = 0, .correctives = false});
  warn_of_repairs(bare);
  warn_of_excess(motion, "betas", betas, std::ssize(betas), bare, bare.betas_in_file);
  const Index count = std::min<Index>(bare.betas_in_file, static_cast<Index>(betas.size()));
  return count == 0 ? bare : read_smplx(path, {.betas = count, .expressions = 0, .correctives = false});
}

Motion read_motion_with_warnings(const std::string& path) {
  if (std::filesystem::is_directory(path))
    throw UserError(path + ": is a folder; of one of SMPLer-X's results `hsi4d motion " + path +
                    " OUT.npz` makes a motion");
  Motion motion = read_motion(path);
  if (!motion.unread.empty()) log_warning(path + ": arrays that are not read: " + few_names(motion.unread));
  if (motion.lost_shape)
    log_warning(path + ": is of " + motion.converted_from + ", whose betas are no shape of SMPL-X: they are left out");
  return motion;
}

void check_begins_with_frame_0(const Motion& motion, const std::string& file, const std::string& needed) {
  if (motion.first_frame == 0) return;
  throw DataError(file + ": begins with frame " + number_text(motion.first_frame) + " of its video; " + needed);
}

Avatar read_person(const std::string& file) {
  Avatar avatar = read_avatar(file);
  if (avatar.joint_count() == kSmplxJoints) return avatar;
  throw DataError(file + ": has " + std::to_string(avatar.joint_count()) + " joints; a person has the " +
                  std::to_string(kSmplxJoints) + " of SMPL-X");
}

PoseFolder read_pose_folder_with_warnings(const std::string& folder, double frame_rate, int person) {
  PoseFolder read = read_pose_folder(folder, frame_rate, person);
  if (read.filled > 0) log_warning(folder + ": frames without a file, interpolated: " + std::to_string(read.filled));
  if (read.counts_from_one)
    log_info(folder + ": its files count from frame 1, which is taken for the first frame of the video");
  if (read.motion.first_frame > 0)
    log_warning(folder + ": begins with frame " + number_text(read.motion.first_frame) +
                " of the video, counted from 0, by the names of its files");
  std::vector<std::string> others;
  for (const std::int64_t other : read.other_people) others.push_back(std::to_string(other));
  if (!others.empty())
    log_warning(folder + ": person " + std::to_string(person) + " is read; there are files of the people " +
                few_names(others) + " too (--person)");
  return read;
}

Motion read_motion_for(const std::string& path, const Avatar& avatar) {
  return for_body(read_motion_with_warnings(path), avatar);
}

SmplxModel body_model_of(const BodySettings& settings) {
  SmplxModel model = settings.kind == BodyKind::kProcedural ? procedural_smplx(settings.betas)
                                                            : read_smplx(settings.path.string(), {settings.betas, 0});
  warn_of_repairs(model);
  return model;
}

BodyModel rest_body(const BodySettings& settings) {
  if (settings.kind == BodyKind::kProcedural && settings.shape.empty()) return procedural_body();
  std::vector<double> betas = settings.shape;
  betas.resize(static_cast<std::size_t>(settings.betas));
  return rest_body(body_model_of(settings), betas);
}

BodySettings body_of_avatar(const BodySettings& settings, const std::string& avatar) {
  const std::optional<AvatarShape> shape = read_avatar_shape(avatar);
  if (!shape || shape->body != name_of(settings.kind)) return settings;
  BodySettings result = settings;
  result.betas = std::max(settings.betas, static_cast<Index>(shape->betas.size()));
  if (settings.shape.empty()) result.shape = shape->betas;
  if (are_same_betas(result.shape, shape->betas)) return result;
  throw UserError("/body/shape: is " + numbers_text(settings.shape) + "; the avatar " + avatar +
                  " was made in the shape " + numbers_text(shape->betas) +
                  "; leave body.shape out, or take an avatar " + "of that shape");
}

std::string difference_from(const BodyModel& body, const Avatar& avatar) {
  if (!avatar.body.empty() && avatar.body != body.name)
    return "the avatar is of the body \"" + avatar.body + "\", and `body` says \"" + body.name + "\"";
  double largest = 0;
  for (std::size_t i = 0; i < body.joints.size(); ++i)
    largest = std::max(largest, std::fabs(body.joints[i] - avatar.joints[i]));
  if (largest <= kSameJoints) return "";
  return "joints of the avatar are " + rounded(100 * largest, 2) + " cm from those of `body`: of another shape";
}

}  // namespace hsi4d
