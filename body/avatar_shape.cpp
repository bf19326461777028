#include "body/avatar_shape.h"

#include <cmath>

#include "body/pose_layout.h"
#include "core/file.h"
#include "core/finite_numbers.h"
#include "core/text.h"

namespace hsi4d {

namespace {

void check_betas(const NpyArray& array, const std::vector<double>& betas) {
  if (std::ssize(betas) > kMostBetas)
    throw DataError(array.source() + ": has " + std::to_string(betas.size()) + " numbers; allowed: at most " +
                    std::to_string(kMostBetas));
  for (std::size_t i = 0; i < betas.size(); ++i) {
    if (std::abs(betas[i]) > kLargestBeta)
      throw DataError(array.source() + ": number " + std::to_string(i) + " is " + number_text(betas[i]) +
                      "; allowed: " + kBetasText);
  }
}

}  // namespace

bool is_gender(std::string_view word) { return word == "neutral" || word == "female" || word == "male"; }

void add_avatar_shape(const AvatarShape& shape, SafetensorsWriter& file) {
  file.add<double>("betas", {std::ssize(shape.betas)}, shape.betas);
  file.set_text("gender", shape.gender);
}

std::optional<AvatarShape> avatar_shape_of(const Safetensors& file) {
  if (!file.has("betas")) return {};
  AvatarShape shape;
  if (file.metadata().contains("body")) shape.body = file.text("body");
  shape.betas = finite_numbers<double>(file.array("betas"), {-1});
  check_betas(file.array("betas"), shape.betas);
  if (!file.metadata().contains("gender")) return shape;
  shape.gender = file.text("gender");
  if (!is_gender(shape.gender))
    throw DataError(file.source() + ": metadata 'gender' is \"" + with_escapes(shape.gender) +
                    "\"; allowed: " + kGendersText);
  return shape;
}

std::optional<AvatarShape> read_avatar_shape(const std::string& path) {
  const Bytes file = read_file(path);
  if (!looks_like_safetensors(file)) return {};
  return avatar_shape_of(Safetensors::decode(file, path));
}

}  // namespace hsi4d
