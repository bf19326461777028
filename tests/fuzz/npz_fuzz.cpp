#include <string>

#include "core/npz.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::npz_fuzz {

std::vector<Bytes> corpus() {
  NpzWriter small;
  small.add_scalar("x", 1.5);
  NpzWriter mixed;
  mixed.add<float>("weights", {2, 3}, {1, 2, 3, 4, 5, 6});
  mixed.add_text("gender", "neutral");
  mixed.add<int64_t>("parents", {40}, std::vector<int64_t>(40, 7));
  return {small.encode(), list_of(mixed.encode()), mixed.encode(NpzPacking::stored), mixed.encode(NpzPacking::deflated),
          NpzWriter().encode()};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const Npz npz = Npz::decode(archive_of(file), "fuzz.npz");
    for (const std::string& name : npz.names()) is_read([&] { npz.array(name).as<double>(); });
    for (const Npz::Skipped& skipped : npz.skipped()) is_read([&] { npz.array(skipped.name); });
  });
}

const Target target("npz", corpus, accepts);

}  // namespace hsi4d::fuzz::npz_fuzz
