// Contacts of data.contacts: which part of the body touches what in which frame, as somebody has annotated it.
//
//   {"format": "hsi4d contacts", "version": 1, "contacts": [
//     {"frame": 4, "body": "right_hand", "object": "can", "point": [0, 0, 0.1], "weight": 1},
//     {"frame": 4, "vertex": 1234, "scene": [0.2, 0.6, 0.45]}]}
#pragma once

#include <string>
#include <vector>

#include "body/body_model.h"
#include "optim/annotated_contact.h"
#include "pipelines/config/data_settings.h"

namespace hsi4d {

/// What contacts may name.
struct ContactNames {
  std::vector<std::string> objects;  ///< in the clip's order
  Index frames = 0;
};

/// The contacts of a file in memory, in its order. `body` is a joint of SMPL-X, or "left_hand" or "right_hand":
/// wrist and fingers.
///
/// @param name  what messages call it
/// Throws DataError naming the file, the line, the JSON pointer, the value and what is allowed: another format or
/// version, an unknown key, a contact without what touches or is touched, or with two of these, a frame, an object or a
/// part that is not there, a place beyond 1e6 m, a weight that is not above 0 or beyond 1e6.
std::vector<AnnotatedContact> decode_contacts(const std::string& text, const std::string& name,
                                              const ContactNames& known);

/// As decode_contacts. Throws UserError for a file that cannot be read.
std::vector<AnnotatedContact> read_contacts(const std::string& path, const ContactNames& known);

/// Throws UserError naming the file and the contact where nothing of the human can be what touches: a vertex that the
/// body does not have, a part that no point follows.
/// @param body  that the avatar was made on; null: it is another, and its Gaussians stand for the vertices
void check_contacts(const std::vector<AnnotatedContact>& contacts, const BodyModel* body,
                    const SparseWeights& of_gaussians, const std::string& path);

}  // namespace hsi4d
