#include "pipelines/input/input_hashes.h"

#include <filesystem>
#include <sstream>

#include "core/check.h"
#include "core/file.h"
#include "core/parallel.h"
#include "optim/checkpoint.h"

namespace hsi4d {

namespace {

constexpr std::size_t kMostTold = 8;

std::string line_of(const ClipFile& file) {
  if (!std::filesystem::exists(file.path)) return "- " + file.name;
  return text_hash(read_text_file(file.path.string())) + " " + file.name;
}

std::vector<std::string> lines_of(const std::vector<ClipFile>& files) {
  std::vector<std::string> lines(files.size());
  parallel_for(std::ssize(files), 1, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      lines[static_cast<std::size_t>(i)] = line_of(files[static_cast<std::size_t>(i)]);
  });
  return lines;
}

}  // namespace

std::string input_hashes(const std::vector<ClipFile>& files) {
  std::string text;
  for (const std::string& line : lines_of(files)) text += line + "\n";
  return text;
}

void check_unchanged(const std::string& before, const std::vector<ClipFile>& files, const std::string& checkpoint) {
  const std::vector<std::string> now = lines_of(files);
  std::istringstream text(before);
  std::string problems;
  std::size_t changed = 0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    std::string line;
    std::getline(text, line);
    if (line == now[i]) continue;
    if (++changed > kMostTold) continue;
    problems += files[i].path.string() + ": is not what the run began with (" + files[i].name + ")\n";
  }
  if (changed == 0) return;
  if (changed > kMostTold) problems += "and " + std::to_string(changed - kMostTold) + " more files\n";
  throw DataError(problems + checkpoint + ": goes on with the inputs as they were; without it the run begins anew");
}

}  // namespace hsi4d
