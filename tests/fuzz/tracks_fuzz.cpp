// Motions with objects and cameras, to be compared: one file of such a folder is tried, the others are good.
#include "body/procedural_body.h"
#include "core/npz.h"
#include "pipelines/evaluate/tracks.h"
#include "tests/fuzz/archive_list.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::tracks_fuzz {

namespace {

constexpr std::string_view kCameras =
    R"({"format": "hsi4d cameras", "version": 1, "cameras": [{"width": 2, "height": 1, "fx": 1, "fy": 1,
 "cx": 1, "cy": 0.5, "world_to_camera": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]},
 {"width": 2, "height": 1, "fx": 1, "fy": 1,
 "cx": 1, "cy": 0.5, "world_to_camera": [[0, -1, 0, 7], [0, 0, -1, 8], [1, 0, 0, 9], [0, 0, 0, 1]]}]})";

Bytes motion() {
  NpzWriter file;
  file.add<double>("trans", {2, 3}, {0, 1, 2, 3, 4, 5});
  file.add<float>("poses", {2, 165}, std::vector<float>(330, 0.5F));
  file.add_scalar("mocap_framerate", 10.0);
  return file.encode();
}

Bytes objects() {
  NpzWriter file;
  for (const char* name : {"ball/rotation", "ball/translation", "box/rotation", "box/translation"})
    file.add<double>(name, {2, 3}, {0, 1, 2, 0.5, 0.25, 0.125});
  return file.encode();
}

Scratch& scratch() {
  static Scratch made({{"motion.npz", motion()}, {"objects.npz", objects()}, {"cameras.json", bytes_of(kCameras)}});
  return made;
}

}  // namespace

std::vector<Bytes> corpus() {
  std::vector<Bytes> all = scratch().corpus();
  all.push_back(Scratch::with_choice(0, list_of(motion())));
  all.push_back(Scratch::with_choice(1, list_of(objects())));
  return all;
}

bool accepts(std::span<const uint8_t> file) {
  static const Track truth = read_track(scratch().path());
  static const BodyModel body = procedural_body();
  static const RestSkeleton skeleton{body.parents, body.joints};
  scratch().try_file(file, [](std::span<const uint8_t> rest) { return archive_of(rest); });
  return is_read([&] {
    const Track track = read_track(scratch().path());
    const AlignedTracks both = aligned(track, skeleton, truth, skeleton);
    HSI4D_CHECK(both.estimate.size() == both.truth.size() && both.truth.size() <= 2, "frames that are not there");
  });
}

const Target target("tracks", corpus, accepts);

}  // namespace hsi4d::fuzz::tracks_fuzz
