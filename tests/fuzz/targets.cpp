#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz {

std::vector<const Target*>& targets() {
  static std::vector<const Target*> all;
  return all;
}

Target::Target(const char* target_name, std::vector<Bytes> (*target_corpus)(),
               bool (*target_accepts)(std::span<const uint8_t>))
    : name(target_name), corpus(target_corpus), accepts(target_accepts) {
  targets().push_back(this);
}

}  // namespace hsi4d::fuzz
