// A folder for readers that want files with names: one of its files is tried, the others are good.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stress/scratch_folder.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz {

inline Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

/// A file of a folder: its name, which may lead through folders, and a good content.
struct ScratchFile {
  std::string name;
  Bytes good;
};

/// Good files, of which the last one that was tried may be another.
class Scratch {
 public:
  explicit Scratch(std::vector<ScratchFile> files) : files_(std::move(files)) {
    for (const ScratchFile& file : files_) put(file.name, file.good);
  }

  std::string path() const { return folder_.path(); }
  std::string operator/(const std::string& name) const { return folder_ / name; }

  /// What mutations start from: the good content of each file behind the byte that chooses it.
  std::vector<Bytes> corpus() const {
    std::vector<Bytes> all;
    for (std::size_t i = 0; i < files_.size(); ++i) all.push_back(with_choice(i, files_[i].good));
    return all;
  }

  /// Makes the file that the first byte chooses hold the others, and every other file good.
  /// @param made  the content of the file that is made of bytes of the input
  template <class Made>
  void try_file(std::span<const uint8_t> input, Made&& made) {
    const std::size_t choice = input.empty() ? 0 : input[0] % files_.size();
    if (tried_ != choice) put(files_[tried_].name, files_[tried_].good);
    tried_ = choice;
    put(files_[choice].name, made(input.empty() ? input : input.subspan(1)));
  }
  void try_file(std::span<const uint8_t> input) {
    try_file(input, [](std::span<const uint8_t> rest) { return Bytes(rest.begin(), rest.end()); });
  }

  static Bytes with_choice(std::size_t choice, const Bytes& content) {
    Bytes input = {static_cast<uint8_t>(choice)};
    input.insert(input.end(), content.begin(), content.end());
    return input;
  }

 private:
  void put(const std::string& name, std::span<const uint8_t> content) const {
    write_file(folder_ / name, content);  // folders on the way are made
  }

  std::vector<ScratchFile> files_;
  ScratchFolder folder_;
  std::size_t tried_ = 0;
};

}  // namespace hsi4d::fuzz
