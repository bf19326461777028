#include "pipelines/locate/colmap_camera.h"

#include <vector>

#include "core/check.h"
#include "core/text.h"
#include "pipelines/photos/colmap.h"

namespace hsi4d {

namespace fs = std::filesystem;

Camera colmap_camera(const fs::path& folder, const std::string& picture, const Similarity& alignment) {
  const fs::path model = colmap_folder(folder);
  if (model.empty())
    throw UserError(folder.string() +
                    ": holds no model of COLMAP: cameras and images, .bin or .txt, in it, in sparse/0 "
                    "or in sparse");
  const std::vector<PosedImage> images = read_colmap(model).images;
  const PosedImage* found = nullptr;
  std::vector<std::string> names;
  for (const PosedImage& image : images) {
    names.push_back(image.name);
    if (image.name != picture && fs::path(image.name).filename() != picture) continue;
    if (found != nullptr && found->name != picture && image.name != picture)
      throw UserError(model.string() + ": both " + with_escapes(found->name) + " and " + with_escapes(image.name) +
                      " are called " + picture + "; --name says which");
    if (found == nullptr || image.name == picture) found = &image;
  }
  if (found == nullptr)
    throw UserError(model.string() + ": has not registered " + with_escapes(picture) + ", but " + few_names(names) +
                    "; --name says what the model calls it");
  if (!found->lens.is_straight())
    throw UserError(model.string() + ": the lens of " + with_escapes(found->name) +
                    " bends; frames are taken for a pinhole's. Register it with --ImageReader.camera_model PINHOLE, or "
                    "straighten the video first");
  return moved_camera(found->camera, alignment);
}

}  // namespace hsi4d
