#include "optim/checkpoint.h"

#include <bit>
#include <limits>

#include <catch2/catch.hpp>

#include "core/npz.h"
#include "tests/support/temporary_folder.h"

namespace checkpoint_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

template <class T, class Bits>
std::vector<T> telling_numbers() {
  using Limits = std::numeric_limits<T>;
  std::vector<T> all = {T(0),
                        -T(0),
                        T(1.5),
                        Limits::infinity(),
                        -Limits::infinity(),
                        Limits::denorm_min(),
                        -Limits::denorm_min(),
                        Limits::max(),
                        Limits::lowest(),
                        Limits::min(),
                        Limits::quiet_NaN(),
                        -Limits::quiet_NaN()};
  const Bits nan = std::bit_cast<Bits>(Limits::quiet_NaN());
  all.push_back(std::bit_cast<T>(Bits(nan | 0x1234)));                                 // a payload
  all.push_back(std::bit_cast<T>(Bits(std::bit_cast<Bits>(Limits::infinity()) | 1)));  // a signalling NaN
  return all;
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

std::string refusal(const std::string& path, const std::string& hash) {
  try {
    load_checkpoint(path, hash);
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a checkpoint comes back bit for bit") {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "state.npz").string();
  const auto doubles = telling_numbers<double, std::uint64_t>();
  const auto floats = telling_numbers<float, std::uint32_t>();
  const std::vector<std::int64_t> integers = {0, -1, std::numeric_limits<std::int64_t>::min(),
                                              std::numeric_limits<std::int64_t>::max(), (std::int64_t{1} << 53) + 1};
  Checkpoint checkpoint;
  checkpoint.set("body/pose", doubles);
  checkpoint.set("colors", floats);
  checkpoint.set("frame", integers);
  checkpoint.set("empty", std::vector<float>{});
  checkpoint.set("note", std::string("Zwölf\nzeilen: π"));
  checkpoint.set("nothing", std::string());
  checkpoint.save(path, "abc");
  const Checkpoint again = load_checkpoint(path, "abc");
  CHECK(again.names() == checkpoint.names());
  CHECK(same_bits(again.doubles("body/pose"), doubles));
  CHECK(same_bits(again.floats("colors"), floats));
  CHECK(again.integers("frame") == integers);
  CHECK(again.floats("empty").empty());
  CHECK(again.text("note") == "Zwölf\nzeilen: π");
  CHECK(again.text("nothing").empty());
  CHECK(again.encode("abc") == checkpoint.encode("abc"));
}

TEST_CASE("a checkpoint names the entry that is missing or of another type") {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "state.npz").string();
  Checkpoint checkpoint;
  checkpoint.set("pose", std::vector<double>{1});
  CHECK_THROWS_AS(checkpoint.set("version", std::string("2")), InternalError);
  CHECK_THROWS_AS(checkpoint.set("", std::string("2")), InternalError);
  checkpoint.save(path, "abc");
  const Checkpoint again = load_checkpoint(path, "abc");
  CHECK_THROWS_WITH(again.doubles("poze"), Contains("state.npz: it has no entry 'poze'"));
  CHECK_THROWS_WITH(again.floats("pose"), Contains("state.npz: its entry 'pose' is not a vector of float32"));
  CHECK_THROWS_AS(again.text("pose"), DataError);
}

TEST_CASE("files that are no checkpoint of this run are refused by name") {
  const TemporaryFolder folder;
  const auto written = [&](const std::string& format, std::int64_t version, const auto& add_more) {
    NpzWriter file;
    file.add_text("format", format);
    file.add_scalar<std::int64_t>("version", version);
    file.add_text("config_hash", "abc");
    add_more(file);
    const std::string path = (folder.path() / "state.npz").string();
    file.write(path);
    return path;
  };
  const auto nothing = [](NpzWriter&) {};
  CHECK(refusal(written("hsi4d checkpoint", 1, nothing), "abc").empty());
  CHECK_THAT(refusal(written("hsi4d avatar", 1, nothing), "abc"),
             Contains("state.npz: its format is 'hsi4d avatar'; 'hsi4d checkpoint' is needed"));
  CHECK_THAT(refusal(written("hsi4d checkpoint", 2, nothing), "abc"),
             Contains("state.npz: version 2 of the checkpoint format; this program reads up to version 1"));
  CHECK_THAT(refusal(written("hsi4d checkpoint", 0, nothing), "abc"), Contains("version 0"));
  CHECK_THAT(refusal(written("hsi4d checkpoint", 1, nothing), "abd"),
             Contains("state.npz: made with another config (hash abc, now abd)"));
  CHECK_THAT(refusal(written("hsi4d checkpoint", 1, [](NpzWriter& f) { f.add<std::int32_t>("x", {1}, {1}); }), "abc"),
             Contains("'x'") && Contains("dtype '<i4'"));
  CHECK_THAT(refusal(written("hsi4d checkpoint", 1,
                             [](NpzWriter& f) {
                               f.add<double>("x", {1, 1}, {1});
                             }),
                     "abc"),
             Contains("'x'") && Contains("shape [1,1]"));
  NpzWriter other;
  other.add_scalar("x", 1.0);
  const std::string path = (folder.path() / "other.npz").string();
  other.write(path);
  CHECK_THAT(refusal(path, "abc"), Contains("other.npz: ") && Contains("format, version or config_hash is missing"));
  CHECK_THROWS_AS(load_checkpoint((folder.path() / "none.npz").string(), "abc"), UserError);
}

TEST_CASE("moments go through a checkpoint") {
  AdamState state;
  state["color_net"] = {12, {{{1, -0.0}, {2, 1e-300}}, {{0.5}, {0.25}}}};
  state["root"] = {};
  Checkpoint checkpoint;
  store_moments(state, "adam", checkpoint);
  store_moments({}, "none", checkpoint);
  const Checkpoint again = decode_checkpoint(checkpoint.encode("abc"), "state.npz", "abc");
  CHECK(stored_moments(again, "adam") == state);
  CHECK(stored_moments(again, "none").empty());
  CHECK(stored_moments(again, "absent").empty());
  Checkpoint cut = again;
  cut.set("adam/color_net/steps", std::vector<std::int64_t>{12, 3});
  CHECK_THROWS_WITH(stored_moments(cut, "adam"), Contains("no entry 'adam/color_net/2/mean'"));
}

TEST_CASE("the hash of a text is FNV-1a") {
  CHECK(text_hash("") == "cbf29ce484222325");
  CHECK(text_hash("foobar") == "85944171f73967e8");
}

}  // namespace checkpoint_test
