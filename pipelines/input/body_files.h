// Files of bodies as the program reads them: what was repaired or left out is told in the log.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "body/avatar.h"
#include "body/motion_edit.h"
#include "body/motion_io.h"
#include "body/smplx_file.h"
#include "pipelines/config/body_settings.h"

namespace hsi4d {

/// Tells how many vertices have repaired skinning weights, where there are any.
void warn_of_repairs(const SmplxModel& model);

/// Tells that numbers of shape or expression beyond what a model has are left out, unless all of those are 0.
///
/// @param file     that they are in, for the message, and
/// @param name     of their array
/// @param numbers  rows of `width`
/// @param there    how many the model has
void warn_of_excess(const std::string& file, const std::string& name, std::span<const double> numbers, Index width,
                    const SmplxModel& model, Index there);

/// The model that the settings name, in the layout of SMPL-X, without expressions; weights that were repaired are told
/// in the log. Throws as read_smplx; DataError when it has fewer betas than are asked for.
SmplxModel body_model_of(const BodySettings& settings);

/// The body in its rest pose and its shape, whatever its kind. Throws as body_model_of.
BodyModel rest_body(const BodySettings& settings);

/// The settings of the body that an avatar was made on: in the shape that its file says, unless the settings say one.
/// Where they name another kind of body, or the file says no shape, they stay as they are.
/// Throws UserError where both say a shape and these differ; DataError as read_avatar_shape.
/// @param avatar  a file
BodySettings body_of_avatar(const BodySettings& settings, const std::string& avatar);

/// Why a body is not the one that the avatar was made on, in words: another name, or joints elsewhere; empty where it
/// is.
std::string difference_from(const BodyModel& body, const Avatar& avatar);

/// Reads a body model with as many directions of shape as a motion has numbers for, as far as the file has them: the
/// first `betas` numbers are those of the model that is returned. Tells what is repaired or left out. Throws as
/// read_smplx.
///
/// @param motion  the file that the betas are of, for messages
SmplxModel read_model_for(const std::string& path, const std::string& motion, const std::vector<double>& betas);

/// Reads a motion, and tells what of it is left out because it is of another body model, and arrays that are not read.
/// Throws as read_motion; UserError for a folder.
Motion read_motion_with_warnings(const std::string& path);

/// Throws DataError naming the file of a motion that begins with a later frame of its video than 0.
/// @param needed  what it is read for, and what is allowed instead
void check_begins_with_frame_0(const Motion& motion, const std::string& file, const std::string& needed);

/// As read_avatar, of a person. Throws DataError naming the file where its joints are not as many as SMPL-X has.
Avatar read_person(const std::string& file);

/// As read_pose_folder; frames that are filled in, where it begins and people that are not read are told in the log.
PoseFolder read_pose_folder_with_warnings(const std::string& folder, double frame_rate, int person);

/// As read_motion_with_warnings, moved to the avatar's body (for_body): its pelvis is where the file has it.
Motion read_motion_for(const std::string& path, const Avatar& avatar);

}  // namespace hsi4d
