// The person's shape in an avatar's file: that of the body that the avatar was made on, so that the body can be made
// again.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/safetensors.h"

namespace hsi4d {

struct AvatarShape {
  std::string body;                ///< Avatar::body, whose betas these are
  std::vector<double> betas;       ///< beyond their end they are 0
  std::string gender = "neutral";  ///< of the body model

  bool operator==(const AvatarShape&) const = default;
};

/// Whether a word is one of kGendersText.
bool is_gender(std::string_view word);
inline constexpr const char* kGendersText = "neutral, female, male";

/// Adds F64 `betas` [B] and the text `gender` to an avatar's file, which has the body's name already.
void add_avatar_shape(const AvatarShape& shape, SafetensorsWriter& file);

/// The shape in an avatar's file; none where it does not say one, as files of other programs and of version 1.
/// Throws DataError naming file and array: another shape than [B], more than kMostBetas, a number that is not finite or
/// beyond kLargestBeta, a gender other than neutral, female and male.
std::optional<AvatarShape> avatar_shape_of(const Safetensors& file);

/// As avatar_shape_of. Throws UserError when the file cannot be read.
std::optional<AvatarShape> read_avatar_shape(const std::string& path);

}  // namespace hsi4d
