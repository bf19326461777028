// Looks at the tags of pages and pictures that the program writes.
#pragma once

#include <string>
#include <vector>

namespace hsi4d::test {

/// Why a page is not well formed: the first tag that does not fit; "" where all do. The page writes its tags as XML
/// does, so every one is closed, by its pair or by itself.
inline std::string tag_fault(const std::string& page) {
  std::vector<std::string> open;
  for (std::size_t i = 0; i < page.size();) {
    if (page[i] != '<') {
      if (page[i] == '>') return "a > outside of a tag at " + std::to_string(i);
      ++i;
      continue;
    }
    std::size_t end = i + 1;
    for (char quote = 0; end < page.size() && (quote != 0 || page[end] != '>'); ++end) {
      if (quote == 0 && page[end] == '<') return "a < inside of a tag at " + std::to_string(end);
      if (quote != 0 ? page[end] == quote : page[end] == '"') quote = quote != 0 ? 0 : '"';
    }
    if (end == page.size()) return "a tag without an end";
    const std::string tag = page.substr(i + 1, end - i - 1);
    const std::string name = tag.substr(0, tag.find_first_of(" /\n", 1));
    i = end + 1;
    if (tag.starts_with("!DOCTYPE")) continue;
    if (tag.starts_with("/")) {
      if (open.empty() || open.back() != tag.substr(1))
        return "</" + tag.substr(1) + "> closes " + (open.empty() ? "nothing" : open.back());
      open.pop_back();
    } else if (!tag.ends_with("/")) {
      open.push_back(name);
      if (name == "script" || name == "style") {  // no tags inside
        i = page.find("</" + name + ">", i);
        if (i == std::string::npos) return name + " is not closed";
      }
    }
  }
  return open.empty() ? "" : open.back() + " is not closed";
}

/// How often a text has a part.
inline std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

}  // namespace hsi4d::test
