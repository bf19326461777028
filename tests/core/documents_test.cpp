// Links between the documents of the repository: the files that they name are there, and the headings too.
#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "core/file.h"
#include "tests/support/temporary_folder.h"

namespace documents_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

/// The documents below a folder; not those of hidden folders, of builds and of runs.
std::vector<fs::path> documents_in(const fs::path& top) {
  std::vector<fs::path> files;
  for (auto it = fs::recursive_directory_iterator(top); it != fs::recursive_directory_iterator(); ++it) {
    const std::string name = it->path().filename().string();
    if (it->is_directory() && (name.starts_with(".") || (it.depth() == 0 && (name == "build" || name == "runs")))) {
      it.disable_recursion_pending();
    } else if (it->path().extension() == ".md") {
      files.push_back(it->path());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Lines outside of fenced blocks of code.
std::vector<std::string> prose_of(const std::string& text) {
  std::vector<std::string> lines;
  bool is_code = false;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with("```")) is_code = !is_code;
    lines.push_back(is_code ? "" : line);
  }
  return lines;
}

/// The anchor that a heading has: small letters, "-" for blanks, no punctuation but "-" and "_".
std::string anchor_of(const std::string& heading) {
  std::string anchor;
  for (const char c : heading) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == ' ') {
      anchor += '-';
    } else if (std::isalnum(byte) != 0 || c == '-' || c == '_' || byte >= 0x80U) {
      anchor += static_cast<char>(byte < 0x80U ? std::tolower(byte) : byte);
    }
  }
  return anchor;
}

std::set<std::string> anchors_of(const std::string& text) {
  std::set<std::string> anchors;
  std::map<std::string, int> seen;
  for (const std::string& line : prose_of(text)) {
    const std::size_t level = line.find_first_not_of('#');
    if (level == 0 || level == std::string::npos || line[level] != ' ') continue;
    const std::string anchor = anchor_of(line.substr(level + 1));
    const int before = seen[anchor]++;
    anchors.insert(before == 0 ? anchor : anchor + "-" + std::to_string(before));
  }
  return anchors;
}

/// Links of a document that lead nowhere, "FILE:LINE: TARGET".
std::vector<std::string> broken_links(const fs::path& file, const fs::path& top) {
  static const std::regex link(R"(\]\(([^()\s]+)\))");
  std::vector<std::string> broken;
  const std::vector<std::string> lines = prose_of(read_text_file(file.string()));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    for (std::sregex_iterator at(lines[i].begin(), lines[i].end(), link), end; at != end; ++at) {
      const std::string target = (*at)[1];
      if (target.find("://") != std::string::npos || target.starts_with("mailto:")) continue;
      const std::size_t hash = target.find('#');
      const std::string path = target.substr(0, hash);
      const fs::path linked = path.empty() ? file : file.parent_path() / path;
      const bool is_there =
          fs::exists(linked) &&
          (hash == std::string::npos || anchors_of(read_text_file(linked.string())).contains(target.substr(hash + 1)));
      if (!is_there)
        broken.push_back(fs::relative(file, top).generic_string() + ":" + std::to_string(i + 1) + ": " + target);
    }
  }
  return broken;
}

}  // namespace

TEST_CASE("links between documents lead to files and headings that are there") {
  const fs::path top = HSI4D_SOURCE_DIR;
  const std::vector<fs::path> files = documents_in(top);
  CHECK(files.size() > 10);
  std::vector<std::string> broken;
  for (const fs::path& file : files) {
    const std::vector<std::string> of_file = broken_links(file, top);
    broken.insert(broken.end(), of_file.begin(), of_file.end());
  }
  CHECK(broken == std::vector<std::string>{});
}

TEST_CASE("the check of links finds what is wrong with them") {
  const TemporaryFolder here;
  here.write("b.md", "# Two words\n## `hsi4d run`: what, why?\n# Two words\n```\n# code\n```\n");
  here.write("a.md",
             "[1](b.md) [2](b.md#two-words) [3](b.md#two-words-1) [4](b.md#hsi4d-run-what-why) [5](#here)\n# Here\n"
             "[6](c.md) [7](b.md#code)\n[8](b.md#two-words-2) [9](https://example.org/c.md) [10](#there)\n"
             "```\n[11](c.md)\n```\n");
  CHECK(broken_links("a.md", ".") ==
        std::vector<std::string>{"a.md:3: c.md", "a.md:3: b.md#code", "a.md:4: b.md#two-words-2", "a.md:4: #there"});
  CHECK(documents_in(".").size() == 2);
}

}  // namespace documents_test
