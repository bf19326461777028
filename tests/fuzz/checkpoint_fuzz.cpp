#include <limits>

#include "optim/checkpoint.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::checkpoint_fuzz {

namespace {
const std::string kHash = text_hash("{}");
}

std::vector<Bytes> corpus() {
  Checkpoint small;
  Checkpoint full;
  full.set("pose", std::vector<double>{1.5, -0.0, std::numeric_limits<double>::quiet_NaN()});
  full.set("colors", std::vector<float>{1, 2, 3});
  full.set("frame", std::vector<std::int64_t>{7});
  full.set("stage", std::string("interaction"));
  store_moments({{"color_net", {3, {{{1, 2}, {3, 4}}, {{5}, {6}}}}}}, "adam", full);
  return {list_of(small.encode(kHash)), list_of(full.encode(kHash)), full.encode(kHash)};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const Checkpoint checkpoint = decode_checkpoint(archive_of(file), "fuzz.npz", kHash);
    for (const std::string& name : checkpoint.names()) is_read([&] { checkpoint.doubles(name); });
    is_read([&] { stored_moments(checkpoint, "adam"); });
  });
}

const Target target("checkpoint", corpus, accepts);

}  // namespace hsi4d::fuzz::checkpoint_fuzz
