#include "body/file_contents.h"

#include <algorithm>

#include "core/check.h"

namespace hsi4d {

namespace {

struct Contents {
  const char* text;
  std::initializer_list<const char*> one_of;  // one of these arrays is there
  std::initializer_list<const char*> and_one_of = {};
};

// The first that fits. AMASS's names are before those of smplx, of which a motion may have some.
const Contents kContents[] = {
    {"a body model", {"v_template", "shapedirs"}},
    {"an avatar", {"weight_indices"}, {"log_scales"}},
    {"a motion", {"poses", "root_orient", "pose_body", "human_pose", "human_orient", "pose_world"}},
    {"parameters of smplx", {"global_orient", "body_pose", "transl"}},
    {"the weights of VPoser", {"decoder_net.0.weight", "vp_model.decoder_net.0.weight"}},
    {"a run's checkpoint", {"config_hash"}},
    {"vertices and joints, as hsi4d pose writes them", {"vertices"}, {"joints"}},
    {"an image", {"image"}, {"alpha"}},
};

bool has_one(const Npz& file, const std::initializer_list<const char*>& names) {
  return std::any_of(names.begin(), names.end(), [&](const char* name) { return file.has(name); });
}

}  // namespace

std::string contents_of(const Npz& file) {
  for (const Contents& contents : kContents) {
    if (has_one(file, contents.one_of) && (contents.and_one_of.size() == 0 || has_one(file, contents.and_one_of)))
      return contents.text;
  }
  const auto& names = file.names();
  const bool are_poses =
      std::any_of(names.begin(), names.end(), [](const auto& n) { return n.ends_with("/rotation"); });
  return are_poses ? "poses of objects" : "";
}

void refuse_other_contents(const Npz& file, std::initializer_list<const char*> wanted, const std::string& hint) {
  const std::string contents = contents_of(file);
  if (contents.empty() || std::find(wanted.begin(), wanted.end(), contents) != wanted.end()) return;
  throw DataError(file.source() + ": holds " + contents + ", not " + *wanted.begin() + hint);
}

}  // namespace hsi4d
