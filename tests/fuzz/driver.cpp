// Runs a fuzz target as an ordinary test: NAME [MUTATIONS [SEED [trace]]], or writes the corpus for libFuzzer:
// NAME corpus FOLDER.
// Every corpus file as it is, cut at every length and with every byte flipped, then random mutations.
// "trace" prints each step before it is run, to find one that crashes.
#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iterator>
#include <string>
#include <string_view>

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

struct Tally {
  int64_t taken = 0;
  int64_t refused = 0;
};

class Driver {
 public:
  explicit Driver(bool trace) : trace_(trace) {}

  bool run(const Bytes& file) {
    if (trace_) {
      std::printf("step %lld\n", static_cast<long long>(tally_.taken + tally_.refused));
      std::fflush(stdout);
    }
    try {
      const bool taken = accepts(file);
      ++(taken ? tally_.taken : tally_.refused);
      return taken;
    } catch (const std::exception& error) {
      std::printf("step %lld: an error of another kind: %s\n", static_cast<long long>(tally_.taken + tally_.refused),
                  error.what());
      write_file("fuzz_finding.bin", file);
      std::exit(1);
    }
  }
  const Tally& tally() const { return tally_; }

 private:
  bool trace_;
  Tally tally_;
};

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

int run_all(int64_t mutations, uint64_t seed, bool trace) {
  const std::vector<Bytes> files = corpus();
  Driver driver(trace);
  for (size_t i = 0; i < files.size(); ++i) {
    if (driver.run(files[i])) continue;
    std::printf("corpus file %zu is refused\n", i);
    return 1;
  }
  for (const Bytes& file : files) {
    for (size_t length = 0; length < file.size(); ++length) driver.run(Bytes(file.begin(), file.begin() + length));
    for (size_t at = 0; at < file.size(); ++at) {
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

int write_corpus(const std::string& folder) {
  int number = 0;
  for (const Bytes& file : corpus()) write_file(folder + "/corpus" + std::to_string(number++), file);
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

}  // namespace
}  // namespace hsi4d::fuzz

int main(int argc, char** argv) {
  if (argc == 3 && std::string_view(argv[1]) == "corpus") return hsi4d::fuzz::write_corpus(argv[2]);
  const int64_t mutations = hsi4d::fuzz::number_or<int64_t>(argc, argv, 1, 2000);
  const uint64_t seed = hsi4d::fuzz::number_or<uint64_t>(argc, argv, 2, 1);
  return hsi4d::fuzz::run_all(mutations, seed, argc > 3 && std::string_view(argv[3]) == "trace");
}
