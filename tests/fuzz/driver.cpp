// Runs a layer's fuzz targets as ordinary tests: READER [MUTATIONS [SEED [trace]]].
// The files of regressions/READER, which once were findings; every corpus file as it is, cut at every length and with
// every byte flipped (of large ones at 400 places); then random mutations. "trace" prints each step before it is
// run, to find one that crashes. READER try FILE... runs files of yours.
#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <iterator>
#include <string>
#include <string_view>

#include "tests/fuzz/allocations.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz {
namespace {

/// SplitMix64 [Steele et al. 2014], the same numbers everywhere.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t operator()() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  size_t below(size_t n) { return n == 0 ? 0 : static_cast<size_t>((*this)() % n); }

 private:
  uint64_t state_;
};

/// An allocation of more bytes is a finding: no file here is as large, nor unpacks to as much, and OpenImageIO takes 64
/// MiB at once for any image of the kinds that are its own.
constexpr std::size_t kLargestAllocation = std::size_t{96} << 20;

/// Places of a corpus file at which it is cut and flipped: all of a small one, evenly chosen ones of a larger one.
constexpr size_t kMostPlaces = 400;

struct Tally {
  int64_t taken = 0;
  int64_t refused = 0;
};

class Driver {
 public:
  Driver(const Target& target, bool trace) : target_(target), trace_(trace) {}

  bool run(const Bytes& file) {
    if (trace_) {
      std::printf("step %lld\n", static_cast<long long>(tally_.taken + tally_.refused));
      std::fflush(stdout);
    }
    try {
      forget_allocations();
      const bool taken = target_.accepts(file);
      if (largest_allocation() > kLargestAllocation)
        found(file, "takes " + std::to_string(largest_allocation()) + " bytes at once");
      ++(taken ? tally_.taken : tally_.refused);
      return taken;
    } catch (const std::exception& error) {
      found(file, std::string("an error of another kind: ") + error.what());
    }
  }
  const Tally& tally() const { return tally_; }

 private:
  [[noreturn]] void found(const Bytes& file, const std::string& what) const {
    std::printf("step %lld: %s; the file is fuzz_finding.bin\n", static_cast<long long>(tally_.taken + tally_.refused),
                what.c_str());
    write_file("fuzz_finding.bin", file);
    std::exit(1);
  }

  const Target& target_;
  bool trace_;
  Tally tally_;
};

/// The files that once were findings; their names are printed first, so that one that crashes is known.
void run_regressions(Driver& driver, const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  if (std::filesystem::is_directory(folder)) {
    for (const auto& entry : std::filesystem::directory_iterator(folder)) paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  for (const std::filesystem::path& path : paths) {
    std::printf("%s\n", path.filename().c_str());
    std::fflush(stdout);
    driver.run(read_file(path.string()));
  }
}

void mutate_once(Bytes& file, const std::vector<Bytes>& files, Random& random) {
  static constexpr uint64_t kTelling[] = {0, 1, 0x7f, 0x80, 0xff, 0x7fff, 0xffff, 0x7fffffff, 0xffffffff, ~uint64_t{0}};
  const size_t at = random.below(file.size());
  const size_t length = std::min(random.below(32) + 1, file.size() - at);
  switch (random.below(7)) {
    case 0:
      if (!file.empty()) file[at] ^= static_cast<uint8_t>(1u << random.below(8));
      break;
    case 1:
      if (!file.empty()) file[at] = static_cast<uint8_t>(random());
      break;
    case 2: {  // a number at its limits, either byte order
      const uint64_t number = kTelling[random.below(std::size(kTelling))];
      const size_t bytes = size_t{1} << random.below(4);
      const bool big = random.below(2) == 1;
      for (size_t i = 0; i < bytes && at + i < file.size(); ++i) {
        file[at + i] = static_cast<uint8_t>(number >> (8 * (big ? bytes - 1 - i : i)));
      }
      break;
    }
    case 3:
      file.erase(file.begin() + at, file.begin() + at + length);
      break;
    case 4: {
      const Bytes part(file.begin() + at, file.begin() + at + length);
      file.insert(file.begin() + random.below(file.size() + 1), part.begin(), part.end());
      break;
    }
    case 5:
      file.resize(random.below(file.size() + 1));
      break;
    default: {  // the end of another file
      const Bytes& other = files[random.below(files.size())];
      file.resize(at);
      file.insert(file.end(), other.begin() + random.below(other.size()), other.end());
    }
  }
}

int run_all(const Target& target, int64_t mutations, uint64_t seed, bool trace) {
  const std::vector<Bytes> files = target.corpus();
  Driver driver(target, trace);
  run_regressions(driver, std::filesystem::path(HSI4D_FUZZ_REGRESSIONS) / target.name);
  for (size_t i = 0; i < files.size(); ++i) {
    if (driver.run(files[i])) continue;
    std::printf("corpus file %zu is refused\n", i);
    return 1;
  }
  for (const Bytes& file : files) {
    const size_t step = file.size() / kMostPlaces + 1;
    for (size_t length = 0; length < file.size(); length += step)
      driver.run(Bytes(file.begin(), file.begin() + length));
    for (size_t at = 0; at < file.size(); at += step) {
      Bytes flipped = file;
      flipped[at] ^= 0xff;
      driver.run(flipped);
    }
  }
  Random random(seed);
  for (int64_t i = 0; i < mutations; ++i) {
    Bytes file = files[random.below(files.size())];
    for (size_t k = random.below(4) + 1; k > 0; --k) mutate_once(file, files, random);
    driver.run(file);
  }
  std::printf("seed %llu: %lld files taken, %lld refused\n", static_cast<unsigned long long>(seed),
              static_cast<long long>(driver.tally().taken), static_cast<long long>(driver.tally().refused));
  return 0;
}

int run_files(const Target& target, int count, char** paths) {
  Driver driver(target, false);
  for (int i = 0; i < count; ++i)
    std::printf("%s: %s\n", paths[i], driver.run(read_file(paths[i])) ? "taken" : "refused");
  return 0;
}

template <class T>
T number_or(int argc, char** argv, int i, T otherwise) {
  if (i >= argc) return otherwise;
  const std::string_view text = argv[i];
  T value = otherwise;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) {
    std::printf("not a number: %s\n", argv[i]);
    std::exit(2);
  }
  return value;
}

/// The target of this name; the names of all are told where there is none.
const Target& target_named(std::string_view name) {
  for (const Target* target : targets()) {
    if (target->name == name) return *target;
  }
  std::printf("usage: READER [MUTATIONS [SEED [trace]]], or READER try FILE...; readers:");
  for (const Target* target : targets()) std::printf(" %s", target->name);
  std::printf("\n");
  std::exit(2);
}

}  // namespace
}  // namespace hsi4d::fuzz

int main(int argc, char** argv) {
  using namespace hsi4d::fuzz;
  const Target& target = target_named(argc > 1 ? argv[1] : "");
  if (argc > 3 && std::string_view(argv[2]) == "try") return run_files(target, argc - 3, argv + 3);
  const int64_t mutations = number_or<int64_t>(argc, argv, 2, 2000);
  const uint64_t seed = number_or<uint64_t>(argc, argv, 3, 1);
  return run_all(target, mutations, seed, argc > 4 && std::string_view(argv[4]) == "trace");
}
