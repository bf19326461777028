#include "pipelines/cli/text.h"

#include <filesystem>

namespace hsi4d::cli {

std::string short_number(double value) { return rounded(value, 4); }

std::string file_ending(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  for (char& c : ending) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return ending;
}

}  // namespace hsi4d::cli
