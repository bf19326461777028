#include "core/exr_header.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

#include "core/check.h"
#include "core/text.h"

namespace hsi4d {
namespace {

/// Types of which every value has the same length.     [OpenEXR File Layout, predefined attribute types]
struct FixedType {
  std::string_view name;
  uint32_t bytes;
};

constexpr std::array<FixedType, 24> kFixedTypes = {{{"box2i", 16},
                                                    {"box2f", 16},
                                                    {"chromaticities", 32},
                                                    {"compression", 1},
                                                    {"deepImageState", 1},
                                                    {"double", 8},
                                                    {"envmap", 1},
                                                    {"float", 4},
                                                    {"int", 4},
                                                    {"keycode", 28},
                                                    {"lineOrder", 1},
                                                    {"m33f", 36},
                                                    {"m33d", 72},
                                                    {"m44f", 64},
                                                    {"m44d", 128},
                                                    {"rational", 8},
                                                    {"tiledesc", 9},
                                                    {"timecode", 8},
                                                    {"v2i", 8},
                                                    {"v2f", 8},
                                                    {"v2d", 16},
                                                    {"v3i", 12},
                                                    {"v3f", 12},
                                                    {"v3d", 24}}};

class AttributeWalk {
 public:
  AttributeWalk(std::span<const uint8_t> content, const std::string& name) : content_(content), name_(name) {}

  void check() {
    skip(4);  // magic number
    const bool many_parts = (number() & 0x1000) != 0;
    do {
      for (std::string_view attribute = text(); !attribute.empty(); attribute = text()) check_attribute(attribute);
    } while (many_parts && at_ < content_.size() && content_[at_] != 0);
  }

 private:
  void check_attribute(std::string_view attribute) {
    const std::string_view type = text();
    const uint32_t size = number();
    const size_t begin = at_;
    skip(size);
    const size_t end = at_;
    at_ = begin;
    if (const size_t length = own_length(type, size, end); length != size)
      throw DataError(name_ + ": its attribute \"" + with_escapes(attribute) + "\" has " + std::to_string(size) +
                      " bytes, which is not the length of a " + with_escapes(type));
    at_ = end;
  }

  /// What OpenEXR will read, which must not be beyond `end`.
  size_t own_length(std::string_view type, uint32_t size, size_t end) {
    const auto* const fixed = std::find_if(kFixedTypes.begin(), kFixedTypes.end(),
                                           [&](const FixedType& known) { return known.name == type; });
    if (fixed != kFixedTypes.end()) return fixed->bytes;
    const size_t begin = at_;
    if (type == "chlist") {
      while (at_ < end && !text().empty()) skip(16);
      return at_ - begin;
    }
    if (type == "preview") return size < 8 ? 8 : 8 + size_t{4} * number() * number();
    if (type == "stringvector") {
      while (at_ < end) skip(number());
      return at_ - begin;
    }
    if (type == "idmanifest") return std::max<size_t>(size, 4);  // it begins with a number
    return size;  // texts, numbers of any count, and types that nobody knows
  }

  void skip(size_t bytes) {
    if (bytes > content_.size() - at_) throw DataError(name_ + ": ends within its OpenEXR header");
    at_ += bytes;
  }
  uint32_t number() {
    skip(4);
    uint32_t value;
    std::memcpy(&value, content_.data() + at_ - 4, 4);
    return value;
  }
  std::string_view text() {
    const size_t begin = at_;
    do skip(1);
    while (content_[at_ - 1] != 0);
    return {reinterpret_cast<const char*>(content_.data()) + begin, at_ - 1 - begin};
  }

  std::span<const uint8_t> content_;
  const std::string& name_;
  size_t at_ = 0;
};

}  // namespace

void check_exr_attributes(std::span<const uint8_t> file, const std::string& name) { AttributeWalk(file, name).check(); }

}  // namespace hsi4d
