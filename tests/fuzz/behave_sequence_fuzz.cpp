// A sequence of BEHAVE: each of its two files beside a good other one.
#include "core/npz.h"
#include "pipelines/evaluate/behave_sequence.h"
#include "tests/fuzz/archive_list.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::behave_sequence_fuzz {

namespace {

const std::vector<std::string> kTimes = {"t0003.000", "t0003.067"};

Bytes human() {
  NpzWriter file;
  file.add<float>("poses", {2, 156}, std::vector<float>(312, 0.25F));
  file.add<float>("trans", {2, 3}, {0, 1, 2, 0.5F, 1, 2});
  file.add_texts("frame_times", kTimes);
  return file.encode();
}

Bytes object() {
  NpzWriter file;
  file.add<float>("angles", {2, 3}, {0, 1, 2, 0, 1, 1.5F});
  file.add<double>("trans", {2, 3}, {0, 1, 2, 3, 4, 5});
  file.add_texts("frame_times", kTimes);
  return file.encode();
}

Scratch& scratch() {
  static Scratch made({{"smpl_fit_all.npz", human()}, {"object_fit_all.npz", object()}});
  return made;
}

}  // namespace

std::vector<Bytes> corpus() {
  return {Scratch::with_choice(0, human()), Scratch::with_choice(0, list_of(human())),
          Scratch::with_choice(1, object()), Scratch::with_choice(1, list_of(object()))};
}

bool accepts(std::span<const uint8_t> file) {
  scratch().try_file(file, [](std::span<const uint8_t> rest) { return archive_of(rest); });
  return is_read([&] {
    const Track track = read_behave_sequence(scratch().path(), "object");
    HSI4D_CHECK_EQ(track.object_poses.size(), track.motion.poses.size());
    HSI4D_CHECK_EQ(track.good_frames.size(), track.motion.poses.size());
    for (const std::vector<ObjectPose>& poses : track.object_poses)
      HSI4D_CHECK(poses.at(0).rotation.allFinite() && poses.at(0).translation.allFinite(), "no number was taken");
  });
}

const Target target("behave_sequence", corpus, accepts);

}  // namespace hsi4d::fuzz::behave_sequence_fuzz
